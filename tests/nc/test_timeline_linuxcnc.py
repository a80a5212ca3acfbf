"""The time line against LinuxCNC itself, which runs the programs with simulated drives.

Its time is counted in periods of its servo thread, see `linuxcncrun.run`.
"""

import math
import random
from collections.abc import Iterator
from itertools import pairwise

import linuxcncrun
import pytest

from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.planner.timeline import MotionLimits, Timed, time_blocks

KINEMATICS = MotionLimits(
    rapid=(linuxcncrun.SPEEDS[0] * 60.0, linuxcncrun.SPEEDS[1] * 60.0, linuxcncrun.SPEEDS[2] * 60.0),
    acceleration=linuxcncrun.ACCELERATIONS,
    tool_change=0.0,
    stop=0.0,
    spindle=0.0,
    cycle=linuxcncrun.PERIOD,
)
#: of stretches that are as long as an eighth of a program or longer
STRETCHES = 8


def surface(step: float, n: int, height: float) -> list[str]:
    """Return a curve in space in short straight lines."""
    points = ((k * step, math.sin(k * step / 4.0), math.cos(k * step / 3.0) - 1.0) for k in range(n))
    return [f"X{x:.4f} Y{height * y:.4f} Z{height / 2.0 * z:.4f}" for x, y, z in points]


def zigzag(n: int) -> list[str]:
    return [f"{'Y' if k % 2 else 'X'}{3 * (k // 2 + 1) if k % 2 else 40 * (1 - k // 2 % 2)}" for k in range(n)]


def scatter(n: int) -> list[str]:
    chance = random.Random(5)
    return [
        f"G0 X{chance.uniform(-90, 90):.3f} Y{chance.uniform(-90, 90):.3f} Z{chance.uniform(-50, 50):.3f}"
        for _ in range(n)
    ]


ARCS = """G2 X0 Y0 I20
G3 X0 Y0 J3
G2 X0 Y0 Z-20 I15 P4
G1 X20
G3 X40 Y20 J20
G1 Y40
G2 X60 Y60 I20
G1 X90
G3 X90 Y40 J-10
G1 X20 Y0
G18 G2 X40 Z-20 I10
G17 G1 X20
G2 X20 Y30 Z0 J15
G2 X30 Y30 I5 J-3
G2 X40 Y30 I5 J3"""
DRILLING = """S1000 M3
G99 G81 X10 Y0 Z-3 R2 F400
X30
G83 X10 Z-6 R1 Q2
G82 X0 Y20 Z-2 R1 P0.4
G80
M5
G4 P0.5
G1 X20 Z1 F1500
M8
G0 Z5
T2 M6
G1 X40"""
FEEDS = """G20
G1 X1 F20
X2 F150
Y1.5 F60
G21
G1 X60 F400
X80 F4000
G93 X40 Y0 F60
X0 F30
G94 F1200 X10"""
PROGRAMS = {
    "feeds": ["G64", FEEDS],
    "surface": ["G64 F3600", "G1", *surface(0.3, 300, 8.0)],
    "surface with tolerance": ["G64 P0.02 F5400", "G1", *surface(0.08, 1500, 3.0)],
    "rapids": ["G64", *scatter(6)],
    "rapids exact": ["G61", *scatter(4)],
    "arcs": ["G64 F6000", ARCS],
    "drilling": ["G64", DRILLING],
    "zigzag exact": ["G61 F4000", "G1", *zigzag(12)],
    "zigzag exact stop": ["G61.1 F4000", "G1", *zigzag(12)],
    "zigzag": ["G64 F4000", "G1", *zigzag(16)],
    "zigzag with tolerance": ["G64 P0.05 F4000", "G1", *zigzag(16)],
}


def text(lines: list[str]) -> str:
    return "\n".join(["G21 G90 G17 G94", *lines, "G0 X0 Y0 Z0", "M2", ""])


@pytest.fixture(scope="module")
def ran() -> dict[str, linuxcncrun.Run]:
    return linuxcncrun.run({name.replace(" ", "_"): text(lines) for name, lines in PROGRAMS.items()}, 240.0)


def ours(lines: list[str]) -> list[Timed]:
    blocks = follow_program(read_lines(text(lines).splitlines(keepends=True)), Setup())
    return list(time_blocks(blocks, KINEMATICS))


@pytest.mark.long
@pytest.mark.parametrize("name", PROGRAMS)
def test_the_whole_run_and_stretches_of_it_are_within_2_percent(name: str, ran: dict[str, linuxcncrun.Run]) -> None:
    """They are within 0.1 %; the issue asks for 2 %."""
    theirs, mine = ran[name.replace(" ", "_")], ours(PROGRAMS[name])
    print(f"{name:24} LinuxCNC {theirs.seconds:7.3f} s, time line {mine[-1].end:7.3f} s")
    assert mine[-1].end == pytest.approx(theirs.seconds, rel=0.02)
    starts = {t.block.line.number: t.start for t in mine}
    for first, second in stretches(theirs):
        lasts = theirs.began[second] - theirs.began[first]
        assert starts[second] - starts[first] == pytest.approx(lasts, rel=0.02, abs=0.01), f"lines {first} to {second}"


def stretches(run: linuxcncrun.Run) -> Iterator[tuple[int, int]]:
    """Yield first and last line of stretches of a run."""
    chosen: list[int] = []
    for line, at in sorted(run.began.items(), key=lambda entry: entry[1]):
        if line and (not chosen or at - run.began[chosen[-1]] >= run.seconds / STRETCHES):
            chosen.append(line)
    assert len(chosen) > 3
    yield from pairwise(chosen)
