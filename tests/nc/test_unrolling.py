"""Subprograms, macros and loops of a Fanuc written out, judged by LinuxCNC running the equal program with O-words."""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
from oracle_run import Oracle
from test_interpret import needs_linuxcnc

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.expansion import unroll as unroll_module
from thermocomp.nc.expansion.unroll import unroll
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines, split_lines

FANUC = Setup("fanuc", inch=False, integers="refuse", least=1e-6)
BEGIN = "G21 G90 G17 F500\nG0 X0. Y0. Z20.\n"
Place = tuple[float, ...]


@pytest.fixture(scope="module")
def oracle() -> Iterator[Oracle]:
    with Oracle() as running:
        yield running


def written(text: str, setup: Setup = FANUC) -> list[tuple[str, int]]:
    return list(unroll(split_lines(text), setup))


def places(text: str) -> list[Place]:
    """Return where the follower goes in what comes out."""
    lines = read_lines((line for line, _ in written(text)), "fanuc")
    return [m.end for b in follow_program(lines, FANUC) for m in b.moves if math.dist(m.start, m.end) > 1e-9 or m.arc]


def theirs(oracle: Oracle, text: str) -> list[Place]:
    ran = oracle.run(text)
    assert not ran.error, ran
    found: list[Place] = []
    at = (0.0, 0.0, 0.0)
    for _, kind, values in ran.out:
        x, y, z = values[:3] if kind in ("rapid", "feed", "arc") else at
        if kind == "arc" or math.dist(at, (x, y, z)) > 1e-9:
            found.append((x, y, z))
        at = (x, y, z)
    return found


#: what it is; the main program and what it calls, for a Fanuc; the same for LinuxCNC, subprograms first
EQUAL = [
    (
        "subprogram, called twice, and with L",
        "M98 P1000\nG0 X50.\nM98 P1000 L3\nM30\nO1000\nG91\nG1 Z-2.\nX5.\nG90\nM99\n",
        "o1000 sub\nG91\nG1 Z-2\nX5\nG90\no1000 endsub\n",
        "o1000 call\nG0 X50\no1000 call\no1000 call\no1000 call\nM2\n",
    ),
    (
        "repeats in front of the number, a move beside the call",
        "X5. Y5. M98 P31000\nM98 P20007\nM30\nO1000\nG91 X1. Y-1.\nG90 M99\nO0007 (SEVEN)\n"
        "G91 Z-1. (DOWN)\nG90\nN9 M99\n",
        "o1000 sub\nG91 X1 Y-1\nG90\no1000 endsub\no7 sub\nG91 Z-1\nG90\no7 endsub\n",
        "X5 Y5\no1 repeat [3]\no1000 call\no1 endrepeat\no7 call\no7 call\nM2\n",
    ),
    (
        "subprograms four deep",
        "M98 P10\nM30\nO10\nX1.\nM98 P20 L2\nM99\nO20\nY1.\nM98 P30\nY2.\nM99\nO30\nM98 P40 K2\n"
        "M99\nO40\nG91 Z1.\nG90 M99\n",
        "o40 sub\nG91 Z1\nG90\no40 endsub\no30 sub\no40 call\no40 call\no30 endsub\n"
        "o20 sub\nY1\no30 call\nY2\no20 endsub\no10 sub\nX1\no20 call\no20 call\no10 endsub\n",
        "o10 call\nM2\n",
    ),
    (
        "rows of holes in two loops",
        "#1=0\nWHILE[#1LT3]DO1\n#2=0\nWHILE [#2 LT 4] DO2\nG0 X[#2*10.] Y[#1*12.5]\nG1 Z-[1+#1/2]\n"
        "G0 Z5.\n#2=#2+1\nEND2\n"
        "#1=#1+1\nEND1\nM30\n",
        "",
        "#1=0\no1 while [#1 LT 3]\n#2=0\no2 while [#2 LT 4]\nG0 X[#2*10] Y[#1*12.5]\nG1 Z-[1+#1/2]\nG0 Z5\n#2=[#2+1]\n"
        "o2 endwhile\n#1=[#1+1]\no1 endwhile\nM2\n",
    ),
    (
        "branches",
        "#1=5\nN10 #1=#1-1\nIF[#1EQ3]GOTO30\nG1 X#1\nIF[#1GT0]GOTO10\nGOTO40\nN30 Y#1\nGOTO10\n"
        "N40 IF[#1LT0]THEN#1=9\nZ#1\nM30\n",
        "",
        "#1=4\no1 while [#1 GE 0]\no2 if [#1 EQ 3]\nY#1\no2 else\nG1 X#1\no2 endif\n#1=[#1-1]\no1 endwhile\nZ0\nM2\n",
    ),
    (
        "ring of holes by a macro",
        "G65 P9100 X10. Y20. I25. H6 A15.\nG65 P9100 L2 X-5. Y0. I8. H3\nM30\nO9100 (RING)\n"
        "IF[#1EQ#0]THEN#1=90\n#10=0\n"
        "WHILE[#10LT#11]DO1\n#12=#1+360*#10/#11\nG0 X[#24+#4*COS[#12]] Y[#25+#4*SIN[#12]]\nG1 Z-3.\nG0 Z5.\n#10=#10+1\n"
        "END1\nM99\n",
        "o9100 sub\n#10=0\no1 while [#10 LT #5]\n#12=[#4+360*#10/#5]\nG0 X[#1+#3*COS[#12]] Y[#2+#3*SIN[#12]]\nG1 Z-3\n"
        "G0 Z5\n#10=[#10+1]\no1 endwhile\no9100 endsub\n",
        "o9100 call [10] [20] [25] [15] [6]\no9100 call [-5] [0] [8] [90] [3]\no9100 call [-5] [0] [8] [90] [3]\nM2\n",
    ),
    (
        "words whose argument is not given are left out",
        "G65 P1 X3. Z4.\nG65 P1 Y2.\nM30\nO1\nG0 X#24 Y#25 Z#26\nM99\n",
        "",
        "G0 X3 Z4\nG0 Y2\nM2\n",
    ),
    (
        "macros have variables of their own, and share the common ones",
        "#1=1\n#100=5\nG65 P1 A7.\nX#1 Y#100\nM30\nO1\nX#1\n#1=9\n#100=#100+1\nG65 P2 B#1\nX#1\n"
        "M99\nO2\nY#2\n#100=#100*2\nM99\n",
        "",
        "X7\nY9\nX9\nX1 Y12\nM2\n",
    ),
    (
        "a subprogram shares all variables",
        "#1=1\nM98 P1 L2\nX#1\nM30\nO1\n#1=#1+1\nY#1\nM99\n",
        "o1 sub\n#101=[#101+1]\nY#101\no1 endsub\n",
        "#101=1\no1 call\no1 call\nX#101\nM2\n",
    ),
    (
        "functions and brackets",
        "#1=SQRT[2]\n#2=ATAN[1]/[2]\nX#1 Y[#2/10]\n"
        "X[SIN[30]+COS[60]*TAN[45]] Y[FIX[2.7]+FUP[2.2]]\nX[[7 MOD 4]+ABS[-2.5]]\nM30\n",
        "",
        "#1=SQRT[2]\n#2=ATAN[1]/[2]\nX#1 Y[#2/10]\n"
        "X[SIN[30]+COS[60]*TAN[45]] Y[FIX[2.7]+FUP[2.2]]\nX[[7 MOD 4]+ABS[-2.5]]\nM2\n",
    ),
    (
        "deeper and deeper arcs",
        "#5=0\nN1 #5=#5-1.5\nG1 Z#5\nG2 I[10+#5]\nG3 X[#5] Y0. R#105\nX0. R[20]\nIF[#5GT-6]GOTO1\nM30\n".replace(
            "#105", "[5-#5]"
        ),
        "",
        "#5=0\no1 do\n#5=[#5-1.5]\nG1 Z#5\nG2 I[10+#5]\nG3 X[#5] Y0 R[5-#5]\nX0 R[20]\no1 while [#5 GT -6]\nM2\n",
    ),
    (
        "M99 P continues elsewhere",
        "X1.\nM98 P1\nX2.\nN50 X3.\nM30\nO1\nY1.\nM99 P50\n",
        "",
        "X1\nY1\nX3\nM2\n",
    ),
    (
        "Haas: M97 calls a line",
        "X1.\nM97 P100 L2\nX2.\nM30\nN100 G91 Y1.\nG90\nM99\n",
        "o1 sub\nG91 Y1\nG90\no1 endsub\n",
        "X1\no1 call\no1 call\nX2\nM2\n",
    ),
]


@needs_linuxcnc
@pytest.mark.parametrize(("fanuc", "subs", "linuxcnc"), [e[1:] for e in EQUAL], ids=[e[0] for e in EQUAL])
def test_what_comes_out_moves_as_linuxcnc_does(oracle: Oracle, fanuc: str, subs: str, linuxcnc: str) -> None:
    mine, wanted = places(f"%\nO1234\n{BEGIN}{fanuc}%\n"), theirs(oracle, subs + BEGIN + linuxcnc)
    assert len(mine) == len(wanted) >= 3
    assert all(math.dist(a, b) < 2e-6 for a, b in zip(mine, wanted, strict=True))


def test_a_plain_program_comes_out_unchanged() -> None:
    text = (
        "leader (#1 M98)\n%\nO1 (A; GOTO 5)\n(M98 P5)\nN10 g0 x 1 . 5\n\n/G1 X5. F100\nM30\n%\nO2 M99\n"
        "M98 P7\nafter the end [\n"
    )
    assert written(text) == [(line, n) for n, line in enumerate(split_lines(text), 1)]
    text = "G0 X#5 (\nM98 P1\n"  # what cannot be read is for the follower to refuse
    assert written("G0 X1. (\n\r\n")[0] == ("G0 X1. (\n", 1)


def test_every_line_tells_where_it_comes_from() -> None:
    text = "%\nO1\nG0 X1.\nM98 P2 (CALL)\nM98 P2 X5.\n#1=3\nN7 X#1 (C) Y1.\nM30\nO2\nY5. (HERE)\nG0 M99\n%\n"
    assert written(text) == [
        ("%\n", 1),
        ("O1\n", 2),
        ("G0 X1.\n", 3),
        ("Y5. (HERE)\n", 10),
        ("G0 \n", 11),
        ("  X5.\n", 5),
        ("Y5. (HERE)\n", 10),
        ("G0 \n", 11),
        ("N7 X3. (C) Y1.\n", 7),
        ("M30\n", 8),
        ("%\n", 12),
    ]


@pytest.mark.parametrize(
    ("words", "becomes"),
    [
        ("X#1 Y-#1", "X10.667 Y-10.667"),
        ("X[#1/1000000]", "X0."),
        ("A#1 F#1", "A10.667 F10.667"),
        ("T#2 M6", "T3 M6"),
        ("G#2 X1. R5.", "G3 X1. R5."),
        ("G[54+0.1] P#2", "G54.1 P3"),
        ("G81 Z-1. R1. K#2", "G81 Z-1. R1. K3"),
        ("G2 K#2 X1.", "G2 K3. X1."),
        ("H#2 S[#2*1000] D[#2]", "H3 S3000 D3"),
    ],
)
def test_numbers_as_the_control_makes_them_of_variables(words: str, becomes: str) -> None:
    setup = replace(FANUC, least=0.001)
    assert [t for t, _ in written(f"#1=32/3\n#2=3\n{words}\nM30\n", setup)] == [f"{becomes}\n", "M30\n"]
    assert written("G20\n#1=32/3\nX#1\n", setup)[1][0] == "X10.6667\n"


REFUSED = [
    ("M98 P5", 1, "O0005 is not in this file"),
    ("M98", 1, "M98 needs P"),
    ("M98 P2 L0\nM30\nO2\nM99", 1, "0 repeats"),
    ("M98 P2 L2 K2\nM30\nO2\nM99", 1, "at most one of L and K"),
    ("M98 P20002\nM30\nO2\nM99\nO20002\nM99", 1, "or 2 calls of O0002"),
    ("M98 P2\nM30\nO2\nM99\nO2\nM99", 1, "O2 appears in lines 3 and 5"),
    ("M98 P2\nM30\nO2\nX1.", 4, "without M99"),
    ("M98 P2\nO2\nX1.\nM99", 1, "no M30 or M2"),
    ("M98 P2\nM30\nO2\nM98 P2\nM99", 4, "more than 4 nested calls"),
    ("X1.\nM99", 2, "M99 in the main program"),
    ("/M98 P2\nM30\nO2\nM99", 1, "--block-delete"),
    ("/GOTO5\nN5 M30", 1, "--block-delete"),
    ("G65 P9000 X1.", 1, "O9000 is not in this file"),
    ("G65 P2 X1\nM30\nO2\nM99", 1, "no decimal point"),
    ("G65 P2 K1. I2.\nM30\nO2\nM99", 1, "in this order"),
    ("G65 P2 G5 X1.\nM30\nO2\nM99", 1, "not an argument"),
    ("G65 X1.", 1, "G65 needs P"),
    ("G65 P2\nM30\nO2\nX[#24+1]\nM99", 4, "#24 is unknown"),
    ("#500=1", 1, "keep their values in the control"),
    ("#5221=1", 1, "keep their values in the control"),
    ("#1=#500", 1, "#500 is unknown"),
    ("X#5021", 1, "present position"),
    ("#1=#150", 1, "#150 is unknown"),
    ("#1=#0", 1, "set to empty"),
    ("IF[#1EQ#0]GOTO5\nN5", 1, "whether #1 is empty"),
    ("IF[#3003EQ1]GOTO5\nN5", 1, "unknown"),
    ("GOTO5", 1, "there is no N5"),
    ("GOTO5\nN5\nN005", 1, "N5 appears in lines 2 and 3"),
    ("#1=1\nN1 GOTO1", 2, "has no end: no variable changes"),
    ("#1=0\nWHILE[#1LT1]DO1\nX1.\nEND1", 2, "has no end: no variable changes"),
    ("WHILE[1EQ1]DO1\nX1.", 1, "DO1 without END1"),
    ("END1", 1, "without its DO1"),
    ("DO1\nDO1\nEND1\nEND1", 2, "inside DO1"),
    ("DO1\nDO2\nEND1\nEND2", 3, "overlapping loops"),
    ("GOTO5\nDO1\nN5 X1.\nEND1", 1, "jumps into a loop"),
    ("#1=0.1+0.2\nIF[#1EQ0.3]GOTO5\nN5", 2, "differ by rounding only"),
    ("#1=0.1*3*10\nX[FIX[#1]]", 2, "within rounding of a whole number"),
    ("T[1.5]", 1, "whole number"),
    ("IF[1EQ1]X5.", 1, "not supported"),
    ("#1=5 X1.", 1, "not supported|has no value|found"),
]


@pytest.mark.parametrize(("text", "line", "reason"), REFUSED)
def test_what_is_not_certain_is_refused(text: str, line: int, reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermocomp.nc.expansion.unroll.MOST_STEPS", 1000)
    with pytest.raises(ProgramError, match=reason) as caught:
        written(text + "\n")
    assert line in (0, caught.value.line)
    assert len(caught.value.reason) > 15


#: what moves no axis
STILL = [
    "S3000 M3\nM5",
    "G10 L2 P1 X#1",
    "G90 F100.",
    "G4 X1.",
    "G 04 P100",
    "G92 X0. Y0.",
    "(X1.)",
    "T1 M6",
    "G52 X#1",
]


def test_it_ends_where_too_much_comes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermocomp.nc.expansion.unroll.MOST", 2000)
    endless = unroll(["#1=0\n", "WHILE[#1LT1]DO1\n", "#1=#1-1\n", "G0 X1.\n", "END1\n"], FANUC)
    assert len(list(islice(endless, 1000))) == 1000
    with pytest.raises(
        ProgramError, match=r"line 2: the loop that begins here has run more than .* seems to have no end"
    ):
        for _ in endless:
            pass


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        # nothing changes from one pass to the next
        ("N10 #100=1\nGOTO 10", 1, "no variable changes"),
        ("N10 X1.\nX2.\nGOTO10", 1, "no variable changes"),
        ("WHILE[1EQ1]DO1\nDO2\nEND2\nEND1", 2, "no variable changes"),
        ("DO1\nM98 P2\nEND1\nM30\nO2\n#1=5\nM99", 1, "no variable changes"),
        ("DO1\nG65 P2 A1.\nEND1\nM30\nO2\n#2=#1\n#101=3\nM99", 1, "no variable changes"),
        ("M98 P2\nM30\nO2\nN5 X1.\nIF[1EQ1]GOTO5\nM99", 4, "no variable changes"),
        ("N1 M98 P2\nN3 M30\nO2\nM99 P1", 1, "no variable changes"),
        # a counter runs away
        ("#1=0\nN10 #1=#1+1\nGOTO10", 2, "2,000 lines and moved no axis"),
        ("#1=9\nWHILE[#1GT0]DO1\n#2=0\nWHILE[#2LT3]DO2\n#2=#2+1\nEND2\n#1=#1+1\nEND1", 2, "2,000 lines and"),
        *((f"#1=9\nN1 #1=#1+1\n{text}\nGOTO1", 2, "2,000 lines and moved no axis") for text in STILL),
        ("#1=9\nN1 #1=#1+1\nM98 P2\nGOTO1\nM30\nO2\n#3=1\n#3=2\nM5\nM99", 2, "2,000 lines and moved no axis"),
        ("#1=9\nWHILE[#1GT0]DO1\n#1=#1+1\nX#1\nEND1", 2, "more than 2,200 lines that would be"),
        ("#1=9\nN1 #1=#1+1\nM98 P2\nGOTO1\nM30\nO2\n#3=1\n#3=2\n#3=3\nX#1\nM99", 2, "more than 10,000 lines"),
    ],
)
def test_a_loop_without_end_is_refused_where_it_begins(
    text: str, line: int, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("MOST", "MOST_STEPS", "MOST_IDLE"):
        monkeypatch.setattr(unroll_module, name, getattr(unroll_module, name) // 100)
    with pytest.raises(ProgramError) as caught:
        for _ in unroll(split_lines(f"{text}\nM30\n"), FANUC):
            pass
    assert (caught.value.line, reason in caught.value.reason) == (line, True)
    assert "no end" in caught.value.reason


def test_so_many_lines_are_run() -> None:
    with pytest.raises(ProgramError, match="has run more than 220,000 lines that would be written"):
        for _ in unroll(split_lines("#1=9\nWHILE[#1GT0]DO1\n#1=#1+1\nX#1\nEND1\nM30\n"), FANUC):
            pass


def test_a_subprogram_that_calls_itself_is_refused() -> None:
    with pytest.raises(ProgramError, match="more than 4 nested calls"):
        written("M98 P2\nM30\nO2\nM98 P2\nM99\n")


def test_a_loop_that_ends_is_written_out() -> None:
    """Also where a variable gets back a value it had."""
    text = "#2=0\n#1=0\nN1 #1=1-#1\nX#1\n#2=#2+1\nIF[#2LT9]GOTO1\nM98 P2 L20\nM30\nO2\nN5 #3=1\nX9.\nM99\n"
    assert sum(line.startswith("X9") for line, _ in written(text)) == 20


@pytest.mark.long
def test_a_long_loop_is_written_out() -> None:
    rows = ["#1=0\n", "WHILE[#1LT400]DO1\n", "#2=0\n", "WHILE[#2LT500]DO2\n", "G1 X#2 Y#1 F1000\n", "#2=#2+1\n"]
    lines = unroll([*rows, "END2\n", "#1=#1+1\n", "END1\n", "M30\n"], FANUC)
    assert sum(text.startswith("G1") for text, _ in lines) == 200_000


def test_lines_that_move_nothing_are_written_if_they_end() -> None:
    """More than a loop may have, once each; and in loops with a move now and then."""
    loop = "#1=0\nWHILE[#1LT3]DO1\n#2=0\nWHILE[#2LT30000]DO2\n#2=#2+1\nEND2\nX#1\n#1=#1+1\nEND1\nM30\n"
    out = [text for text, _ in unroll(["F100.\n"] * 210_000 + list(split_lines(loop)), FANUC)]
    assert (len(out), out[-4:]) == (210_004, ["X0.\n", "X1.\n", "X2.\n", "M30\n"])


def test_lines_that_are_skipped_call_nothing() -> None:
    setup = replace(FANUC, skip_optional=True)
    assert [n for _, n in written("/M98 P5\n/GOTO 7\nX1.\nM30\n", setup)] == [1, 2, 3, 4]


def test_the_programs_that_come_with_the_tests() -> None:
    plain = 0
    for path in sorted(Path(__file__).with_name("fanuc").glob("*.nc")):
        text = path.read_text("ascii")
        if "#500" in text:
            continue
        out = "".join(line for line, _ in written(text))
        acts = any(mark in text for mark in ("M98", "M97", "G65", "#"))
        assert (out == text) == (not acts)
        code = re.sub(r"\([^)]*\)", "", out)
        assert not any(mark in code for mark in ("M98", "M97", "G65 P", "M99", "WHILE", "GOTO"))
        plain += not acts
    assert plain > 15
