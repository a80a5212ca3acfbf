"""The NC program of a cutting test: written, revised, and read back as the machine will run it (P-04, P-06, P-07).

A stepped block with four faces, one at each position of Z that has a model, is face-milled cold and again, beside it,
after an hour in which the spindle runs at other speeds and the axes move.
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
#: length of the tool; the work coordinate system lies so much lower: words of Z are positions of the axis [mm]
TOOL = 120.0
#: what stands at the controller
SETUP = Setup(offsets={1: (0.0, 0.0, -TOOL)}, tools={1: TOOL})
KINEMATICS = MotionLimits()
#: the tool is up, above the highest face [mm]
UP = 650.0
#: a face is so many passes of X, from left to right and back [mm], so far apart [mm], at this feed [mm/min]
PASSES, LENGTH, APART, FEED = 5, 240.0, 25.0, 1200.0
#: where the faces that are milled cold, and after the hour, begin in X; where the first position's does in Y [mm]
LEFT, LOWEST = (30.0, 330.0), 20.0
#: from face to face in Y [mm]
NEXT = 135.0
#: in between the axes go to and fro between these (X, Y, Z) [mm], at this feed [mm/min]: 30 s a move
CORNERS = ((150.0, 25.0, 150.0), (450.0, 525.0, 450.0))
ROUGHING = 1340.0
ROUGHING_MOVE = 30.0
#: how often a block's surface is looked at [s]
LOOK = 1.0
#: most that a correction changes by in a cut, per block and 10 mm of way [um], as ``thermocomp revise`` has it
STEP = 1.0
#: a correction is renewed as soon as the drift has moved by so much, likewise [um]
TOLERANCE = 1.0
#: how a program is revised: as the paper does, as soon as it is needed, and at safe points only
EVERY, NEEDED, SAFE = "every 10 min", f"by {TOLERANCE:g} um", f"work offset, by {TOLERANCE:g} um"
WAYS = (EVERY, NEEDED, SAFE)


# -- written -----------------------------------------------------------------------------------------------------------


def write_program(test: Recording) -> list[str]:
    """Write the NC program that a cutting test has been run with.

    Parameters
    ----------
    test : Recording
        With the spindle speed.

    Returns
    -------
    list of str
        Lines. The spindle turns as in the recording, from its start on: what the moves leave of the time is dwell.

    Raises
    ------
    ValueError
        In some stretch the moves take longer than the test.
    """
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
    """Return the times at which the cold faces and the other ones are milled, from and to [s]: see `MILLING`."""
    running = np.flatnonzero(_speeds(test)[1:] > 0)
    begin, end = float(test.time[running[0]]), float(test.time[running[-1] + 1])
    return (begin, begin + MILLING * MINUTE), (end - MILLING * MINUTE, end)


def _speeds(test: Recording) -> FloatArray:
    return np.asarray(test.table[SPEED].to_numpy(dtype=np.float64))


def _stretches(test: Recording, borders: Sequence[float]) -> Iterator[tuple[float, float, float]]:
    """Yield from when to when [s] the spindle turns at which speed [1/min]; no stretch goes over a border."""
    speed, begin = _speeds(test), float(test.time[0])
    for k in range(1, len(speed)):  # a row tells the speed that led to it
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
    """Yield moves to and fro that take a little less."""
    x, y, z = CORNERS[0]
    yield f"G0 X{x:g} Y{y:g}"
    yield f"G0 Z{z:g}"
    for n in range(1, int(seconds / ROUGHING_MOVE) + 1):
        x, y, z = CORNERS[n % 2]
        yield f"G1 X{x:g} Y{y:g} Z{z:g} F{ROUGHING:g}"
    yield f"G0 Z{UP:g}"


def _filled(lines: list[str], due: Sequence[tuple[int, float]]) -> list[str]:
    """Let each of some dwells, of 1 s so far, end when it is due [s]."""
    ends = [t.end for t in run(lines)]
    longer = 0.0
    for k, when in due:
        lacking = when - ends[k] - longer
        if lacking < -1.0:
            raise ValueError(f"line {k + 1}: the moves before it take {-lacking - 1.0:.1f} s longer than the test does")
        lines[k] = f"G4 P{1.0 + lacking:.3f}\n"
        longer += round(lacking, 3)
    return lines


# -- revised -----------------------------------------------------------------------------------------------------------


def stations(models: Sequence[ErrorModel]) -> list[Station]:
    """Return the models of the drift of Z at each position (P-04)."""
    return [Station("Z", m, "Z", float(p), shadow=True) for m, p in zip(models, POSITIONS, strict=True)]


def warmed(models: Sequence[ErrorModel], seconds: float, speed: float) -> ThermalStart:
    """Return the start state that is carried over from a job before: it began cold, and had one speed [1/min]."""
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
    lines : iterable of str
    models : sequence of ErrorModel
        One per position.
    way : str
        One of `WAYS`.
    start : ThermalStart, optional
        State of the machine when the program begins; cold without it. The drift counts from there: it is then that the
        work is set up.

    Returns
    -------
    list of str
        Lines.
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


# -- read back ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FacedSurface:
    """A face as the program has it cut, at every second of its passes.

    Parameters
    ----------
    number : int
        1 is milled cold, 2 after the hour.
    position : float
        Position of Z, in the drawing [mm].
    time : ndarray of shape (n,)
        [s]
    z : ndarray of shape (n,)
        Commanded minus drawing [um].
    """

    number: int
    position: float
    time: FloatArray
    z: FloatArray

    def surface(self, drift: Recording) -> FloatArray:
        """Return the position of the surface, actual minus drawing, (n,) [um].

        Parameters
        ----------
        drift : Recording
            Deviation of the machine at each of `POSITIONS`.
        """
        columns = [drift.table[f"z_at_{p}_um"].to_numpy(dtype=np.float64) for p in POSITIONS]
        there = np.column_stack([np.interp(self.time, drift.time, column) for column in columns])
        at = self.position + self.z / 1e3
        lies: FloatArray = self.z + [np.interp(p, POSITIONS, row) for p, row in zip(at, there, strict=True)]
        return lies


def run(lines: Iterable[str]) -> Iterator[Timed]:
    """Read a program as the machine runs it."""
    return time_blocks(follow_program(read_lines(lines, SETUP.controller), SETUP), KINEMATICS)


def faces(lines: Iterable[str]) -> list[FacedSurface]:
    """Return the faces that a program cuts; comments in the program mark the start of each face.

    Parameters
    ----------
    lines : iterable of str

    Returns
    -------
    list of FacedSurface
        In the order they are milled.
    """
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
    """Return times [s], and commanded minus drawing [um], over a pass: an array of two rows."""
    share = (np.arange(n := max(1, round((end - start) / LOOK))) + 0.5) / n
    z = np.interp(share, (0.0, 1.0), (block.moves[0].start[2], block.moves[-1].end[2]))
    return np.array([start + share * (end - start), 1e3 * (z - position)])


def turning(lines: Iterable[str], times: FloatArray) -> FloatArray:
    """Return the spindle speed of a program at some times [s], rising, shape (n,) [1/min]."""
    ends, speeds = np.array([(t.end, abs(t.block.speed)) for t in run(lines)]).T
    found: FloatArray = speeds[np.minimum(np.searchsorted(ends, times), len(ends) - 1)]
    return found
