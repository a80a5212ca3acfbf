"""When the correction in a program is renewed, and what it leaves of the drift."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from operator import add
from typing import NamedTuple, Protocol

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.rewrite.frame import Vector

#: what the tool point deviates by at a point of the machine [um]
Field = Callable[[Point], Vector]


class DriftSource(Protocol):
    """Interface of a machine's drift."""

    @property
    def by_position(self) -> bool:
        """Whether the deviation varies with the place."""

    def advance(self, dt: float, speed: float) -> None:
        """Let `dt` seconds pass with the spindle at `speed` [1/min]."""

    def deviation(self, point: Point) -> Vector:
        """Return by how much the tool point deviates now [um], at a place in machine coordinates [mm]."""

    def field(self) -> Field:
        """Return the present `deviation` as a function of position that time no longer changes."""


@dataclass
class Demand:
    """Corrections required of the axes.

    A correction is renewed when it is due: every `every` seconds (P-06), or as soon as the drift has moved by
    `tolerance` since. Renewed every so often, it still follows the place by `tolerance`, where it depends on it.

    Parameters
    ----------
    tolerance : float
        [um]
    every : float or None
        [s]; None: by tolerance alone.
    most : float
        A correction beyond that is no thermal drift any more [um].
    """

    tolerance: float
    every: float | None = None
    most: float = 400.0
    _force: Vector = field(default=(0.0, 0.0, 0.0), init=False)
    _field: Field | None = field(default=None, init=False)
    _next: float = field(default=0.0, init=False)

    def at(self, time: float, drift: DriftSource, point: Point) -> Vector:
        """Return the correction in force at a time [s] and place [mm, machine coordinates].

        Parameters
        ----------
        time : float
            [s]
        drift : DriftSource
            At that time.
        point : tuple of float
            Machine coordinates [mm].

        Returns
        -------
        tuple of float
            [um, machine axes], minus the deviation (E-P4).

        Raises
        ------
        InputError
            It is larger than any thermal drift, or not a number.
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
        x, y, z = (  # a nan is never near, and no correction opposes it
            f if not renewed and abs(w - f) <= near else w
            for w, f in zip(oppose_deviation(deviation), force, strict=True)
        )
        if max(abs(x), abs(y), abs(z)) > self.most:
            raise InputError(
                f"the correction after {time:.0f} s would be X {x:.0f}, Y {y:.0f}, Z {z:.0f} um: more than "
                f"{self.most:g} um is no thermal drift; check the model, its unit and the start state"
            )
        self._force = x, y, z
        return self._force


def oppose_deviation(deviation: Vector) -> Vector:
    """Return the corrections that cancel a deviation [um]."""
    x, y, z = (Correction.opposing(Deviation(d)).offset for d in deviation)
    return x, y, z


class CutErrors(NamedTuple):
    """Deviations in a block in which the tool cuts, at its ends and inside: lowest and highest of each axis [um]."""

    drift: tuple[Vector, Vector]
    left: tuple[Vector, Vector]  #: what the correction leaves of it


@dataclass
class Left:
    """Remainder of the drift in the cuts, after the correction that was computed from it.

    Parameters
    ----------
    most : list of float
        Per axis, largest magnitude in the cuts [um].
    line : list of int
        Line of each.
    without : list of float
        The same without correction.
    """

    most: list[float] = field(default_factory=lambda: [0.0] * 3)
    line: list[int] = field(default_factory=lambda: [0] * 3)
    without: list[float] = field(default_factory=lambda: [0.0] * 3)

    def take(self, line: int, samples: Iterable[tuple[Vector, Vector]]) -> CutErrors:
        """Add a cut.

        Parameters
        ----------
        line : int
        samples : iterable of (tuple of float, tuple of float)
            Deviation and correction carried [um], at both ends and here and there on the way.

        Returns
        -------
        CutErrors
            All that is told of this cut comes from here.
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
