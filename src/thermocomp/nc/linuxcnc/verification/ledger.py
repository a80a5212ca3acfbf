"""Required shift of every line of a revised program, and the original line of each of its lines."""

from array import array
from operator import sub
from typing import Any, NamedTuple

import numpy as np

from thermocomp.nc.rewrite.revise import Revised
from thermocomp.nc.rewrite.text import Vector

Floats = np.ndarray[Any, np.dtype[np.float64]]
Booleans = np.ndarray[Any, np.dtype[np.bool_]]
Integers = np.ndarray[Any, np.dtype[np.int64]]

_INVERSE_TIME = 93
#: flags of lines: unknown previous position of an axis in the line; move to machine coordinates
_UNPLACED, _MACHINE = 1.0, 2.0


class Shifts(NamedTuple):
    """Required shifts of several lines, and the permitted alternatives."""

    before: Floats  #: array of lines x 3
    after: Floats
    inner: Floats
    inverse: Booleans
    placed: Booleans  #: previous positions of the axes in the line are known
    machine: Booleans  #: move to machine coordinates, where the shift of the axes is zero
    others: tuple[Floats, ...]  #: alternative shifts before and after the line


class _Track:
    """Vectors of numbers by program line, stored only where they change."""

    def __init__(self, width: int) -> None:
        self.lines, self.numbers, self.width = array("i"), array("d"), width
        self._last = (0.0,) * width

    def take(self, line: int, numbers: tuple[float, ...]) -> None:
        if numbers != self._last:
            self.lines.append(line)
            self.numbers.extend(numbers)
            self._last = numbers

    def at(self, lines: Integers) -> Floats:
        """Return the numbers for given lines, one row per line."""
        if not self.lines:
            return np.zeros((len(lines), self.width))
        k = np.searchsorted(np.frombuffer(self.lines, np.intc), lines, side="right") - 1
        rows = np.frombuffer(self.numbers).reshape(-1, self.width)[k]
        rows[k < 0] = 0.0
        return rows


class Ledger:
    """Required shift of every line of a program; stored only where it changes."""

    def __init__(self) -> None:
        self._carried, self._inner, self._other = _Track(3), _Track(3), _Track(3)
        self._inverse, self._loose = _Track(1), _Track(1)
        #: by line of a divided move: shifts at the inner ends of its pieces
        self.knots: dict[int, tuple[Vector, ...]] = {}
        # for lines that became none or several, and the header: first line in the revised program, count, original line
        self._first, self._count, self._original = array("i"), array("i"), array("i")
        self._written = 0
        self._last = 0

    def take(self, revised: Revised) -> None:
        """Record the shift of the next line; lines are passed in order, including the header."""
        if len(revised.texts) != 1 or not revised.number:
            self._first.append(self._written + 1)
            self._count.append(len(revised.texts))
            self._original.append(revised.number or self._last)
        self._written += len(revised.texts)
        self._last = line = revised.number or self._last
        block = revised.block
        if block is None:
            return
        self._carried.take(line, revised.carried)
        self._inner.take(line, tuple(map(sub, revised.inner, revised.carried)))
        self._inverse.take(line, (float(block.modal.feed_mode == _INVERSE_TIME),))
        if revised.knots:
            self.knots[line] = revised.knots
        goes = block.kind in ("machine", "home")
        self._loose.take(line, (_MACHINE if goes else float(not revised.placed),))
        self._other.take(line, tuple(map(sub, revised.other or revised.carried, revised.carried)))

    def of(self, lines: Integers) -> Shifts:
        """Return the required shifts of lines of the original."""
        after = self._carried.at(lines)
        before, loose = self._carried.at(lines - 1), self._loose.at(lines)[:, 0]
        others = (before + self._other.at(lines - 1), after + self._other.at(lines)) if self._other.lines else ()
        return Shifts(
            before=before,
            after=after,
            inner=after + self._inner.at(lines),
            inverse=self._inverse.at(lines)[:, 0] > 0,
            placed=loose != _UNPLACED,
            machine=loose == _MACHINE,
            others=others,
        )

    def originals(self, lines: Integers) -> Integers:
        """Return the lines of the original for lines of the revised program."""
        if not self._first:
            return lines
        tables = self._first, self._count, self._original
        first, count, original = (np.frombuffer(a, np.intc).astype(int) for a in tables)
        k = np.searchsorted(first, lines, side="right") - 1
        beyond = lines - first[k] - count[k]
        return np.where(k < 0, lines, np.where(beyond < 0, original[k], original[k] + 1 + beyond))

    @property
    def lines(self) -> int:
        """Number of lines of the original that were recorded."""
        return self._last
