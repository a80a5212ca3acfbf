"""Moves of canned cycles, as in LinuxCNC."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from thermocomp.nc.interpreter.block import PLANES, Modal, Point

#: clearance above the previous depth in chip breaking and peck drilling [inch]
BACK_OFF: Final = 0.01
#: levels that differ by less are equal except for rounding
ROUNDING: Final = 1e-9
#: more holes or pecks than this indicate an error in the program
MOST: Final = 100_000


class CycleError(Exception):
    """Error for a canned cycle with invalid words; the message gives the reason."""


class CycleMove(NamedTuple):
    """One move of a canned cycle."""

    rapid: bool
    place: Point  #: program coordinates, in program units


#: words that are required in the first line of a cycle and stay in force
KEPT: Final = {
    **dict.fromkeys(("G74", "G81", "G84", "G85"), "R"),
    **dict.fromkeys(("G76", "G82", "G86", "G89"), "RP"),
    **dict.fromkeys(("G73", "G83"), "RQ"),
    "G87": "RIJK",
}
#: tapping: P is an optional dwell
_TAPS: Final = ("G74", "G84")


@dataclass(slots=True)
class CannedCycle:
    """One line of a cycle.

    Parameters
    ----------
    modal : Modal
        State in force, with the code of the cycle.
    start : tuple of float
        Position of the tool, in program coordinates and units, like all other values.
    named : dict of str to float
        Axis words of the line.
    sticky : dict of str to float
        R, Q, P, I, J, K and the depth (by its axis) in force, including the words of the line.
    level : float
        Position of the tool perpendicular to the plane at the start of the cycle, to which G98 returns.
    direct : bool
        The tool moves to the next hole at its level, also from R in G98, and up to an R above it there (Fanuc).
    levels : bool
        R and the depth are levels, also in G91 (Fanuc).
    """

    modal: Modal
    start: Point
    named: dict[str, float]
    sticky: dict[str, float]
    level: float
    repeats: int = 1
    direct: bool = False
    levels: bool = False

    def steps(self) -> Iterator[CycleMove]:
        """Yield the moves; their number does not change if the whole cycle is slightly shifted."""
        modal = self.modal
        first, second, across = PLANES[modal.plane]
        r, bottom = self.sticky["R"], self.sticky["XYZ"[across]]
        if not (modal.absolute or self.levels):
            r += self.level
            bottom += r
        if r < bottom:
            raise CycleError(f"R is at {r:g}, below the bottom of the hole at {bottom:g}; check R and {'XYZ'[across]}")
        pecks = (r - bottom) / self.sticky["Q"] if modal.motion in ("G73", "G83") else 1.0
        if pecks > MOST:
            raise CycleError(f"Q{self.sticky['Q']:g} makes more than {MOST} pecks; check Q")
        if self.repeats * max(pecks, 1.0) > MOST:
            raise CycleError(f"{self.repeats} repeats make more than {MOST} strokes; reduce L or K")

        a, b, now = self.start[first], self.start[second], self.start[across]
        level = self.level
        if level < r and not self.direct:
            level = now = r
        yield CycleMove(True, self._at(a, b, now))
        back = r if modal.retract == 99 else level
        height = now if now > r + ROUNDING or self.direct else back
        da, db = self.named.get("XYZ"[first]), self.named.get("XYZ"[second])
        for _ in range(self.repeats):
            if modal.absolute:
                a, b = a if da is None else da, b if db is None else db
            else:
                a, b = a + (da or 0.0), b + (db or 0.0)
            yield CycleMove(True, self._at(a, b, height))
            yield CycleMove(True, self._at(a, b, r))
            yield from self._hole(a, b, r, bottom, back)
            height = back

    def _at(self, a: float, b: float, c: float) -> Point:
        """Return a point from its coordinates in the plane and perpendicular to it."""
        return {17: (a, b, c), 18: (b, c, a), 19: (c, a, b)}[self.modal.plane]

    def _hole(self, a: float, b: float, r: float, bottom: float, back: float) -> Iterator[CycleMove]:
        """Yield the moves from R to the bottom and back."""
        code, sticky, at = self.modal.motion, self.sticky, self._at
        if code == "G87":
            beside = a + sticky["I"], b + sticky["J"]
            top = sticky["K"] + (0.0 if self.modal.absolute else bottom)
            yield CycleMove(True, at(*beside, r))
            yield CycleMove(True, at(*beside, bottom))
            yield CycleMove(True, at(a, b, bottom))
            yield CycleMove(False, at(a, b, top))
            yield CycleMove(False, at(a, b, bottom))
            yield CycleMove(True, at(*beside, bottom))
            yield CycleMove(True, at(*beside, back))
            yield CycleMove(True, at(a, b, back))
            return
        if code in ("G73", "G83"):
            off = BACK_OFF if self.modal.inch else BACK_OFF * 25.4
            depth = r - sticky["Q"]
            while depth > bottom:
                yield CycleMove(False, at(a, b, depth))
                if code == "G83":
                    yield CycleMove(True, at(a, b, r))
                yield CycleMove(True, at(a, b, depth + off))
                depth -= sticky["Q"]
        yield CycleMove(False, at(a, b, bottom))
        if code == "G85":
            yield CycleMove(False, at(a, b, r))
        yield CycleMove(code not in ("G89", *_TAPS), at(a, b, back))


def pause(code: str, sticky: dict[str, float]) -> float:
    """Return the dwell at the bottom of one hole, in the units of the word P."""
    return sticky.get("P", 0.0) if "P" in KEPT[code] or code in _TAPS else 0.0
