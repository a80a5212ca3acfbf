"""NC program of a cutting test: written, revised, and read back as run by the machine (P-04, P-06, P-07).

A stepped block has four faces, one at each modelled position of Z. They are face-milled cold and again, next to the
first surfaces, after an hour in which the spindle runs at other speeds and the axes move.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.nc.interpreter.block import Block, Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.planner.timeline import MotionLimits, Timed, time_blocks
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand
from thermocomp.nc.rewrite.method import CorrectionMethod
from thermocomp.nc.rewrite.offset import Offset
from thermocomp.nc.rewrite.revise import Revision
from thermocomp.nc.rewrite.text import DIGITS
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.start import ThermalStart, begin_cold, carry_over
from thermocomp.nc.thermal.stations import Station
from thermocomp.papers.precompensation.setup import INTERVAL, MILLING, POSITIONS, SPEED
from thermocomp.papers.study import FloatArray
from thermocomp.recordings.recording import Recording

MINUTE = 60.0
#: tool length; the work coordinate system is lower by this amount: Z words are axis positions [mm]
TOOL = 120.0
#: settings at the controller
SETUP = Setup(offsets={1: (0.0, 0.0, -TOOL)}, tools={1: TOOL})
KINEMATICS = MotionLimits()
#: height of the retracted tool, above the highest face [mm]
UP = 650.0
#: number of passes of a face in X, back and forth, their length and spacing [mm], and the feed [mm/min]
PASSES, LENGTH, APART, FEED = 5, 240.0, 25.0, 1200.0
#: start in X of the cold faces and of those after the hour; start in Y of the first position's face [mm]
LEFT, LOWEST = (30.0, 330.0), 20.0
#: distance between faces in Y [mm]
NEXT = 135.0
#: end points (X, Y, Z) of the movements in between [mm], and their feed [mm/min]: 30 s per movement
CORNERS = ((150.0, 25.0, 150.0), (450.0, 525.0, 450.0))
ROUGHING = 1340.0
ROUGHING_MOVE = 30.0
#: sampling interval of the surface of a block [s]
LOOK = 1.0
#: largest change of a correction in a cut, per block and 10 mm of path [um], as in ``thermocomp revise``
STEP = 1.0
#: change of the drift at which a correction is renewed [um], as in ``thermocomp revise``
TOLERANCE = 1.0
#: revision methods: as in the paper, as soon as needed, and at safe points only
EVERY, NEEDED, SAFE = "every 10 min", f"per {TOLERANCE:g} um", f"work offset, per {TOLERANCE:g} um"
WAYS = (EVERY, NEEDED, SAFE)


# -- writing -----------------------------------------------------------------------------------------------------------


def write_program(test: Recording) -> list[str]:
    """Return the NC program of a cutting test."""
    lines = [f"(CUTTING TEST {test.name.upper()})", "G21 G90 G17 G94 G40 G54", "T1 M6", "G43 H1", f"G0 Z{UP:g}"]
    due: list[tuple[int, float]] = []
    first, last = milling(test)
    turning = False
    for start, end, speed in _stretches(test, (*first, *last)):
        if speed:
            lines.append(f"S{speed:g}" if turning else f"S{speed:g} M3")
        elif turning:
            lines.append("M5")
        turning = bool(speed)
        if start in (first[0], last[0]):
            lines += _faces(1 if start == first[0] else 2)
        elif speed:
            lines += _roughing(end - start)
        due.append((len(lines), end))
        lines.append("G4 P1.0")
    lines += ["M5", "M30"]
    return _filled([line + "\n" for line in lines], due)


def milling(test: Recording) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the periods [s] in which the cold faces and the later ones are milled: see `MILLING`."""
    running = np.flatnonzero(_speeds(test)[1:] > 0)
    begin, end = float(test.time[running[0]]), float(test.time[running[-1] + 1])
    return (begin, begin + MILLING * MINUTE), (end - MILLING * MINUTE, end)


def _speeds(test: Recording) -> FloatArray:
    return np.asarray(test.table[SPEED].to_numpy(dtype=np.float64))


def _stretches(test: Recording, borders: Sequence[float]) -> Iterator[tuple[float, float, float]]:
    """Yield start and end [s] of periods of constant spindle speed [1/min]; no period crosses a boundary."""
    speed, begin = _speeds(test), float(test.time[0])
    for k in range(1, len(speed)):  # the speed in a row is that of the preceding interval
        end = float(test.time[k])
        if k == len(speed) - 1 or speed[k + 1] != speed[k] or end in borders:
            yield begin, end, float(speed[k])
            begin = end


def _faces(number: int) -> Iterator[str]:
    """Yield the lines that mill a face at each position."""
    left = LEFT[number - 1]
    for k, z in enumerate(POSITIONS):
        y = LOWEST + k * NEXT
        yield f"G0 X{left:g} Y{y:g}"
        yield f"G0 Z{z:g}"
        yield _comment(number, z)
        for n in range(PASSES):
            if n:
                yield f"Y{y + n * APART:g}"
            yield f"{'' if n else 'G1 '}X{left if n % 2 else left + LENGTH:g}{'' if n else f' F{FEED:g}'}"
        yield f"G0 Z{UP:g}"


def _comment(number: int, z: float) -> str:
    return f"(FACE {number} AT Z {z:g})"


def _roughing(seconds: float) -> Iterator[str]:
    """Yield movements back and forth that take slightly less than the given time."""
    x, y, z = CORNERS[0]
    yield f"G0 X{x:g} Y{y:g}"
    yield f"G0 Z{z:g}"
    for n in range(1, int(seconds / ROUGHING_MOVE) + 1):
        x, y, z = CORNERS[n % 2]
        yield f"G1 X{x:g} Y{y:g} Z{z:g} F{ROUGHING:g}"
    yield f"G0 Z{UP:g}"


def _filled(lines: list[str], due: Sequence[tuple[int, float]]) -> list[str]:
    """Return the lines with each dwell, initially 1 s, extended to end at its due time [s]."""
    ends = [t.end for t in run(lines)]
    longer = 0.0
    for k, when in due:
        lacking = when - ends[k] - longer
        if lacking < -1.0:
            raise ValueError(f"line {k + 1}: the moves before it take {-lacking - 1.0:.1f} s longer than the test does")
        lines[k] = f"G4 P{1.0 + lacking:.3f}\n"
        longer += round(lacking, 3)
    return lines


# -- revising ----------------------------------------------------------------------------------------------------------


def stations(models: Sequence[ErrorModel]) -> list[Station]:
    """Return the models of the drift of Z at each position (P-04)."""
    return [Station("Z", m, "Z", float(p), shadow=True) for m, p in zip(models, POSITIONS, strict=True)]


def warmed(models: Sequence[ErrorModel], seconds: float, speed: float) -> ThermalStart:
    """Return the state carried over from a preceding job with a cold start and a constant speed [1/min]."""
    there = stations(models)
    before = Drift(there, begin_cold(there, {}))
    before.advance(seconds, speed)
    return carry_over(there, before.state())


def revise_program(
    lines: Iterable[str], models: Sequence[ErrorModel], way: str, start: ThermalStart | None = None
) -> list[str]:
    """Revise a program by the drift that it will cause.

    Parameters
    ----------
    start : ThermalStart, optional
        State of the machine at the start of the program. Default: cold. The drift is relative to this time, at which
        the work is set up.
    """
    there = stations(models)
    drift = Drift(there, start or begin_cold(there, {}))
    digits = DIGITS[SETUP.controller]
    method: CorrectionMethod = Coordinates(digits, STEP)
    if way == SAFE:
        method = Offset(digits, STEP, safe_z=UP, axes=(False, False, True))
    demand = Demand(TOLERANCE, INTERVAL if way == EVERY else None)
    revision = Revision(setup=SETUP, kinematics=KINEMATICS, drift=drift, method=method, demand=demand)
    return [text for became in revision.revise(lines) for text in became.texts]


# -- reading back ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FacedSurface:
    """A face as commanded by the program, for each second of its passes.

    Parameters
    ----------
    number : int
        1: milled cold, 2: after the hour.
    position : float
        Position of Z in the drawing [mm].
    time : ndarray of shape (n,)
        [s]
    z : ndarray of shape (n,)
        Commanded minus drawing position [um].
    """

    number: int
    position: float
    time: FloatArray
    z: FloatArray

    def surface(self, drift: Recording) -> FloatArray:
        """Return the position of the surface, actual minus drawing position, (n,) [um]."""
        columns = [drift.table[f"z_at_{p}_um"].to_numpy(dtype=np.float64) for p in POSITIONS]
        there = np.column_stack([np.interp(self.time, drift.time, column) for column in columns])
        at = self.position + self.z / 1e3
        lies: FloatArray = self.z + [np.interp(p, POSITIONS, row) for p, row in zip(at, there, strict=True)]
        return lies


def run(lines: Iterable[str]) -> Iterator[Timed]:
    """Yield the blocks of a program as run by the machine."""
    return time_blocks(follow_program(read_lines(lines, SETUP.controller), SETUP), KINEMATICS)


def faces(lines: Iterable[str]) -> list[FacedSurface]:
    """Return the faces cut by a program; comments in the program mark the start of each face."""
    begins = {_comment(n, z).strip("()"): (n, float(z)) for n in (1, 2) for z in POSITIONS}
    found: dict[tuple[int, float], list[FloatArray]] = {}
    face: tuple[int, float] | None = None
    for block, start, end in run(lines):
        face = begins.get(block.line.comment, face)
        if face and _cuts(block):
            found.setdefault(face, []).append(_looked_at(block, start, end, face[1]))
        elif block.moves:
            face = None
    return [FacedSurface(n, z, *np.hstack(parts)) for (n, z), parts in found.items()]


def _cuts(block: Block) -> bool:
    return bool(block.moves) and not any(m.rapid for m in block.moves)


def _looked_at(block: Block, start: float, end: float, position: float) -> FloatArray:
    """Return times [s], and commanded minus drawing positions [um], over a pass: an array with two rows."""
    share = (np.arange(n := max(1, round((end - start) / LOOK))) + 0.5) / n
    z = np.interp(share, (0.0, 1.0), (block.moves[0].start[2], block.moves[-1].end[2]))
    return np.array([start + share * (end - start), 1e3 * (z - position)])


def turning(lines: Iterable[str], times: FloatArray) -> FloatArray:
    """Return the spindle speed of a program at increasing times [s], shape (n,) [1/min]."""
    ends, speeds = np.array([(t.end, abs(t.block.speed)) for t in run(lines)]).T
    found: FloatArray = speeds[np.minimum(np.searchsorted(ends, times), len(ends) - 1)]
    return found
