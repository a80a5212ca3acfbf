"""`Stack`: joint evaluation of many frozen models, such as the 32 components of a machine."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.bands import Bands
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.expression import Input as Leaf
from thermocomp.core.inputs import Input
from thermocomp.core.layers import Layers
from thermocomp.core.model import ErrorModel

IndexArray = NDArray[np.intp]
# an input as used by one model: with the reference, bounds, margin and fading of that model
Tap = tuple[Input, float, float]


class StackState(NamedTuple):
    """State of a stack between two steps; leading axes, if any, are a batch of independent runs."""

    reference: FloatArray  #: (..., n_taps), values that count as zero; a tap is an input with its reference and range
    memory: FloatArray | None  #: (..., n_memory); None before the first reading
    deviation: FloatArray  #: (..., n_models), last deviations returned
    outside: BoolArray  #: (..., n_taps), inputs beyond the trained range
    outputs: FloatArray  #: (..., n_outputs), of the expressions: deviations within the trained range, then spreads


class Stack:
    """Several models with one `init` and one `step`; each gives the same output as on its own, up to rounding.

    Their expressions are compiled together (`thermocomp.core.layers`): an input, variable, term or lag used by several
    of them is computed once.

    Attributes
    ----------
    inputs : tuple of str
        Names of the inputs of all models, in the order of their first use.

    Raises
    ------
    InputError
        Two models use the same input name for different quantities.
    """

    def __init__(self, models: Sequence[ErrorModel]) -> None:
        self.models = tuple(models)
        measured: dict[str, tuple[str, str]] = {}
        for i in (i for m in self.models for i in m.inputs):
            if measured.setdefault(i.name, (i.quantity, i.unit)) != (i.quantity, i.unit):
                first = " in ".join(measured[i.name])
                raise InputError(f"input {i.name}: one model needs {first}, another needs {i.quantity} in {i.unit}")
        self.inputs = tuple(measured)
        taps: dict[Tap, int] = {}
        bounds: list[list[float]] = []  # of each tap: reference, low, high, fade span
        self._taps: list[IndexArray] = []  # of each model
        outputs, spreads = [], []
        for m in self.models:
            mine = []
            for i, *row in zip(m.inputs, m._reference, *m._range, strict=True):
                mine.append(taps.setdefault((i, m.support.margin, m.support.fade_over), len(taps)))
                bounds += [row] if len(bounds) < len(taps) else []
            leaves = [Leaf(k, i.name) for k, i in zip(mine, m.inputs, strict=True)]
            outputs.append(m.expression(leaves))
            spreads.append(m.spread_expressions(leaves))
            self._taps.append(np.array(mine, dtype=np.intp))
        self._layers = Layers([*outputs, *(node for nodes in spreads for node in nodes)], len(taps))
        self._bands = Bands(self.models, self._taps, [len(nodes) for nodes in spreads])
        self._moved = [k for k, m in enumerate(models) if m.support.policy != "clip"]  # by their support
        self._tap_names = tuple(i.name for i, _, _ in taps)
        self._columns = np.array([self.inputs.index(name) for name in self._tap_names], dtype=np.intp)
        self._zero, self._low, self._high, self._span = np.array(bounds, dtype=np.float64).reshape(-1, 4).T
        self._held, self._faded = (
            _padded({k: self._taps[k] for k, m in enumerate(models) if m.support.policy == policy and m.inputs})
            for policy in ("hold", "fade")
        )
        self._fade_over = np.array([self.models[k].support.fade_over for k in self._faded[0].tolist()])
        self._joint = [
            (k, m.joint, self._taps[k])
            for k, m in enumerate(models)
            if m.joint is not None and m.support.policy != "clip"
        ]

    def init(self) -> StackState:
        """Return the state of a machine that has just been zeroed: see `ErrorModel.init`."""
        nowhere = np.zeros(len(self._zero), dtype=np.bool_)
        return StackState(
            reference=self._zero.copy(),
            memory=None,
            deviation=np.zeros(len(self.models)),
            outside=nowhere,
            outputs=np.empty(0),
        )

    def step(self, state: StackState, values: FloatArray, dt: float) -> tuple[StackState, FloatArray]:
        """Process one reading and return the deviations at its time.

        Parameters
        ----------
        values : ndarray of shape (..., n_inputs)
            Values in the order of `inputs` [their units]. Leading axes are a batch of independent runs.
        dt : float
            Time since the previous reading [s]; ignored in the first step.

        Returns
        -------
        deviations : ndarray of shape (..., n_models)
            One per model [its unit].
        """
        if not np.isfinite(values).all() or not 0.0 <= dt < np.inf:
            raise ReadingError(
                f"inputs {values} of {', '.join(self.inputs)} and time step {dt} s must be finite, and the time step "
                "not negative"
            )
        reference, memory = state.reference, state.memory
        if memory is None:
            seen = values[..., self._columns]
            reference = np.where(np.isnan(reference), seen, reference)
        change, clipped = self._changes(reference, values)
        outside = clipped != change
        if memory is None:
            memory, dt = self._layers.begin(clipped), 0.0
        memory, found = self._layers.advance(memory, clipped, dt)
        deviation = found[..., : len(self.models)].copy()
        if self._joint or outside.any():
            deviation = self._supported(state.deviation, deviation, change, clipped)
        after = StackState(reference=reference, memory=memory, deviation=deviation, outside=outside, outputs=found)
        return after, deviation

    def _changes(self, reference: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the values of all taps minus their reference, and these clipped to the trained ranges."""
        change = values[..., self._columns] - reference
        return change, np.minimum(np.maximum(change, self._low), self._high)

    def _supported(
        self, before: FloatArray, deviation: FloatArray, change: FloatArray, clipped: FloatArray
    ) -> FloatArray:
        """Return the deviations after the support policies ``hold`` and ``fade`` outside the trained range."""
        far, outside = np.zeros(deviation.shape), clipped != change
        for k, joint, taps in self._joint:
            far[..., k] = joint.distance(change[..., taps])
        models, taps = self._faded
        if models.size:
            excess = (np.minimum(np.abs(change - clipped), self._span) / self._span)[..., taps].max(axis=-1)
            beyond = np.maximum(excess, (far[..., models] - 1.0) / self._fade_over)
            deviation[..., models] *= np.clip(1.0 - beyond, 0.0, 1.0)
        models, taps = self._held
        if models.size:
            last, now = before[..., models], deviation[..., models]
            beyond = outside[..., taps].any(axis=-1) | ~(far[..., models] <= 1.0)
            deviation[..., models] = np.where(beyond, last, now)
        return deviation

    def half_widths(self, state: StackState, values: FloatArray) -> FloatArray:
        """Return the half-widths of the bands about the deviations of the last reading.

        Parameters
        ----------
        values : ndarray of shape (..., n_inputs)
            That reading.

        Returns
        -------
        ndarray of shape (..., n_models)
            One per model [its unit]; NaN for a model without a band.
        """
        if state.memory is None or all(m.band is None for m in self.models):
            return np.full((*values.shape[:-1], len(self.models)), np.nan)
        said, n = state.outputs, len(self.models)
        found = self._bands.half_widths(*self._changes(state.reference, values), said[..., n:])
        if self._moved:
            found[..., self._moved] += np.abs(said[..., self._moved] - state.deviation[..., self._moved])
        return found

    def outside(self, state: StackState) -> tuple[str, ...]:
        """Return the names of the inputs that were outside the trained range of a model in the last step."""
        beyond = np.moveaxis(state.outside, -1, 0)
        found = {name for name, out in zip(self._tap_names, beyond, strict=True) if out.any()}
        return tuple(name for name in self.inputs if name in found)


def _padded(taps: dict[int, IndexArray]) -> tuple[IndexArray, IndexArray]:
    """Return models (n,) and their taps (n, maximum number of taps), padded with repetitions of a model's first tap."""
    widest = max((len(t) for t in taps.values()), default=0)
    rows = [[*t, *t[:1].tolist() * (widest - len(t))] for t in taps.values()]
    return np.array(list(taps), dtype=np.intp), np.array(rows, dtype=np.intp).reshape(len(taps), widest)
