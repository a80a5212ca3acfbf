"""Inputs of a model, their training range, and the behaviour of the model outside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.bounds import LEAST, MARGIN, RANGE, check_between, check_finite, check_name
from thermocomp.core.exceptions import SettingError, explain_unknown
from thermocomp.core.units import HOUSE_UNITS


@dataclass(frozen=True)
class Input:
    """One input of a model, with its training range.

    Parameters
    ----------
    name : str
        Channel name.
    quantity, unit : str
        Measured quantity, a key of `HOUSE_UNITS`, and its house unit.
    reference : float
        Value that counts as zero [unit].
    rezero : bool
        True: the mean of the first readings after a start (or a re-zeroing) replaces `reference`, as temperatures in a
        drift test are relative to its start (`ErrorModel.zeroing`); False: `reference` is absolute, as for a spindle
        speed.
    low, high : float
        Trained range of value minus reference [unit].

    Raises
    ------
    SettingError
        Unknown quantity, wrong unit, empty range, empty name, or a number beyond `thermocomp.core.bounds.RANGE`.
    """

    name: str
    quantity: str
    unit: str
    reference: float
    rezero: bool
    low: float
    high: float

    def __post_init__(self) -> None:
        check_name("input", self.name)
        if self.quantity not in HOUSE_UNITS:
            raise explain_unknown("quantity", self.quantity, HOUSE_UNITS, ("quantity",))
        if self.unit != (house := HOUSE_UNITS[self.quantity]):
            raise SettingError(
                f"input {self.name}: expected a {self.quantity} in {house}, found {self.unit!r}", ("unit",)
            )
        check_finite(f"input {self.name}", RANGE, reference=self.reference, low=self.low, high=self.high)
        if not self.low <= self.high:
            raise SettingError(
                f"input {self.name}: trained range [{self.low}, {self.high}]: the first value must not exceed "
                "the second"
            )

    @property
    def unsigned(self) -> bool:
        """Whether only the amount counts: a speed that was never negative in the training data.

        A spindle that turns the other way (M4) causes the same heat.
        """
        return self.quantity == "spindle_speed" and self.reference + self.low >= 0.0


@dataclass(frozen=True)
class Support:
    """Behaviour of a model outside its training range.

    Inputs are always clipped to the trained range widened by `margin`. In addition:

    - ``clip``: no further action; the deviation at the clipped inputs is returned,
    - ``hold``: the last deviation from inside the range is returned until all inputs are inside again,
    - ``fade``: the deviation is faded linearly to zero over `fade_over` beyond the range.

    With a `JointSupport`, a reading is also outside where the combination of its inputs is unlike the training data:
    ``hold`` and ``fade`` act on this too, ``clip`` does not (see `ErrorModel.distance`).

    Parameters
    ----------
    margin : float
        Fraction of each input's trained span that still counts as inside.
    fade_over : float
        Fraction of each input's trained span over which ``fade`` reaches zero; for the joint distance, of its limit.
    """

    policy: Literal["clip", "hold", "fade"] = "clip"
    margin: float = 0.25
    fade_over: float = 0.5

    def __post_init__(self) -> None:
        check_between("support", 0.0, MARGIN, margin=self.margin)
        check_between("support", LEAST, MARGIN, fade_over=self.fade_over)


class TrainedRange(NamedTuple):
    """Trained range of all inputs of a model, as values minus their reference."""

    low: FloatArray  #: (n_inputs,), minimum with the margin
    high: FloatArray  #: (n_inputs,), maximum with the margin
    fade_span: FloatArray  #: (n_inputs,), distance beyond them over which ``fade`` reaches zero

    @classmethod
    def of(cls, inputs: Sequence[Input], support: Support) -> "TrainedRange":
        """Return the trained range of the given inputs, with the margin."""
        low = np.array([i.low for i in inputs])
        high = np.array([i.high for i in inputs])
        margin = support.margin * (high - low)
        span = (high - low) * support.fade_over
        return cls(low - margin, high + margin, np.where(span > 0, span, np.finfo(np.float64).tiny))

    def clip(self, change: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return inputs minus their reference, clipped to the range, and which were outside."""
        clipped = np.minimum(np.maximum(change, self.low), self.high)
        return clipped, np.asarray(clipped != change)

    def keep(
        self,
        support: Support,
        before: FloatArray,
        deviation: FloatArray,
        change: FloatArray,
        clipped: FloatArray,
        far: FloatArray,
    ) -> FloatArray:
        """Return the deviation after ``hold`` or ``fade``.

        Parameters
        ----------
        before, deviation : ndarray of shape (...,)
            Previous deviation; deviation at the clipped inputs.
        change, clipped : ndarray of shape (..., n_inputs)
            Inputs minus their reference, before and after clipping.
        far : ndarray of shape (...,)
            See `JointSupport.distance`.
        """
        outside = (clipped != change).any(axis=-1) | ~(far <= 1.0)
        if not outside.any():
            return deviation
        if support.policy == "hold":
            return np.where(outside, before, deviation)
        excess = np.minimum(np.abs(change - clipped), self.fade_span) / self.fade_span
        beyond = np.maximum(excess.max(axis=-1, initial=0.0), (far - 1.0) / support.fade_over)
        return np.asarray(deviation * np.clip(1.0 - beyond, 0.0, 1.0))
