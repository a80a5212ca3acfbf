"""What is refused: always with the line, what was found, and what to do."""

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle_run import Oracle
from test_interpret import needs_linuxcnc, run

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Setup

START = "G21 G90 F100 S100\n"


@pytest.fixture(scope="module")
def oracle() -> Iterator[Oracle]:
    with Oracle() as running:
        yield running


#: refused by LinuxCNC too
WRONG = [
    ("X1", "no motion code"),
    ("G80 X1", "axis words with G80"),
    ("G0 G1 X1", "exclude each other"),
    ("G0 G92 X1", "both would use the axis words"),
    ("G4", "G4 needs P"),
    ("G4 P-1", "negative"),
    ("G0 X1 R1", "no code that uses it"),
    ("G0 X1 H1", "no code that uses it"),
    ("G1 X1 P1", "no code that uses it"),
    ("G0 X1 X2", "twice"),
    ("G2 X1", "needs its centre"),
    ("G2 X1 R1 I1", "needs its centre"),
    ("G2 X1 I0.5 K1", "the centre is in I and J"),
    ("G2 X0 R1", "ends at its start point"),
    ("G2 X2 R0.9", "too small"),
    ("G2 X2 I1.03", "check centre and end"),
    ("G2 X0 Y0 I0.001", "the radius of the arc is zero"),
    ("G2 X2 I1 P0", "whole number"),
    ("G90.1\nG2 X2 I1", "G90.1 needs"),
    ("G91 G53 G0 X1", "G91"),
    ("G2 X2 I1\nG53 X1", "needs G0 or G1"),
    ("G81 X1 Z-1", "needs R"),
    ("G82 X1 Z-1 R1", "needs P"),
    ("G83 X1 Z-1 R1 Q0", "above 0"),
    ("G81 X1 Z2 R1", "below the bottom"),
    ("G81 X1 Z-1 R1 L0", "whole number"),
    ("G81 X1 Z-1 R1 A1", "rotary"),
    ("G81 X1 Z-1 R1\nR2", "no code that uses it"),
    ("G84 X1 Z-1 R1", "spindle is stopped"),
    ("M4\nG84 X1 Z-1 R1", "the wrong direction"),
    ("G93 G1 X1 F1\nX2", "needs F"),
    ("G93 F1 G81 X1 Z-1 R1", "G93"),
    ("G94\nG1 X1", "no F is in force"),
    ("G1 X1 F0", "no F is in force"),
    ("G33 Z-1", "needs K"),
    ("M3\nG33 Z-1 K1 F1", "remove F"),
    ("G33 Z-1 K1", "spindle is stopped"),
    ("G38.2 X0", "ends where it starts"),
    ("G5 X1", "needs P and Q"),
    ("G10 L2 X1", "G10 L2"),
    ("G10 P1 X1", "is not supported"),
    ("G10 L2 P11 X1", "9 work coordinate systems"),
    ("G10 L20 P1 X1 R5", "only"),
    ("G92", "without axis words"),
    ("G41 D1\nG92 X1", "cutter compensation"),
    ("G41 D1\nG54", "cutter compensation"),
    ("G41 D1\nG18", "cutter compensation"),
    ("G41 D1\nT1\nM6", "cutter compensation"),
    ("G41 D1\nG28", "cutter compensation"),
    ("G41 D1\nG42 D1", "cutter compensation"),
    ("G41 D1\nG38.2 X5", "cutter compensation"),
    ("M3 M4", "exclude each other"),
    ("M61", "needs Q"),
    ("T1.5", "whole number"),
    ("F-1", "negative"),
    ("S-1", "negative"),
    ("G54.1 P1", "unknown"),
    ("G68", "unknown"),
    ("G0.5 X1", "unknown"),
    ("M29", "unknown"),
    ("M3 M8 M6 T1 M0 M48", "more than 4 M codes"),
]

#: not followed for certain, whatever LinuxCNC does
NOT_FOLLOWED = [
    ("G0 X#7", "unknown"),
    ("M98 P100", "subprogram"),
    ("M99", "subprogram"),
    (
        "M101",
        "user-defined), so its effect is unknown; if it does not affect axes and spindle: --harmless M101",
    ),
    ("M70", "M70"),
    ("G28.1", "G28"),
    ("G5.2 X1 Y1 L3 P1", "NURBS"),
    ("G76 P1 Z-1 I-1 J1 K1", "--expand"),
    ("G88 X1 Z-1 R1 P1", "by hand"),
    ("G96 S100 D500", "G97"),
    ("G0 U1", "U V W"),
    ("G0 @1 ^30", "polar"),
    ("o100 if [1]", "--expand"),
    ("o<a> call", "--expand"),
    ("G18 M3 G84 X1 Y-1 R1", "G17"),
    ("G10 L2 P1 R30\nG18 G2 X2 I1", "rotated"),
    ("G43 H1\nG20\nG49", "G49 before the unit"),
    ("G81 X1 Z-1 R1\nG18\nG81 X1 Y-1 R1 Z0", "G80 before"),
    ("/G91", "--block-delete"),
    ("G91 G0\n/X1", "--block-delete"),
    ("G0\n/G91 X1", "--block-delete"),
    ("/G92 X1", "--block-delete"),
    ("/M3", "--block-delete"),
    ("/M30", "--block-delete"),
    ("/#1=5\nG0 X#1", "--block-delete"),
    ("G81 X1 Z-1 R1\n/X2", "--block-delete"),
]


@pytest.mark.parametrize(("text", "reason"), WRONG + NOT_FOLLOWED)
def test_refused_with_line_and_reason(text: str, reason: str) -> None:
    with pytest.raises(ProgramError) as caught:
        run(START + text + "\n")
    assert reason in caught.value.reason
    assert caught.value.line == 1 + len(text.splitlines())


@needs_linuxcnc
@pytest.mark.parametrize("text", [text for text, _ in WRONG])
def test_linuxcnc_refuses_it_too(oracle: Oracle, text: str) -> None:
    assert oracle.run(START + text + "\nM2\n").error


@needs_linuxcnc
@pytest.mark.parametrize(
    ("arc", "right", "wrong"),
    [
        ("G2 X{} I1", 2.02828, 2.02829),
        ("G2 X{} I100", 200.10010, 200.10011),
        ("G2 X{} I10000", 20002.8284, 20002.8285),
        ("G2 X{} R1", 2.002539, 2.002541),
        ("G20\nG2 X{} I1", 2.002828, 2.002829),
    ],
)
def test_radii_are_judged_as_linuxcnc_does(oracle: Oracle, arc: str, right: float, wrong: float) -> None:
    text = START + arc + "\nM2\n"
    assert not oracle.run(text.format(right)).error
    run(text.format(right))
    assert oracle.run(text.format(wrong)).error
    with pytest.raises(ProgramError):
        run(text.format(wrong))


@pytest.mark.parametrize(
    "text", ["G0 X1", "G92 X1", "F100", "G10 L2 P1 X1", "G28 Z1", "G0 X0\nG2 X0 I1", "G43.1 Z1", "G20 F10"]
)
def test_the_unit_has_to_be_told(text: str) -> None:
    with pytest.raises(ProgramError, match=r"G20 or G21|the unit in force before"):
        run(text, Setup())
    run("G21\nF1\nG0\n" + text)


def test_nothing_is_needed_before_lengths_that_are_none() -> None:
    blocks = run("T1 M6\nG4 P1\nG91 G28 Z0\nM8\nG21 G90 G0 X1\n", Setup())
    assert blocks[-1].end[0] == 1.0


def test_a_speed_that_was_never_told() -> None:
    with pytest.raises(ProgramError, match="without a spindle speed"):
        run("M3")
    assert run("S0 M3")[0].speed == 0.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("G16", "polar"),
        ("G51 X1", "scaling"),
        ("G51.1 X0", "mirroring"),
        ("G43.4 H1", "tool centre point"),
        ("G12.1", "polar interpolation"),
        ("G7.1 C10", "cylindrical"),
        ("G66 P9000", "G65 on every line"),
        ("G87 X1 Z-1 R1 Q1", "shifts the tool by a parameter"),
        ("M198 P1", "subprogram"),
        ("G28", "without axis words"),
        ("G10 L50", "is not supported"),
        ("G52 X1\nG92 X2", "G52 and G92"),
        ("M10", "if it does not affect axes and spindle: --harmless M10"),
        ("G999", "not a known code (fanuc), so its effect is unknown; replace it with supported codes"),
        ("T0101", "a lathe program, in which X is a diameter"),
        ("T1212\nG0 X1.\nG1 X2. F100", "T1212 on an earlier line, and no M6: this is a lathe program"),
        ("G50 S2500", "a lathe program"),
        ("G0 X1. Z1.\nG50 X200. Z100.", "a lathe program"),
        ("G54 P1", "write G54.1 P1"),
        ("G64 G54 P1", "write G54.1 P1"),
        (
            "G17 G54 G64 P0.01",
            "LinuxCNC's G64 has P, a Fanuc's has none: remove P, or give --controller linuxcnc",
        ),
        ("G2 X1. Y0. I0.5 P2", "LinuxCNC's G2 has P"),
        ("M19 R90.", "M19 with R90. orients the spindle in a way that the machine builder has defined"),
        ("M19 P90", "revise the program without P90, and put P90 back after M19 in the revised program"),
        ("G107 C10", "cylindrical"),
        ("G0 X1.\nG5.1 Q1 X5.", "on a separate line"),
        ("G0 G8 P1 X5.", "on a separate line"),
        ("G99 G81 X1. Z-1. R1. F100 K0", "X with K0"),
        ("G0 X2. Y0\nG99 G81 X1. Z-1. R1. F100 L0", "X with L0"),
        ("G0 Z5.\nG91 G81 X1. Z-1. R-2. F100\nG90 G82 X1. Z-1. R2.", "G90 while G81 is in force"),
        ("G0 Z5.\nG81 X1. Z-1. R2. F100\nG91 G28 Z0", "G91 while G81 is in force"),
        ("G0 Z5.\nG98 G81 X1. Z-1. R6. F100", "R is 1 mm above the initial level"),
        ("G0 Z5.\nG91 G81 X1. Z-1. R2. F100", "R is 2 mm above the initial level"),
        ("G2 X1. Y0. R5. F100\nG81 X1. Z-3. R-2.\nG80 Z5.", "neither G0 nor G1"),
        ("G92.1 X0", "G92.1 without X, Y and Z"),
        ("G12 I5. D1 F100", "milling cycles and hole patterns"),
        ("G70 I5. J15. L12", "milling cycles and hole patterns"),
        ("G154", "G154 needs P"),
        ("G0 G52 X1.", "both would use the axis words"),
        ("G18 G68 X0 Z0 R30.", "G68 in G18"),
        ("G68 X0 R30.", "G68 without Y"),
        ("G68 X0 Y0", "the angle"),
        ("G68 X0 Y0 Z0 R10.", "G68 with Z"),
        ("G68 X0 Y0 I1. J0 K0 R10.", "no code that uses it"),
        ("G91 G68 X0 Y0 R30.", "G68 in G91"),
        ("G41 D1\nG68 X0 Y0 R30.", "G40 before it"),
        ("G0 X0\nG68 X0 Y0 R30.\nX5.", "to X and Y in G90"),
        ("G0 X0\nG68 X0 Y0 R30.\nG91 X5. Y5.", "to X and Y in G90"),
        ("G0 X0\nG68 X0 Y0 R30.\nG81 Z-5. R-1. F100", "to X and Y in G90"),
        ("G0 X0\nG68 X0 Y0 R30.\nX1. Y1.\nG69\nY5.", "first move after G69"),
        ("G68 X0 Y0 R30.\nG68 X0 Y0 R60.", "G69 between"),
        ("G68 X0 Y0 R30.\nG55", "G69 before"),
        ("G68 X0 Y0 R30.\nG52 X5.", "G69 before"),
        ("G68 X0 Y0 R30.\nG91 G28 Z0", "G69 before"),
        ("G68 X0 Y0 R30.\nG18", "G69 before"),
        ("G81 X1. Z-1. R1. F100\nG80\nX2.", "no motion code is in force"),
    ],
)
def test_fanuc_refusals(text: str, reason: str) -> None:
    with pytest.raises(ProgramError) as caught:
        run("G21 G90\n" + text + "\n", Setup("fanuc", inch=False))
    assert reason in caught.value.reason
    assert "--expand" not in caught.value.reason  # which is LinuxCNC's
    assert caught.value.line == 2 + text.count("\n")


@pytest.mark.parametrize("text", ["G30 P2 Z0.", "G91 G30 Z0. P2", "G54 P3", "G49 H0", "G0 X1. E2."])
def test_a_letter_that_linuxcnc_has_no_use_for_may_be_a_fanucs(text: str) -> None:
    with pytest.raises(ProgramError, match=r"no code that uses it in LinuxCNC.*give --controller fanuc if"):
        run(START + text + "\n")


@pytest.mark.parametrize("text", ["IF [#1 EQ 1] GOTO 10", "WHILE [#1 LT 2] DO1", "M98 P1000", "M97 P10", "G65 P9000"])
def test_fanuc_refusals_that_expand_helps_with(text: str) -> None:
    with pytest.raises(ProgramError, match=r"^line 2: .*--expand writes"):
        run(f"G21 G90\n{text}\n", Setup("fanuc", inch=False))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("G4 X2000", "G4 X2000 has no decimal point"),
        ("G4 P600.", "P600. for a dwell: with a decimal point it is in seconds for a Haas"),
        ("G4 P600.", "write G4 X600. for seconds, or P without a decimal point for milliseconds"),
        ("G0 Z5.\nG82 X1. Z-1. R1. P2. F100.", "P2. for a dwell"),
    ],
)
def test_dwells_that_controls_read_in_two_ways(text: str, reason: str) -> None:
    with pytest.raises(ProgramError) as caught:
        run(f"G21 G90\n{text}\n", Setup("fanuc", inch=False, integers="refuse"))
    assert reason in caught.value.reason
    assert run("G4 X2.\n", Setup("fanuc", integers="refuse"))[0].pause == 2.0
    assert run("G4 X2000\n", Setup("fanuc", integers="least"))[0].pause == 2.0
    assert run("G4 P600\n", Setup("fanuc", integers="refuse"))[0].pause == 0.6


def test_integers_can_be_refused() -> None:
    setup = Setup("fanuc", inch=False, integers="refuse")
    with pytest.raises(ProgramError, match="no decimal point"):
        run("G0 X10", setup)
    assert run("G0 X10. Y0", setup)[0].end[0] == 10.0


def test_numbers_that_are_no_lengths_need_no_decimal_point() -> None:
    setup = Setup("fanuc", inch=False, integers="refuse")
    text = "G05.1 Q1 R3\nG0 X1.\nG05.1 Q1 X0 Y0 Z0\nG05 P10000\nG08 P1\nG187 P2 E0.01\nG61.1\nG64\nG43 H1 Z5.\n"
    blocks = run(text + "G99 G81 X1. Z-1. R1. F100 K3\nX2. L2\nG80\n", setup)
    assert [len(b.moves) for b in blocks] == [0, 1, 0, 0, 0, 0, 0, 0, 1, 13, 9, 0]
    assert blocks[2].end[0] == 1.0
    for wrong in ("G83 X1. Z-1. R1. Q1 F100", "G81 X1. Z-1. R1 F100", "G18 G2 X1. Z0 I0.5 K1 F100"):
        with pytest.raises(ProgramError, match="no decimal point"):
            run(wrong, setup)


@pytest.mark.parametrize("controller", ["linuxcnc", "fanuc"])
def test_codes_of_the_maker_that_move_nothing(controller: str) -> None:
    setup = Setup(controller, inch=False, integers="refuse", harmless=frozenset({88, 101, 6}))  # type: ignore[arg-type]
    blocks = run("G0 X1.\nM88 M101\nM101 P1 Q2\nX2. M88\nT1 M6\n", setup)
    assert [(b.kind, b.end[0]) for b in blocks[:4]] == [("line", 1.0), ("none", 1.0), ("none", 1.0), ("line", 2.0)]
    assert blocks[1].codes == ("M88", "M101")
    assert blocks[4].tool_change == 1  # what is known stays what it is
    for text in ("M89", "M88 R1", "M188"):
        with pytest.raises(ProgramError, match=r"harmless M|no code that uses it"):
            run(text, setup)


@settings(max_examples=400, deadline=None)
@given(
    st.lists(
        st.lists(
            st.one_of(
                st.sampled_from(
                    [
                        "G0",
                        "G1",
                        "G2",
                        "G3",
                        "G17",
                        "G18",
                        "G19",
                        "G20",
                        "G21",
                        "G28",
                        "G43",
                        "G43.1",
                        "G5",
                        "G5.1",
                        "G10",
                    ]
                ),
                st.sampled_from(
                    ["G52", "G53", "G55", "G81", "G83", "G87", "G92", "G90", "G91", "G93", "G95", "G33.1", "M6"]
                ),
                st.builds(
                    "{}{}".format,
                    st.sampled_from("ABCDEFHIJKLPQRSTUVWXYZ/#"),
                    st.sampled_from(["0", "1", "-1", "2.5", "[1/0]", "#5", "1e5", ""]),
                ),
                st.text(max_size=4),
            ),
            max_size=7,
        ).map(" ".join),
        max_size=6,
    ),
    st.sampled_from(["linuxcnc", "fanuc"]),
)
def test_rubbish_is_refused_and_never_crashes(lines: list[str], controller: str) -> None:
    setup = Setup(controller, inch=False)  # type: ignore[arg-type]
    try:
        run("F100 S100 M3\n" + "\n".join(lines) + "\n", setup)
    except ProgramError as error:
        assert error.reason  # noqa: PT017
