"""Modal state of a program and words of a line, as far as relevant for detecting the dialect."""

import re
from dataclasses import dataclass
from typing import Final

from thermocomp.nc.interpreter.codes import CYCLES, USED_BY

DRILLS: Final = frozenset(float(code[1:]) for code in CYCLES)
MOTIONS: Final = (0.0, 1.0, 2.0, 3.0, 33.0, *sorted(DRILLS))
#: codes that use the axis words of their line
TAKES_AXES: Final = frozenset((4.0, 10.0, 28.0, 30.0, 52.0, 53.0, 92.0))
ARCS: Final = (2.0, 3.0)
ARC_WORDS: Final = "XYZIJKR"
_Z: Final = re.compile(r"[Zz] *([-+.0-9]+)")
_TURNS: Final = (7.0, 8.0, 18.0, 33.0, 76.0, 96.0)


@dataclass
class LineWords:
    """Words of a line.

    Parameters
    ----------
    code : str
        The line without comments, in upper case.
    g, m : list of float
        Numbers of the codes; -1 for computed ones.
    computed : str
        First computed code; empty if there is none.
    values : dict of str to str
        All other words, as written.
    p_of : str
        The code that P belongs to; empty if there is none.
    """

    code: str
    g: list[float]
    m: list[float]
    computed: str
    values: dict[str, str]
    p_of: str

    def linuxcncs_user_of_p(self) -> str:
        """Return the first code that P may belong to in LinuxCNC; empty if there is none."""
        codes = (*(f"G{n:g}" for n in self.g), *(f"M{n:g}" for n in self.m))
        return next((code for code in codes if code in USED_BY["linuxcnc"]["P"]), "")


@dataclass
class InForce:
    """Modal state of a program, as far as it matters for the dialect.

    Parameters
    ----------
    whole : bool
        The meaning of a length without a decimal point is specified.
    retract : bool
        G98 or G99 is specified.
    motion : float
        G code of the motion in force; -1 before the first one.
    begins : bool
        The motion was put in force by the current line.
    across : bool
        Holes are drilled in a plane other than XY (G18, G19).
    kept : bool or None
        Value of `absolute` when the words of the cycle were written; None if none were written.
    unit : str
        Unit, preceded by a blank; empty if unknown.
    per_turn : bool
        The feed is per revolution (G95).
    mixed : int
        Number of arcs with lengths both with and without decimal points: they close only if the latter are whole units.
    level, plane : float or None
        Z programmed before a cycle, and R of the last cycle, both in G90; None: unknown.
    to_plane : bool
        Cycles return to R (G99).
    drilled, changed, milled, lathe : bool
        The program has a drilling cycle, an M6, a Y word, a code of lathes.
    """

    whole: bool
    retract: bool = False
    motion: float = -1.0
    begins: bool = False
    absolute: bool = True
    across: bool = False
    kept: bool | None = None
    unit: str = ""
    per_turn: bool = False
    mixed: int = 0
    level: float | None = None
    plane: float | None = None
    to_plane: bool = False
    drilled: bool = False
    changed: bool = False
    milled: bool = False
    lathe: bool = False

    @property
    def mill(self) -> bool:
        """True if the program shows that the machine is not a lathe."""
        return self.milled and not self.lathe

    def takes_p(self, line: LineWords) -> bool:
        """Return whether a P may belong to the motion of a line, after `take` has processed the line."""
        moves = not line.values.keys().isdisjoint(ARC_WORDS)
        return moves and self.motion in (*ARCS, *DRILLS) and TAKES_AXES.isdisjoint(line.g)

    @property
    def feed(self) -> bool:
        """True if a feed without a decimal point is ambiguous."""
        return not self.whole and (self.per_turn or self.unit == " in")

    def begins_above(self, line: LineWords) -> bool:
        """Return whether R of a cycle is above the level at which the cycle begins."""
        level, plane = self.level if self.absolute else 0.0, _position(line.values.get("R", ""))
        return level is not None and plane is not None and plane > level

    def take_plain(self, motion: float, text: str) -> None:
        """Process a line of moves without other codes, given the motion in force on it."""
        before, self.motion = self.motion, motion
        z = _Z.search(text)
        if z or before in DRILLS:
            self._take_level(before, z[1] if z else "")
        self.milled = self.milled or "Y" in text or "y" in text

    def _take_level(self, before: float, z: str, *, sure: bool = True) -> None:
        """Follow the level from which a cycle begins; `sure`: the Z of the line is that of a move."""
        if before in DRILLS and self.motion not in DRILLS and self.to_plane:
            self.level = self.plane
        if z and self.motion not in DRILLS:
            place = _position(z) if sure else None
            if place is not None and not self.absolute:
                place = None if self.level is None else self.level + place
            self.level = place

    def take(self, line: LineWords) -> None:
        """Update the modal state by the codes of a line."""
        codes = set(line.g)
        before = self.motion
        for code in (*MOTIONS, 80.0):
            if code in codes:
                self.motion = code
        self.begins = self.motion != before
        if 90.0 in codes or 91.0 in codes:
            self.absolute = 90.0 in codes
        if not codes.isdisjoint((17.0, 18.0, 19.0)):
            self.across = 17.0 not in codes
        if self.begins:
            self.kept = None
        if self.motion in DRILLS and {"R", "Z"} <= line.values.keys() and TAKES_AXES.isdisjoint(codes):
            self.kept = self.absolute
        if 20.0 in codes or 21.0 in codes:
            self.unit = " in" if 20.0 in codes else " mm"
        if not codes.isdisjoint((93.0, 94.0, 95.0)):
            self.per_turn = 95.0 in codes
        if not codes.isdisjoint((98.0, 99.0)):
            self.to_plane = 99.0 in codes
        self._take_level(before, line.values.get("Z", ""), sure=TAKES_AXES.isdisjoint(codes))
        if self.motion in DRILLS and "R" in line.values:
            self.plane = _position(line.values["R"]) if self.absolute else None
        self.drilled = self.drilled or not codes.isdisjoint(DRILLS)
        self.changed = self.changed or 6.0 in line.m
        self.milled = self.milled or "Y" in line.values
        self.lathe = self.lathe or not codes.isdisjoint(_TURNS)
        self.retract = self.retract or 98.0 in codes or 99.0 in codes


def _position(value: str) -> float | None:
    """Return the value of a plain number; None otherwise."""
    try:
        return float(value)
    except ValueError:
        return None


def read_number(value: str) -> float:
    """Return the value of a plain number; -1 otherwise."""
    try:
        return float(value)
    except ValueError:
        return -1.0
