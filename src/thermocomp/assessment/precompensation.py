"""A revised program is judged by LinuxCNC's own interpreter: its moves are the original's plus what was asked for."""

import math
from array import array
from bisect import bisect_right
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from itertools import groupby, zip_longest
from pathlib import Path
from typing import NamedTuple

from thermocomp.compensation.nc.following import startup
from thermocomp.compensation.nc.following.block import Setup
from thermocomp.compensation.nc.revising.frame import Vector
from thermocomp.compensation.nc.revising.revise import Revised
from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.shopfloor import rs274
from thermocomp.shopfloor.rs274 import Canonical, Place

#: largest difference that is rounding [um]
ROUNDING = 0.1
MOVES = frozenset(("rapid", "feed", "arc", "probe", "tap", "curve"))
#: what a revision changes to keep the places: they are judged by where the tool goes
_OFFSETS = frozenset(("g5x", "g92", "length", "tooltable"))
#: a header is added, and a program that tells its own line numbers tells others
_SAID = frozenset(("comment", "message"))
_INVERSE_TIME = 93
#: of other axes [mm, deg]
_SAME = 1e-6
REVISED = "revised program"


class Shift(NamedTuple):
    """By how much the moves of a line may be shifted [um, machine axes]."""

    before: Vector  #: what the axes carry before it
    after: Vector  #: what they carry behind it: its last move has to have this
    inner: Vector  #: on the way, in a cycle
    inverse: bool  #: G93: a way of another length gives another feed


class Ledger:
    """What every line of a program should be shifted by; as long as that stays the same it takes no room."""

    def __init__(self) -> None:
        self._lines = array("q")
        self._numbers = array("d")
        self._last: tuple[float, ...] = ()

    def take(self, revised: Revised) -> None:
        """Take a line in, in its order."""
        block = revised.block
        if block is None:
            return
        inverse = float(block.modal.feed_mode == _INVERSE_TIME)
        entry = (*revised.carried, *revised.inner, inverse)
        if entry != self._last:
            self._lines.append(revised.number)
            self._numbers.extend(entry)
            self._last = entry

    def at(self, line: int) -> Shift:
        """Return what a line of the original should be shifted by."""
        k = bisect_right(self._lines, line) - 1
        if k < 0:
            return Shift((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), inverse=False)
        x, y, z, i, j, k_, inverse = self._numbers[7 * k : 7 * k + 7]
        after = x, y, z
        before: Vector = after
        if self._lines[k] == line:
            a, b, c = self._numbers[7 * k - 7 : 7 * k - 4] if k else (0.0, 0.0, 0.0)
            before = a, b, c
        return Shift(before, after, (i, j, k_), bool(inverse))


class Proof(NamedTuple):
    """What the interpreter has found."""

    moves: int  #: canonical moves that were compared
    largest: float  #: largest difference between a move and what was asked for [um]
    states: int = 1  #: stored states of the controller
    slower: float = 0.0  #: by how much a move takes longer or shorter, at most [%]
    held: tuple[str, ...] = ()  #: what was the same in all of them
    drawn: tuple[str, ...] = ()  #: and what was not

    @property
    def sentence(self) -> str:
        """In which states it was proved."""
        return f"in {self.states} controller state{'s' * (self.states != 1)}"


class Unprovable(InputError):  # noqa: N818 - no fault of anybody
    """Nothing can be said about a program: it is not refused for a fault, but nobody has judged it."""


def stored(setup: Setup) -> rs274.Stored:
    """Return what stands at the controller, as the interpreter wants it."""
    return rs274.Stored(
        origins={system: origin for system, origin in setup.offsets.items() if system <= 9},
        lengths=setup.tools,
        home28=setup.home or (),
        rotations=setup.rotations,
        startup=startup.whole(setup),
    )


def prove(
    original: Path,
    revised: Path,
    ledger: Ledger,
    setup: Setup,
    progress: Callable[[int], object] = lambda _: None,
) -> Proof:
    """Run the interpreter on both programs, and compare them call by call.

    Every move has to be that of the original, shifted by what its line should carry, within 0.1 um; all else that the
    interpreter tells (feeds, speeds, tools, dwells ...) has to be the same.

    Parameters
    ----------
    original, revised : Path
        The programs.
    ledger : Ledger
        What the lines of the original should be shifted by.
    setup : Setup
        That of the revision.
    progress : callable, optional
        Told the line of the original.

    Returns
    -------
    Proof

    Raises
    ------
    ProgramError
        A move is not where it should be, or the interpreter refuses the revised program: a fault of thermocomp.
    Unprovable
        The interpreter refuses the original, so nothing can be proved; or it is not installed.
    """
    moves, largest = 0, 0.0
    with closing(_pairs(original, revised, setup)) as pairs:
        for line, group in groupby(pairs, key=lambda pair: pair[0].call.line):
            progress(line)
            shift = ledger.at(line)
            last: tuple[_Told, _Told] | None = None
            for was, now in group:
                if was.call.file:
                    what = f"calls {was.call.file}, another file: what it does there has not been shifted"
                    raise ProgramError(line, what)
                if not was.places:
                    _compare(was.call, now.call, shift)
                    continue
                if last is not None:
                    largest = max(largest, _off(*last, (shift.after, shift.before, shift.inner)))
                last = was, now
                moves += 1
            if last is not None:
                largest = max(largest, _off(*last, (shift.after,)))
    return Proof(moves, largest)


class _Told(NamedTuple):
    """A call, and where a move goes: its end, or the points of a curve [mm, machine coordinates]."""

    call: Canonical
    places: tuple[Place, ...]


def _pairs(original: Path, revised: Path, setup: Setup) -> Generator[tuple[_Told, _Told]]:
    if (reason := rs274.installed()) is not None:
        raise Unprovable(reason)
    line = 0
    with closing(_told(original, setup, "original")) as first, closing(_told(revised, setup, REVISED)) as second:
        for was, now in zip_longest(first, second):
            if was is None or now is None:
                whose, kind = ("original", was.call.kind) if was else (REVISED, now.call.kind)
                raise _fault(was.call.line if was else line, f"makes a '{kind}' in the {whose} only")
            line = was.call.line
            if was.call.kind != now.call.kind:
                raise _fault(line, f"makes a '{now.call.kind}' in place of a '{was.call.kind}'")
            yield was, now


def _told(path: Path, setup: Setup, whose: str) -> Generator[_Told]:
    """Yield the calls that are compared."""
    frame, here = rs274.Frame(), rs274.ORIGIN
    calls = rs274.read(path, stored(setup), inch=bool(setup.inch), block_delete=setup.skip_optional)
    try:
        for call in calls:
            kind, values = call.kind, call.values
            frame.take(kind, values)
            if kind in _OFFSETS or kind in _SAID:
                continue
            places: tuple[Place, ...] = ()
            if kind == "tap":  # there, and back
                places = (frame.machine((values[0], values[1], values[2], *frame.program(here)[3:])),)
            elif kind == "curve":  # in XY; each of its points has a weight
                there = frame.program(here)[2:]
                points = zip(values[1::3], values[2::3], strict=True)
                places = tuple(frame.machine((x, y, *there)) for x, y in points)
                here = places[-1]
            elif kind in MOVES:
                places = (call.machine,)
                here = call.machine
            yield _Told(call, places)
    except ProgramError as e:
        if whose == REVISED:
            raise _fault(e.line, f"does not run the {whose}: {e.reason}") from e
        raise Unprovable(f"LinuxCNC's interpreter does not run the {whose}: {e}") from e
    finally:
        calls.close()


def _compare(was: Canonical, now: Canonical, shift: Shift) -> None:
    """Compare calls that are no moves."""
    if was.kind == "feedrate" and shift.inverse:
        return
    numbers = zip_longest(was.values, now.values, fillvalue=math.nan)
    if was.text != now.text or not all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9) for a, b in numbers):
        raise _fault(was.line, f"gives '{was.kind}' {now.text or now.values} instead of {was.text or was.values}")


def _off(was: _Told, now: _Told, allowed: tuple[Vector, ...]) -> float:
    """Return by how much a move is off [um], the nearest of the allowed shifts counted, axis by axis."""
    first, second = was.call, now.call
    if len(was.places) != len(now.places):
        raise _fault(first.line, "makes another curve")
    worst = 0.0
    for a, b in zip(was.places, now.places, strict=True):
        worst = max(worst, _apart(first, a[:3], b[:3], allowed, (0, 1, 2), "moves {axis} by"))
        if any(abs(p - q) > _SAME for p, q in zip(a[3:], b[3:], strict=True)):
            raise _fault(first.line, "moves another axis than X, Y and Z")
    if first.arc is None or second.arc is None:
        if first.arc is not second.arc:
            raise _fault(first.line, "has lost or got an arc")
        return worst
    if (first.arc.plane, first.arc.turns) != (second.arc.plane, second.arc.turns):
        raise _fault(first.line, "turns another way")
    axes = rs274.PLANE_AXES[first.arc.plane][:2]
    centres = first.arc.machine_centre, second.arc.machine_centre
    return max(worst, _apart(first, *centres, allowed, axes, "moves {axis} of an arc's centre by"))


def _apart(
    call: Canonical,
    was: Sequence[float],
    now: Sequence[float],
    allowed: tuple[Vector, ...],
    axes: Sequence[int],
    what: str,
) -> float:
    worst = 0.0
    for axis in axes:
        found = (now[axis] - was[axis]) * 1e3
        off = min(abs(found - shift[axis]) for shift in allowed)
        if not off <= ROUNDING:
            wanted = allowed[0][axis]
            raise _fault(call.line, f"{what.format(axis='XYZ'[axis])} {found:.2f} um instead of {wanted:.2f} um")
        worst = max(worst, off)
    return worst


def _fault(line: int, what: str) -> ProgramError:
    return ProgramError(line, f"LinuxCNC's interpreter disagrees: it {what}; please report this: nothing was written")
