"""Inputs of the models along a program: spindle speed from the program, all others constant or forecast."""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, explain_unknown
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.units import read_with_unit

FloatArray = NDArray[np.float64]

SPEED = "spindle_speed"
#: example value of each quantity, for messages
_EXAMPLES = {
    "temperature": "21.5degC",
    "displacement": "3um",
    "angle": "5urad",
    "position": "100mm",
    "feed": "900mm/min",
}


def interpolate(places: Sequence[float], values: Sequence[float], place: float) -> float:
    """Return the value at a place: linear between the given places, constant beyond the outermost ones."""
    k = bisect_right(places, place)
    if k in (0, len(places)):
        return values[0 if k == 0 else -1]
    share = (place - places[k - 1]) / (places[k] - places[k - 1])
    return (1.0 - share) * values[k - 1] + share * values[k]


@dataclass(frozen=True)
class InputSignal:
    """Value over the time of the program: linear between its points, constant before the first and after the last.

    Parameters
    ----------
    time : tuple of float
        Time since the start of the program, increasing [s].
    values : tuple of float
        Values at these times.

    Raises
    ------
    InputError
        There is no point, a number is not finite, or the time does not increase.
    """

    time: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.time or len(self.time) != len(self.values):
            raise InputError(
                f"forecast: {len(self.time)} times and {len(self.values)} values: expected equal numbers, at least 1"
            )
        if not all(map(math.isfinite, (*self.time, *self.values))):
            raise InputError("forecast: times and values must be finite numbers")
        for a, b in pairwise(self.time):
            if not a < b:
                raise InputError(f"forecast: the times must increase, but {b:g} s follows {a:g} s")

    @classmethod
    def constant(cls, value: float) -> "InputSignal":
        """Return a signal with the same value at all times."""
        return cls((0.0,), (value,))

    @property
    def varies(self) -> bool:
        """True if the signal changes over time."""
        return len(self.time) > 1

    def at(self, time: float) -> float:
        """Return the value of the signal at a time [s]."""
        return interpolate(self.time, self.values, time)

    def held(self, time: float) -> float:
        """Return the duration, up to a time of the program, for which the value was held beyond its points [s]."""
        if not self.varies:
            return 0.0
        return max(time - self.time[-1], 0.0) + max(min(time, self.time[0]), 0.0)


#: signal over the program, by input name
Inputs = Mapping[str, InputSignal]


class Wiring:
    """Sources of the inputs of one model.

    An input of quantity ``spindle_speed`` gets the speed of the program; an input that does not affect the deviation
    needs no source.

    Parameters
    ----------
    others : mapping of str to InputSignal
        Inputs that do not follow from the program.

    Raises
    ------
    InputError
        The model requires an input that is not given.
    """

    def __init__(self, model: ErrorModel, others: Inputs) -> None:
        self._speed = [k for k, i in enumerate(model.inputs) if i.quantity == SPEED]
        self._signals = {k: _signal(model, i, others) for k, i in enumerate(model.inputs) if i.quantity != SPEED}
        self._varying = [(k, s) for k, s in self._signals.items() if s.varies]
        self._values = np.zeros(len(model.inputs))
        for k, signal in self._signals.items():
            self._values[k] = signal.values[0]

    @property
    def varies(self) -> bool:
        """True if an input of the model changes over time independently of the program."""
        return bool(self._varying)

    def values(self, time: float, speed: float) -> FloatArray:
        """Return the inputs of the model, in their order, at a time [s] and a spindle speed [1/min]."""
        values = self._values.copy()
        for k in self._speed:
            values[k] = speed
        for k, signal in self._varying:
            values[k] = signal.at(time)
        return values


def constants(texts: Sequence[str], models: Sequence[ErrorModel]) -> dict[str, InputSignal]:
    """Read the inputs to which the user assigned constant values.

    Parameters
    ----------
    texts : sequence of str
        Input name, with or without its unit at the end (``t3_C``), and value with a unit, such as ``t3=21.5degC``.
    """
    inputs = {i.name: i for m in models for i in m.inputs}
    found: dict[str, InputSignal] = {}
    for text in texts:
        said, _, value = (part.strip() for part in text.partition("="))
        fitting = [n for n in inputs if said in (n, n.rpartition("_")[0])]
        if len(fitting) != 1:
            raise explain_unknown("input", said, [n for n, i in inputs.items() if i.quantity != SPEED])
        channel = inputs[fitting[0]]
        if channel.quantity == SPEED:
            raise InputError(f"constant {text!r}: the spindle speed is taken from the program; remove this value")
        if channel.name in found:
            raise InputError(f"constant {text!r}: {channel.name} was given before; remove one")
        number = read_with_unit(value, channel.quantity)
        if number is None:
            raise InputError(f"constant {text!r}: write a value with its unit, such as {_written(channel, said)}")
        found[channel.name] = InputSignal.constant(number)
    return found


def _signal(model: ErrorModel, channel: Input, others: Inputs) -> InputSignal:
    if channel.name in others:
        return others[channel.name]
    if channel.name not in model.sensors:
        return InputSignal.constant(channel.reference)
    kind = channel.quantity.replace("_", " ")
    raise InputError(
        f"model of {model.target} needs {channel.name}, a {kind}: it is not driven by the speed alone; give "
        f"--constant {_written(channel, channel.name)} or --forecast FILE"
    )


def _written(channel: Input, name: str) -> str:
    return f"{name}={_EXAMPLES.get(channel.quantity, f'1{channel.unit}')}"
