"""Figures of merit with their unit and direction of improvement."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.messages import Message

Function = Callable[[FloatArray, FloatArray], float]


@dataclass(frozen=True)
class Metric:
    """A figure of merit.

    Parameters
    ----------
    name : str
    best : {'low', 'high', 'zero'}
        Best value.
    unit : str
        ``um`` denotes the unit of the deviation; ``%`` and ``1`` are literal.
    description : str
    function : callable
        (measured, predicted) -> value.
    """

    name: str
    best: Literal["low", "high", "zero"]
    unit: str
    description: str
    function: Function

    def __call__(self, measured: FloatArray, predicted: FloatArray) -> float:
        """Evaluate for measured and predicted deviations of shape (n_rows,) [um]."""
        return self.function(measured, predicted)

    def better(self, a: float, b: float) -> bool:
        """Return whether the value `a` is better than the value `b`."""
        if self.best == "zero":
            return abs(a) < abs(b)
        return a < b if self.best == "low" else a > b


METRICS: dict[str, Metric] = {}


def metric(best: Literal["low", "high", "zero"], unit: str) -> Callable[[Function], Metric]:
    """Register a function of (measured, predicted) as a metric; its docstring is the description."""

    def register(function: Function) -> Metric:
        name = function.__name__
        METRICS[name] = Metric(
            name=name, best=best, unit=unit, description=Message((function.__doc__ or "").strip()), function=function
        )
        return METRICS[name]

    return register


@metric(best="low", unit="um")
def mae(measured: FloatArray, predicted: FloatArray) -> float:
    """Mean absolute residual."""
    return float(np.abs(measured - predicted).mean())


@metric(best="low", unit="um")
def rms(measured: FloatArray, predicted: FloatArray) -> float:
    """Root mean square of the residual."""
    return float(np.sqrt(np.mean((measured - predicted) ** 2)))


@metric(best="low", unit="um")
def max_abs(measured: FloatArray, predicted: FloatArray) -> float:
    """Largest absolute residual."""
    return float(np.abs(measured - predicted).max())


@metric(best="low", unit="um")
def peak_to_peak(measured: FloatArray, predicted: FloatArray) -> float:
    """Range of the residual, as ISO 230-3 states a drift."""
    return float(np.ptp(measured - predicted))


@metric(best="zero", unit="um")
def bias(measured: FloatArray, predicted: FloatArray) -> float:
    """Mean of the residual."""
    return float((measured - predicted).mean())


@metric(best="high", unit="%")
def reduction(measured: FloatArray, predicted: FloatArray) -> float:
    """Reduction of the RMS relative to no compensation, in percent; negative means harm."""
    none = rms(measured, np.zeros_like(measured))
    return 100.0 * (1.0 - rms(measured, predicted) / none) if none > 0 else float("-inf")
