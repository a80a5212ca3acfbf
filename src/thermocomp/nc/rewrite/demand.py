"""Update of the correction in a program, and the drift that remains, with the given work offsets or with others."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from operator import add
from typing import NamedTuple, Protocol

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Point, triple
from thermocomp.nc.rewrite.text import Vector

#: sampling intervals in a cut: in time [s], and along the path if the drift depends on the position [mm]
OFTEN = 20.0
DENSE = 20.0
#: distance of the positions compared by `Elsewhere` [mm]
AWAY = 100.0

#: deviation of the tool point at a point in machine coordinates [um]
Field = Callable[[Point], Vector]


class DriftSource(Protocol):
    """Interface of the predicted drift of a machine over the time of a program."""

    @property
    def by_position(self) -> bool:
        """Whether the deviation depends on the position."""

    def advance(self, dt: float, speed: float) -> None:
        """Advance the time by `dt` seconds with the spindle at `speed` [1/min]."""

    def deviation(self, point: Point) -> Vector:
        """Return the present deviation of the tool point [um] at a point in machine coordinates [mm]."""

    def field(self) -> Field:
        """Return the present `deviation` as a function of position that is independent of time."""


@dataclass
class Demand:
    """Required corrections of the axes, and their updates.

    A correction is updated when it is due: every `every` seconds (P-06), or as soon as the drift has changed by
    `tolerance` since the last update. With `every`, it still follows a dependence on position by `tolerance`.

    Parameters
    ----------
    tolerance : float
        Change of the drift that causes an update [um].
    every : float or None
        Interval between updates [s]; None: updates by tolerance alone.
    most : float
        Largest plausible correction; a larger one is not a thermal drift [um].
    """

    tolerance: float
    every: float | None = None
    most: float = 400.0
    _force: Vector = field(default=(0.0, 0.0, 0.0), init=False)
    _field: Field | None = field(default=None, init=False)
    _next: float = field(default=0.0, init=False)

    def at(self, time: float, drift: DriftSource, point: Point) -> Vector:
        """Return the correction in force at a time [s] and point [mm, machine coordinates].

        Parameters
        ----------
        time : float
            Time since the start of the program [s].
        point : tuple of float
            Machine coordinates [mm].

        Returns
        -------
        tuple of float
            Correction, minus the deviation [um, machine axes] (E-P4).
        """
        renewed = False
        now: Field = drift.deviation
        if self.every is not None:
            if self._field is None or time >= self._next:
                self._field, renewed = drift.field(), True
                self._next = (math.floor(time / self.every + 1e-9) + 1) * self.every
            now = self._field
        deviation, force, near = now(point), self._force, self.tolerance
        if not renewed and all(abs(d + f) <= near for d, f in zip(deviation, force, strict=True)):
            return force
        x, y, z = (  # a nan exceeds any tolerance, and has no opposing correction
            f if not renewed and abs(w - f) <= near else w
            for w, f in zip(oppose_deviation(deviation), force, strict=True)
        )
        if max(abs(x), abs(y), abs(z)) > self.most:
            raise InputError(
                f"the correction after {time:.0f} s would be X {x:.0f}, Y {y:.0f}, Z {z:.0f} um: more than "
                f"{self.most:g} um is not plausible as thermal drift; check the model, its unit and the start state"
            )
        self._force = x, y, z
        return self._force


def oppose_deviation(deviation: Vector) -> Vector:
    """Return the corrections that cancel a deviation [um]."""
    return triple(Correction.opposing(Deviation(d)).offset for d in deviation)


class CutErrors(NamedTuple):
    """Deviations in a cut, at its ends and inside: lowest and highest of each axis [um]."""

    drift: tuple[Vector, Vector]
    left: tuple[Vector, Vector]  #: remaining drift after the correction


@dataclass
class Left:
    """Remaining drift in the cuts, after the correction computed from the same drift.

    Parameters
    ----------
    most : list of float
        Largest magnitude in the cuts, per axis [um].
    line : list of int
        Line of each of these.
    without : list of float
        Largest magnitude without correction, per axis [um].
    """

    most: list[float] = field(default_factory=lambda: [0.0] * 3)
    line: list[int] = field(default_factory=lambda: [0] * 3)
    without: list[float] = field(default_factory=lambda: [0.0] * 3)

    def take(self, line: int, samples: Iterable[tuple[Vector, Vector]]) -> CutErrors:
        """Add the samples of a cut; return its errors.

        Parameters
        ----------
        samples : iterable of (tuple of float, tuple of float)
            Deviation and correction [um], at both ends and at points in between.
        """
        drifts, lefts = [], []
        for deviation, carried in samples:
            drifts.append(deviation)
            lefts.append(tuple(map(add, deviation, carried)))
        cut = CutErrors(_range(drifts), _range(lefts))
        most, without = self.most, self.without
        for i in range(3):
            left = max(-cut.left[0][i], cut.left[1][i])
            if left > most[i]:
                most[i], self.line[i] = left, line
            without[i] = max(without[i], -cut.drift[0][i], cut.drift[1][i])
        return cut


def _range(vectors: Sequence[tuple[float, ...]]) -> tuple[Vector, Vector]:
    a, b, c = map(min, *vectors)
    x, y, z = map(max, *vectors)
    return (a, b, c), (x, y, z)


@dataclass
class Elsewhere:
    """Error with other work offsets: the drift in the cuts, compared with that 100 mm away in both axis directions.

    Parameters
    ----------
    most : list of float
        Largest change of the drift, per axis [um].
    """

    most: list[float] = field(default_factory=lambda: [0.0] * 3)
    _time: float = field(default=-math.inf, init=False)
    _place: Point = field(default=(math.inf,) * 3, init=False)

    def take(self, time: float, point: Point, drift: DriftSource) -> None:
        """Process the position of a cut [mm, machine coordinates] at a time [s], if far enough from the last sample."""
        if time - self._time < OFTEN and math.dist(point, self._place) < DENSE:
            return
        self._time, self._place = time, point
        now = drift.field()
        here = now(point)
        for axis in range(3):
            for away in (-AWAY, AWAY):
                place = triple(p + away * (k == axis) for k, p in enumerate(point))
                for k, (there, was) in enumerate(zip(now(place), here, strict=True)):
                    self.most[k] = max(self.most[k], abs(there - was))
