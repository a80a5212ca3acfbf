"""Programs written out in plain lines, judged by LinuxCNC's interpreter."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.linuxcnc.expansion import expand as expanding
from thermocomp.nc.linuxcnc.expansion.expand import expand
from thermocomp.nc.linuxcnc.expansion.origins import SYSTEMS
from thermocomp.nc.linuxcnc.expansion.proof import compare, compare_parameters
from thermocomp.nc.linuxcnc.rs274 import HIGHEST_TOOL, Stored, read
from thermocomp.nc.linuxcnc.rs274process import draw_controller

pytestmark = pytest.mark.usefixtures("interpreter")

NCFILES = Path("/usr/share/linuxcnc/ncfiles")
ZERO = dict.fromkeys(range(1, HIGHEST_TOOL), 0.0)
Plain = Callable[..., list[str]]


@pytest.fixture
def plain(tmp_path: Path) -> Plain:
    """Expand a text; without the header."""

    def plain(text: str, **options: Any) -> list[str]:
        path, out = tmp_path / "program.ngc", tmp_path / "plain.ngc"
        path.write_text(text, encoding="latin-1")
        out.unlink(missing_ok=True)
        expansion = expand(path, out, **options)
        lines = out.read_text(encoding="ascii").splitlines()
        assert len(lines) == len(expansion.sources)
        head = 1 + (lines[0] == "%")
        assert lines[head - 1] == "(expanded from program.ngc by thermocomp)"
        return lines[head:]

    return plain


START = "G17 G40 G80 G90 G94"


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        # a work coordinate system that is chosen, whichever is in force; none that is not
        *((f"G21 {code}\nG0 X1\nM2\n", ["G21", code, "G0 X1", "M2"]) for code in SYSTEMS.values()),
        ("G21\nG0 X1\nM2\n", ["G21", "G0 X1", "M2"]),
        # the origin of the system in force, whichever it is
        ("G21\nG0 X1 Y2\nG10 L20 P0 X0 Y0\nX3\nM2\n", ["G21", "G0 X1 Y2", "G10 L20 P0 X0 Y0", "G0 X3 Y0", "M2"]),
        ("G21 G55\nG0 X1\nG10 L2 P2 X7\nM2\n", ["G21", "G55", "G0 X1", "G10 L2 P2 X7", "M2"]),
        # an offset of nothing, twice
        ("G92.1\nG52 X0 Y0 Z0\nG21\nG0 X1\nM2\n", ["G92.1", "G21", "G0 X1", "M2"]),
        # radii, if the program says which
        ("G21 G8\nG0 X1\nM2\n", ["G8", "G21", "G0 X1", "M2"]),
        ("G21 G7\nG0 X2\nM2\n", ["G8", "G21", "G0 X1", "M2"]),
        # loops, parameters, expressions
        (
            "G21\n#1=0\no1 while [#1 LT 2]\nG0 X[#1*1.5] Y-1\n#1=[#1+1]\no1 endwhile\nM2\n",
            ["G21", "G0 X0 Y-1", "G0 X1.5 Y-1", "M2"],
        ),
        ("G21\no<s> sub\nG0 X#1\no<s> endsub\no<s> call [3]\no<s> call [4]\nM30\n", ["G21", "G0 X3", "G0 X4", "M30"]),
        # G91 from a place that is known
        ("G21\nG0 X1\nG91\nX1\nX1\nG90\nM2\n", ["G21", "G0 X1", "G0 X2", "G0 X3", "M2"]),
        # cycles
        (
            "G21 G64\nG0 Z5\nG99 G81 X1 Y2 Z-1 R1 F100\nX3\nG80\nM2\n",
            ["G21", "G64", "G0 Z5", "G61", "G0 X1 Y2 Z5", "G0 X1 Y2 Z1", "G1 X1 Y2 Z-1 F100", "G0 X1 Y2 Z1", "G64",
             "G61", "G0 X3 Y2 Z1", "G1 X3 Y2 Z-1", "G0 X3 Y2 Z1", "G64", "M2"],
        ),
        # full words, feed, spindle, coolant, stops, tools
        (
            "G21\nT2 M6\nG43\nS800 M3 M8\nG0 X1 Y1\nG1 X2 F50\nY2 F60\nM0\nM9 M5\nG4 P0.5\nM61 Q3\nG43 H1\nG49\nM30\n",
            ["G21", "T2", "M5", "M6", "G43 H2", "S800", "M3", "M8", "G0 X1 Y1", "G1 X2 Y1 F50", "G1 X2 Y2 F60", "M0",
             "M5", "M9", "G4 P0.5", "M61 Q3", "G43 H1", "G49", "M30"],
        ),
        # arcs in all planes, in turns, by radius
        (
            "G21\nG0 X0 Y0 Z0\nG2 X10 Y0 R5 F100\nG18 G3 X0 Z0 I-5 Y1\nG19 G2 Y1 Z0 J2 K0 P3\nM2\n",
            ["G21", "G0 X0 Y0 Z0", "G91.1", "G2 X10 Y0 Z0 I5 J0 F100", "G18", "G3 X0 Y1 Z0 K0 I-5", "G19",
             "G2 X0 Y1 Z0 J2 K0 P3", "M2"],
        ),
        # a place of an axis that is not known is not written
        (
            "G21\nG53 G0 Z0\nG0 X1\nG53 G1 Y-2 F9\nG0 Y1\nM2\n",
            ["G21", "G53 G0 Z0", "G0 X1", "G53 G1 Y-2 F9", "G0 Y1", "M2"],
        ),
        # home: all axes, by a known place, from wherever it stands
        (
            "G21\nG91 G28 Z0\nG90 G0 X1 Z5\nG28 Z5\nG28\nG30\nM2\n",
            ["G21", "G91 G28 Z0", "G90", "G0 X1 Z5", "G28 Z5", "G28", "G30", "M2"],
        ),
        # work coordinate systems, G92, G52, G10
        (
            "G21\nG55 G0 X1\nG92 X5\nG0 X6\nG52 Y1\nG0 X2 Y2\nG92.1\nG10 L2 P2 Z5\nG10 L20 P2 X7 Y3\nG0 X1\n"
            "G10 L2 P3 X4\nG56 G0 X1\nM2\n",
            ["G21", "G55", "G0 X1", "G92 X5", "G0 X6", "G52 Y1", "G0 X2 Y2", "G92.1", "G10 L2 P2 Z5",
             "G10 L20 P2 X7 Y3", "G0 X1 Y3", "G10 L2 P3 X4", "G56", "G0 X1", "M2"],
        ),
        # inches and a change of unit
        (
            "G20\nG0 X1\nG1 X2.00005 F10\nG21\nG1 X1\nM2\n",
            ["G20", "G0 X1", "G1 X2.00005 F10", "G21", "G1 X1 F254", "M2"],
        ),
        # feeds: inverse time becomes what it means, per revolution stays
        (
            "G21\nG0 X0\nS100 M3\nG93\nG1 X10 F2\nG95 F0.1\nG1 X0\nM2\n",
            ["G21", "G0 X0", "S100", "M3", "G94", "G1 X10 F20", "G95", "G1 X0 F0.1", "M2"],
        ),
        # threads, taps, curves
        (
            "G21 F100\nG0 X0 Y0 Z0\nS100 M3\nG33 Z-5 K1.5\nG33.1 Z-9 K2\n"
            "G5.1 X10 Y0 I5 J5\nG5 X20 Y0 I1 J1 P-1 Q1\nM2\n",
            ["G21", "G0 X0 Y0 Z0", "S100", "M3", "G33 K1.5 X0 Y0 Z-5", "G33.1 X0 Y0 Z-9 K2", "G5.1 X10 Y0 I5 J5 F100",
             "G5 X20 Y0 I1 J1 P-1 Q1", "M2"],
        ),
        # rotary axes, comments, messages, outputs, overrides, path modes
        (
            "%\nG21 (what; for [it] is)\nG0 X1 A90\nG1 A10 F30\n(MSG,look)\nM62 P1\nM67 E1 Q2.5\nM49\n"
            "G64 P0.1 Q0.2\nG61.1\nG96 D900 S20\nG97 S30\n%\n",
            ["%", "(what; for [it] is)", "G21", "G0 X1 A90", "G1 X1 A10 F30", "(MSG,look)", "M62 P1", "M67 E1 Q2.5",
             "M50 P0", "M51 P0", "G64 P0.1 Q0.2", "G61.1", "G96 D900 S20", "G97 S30", "%"],
        ),
        # the end puts states back itself
        ("G21\nG0 X1\nG55\nG18\nM2\n", ["G21", "G0 X1", "G55", "G18", "M2"]),
        # cutter radius compensation with its own diameter
        (
            "G21\nG0 X0 Y0\nG41.1 D4\nG1 X10 F100\nG1 X20\nY20\nG40 X30\nM2\n",
            ["G21", "G0 X0 Y0", "G1 X10 Y2 F100", "G1 X18 Y2", "G1 X18 Y20", "G1 X30 Y20", "M2"],
        ),
    ],
)  # fmt: skip
def test_plain_lines(plain: Plain, text: str, lines: list[str]) -> None:
    start = "%" if lines[0] == "%" else START
    found = plain(text)
    expected = [start, *lines] if start == START else [START, *lines[1:]]
    assert found == expected


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("G0 X1\nM2\n", 1, "no unit"),
        ("G21\nG91\nG0 X1\nM2\n", 3, "the end position in X.* depends on what is stored"),
        ("G21\nG0 X[#5221 + 1]\nM2\n", 2, "the end position in X.* depends"),
        ("G21\nT1 M6\nG0 Z#5403\nM2\n", 3, "the end position in Z depends"),
        ("G21\nG0 X#100\nM2\n", 2, "the end position in X.* depends"),
        ("G21\nG0 X1\no1 if [#5422 GT 0]\nG0 X2\no1 endif\nG0 X3\nM2\n", 4, "the path of execution depends"),
        ("G21\no1 if [#<_task>]\nG0 X2\no1 endif\nM2\n", 3, "the path of execution depends"),
        ("G21\nG0 X0\nG2 X10 Y0 R5 F100\nM2\n", 3, "start or end of this arc depends|refuses the program"),
        ("G21\nG1 X1 F[#5221*0 + #5222 + 1000]\nM2\n", 2, "the feed depends"),
        ("G21\nG38.2 Z-500 F10\nM2\n", 2, "it probes|refuses the program"),
        ("G21\nM66 P0 L0\nM2\n", 2, "waits for an input"),
        ("G21\nM19 R5 Q1\nM2\n", 2, "orients the spindle"),
        ("G21\nG0 X1\nm 19 (orient)\nM2\n", 3, "orients the spindle"),
        ("G21\no<turn> sub\nM19\no<turn> endsub\no<turn> call\nM2\n", 3, "orients the spindle"),
        ("G21\nG0 X[#5400/10]\nM2\n", 2, "the end position in X.* depends"),
        ("G21\nT1\nG43\n#1=#5400\nM6\nG43 H#1\nG0 Z5\nM2\n", 7, "plain lines would not do the same"),
        ("G21\nM101\nM2\n", 2, "M101 is a user-defined code"),
        ("G21\nG10 L1 P1 Z5\nM2\n", 2, "writes the tool table"),
        ("G21\n#1=5\nG10 L2 P3 X#1\nM2\n", 3, "is set by expressions"),
        ("G21\nG92 X#5221\nM2\n", 2, "shift of X by G92 depends"),
        ("G21\nG0 X1\nG28.1\nM2\n", 1, "another parameter #5161|#516"),
        ("G21\nG0 X0 Y0\nT1 M6\nG41\nG1 X10 F100\nX20\nM2\n", 5, "depends on what is stored"),
        ("G21\nG0 Z5\nG98 G81 X1 Y1 Z-1 R1 F100\nM2\n", 3, "restores the path mode"),
        ("G21 G64\nG0 Z5\nG81 X1 Y1 Z-1 R1 F100\nM2\n", 3, "G98 or G99"),
        ("G21\n(DEBUG,#5221)\nM2\n", 2, "the values in this message depend"),
        ("G21\n\nG1 X1\nM2\n", 3, "zero feed"),
        ("G21 F100\nG43 H1\nG43.2 H2\nM2\n", 3, "tool length in force depends"),
        ("G21 F100\nG0 X0 Y0\nG5.2 P1\nX5 Y5 P1\nX9 Y0 P2\nG5.3\nM2\n", 6, "splines"),
    ],
)
def test_refused(plain: Plain, tmp_path: Path, text: str, line: int, reason: str) -> None:
    with pytest.raises(ProgramError, match=reason) as caught:
        plain(text)
    assert caught.value.line == line
    assert [p.name for p in tmp_path.iterdir()] == ["program.ngc"]


def test_what_the_program_does_not_say_can_be_told(plain: Plain) -> None:
    assert plain("G0 X1\nM2\n", inch=True) == [START, "G20", "G0 X1", "M2"]
    assert plain("M101 P2\nM2\n", user_codes=True) == [START, "M101 P2", "M2"]
    cycle = "G21\nG0 Z5\nG81 X1 Y1 Z-1 R1 F100\nM2\n"
    assert plain(cycle, startup="G64 P0.01 G98")[1:] == [
        "G21 G64 P0.01 G98", "G21", "G0 Z5", "G61", "G0 X1 Y1 Z5", "G0 X1 Y1 Z1", "G1 X1 Y1 Z-1 F100", "G0 X1 Y1 Z5",
        "G64 P0.01 Q0.01", "M2",
    ]  # fmt: skip
    corner = "G21\nG0 X0 Y0\nT1 M6\nG41\nG1 X10 F100\nX20\nY20\nG40 X30\nM2\n"
    assert "G1 X18 Y2" in plain(corner, diameters={1: 4.0})
    with pytest.raises(ProgramError, match="line 5: the program cannot be written as plain lines"):
        plain(corner, diameters={2: 4.0})
    assert plain("G21\n/G0 X1\nG0 X2\nM2\n", block_delete=True) == [START, "G21", "G0 X2", "M2"]


def test_subprograms_in_folders_and_the_lines_they_come_from(tmp_path: Path) -> None:
    folder = tmp_path / "subs"
    folder.mkdir()
    (folder / "far.ngc").write_text("o<far> sub\n\n\n\nG0 Y#1\nG0 Z1\no<far> endsub\nM2\n", encoding="ascii")
    (tmp_path / "p.ngc").write_text("G21\nG0 X1\no<far> call [1]\nG0 X2\nM2\n", encoding="ascii")
    expansion = expand(tmp_path / "p.ngc", tmp_path / "out.ngc", subroutines=[folder])
    lines = expansion.path.read_text(encoding="ascii").splitlines()
    assert dict(zip(lines, expansion.sources, strict=True)) == {
        "(expanded from p.ngc by thermocomp)": 0, START: 0, "G21": 1, "G0 X1": 2, "G0 X1 Y1": 2, "G0 X1 Y1 Z1": 2,
        "G0 X2 Y1 Z1": 4, "M2": 5,
    }  # fmt: skip
    assert expansion.acts == 5


def test_the_tool_that_is_in_the_spindle_already(plain: Plain) -> None:
    """Its length is that of no tool the program names, and not none (G49): Z would go down by the whole tool."""
    moves = "G43\nG0 X0 Y0 Z5\nG1 Z-1 F100\n"
    found = plain(f"G21\n{moves}T2 M6\nG43\nG0 Z5\nG49\nT0 M6\nG43\nG0 Z6\nM2\n")
    assert found[2:4] == ["G43", "G0 X0 Y0 Z5"]
    assert [line for line in found if line.startswith("G4")] == ["G43", "G43 H2", "G49", "G49"]
    text = "G21 G90 G17 G54 G43\nS6000 M3\no1 repeat [2]\nG0 X0 Y0 Z5\nG1 Z-1 F100\nG0 Z5\no1 endrepeat\nM2\n"
    assert "G49" not in plain(text)
    with pytest.raises(ProgramError, match="stored"):
        plain("G21\nG0 X0 Y0\nG41\nG1 X10 F100\nX20\nM2\n")  # its diameter


def test_the_proof_sees_a_tool_length_that_was_dropped(tmp_path: Path) -> None:
    one, two = tmp_path / "one.ngc", tmp_path / "two.ngc"
    one.write_text("G21 G43\nG0 X0 Y0 Z5\nM2\n", encoding="ascii")
    two.write_text("G21 G49\nG0 X0 Y0 Z5\nM2\n", encoding="ascii")
    stored = Stored(lengths={7: 80.0}, spindle=7)
    with pytest.raises(ProgramError, match="the plain lines would not do the same"):
        compare(read(one, stored), read(two, stored))


def test_orienting_in_a_subprogram_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "turn.ngc").write_text("o<turn> sub\n\nM19\no<turn> endsub\nM2\n", encoding="ascii")
    (tmp_path / "p.ngc").write_text("G21\no<turn> call\nM2\n", encoding="ascii")
    with pytest.raises(ProgramError, match=r"M19.*line 3 of turn\.ngc"):
        expand(tmp_path / "p.ngc", tmp_path / "out.ngc")


def test_m19_in_remarks_and_in_lines_left_out_is_none(plain: Plain) -> None:
    text = "G21\n(M19)\n#<m19>=5 ; M19\n/M19\nG0 X1\nM2\n"
    assert plain(text, block_delete=True)[-2:] == ["G0 X1", "M2"]


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text("M2\n", encoding="ascii")
    with pytest.raises(InputError, match="exists already"):
        expand(tmp_path / "p.ngc", tmp_path / "p.ngc")
    with pytest.raises(InputError, match="is not a file"):
        expand(tmp_path / "q.ngc", tmp_path / "out.ngc")
    assert [p.name for p in tmp_path.iterdir()] == ["p.ngc"]


BASE = "G21 G17\nT1 M6\nS500 M3\nM8\nG0 X0 Y0 Z5\nG1 X10 F100\nG2 X20 Y0 I5 J0\nG4 P1\nM2\n"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("X10 F", "X10.000002 F"),
        ("F100", "F100.001"),
        ("M3", "M4"),
        ("S500", "S501"),
        ("M8\n", ""),
        ("T1", "T2"),
        ("G0 X0 Y0 Z5", "G1 X0 Y0 Z5 F100"),
        ("G2 X", "G3 X"),
        ("I5 J0\n", "I5 J0 P2\n"),
        ("I5 J0", "I5 J0.000002"),
        ("P1", "P1.1"),
        ("G4 P1\n", ""),
        ("G4 P1\n", "G4 P1\nM0\n"),
        ("M2", "G0 Z1\nM2"),
        ("G4 P1", "G61\nG4 P1"),
    ],
)
def test_the_proof_sees_every_difference(tmp_path: Path, old: str, new: str) -> None:
    one, two = tmp_path / "one.ngc", tmp_path / "two.ngc"
    assert old in BASE
    one.write_text(BASE, encoding="ascii")
    two.write_text(BASE.replace(old, new), encoding="ascii")
    with pytest.raises(ProgramError, match="the plain lines would not do the same"):
        compare(read(one), read(two))


def test_the_proof_tells_a_full_circle_from_none(tmp_path: Path) -> None:
    one, two = tmp_path / "one.ngc", tmp_path / "two.ngc"
    text = "G21\nG0 X0 Y0 Z0\nG3 X0 Y{} I5 J0 F100\nM2\n"
    one.write_text(text.format("-0.0000004"), encoding="ascii")
    two.write_text(text.format("0"), encoding="ascii")
    with pytest.raises(ProgramError, match="line 3: the plain lines would not do the same as the program: arc"):
        compare(read(one), read(two))
    one.write_text(text.format("0"), encoding="ascii")
    assert compare(read(one), read(two)) == 2


def test_the_proof_looks_at_what_is_left_in_the_controller() -> None:
    compare_parameters({5221: 1.0, 100: 5.0, 5162: 0.0}, {5221: 1.0})
    compare_parameters({5210: 1.0}, {})
    with pytest.raises(ProgramError, match="a different value in parameter #5210"):
        compare_parameters({5210: 1.0, 5211: 2.0}, {5211: 2.0})
    with pytest.raises(ProgramError, match="a different value in parameter #5221"):
        compare_parameters({5221: 1.0}, {5221: 1.00001})


@pytest.mark.parametrize(
    ("name", "acts"), [("cds.ngc", 250), ("daisy.ngc", 50), ("lathe_pawn.ngc", 100), ("flowsnake.ngc", 3000)]
)
def test_programs_of_linuxcnc(tmp_path: Path, name: str, acts: int) -> None:
    if not (NCFILES / name).is_file():
        pytest.skip(f"{NCFILES / name} is not here: it comes with the Debian package linuxcnc-uspace")
    expansion = expand(NCFILES / name, tmp_path / name, inch=False, startup="G64 G98", diameters=ZERO)
    assert expansion.acts >= acts
    code = re.sub(r"\([^)]*\)", "", expansion.path.read_text(encoding="ascii"))
    assert not re.search(r"#|\[|\bO|N\d|G91(?!\.1)|G8[1-9]|G7[36]|G4[12]|G93", code)


# --- random programs ---
number = st.integers(-40, 40).map(lambda n: f"{n / 8:.3f}")
feed = st.integers(1, 500)
block = st.one_of(
    st.builds("G90 G0 X{} Y{} Z{}".format, number, number, number),
    st.builds("G90 G1 X{} Y{} F{}".format, number, number, feed),
    st.builds("G91 G1 X{} Z{} F{}\nG90".format, number, number, feed),
    st.builds("G17 G91 G2 X{0} Y{0} I{0} J0 F90\nG90".format, st.integers(1, 9)),
    st.builds("G18 G91 G3 X{0} Z{0} I{0} K0 Y{1} F90\nG90 G17".format, st.integers(1, 9), number),
    st.builds("G91 G98 G81 X{} Y{} Z-2 R-1 L2 F50\nG80 G90".format, number, number),
    st.builds("#1=[{}]\nG0 X[#1*2] Y[#1-1]".format, number),
    st.builds("{0}\nG0 X1 Y1 Z1".format, st.sampled_from(["G54", "G55", "G20", "G21", "G59.3", "G43 H3", "G49"])),
    st.builds("G92 X{} Y{}".format, number, number),
    st.builds("G52 X{0} Y{0} Z0\nG0 X0 Y0 Z0".format, number),
    st.builds("G10 L2 P1 X{} R{}\nG54 G0 X0 Y0 Z5".format, number, st.integers(-90, 90)),
    st.sampled_from(["M3 S500", "M5", "M8", "M9", "G4 P0.5", "M0", "G53 G0 Z0\nG0 Z5", "G28\nG0 X0 Y0 Z5", "G64 P0.1"]),
)


@pytest.mark.long
@given(st.lists(block, min_size=5, max_size=40))
@settings(
    max_examples=8,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_random_programs_expand_and_stay_as_they_are_when_expanded_again(plain: Plain, blocks: list[str]) -> None:
    first = plain("G21 G64\nG0 X0 Y0 Z5\n" + "\n".join(blocks) + "\nM2\n")
    assert plain("\n".join(first[1:]) + "\n") == first


def test_a_loop_that_writes_too_many_lines_is_refused(plain: Plain, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expanding, "MOST", 5000)
    with pytest.raises(
        ProgramError,
        match=r"line [2-5]: more than 5,000 plain lines would be written: check the program for an endless loop",
    ):
        plain("G21\no1 repeat [4000]\nG0 X1\nX0\no1 endrepeat\nM2\n")


def test_the_radii_of_a_subprogram_are_refused(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21\no<sub> call\nM2\n")
    (tmp_path / "sub.ngc").write_text("o<sub> sub\nG7 G0 X2\no<sub> endsub\nM2\n")
    with pytest.raises(
        ProgramError, match=r"a subprogram has G7 or G8 .*write G8 at the start of the program \(line 2 of sub.ngc\)"
    ):
        expand(tmp_path / "part.ngc", tmp_path / "out.ngc")


def test_what_is_written_stands_in_its_system_whatever_is_in_force(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21 G54 G8\n#1=5\nG0 X[#1] Y0 Z0\nM2\n")
    expand(tmp_path / "part.ngc", tmp_path / "out.ngc")
    for startup in ("G64 G98", "G7 G64 G98"):
        stored = replace(draw_controller(7, startup), system=2)
        moves = [
            [call.machine for call in read(tmp_path / name, stored) if call.kind == "rapid" and call.line]
            for name in ("part.ngc", "out.ngc")
        ]
        assert moves[0] == moves[1]
        assert moves[0]
