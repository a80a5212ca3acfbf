"""The compensator: one reading in, one correction per axis or target out. State in, state out.

The way of a reading: in time? -> watch (which temperatures are to be believed; what stands in for the others) -> gate
(complete? finite? plausible?) -> minus the zero and `ErrorModel.step` per model -> offset and slope per axis -> minus
sign -> limits -> `Correction`. What the gate turns away changes nothing: every correction stays where it was, for
`Limits.hold`, and fades after that; so does one whose model was never judged without the sensors that failed. The first
readings after a start are averaged: they are what temperatures count from, and the corrections stay zero until it is
known, as long as the spindle stands (`ErrorModel.zeroing`). A probing comes with a reading and counts from the next one
on: it says what the models are wrong by (`thermocomp.runtime.adaptation`).
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Machine
from thermocomp.core.model import ErrorModel, FloatArray, State
from thermocomp.core.position import PositionModel
from thermocomp.core.reading import Reading
from thermocomp.core.watch import Watch
from thermocomp.core.zero import Gathered, robust_mean
from thermocomp.runtime.adaptation import Adaptation, Probing
from thermocomp.runtime.gate import explain_implausible, explain_untimely, is_number
from thermocomp.runtime.limits import fade, limit_line
from thermocomp.runtime.lines import DeviationLine, constant, evaluate, straight
from thermocomp.runtime.watch import WORDS, WatchState, begin, look
from thermocomp.volumetric.model import VolumetricModel
from thermocomp.volumetric.straight import best_lines

#: what is said to be outside where each input is inside its own range, but all together are unlike the training
TOGETHER = "inputs together"


class CompensatorState(NamedTuple):
    """All that a compensator remembers between two readings."""

    models: tuple[State, ...]  #: one per model
    corrections: dict[str, Correction]  #: in force, by target or axis
    time: float | None  #: of the last reading that passed the gate [s]
    clock: float | None  #: the latest at which a step was taken, whatever the gate said [s]
    gathered: tuple[Gathered, ...]  #: readings that the zero is averaged of, one per model; empty once it is known
    watches: tuple[WatchState, ...]  #: over the temperatures
    idle: dict[str, float]  #: how long no model has driven each target or axis; not there: one drives it [s]
    learned: dict[str, Adaptation]  #: from probings, by target or axis


class Compensated(NamedTuple):
    """What a compensator says of one reading."""

    corrections: dict[str, Correction]  #: in force after this reading, by target or axis
    rejected: str  #: why the gate turned the reading away; empty if it passed
    outside: tuple[str, ...]  #: inputs outside the trained range of a model
    failed: dict[str, str]  #: sensors that are not believed, and what they are: see `thermocomp.runtime.watch`
    held: dict[str, str]  #: targets or axes that no model drives, and why: held, then fading
    half_widths: dict[str, float]  #: of the band about the deviation, by target or axis that has one [um]
    refused: dict[str, str]  #: targets or axes whose probing was not used, and why


@dataclass(frozen=True, eq=False)
class Compensator:
    """Models, and what their corrections may never do. It remembers nothing: what it does is `CompensatorState`.

    Made by `of` or `of_machine`.

    Parameters
    ----------
    models : tuple of ErrorModel
        Models of time, stepped one by one, each from a zero of its own.
    lines : dict of str to DeviationLine
        By target or axis.
    limits : Limits

    Raises
    ------
    InputError
        The do-no-harm gate refused a model, or it is unproven and nobody takes it.
    """

    models: tuple[ErrorModel, ...]
    lines: dict[str, DeviationLine]
    limits: Limits = Limits()

    @cached_property
    def watches(self) -> tuple[Watch, ...]:
        """Over the temperatures of the models: one per model file."""
        found: list[Watch] = []
        for m in self.models:
            if m.watch is not None and m.watch not in found:
                found.append(m.watch)
        return tuple(found)

    def __post_init__(self) -> None:
        for m in self.models:
            m.check_may_run()

    @classmethod
    def of(cls, sources: Sequence[ErrorModel | PositionModel], limits: Limits = Limits()) -> "Compensator":
        """Return the compensator of some targets.

        Parameters
        ----------
        sources : sequence of ErrorModel or PositionModel
            One per target [um]. Of a `PositionModel` the thermal part alone: its profile is a table in the controller;
            where it is no straight line, the best one over the travel.
        limits : Limits

        Raises
        ------
        InputError
            Two models have the same target, one does not predict micrometres, or may not run.
        """
        targets = [m.target for m in sources]
        if len(set(targets)) != len(targets):
            raise InputError(f"two models for the same target among {', '.join(targets)}")
        models: list[ErrorModel] = []
        lines: dict[str, DeviationLine] = {}
        for source in sources:
            if source.unit != "um":
                raise InputError(f"model of {source.target} predicts {source.unit}; a compensator corrects um")
            begin = len(models)
            if isinstance(source, PositionModel):
                models += source.models
                lines[source.target] = DeviationLine(slice(begin, len(models)), source.travel, straight(source))
            else:
                models.append(source)
                lines[source.target] = DeviationLine(slice(begin, len(models)), (0.0, 0.0), constant)
        return cls(tuple(models), lines, limits)

    @classmethod
    def of_machine(
        cls, machine: Machine, at: ArrayLike, tool: ArrayLike | None = None, limits: Limits = Limits()
    ) -> "Compensator":
        """Return the compensator of a machine's axes: the best straight line of each through one point.

        Parameters
        ----------
        machine : Machine
            With its components.
        at : array-like of shape (3,)
            Where the other axes stand while one moves [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.
        limits : Limits

        Raises
        ------
        InputError
            A position is not finite, or a model may not run.
        """
        model = VolumetricModel(machine)
        best_lines(model.field(np.zeros(len(model.stack.models))), at, tool)  # says what is wrong with them now

        def along(axis: str) -> Callable[[Sequence[float]], Deviation]:
            return lambda said: best_lines(model.field(np.asarray(said)), at, tool, axes=axis)[axis]

        every = slice(0, len(model.stack.models))
        axes = [machine.axis(name) for name in "XYZ" if name in machine.structure.axes]
        return cls(model.stack.models, {a.name: DeviationLine(every, a.travel, along(a.name)) for a in axes}, limits)

    def start(self) -> CompensatorState:
        """Return the state of a compensator that has seen no reading: all corrections are zero."""
        none = {target: Correction(0.0) for target in self.lines}
        watches = tuple(begin(w) for w in self.watches)
        return CompensatorState(
            tuple(m.init() for m in self.models), none, None, None, (Gathered(),) * len(self.models), watches, {}, {}
        )

    def gate(self, state: CompensatorState, reading: Reading, now: float) -> str:
        """Say why a reading must not be used; the empty string if it may.

        A temperature is plausible while it stays within its trained range widened by the whole span of that range. The
        first readings decide what counts as zero: there the temperatures as a whole (their median) have to be within
        `DAY` of the zero of the training, and each of them as near to the others as it was then, give or take
        `MIN_SPAN` or its trained span. What nature sets no bounds to, a displacement or a bare number, has its trained
        range, widened by `WIDE` times its width. The constants are those of `thermocomp.runtime.gate`.

        Parameters
        ----------
        state : CompensatorState
            Before the reading.
        reading : Reading
            The inputs of all models have to be in it.
        now : float
            The clock of the reading's source, now [s].

        Returns
        -------
        str
        """
        why = explain_untimely(reading, state.time, now, self.limits)
        for model, memory in zip(self.models, state.models, strict=True):
            if why:
                break
            values = [reading.values.get(i.name) for i in model.inputs]
            why = explain_implausible(model, values, memory.reference.tolist())
        return why

    def step(
        self, state: CompensatorState, reading: Reading, now: float, probings: Mapping[str, Probing] | None = None
    ) -> tuple[CompensatorState, Compensated]:
        """Take one reading in and give the corrections that are in force after it.

        Parameters
        ----------
        state : CompensatorState
            From `start` or the previous `step`.
        reading : Reading
        now : float
            The clock of the reading's source, now [s].
        probings : mapping of str to Probing, optional
            By target or axis, made at the time of the reading. They count from the next reading on.

        Returns
        -------
        state : CompensatorState
        said : Compensated
        """
        probings = probings or {}
        state, reading = self._believe(state, reading, now)
        failed = _failed(self.watches, state.watches)
        if rejected := self.gate(state, reading, now):
            state, held = self._idle(state, now, dict.fromkeys(self.lines, rejected))
            refused = dict.fromkeys(probings, f"its reading is rejected: {rejected}")
            return state, Compensated(state.corrections, rejected, (), failed, held, {}, refused)
        dt = 0.0 if state.time is None else reading.time - state.time
        # Travel is not saved up: an outage, with rejected readings or with none, must not end in a jump.
        travel = 0.0 if state.clock is None else min(now - state.clock, self.limits.reading_age)
        states, begins, said, outside = list(state.models), list(state.gathered), list[float](), list[str]()
        given = list[FloatArray]()
        for k, model in enumerate(self.models):
            memory, known = state.models[k], True
            values = np.array([reading.values[i.name] for i in model.inputs])
            if memory.memory is None and np.isnan(memory.reference).any():
                resting = model.zeroing.stands(reading.values.get(model.zeroing.speed))
                gathering = _zeroed(model, memory, begins[k], (reading.time, values, resting))
                memory, begins[k], known, values = gathering
            said.append(math.nan)
            if known:
                memory, deviation = model.step(memory, values, dt)
                said[k] = float(deviation)
                outside += _beyond(model, memory, values)
            states[k] = memory
            given.append(values)
        corrections, idle, held = dict(state.corrections), dict(state.idle), dict[str, str]()
        learned, widths = dict(state.learned), dict[str, float]()
        refused = dict.fromkeys(probings, "no model drives its correction")
        for target, line in self.lines.items():
            models, told = self.models[line.models], said[line.models]
            if failed and (why := _unjudged(models, failed)):
                held[target] = why
            elif all(map(math.isfinite, told)):
                now_said = evaluate(
                    *(line, models, states[line.models], given[line.models], told, reading.time),
                    *(learned.get(target), probings.get(target), failed),
                )
                wanted = Correction.opposing(now_said.deviation)
                corrections[target] = limit_line(wanted, corrections[target], line.travel, travel, self.limits)
                idle.pop(target, None)
                if not math.isnan(now_said.half_width):
                    widths[target] = now_said.half_width
                if now_said.learned is not None:
                    learned[target] = now_said.learned
                if target in probings:
                    refused[target] = now_said.refused
        new = state._replace(
            models=tuple(states), corrections=corrections, gathered=tuple(begins), idle=idle, learned=learned
        )
        new, held = self._idle(new, now, held)
        return new._replace(time=reading.time), Compensated(
            *(new.corrections, "", tuple(dict.fromkeys(outside)), failed, held, widths),
            {target: why for target, why in refused.items() if why},
        )

    def _believe(self, state: CompensatorState, reading: Reading, now: float) -> tuple[CompensatorState, Reading]:
        """Return the reading with what stands in for temperatures that are not believed."""
        if not self.watches or explain_untimely(reading, state.time, now, self.limits):
            return state, reading
        values, states = dict(reading.values), []
        for watch, before in zip(self.watches, state.watches, strict=True):
            given = [values.get(i.name) for i in watch.inputs]
            numbers = np.array([float(v) if is_number(v) else math.nan for v in given])  # type: ignore[arg-type]
            resting = watch.zeroing.stands(values.get(watch.zeroing.speed))
            seen, believed = look(watch, before, reading.time, numbers, resting=resting)
            states.append(seen)
            values |= {watch.inputs[k].name: float(believed[k]) for k in watch.bank.temperatures.tolist()}
        return state._replace(watches=tuple(states)), replace(reading, values=values)

    def _idle(
        self, state: CompensatorState, now: float, held: dict[str, str]
    ) -> tuple[CompensatorState, dict[str, str]]:
        """Let corrections that nothing drives fade once they were held for long; say how long they have been."""
        if not math.isfinite(now):
            return state, held
        clock = _later(state.clock, now)
        # one reading counts for no more than its age may be: a clock that leaps makes nothing fade
        travel = 0.0 if state.clock is None else min(clock - state.clock, self.limits.reading_age)
        corrections, idle, said = dict(state.corrections), dict(state.idle), dict[str, str]()
        for target, why in held.items():
            idle[target] = idle.get(target, 0.0) + travel
            ends = self.lines[target].travel
            corrections[target] = fade(corrections[target], ends, idle[target], travel, self.limits)
            word = "fading" if idle[target] > self.limits.hold else "held"
            said[target] = f"{word}, not driven for {idle[target]:.0f} s: {why}"
        return state._replace(corrections=corrections, clock=clock, idle=idle), said


def _beyond(model: ErrorModel, after: State, values: FloatArray) -> list[str]:
    """Return the inputs that are outside the trained range."""
    if after.outside.any():
        return [i.name for i, out in zip(model.inputs, after.outside, strict=True) if out]
    return [] if model.distance(after, values) <= 1.0 else [TOGETHER]


def _failed(watches: Sequence[Watch], states: Sequence[WatchState]) -> dict[str, str]:
    """Return the sensors that are not believed, and what they are."""
    return {
        name: WORDS[fault]
        for watch, state in zip(watches, states, strict=True)
        if state.fault.any()
        for name, fault in zip(watch.names, state.fault.tolist(), strict=True)
        if fault
    }


def _unjudged(models: Sequence[ErrorModel], failed: Collection[str]) -> str:
    """Say why models must not drive a correction without the sensors that failed; the empty string if they may."""
    for model in models:
        lost = [n for n in failed if n in model.sensors]
        if lost and not model.may_lose(lost):
            return f"{model.target} does harm without {' and '.join(lost)}, or was not judged without"
    return ""


def _zeroed(
    model: ErrorModel, memory: State, gathered: Gathered, reading: tuple[float, FloatArray, bool]
) -> tuple[State, Gathered, bool, FloatArray]:
    """Take a reading into the zero if it belongs there; return whether that is known now, and what the reading says.

    Once it is, the model goes through the readings before this one, as if it had been known from the first of them; all
    readings of the zero say their mean.
    """
    before, values = gathered, reading[1]
    if gathered.belongs(model.zeroing, reading[0], reading[2]):
        gathered = gathered.add(*reading)
        if not gathered.complete(model.zeroing):
            return memory, gathered, False, values
        values = robust_mean(gathered.values)
    mean, last = robust_mean(gathered.values), gathered.times[0]
    memory = memory._replace(reference=np.where(np.isnan(memory.reference), mean, memory.reference))
    for time in before.times:
        memory, _ = model.step(memory, mean, time - last)
        last = time
    return memory, Gathered(), True, values


def _later(clock: float | None, now: float) -> float:
    """Return the clock, which never goes back: time that was travelled in must not be there to travel in again."""
    return now if clock is None else max(clock, now)
