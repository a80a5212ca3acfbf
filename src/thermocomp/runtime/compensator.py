"""The compensator: one reading in, one correction per axis or target out; state in, state out.

Processing chain of a reading: time check -> feed (does the source repeat its last values?) -> watch (which temperatures
are trusted; substitutes) -> gate (complete, finite, plausible) -> minus the zero and `ErrorModel.step` per model ->
offset and slope per axis -> minus sign -> limits -> `Correction`. Rejected readings leave the models unchanged: every
correction is held for `Limits.hold` and fades after that; the same applies to a correction whose model was never judged
without the failed sensors. The first readings after a start, while the spindle is stopped, are averaged to the zero of
the temperatures, and the corrections remain zero until it is known (`ErrorModel.zeroing`). A probing arrives with a
reading and takes effect from the next reading onwards: it measures the error of the models
(`thermocomp.runtime.adaptation`).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Machine
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.reading import Reading
from thermocomp.core.state import State
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.watch import Watch
from thermocomp.core.zero import ZeroMean
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.advance import Advanced, advance
from thermocomp.runtime.clocking import place
from thermocomp.runtime.driving import Driven, drive, rest, travel_time
from thermocomp.runtime.feed import TemperatureFeed
from thermocomp.runtime.gate import explain_implausible, explain_unjudged
from thermocomp.runtime.geometry.straight import best_lines
from thermocomp.runtime.geometry.volumetric import VolumetricModel
from thermocomp.runtime.group import Group
from thermocomp.runtime.identity import remember, sift
from thermocomp.runtime.lines import DeviationLine, constant, evaluate, straight
from thermocomp.runtime.lookout import Lookout
from thermocomp.runtime.state import NO_ZERO, Compensated, CompensatorState, Reference, Status
from thermocomp.runtime.watchstate import WatchState, begin


@dataclass(frozen=True, eq=False)
class Compensator:
    """Models, and the limits of their corrections. It has no memory: the state is a `CompensatorState`.

    Created by `of` or `of_machine`.

    Parameters
    ----------
    models : tuple of ErrorModel
        Models of time, stepped individually, each with a separate zero.
    lines : dict of str to DeviationLine
        Lines by target or axis.
    watching : bool
        True: permit creation even if none of its targets may run, to observe their predictions.
    repeats : {'watch', 'exception'}
        'exception': the source reports changes only, so repeated temperatures do not mean that it has stopped.

    Raises
    ------
    InputError
        None of its targets may run: the do-no-harm gate refused a model, or it is unproven and not approved by a
        person.
    """

    models: tuple[ErrorModel, ...]
    lines: dict[str, DeviationLine]
    limits: Limits = Limits()
    watching: bool = False
    repeats: Literal["watch", "exception"] = "watch"

    @cached_property
    def unsigned(self) -> frozenset[str]:
        """Channels of which only the amount counts: see `Input.unsigned`."""
        inputs = [*(i for m in self.models for i in m.inputs), *(i for w in self.watches for i in w.inputs)]
        return frozenset(i.name for i in inputs if i.unsigned) - {i.name for i in inputs if not i.unsigned}

    @cached_property
    def watches(self) -> tuple[Watch, ...]:
        """Watches over the temperatures of the models: one per model file."""
        found: list[Watch] = []
        for m in self.models:
            if m.watch is not None and m.watch not in found:
                found.append(m.watch)
        return tuple(found)

    @cached_property
    def thresholds(self) -> Thresholds:
        """Thresholds of all models."""
        return self.models[0].thresholds if self.models else THRESHOLDS

    @cached_property
    def _lookouts(self) -> tuple[Lookout, ...]:
        return tuple(Lookout(w) for w in self.watches)

    @cached_property
    def feed(self) -> TemperatureFeed:
        """Temperatures of the models and watches, whose repetition is monitored."""
        inputs = [i for m in self.models for i in m.inputs] + [i for w in self.watches for i in w.inputs]
        heat = dict.fromkeys(i.name for i in inputs if i.quantity == "temperature")
        return TemperatureFeed(tuple(heat) if self.repeats == "watch" else (), self.watches, self.thresholds)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Groups of models that are evaluated together in each step."""
        return Group.of(self.models)

    @cached_property
    def shadow(self) -> dict[str, Status]:
        """Targets or axes that are predicted but must not run, with the reasons."""
        found = dict[str, Status]()
        for target, line in self.lines.items():
            try:
                for m in self.models[line.models]:
                    m.check_may_run()
            except InputError as e:
                found[target] = Status("shadow", str(e))
        return found

    def __post_init__(self) -> None:
        if any(m.thresholds != self.thresholds for m in self.models):
            raise InputError("the models have different thresholds; fit them with the same version of thermocomp")
        if self.shadow and len(self.shadow) == len(self.lines) and not self.watching:
            raise InputError(next(iter(self.shadow.values())).reason)

    @classmethod
    def of(
        cls,
        sources: Sequence[ErrorModel | PositionModel],
        limits: Limits = Limits(),
        *,
        watching: bool = False,
    ) -> "Compensator":
        """Return the compensator of the given targets.

        Parameters
        ----------
        sources : sequence of ErrorModel or PositionModel
            One per target [um]. Of a `PositionModel`, only the thermal part is used, since its profile is a table in
            the controller; if the thermal part is not a straight line, it is replaced by the best line over the travel.
        """
        targets = [m.target for m in sources]
        if len(set(targets)) != len(targets):
            raise InputError(f"two models for the same target among {', '.join(targets)}; give one model per target")
        models: list[ErrorModel] = []
        lines: dict[str, DeviationLine] = {}
        for source in sources:
            if source.unit != "um":
                raise InputError(
                    f"model of {source.target} predicts {source.unit}; a compensator needs models that predict um"
                )
            begin = len(models)
            if isinstance(source, PositionModel):
                models += source.models
                lines[source.target] = DeviationLine(slice(begin, len(models)), source.travel, straight(source))
            else:
                models.append(source)
                lines[source.target] = DeviationLine(slice(begin, len(models)), (0.0, 0.0), constant)
        return cls(tuple(models), lines, limits, watching)

    @classmethod
    def of_machine(
        cls, machine: Machine, at: ArrayLike, tool: ArrayLike | None = None, limits: Limits = Limits()
    ) -> "Compensator":
        """Return the compensator of a machine's axes, with the best straight line of each axis through one point.

        Parameters
        ----------
        at : array-like of shape (3,)
            Positions of the other axes while one moves [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.
        """
        model = VolumetricModel(machine)
        best_lines(model.field(np.zeros(len(model.stack.models))), at, tool)  # raises an error now if they are invalid

        def along(axis: str) -> Callable[[Sequence[float]], Deviation]:
            return lambda said: best_lines(model.field(np.asarray(said)), at, tool, axes=axis)[axis]

        every = slice(0, len(model.stack.models))
        axes = [machine.axis(name) for name in "XYZ" if name in machine.structure.axes]
        return cls(model.stack.models, {a.name: DeviationLine(every, a.travel, along(a.name)) for a in axes}, limits)

    def start(self) -> CompensatorState:
        """Return the state of a compensator before the first reading: all corrections are zero."""
        none = {target: Correction(0.0) for target in self.lines}
        models, watches = [m.init() for m in self.models], tuple(begin(w) for w in self.watches)
        return self.share(
            models,
            CompensatorState(
                models=(),
                corrections=none,
                time=None,
                clock=None,
                taken=None,
                origin=0.0,
                averaged=(ZeroMean(),) * len(self.models),
                watches=watches,
                idle={},
                learned={},
                references={},
                raw={},
                orders=dict(self.shadow),
                away=None,
            ),
        )

    def share(self, models: Sequence[State], state: CompensatorState) -> CompensatorState:
        """Return a state with the given model states, sharing objects that are equal in several of them."""
        found = list(models)
        for group in self.groups:
            for k, own in zip(group.members, group.share([found[k] for k in group.members]), strict=True):
                found[k] = own
        return state._replace(models=tuple(found))

    def gate(self, state: CompensatorState, reading: Reading) -> str:
        """Return the reason why a reading must not be used, regardless of its time; empty if it may be used.

        A temperature is plausible within its trained range widened on either side by the span of that range. For the
        first readings, which determine the zero, the median of the temperatures must lie within `zero_change` of the
        zero of the training, and each may differ from the others by at most its trained span or `start_offset`: only
        rises from the zero are used. Quantities without physical bounds (a displacement, a dimensionless number) may
        take values in their trained range widened by `margin` times its width: see
        `thermocomp.core.thresholds.Thresholds`.
        """
        for group in self.groups:
            values = group.ranges.pick(reading.values)
            reference = state.models[group.members[0]].reference
            if group.ranges.hold(values, reference):
                continue
            if why := explain_implausible(group.lead, values, reference.tolist()):
                return why
        return ""

    def step(
        self,
        state: CompensatorState,
        reading: Reading,
        now: float,
        probings: Mapping[str, Probing] | None = None,
        tick: float | None = None,
    ) -> tuple[CompensatorState, Compensated]:
        """Process one reading and return the corrections that are in force after it.

        Parameters
        ----------
        now : float
            Present time of the clock of the reading's source [s].
        tick : float, optional
            Present time of the monotonic clock of the process [s], by which corrections move. Default: `now`; if that
            clock is set back, corrections wait until it has reached its previous time.
        """
        (fresh, known_before), tick = sift(state, probings), now if tick is None else tick
        instant, why = place(state, reading, now, tick, self.limits, self.thresholds)
        if not why:
            if negative := [n for n in self.unsigned if _is_negative(reading.values.get(n))]:
                reading = replace(reading, values={**reading.values, **{n: -reading.values[n] for n in negative}})
            state, reading, why = self._believe(state, reading, instant.time, tick)
        if why := why or self.gate(state, reading):
            state, said = self.wait(state, tick, why)
            return state, said._replace(
                refused=dict.fromkeys(probings or (), f"the reading to which the probing belongs is rejected: {why}")
            )
        dt = 0.0 if state.time is None else instant.time - state.time
        travel = travel_time(state, tick, self.limits)
        stepped = advance(self.groups, state.models, state.averaged, reading, instant.time, dt)
        failed = Lookout.failed(self._lookouts, state.watches)
        done = self._drive(state, stepped, (reading.time, instant.time), fresh, failed, travel)
        left = rest(state, done.corrections, tick, self.lines, self.limits, done.held, driven=done.states)
        probed = {t: fresh[t] for t in done.moved}
        new = state._replace(
            models=stepped.states,
            corrections=left.corrections,
            clock=left.clock,
            idle=left.idle,
            averaged=stepped.averaged,
            learned=done.learned,
            probed=remember(state, probed, instant.time, self.thresholds.resumable) if probed else state.probed,
            references=done.references,
            raw=done.raw,
            away=None if done.arrived else state.away,
            because="" if done.arrived else state.because,
            zeroed=reading.time if state.time is None and not state.references else state.zeroed,
            time=instant.time,
            origin=instant.origin,
            taken=left.clock,
        )
        return new, Compensated(
            corrections=left.corrections,
            rejected="",
            outside=stepped.outside,
            failed=failed,
            states=done.states | left.states,
            deviations=done.deviations,
            half_widths=done.half_widths,
            refused=known_before | {t: why for t, why in done.refused.items() if why},
            moved=done.moved,
        )

    def _drive(
        self,
        state: CompensatorState,
        stepped: Advanced,
        times: tuple[float, float],
        fresh: Mapping[str, Probing],
        failed: Mapping[str, str],
        travel: float,
    ) -> Driven:
        """Return the changes by one step of the models, target by target.

        Parameters
        ----------
        times : tuple of float
            Time of the reading, as given and on the continuous clock of the state [s].
        travel : float
            Time that counts for the movement of the corrections [s].
        """
        done = Driven.begin(state, fresh)
        for target, line in self.lines.items():
            if not all(map(math.isfinite, stepped.said[line.models])):
                order, averaged = state.orders.get(target), Status("restarting", "its zero is being averaged")
                done.states[target] = order if order is not None and order.word == NO_ZERO else averaged
                continue
            if target not in done.references:
                done.references[target] = Reference(times[0], "mean over the first readings after the start")
            zero, probing = done.references[target].shift, fresh.get(target)
            known, most = done.learned.get(target), self.limits.magnitude
            answer = evaluate(line, self.models, stepped, times[1], known, probing, failed, zero, most)
            done.raw[target], done.deviations[target] = answer.raw, answer.deviation
            if failed and (why := explain_unjudged(self.models[line.models], failed)):
                done.held[target] = why  # no band either: the error without these sensors was never judged
                continue
            if not math.isnan(answer.half_width):
                done.half_widths[target] = answer.half_width
            if answer.learned is not None:
                done.learned[target] = answer.learned
            if probing is not None:
                done.refused[target], done.moved[target] = answer.refused, answer.moved
            correction, status = drive(
                state, target, line, answer.deviation, travel, self.limits, self.thresholds.caught_up
            )
            done.corrections[target], done.states[target] = correction, status
            done.arrived &= status.word != "restarting"
        return done

    def wait(self, state: CompensatorState, tick: float, why: str) -> tuple[CompensatorState, Compensated]:
        """Let time pass without a usable reading: corrections are held for `Limits.hold`, then fade.

        Parameters
        ----------
        tick : float
            Present time of the monotonic clock of the process [s].
        """
        left = rest(state, state.corrections, tick, self.lines, self.limits, dict.fromkeys(self.lines, why))
        new = state._replace(corrections=left.corrections, clock=left.clock, idle=left.idle)
        failed = Lookout.failed(self._lookouts, state.watches)
        return new, Compensated(
            corrections=left.corrections,
            rejected=why,
            outside=(),
            failed=failed,
            states=left.states,
            deviations={},
            half_widths={},
            refused={},
        )

    def _believe(
        self, state: CompensatorState, reading: Reading, time: float, tick: float
    ) -> tuple[CompensatorState, Reading, str]:
        """Return the reading with substitutes for temperatures that are not trusted, and why the source has stopped."""
        travel, age = travel_time(state, tick, self.limits), self.limits.reading_age
        feed, why = self.feed.heed(state.feed, reading.values, reading.counter, travel, age)
        state = state._replace(feed=feed)
        if why:
            return state, reading, why
        values, states = reading.values, list[WatchState]()
        for lookout, before in zip(self._lookouts, state.watches, strict=True):
            late = time + self.limits.reading_age
            if state.time is None and (late < before.time or late < before.averaged.last):
                # the clock was set back before a reading was used: no other clock is known yet
                before = begin(lookout.watch)  # noqa: PLW2901
            seen, values = lookout.believe(before, time, values)
            states.append(seen)
        if values is not reading.values:
            reading = Reading(reading.time, values, reading.positions)
        feed, why = self.feed.compare_predictions(feed, states)
        return state._replace(watches=tuple(states), feed=feed), reading, why


def _is_negative(value: object) -> bool:
    """Return whether a value is a number below zero; what a source sends may be anything."""
    return isinstance(value, Real) and value < 0
