"""A program is gone through first: what is refused whatever the drift is refused then, and nothing else."""

import random
from pathlib import Path

import pytest
from nc_law import STATED, Growing, Steady, method

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.rewrite.demand import Demand
from thermocomp.nc.rewrite.revise import Revision

HEAD = "G21 G90 G17 G94 G54\nS3000 M3 F300\nG0 X0 Y0 Z10\nG1 Z-1\n"


def revision(way: str = "coordinates", setup: Setup = STATED, drift: Steady | None = None) -> Revision:
    return Revision(setup, MotionLimits(), drift or Growing(), method(way), Demand(1.0))


def refused(text: str, way: str = "coordinates", setup: Setup = STATED) -> str:
    try:
        for _ in revision(way, setup).rehearse(text.splitlines(keepends=True)):
            pass
    except ProgramError as e:
        return str(e)
    return ""


@pytest.mark.parametrize(
    "line",
    [
        "G77 X1",  # not read
        "G38.2 Z-5",  # probing
        "G2 X10 Y0 I1 J9",  # no arc
        "M123",
        "T2 M6\nG92 X0",  # the place of an axis that the change may have moved
        "G94\nX5",
        "G93 G1 X5",
        "(THERMOCOMP REVISED FOR THERMAL DRIFT)",
        "G1 A90 F50",
    ],
)
def test_what_is_refused_is_refused_at_once(line: str) -> None:
    text = f"{HEAD}X1 Y1\nX2 Y2\n{line}\nG0 Z10\nM2\n"
    with pytest.raises(ProgramError) as late:
        list(revision().revise(text.splitlines(keepends=True)))
    assert refused(text) == str(late.value)


def test_what_is_revised_is_never_refused_before() -> None:
    """Lines of all kinds between lines that look alike, which the method is not asked about twice."""
    chance = random.Random(8)
    special = [
        "M0",
        "M1",
        "T{} M6",
        "G43 H1",
        "X{} Y{} M0",
        "X{} Z5 M1",
        "G53 G0 Z0",
        "G28 Z5",
        "G92 X{}",
        "G92.1",
        "G55",
        "G54",
        "G91",
        "G90",
        "G0 X{} Y{}",
        "G1 X{} Y{} Z{}",
        "/X{} Y{}",
        "G1 X{} Y{} F200 M8",
        "G81 X{} Y{} Z-5 R2",
        "G80",
        "(note)",
        "",
    ]
    revised = refusals = 0
    for _ in range(400):
        lines = [HEAD]
        for _ in range(30):
            if chance.random() < 0.4:
                text = chance.choice(special)
            else:
                text = chance.choice(("X{} Y{}", "X{}", "Y{} X{}", "X{} Y{} Z{}", "Z{}"))
            while "{}" in text:
                text = text.replace("{}", str(chance.randint(1, 9)), 1)
            lines.append(text + "\n")
        program = "".join([*lines, "M2\n"])
        for way in ("coordinates", "offset"):
            try:
                list(revision(way).revise(program.splitlines(keepends=True)))
            except ProgramError:
                refusals += 1
                continue
            revised += 1
            assert refused(program, way) == "", program
    assert min(revised, refusals) > 30


@pytest.mark.parametrize("between", ["X5 Z2 M0", "X5 Z2 M1", "G53 G0 X0 Y0\nG1", "M0"])
def test_what_clears_a_doubt_is_not_passed_over(between: str) -> None:
    text = f"{HEAD}X1 Y1\n{between}\nX1 Y1\nG92 Y0\nG0 Z10\nM2\n"
    assert list(revision().revise(text.splitlines(keepends=True)))
    assert refused(text) == ""


def test_the_revision_begins_anew_behind_it(tmp_path: Path) -> None:
    text = f"{HEAD}X100\nG0 Z10\nT2 M6\nG0 X0 Y0\nZ2\nG1 Z-1\nM2\n".splitlines(keepends=True)
    run, other = revision(drift=Growing()), revision(drift=Growing())
    assert len(list(run.rehearse(text))) == len(text)
    assert [r.texts for r in run.revise(text)] == [r.texts for r in other.revise(text)]
    assert run.changed
