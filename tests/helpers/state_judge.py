"""Judges a revised program on its own: LinuxCNC's interpreter runs it and the original in drawn states of a controller.

It knows nothing of what the revision wanted; it asks what has to hold of any revision: every move is that of the
original but for a small shift that is the same whatever is stored in the controller, takes the time it took, and all
else is as it was.
"""

import math
import re
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from state_pieces import joined
from state_run import MOVES, STILL, Move, Ran, State, bare, followed, run, turned

from thermocomp.core.exceptions import ThermocompError
from thermocomp.nc.linuxcnc import rs274

Vector = tuple[float, float, float]

#: difference that is rounding [um]
ROUNDING = 0.1
#: a shift may be larger than the largest drift at the lines' ends by this: within a line it may have been more [um]
OVER = 1.0
#: of the time of a feed move
SHARE, SECONDS = 0.02, 0.005


class WrongError(Exception):
    """The revised program is not right.

    Parameters
    ----------
    faults : list of str
        State, line and what is wrong, the first of each state first.
    """

    def __init__(self, faults: list[str]) -> None:
        super().__init__(faults[0])
        self.faults = faults


class InvalidError(Exception):
    """The original does not run in any drawn state."""


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
    machine, kept = _machine_lines(original), _kept(original)
    compared = moves = 0
    chance = False
    first: dict[bool, dict[int, list[Vector]]] = {}
    wrong: list[str] = []
    runs = zip(drawn, run(original, drawn, folder), run(revised, drawn, folder), strict=True)
    for number, (state, was, done) in enumerate(runs):
        if isinstance(was, ThermocompError):
            continue  # such as arcs of G18 in rotated coordinates
        faults: list[str] = []
        if isinstance(done, ThermocompError):
            wrong.append(f"state {number}: the interpreter refuses the revised program: {done}")
            continue
        now = joined(was, done, most)
        if not chance and _begins_at_r(was, now, most, kept):
            chance = True  # in one of the states: in more it is no chance
            continue
        compared += 1
        moves += len(was.moves)
        if (fault := _calls(was, now)) is None:
            faults += (
                f for a, b in zip(was.moves, now.moves, strict=True) for f in _moved(a, b, most, a.line in machine)
            )
            shifts: dict[int, list[Vector]] = {}
            for a, b in zip(was.moves, now.moves, strict=True):
                shifts.setdefault(a.line, []).append(_shift(a.end, b.end))
            if not state.jog:
                first.setdefault(state.skip, shifts)
                faults += _in_machine(shifts, machine)
            faults += _same(shifts, first.get(state.skip, {}), kept, bool(state.jog))
            faults += _left(was.left, now.left)
        else:
            faults.append(fault)
        wrong += (f"state {number}: {fault}" for fault in faults)
    if wrong:
        raise WrongError(wrong)
    if compared < len(drawn) / 2:
        raise InvalidError(f"it runs in {compared} of {len(drawn)} states")
    return Judgement(compared, moves)


def _calls(was: Ran, now: Ran) -> str | None:
    """Return where the calls begin to differ in more than the places of moves."""
    for a, b in zip_longest(was.calls, now.calls):
        if a is None or b is None or a[0] != b[0]:
            line = (a or b)[1]
            return f"line {line}: '{b[0] if b else 'nothing'}' instead of '{a[0] if a else 'nothing'}'"
        if a[0] not in MOVES and (
            a[3] != b[3]
            or not all(
                math.isclose(p, q, rel_tol=1e-9, abs_tol=1e-9) for p, q in zip_longest(a[2], b[2], fillvalue=math.nan)
            )
        ):
            return f"line {a[1]}: '{a[0]}' gives {b[2]} {b[3]} instead of {a[2]} {a[3]}"
    return None


def _begins_at_r(was: Ran, now: Ran, most: Vector, kept: dict[int, tuple[frozenset[int], bool]]) -> bool:
    """Return whether a cycle begins between its R and the shifted one, so that only one of both goes up to it first.

    Where the level is not known nobody can foresee that; it is less than a correction.
    """
    for a, b in zip(was.moves, now.moves, strict=False):
        for first, other in ((a, b), (b, a)):
            rise = first.end[2] - first.start[2]
            if (
                kept.get(a.line, (frozenset(), False))[1]
                and first.kind == other.kind == "rapid"
                and first.end[:2] == first.start[:2]
                and STILL < rise <= (most[2] + OVER) / 1e3
                and math.dist(other.start[:2], other.end[:2]) > STILL
            ):
                return True
    return False


def _moved(a: Move, b: Move, most: Vector, leaves: bool) -> Iterator[str]:
    """Yield what is wrong with a move; one to machine coordinates leaves its shift, and is as much longer."""
    shift = _shift(a.end, b.end)
    where = f"line {a.line}, {a.kind}"
    for value, limit, letter in zip(shift, most, "XYZ", strict=True):
        if abs(value) > limit + OVER:
            yield f"{where}: {letter} is shifted by {value:.1f} um, and {limit:.1f} um was the most"
    if any(abs(p - q) > STILL for p, q in zip(a.end[3:], b.end[3:], strict=True)):
        yield f"{where}: another axis than X, Y, Z goes elsewhere"
    if a.steps < STILL <= b.steps and turned(a.start, a.end) > STILL:
        yield f"{where}: moves X, Y or Z by {b.steps * 1e3:.2f} um, the original only turns"
    elif a.kind != "rapid" and not leaves:
        allowed = max(SHARE * a.seconds, SECONDS) if a.steps >= STILL else 1e-6 * a.seconds
        if abs(a.seconds - b.seconds) > allowed:
            yield f"{where}: takes {b.seconds:.4f} s instead of {a.seconds:.4f} s"
    if len(a.points) != len(b.points) or (a.arc is None) != (b.arc is None):
        yield f"{where}: another curve"
        return
    for p, q in zip(a.points, b.points, strict=True):
        if max(map(abs, map(float.__sub__, _shift(p, q), shift))) > ROUNDING:
            yield f"{where}: a point of the curve is shifted otherwise than its end"
    if a.arc and b.arc:
        yield from _turns(a, b, a.arc, b.arc)


def _turns(a: Move, b: Move, first: rs274.ArcPath, second: rs274.ArcPath) -> Iterator[str]:
    """Yield what is wrong with an arc: in its plane start, centre and end go together."""
    where, shift = f"line {a.line}, {a.kind}", _shift(a.end, b.end)
    if (first.plane, first.turns) != (second.plane, second.turns):
        yield f"{where}: turns another way"
    for k in rs274.PLANE_AXES[first.plane][:2]:
        moved = (second.machine_centre[k] - first.machine_centre[k]) * 1e3
        begun = (b.start[k] - a.start[k]) * 1e3
        if abs(moved - shift[k]) > ROUNDING or abs(begun - shift[k]) > ROUNDING:
            yield (
                f"{where}: {'XYZ'[k]} is shifted by {begun:.2f} um at its start, {moved:.2f} um at its centre, "
                f"{shift[k]:.2f} um at its end"
            )


def _shift(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (b[0] - a[0]) * 1e3, (b[1] - a[1]) * 1e3, (b[2] - a[2]) * 1e3


def _same(
    shifts: dict[int, list[Vector]],
    first: dict[int, list[Vector]],
    kept: dict[int, tuple[frozenset[int], bool]],
    jogged: bool,
) -> Iterator[str]:
    """Yield differences to the first state, where the lines end.

    An axis that a line does not position keeps what it carries in this state; behind a hole it may be that of R, or of
    the level where the cycle began.
    """
    carried = level = (0.0, 0.0, 0.0)
    for line, (*within, shift) in shifts.items():
        wanted = first.get(line, [shift])
        free, drills = kept.get(line, (frozenset(), False))
        if not drills:
            level = shift
        for axis, value in enumerate(shift):
            allowed = {wanted[-1][axis]}
            if axis in free:
                allowed.add(carried[axis])
            if drills and axis == 2:
                allowed |= {carried[2], level[2], *(s[2] for s in within)}
            if jogged:
                allowed.add(0.0)
            if all(abs(value - a) > ROUNDING for a in allowed):
                how = "after a hand has moved the axes " if jogged else ""
                yield (
                    f"line {line}: {how}{'XYZ'[axis]} is shifted by {value:.2f} um, in the first by "
                    f"{wanted[-1][axis]:.2f} um"
                )
        carried = shift


def _kept(text: str) -> dict[int, tuple[frozenset[int], bool]]:
    """Return, by line, the axes that it does not position, and whether it drills."""
    lines = text.split("\n")
    return {
        number: (frozenset(i for i, letter in enumerate("XYZ") if letter not in bare(line)), mode.drills)
        for number, (line, mode) in enumerate(zip(lines, followed(lines), strict=True), 1)
    }


def _machine_lines(text: str) -> dict[int, tuple[int, ...]]:
    """Return lines that end in machine coordinates, and of which axes."""
    found = {}
    for number, line in enumerate(map(bare, text.split("\n")), 1):
        if not re.search(r"G(53|28|30)(?![.\d])", line) or line.startswith("#"):
            continue
        axes = tuple(i for i, letter in enumerate("XYZ") if letter in line)
        if axes or not re.search(r"G53|[ABC]", line):
            found[number] = axes or (0, 1, 2)
    return found


def _in_machine(shifts: dict[int, list[Vector]], machine: dict[int, tuple[int, ...]]) -> Iterator[str]:
    for line in shifts.keys() & machine.keys():
        for axis in machine[line]:
            if abs(value := shifts[line][-1][axis]) > ROUNDING:
                yield f"line {line}: {'XYZ'[axis]} goes to machine coordinates shifted by {value:.2f} um"


def _left(was: dict[int, float], now: dict[int, float]) -> Iterator[str]:
    """Yield what stays in the controller behind the program and did not: homes, work offsets, G92."""
    for number in (*range(5161, 5190), *range(5220, 5390)):
        if abs(was.get(number, 0.0) - now.get(number, 0.0)) > ROUNDING * 1e-3:
            yield f"#{number} is left at {now.get(number)} instead of {was.get(number)}"
    for axis in range(9):
        a, b = (left.get(5211 + axis, 0.0) * left.get(5210, 0.0) for left in (was, now))
        if abs(a - b) > ROUNDING * 1e-3:
            yield f"a G92 of {b} stays in force instead of {a}"
