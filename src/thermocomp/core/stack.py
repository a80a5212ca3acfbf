"""`Stack`: joint evaluation of many frozen models, such as the 32 components of a machine."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.state import State
from thermocomp.core.terms import Term, TermTable, Variable
from thermocomp.core.together import Together, TogetherState

IndexArray = NDArray[np.intp]
# an input as used by one model: with the reference, bounds, margin and fading of that model
Tap = tuple[Input, float, float]


class StackState(NamedTuple):
    """State of a stack between two steps; leading axes, if any, are a batch of independent runs."""

    reference: FloatArray  #: (..., n_taps), values that count as zero
    memory: FloatArray | None  #: (..., n_lags); None before the first reading
    deviation: FloatArray  #: (..., n_models), last deviations returned
    outside: BoolArray  #: (..., n_taps), inputs beyond the trained range
    groups: tuple[TogetherState, ...]  #: states of the paced models that share their states
    others: tuple[State, ...]  #: states of the models that are stepped individually


class Stack:
    """Several models with one `init` and one `step`; each gives the same output as alone, up to rounding.

    A `Polynomial` is a `LinearDynamic` without lags: models of the two families share one table of terms, one bank of
    lags and one readout, so that an input, variable or term used by several of them is evaluated once. `PacedDynamic`
    models with the same states are grouped. The models of the other families are stepped individually.

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
        alike: dict[object, list[int]] = {}
        for k, m in enumerate(self.models):
            if isinstance(m, PacedDynamic) and (key := Together.key(m)) is not None:
                alike.setdefault(key, []).append(k)
        paced = [[m for k in group if isinstance(m := self.models[k], PacedDynamic)] for group in alike.values()]
        self._groups = [
            (np.array(group, dtype=np.intp), Together(members), self._places(members[0]))
            for group, members in zip(alike.values(), paced, strict=True)
        ]
        grouped = {k for group in alike.values() for k in group}
        self._others = [
            (k, m, self._places(m))
            for k, m in enumerate(self.models)
            if not isinstance(m, Polynomial | LinearDynamic) and k not in grouped
        ]
        linear = [(k, m) for k, m in enumerate(self.models) if isinstance(m, Polynomial | LinearDynamic)]
        self._any_linear = bool(linear)
        self._lay(linear)

    def _places(self, model: ErrorModel) -> IndexArray:
        return np.array([self.inputs.index(i.name) for i in model.inputs], dtype=np.intp)

    def _lay(self, linear: Sequence[tuple[int, Polynomial | LinearDynamic]]) -> None:
        """Combine the models of the two linear families in one layout."""
        # entries of these dicts that exist already are reused
        taps: dict[Tap, int] = {}
        variables: dict[tuple[tuple[int, float], ...], int] = {}
        terms: dict[Term, int] = {}
        bounds: list[list[float]] = []  # of each tap: reference, low, high, fade span
        read_out: list[tuple[int, int, float]] = []  # term, model, factor
        lags: list[tuple[int, float, int, float]] = []  # term, time constant, model, factor
        used: dict[int, list[int]] = {}  # taps by model
        for k, m in linear:
            mine = used[k] = []
            for i, *row in zip(m.inputs, m._reference, *m._range, strict=True):
                mine.append(taps.setdefault((i, m.support.margin, m.support.fade_over), len(taps)))
                bounds += [row] if len(bounds) < len(taps) else []
            mixed = []
            for v in m._table.variables:
                weights = tuple((mine[i], w) for i, w in v.weights)
                mixed.append(variables.setdefault(weights, len(variables)))
            at = [terms.setdefault(tuple(mixed[v] for v in t), len(terms)) for t in m._table.terms]
            if isinstance(m, Polynomial):
                read_out += [(t, k, c) for t, c in zip(at, m.coefficients, strict=True)]
            else:
                read_out += [(t, k, c) for t, c in zip(at, m.direct, strict=True)]
                follows = (at[s] for s in m.lag_signals)
                lags += [(t, tau, k, c) for t, tau, c in zip(follows, m.time_constants, m.lagged, strict=True)]
        self._tap_names = tuple(i.name for i, _, _ in taps)
        self._columns = np.array([self.inputs.index(name) for name in self._tap_names], dtype=np.intp)
        self._zero, self._low, self._high, self._span = np.array(bounds, dtype=np.float64).reshape(-1, 4).T
        self._table = TermTable(len(taps), tuple(Variable("", w) for w in variables), tuple(terms))
        self._follows = np.array([t for t, _, _, _ in lags], dtype=np.intp)
        self._tau = np.array([tau for _, tau, _, _ in lags], dtype=np.float64)
        n = len(self.models)
        self._direct, self._lagged = np.zeros((len(terms), n)), np.zeros((len(lags), n))
        for t, k, c in read_out:
            self._direct[t, k] += c
        for lag, (_, _, k, c) in enumerate(lags):
            self._lagged[lag, k] = c
        self._intercept = np.zeros(n)
        for k, m in linear:
            self._intercept[k] = m.intercept
        self._held, self._faded = (
            _padded({k: used[k] for k, m in linear if m.support.policy == policy and m.inputs})
            for policy in ("hold", "fade")
        )
        self._fade_over = np.array([self.models[k].support.fade_over for k in self._faded[0].tolist()])
        self._joint = [
            (k, m.joint, np.array(used[k], dtype=np.intp))
            for k, m in linear
            if m.joint is not None and m.support.policy != "clip"
        ]

    def init(self) -> StackState:
        """Return the state of a machine that has just been zeroed: see `ErrorModel.init`."""
        return StackState(
            reference=self._zero.copy(),
            memory=None,
            deviation=np.zeros(len(self.models)),
            outside=np.zeros(len(self._zero), dtype=np.bool_),
            groups=tuple(together.init() for _, together, _ in self._groups),
            others=tuple(m.init() for _, m, _ in self._others),
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
        if self._any_linear or not self.models:
            linear = self._step_linear(state, values, dt)
            deviation = linear.deviation
        else:
            linear, deviation = state, np.empty((*values.shape[:-1], len(self.models)))
        groups = []
        for (members, together, columns), earlier in zip(self._groups, state.groups, strict=True):
            later, deviation[..., members] = together.step(earlier, values[..., columns], dt)
            groups.append(later)
        others = []
        for (k, model, columns), before in zip(self._others, state.others, strict=True):
            after, deviation[..., k] = model.step(before, values[..., columns], dt)
            others.append(after)
        return linear._replace(deviation=deviation, groups=tuple(groups), others=tuple(others)), deviation

    def _step_linear(self, state: StackState, values: FloatArray, dt: float) -> StackState:
        """Step the models of the two linear families; deviations of other models are set to their intercept or zero."""
        seen, reference, memory = values[..., self._columns], state.reference, state.memory
        if memory is None:
            reference = np.where(np.isnan(reference), seen, reference)
        change = seen - reference
        clipped = np.minimum(np.maximum(change, self._low), self._high)
        outside = clipped != change
        terms = self._table.evaluate(clipped)
        signals = terms[..., self._follows]
        memory = signals if memory is None else lagbank.advance(memory, signals, dt, self._tau)
        deviation = np.asarray(terms @ self._direct + memory @ self._lagged + self._intercept)
        if self._joint or outside.any():
            far = np.zeros((*change.shape[:-1], len(self.models)))
            for k, joint, taps in self._joint:
                far[..., k] = joint.distance(change[..., taps])
            models, taps = self._faded
            if models.size:
                excess = (np.minimum(np.abs(change - clipped), self._span) / self._span)[..., taps].max(axis=-1)
                beyond = np.maximum(excess, (far[..., models] - 1.0) / self._fade_over)
                deviation[..., models] *= np.clip(1.0 - beyond, 0.0, 1.0)
            models, taps = self._held
            if models.size:
                last, now = state.deviation[..., models], deviation[..., models]
                beyond = outside[..., taps].any(axis=-1) | ~(far[..., models] <= 1.0)
                deviation[..., models] = np.where(beyond, last, now)
        return StackState(
            reference=reference,
            memory=memory,
            deviation=deviation,
            outside=outside,
            groups=state.groups,
            others=state.others,
        )

    def half_widths(self, state: StackState, values: FloatArray) -> FloatArray:
        """Return the half-widths of the bands about the deviations of a reading.

        Parameters
        ----------
        values : ndarray of shape (..., n_inputs)
            The reading.

        Returns
        -------
        ndarray of shape (..., n_models)
            One per model [its unit]; NaN for a model without a band.
        """
        found = np.full((*values.shape[:-1], len(self.models)), np.nan)
        for (members, together, _), now in zip(self._groups, state.groups, strict=True):
            found[..., members] = together.half_widths(now)
        for (k, model, columns), s in zip(self._others, state.others, strict=True):
            found[..., k] = model.half_width(s, values[..., columns])
        return found

    def outside(self, state: StackState) -> tuple[str, ...]:
        """Return the names of the inputs that were outside the trained range of a model in the last step."""
        found = {
            name for name, out in zip(self._tap_names, np.moveaxis(state.outside, -1, 0), strict=True) if out.any()
        }
        ends: list[tuple[ErrorModel, BoolArray]] = [
            (together.models[0], s.outside) for (_, together, _), s in zip(self._groups, state.groups, strict=True)
        ]
        ends += [(model, s.outside) for (_, model, _), s in zip(self._others, state.others, strict=True)]
        for model, beyond in ends:
            found |= {i.name for i, out in zip(model.inputs, np.moveaxis(beyond, -1, 0), strict=True) if out.any()}
        return tuple(name for name in self.inputs if name in found)


def _padded(taps: dict[int, list[int]]) -> tuple[IndexArray, IndexArray]:
    """Return models (n,) and their taps (n, maximum number of taps), padded by repeating the first tap of a model."""
    widest = max((len(t) for t in taps.values()), default=0)
    rows = [t + t[:1] * (widest - len(t)) for t in taps.values()]
    return np.array(list(taps), dtype=np.intp), np.array(rows, dtype=np.intp).reshape(len(taps), widest)
