"""Drift along a program: frozen models in free run, driven by its spindle speed (P-05, P-06).

Program time advances in steps as short as a move; the models are stepped at longer intervals: at least every
`Drift.step` seconds, when the spindle speed changes, and again soon after, because part of a deviation may follow the
speed immediately. While the inputs are constant, the results of the families of `thermocomp.core` do not depend on the
division of time into steps.
"""

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Point, triple
from thermocomp.nc.thermal.inputs import FloatArray, Inputs, Wiring, interpolate
from thermocomp.nc.thermal.jobstate import JobState
from thermocomp.nc.thermal.start import ThermalStart, hand_over_state
from thermocomp.nc.thermal.stations import AXES, Station, check_stations

#: a speed of shorter duration is averaged; the immediate response to a speed is updated after this time [s]
SOON = 0.5
#: maximum number of steps into which a pause with a forecast is divided
MOST_STEPS = 5000


class Outside(NamedTuple):
    """Input that was beyond the range in which a model was trained, including the margin of its support."""

    name: str
    unit: str
    low: float  #: trained range [unit]
    high: float
    farthest: float  #: value farthest outside [unit]
    seconds: float  #: time outside [s]


class Drift:
    """Drift of the tool point at any moment and position of a program.

    Parameters
    ----------
    stations : sequence of Station
        One per axis, or several along one axis: between them the deviation is linear, beyond them it is that of the
        outermost one (P-04).
    start : ThermalStart
        From `thermocomp.nc.thermal.start`.
    others : mapping of str to Signal, optional
        Inputs that do not follow from the program.
    zero : {'start', 'cold', 'last'}
        Zero of the drift. ``start``: work offsets and tools were set at the start of the program; ``cold``: on the cold
        machine, the deviation is the output of the models; ``last``: as in the previous job.
    step : float
        Maximum time between steps of the models [s].

    Attributes
    ----------
    time : float
        Time since the start of the program, up to the last step of the models [s].
    assumed : tuple of str
        Assumptions made at the start if one measurement applies to several stations.
    beyond : dict of str to float
        Largest distance of a requested position beyond the outermost station, per axis [mm].

    Raises
    ------
    InputError
        The stations are inconsistent, a model requires an input that is not given, or there is no last job.
    """

    def __init__(
        self,
        stations: Sequence[Station],
        start: ThermalStart,
        others: Inputs | None = None,
        *,
        zero: Literal["start", "cold", "last"] = "start",
        step: float = 5.0,
    ) -> None:
        if not 0 < step < math.inf:
            raise InputError(f"drift: step {step} s must be positive and finite")
        if zero == "last" and start.zeros is None:
            raise InputError(
                "drift: the zero of the last job requires the state carried over from that job; found none"
            )
        if check_stations(stations) != list(stations) or len(start.states) != len(stations):
            raise InputError("drift: stations must be ordered by axis and position, as returned by 'stations'")
        self.stations = tuple(stations)
        self.step = step
        self.assumed = start.assumed
        self.beyond: dict[str, float] = {}
        self._others = dict(others or {})
        self._wiring = [Wiring(s.model, self._others) for s in stations]
        self._varies = any(w.varies for w in self._wiring)
        self._states = list(start.states)
        self._outside: dict[tuple[int, int], tuple[float, float]] = {}
        self._doubts = list(start.doubts or (0.0,) * len(stations))
        self._doubtful = {k for k, doubt in enumerate(self._doubts) if doubt}
        self._pending = self._speed = self._counted = self._turns = 0.0
        self._due = step
        self._zeros = [0.0] * len(stations)
        self._ladders = _ladders(self.stations)
        self.time = -start.pause
        self._publish()
        if start.pause:
            self.advance(start.pause, 0.0)
            self._flush()
            self.time = 0.0
        # a model error at the time of the zero affects all later times
        if zero == "start":
            self._zeros, self._zero_known = [float(s.deviation) for s in self._states], start.known
        elif zero == "last" and start.zeros is not None:
            self._zeros, self._zero_known = list(start.zeros), start.zero_known
        else:
            self._zero_known = True
        self._publish()

    # -- time --------------------------------------------------------------------------------------------------------

    def advance(self, dt: float, speed: float) -> None:
        """Advance the time with the spindle at a speed.

        Parameters
        ----------
        dt : float
            Time step [s].
        speed : float
            Spindle speed [1/min]; the direction of rotation does not matter.
        """
        speed = abs(speed)
        if not (0.0 <= dt < math.inf and speed < math.inf):
            raise InputError(
                f"drift: {dt} s at {speed} 1/min: expected finite numbers, and a time that is not negative"
            )
        if speed != self._speed:
            self._change(speed)
        self._pending += dt
        if self._pending >= self._due:
            self._flush()

    def _change(self, speed: float) -> None:
        if self._pending >= SOON:
            self._flush()
        else:
            self._turns += (self._pending - self._counted) * self._speed
            self._counted = self._pending
        self._speed = speed
        self._due = min(SOON, self.step)

    def _flush(self) -> None:
        """Advance the models by the time since their last step."""
        total, speed = self._pending, self._speed
        if self._counted:
            speed = (self._turns + (total - self._counted) * speed) / total
        steps = min(math.ceil(total / self.step), MOST_STEPS) if self._varies else 1
        begin = self.time
        for k in range(1, steps + 1):
            self._take(begin + total * k / steps, total / steps, speed)
        self._pending = self._counted = self._turns = 0.0
        self._due = self.step
        self._publish()

    def _take(self, time: float, dt: float, speed: float) -> None:
        self.time = time
        for k, (station, wiring) in enumerate(zip(self.stations, self._wiring, strict=True)):
            values = wiring.values(time, speed)
            self._states[k], deviation = station.model.step(self._states[k], values, dt)
            out = self._states[k].outside
            if out.any():
                self._note(k, values, dt)
            said = abs(float(deviation) - self._zeros[k])
            if not station.model.remembers:
                self._doubts[k] = said if out.any() else 0.0
            elif k in self._doubtful or out.any():
                # a memory that was driven by clipped inputs remains doubtful
                self._doubtful.add(k)
                self._doubts[k] = max(self._doubts[k], said)

    def _note(self, k: int, values: FloatArray, dt: float) -> None:
        state, model = self._states[k], self.stations[k].model
        for i in np.flatnonzero(state.outside).tolist():
            low, high = _trained(model.inputs[i].low, model.inputs[i].high, float(state.reference[i]))
            farthest, seconds = self._outside.get((k, i), (0.5 * (low + high), 0.0))
            value = float(values[i])
            if _excess(value, low, high) > _excess(farthest, low, high):
                farthest = value
            self._outside[k, i] = farthest, seconds + dt

    # -- deviation ---------------------------------------------------------------------------------------------------

    def deviation(self, point: Point) -> Point:
        """Return the present deviation of the tool point, actual minus commanded, at a position.

        Parameters
        ----------
        point : tuple of float
            Machine coordinates [mm].

        Returns
        -------
        tuple of float
            X, Y, Z, relative to the given zero; 0 for an axis without a model [um].
        """
        if not self._ladders:
            return self._everywhere
        found = list(self._everywhere)
        for ladder in self._ladders:
            position = point[ladder.along]
            found[ladder.axis] = interpolate(ladder.positions, ladder.values, position)
            past = max(ladder.positions[0] - position, position - ladder.positions[-1])
            if past > self.beyond.get(AXES[ladder.axis], 0.0):
                self.beyond[AXES[ladder.axis]] = past
        return triple(found)

    def field(self) -> Callable[[Point], Point]:
        """Return the present `deviation` as a function of position that is independent of time."""
        everywhere = self._everywhere
        if not self._ladders:
            return lambda _: everywhere
        frozen = copy.copy(self)
        frozen._ladders = tuple(copy.copy(ladder) for ladder in self._ladders)
        frozen.beyond = {}  # separate: positions may be outside the program
        return frozen.deviation

    @property
    def values(self) -> tuple[float, ...]:
        """Present deviation, per station, relative to the given zero [um]."""
        return tuple(float(s.deviation) - z for s, z in zip(self._states, self._zeros, strict=True))

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes whose drift has a model."""
        return tuple(a for a in AXES if any(s.axis == a for s in self.stations))

    @property
    def driven(self) -> tuple[str, ...]:
        """Axes whose models have an effect: an input influences them, or they are not 0 at rest."""
        return tuple(
            a for a in AXES if any(s.axis == a and (s.model.sensors or s.model.intercept) for s in self.stations)
        )

    @property
    def by_position(self) -> bool:
        """Whether the deviation depends on the position."""
        return bool(self._ladders)

    def _publish(self) -> None:
        """Update the values that `deviation` returns until the next step."""
        values = self.values
        places = [0.0, 0.0, 0.0]
        for station, value in zip(self.stations, values, strict=True):
            places[AXES.index(station.axis)] = value
        self._everywhere: Point = triple(places)
        for ladder in self._ladders:
            ladder.values = values[ladder.stations]

    # -- uncertainty -------------------------------------------------------------------------------------------------

    @property
    def outside(self) -> tuple[Outside, ...]:
        """Inputs that have left the trained range of a model so far, each with the model of the largest excess."""
        found: dict[str, Outside] = {}
        for (k, i), (farthest, seconds) in self._outside.items():
            state, channel = self._states[k], self.stations[k].model.inputs[i]
            low, high = _trained(channel.low, channel.high, float(state.reference[i]))
            mine = Outside(name=channel.name, unit=channel.unit, low=low, high=high, farthest=farthest, seconds=seconds)
            other = found.get(channel.name)
            if other is None or _excess(farthest, low, high) > _excess(other.farthest, other.low, other.high):
                found[channel.name] = mine
        return tuple(found.values())

    @property
    def held(self) -> dict[str, float]:
        """Forecasts that do not cover the program so far, with the time held beyond their points [s]."""
        used = {i.name for s in self.stations for i in s.model.inputs}
        return {n: h for n, s in self._others.items() if n in used and (h := s.held(self.time)) > 0}

    def uncertainty(self) -> tuple[float, float, float]:
        """Return the error bounds of the models.

        Per axis, the largest value of its stations: the largest error on unseen cycles, doubled if the zero itself is a
        prediction, plus, after an input has left the trained range, the whole output of the model.

        Returns
        -------
        tuple of float
            X, Y, Z; nan where a model was never judged, 0 for an axis without a model [um].
        """
        worst = [0.0, 0.0, 0.0]
        for station, doubt in zip(self.stations, self._doubts, strict=True):
            k, honest = AXES.index(station.axis), station.model.honest_error
            error = math.nan if honest is None else honest.max_abs * (1 if self._zero_known else 2) + doubt
            if not error <= worst[k]:  # nan stays nan
                worst[k] = error if not math.isnan(worst[k]) else math.nan
        return triple(worst)

    # -- next job ----------------------------------------------------------------------------------------------------

    def state(self) -> JobState:
        """Return the state from which the next job can start, after stepping the models to the present time."""
        if self._pending:
            self._flush()
        stations = map(hand_over_state, self.stations, self._states, self._zeros, self._doubts)
        return JobState(tuple(stations), self._zero_known)


@dataclass(slots=True)
class _Ladder:
    """Models of the drift of one axis at several positions along an axis."""

    axis: int
    along: int
    positions: tuple[float, ...]
    stations: slice
    values: tuple[float, ...] = ()


def _ladders(stations: Sequence[Station]) -> tuple[_Ladder, ...]:
    found, first = [], 0
    for axis, group in groupby(stations, key=lambda s: s.axis):
        mine = list(group)
        if mine[0].along is not None:
            places = slice(first, first + len(mine))
            found.append(_Ladder(AXES.index(axis), AXES.index(mine[0].along), tuple(s.at for s in mine), places))
        first += len(mine)
    return tuple(found)


def _trained(low: float, high: float, reference: float) -> tuple[float, float]:
    return reference + low, reference + high


def _excess(value: float, low: float, high: float) -> float:
    return max(low - value, value - high)
