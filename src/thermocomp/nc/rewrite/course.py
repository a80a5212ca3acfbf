"""Recorders of a revision: the course of the program, for a figure, and whether it stays within the travel.

If a program exceeds the travel of the machine, either the program or the given origins are wrong.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.nc.rewrite.demand import CutErrors
from thermocomp.nc.rewrite.revise import Revised
from thermocomp.nc.rewrite.text import Vector

FloatArray = NDArray[np.float64]

#: minimum distance beyond the travel that is reported [mm]
BEYOND = 1.0
_NOT_CUTTING = (math.nan,) * 3


class Run(NamedTuple):
    """Run divided into time intervals, with the lowest and the highest value in each."""

    time: FloatArray  #: (n,), end of each interval [s]; the first begins at 0
    deviation: FloatArray  #: (n, 2, 3), drift of X, Y, Z [um]
    carried: FloatArray  #: (n, 2, 3), correction in force [um]
    left: FloatArray  #: (n, 2, 3), remaining drift in the cuts [um]; nan where nothing is cut
    speed: FloatArray  #: (n, 2), spindle speed [1/min]


class Bound(NamedTuple):
    """Bound of the error of the tool position during a cut, for one axis [um]."""

    axis: str
    low: float  #: lowest drift in the whole run
    high: float
    without: float  #: largest drift in a cut
    left: float  #: remaining drift in a cut, between updates of the correction
    line: int  #: line of `left`
    model: float  #: error bound of the models; nan: they were never judged

    @property
    def most(self) -> float:
        """Return the bound of the error; nan if the models were never judged."""
        return self.left + self.model


@dataclass
class Course:
    """Recorder of drift, correction and spindle speed over the run of a program.

    Parameters
    ----------
    most : int
        Maximum number of intervals; adjacent ones are merged when exceeded.
    """

    most: int = 1500
    _times: list[float] = field(default_factory=list, init=False)
    _low: list[tuple[float, ...]] = field(default_factory=list, init=False)
    _high: list[tuple[float, ...]] = field(default_factory=list, init=False)
    _last: tuple[Vector, Vector, float, CutErrors | None] | None = field(default=None, init=False)
    _rows: int = field(default=0, init=False)  # rows in the last interval
    _stride: int = field(default=1, init=False)  # rows per interval

    def take(self, revised: Revised) -> None:
        """Take the results of the next line of the program."""
        block = revised.block
        if block is None:
            return
        speed, cut = abs(block.speed), revised.cut
        row = revised.deviation, revised.carried, speed, cut
        if row == self._last:  # only the time has changed
            self._times[-1] = revised.end
            return
        self._last = row
        if cut is None:
            low = high = (*revised.deviation, *revised.carried, speed, *_NOT_CUTTING)
        else:
            low = (*cut.drift[0], *revised.carried, speed, *cut.left[0])
            high = (*cut.drift[1], *revised.carried, speed, *cut.left[1])
        if self._rows and self._rows < self._stride:
            self._times[-1] = revised.end
            self._low[-1] = tuple(map(_least, self._low[-1], low))
            self._high[-1] = tuple(map(_most, self._high[-1], high))
            self._rows += 1
            return
        self._times.append(revised.end)
        self._low.append(low)
        self._high.append(high)
        self._rows = 1
        if len(self._times) > self.most:
            self._join()

    def run(self) -> Run:
        """Return the recorded run up to the last line taken."""
        table = np.array([self._low, self._high], dtype=np.float64).reshape(2, -1, 10).swapaxes(0, 1)
        return Run(
            time=np.array(self._times, dtype=np.float64),
            deviation=table[:, :, 0:3],
            carried=table[:, :, 3:6],
            left=table[:, :, 7:10],
            speed=table[:, :, 6],
        )

    def _join(self) -> None:
        """Merge adjacent intervals; an unpaired last one remains open."""
        n = len(self._times) // 2 * 2
        odd = len(self._times) > n
        self._times[:n] = self._times[1:n:2]
        for rows, outer in ((self._low, _least), (self._high, _most)):
            rows[:n] = [tuple(map(outer, a, b)) for a, b in zip(rows[0:n:2], rows[1:n:2], strict=True)]
        self._rows = self._rows if odd else 2 * self._stride
        self._stride *= 2


def _least(a: float, b: float) -> float:
    return b if a != a or b < a else a  # noqa: PLR0124 - nan gives way


def _most(a: float, b: float) -> float:
    return b if a != a or b > a else a  # noqa: PLR0124 - nan gives way


@dataclass
class Travel:
    """Check of the cuts of a program in machine coordinates, if program or setup define origin and tool length.

    Parameters
    ----------
    limits : mapping of str to tuple of float
        Lowest and highest position by axis [mm].
    """

    limits: Mapping[str, tuple[float, float]]
    _farthest: dict[str, tuple[float, float, int]] = field(default_factory=dict, init=False)  # beyond, position, line

    def take(self, revised: Revised) -> None:
        """Take the results of the next line of the program."""
        block = revised.block
        if block is None:
            return
        modal = block.modal
        if not modal.origin_told or all(m.rapid for m in block.moves):
            return
        for k, axis in enumerate("XYZ"):
            if axis not in self.limits or not block.known[k] or (axis == "Z" and modal.untold_tool is not None):
                continue
            low, high = self.limits[axis]
            for move in block.moves:
                position = move.end[k]
                beyond = max(low - position, position - high)
                if not move.rapid and beyond > max(BEYOND, self._farthest.get(axis, (0.0,))[0]):
                    self._farthest[axis] = beyond, position, block.line.number

    def warnings(self) -> list[str]:
        """Return warnings for the axes that exceed their travel, with the positions farthest beyond it."""
        return [
            f"{axis} goes to {position:.6g} mm at line {line}, in machine coordinates: outside its travel, "
            f"{self.limits[axis][0]:g} to {self.limits[axis][1]:g} mm; check the program and the origins"
            for axis, (_, position, line) in sorted(self._farthest.items())
        ]
