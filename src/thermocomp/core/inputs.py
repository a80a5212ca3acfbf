"""What a model wants to know, in which range it was trained, and what it does beyond."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from thermocomp.core.exceptions import InputError


@dataclass(frozen=True)
class Input:
    """One input of a model, with the range it was trained in.

    Parameters
    ----------
    name : str
        Channel name.
    quantity, unit : str
        What it measures, in house units.
    reference : float
        Value that counts as zero [unit].
    rezero : bool
        True: the mean of the first readings after a start (or a re-zeroing) replaces `reference`, as the temperatures
        of a drift test are counted from its start (`ErrorModel.zeroing`); False: `reference` is absolute, as for a
        spindle speed.
    low, high : float
        Trained range of value minus reference [unit].
    """

    name: str
    quantity: str
    unit: str
    reference: float
    rezero: bool
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.low) and np.isfinite(self.high)):
            raise InputError(f"input {self.name}: trained range [{self.low}, {self.high}] must be finite numbers")
        if not self.low <= self.high:
            raise InputError(f"input {self.name}: trained range [{self.low}, {self.high}] is empty")


@dataclass(frozen=True)
class Support:
    """What a model does outside its trained range.

    Inputs are always clipped to the trained range widened by `margin`; on top of that

    - ``clip``: nothing, the deviation at the clipped inputs is given,
    - ``hold``: the last deviation from inside the range is given until all inputs are back,
    - ``fade``: the deviation is faded to zero, linearly, over `fade_over` beyond the range.

    A model with a `JointSupport` is outside, too, where its inputs together are unlike all that was trained: ``hold``
    and ``fade`` act on that as well, ``clip`` gives what it gives (see `ErrorModel.distance`).

    Parameters
    ----------
    policy : {'clip', 'hold', 'fade'}
    margin : float
        Share of each input's trained span that is still taken as inside.
    fade_over : float
        Share of each input's trained span over which ``fade`` reaches zero; of the joint distance: share of its limit.
    """

    policy: Literal["clip", "hold", "fade"] = "clip"
    margin: float = 0.25
    fade_over: float = 0.5

    def __post_init__(self) -> None:
        if not self.margin >= 0 or not self.fade_over > 0:
            raise InputError(f"support: margin {self.margin} must be >= 0 and fade_over {self.fade_over} > 0")


def check_finite(owner: str, **numbers: Any) -> None:
    """Raise `InputError` if one of the named number sequences holds a nan or an infinity."""
    for name, values in numbers.items():
        if not np.isfinite(np.asarray(values, dtype=np.float64)).all():
            raise InputError(f"{owner}: {name} must be finite numbers, found {values}")
