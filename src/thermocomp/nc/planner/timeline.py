"""When a controller runs which line: speeds, accelerations and corners of the moves, pauses and tool changes."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from thermocomp.core.exceptions import SettingError
from thermocomp.core.machine import Machine
from thermocomp.nc.interpreter.block import PLANES, Block, Move, Point
from thermocomp.nc.interpreter.codes import ADDITIONAL_SYSTEMS
from thermocomp.nc.planner.corners import Corners, find_overlap_speeds
from thermocomp.nc.planner.segment import Segment, Segments, Vector

#: of an axis whose machine file does not tell: a machining centre of medium size [mm/min, mm/s2]
RAPID, ACCELERATION = 30_000.0, 3000.0
#: segments that the controller looks ahead
AHEAD = 50
#: segments that are planned at once
CHUNK = 500
#: points that one line may replace
CHAIN = 100
#: a feed segment that takes less time than that gets one steady acceleration [s]
STEADY = 0.01
#: the axes come to a stop before these, as they do at LinuxCNC: pauses, probing, other coordinates, what has to be
#: done at a place
HALTS = frozenset(
    {"G4", "G10", "G31", "G38.2", "G38.3", "G38.4", "G38.5", "G43", "G43.1", "G43.2", "G44", "G49", "G52"}
    | {
        "G68",
        "G69",
        "G54",
        "G55",
        "G56",
        "G57",
        "G58",
        "G59",
        "G59.1",
        "G59.2",
        "G59.3",
        "G92",
        "G92.1",
        "G92.2",
        "G92.3",
    }
    | {"M0", "M1", "M2", "M3", "M4", "M5", "M6", "M7", "M8", "M9", "M19", "M30", "M60", "M61", "M64", "M65", "M66"}
    | {"M98", "M99"}
    | ADDITIONAL_SYSTEMS
)


@dataclass(frozen=True)
class MotionLimits:
    """Dynamics of a machine and its controller.

    Parameters
    ----------
    rapid : tuple of float
        Most speed of X, Y, Z [mm/min].
    acceleration : tuple of float
        Most acceleration of X, Y, Z [mm/s2].
    feed : float
        Most feed along the path [mm/min].
    rotary_rapid : float
        Most speed of a rotary axis [deg/min].
    rotary_acceleration : float
        [deg/s2]
    tool_change : float
        From the last move before a tool change to the first one after it [s].
    stop : float
        Duration of M0, M1 and M60 [s]: the operator decides.
    spindle : float
        Delay of the program by a change of the spindle speed [s].
    cycle : float
        Interpolation cycle of the controller [s].

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

    def __post_init__(self) -> None:
        for key in ("rapid", "acceleration"):
            numbers = getattr(self, key)
            if not all(0 < v < math.inf for v in numbers):
                raise SettingError(f"{numbers}: must be positive", (key,))
        for key in ("feed", "rotary_rapid", "rotary_acceleration", "cycle"):
            if not getattr(self, key) > 0:
                raise SettingError(f"{getattr(self, key)}: must be positive", (key,))
        for key in ("tool_change", "stop", "spindle"):
            if not 0 <= getattr(self, key) < math.inf:
                raise SettingError(f"{getattr(self, key)}: must not be negative", (key,))

    @classmethod
    def of(cls, machine: Machine, **others: float) -> "MotionLimits":
        """Return those of a machine file.

        Parameters
        ----------
        machine : Machine
            Axes that are not there or do not tell go as those of a medium machining centre.
        **others : float
            The numbers that are not of one axis, such as ``tool_change``.
        """
        axes = {a.name: a for a in machine.axes}

        def told(key: str, otherwise: float) -> Vector:
            x, y, z = (getattr(axes.get(name), key, None) or otherwise for name in "XYZ")
            return (x, y, z)

        return cls(told("rapid", RAPID), told("acceleration", ACCELERATION), **others)


class Timed(NamedTuple):
    """A block, and when it is run."""

    block: Block
    start: float  #: [s] since the program was started
    end: float  #: [s]


def time_blocks(blocks: Iterable[Block], kinematics: MotionLimits) -> Iterator[Timed]:
    """Return the start and end time of each block.

    A corner that is cut counts to the block after it, as it does at LinuxCNC, and of lines that become one under
    ``G64 P`` the last one takes the time. Memory is bounded: some hundred moves are looked ahead.

    Parameters
    ----------
    blocks : iterable of Block
    kinematics : MotionLimits

    Yields
    ------
    Timed
        One for each block, in their order.

    Raises
    ------
    ProgramError
        A move in feed has no feed, or an arc has no radius.
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
    """Moves ahead of the controller, and those it has completed."""

    def __init__(self, kinematics: MotionLimits) -> None:
        self.kinematics = kinematics
        x, y, z = kinematics.rapid
        speeds = (x / 60.0, y / 60.0, z / 60.0)
        rotary = (kinematics.rotary_rapid / 60.0, kinematics.rotary_acceleration)
        self.segments = Segments(speeds, kinematics.acceleration, kinematics.feed / 60.0, rotary)
        self.corners = Corners(speeds, kinematics.acceleration, kinematics.cycle)
        self.now = 0.0  #: the segments up to here are timed [s]
        self.since = 0.0  #: the blocks up to here are done [s]
        self.speed = 0.0  #: of the path at that time [mm/s]
        self.shared = 0.0  #: how long the next segment runs beside the one before it [s]
        self.turning = 0.0  #: of the spindle [1/min]
        self.exact = False
        self.straight = 0.0  #: how far points may be off a line that replaces their lines [mm]
        self.chain: list[Point] = []  #: of such a line, from where it begins
        self.chained: tuple[int, Move, Block] | None = None  #: the last one that it replaces
        self.last: Segment | None = None  #: its end is still open
        self.tolerance: float | None = None  #: at the end of that
        self.ahead: list[tuple[Segment, float]] = []  #: with accelerations
        self.waiting: deque[tuple[int, Block]] = deque()
        self.done: list[Timed] = []

    def add(self, serial: int, block: Block) -> None:
        """Add a block."""
        kinematics, codes = self.kinematics, block.codes
        before = 0.0
        halts = "S" in block.words
        if codes or not serial:
            halts = halts or not HALTS.isdisjoint(codes)
            if not serial or "G61.1" in codes or "G61" in codes or "G64" in codes:
                self._path_mode(block)
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
                    self._join(self.segments.of(serial, move, block), block)
        if after or block.ends or block.kind == "probe" or (self.last is None and self.chained is None):
            self.halt(after)

    def halt(self, pause: float) -> None:
        """Stop, and wait [s]."""
        self._unchain()
        if self.last is not None:
            self._push(self.last, self.tolerance is not None)
            self.last = None
        if self.ahead:
            self._run(len(self.ahead))
        self.now += pause
        while self.waiting:
            self._finish()

    def _path_mode(self, block: Block) -> None:
        """Set how exact the path is from here on."""
        self._unchain()
        self.exact, self.straight = block.modal.exact_stop, block.modal.naive

    def _chain(self, serial: int, move: Move, block: Block) -> None:
        """Replace lines in feed by one, as long as it passes near enough by their ends."""
        if self.chained is not None and (self.chained[1].feed != move.feed or not self._near(move.end)):
            self._unchain()
        if self.chained is None:
            self.chain = [move.start]
        self.chain.append(move.end)
        self.chained = (serial, move, block)

    def _near(self, end: Point) -> bool:
        """Return whether a line to there passes near all points of the chain."""
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
        """Add the line of the chain."""
        if self.chained is not None:
            serial, move, block = self.chained
            self.chained = None
            self._join(
                self.segments.of(
                    serial, Move(rapid=False, start=self.chain[0], end=move.end, arc=None, feed=move.feed), block
                ),
                block,
            )

    def _finish(self) -> None:
        """End the first block that waits."""
        self.done.append(Timed(self.waiting.popleft()[1], self.since, self.now))
        self.since = self.now

    def _join(self, segment: Segment | None, block: Block) -> None:
        """Put a segment behind the last one."""
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
        """Time the first segments."""
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
                    # the block changes when both are equally fast
                    following, b = ahead[k + 1]
                    below = min(p, find_overlap_speeds(segment.overlap, segment, a, following, b, 1.0)[0])
                    self.shared = below / (a + b)
                    now -= below / a - self.shared
                elif not w:
                    now += cycle / 2.0  # the next one begins in a cycle of its own
            v = w
        self.now, self.speed = now, v
        del ahead[:count]

    def _leaving(self) -> list[float]:
        """Return the squares of the most speeds at the ends of the segments, such that all can brake in time."""
        ahead = self.ahead
        n = len(ahead)
        squares = [0.0] * n
        ways = [0.0] * n  # what braking from here to the end of what lies ahead would shed
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
    """Return whether a segment of a cycle is the retract to its height R: all that follows that is run exactly."""
    first = block.moves[0]
    i, j, k = PLANES[block.modal.plane]
    up = first.end[k] > first.start[k] and first.end[i] == first.start[i] and first.end[j] == first.start[j]
    return up and segment.nominal == first.end[k] - first.start[k] and segment.leave[k] > 0.0
