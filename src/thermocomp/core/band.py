"""Band: uncertainty of a model output, by machine phase and by distance from the training conditions."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import COEFFICIENT, LEAST, check_between
from thermocomp.core.exceptions import SettingError
from thermocomp.core.messages import Message
from thermocomp.core.thresholds import THRESHOLDS

FloatArray = NDArray[np.float64]

#: minimum number of cycles for a distribution-free band; with fewer, the required quantile exceeds the largest error
CONFORMAL = 9
#: largest half-width where the averaged regressions agree [unit]
WIDEST = 1e6
#: distance from the training beyond which the band does not widen further [-]
FARTHEST = 5.0


@dataclass(frozen=True)
class Band:
    """Half-width of the band about a model output, fixed when the model was fitted.

    The half-width is ``factor * sqrt(floor^2 + spread^2)``. The spread is the standard deviation between the
    regressions that the model averages; it is large where the training data do not determine the output. Inputs are
    clipped, so the spread does not grow beyond their range. Outside the joint support (`core.joint`), the half-width
    is multiplied by ``1 + widening * (distance - 1)``, with a distance of at most `FARTHEST`.

    Parameters
    ----------
    level : float
        Fraction of the rows of unseen thermal cycles that the band is designed to contain.
    basis : {'assumption', 'conformal'}
        ``assumption``: errors are normally distributed, fully correlated within a cycle, and their size is estimated
        from `cycles` cycles; ``conformal``: distribution-free, assuming that the cycles are exchangeable.
    cycles : int
        Number of thermal cycles the band is based on, each left out in turn.
    floor : float
        Smallest half-width, used where the averaged regressions agree [unit].
    running, stopped : float
        Factor while the spindle turns, and while it is stopped [-].
    speeds : tuple of int
        Indices of the inputs that show whether the spindle turns; empty: the larger factor always applies.
    widening : float
        Relative increase of the half-width per unit of distance outside the joint support [-].

    Raises
    ------
    SettingError
        A value is out of range.
    """

    level: float
    basis: Literal["assumption", "conformal"]
    cycles: int
    floor: float
    running: float
    stopped: float
    speeds: tuple[int, ...] = ()
    widening: float = 0.0  # as in files of versions before there was any

    def __post_init__(self) -> None:
        check_between("band", 0.5, 1.0 - LEAST, level=self.level)
        check_between("band", LEAST**2, COEFFICIENT, floor=self.floor, running=self.running, stopped=self.stopped)
        check_between("band", 0.0, COEFFICIENT, widening=self.widening)
        check_between("band", 0.0, WIDEST, **{"half-width": self.floor * max(self.running, self.stopped)})
        check_between("band", CONFORMAL if self.basis == "conformal" else 2, COEFFICIENT, cycles=self.cycles)
        if min(self.speeds, default=0) < 0:
            raise SettingError(f"band: input index {min(self.speeds)} in speeds: must not be negative")
        if len(set(self.speeds)) < len(self.speeds):
            raise SettingError(f"band: an input index occurs twice in speeds, {list(self.speeds)}")

    @property
    def words(self) -> str:
        """Short description of the band, as in all outputs."""
        assumed = self.basis == "assumption"
        return Message(
            "{level:g} % band by assumption, {n} cycles" if assumed else "{level:g} % band conformal, {n} cycles",
            level=100 * self.level,
            n=self.cycles,
        )

    def tell(self, unit: str) -> str:
        """Return the band as text in a given unit, with its half-widths where the averaged regressions agree."""
        rest, run = self.stopped, self.running
        if not self.speeds:
            rest = run = max(rest, run)
        return Message(
            "{words}: half-width at least {rest:.2f} {unit} at rest and {run:.2f} {unit} with the spindle running, "
            "more where the averaged models disagree{far}",
            words=self.words,
            rest=self.floor * rest,
            run=self.floor * run,
            unit=unit,
            far=Message(" and far from the training data") if self.widening else "",
        )

    def turning(self, change: FloatArray, stopped: float = THRESHOLDS.stopped_speed) -> NDArray[np.bool_]:
        """Return whether the spindle turns faster than `stopped`, for input states of shape (..., n_inputs)."""
        return np.asarray(np.logical_or.reduce([np.abs(change[..., k]) > stopped for k in self.speeds]))

    def half_width(
        self,
        change: FloatArray,
        spread: FloatArray,
        stopped: float = THRESHOLDS.stopped_speed,
        distance: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Return the half-width for states of the inputs.

        Parameters
        ----------
        change : ndarray of shape (..., n_inputs)
            Inputs minus their reference [their units].
        spread : ndarray of shape (...,)
            Spread of the averaged regressions [unit].
        stopped : float
            Largest speed that counts as stopped [1/min].
        distance : array-like of shape (...,)
            See `thermocomp.core.joint.JointSupport.distance`.

        Returns
        -------
        ndarray of shape (...,)
            [unit]
        """
        factor: FloatArray | float = max(self.running, self.stopped)
        if self.speeds:
            factor = np.where(self.turning(change, stopped), self.running, self.stopped)
        return np.asarray(factor * np.sqrt(self.floor**2 + spread**2) * widen(self.widening, distance))


def widen(widening: FloatArray | float, distance: FloatArray | float) -> FloatArray:
    """Return the relative half-width at a distance from the training data, 1 inside the joint support."""
    return np.asarray(1.0 + widening * (np.minimum(np.maximum(distance, 1.0), FARTHEST) - 1.0))
