"""Comparison of two programs in the same controller, call by call; the second one may divide moves."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.linuxcnc.rs274 import PLANE_AXES
from thermocomp.nc.linuxcnc.rs274process import InterpreterRun
from thermocomp.nc.linuxcnc.verification.calls import MOVES, STILL, Calls, Side
from thermocomp.nc.linuxcnc.verification.ledger import Floats, Integers, Ledger, Shifts

#: largest difference regarded as rounding [um]
ROUNDING = 0.1
#: allowed change in the duration of a move: relative, and absolute [s]
SLOWER, PAUSE = 0.02, 0.005
#: relative rounding error of other quantities: numbers of other calls, durations of rotary moves
_EXACT = 1e-9

Mask = np.ndarray[Any, np.dtype[np.bool_]]


class RefusedError(Exception):
    """Error if the interpreter refuses the original program."""


class Found(NamedTuple):
    """Results of the comparison of two programs."""

    moves: int
    largest: float  #: largest deviation of a move from the required shift [um]
    slower: float  #: largest change in the duration of a move, relative to the larger of its duration and 0.25 s [%]


class _Check(NamedTuple):
    bad: Mask  #: mask of the calls that differ
    say: Callable[[int], str]


class LineOrigins(NamedTuple):
    """Mapping of the lines run by the interpreter to lines of the original, for both programs."""

    first: Callable[[Integers], Integers]  #: for the original, or its translation
    second: Callable[[Integers], Integers]  #: for the revised program, or its translation
    divided: bool = True  #: several lines with one original line may be pieces of a divided move


def compare(
    first: InterpreterRun,
    second: InterpreterRun,
    ledger: Ledger,
    origin: LineOrigins,
    progress: Callable[[int], object],
) -> Found:
    """Run the next job of both programs in parallel, and compare their calls."""

    def drop(lines: Integers) -> Mask:
        return ledger.of(lines).inverse

    sides = Side(first, origin.first, drop), Side(second, origin.second, drop)
    was, now = _run(sides[0]), sides[1].chunks()
    comparison = _Comparison(*sides, ledger)
    a: Calls | None = None
    b: _Joined | None = None
    while True:
        a = next(was, None) if a is None else a
        try:
            b = _joined(next(now, None), sides[1], divided=origin.divided) if b is None else b
        except ProgramError as e:
            for _ in was:  # a refusal of the original takes precedence
                pass
            line = int(origin.second(np.array([e.line]))[0])
            raise ProgramError(line, f"the revised program does not run: {e.reason}") from e
        if a is None or b is None:
            break
        count = min(len(a), len(b.calls))
        comparison.compare(a.take(slice(0, count)), b.part(0, count))
        progress(int(a.line[count - 1]))
        a = a.take(slice(count, None)) if len(a) > count else None
        b = b.part(count, len(b.calls)) if len(b.calls) > count else None
    if (rest := a or (b and b.calls)) is not None:
        side, whose = (sides[0], "original") if a is not None else (sides[1], "revised program")
        raise ProgramError(int(rest.line[0]), f"only the {whose} contains this '{side.name(rest.kind[0])}'")
    return Found(comparison.moves, comparison.largest, comparison.slower * 100.0)


def _run(side: Side) -> Iterator[Calls]:
    try:
        yield from side.chunks()
    except ProgramError as e:
        raise RefusedError(int(side.original(np.array([e.line]))[0]), e.reason) from e


def _joined(calls: Calls | None, side: Side, *, divided: bool) -> "_Joined | None":
    """Return calls with the pieces of divided moves merged, and the pieces."""
    if calls is None:
        return None
    same = (calls.kind[1:] == calls.kind[:-1]) & (calls.line[1:] == calls.line[:-1]) & (calls.raw[1:] > calls.raw[:-1])
    same &= side.is_kind(calls.kind[1:], "rapid", "feed", "arc")
    if not (divided and same.any()):
        return _Joined(calls, None)
    begins = np.concatenate(([True], ~same))
    ends = np.concatenate((~same, [True]))
    whole = calls.take(ends)
    whole.start = calls.start[begins]
    number = np.cumsum(begins) - 1
    for name in ("seconds", "sweep"):
        setattr(whole, name, np.bincount(number, getattr(calls, name), len(whole)))
    done = np.cumsum(calls.sweep)
    inner = np.flatnonzero(~ends)
    pieces = calls.take(inner)
    before = np.concatenate(([0.0], done))[np.flatnonzero(begins)]
    pieces.sweep = done[inner] - before[number[inner]]
    return _Joined(whole, _Pieces(number[inner], pieces))


class _Pieces(NamedTuple):
    of: Integers  #: index of the move
    calls: Calls  #: all but the last pieces of divided moves; their sweep counts from the start of the move


class _Joined(NamedTuple):
    calls: Calls
    pieces: _Pieces | None

    def part(self, first: int, last: int) -> "_Joined":
        """Return the calls from `first` up to but excluding `last`, with the pieces of their moves."""
        calls = self.calls.take(slice(first, last))
        if self.pieces is None:
            return _Joined(calls, None)
        mine = (self.pieces.of >= first) & (self.pieces.of < last)
        return _Joined(calls, _Pieces(self.pieces.of[mine] - first, self.pieces.calls.take(mine)))


class _Comparison:
    """Comparison of the calls of the original and of the revised program."""

    def __init__(self, first: Side, second: Side, ledger: Ledger) -> None:
        self.sides, self.ledger = (first, second), ledger
        self.moves, self.largest, self.slower = 0, 0.0, 0.0

    def compare(self, was: Calls, joined: _Joined) -> None:
        """Compare the next calls of both programs, one by one; raise `ProgramError` at the first difference."""
        now, pieces = joined
        moving = self.sides[0].is_kind(was.kind, *MOVES)
        shifts = self.ledger.of(was.line)
        checks = [
            *self._order(was, now),
            *self._numbers(was, now, moving),
            *self._places(was, now, moving, shifts),
            *self._arcs(was, now, joined, shifts, moving),
            *self._times(was, now, moving, shifts),
        ]
        if pieces is not None:
            checks += self._divided(was, pieces)
        worst = [int(np.argmax(check.bad)) if check.bad.any() else len(was) for check in checks]
        if (first := min(worst)) < len(was):
            raise ProgramError(int(was.line[first]), "it " + checks[worst.index(first)].say(first))
        self.moves += int(moving.sum())

    def _order(self, was: Calls, now: Calls) -> Iterator[_Check]:
        name, other = self.sides[0].name, self.sides[1].name
        yield _Check(
            was.kind != now.kind, lambda i: f"makes a '{other(now.kind[i])}' instead of a '{name(was.kind[i])}'"
        )
        yield _Check(
            was.line != now.line, lambda i: f"makes a '{name(was.kind[i])}' that belongs to line {now.line[i]}"
        )

    def _numbers(self, was: Calls, now: Calls, moving: Mask) -> Iterator[_Check]:
        """Compare the numbers of calls other than moves."""
        other = ~moving
        if other.any():
            apart = np.abs(now.values - was.values) > _EXACT * np.maximum(1.0, np.abs(was.values))
            name = self.sides[0].name

            def say(i: int) -> str:
                first, second = (_short(calls.values[i]) for calls in (was, now))
                return f"gives '{name(was.kind[i])}' {second} instead of {first}"

            yield _Check(apart.any(axis=1) & other, say)

    # -- positions ---------------------------------------------------------------------------------------------------

    def _places(self, was: Calls, now: Calls, moving: Mask, shifts: Shifts) -> Iterator[_Check]:
        last = self._last(was.line, moving)
        found = (now.end[:, :3] - was.end[:, :3]) * 1e3
        off = np.abs(found - shifts.after)
        if shifts.before is not shifts.after:
            on_the_way = moving & ~last
            for other in (shifts.before, shifts.inner, *shifts.others[:1]):
                off = np.where(on_the_way[:, None], np.minimum(off, np.abs(found - other)), off)
            for other in shifts.others[1:]:
                off = np.minimum(off, np.abs(found - other))
        # a tap ends at its start: compare its depth
        straight = moving & ~self.sides[0].is_kind(was.kind, "tap")
        self._note(off[straight])

        def say(i: int) -> str:
            k = int(np.argmax(~(off[i] <= ROUNDING)))
            return f"moves {'XYZ'[k]} by {found[i, k]:.2f} um instead of {shifts.after[i, k]:.2f} um"

        yield _Check(straight & ~(off <= ROUNDING).all(axis=1), say)
        others = np.abs(now.end[:, 3:] - was.end[:, 3:]).max(axis=1) > STILL
        yield _Check(moving & others, lambda _: "moves an axis other than X, Y and Z")
        stands, moves = (np.abs(c.end[:, :3] - c.start[:, :3]).max(axis=1) for c in (was, now))
        turning = np.abs(was.end[:, 3:6] - was.start[:, 3:6]).max(axis=1) > STILL
        still = (stands < STILL) & (was.plane == 0) & straight
        # the program does not determine whether a rapid moves at all: the tool may already be at its end
        still &= shifts.placed | turning | (was.kind != self.sides[0].run.codes["rapid"])
        # a move to machine coordinates removes the shift of the axes, even if the tool is already there
        still &= ~shifts.machine | turning
        # with a rotary axis, any linear motion changes the meaning of the feed; else allow for rounding
        least = np.where(turning, STILL, 1e-3 * ROUNDING)
        yield _Check(
            still & (moves >= least),
            lambda i: (
                f"moves X, Y, Z by {moves[i] * 1e3:.2f} um where the original moves "
                + ("a rotary axis only" if turning[i] else "nothing")
            ),
        )
        bent = np.flatnonzero(self.sides[0].is_kind(was.kind, "tap", "curve") & (was.kind == now.kind)).tolist()
        bad = np.zeros(len(was), bool)
        for i in bent:
            points = [s.curves[int(c.values[i, 0])] for s, c in zip(self.sides, (was, now), strict=True)]
            bad[i] = len(points[0]) != len(points[1]) or not np.allclose(
                was.values[i, 1:4], now.values[i, 1:4], rtol=_EXACT, atol=_EXACT
            )
            if not bad[i]:
                apart = np.abs((points[1] - points[0])[:, :3] * 1e3 - shifts.after[i])
                self._note(apart)
                bad[i] = not (apart <= ROUNDING).all()
        yield _Check(bad, lambda i: f"makes another {self.sides[0].name(was.kind[i])}")

    def _last(self, line: Integers, moving: Mask) -> Mask:
        """Return a mask of the last move of each line."""
        where = np.flatnonzero(moving)
        group = np.concatenate(([0], np.cumsum(line[1:] != line[:-1])))[where]
        last = np.zeros(len(line), bool)
        last[where] = np.concatenate((group[1:] != group[:-1], [True]))[: len(where)]
        return last

    def _note(self, off: Floats) -> None:
        if off.size:
            self.largest = max(self.largest, float(off.max()))

    def _arcs(self, was: Calls, now: Calls, joined: _Joined, shifts: Shifts, moving: Mask) -> Iterator[_Check]:
        arcs = (was.plane > 0) & (now.plane > 0)
        if not arcs.any():
            return
        whole = np.ones(len(was), bool)
        if joined.pieces is not None:
            whole[joined.pieces.of] = False
        turns = (np.sign(was.turns) != np.sign(now.turns)) | (was.plane != now.plane) | whole & (was.turns != now.turns)
        yield _Check(arcs & turns, lambda _: "turns another way")
        last = self._last(was.line, moving)
        for plane, (i, j, _) in PLANE_AXES.items():
            mine = arcs & (was.plane == plane)
            if not mine.any():
                continue
            found = (now.centre - was.centre) * 1e3
            off = np.abs(found - shifts.after[:, [i, j]])
            for other in (shifts.before, shifts.inner):
                near = np.minimum(off, np.abs(found - other[:, [i, j]]))
                off = np.where((~last)[:, None], near, off)
            ends = (now.end - was.end)[:, [i, j]] * 1e3
            for other in shifts.others[1:]:  # the whole arc, including its end
                whole = other[:, [i, j]]
                off = np.minimum(off, np.maximum(np.abs(found - whole), np.abs(ends - whole)))
            self._note(off[mine])

            def say(n: int, axes: str = "XYZ"[i] + "XYZ"[j], off: Floats = off, found: Floats = found) -> str:
                k = int(np.argmax(~(off[n] <= ROUNDING)))
                wanted = shifts.after[n, "XYZ".index(axes[k])]
                return f"moves {axes[k]} of an arc's centre by {found[n, k]:.2f} um instead of {wanted:.2f} um"

            yield _Check(mine & ~(off <= ROUNDING).all(axis=1), say)
        # a full circle that vanished, or vice versa
        yield _Check(arcs & (np.abs(was.sweep - now.sweep) > np.pi), lambda _: "turns by a different angle")

    # -- durations ---------------------------------------------------------------------------------------------------

    def _times(self, was: Calls, now: Calls, moving: Mask, shifts: Shifts) -> Iterator[_Check]:
        change = np.abs(now.seconds - was.seconds)
        way = np.abs(was.end - was.start) > STILL
        linear = way[:, [0, 1, 2, 6, 7, 8]].any(axis=1) | (was.plane > 0)
        linear |= self.sides[0].is_kind(was.kind, "tap", "curve")
        turning_alone = way[:, 3:6].any(axis=1) & ~linear
        exact, near = _EXACT * np.maximum(was.seconds, 1.0), np.maximum(SLOWER * was.seconds, PAUSE)
        allowed = np.where(turning_alone, exact, near)
        # removing the shift on a move to machine coordinates may take the time needed at the same feed
        goes, went = ((c.end - c.start)[:, :3] for c in (now, was))
        far = np.linalg.norm(goes, axis=1)
        pace = now.seconds / np.where(far > STILL, far, np.inf)
        given_back = np.where(shifts.machine & ~turning_alone, np.linalg.norm(goes - went, axis=1), 0.0)
        allowed = np.maximum(allowed, given_back * pace * (1.0 + SLOWER))
        if moving.any():
            self.slower = max(self.slower, float((change / np.maximum(was.seconds, PAUSE / SLOWER))[moving].max()))
        yield _Check(
            moving & ~(change <= allowed),
            lambda i: f"takes {now.seconds[i]:.4g} s for a move of {was.seconds[i]:.4g} s",
        )

    # -- pieces ------------------------------------------------------------------------------------------------------

    def _divided(self, was: Calls, pieces: _Pieces) -> Iterator[_Check]:
        """Compare the pieces of divided moves: without their shifts, they must end on the path of the original."""
        of, calls = pieces
        first, way = was.start[of], was.end[of] - was.start[of]
        asked = np.full((len(of), 3), np.nan)
        for move in np.unique(of).tolist():
            mine = np.flatnonzero(of == move)
            if len(knots := self.ledger.knots.get(int(was.line[move]), ())) == len(mine):
                asked[mine] = knots
        end = calls.end[:, :3] - asked / 1e3
        square = np.maximum(np.einsum("ij,ij->i", way[:, :3], way[:, :3]), STILL**2)
        share = np.einsum("ij,ij->i", end - first[:, :3], way[:, :3]) / square
        place = first + share[:, None] * way
        turned = np.zeros(len(of), bool)
        for plane, (i, j, _) in PLANE_AXES.items():
            mine = np.flatnonzero(was.plane[of] == plane)
            if not len(mine):
                continue
            about, sense = was.centre[of[mine]], np.sign(was.turns[of[mine]])
            begin, there = first[mine][:, [i, j]] - about, end[mine][:, [i, j]] - about
            cross = begin[:, 0] * there[:, 1] - begin[:, 1] * there[:, 0]
            angle = sense * np.arctan2(cross, np.einsum("ij,ij->i", begin, there)) % (2.0 * np.pi)
            share[mine] = angle / was.sweep[of[mine]]
            place[mine] = first[mine] + share[mine, None] * way[mine]
            radius, angle = np.hypot(*begin.T), np.arctan2(begin[:, 1], begin[:, 0]) + sense * angle
            place[mine, i], place[mine, j] = about[:, 0] + radius * np.cos(angle), about[:, 1] + radius * np.sin(angle)
            centre = (calls.centre[mine] - about) * 1e3 - asked[mine][:, [i, j]]
            turned[mine] = ~(np.abs(centre) <= ROUNDING).all(axis=1) | (calls.turns[mine] != sense)
        found = (end - place[:, :3]) * 1e3
        # rotary axes must be at the same fraction of the move as the linear axes, within rounding
        loose = STILL + np.abs(way[:, 3:]) * (ROUNDING / 1e3 / np.sqrt(square))[:, None]
        beside = turned | ~(np.abs(found) <= ROUNDING).all(axis=1)
        beside |= (np.abs(calls.end - place)[:, 3:] > loose).any(axis=1)
        back = np.zeros(len(of), bool)
        back[1:] = (of[1:] == of[:-1]) & (share[1:] <= share[:-1])
        beside |= back | ~((share > 0.0) & (share < 1.0))
        bad = np.zeros(len(was), bool)
        bad[of[beside]] = True

        def say(i: int) -> str:
            k = int(np.argmax(beside & (of == i)))
            if np.isnan(asked[k]).any():
                return "divides a move into pieces other than those specified"
            axis = int(np.argmax(np.abs(found[k])))
            return f"puts a piece of a divided move off its path: {'XYZ'[axis]} by {found[k, axis]:.2f} um"

        yield _Check(bad, say)


def _short(values: Floats) -> str:
    return " ".join(f"{v:.10g}" for v in np.trim_zeros(values, "b")) or "0"
