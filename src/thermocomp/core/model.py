"""`ErrorModel`: plain numbers with ``init`` and ``step``; the interface between training and operation.

Estimators freeze into one of the families (`thermocomp.core.polynomial`, `thermocomp.core.lineardynamic`). The same
object is evaluated live, replayed in every assessment and written as JSON. It has no hidden state: `step` takes a state
and returns the next one.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.band import Band
from thermocomp.core.bounds import GAP, INPUTS, bound_readings, check_count, check_name
from thermocomp.core.exceptions import InputError, ReadingError, SettingError
from thermocomp.core.expression import Clip, Node, format_node
from thermocomp.core.expression import Input as Leaf
from thermocomp.core.family import ModelFamily
from thermocomp.core.gated import Gated
from thermocomp.core.inputs import Input, Support, TrainedRange
from thermocomp.core.joint import JointSupport
from thermocomp.core.layers import Layers
from thermocomp.core.merging import merge_lags
from thermocomp.core.provenance import HonestError, Provenance, read_approval
from thermocomp.core.rows import Replayable
from thermocomp.core.state import RunOutputs, State
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.validity import Validity
from thermocomp.core.watch import Watch
from thermocomp.core.zero import FIRST_READING, Zeroing

_UNIT = re.compile(r"(um|urad)(/m(\^[2-9])?)?")


@dataclass(frozen=True, kw_only=True)
class ErrorModel(Gated, Replayable, ModelFamily):
    """Frozen model of one error component.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    target : str
        Displacement channel (or error component) that is predicted.
    unit : str
        Unit of the deviation: um or urad; um/m, urad/m^2 and so on for the slopes of a position-dependent component.
    inputs : tuple of Input
        Inputs, in the order of their values.
    intercept : float
        Deviation in the reference state [unit].
    support : Support
        Behaviour outside its training range.
    provenance : Provenance or None
        Origin of the model.
    honest_error : HonestError or None
        Error on unseen cycles; None if the model was never judged.
    validity : Validity or None
        Conditions covered by these cycles.
    joint : JointSupport or None
        Joint support in the space of the inputs; None: only a range per input is known.
    zeroing : Zeroing
        Averaging time for the reference of the inputs with ``rezero``, as in the training.
    band : Band or None
        Uncertainty band; None if not estimated.
    watch : Watch or None
        Checks of the temperatures, and substitute values for rejected ones.
    thresholds : Thresholds
        Fixed numbers by which the compensator decides.

    Examples
    --------
    >>> import thermocomp as tc
    >>> rises = [[0.0], [5.0], [10.0]]
    >>> model = tc.freeze(tc.LeastSquares().fit(rises, [0.0, 10.0, 20.0]), target="z_um")
    >>> model.predict({"x0": [0.0, 4.0]}).round(1).tolist()
    [0.0, 8.0]
    """

    family: str
    target: str
    unit: str
    inputs: tuple[Input, ...]
    intercept: float = 0.0
    support: Support = Support()
    provenance: Provenance | None = None
    honest_error: HonestError | None = None
    validity: Validity | None = None
    joint: JointSupport | None = None
    zeroing: Zeroing = FIRST_READING
    band: Band | None = None
    watch: Watch | None = field(default=None, repr=False)
    thresholds: Thresholds = field(default=THRESHOLDS, repr=False)

    def __post_init__(self) -> None:
        check_name("target", self.target)
        owner, names = f"model of {self.target}", [i.name for i in self.inputs]
        if not _UNIT.fullmatch(self.unit):
            raise SettingError(f"{owner}: unit {self.unit!r}: expected um, urad or, along an axis, um/m", ("unit",))
        check_count(owner, INPUTS, inputs=self.inputs)
        if len(set(names)) != len(names):
            raise SettingError(f"{owner}: an input is named twice in {names}")
        if self.joint is not None and self.joint.n_inputs > len(names):
            raise SettingError(
                f"{owner}: joint support for {self.joint.n_inputs} inputs, but the model has {len(names)}"
            )
        if self.band is not None and max(self.band.speeds, default=-1) >= len(names):
            raise SettingError(
                f"{owner}: its band uses input index {max(self.band.speeds)}: expected 0 to {len(names) - 1}"
            )
        if self.watch is not None and self.watch.thresholds != self.thresholds:
            raise SettingError(f"{owner}: its watch (sensor monitoring) has other thresholds than the model")
        self._check()

    def __getstate__(self) -> dict[str, object]:
        """Return only the numbers for pickling; derived values are recomputed after loading."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    # -- evaluation ---------------------------------------------------------------------------------------------------

    def init(self, reference: ArrayLike | None = None) -> State:
        """Return the state of a machine that has just been zeroed.

        Parameters
        ----------
        reference : array-like of shape (n_inputs,), optional
            Values that count as zero. Default: the first reading for inputs with ``rezero``, and the reference stored
            in the model for the others.

        Returns
        -------
        State
        """
        if reference is None:
            zero = self._reference.copy()
        else:
            zero = np.asarray(reference, dtype=np.float64)
            if zero.shape != (len(self.inputs),) or not np.isfinite(zero).all():
                raise InputError(
                    f"reference of the model of {self.target}: expected {len(self.inputs)} finite numbers, found "
                    f"{zero.tolist()}"
                )
        return State(zero, None, np.zeros(()), np.zeros(len(self.inputs), dtype=np.bool_))

    def step(self, state: State, inputs: FloatArray, dt: float) -> tuple[State, FloatArray]:
        """Process one reading and return the deviation at its time.

        Parameters
        ----------
        state : State
            From `init` or the previous `step`.
        inputs : ndarray of shape (..., n_inputs)
            Values in the order of `inputs` [their units]. Leading axes are a batch of independent runs.
        dt : float
            Time since the previous reading [s]; ignored in the first step.

        Returns
        -------
        state : State
        deviation : ndarray of shape (...,)
            [unit]

        Raises
        ------
        ReadingError
            An input is not finite, or `dt` is negative or not finite.
        """
        if not np.isfinite(inputs).all() or not 0.0 <= dt < np.inf:
            raise self._refuse_reading(inputs, dt)
        inputs, dt = bound_readings(inputs), min(dt, GAP)
        reference = state.reference
        memory = state.memory
        if memory is None:
            reference = self.settle(reference, inputs)
        change = inputs - reference
        clipped, outside = self.clip(change)
        if memory is None:
            memory, dt = self._layers.begin(clipped), 0.0
        memory, found = self._layers.advance(memory, clipped, dt)
        deviation = found[..., 0]
        if self.support.policy != "clip":
            far = np.zeros(change.shape[:-1]) if self.joint is None else self.joint.distance(change)
            deviation = self._range.keep(self.support, state.deviation, deviation, change, clipped, far)
        return State(reference, memory, deviation, outside), deviation

    def run(self, state: State, inputs: FloatArray, steps: FloatArray, further: Sequence[Node] = ()) -> RunOutputs:
        """Process readings one after another: as `step`, but in a fraction of the time.

        Parameters
        ----------
        state : State
            From `init` or a previous step.
        inputs : ndarray of shape (n_readings, ..., n_inputs)
            Values in the order of `inputs` [their units]; at least one reading.
        steps : ndarray of shape (n_readings,)
            Time since the previous reading [s]; the first is ignored if the state is from `init`.
        further : sequence of Node
            Expressions of the clipped changes to be computed as well, without other lags than those of the model.

        Raises
        ------
        ReadingError
            An input is not finite, or a step is negative or not finite.
        """
        if not np.isfinite(inputs).all() or not ((steps >= 0) & (steps < np.inf)).all():
            raise self._refuse_reading(inputs, float(steps.min()))
        layers = self.layers_with(further) if further else self._layers
        inputs, steps = bound_readings(inputs), np.minimum(steps, GAP)
        memory, reference = state.memory, state.reference
        if memory is None:
            reference = self.settle(reference, inputs[0])
        change = inputs - reference
        clipped, outside = self.clip(change)
        if memory is None:
            memory, steps[0] = layers.begin(clipped[0]), 0.0
        memory, outputs = layers.run(memory, clipped, steps)
        deviation, far = outputs[..., 0], np.zeros(outputs.shape[:-1])
        if self.joint is not None and (self.support.policy != "clip" or (self.band and self.band.widening)):
            far = self.joint.distance(change)
        if self.support.policy != "clip":
            before, found = state.deviation, np.empty(deviation.shape)
            for k in range(len(inputs)):
                found[k] = self._range.keep(self.support, before, deviation[k], change[k], clipped[k], far[k])
                before = found[k]
            deviation = found
        last = State(reference, memory, deviation[-1], outside[-1])
        return RunOutputs(state=last, deviation=deviation, outside=outside, change=clipped, far=far, outputs=outputs)

    def _refuse_reading(self, inputs: FloatArray, dt: float) -> ReadingError:
        return ReadingError(
            f"model of {self.target}: inputs {inputs} and time step {dt} s must be finite, and the time step not "
            "negative"
        )

    def settle(self, reference: FloatArray, inputs: FloatArray) -> FloatArray:
        """Return the reference, (..., n_inputs), with unknown values taken from the first reading."""
        return np.where(np.isnan(reference), inputs, reference)

    def clip(self, change: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the inputs minus their reference, clipped to the trained range and margin, and which were outside."""
        return self._range.clip(change)

    def distance(self, state: State, inputs: FloatArray) -> FloatArray:
        """Return the distance of a reading from the training data, in all inputs together.

        Parameters
        ----------
        state : State
            State after the step that processed the reading.
        inputs : ndarray of shape (..., n_inputs)
            The reading.

        Returns
        -------
        ndarray of shape (...,)
            See `JointSupport.distance`; a reading is outside if this exceeds 1 or is NaN. 0 without a joint support.
        """
        if self.joint is None:
            return np.zeros(np.shape(inputs)[:-1])
        return self.joint.distance(bound_readings(inputs) - state.reference)

    def half_width(self, state: State, inputs: FloatArray) -> FloatArray:
        """Return the half-width of the band about the deviation of a reading; state and inputs as of `distance`.

        Returns
        -------
        ndarray of shape (...,)
            [unit]; NaN without a band. Where ``hold`` or ``fade`` changes the output of the model, the half-width grows
            by the difference.
        """
        if self.band is None or state.memory is None:
            return np.full(np.shape(inputs)[:-1], np.nan)
        change = self.change(state, inputs)
        found = self._layers.advance(state.memory, change, 0.0)[1]
        far = self.distance(state, inputs) if self.band.widening else np.zeros(change.shape[:-1])
        return self.widen(
            RunOutputs(
                state=state, deviation=state.deviation, outside=state.outside, change=change, far=far, outputs=found
            )
        )

    def widen(self, run: RunOutputs) -> FloatArray:
        """Return the half-widths of the band, (...,), for the outputs of `run`."""
        if self.band is None:
            return np.full(run.deviation.shape, np.nan)
        kept: FloatArray | float = 0.0
        if self.support.policy != "clip":
            kept = np.abs(run.outputs[..., 0] - run.deviation)
        spread = np.sqrt((run.outputs[..., 1:] ** 2).sum(axis=-1))
        return self.band.half_width(run.change, spread, self.thresholds.stopped_speed, run.far) + kept

    def directions(self, state: State, inputs: FloatArray) -> FloatArray:
        """Return the directions in which the averaged regressions differ; state and inputs as of `distance`.

        Returns
        -------
        ndarray of shape (..., n_directions)
            [unit]; the error of the deviation is modelled as a sum of these, each multiplied by a random number with
            mean 0 and standard deviation 1. n_directions is 0 if the model is not an average.
        """
        change = self.change(state, inputs)
        memory = self._layers.begin(change) if state.memory is None else state.memory
        return self._layers.advance(memory, change, 0.0)[1][..., 1:]

    def change(self, state: State, inputs: FloatArray) -> FloatArray:
        """Return a reading relative to its reference, clipped to the training range."""
        return self.clip(bound_readings(inputs) - state.reference)[0]

    # -- derived numbers ----------------------------------------------------------------------------------------------

    @cached_property
    def _reference(self) -> FloatArray:
        """Reference of each input; NaN where the first reading is the reference."""
        return np.array([np.nan if i.rezero else i.reference for i in self.inputs])

    @cached_property
    def _range(self) -> TrainedRange:
        return TrainedRange.of(self.inputs, self.support)

    @cached_property
    def leaves(self) -> tuple[Leaf, ...]:
        """Inputs of the model as leaves of an expression."""
        return tuple(Leaf(k, i.name) for k, i in enumerate(self.inputs))

    @cached_property
    def _layers(self) -> Layers:
        return self.layers_with()

    def layers_with(self, further: Sequence[Node] = ()) -> Layers:
        """Return the deviation, the spread and further expressions as functions of the clipped changes of the inputs.

        The memory is that of `step` if the further expressions contain no other lags.
        """
        nodes = [self._expression(self.leaves), *self.spread_expressions(self.leaves), *further]
        return Layers(nodes, len(self.inputs), self._order_memory(self.leaves))

    def merged(self) -> Self:
        """Return this model for replays of many variants: lags merged, no spread; its memory is not that of `step`."""
        lean = replace(self)
        layers = Layers([merge_lags(self._expression(self.leaves))], len(self.inputs))
        lean.__dict__["_layers"] = layers  # in place of the cached property of a frozen dataclass
        return lean

    @property
    def remembers(self) -> bool:
        """False: the deviation depends only on the current reading."""
        return self._layers.n_memory > 0

    @property
    def remembered(self) -> tuple[Node, ...]:
        """Lags and recurrences, in the order of the memory."""
        return self._layers.remembered

    @property
    def bounds(self) -> tuple[list[float], list[float], list[float]]:
        """Minimum and maximum change of each input with its margin, and the fade distance beyond them."""
        low, high, span = self._range
        return low.tolist(), high.tolist(), span.tolist()

    def expression(self, change: Sequence[Node] | None = None) -> Node:
        """Return the computation of the model as a tree, equal to `step` with the support policy ``clip``.

        Parameters
        ----------
        change : sequence of Node, optional
            Expressions of the inputs minus their reference, clipped to the trained range.
        """
        bounds = zip(self.inputs, *self.bounds[:2], strict=True)
        return self._expression(change or [Clip(Leaf(k, i.name), low, high) for k, (i, low, high) in enumerate(bounds)])

    def formula(self) -> str:
        """Return the model as one line of text."""
        return format_node(self.expression())

    def taken(self, by: str | None) -> Self:
        """Return this model with the approval of a person if it is unproven; else unchanged.

        Parameters
        ----------
        by : str or None
            Person and reason, such as ``"M. Weber, trial on machine 7"``; None: not approved.

        Raises
        ------
        InputError
            Name or reason is missing.
        """
        if by is None:
            return self
        taken, found = read_approval(by), self.honest_error
        if found is None or found.word != "unproven":
            return self
        return replace(self, honest_error=replace(found, taken=taken))
