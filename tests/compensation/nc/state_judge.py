"""Judges a revised program on its own: LinuxCNC's interpreter runs it and the original in drawn states of a controller.

It knows nothing of what the revision wanted; it asks what has to hold of any revision: every move is that of the
original but for a small shift that is the same whatever is stored in the controller, takes the time it took, and all
else is as it was.
"""

import math
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from thermocomp.core.exceptions import ProgramError, ThermocompError
from thermocomp.shopfloor import rs274

Vector = tuple[float, float, float]

#: states that are drawn
STATES = 8
#: difference that is rounding [um]
ROUNDING = 0.1
#: a shift may be larger than the largest correction asked for by this [um]
OVER = 0.2
#: an axis that moves less stands still [mm, deg]
STILL = 1e-6
#: of the time of a feed move
SHARE, SECONDS = 0.02, 0.005

_OFFSETS = frozenset(("g5x", "g92", "length", "tooltable"))
_SAID = frozenset(("comment", "message"))
_MOVES = frozenset(("rapid", "feed", "arc", "probe", "tap", "curve"))
_CODE = re.compile(r"G(\d+(?:\.\d)?)")
_STOPS = re.compile(r"M0*(0|1|6|60)(?!\d)")


class WrongError(Exception):
    """The revised program is not right; the text says where and why."""


class InvalidError(Exception):
    """The original does not run in any drawn state."""


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


def _near(draw: random.Random, most: float) -> Vector:
    return draw.uniform(-most, most), draw.uniform(-most, most), draw.uniform(-most, 0.0)


@dataclass
class Ran:
    """A program as the interpreter ran it."""

    moves: list[Move]
    #: every call in order: kind, line of the program, numbers; of moves the place in `moves`
    calls: list[tuple[str, int, tuple[float, ...], str]]
    left: dict[int, float]


def run(text: str, state: State, folder: Path) -> Ran:
    """Run a program in a state.

    Raises
    ------
    ThermocompError
        The interpreter refuses it.
    """
    path = folder / "judged.ngc"
    lines = re.sub(r"[^\n\x20-\x7e\t%]", "?", text).split("\n")
    numbers: Sequence[int] = range(1, len(lines) + 1)
    if state.jog:
        lines, numbers = _jogged(lines, state.jog)
    path.write_text("\n".join(lines), encoding="ascii")
    modes = _feed_modes(lines)
    left: dict[int, float] = {}
    ran = Ran([], [], left)
    frame, here, feed, speed, turning, mode, pitch = rs274.Frame(), rs274.ORIGIN, (0.0, 0.0), 0.0, False, 94, 0.0
    for call in rs274.read(path, state.stored, block_delete=state.skip, left=left):
        frame.take(call.kind, call.values)
        kind, values = call.kind, call.values
        line = numbers[min(call.line, len(numbers)) - 1] if call.line else 0
        if call.line and not line:  # a hand at the machine
            here = call.machine if kind in _MOVES else here
            continue
        if kind in _MOVES:
            points: tuple[rs274.Place, ...] = ()
            end = call.machine
            if kind == "tap":  # there, and back
                end = frame.machine((values[0], values[1], values[2], *frame.program(here)[3:]))
            elif kind == "curve":
                there = frame.program(here)[2:]
                points = tuple(frame.machine((x, y, *there)) for x, y in zip(values[1::3], values[2::3], strict=True))
                end = points[-1]
            way = _way(here, end, call.arc, points)
            seconds = 0.0
            if kind != "rapid":
                seconds = _seconds(way, _turned(here, end), feed, pitch, speed if turning else 0.0, mode)
            ran.calls.append((kind, line, (len(ran.moves),), ""))
            ran.moves.append(Move(kind, line, here, end, call.arc, points, seconds, way))
            here = here if kind == "tap" else end
            continue
        if kind == "feedrate":
            feed = values[0], values[1]
        elif kind == "speed":
            speed = values[1]
        elif kind in ("m3", "m4", "m5"):
            turning = kind != "m5"
        elif kind == "feedmode":
            mode = 95 if values[1] else 94
        elif kind == "sync":
            pitch = values[1]
        elif kind == "unsync":
            pitch = 0.0
        if line and kind not in _OFFSETS and kind not in _SAID:
            if kind == "feedrate" and modes[min(call.line, len(modes)) - 1] == 93:
                values = ()  # LinuxCNC makes a feed of it, by the length of the move: its time is compared
            ran.calls.append((kind, line, values, call.text))
    return ran


def _seconds(
    way: float, turned: float, feed: tuple[float, float], pitch: float, speed: float, mode: int
) -> float:
    """Return the nominal time of a move; a feed of rotary axes alone counts degrees."""
    length, rate = (way, feed[0]) if way >= STILL else (turned, feed[1])
    if pitch:
        rate = pitch * abs(speed)
    elif mode == 95:
        rate *= abs(speed)
    return length / rate * 60.0 if rate else 0.0


def _way(start: rs274.Place, end: rs274.Place, arc: rs274.ArcPath | None, points: Sequence[rs274.Place]) -> float:
    if points:
        return math.fsum(math.dist(a[:3], b[:3]) for a, b in zip((start, *points), points, strict=False))
    if arc is None:
        return math.dist(start[:3], end[:3])
    i, j, k = rs274.PLANE_AXES[arc.plane]
    p, q = arc.machine_centre[i], arc.machine_centre[j]
    angle = math.atan2(end[j] - q, end[i] - p) - math.atan2(start[j] - q, start[i] - p)
    if arc.turns > 0:
        angle = angle % math.tau
    else:
        angle = -(-angle % math.tau)
    if abs(angle) < 1e-5:
        angle = math.copysign(math.tau, arc.turns)
    angle = abs(angle) + (abs(arc.turns) - 1) * math.tau
    radius = (math.dist((start[i], start[j]), (p, q)) + math.dist((end[i], end[j]), (p, q))) / 2.0
    return math.hypot(radius * angle, end[k] - start[k])


def _turned(start: rs274.Place, end: rs274.Place) -> float:
    return math.dist(start[3:6], end[3:6])


def _bare(line: str) -> str:
    """Return a line without its comments and spaces, its letters capital."""
    return re.sub(r"\([^)]*\)|;.*|\s", "", line).upper()


def _feed_modes(lines: Sequence[str]) -> list[int]:
    modes, mode = [], 94
    for line in lines:
        for found in re.findall(r"G(9[345])(?![.\d])", _bare(line)):
            mode = int(found)
        modes.append(mode)
    return modes


def _jogged(lines: Sequence[str], place: Vector) -> tuple[list[str], list[int]]:
    """Return a program in which the axes go elsewhere at every stop and tool change, as an operator's hand does it.

    Beside each of its lines stands the number that it had; 0 for those that are new.
    """
    out, numbers = [], []
    motion, absolute, inch, busy = "", True, False, False
    for number, line in enumerate(lines, 1):
        out.append(line)
        numbers.append(number)
        bare = _bare(line)
        if bare.startswith(("#", "%")):
            continue
        for code in _CODE.findall(bare):
            if code in ("90", "91"):
                absolute = code == "90"
            elif code in ("20", "21"):
                inch = code == "20"
            elif code in ("40", "41", "41.1", "42", "42.1"):
                busy = code != "40"
            elif re.fullmatch(r"0*[0123]|7[34]|8\d", code):
                motion = f"G{int(code)}"
        if busy or not _STOPS.search(bare) or motion not in ("", "G0", "G1", "G80"):
            continue
        unit = 25.4 if inch else 1.0
        words = " ".join(f"{letter}{value / unit:.6f}" for letter, value in zip("XYZ", place, strict=True))
        mark = "/" if bare.startswith("/") else ""
        out += [f"{mark}G90 G53 G0 {words}", f"{mark}{motion or 'G80'}{'' if absolute else ' G91'}"]
        numbers += [0, 0]
    return out, numbers


class Judgement(NamedTuple):
    """What was found; there is nothing wrong."""

    states: int  #: in which both programs were run
    moves: int  #: compared, in all states


def judge(
    original: str,
    revised: str,
    most: Vector,
    drawn: Sequence[State],
    folder: Path,
) -> Judgement:
    """Compare two programs in states of a controller.

    Parameters
    ----------
    original, revised : str
    most : tuple of float
        The largest correction asked for, of X, Y and Z [um].
    drawn : sequence of State
    folder : Path
        Where files may be written.

    Returns
    -------
    Judgement

    Raises
    ------
    WrongError
        The revised program is not right.
    InvalidError
        The interpreter refuses the original in most of the states.
    """
    machine = _machine_lines(original)
    compared = moves = 0
    first: dict[bool, dict[int, Vector]] = {}
    for number, state in enumerate(drawn):
        try:
            was = run(original, state, folder)
        except ThermocompError:
            continue  # such as arcs of G18 in rotated coordinates
        try:
            now = run(revised, state, folder)
        except ProgramError as error:
            raise WrongError(f"state {number}: the interpreter refuses the revised program: {error}") from error
        try:
            shifts = list(_compare(was, now, most, machine if not state.jog else {}))
            if not state.jog:
                first.setdefault(state.skip, _lasts(was, shifts))
            _same(was, shifts, first.get(state.skip, {}), bool(state.jog))
        except WrongError as error:
            raise WrongError(f"state {number}: {error}") from error
        compared += 1
        moves += len(was.moves)
    if compared < len(drawn) / 2:
        raise InvalidError(f"it runs in {compared} of {len(drawn)} states")
    return Judgement(compared, moves)


def _compare(was: Ran, now: Ran, most: Vector, machine: dict[int, tuple[int, ...]]) -> Iterator[Vector]:
    """Yield by how much each move is shifted [um]."""
    for a, b in zip_longest(was.calls, now.calls):
        if a is None or b is None or a[0] != b[0]:
            line = (a or b)[1]
            raise WrongError(f"line {line}: '{b[0] if b else 'nothing'}' instead of '{a[0] if a else 'nothing'}'")
        if a[0] in _MOVES:
            yield _moved(was.moves[int(a[2][0])], now.moves[int(b[2][0])], most)
        elif a[3] != b[3] or not all(
            math.isclose(p, q, rel_tol=1e-9, abs_tol=1e-9) for p, q in zip_longest(a[2], b[2], fillvalue=math.nan)
        ):
            raise WrongError(f"line {a[1]}: '{a[0]}' gives {b[2]} {b[3]} instead of {a[2]} {a[3]}")
    _in_machine(was, now, machine)
    _left(was.left, now.left)


def _moved(a: Move, b: Move, most: Vector) -> Vector:
    shift = _shift(a.end, b.end)
    where = f"line {a.line}, {a.kind}"
    for value, limit, letter in zip(shift, most, "XYZ", strict=True):
        if abs(value) > limit + OVER:
            raise WrongError(f"{where}: {letter} is shifted by {value:.1f} um, and {limit:.1f} um was the most")
    if any(abs(p - q) > STILL for p, q in zip(a.end[3:], b.end[3:], strict=True)):
        raise WrongError(f"{where}: another axis than X, Y, Z goes elsewhere")
    if a.steps < STILL <= b.steps and _turned(a.start, a.end) > STILL:
        raise WrongError(f"{where}: moves X, Y or Z by {b.steps * 1e3:.2f} um, the original only turns")
    if a.kind != "rapid":
        allowed = max(SHARE * a.seconds, SECONDS) if a.steps >= STILL else 1e-6 * a.seconds
        if abs(a.seconds - b.seconds) > allowed:
            raise WrongError(f"{where}: takes {b.seconds:.4f} s instead of {a.seconds:.4f} s")
    if len(a.points) != len(b.points) or (a.arc is None) != (b.arc is None):
        raise WrongError(f"{where}: another curve")
    for p, q in zip(a.points, b.points, strict=True):
        if max(map(abs, map(float.__sub__, _shift(p, q), shift))) > ROUNDING:
            raise WrongError(f"{where}: a point of the curve is shifted otherwise than its end")
    if a.arc and b.arc:
        if (a.arc.plane, a.arc.turns) != (b.arc.plane, b.arc.turns):
            raise WrongError(f"{where}: turns another way")
        i, j, _ = rs274.PLANE_AXES[a.arc.plane]
        for k in (i, j):
            moved = (b.arc.machine_centre[k] - a.arc.machine_centre[k]) * 1e3
            begun = (b.start[k] - a.start[k]) * 1e3
            if abs(moved - shift[k]) > ROUNDING or abs(begun - shift[k]) > ROUNDING:
                raise WrongError(
                    f"{where}: {'XYZ'[k]} is shifted by {begun:.2f} um at its start, {moved:.2f} um at its centre, "
                    f"{shift[k]:.2f} um at its end"
                )
    return shift


def _shift(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (b[0] - a[0]) * 1e3, (b[1] - a[1]) * 1e3, (b[2] - a[2]) * 1e3


def _lasts(was: Ran, shifts: Sequence[Vector]) -> dict[int, Vector]:
    """Return the shift of the last move of each line."""
    return {move.line: shift for move, shift in zip(was.moves, shifts, strict=True)}


def _same(was: Ran, shifts: Sequence[Vector], first: dict[int, Vector], jogged: bool) -> None:
    """Compare with another state; what a hand has moved may carry nothing until it is positioned again."""
    for line, shift in _lasts(was, shifts).items():
        for value, wanted, letter in zip(shift, first.get(line, shift), "XYZ", strict=True):
            if abs(value - wanted) > ROUNDING and not (jogged and abs(value) <= ROUNDING):
                how = "after a hand has moved the axes " if jogged else ""
                raise WrongError(
                    f"line {line}: {how}{letter} is shifted by {value:.2f} um, in the first state by {wanted:.2f} um"
                )


def _machine_lines(text: str) -> dict[int, tuple[int, ...]]:
    """Return lines that end in machine coordinates, and of which axes."""
    found = {}
    for number, line in enumerate(text.split("\n"), 1):
        bare = _bare(line)
        if not re.search(r"G(53|28|30)(?![.\d])", bare) or bare.startswith("#"):
            continue
        axes = tuple(i for i, letter in enumerate("XYZ") if letter in bare)
        if axes or not re.search(r"G53|[ABC]", bare):
            found[number] = axes or (0, 1, 2)
    return found


def _in_machine(was: Ran, now: Ran, machine: dict[int, tuple[int, ...]]) -> None:
    last = {}
    for a, b in zip(was.moves, now.moves, strict=True):
        if a.line in machine:
            last[a.line] = a, b
    for line, (a, b) in last.items():
        shift = _shift(a.end, b.end)
        for axis in machine[line]:
            if abs(shift[axis]) > ROUNDING:
                raise WrongError(f"line {line}: {'XYZ'[axis]} goes to machine coordinates shifted by {shift[axis]:.2f} um")


def _left(was: dict[int, float], now: dict[int, float]) -> None:
    """Compare what stays in the controller behind the program: homes, work offsets, G92."""
    for number in (*range(5161, 5190), *range(5220, 5390)):
        if abs(was.get(number, 0.0) - now.get(number, 0.0)) > ROUNDING * 1e-3:
            raise WrongError(f"#{number} is left at {now.get(number)} instead of {was.get(number)}")
    for axis in range(9):
        a, b = (left.get(5211 + axis, 0.0) * left.get(5210, 0.0) for left in (was, now))
        if abs(a - b) > ROUNDING * 1e-3:
            raise WrongError(f"a G92 of {b} stays in force instead of {a}")
