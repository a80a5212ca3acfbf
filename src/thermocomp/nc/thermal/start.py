"""Thermal state of the machine at the start of the program: cold, left by the last job, or measured (E-P5)."""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np

from thermocomp.core.autoregressive import Ticking
from thermocomp.core.exceptions import InputError, explain_unknown
from thermocomp.core.model import ErrorModel
from thermocomp.core.state import State
from thermocomp.core.units import read_with_unit as with_unit
from thermocomp.files.modelfile import drop_unused
from thermocomp.nc.thermal.inputs import SPEED, Inputs, Wiring
from thermocomp.nc.thermal.jobstate import JobState, StationState
from thermocomp.nc.thermal.stations import Station

#: number of speeds tried to explain a measured deviation
_TRIED = 129
#: tolerance for a deviation to be explained [um]
_CLOSE = 1e-9
#: settling time of an autoregressive model [s]
_LONG = 2 * 86400.0


class ThermalStart(NamedTuple):
    """State of the models at the start of the program, or at the start of a pause before it."""

    states: tuple[State, ...]  #: per station
    known: bool  #: the state is not a prediction: the machine is cold or measured
    pause: float = 0.0  #: time the spindle is stopped before the program [s]
    zeros: tuple[float, ...] | None = None  #: deviation that counted as zero in the last job, per station [um]
    zero_known: bool = False  #: the zero of the last job was not a prediction
    doubts: tuple[float, ...] | None = None  #: increase of the bound in the last job, per station [um]
    assumed: tuple[str, ...] = ()  #: assumptions if one measurement applies to several stations


def begin_cold(stations: Sequence[Station], others: Inputs) -> ThermalStart:
    """Return the state of a machine at rest: the spindle has been stopped for a long time."""
    return ThermalStart(tuple(_resting(s.model, Wiring(s.model, others), 0.0) for s in stations), known=True)


def carry_over(stations: Sequence[Station], left: JobState, pause: float = 0.0) -> ThermalStart:
    """Return the state at the end of the last job, and a pause with the spindle stopped.

    Parameters
    ----------
    pause : float
        Time from the end of the last job to the start of this one [s].
    """
    if not 0 <= pause < math.inf:
        raise InputError(f"pause since the last job: {pause} s must be finite and not negative")
    by_name = {s.station: s for s in left.stations}
    if set(by_name) != {str(s) for s in stations}:
        raise InputError(
            f"the last job saved the state of {', '.join(by_name)}, but this job has models of "
            f"{', '.join(map(str, stations))}: use the models of the last job, or start cold or measured"
        )
    mine = [by_name[str(s)] for s in stations]
    return ThermalStart(
        tuple(_restored(station.model, state) for station, state in zip(stations, mine, strict=True)),
        known=False,
        pause=pause,
        zeros=tuple(s.zero for s in mine),
        zero_known=left.zero_known,
        doubts=tuple(s.doubt for s in mine),
    )


def begin_measured(stations: Sequence[Station], deviations: Mapping[str, float], others: Inputs) -> ThermalStart:
    """Return a state in which the outputs of the models equal the measurement, with the spindle stopped.

    An autoregressive model gets the measurement as its past. For other models with memory, the machine is assumed to
    have settled at a constant spindle speed: the lowest one in the trained range at which the deviation equals the
    measured one as soon as the spindle stops. One measurement determines all stations of an axis: each gets the state
    for the one speed at which the mean over them, or the deviation of the one measured station, equals the measurement.

    Parameters
    ----------
    deviations : mapping of str to float
        Measured deviation by axis, or by target (one or all stations of an axis), relative to the cold machine [um].
    """
    by_axis = {a: [s for s in stations if s.axis == a] for a in dict.fromkeys(s.axis for s in stations)}
    known = [n for a, mine in by_axis.items() for n in (a, *(_names(s)[0] for s in mine if len(mine) > 1))]
    told = {str(s): next((n for n in _names(s) if n in deviations), "") for s in stations}
    for name in deviations:
        if name not in by_axis and name not in told.values():
            raise explain_unknown("measured axis or target", name, known)
    states, assumed = dict[str, State](), []
    for axis, mine in by_axis.items():
        named = [s for s in mine if told[str(s)]]
        if axis in deviations:
            if named:
                raise InputError(f"measured start: {axis} and {told[str(named[0])]} are both given; remove one")
            parts = [(mine, mine, deviations[axis])]
        elif len(named) == 1:
            parts = [(mine, named, deviations[told[str(named[0])]])]
        else:
            parts = [([s], [s], deviations[name]) for s in mine if (name := told[str(s)])]
        if len(named) not in (1, len(mine)) and axis not in deviations:
            missing = next(s for s in mine if not told[str(s)])
            what, name = (missing, _names(missing)[0]) if named else (axis, axis)
            raise InputError(f"measured start: the deviation of {what} is missing; also give {name}=VALUEum")
        for group, seen, deviation in parts:
            found, speed = _explaining(group, seen, others, deviation)
            states |= {str(s): state for s, state in zip(group, found, strict=True)}
            if len(group) > 1:
                what = f"the mean of its {len(mine)} models" if seen is group else told[str(seen[0])]
                assumed.append(
                    f"{axis} was measured once: all its models start from the state after a long run at {speed:.0f} "
                    f"1/min, where {what} is {deviation:g} um"
                )
    return ThermalStart(tuple(states[str(s)] for s in stations), known=True, assumed=tuple(assumed))


def deviations(texts: Sequence[str]) -> dict[str, float]:
    """Parse the deviations measured by the user.

    Returns
    -------
    dict of str to float
        Deviation by axis (upper case) or target [um].
    """
    found: dict[str, float] = {}
    for text in texts:
        name, _, value = (part.strip() for part in text.partition("="))
        name = name.upper() if len(name) == 1 else name
        number = with_unit(value, "displacement")
        if not name or number is None:
            raise InputError(
                f"measured {text!r}: expected an axis or target, and a value with its unit, such as Z=12um"
            )
        if name in found:
            raise InputError(f"measured {text!r}: {name} was given before; remove one")
        found[name] = number
    return found


def hand_over_state(station: Station, state: State, zero: float, doubt: float) -> StationState:
    """Return the state of a station from which the next job can start.

    Parameters
    ----------
    zero, doubt : float
        See `StationState` [um].
    """
    memory = np.empty(0) if state.memory is None else state.memory
    return StationState(
        station=str(station),
        target=station.model.target,
        model=identity(station.model),
        reference=tuple(state.reference.tolist()),
        memory=tuple(memory.tolist()),
        deviation=float(state.deviation),
        zero=zero,
        doubt=doubt,
    )


def identity(model: ErrorModel) -> str:
    """Return a hash of the parameters of a model, independent of its origin and assessment."""
    others = ("family", "provenance", "honest_error", "thresholds")
    numbers = {k: v for k, v in drop_unused(asdict(model)).items() if k not in others}
    if numbers["watch"]:
        del numbers["watch"]["thresholds"]
    return hashlib.sha256(json.dumps([model.family, numbers], sort_keys=True).encode()).hexdigest()


def _names(station: Station) -> list[str]:
    """Return the names accepted for a measured deviation of a station, the preferred one first, besides its axis."""
    target = station.model.target
    return [n for n in (target.removesuffix("_um"), target) if n != station.axis]


def _resting(model: ErrorModel, wiring: Wiring, speed: float) -> State:
    """Return the model state of a machine settled at a constant spindle speed."""
    return model.step(model.init(), wiring.values(0.0, speed), 0.0)[0]


def _restored(model: ErrorModel, saved: StationState) -> State:
    if saved.model != identity(model):
        raise InputError(
            f"the model of {saved.target} is not the one of the last job: it was fitted again or altered since; "
            "start cold or measured, or use the model of that job"
        )
    inputs = np.array(saved.reference)
    shape = inputs.shape
    if shape == (len(model.inputs),):
        begun = model.step(model.init(inputs), inputs, 0.0)[0]
        assert begun.memory is not None
        shape = begun.memory.shape
        if len(saved.memory) == shape[0]:
            return begun._replace(memory=np.array(saved.memory), deviation=np.array(saved.deviation))
    raise InputError(f"the state of {saved.station} saved by the last job is incomplete; start cold or measured")


def _explaining(
    stations: Sequence[Station], seen: Sequence[Station], others: Inputs, deviation: float
) -> tuple[list[State], float]:
    """Return states of the stations of an axis with the spindle stopped, and the preceding speed [1/min].

    In these states, the mean over the measured stations is the measured deviation [um].
    """
    what = seen[0].model.target if len(seen) == 1 else f"{seen[0].axis} (the mean of {len(seen)} models)"
    if not math.isfinite(deviation):
        raise InputError(f"measured deviation of {what}: {deviation} um must be finite; remove NaN and infinity")
    for model in (s.model for s in stations):
        if not model.remembers:
            raise InputError(
                f"model of {model.target} has no memory: its prediction depends on the present inputs alone, so it "
                "cannot start from a measured deviation; start cold"
            )
    wirings = {str(s): Wiring(s.model, others) for s in stations}
    if len(stations) == 1 and isinstance(stations[0].model, Ticking):
        return [_begun(stations[0].model, wirings[str(stations[0])], deviation)], math.nan
    for model in (s.model for s in stations):
        if not any(i.quantity == SPEED for i in model.inputs):
            raise InputError(
                f"model of {model.target} is not driven by the spindle speed: no speed explains a measured deviation; "
                "start cold or carry the state of the last job over"
            )

    def stopped(station: Station, speed: float) -> State:
        return _stopped(station.model, wirings[str(station)], speed)

    def too_much(speed: float) -> float:
        return sum(float(stopped(s, speed).deviation) for s in seen) / len(seen) - deviation

    speeds = [i for s in stations for i in s.model.inputs if i.quantity == SPEED]
    low = max(*(i.reference + i.low for i in speeds), 0.0)
    high = min(i.reference + i.high for i in speeds)
    tried = np.linspace(low, max(low, high), _TRIED).tolist()
    excess = [too_much(n) for n in tried]
    for k, found in enumerate(excess):
        exact = abs(found) <= _CLOSE
        if exact or (k and (found > 0) != (excess[k - 1] > 0)):
            speed = tried[k] if exact else _bisected(too_much, tried[k - 1], tried[k])
            return [stopped(s, speed) for s in stations], speed
    reach = [e + deviation for e in excess]
    raise InputError(
        f"measured deviation of {what}: {deviation:g} um; no speed from {low:g} to {high:g} 1/min causes it: "
        f"the model predicts from {min(reach):.3g} to {max(reach):.3g} um; check sign and zero of the measurement"
    )


def _stopped(model: ErrorModel, wiring: Wiring, speed: float) -> State:
    """Return the state of a machine settled at a constant speed, as soon as the spindle stops."""
    if isinstance(model, Ticking):
        reference, inputs = model.init().reference, wiring.values(0.0, speed)
        begun = model.begin_at(0.0, inputs, np.where(np.isnan(reference), inputs, reference))
        _, settled = model.step(begun, inputs, _LONG)
        return _begun(model, wiring, float(settled))
    return model.step(_resting(model, wiring, speed), wiring.values(0.0, 0.0), 0.0)[0]


def _begun(model: Ticking, wiring: Wiring, deviation: float) -> State:
    """Return the state of an autoregressive model with a given past."""
    still, reference = wiring.values(0.0, 0.0), model.init().reference
    return model.begin_at(deviation, still, np.where(np.isnan(reference), still, reference))


def _bisected(too_much: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function with a sign change between both ends, to floating-point precision."""
    rising = too_much(low) <= 0
    while low < (middle := 0.5 * (low + high)) < high:
        if (too_much(middle) <= 0) == rising:
            low = middle
        else:
            high = middle
    return min(low, high, key=lambda n: abs(too_much(n)))
