"""Joint support: distance of a reading, in all inputs together, from the training data of a model.

With a range per input, every combination of values within the ranges counts as covered: a hot front with a cold rear,
or a speed between the trained ones. Here the distance to the nearest of a few training states counts, and for speeds
the distance to the nearest trained speed. The calibration is described in `thermocomp.models.covering`.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import COEFFICIENT, LEAST, check_between, check_finite
from thermocomp.core.exceptions import SettingError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class JointSupport:
    """Representative training states, as plain numbers.

    Parameters
    ----------
    columns : tuple of int
        Inputs (all but speeds and feeds) whose changes are compared jointly.
    scale : tuple of float
        Scale of each of these inputs; the distance is the RMS of the scaled differences [their units].
    points : tuple of tuple of float
        Representative training states: changes of these inputs, in units of `scale`.
    limit : float
        Distance to the nearest point beyond which a state is outside [-].
    speeds : tuple of int
        Inputs that are speeds or feeds.
    levels : tuple of tuple of float
        Trained values of each of these inputs [their units].
    tolerances : tuple of float
        Distance to the nearest level beyond which a speed is outside [their units].

    Raises
    ------
    InputError
        The sizes are inconsistent, or a number is not finite.
    """

    columns: tuple[int, ...]
    scale: tuple[float, ...]
    points: tuple[tuple[float, ...], ...]
    limit: float
    speeds: tuple[int, ...] = ()
    levels: tuple[tuple[float, ...], ...] = ()
    tolerances: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        points, levels = [v for p in self.points for v in p], [v for level in self.levels for v in level]
        check_finite("joint support", points=points, levels=levels)
        positive = {"scale": self.scale, "tolerances": self.tolerances, "limit": self.limit}
        check_between("joint support", LEAST, COEFFICIENT, **positive)
        if len(self.scale) != len(self.columns) or any(len(p) != len(self.columns) for p in self.points):
            raise SettingError(
                f"joint support: {len(self.columns)} columns, {len(self.scale)} scales and points of "
                f"{sorted({len(p) for p in self.points})} numbers; expected one of each per column"
            )
        if not len(self.speeds) == len(self.levels) == len(self.tolerances) or not all(self.levels):
            raise SettingError(
                f"joint support: {len(self.speeds)} speeds, {len(self.levels)} lists of levels and "
                f"{len(self.tolerances)} tolerances; expected at least one level and one tolerance for every speed"
            )
        if self.columns and not self.points:
            raise SettingError(f"joint support: {len(self.columns)} columns but no point; expected at least one point")
        if (least := min([*self.columns, *self.speeds], default=0)) < 0:
            raise SettingError(f"joint support: input index {least} in columns or speeds: must not be negative")

    @property
    def n_inputs(self) -> int:
        """Minimum number of inputs of the model."""
        return 1 + max([*self.columns, *self.speeds], default=-1)

    def distance(self, change: FloatArray) -> FloatArray:
        """Return the distance of states from the training data, normalised by the limit; above 1 or NaN: outside.

        Parameters
        ----------
        change : ndarray of shape (..., n_inputs)
            Inputs minus their reference, before clipping [their units].

        Returns
        -------
        ndarray of shape (...,)
            The larger of the distance to the nearest point divided by `limit` and the distance to the nearest trained
            speed divided by its tolerance; NaN for a state with a NaN. Rounded to 1e-6, so that a batch and its
            individual states give the same result.
        """
        if change.ndim == 1:
            return np.asarray(self._distance_of_one(change))
        columns, weights, points, squares = self._numbers
        far = np.zeros(change.shape[:-1])
        if self.columns:
            state = change.take(columns, axis=-1) * weights
            square = np.minimum.reduce(squares - state @ points, axis=-1) + np.add.reduce(state * state, axis=-1)
            far = np.sqrt(np.maximum(square, 0.0))
        for k, levels, tolerance in zip(self.speeds, self._levels, self.tolerances, strict=True):
            away = np.minimum.reduce(np.abs(change[..., k, None] - levels), axis=-1)
            far = np.maximum(far, away / tolerance)
        return np.asarray(np.rint(far * 1e6) / 1e6)

    def _distance_of_one(self, change: FloatArray) -> float:
        """Return the distance of a single state; live, the numpy calls would take twice as long."""
        columns, weights, points, squares = self._numbers
        far = 0.0
        if self.columns:
            state = change.take(columns) * weights
            far = math.sqrt(max(float((squares - state @ points).min() + state @ state), 0.0))
        for k, levels, tolerance in zip(self.speeds, self.levels, self.tolerances, strict=True):
            speed = float(change[k])
            away = min([abs(speed - level) for level in levels]) / tolerance
            far = math.nan if math.isnan(away + far) else max(far, away)
        return round(far * 1e6) / 1e6 if math.isfinite(far) else far

    @cached_property
    def _levels(self) -> tuple[FloatArray, ...]:
        return tuple(np.array(level) for level in self.levels)

    @cached_property
    def _numbers(self) -> tuple[NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
        """Return the columns, and weights and points that give squared distances relative to the limit."""
        unit = self.limit * np.sqrt(max(len(self.columns), 1))
        points = np.array(self.points, dtype=np.float64).reshape(len(self.points), len(self.columns)) / unit
        return (
            np.array(self.columns, dtype=np.intp),
            1.0 / (np.array(self.scale) * unit),
            2.0 * points.T,
            (points**2).sum(axis=1),
        )
