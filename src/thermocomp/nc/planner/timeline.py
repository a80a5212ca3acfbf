"""Timing of a program in a controller: speeds, accelerations and corners of the moves, pauses and tool changes."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from thermocomp.core.exceptions import SettingError
from thermocomp.core.machine import Machine
from thermocomp.nc.interpreter.block import PLANES, Block, Move, Point, triple
from thermocomp.nc.interpreter.codes import list_names
from thermocomp.nc.planner.corners import Corners, find_overlap_speeds
from thermocomp.nc.planner.segment import Segment, Segments, Vector

#: defaults of an axis not specified in the machine file: medium machining centre [mm/min, mm/s2]
RAPID, ACCELERATION = 30_000.0, 3000.0
#: number of segments in the look-ahead of the controller
AHEAD = 50
#: number of segments planned at once
CHUNK = 500
#: maximum number of points replaced by one line
CHAIN = 100
#: a feed segment of shorter duration has one constant acceleration [s]
STEADY = 0.01
#: codes before which the axes stop, as in LinuxCNC: pauses, probing, other coordinates, actions at a position
HALTS = frozenset(
    {"G4", "G10", "G31", "G38.2", "G38.3", "G38.4", "G38.5", "G52", "G92", "G92.1", "G92.2", "G92.3"}
    | {"M64", "M65", "M66"}
    | list_names("tool length", "rotation", "system", "stop", "spindle", "coolant", "tool")
)


@dataclass(frozen=True)
class MotionLimits:
    """Dynamics of a machine and its controller.

    Parameters
    ----------
    rapid : tuple of float
        Maximum speed of X, Y, Z [mm/min].
    acceleration : tuple of float
        Maximum acceleration of X, Y, Z [mm/s2].
    feed : float
        Maximum feed rate along the path [mm/min].
    rotary_rapid : float
        Maximum speed of a rotary axis [deg/min].
    rotary_acceleration : float
        Maximum acceleration of a rotary axis [deg/s2].
    tool_change : float
        Time from the last move before a tool change to the first move after it [s].
    stop : float
        Duration of M0, M1 and M60 [s]: the operator decides.
    spindle : float
        Delay of the program by a change of the spindle speed [s].
    cycle : float
        Interpolation cycle of the controller [s].
    override : float
        Fraction of the programmed feed, as set by the operator.

    Raises
    ------
    SettingError
        A speed, an acceleration or the cycle is not positive, or a time is negative.
    """

    rapid: Vector = (RAPID, RAPID, RAPID)
    acceleration: Vector = (ACCELERATION, ACCELERATION, ACCELERATION)
    feed: float = math.inf
    rotary_rapid: float = 6000.0
    rotary_acceleration: float = 500.0
    tool_change: float = 5.0
    stop: float = 60.0
    spindle: float = 1.0
    cycle: float = 0.001
    override: float = 1.0

    def __post_init__(self) -> None:
        for key in ("rapid", "acceleration"):
            numbers = getattr(self, key)
            if not all(0 < v < math.inf for v in numbers):
                raise SettingError(f"{numbers}: must be positive", (key,))
        for key in ("feed", "rotary_rapid", "rotary_acceleration", "cycle", "override"):
            if not getattr(self, key) > 0:
                raise SettingError(f"{getattr(self, key)}: must be positive", (key,))
        for key in ("tool_change", "stop", "spindle"):
            if not 0 <= getattr(self, key) < math.inf:
                raise SettingError(f"{getattr(self, key)}: must not be negative", (key,))

    @classmethod
    def of(cls, machine: Machine, **others: float) -> "MotionLimits":
        """Return the motion limits of a machine, with defaults for values that its file does not give."""
        axes = {a.name: a for a in machine.axes}

        def told(key: str, otherwise: float) -> Vector:
            return triple(getattr(axes.get(name), key, None) or otherwise for name in "XYZ")

        return cls(told("rapid", RAPID), told("acceleration", ACCELERATION), **others)


class Timed(NamedTuple):
    """Block, and the time at which it is run."""

    block: Block
    start: float  #: time since the start of the program [s]
    end: float  #: time since the start of the program [s]


def time_blocks(blocks: Iterable[Block], kinematics: MotionLimits) -> Iterator[Timed]:
    """Yield the start and end time of each block.

    The time of a rounded corner counts towards the block after it, as in LinuxCNC, and that of lines merged under
    ``G64 P`` towards the last of them. Memory is bounded: the look-ahead is several hundred moves.
    """
    plan = _Plan(kinematics)
    done = plan.done
    for serial, block in enumerate(blocks):
        plan.add(serial, block)
        if done:
            yield from done
            done.clear()
    plan.halt(0.0)
    yield from done


class _Plan:
    """Motion planner: moves that are planned but not yet timed, and completed blocks."""

    def __init__(self, kinematics: MotionLimits) -> None:
        self.kinematics = kinematics
        x, y, z = kinematics.rapid
        speeds = (x / 60.0, y / 60.0, z / 60.0)
        rotary = (kinematics.rotary_rapid / 60.0, kinematics.rotary_acceleration)
        self.segments = Segments(speeds, kinematics.acceleration, kinematics.feed / 60.0, rotary, kinematics.override)
        self.corners = Corners(speeds, kinematics.acceleration, kinematics.cycle)
        self.now = 0.0  #: end time of the timed segments [s]
        self.since = 0.0  #: end time of the completed blocks [s]
        self.speed = 0.0  #: path speed at `now` [mm/s]
        self.shared = 0.0  #: overlap of the next segment with the previous one [s]
        self.turning = 0.0  #: spindle speed [1/min]
        self.exact = False
        self.straight = 0.0  #: maximum distance of points from a line that replaces several lines [mm]
        self.chain: list[Point] = []  #: points of the lines to be replaced, including the start
        self.chained: tuple[int, Move, Block] | None = None  #: last of the lines to be replaced
        self.last: Segment | None = None  #: last segment, whose end is still open
        self.tolerance: float | None = None  #: tolerance at the end of `last`
        self.ahead: list[tuple[Segment, float]] = []  #: segments to be timed, with accelerations
        self.waiting: deque[tuple[int, Block]] = deque()
        self.done: list[Timed] = []

    def add(self, serial: int, block: Block) -> None:
        """Plan the moves and pauses of the next block."""
        kinematics, codes = self.kinematics, block.codes
        before = 0.0
        halts = "S" in block.words
        if codes or not serial:
            halts = halts or not HALTS.isdisjoint(codes)
            if not serial or "G61.1" in codes or "G61" in codes or "G64" in codes:
                self._unchain()
                self.exact, self.straight = block.modal.exact_stop, block.modal.naive
        if block.tool_change is not None:
            before += kinematics.tool_change
        if block.speed != self.turning:
            self.turning = block.speed
            before += kinematics.spindle
        after = block.pause + (kinematics.stop if block.stops else 0.0)
        if before or halts or len(self.waiting) > 20 * CHUNK:
            self.halt(0.0)
        self.now += before
        self.waiting.append((serial, block))
        if block.moves:
            for move in block.moves:
                if self.straight and not (move.rapid or move.rotary or move.seconds) and move.arc is None:
                    self._chain(serial, move, block)
                else:
                    self._unchain()
                    self._join(serial, move, block)
        if after or block.ends or block.kind == "probe" or (self.last is None and self.chained is None):
            self.halt(after)

    def halt(self, pause: float) -> None:
        """Bring the axes to a stop, and wait for the duration of a pause [s]."""
        self._unchain()
        if self.last is not None:
            self._push(self.last, self.tolerance is not None)
            self.last = None
        if self.ahead:
            self._run(len(self.ahead))
        self.now += pause
        while self.waiting:
            self._finish()

    def _chain(self, serial: int, move: Move, block: Block) -> None:
        """Replace feed lines by a single line while it passes close enough to their ends."""
        if self.chained is not None and (self.chained[1].feed != move.feed or not self._near(move.end)):
            self._unchain()
        if self.chained is None:
            self.chain = [move.start]
        self.chain.append(move.end)
        self.chained = (serial, move, block)

    def _near(self, end: Point) -> bool:
        """Return whether a straight line to this end passes close to all points that it would replace."""
        chain, most = self.chain, self.straight * self.straight
        if len(chain) > CHAIN:
            return False
        x, y, z = chain[0]
        ux, uy, uz = end[0] - x, end[1] - y, end[2] - z
        square = ux * ux + uy * uy + uz * uz
        if not square:
            return False
        for px, py, pz in chain:
            px, py, pz = px - x, py - y, pz - z  # noqa: PLW2901
            t = (px * ux + py * uy + pz * uz) / square
            t = 0.0 if t < 0.0 else min(t, 1.0)
            if (px - t * ux) ** 2 + (py - t * uy) ** 2 + (pz - t * uz) ** 2 > most:
                return False
        return True

    def _unchain(self) -> None:
        """Plan the single line that replaces the chained feed lines."""
        if self.chained is not None:
            serial, move, block = self.chained
            self.chained = None
            self._join(serial, Move(rapid=False, start=self.chain[0], end=move.end, feed=move.feed), block)

    def _finish(self) -> None:
        """Assign start and end time to the first block that waits for them."""
        self.done.append(Timed(self.waiting.popleft()[1], self.since, self.now))
        self.since = self.now

    def _join(self, serial: int, move: Move, block: Block) -> None:
        """Append the segment of a move, with a corner transition from the last one."""
        segment = self.segments.of(serial, move, block)
        if segment is None:
            return
        last = self.last
        if last is not None:
            arc = None if self.exact else self.corners.join(last, segment, self.tolerance)
            self._push(last)
            if arc is not None:
                self._push(arc)
        self.last, self.tolerance = segment, block.modal.blend
        if block.kind == "cycle" and not _lifts(segment, block):
            self.tolerance = None

    def _push(self, segment: Segment, last: bool = False) -> None:
        if segment.length <= 0.0:
            return
        self.ahead.append((segment, segment.finish(self.kinematics.cycle, last)))
        if len(self.ahead) >= CHUNK + AHEAD:
            self._run(CHUNK)

    def _run(self, count: int) -> None:
        """Compute the duration of a number of segments, from the first one on."""
        ahead, cycle = self.ahead, self.kinematics.cycle
        squares = self._leaving()
        sqrt = math.sqrt
        now, v = self.now, self.speed
        waiting = self.waiting
        for k in range(count):
            segment, a = ahead[k]
            if waiting[0][0] < segment.owner:
                self.now = now
                while waiting[0][0] < segment.owner:
                    self._finish()
            now -= self.shared
            self.shared = 0.0
            length, top = segment.length, segment.speed
            w = sqrt(min(squares[k], v * v + 2.0 * a * length))
            if w and not segment.rapid and 2.0 * length < STEADY * (v + w):
                now += 2.0 * length / (v + w)
            else:
                peak = v * v + w * w
                p = min(top, sqrt(peak / 2.0 + a * length))
                now += (2.0 * p - v - w) / a + (length - (2.0 * p * p - peak) / (2.0 * a)) / p
                if segment.overlap is not None:
                    # the block changes when both segments are equally fast
                    following, b = ahead[k + 1]
                    below = min(p, find_overlap_speeds(segment.overlap, segment, a, following, b, 1.0)[0])
                    self.shared = below / (a + b)
                    now -= below / a - self.shared
                elif not w:
                    now += cycle / 2.0  # the next segment begins in a separate cycle
            v = w
        self.now, self.speed = now, v
        del ahead[:count]

    def _leaving(self) -> list[float]:
        """Return the squares of the maximum speeds at the ends of the segments from which all can stop in time."""
        ahead = self.ahead
        n = len(ahead)
        squares = [0.0] * n
        ways = [0.0] * n  # decrease of the squared speed by braking from here to the end of the look-ahead
        square = way = 0.0
        following = 0.0
        for k in range(n - 1, -1, -1):
            segment, a = ahead[k]
            most = min(segment.through, segment.speed, following)
            square = min(square, most * most)
            stop = k + AHEAD
            squares[k] = min(square, way - ways[stop]) if stop < n else square
            ways[k] = way
            shed = 2.0 * a * segment.length
            square += shed
            way += shed
            following = segment.speed
        return squares


def _lifts(segment: Segment, block: Block) -> bool:
    """Return whether a segment of a cycle is the retract to R: the following ones are run exactly."""
    first = block.moves[0]
    i, j, k = PLANES[block.modal.plane]
    up = first.end[k] > first.start[k] and first.end[i] == first.start[i] and first.end[j] == first.start[j]
    return up and segment.nominal == first.end[k] - first.start[k] and segment.leave[k] > 0.0
