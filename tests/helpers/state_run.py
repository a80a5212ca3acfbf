"""Runs a program in drawn states of a controller: its moves in machine coordinates, and how long each takes."""

import math
import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from thermocomp.core.exceptions import ThermocompError
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.rs274process import InterpreterJob, InterpreterRun

#: states that are drawn
STATES = 8
#: an axis that moves less stands still [mm, deg]
STILL = 1e-6
MOVES = frozenset(("rapid", "feed", "arc", "probe", "tap", "curve"))

_OFFSETS = frozenset(("g5x", "g92", "length", "tooltable"))
_SAID = frozenset(("comment", "message"))
_STOPS = re.compile(r"M0*(0|1|6|60)(?!\d)")


class Move(NamedTuple):
    """A move as the machine makes it."""

    kind: str
    line: int
    start: rs274.Place  #: machine coordinates [mm, deg]
    end: rs274.Place
    arc: rs274.ArcPath | None
    points: tuple[rs274.Place, ...]  #: of a curve
    seconds: float  #: nominal, of moves in feed; 0 for rapids
    steps: float  #: way of X, Y, Z [mm]


@dataclass(frozen=True)
class State:
    """What is stored in the controller, whether optional lines are skipped, and whether somebody moves the axes."""

    stored: rs274.Stored
    skip: bool = False
    jog: tuple[float, float, float] | None = None  #: at M0, M1, M60 and M6, to there [mm]


@dataclass(frozen=True)
class Stated:
    """What is said of the controller, which is so in every state.

    Parameters
    ----------
    no_rotation, no_shift : bool
        No work coordinate system is rotated, and no G92 is in force at the start.
    """

    no_rotation: bool
    no_shift: bool


def states(seed: int, stated: Stated, count: int = STATES) -> list[State]:
    """Return drawn states: those that differ in all that is not stated, one with optional lines, two with a jog."""
    draw = random.Random(seed)
    drawn = [State(_stored(draw, stated, k)) for k in range(count)]
    drawn[-3] = replace(drawn[-3], skip=True)
    drawn[-2] = replace(drawn[-2], jog=_near(draw, 200.0))
    drawn[-1] = replace(drawn[-1], skip=True, jog=_near(draw, 400.0))
    return drawn


def _stored(draw: random.Random, stated: Stated, k: int) -> rs274.Stored:
    def place(most: float, low: float, high: float) -> tuple[float, ...]:
        x, y = (draw.uniform(-most, most) for _ in range(2))
        turned = [draw.choice((0.0, draw.uniform(-180, 180))) for _ in range(3)]
        return (x, y, draw.uniform(low, high), *turned, 0.0, 0.0, 0.0)

    if not k:  # a controller that nobody has touched
        return rs274.Stored(startup="G64 G98")
    shift: tuple[float, ...] = ()
    if not stated.no_shift and draw.random() < 0.5:
        shift = place(40.0, -40.0, 40.0)
    rotations = {}
    if not stated.no_rotation:
        rotations = {n: draw.choice((0.0, 90.0, draw.uniform(-45, 45))) for n in range(1, 10)}
        if k % 2:  # arcs of G18 and G19 and cycles run without one only
            rotations = {}
    return rs274.Stored(
        origins={n: place(300.0, -480.0, 60.0) for n in range(1, 10)},
        rotations=rotations,
        shift=shift,
        lengths={n: draw.uniform(20.0, 200.0) for n in range(1, 10)},
        diameters={n: draw.uniform(1.0, 4.0) for n in range(1, 10)},
        active_length=draw.choice((0.0, draw.uniform(20.0, 200.0))),
        spindle=draw.randint(0, 6),
        home28=place(300.0, -50.0, 50.0),
        home30=place(300.0, -50.0, 50.0),
        startup=f"{draw.choice(('G64', 'G61', 'G64 P0.02'))} {'G99' if k % 3 else 'G98'}",
        start=place(300.0, -400.0, 0.0),
    )


def _near(draw: random.Random, most: float) -> tuple[float, float, float]:
    return draw.uniform(-most, most), draw.uniform(-most, most), draw.uniform(-most, 0.0)


@dataclass
class Ran:
    """A program as the interpreter ran it."""

    moves: list[Move] = field(default_factory=list)
    #: every call in order: kind, line of the program, numbers, text
    calls: list[tuple[str, int, tuple[float, ...], str]] = field(default_factory=list)
    left: dict[int, float] = field(default_factory=dict)  #: parameters the controller would have stored afterwards


def run(text: str, drawn: Sequence[State], folder: Path) -> list[Ran | ThermocompError]:
    """Run a program in states; where the interpreter refuses it, its error stands in the place of the run."""
    path = folder / "judged.ngc"
    plain = re.sub(r"[^\n\x20-\x7e\t%]", "?", text.replace("\r", "")).split("\n")
    found: list[Ran | ThermocompError] = []
    for jog, group in groupby(drawn, key=lambda state: state.jog):  # a hand at the machine makes another program
        lines, numbers = _jogged(plain, jog) if jog else (plain, range(1, len(plain) + 1))
        path.write_text("\n".join(lines), encoding="ascii")
        modes = [mode.feed for mode in followed(lines)]
        jobs = [InterpreterJob(path, state.stored, block_delete=state.skip) for state in group]
        with InterpreterRun(*jobs) as runs:
            for _ in jobs:
                try:
                    found.append(_told(runs, modes, numbers))
                except ThermocompError as error:
                    found.append(error)
    return found


def _told(runs: InterpreterRun, modes: Sequence[int], numbers: Sequence[int]) -> Ran:
    ran, machine = Ran(), _Machine()
    for call in rs274.calls(runs):
        line = numbers[min(call.line, len(numbers)) - 1] if call.line else 0
        if call.kind in MOVES:
            move = machine.move(call, line)
            if line or not call.line:  # else a hand at the machine
                ran.calls.append((call.kind, line, (), ""))
                ran.moves.append(move)
            continue
        machine.take(call)
        if line and call.kind not in _OFFSETS and call.kind not in _SAID:
            # in G93 LinuxCNC makes a feed of F and the length of the move: there its time is compared
            inverse = call.kind == "feedrate" and modes[min(call.line, len(modes)) - 1] == 93
            ran.calls.append((call.kind, line, () if inverse else call.values, call.text))
    ran.left.update(runs.left())
    return ran


class _Machine:
    """Where it stands, and what tells how long its moves take."""

    def __init__(self) -> None:
        self.frame = rs274.ProgramFrame()
        self.here = rs274.ORIGIN
        self.feed = 0.0, 0.0
        self.speed = self.pitch = 0.0
        self.turning = self.per_turn = False

    def take(self, call: rs274.Canonical) -> None:
        kind, values = call.kind, call.values
        self.frame.take(kind, values)
        if kind == "feedrate":
            self.feed = values[0], values[1]
        elif kind == "speed":
            self.speed = abs(values[1])
        elif kind in ("m3", "m4", "m5"):
            self.turning = kind != "m5"
        elif kind == "feedmode":
            self.per_turn = bool(values[1])
        elif kind in ("sync", "unsync"):
            self.pitch = values[1] if values else 0.0

    def move(self, call: rs274.Canonical, line: int) -> Move:
        start, end, values, points = self.here, call.machine, call.values, tuple[rs274.Place, ...]()
        if call.kind == "tap":  # there, and back
            end = self.frame.machine((values[0], values[1], values[2], *self.frame.program(start)[3:]))
        elif call.kind == "curve":
            there = self.frame.program(start)[2:]
            points = tuple(self.frame.machine((x, y, *there)) for x, y in zip(values[1::3], values[2::3], strict=True))
            end = points[-1]
        self.here = start if call.kind == "tap" else end
        way = _way(start, end, call.arc, points)
        seconds = 0.0 if call.kind == "rapid" else self._seconds(way, turned(start, end))
        return Move(call.kind, line, start, end, call.arc, points, seconds, way)

    def _seconds(self, way: float, angle: float) -> float:
        """Return the nominal time of a move; a feed of rotary axes alone counts degrees."""
        length, rate = (way, self.feed[0]) if way >= STILL else (angle, self.feed[1])
        speed = self.speed if self.turning else 0.0
        if self.pitch:
            rate = self.pitch * speed
        elif self.per_turn:
            rate *= speed
        return length / rate * 60.0 if rate else 0.0


def _way(start: rs274.Place, end: rs274.Place, arc: rs274.ArcPath | None, points: Sequence[rs274.Place]) -> float:
    if points:
        return math.fsum(math.dist(a[:3], b[:3]) for a, b in zip((start, *points), points, strict=False))
    if arc is None:
        return math.dist(start[:3], end[:3])
    i, j, k = rs274.PLANE_AXES[arc.plane]
    p, q = arc.machine_centre[i], arc.machine_centre[j]
    angle = math.atan2(end[j] - q, end[i] - p) - math.atan2(start[j] - q, start[i] - p)
    angle = angle % math.tau if arc.turns > 0 else -(-angle % math.tau)
    if abs(angle) < 1e-5:
        angle = math.copysign(math.tau, arc.turns)
    angle = abs(angle) + (abs(arc.turns) - 1) * math.tau
    radius = (math.dist((start[i], start[j]), (p, q)) + math.dist((end[i], end[j]), (p, q))) / 2.0
    return math.hypot(radius * angle, end[k] - start[k])


def turned(start: rs274.Place, end: rs274.Place) -> float:
    """Return the way of the rotary axes [deg]."""
    return math.dist(start[3:6], end[3:6])


def bare(line: str) -> str:
    """Return a line without its comments and spaces, its letters capital."""
    return re.sub(r"\([^)]*\)|;.*|\s", "", line).upper()


class Mode(NamedTuple):
    """Modal codes in force in a line."""

    motion: str = ""  #: such as ``G1`` or ``G81``; empty if the program has not said it
    feed: int = 94
    absolute: bool = True
    inch: bool = False
    cutter: bool = False

    @property
    def drills(self) -> bool:
        """Whether it is a cycle."""
        return self.motion > "G7" and self.motion != "G80"


def followed(lines: Sequence[str]) -> list[Mode]:
    """Return the modal codes of each line, of programs without loops and branches."""
    mode, found = Mode(), []
    for line in lines:
        text = bare(line)
        for code in () if text.startswith("#") else re.findall(r"G(\d+(?:\.\d)?)", text):
            if code in ("90", "91"):
                mode = mode._replace(absolute=code == "90")
            elif code in ("20", "21"):
                mode = mode._replace(inch=code == "20")
            elif code in ("93", "94", "95"):
                mode = mode._replace(feed=int(code))
            elif code in ("40", "41", "41.1", "42", "42.1"):
                mode = mode._replace(cutter=code != "40")
            elif re.fullmatch(r"0*[0123]|7[34]|8\d", code):
                mode = mode._replace(motion=f"G{int(code)}")
        found.append(mode)
    return found


def _jogged(lines: Sequence[str], place: tuple[float, float, float]) -> tuple[list[str], list[int]]:
    """Return a program in which the axes go elsewhere at every stop and tool change, as an operator's hand does it.

    Beside each of its lines stands the number that it had; 0 for those that are new.
    """
    out, numbers = [], []
    for number, (line, mode) in enumerate(zip(lines, followed(lines), strict=True), 1):
        out.append(line)
        numbers.append(number)
        text = bare(line)
        if mode.cutter or mode.drills or mode.motion in ("G2", "G3") or not _STOPS.search(text):
            continue
        unit = 25.4 if mode.inch else 1.0
        words = " ".join(f"{letter}{value / unit:.6f}" for letter, value in zip("XYZ", place, strict=True))
        mark = "/" if text.startswith("/") else ""
        out += [f"{mark}G90 G53 G0 {words}", f"{mark}{mode.motion or 'G80'}{'' if mode.absolute else ' G91'}"]
        numbers += [0, 0]
    return out, numbers
