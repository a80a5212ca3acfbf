"""The second reading finds what the first writing did wrong."""

import pytest

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.rewrite.check import Check
from thermocomp.nc.rewrite.method import Change
from thermocomp.nc.rewrite.text import LONGEST, Vector

BEGIN = ["G21 G90 G17 S500 M3\n", "G0 X0 Y0 Z5 F100\n"]
NONE: Vector = (0.0, 0.0, 0.0)


def checked(line: str, becomes: str, after: Vector = NONE, inner: Vector | None = None) -> None:
    """Let one line of a program become another one."""
    check = Check(Setup())
    for block in follow_program(read_lines([*BEGIN, line]), Setup()):
        last = block.line.number == len(BEGIN) + 1
        carried = after if last else NONE
        check.check(block, Change((becomes if last else block.line.text,), NONE, carried, inner or carried))


@pytest.mark.parametrize(
    ("line", "becomes", "after"),
    [
        ("G1 X5\n", "G1 X5\n", NONE),
        ("G1 X5 Z-1\n", "G1 X5.01 Z-1.025\n", (10.0, 0.0, -25.0)),
        ("G2 X10 I5\n", "G2 X10 I5 Z4.99\n", (0.0, 0.0, -10.0)),
    ],
)
def test_what_is_right_passes(line: str, becomes: str, after: Vector) -> None:
    checked(line, becomes, after)


@pytest.mark.parametrize(
    ("line", "becomes", "after", "said"),
    [
        ("G1 X5\n", "G1 X5.0002\n", NONE, r"moves X by 0\.20 um instead of 0\.00 um"),
        ("G1 X5 Z-1\n", "G1 X5 Z-1\n", (0.0, 0.0, -25.0), r"moves Z by 0\.00 um instead of -25\.00 um"),
        ("G1 X5\n", "G0\n", NONE, "makes 0 moves instead of 1"),
        ("G2 X10 I5\n", "G3 X10 I5\n", NONE, "makes a different arc"),
        ("G2 X10 I5\n", "G1 X10\n", NONE, "makes a different arc"),
        ("G2 X10 I5\n", "G2 X10 I5 J0.01\n", NONE, "makes a different arc"),
        ("G1 X5\n", "G1 X5 Z\n", NONE, "the revised line 'G1 X5 Z' cannot be read"),
        ("G1 X5\n", f"G1 X5{' ' * LONGEST}Y0\n", NONE, "the revised line would have 24[0-9] characters"),
        ("G1 X5\n", "G1 X5\n", (float("nan"), 0.0, 0.0), "moves X by"),
        ("G99 G81 X1 Z-2 R2\n", "G99 G81 X1 Z-2 R2.01\n", NONE, "moves Z by"),
        ("G28 Z5\n", "G28 Z5.01\n", NONE, "moves Z by"),
    ],
)
def test_what_is_wrong_is_found(line: str, becomes: str, after: Vector, said: str) -> None:
    with pytest.raises(ProgramError, match=f"^line 3: .*{said}"):
        checked(line, becomes, after)
