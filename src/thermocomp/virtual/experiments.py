"""Tests run on the virtual machines (X-01): from a protocol and a seed to instrument readings."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, explain_unknown
from thermocomp.core.machine import Channel
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.instruments import Instrument
from thermocomp.virtual.kits import Kit
from thermocomp.virtual.machine import Truth, VirtualMachine
from thermocomp.virtual.nonlinear import NonlinearCentre, NonlinearTool
from thermocomp.virtual.protocol import FEED, SPEED, Experiment, Physics, Programme, make_seed
from thermocomp.virtual.sensors import SensorFault, apply_lags, read, with_faults
from thermocomp.virtual.toolsystem import RestingTool

FloatArray = NDArray[np.float64]
S = TypeVar("S")

#: longest interval between two outputs of the machine model [s]
LONGEST_TICK = 20.0
#: number of time steps computed at once, which limits the memory
BLOCK = 4096
#: quantities recorded relative to the first row
MOVEMENTS = ("displacement", "angle")
#: machine models by machine and physics, as named in protocols
MACHINES: dict[tuple[str, Physics], Callable[[], VirtualMachine[Any]]] = {
    ("centre", "linear"): MachiningCentre,
    ("tool", "linear"): RestingTool,
    ("centre", "nonlinear"): NonlinearCentre,
    ("tool", "nonlinear"): NonlinearTool,
}


@dataclass(frozen=True, eq=False)
class SimulatedTest:
    """A recorded test as plain arrays.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s], from 0
    channels : tuple of Channel
        Temperatures [degC]; displacements [um]; spindle speed [1/min], if there is a spindle; feed [mm/min], if axes
        move.
    values : ndarray of shape (n_rows, n_channels)
        Readings of sensors and probes; displacements are zero at the start except for the noise of the probes.
    truth : ndarray of shape (n_rows, n_displacements)
        Displacements without noise and faults, in the order of their channels [um].
    observables : ndarray of shape (n_rows, n_observables) or None
        All outputs of the machine model relative to 20 degC, if requested: see `thermocomp.virtual.volume`.
    """

    name: str
    time: FloatArray
    channels: tuple[Channel, ...]
    values: FloatArray
    truth: FloatArray
    observables: FloatArray | None = None

    @property
    def displacements(self) -> tuple[Channel, ...]:
        """Channels of `truth`: displacements and angles."""
        return tuple(c for c in self.channels if c.quantity in MOVEMENTS)


def simulate(
    experiment: Experiment,
    *,
    seed: int = 0,
    sensor_noise: float | None = None,
    faults: Sequence[SensorFault] = (),
    whole: bool = False,
) -> Iterator[SimulatedTest]:
    """Run the tests of an experiment in sequence.

    Parameters
    ----------
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC] (C-33: 0.4). Default: as defined for each sensor. The truth
        does not depend on it.
    """
    if seed < 0:
        raise InputError(f"seed {seed}: must not be negative")
    if sensor_noise is not None and not (sensor_noise >= 0 and np.isfinite(sensor_noise)):
        raise InputError(f"sensor noise {sensor_noise} degC: must be finite and not negative")
    machine = MACHINES[experiment.machine, experiment.physics]()

    def test(programme: Programme) -> SimulatedTest:
        weather, noise = (np.random.default_rng(make_seed(seed, programme.name, what)) for what in ("weather", "noise"))
        options: dict[str, Any] = {"sensor_noise": sensor_noise, "faults": faults, "whole": whole}
        mounted = machine
        if isinstance(machine, RestingTool):
            mounted = machine.mounted(programme.mounting or experiment.kit.mountings[0], programme.foundation)
        return run(mounted, experiment.kit, programme, weather, noise, **options)

    return map(test, experiment.programmes(seed))


def run(
    machine: VirtualMachine[S],
    kit: Kit,
    programme: Programme,
    weather: np.random.Generator,
    noise: np.random.Generator,
    *,
    sensor_noise: float | None = None,
    faults: Sequence[SensorFault] = (),
    whole: bool = False,
) -> SimulatedTest:
    """Run one test on a machine.

    Parameters
    ----------
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC]. Default: as defined for each sensor.
    """
    instruments = programme.instruments(kit, sensor_noise)
    sensors = [i.sensor for i in instruments]
    weights = _weights(machine, instruments)
    moves = np.array([s.channel.quantity in MOVEMENTS for s in sensors])
    lags = np.array([s.lag for s in sensors])
    channels, driven = _driven(programme, kit)
    time: FloatArray = programme.sampling * np.arange(len(driven), dtype=np.float64)
    every = math.ceil(programme.sampling / LONGEST_TICK)
    tick = programme.sampling / every
    drives = [s.drive for s in programme.segments for _ in range(round(s.duration / tick))]

    state, sky, true, at_start = _soaked(machine, programme, weights, weather)
    shift = np.array([i.cold for i in instruments]) - np.where([i.zeroed for i in instruments], true, 0.0)
    recorded = np.empty((len(time), len(sensors) + len(channels)))
    recorded[:, len(sensors) :] = driven
    truth = np.empty((len(time), int(moves.sum())))
    # At the start of the test the sensors have settled to the true values.
    felt = true
    recorded[0, : len(sensors)] = read(sensors, (felt + shift)[None], time[:1], noise)
    truth[0] = (true + shift)[moves]
    told = np.tile(at_start, (len(time), 1)) if whole else None
    block = max(BLOCK // every, 1) * every
    for first in range(0, len(drives), block):
        part = drives[first : first + block]
        sky, air = programme.climate.air(sky, first * tick, tick, len(part), weather)
        state, done = machine.run(state, part, air, tick)
        values = _values(done, air, weights)
        followed = apply_lags(lags, felt, true, values, tick)
        felt, true = followed[-1], values[-1]
        rows = slice(1 + first // every, 1 + (first + len(part)) // every)
        recorded[rows, : len(sensors)] = read(sensors, followed[every - 1 :: every] + shift, time[rows], noise)
        truth[rows] = (values[every - 1 :: every] + shift)[:, moves]
        if told is not None:
            told[rows] = done.observables[every - 1 :: every]

    if programme.touch:
        idle = ~programme.touch.rows(time, driven[:, 0] == 0.0)
        recorded[np.ix_(idle, np.flatnonzero([i.touches for i in instruments]))] = np.nan
    channels = [*(s.channel for s in sensors), *channels]
    if programme.faults or faults:
        recorded = with_faults(time, channels, recorded, [*programme.faults, *faults])
    return SimulatedTest(
        name=programme.name, time=time, channels=tuple(channels), values=recorded, truth=truth, observables=told
    )


def _soaked(
    machine: VirtualMachine[S], programme: Programme, weights: FloatArray, weather: np.random.Generator
) -> tuple[S, FloatArray, FloatArray, FloatArray]:
    """Return the initial states of machine and weather, the true instrument values, and the machine observables."""
    climate = programme.climate
    state, sky = machine.init(climate.middle), climate.init(weather)
    begin = -sum(s.duration for s in programme.soak)
    values, told = np.empty((1, weights.shape[1])), np.empty(0)
    for segment in programme.soak:
        n_ticks = math.ceil(segment.duration / LONGEST_TICK)
        tick = segment.duration / n_ticks
        for first in range(0, n_ticks, BLOCK):
            n = min(BLOCK, n_ticks - first)
            sky, air = climate.air(sky, begin + first * tick, tick, n, weather)
            state, truth = machine.run(state, [segment.drive] * n, air, tick)
            values, told = _values(truth, air, weights), truth.observables[-1].copy()
        begin += segment.duration
    return state, sky, values[-1], told


def _weights(machine: VirtualMachine[S], instruments: Sequence[Instrument]) -> FloatArray:
    """Return the weights of temperatures, observables and air per instrument, of shape (n_values, n_instruments)."""
    names = {n: k for k, n in enumerate([*machine.places, *machine.observables])}
    weights = np.zeros((len(names) + 3, len(instruments)))
    for k, instrument in enumerate(instruments):
        for name, weight in instrument.reads.items():
            if name not in names:
                raise explain_unknown("value", name, names)
            weights[names[name], k] = weight
        weights[-3:, k] = instrument.air
    return weights


def _values(truth: Truth, air: FloatArray, weights: FloatArray) -> FloatArray:
    values: FloatArray = np.hstack([truth.temperatures, truth.observables, air]) @ weights
    return values


def _driven(programme: Programme, kit: Kit) -> tuple[list[Channel], FloatArray]:
    """Return the recorded channels of the drive and their values; each row has the command that led to it."""
    segments = programme.segments
    lengths = [1, *(round(s.duration / programme.sampling) for s in segments)]
    channels, columns = [], []
    if kit.top_speed:
        channels.append(SPEED)
        columns.append([0.0, *(s.drive.speed for s in segments)])
    if any(any(s.drive.feed) for s in segments):
        channels.append(FEED)
        columns.append([0.0, *(math.hypot(*s.drive.feed) for s in segments)])
    return channels, np.repeat(np.array(columns).reshape(len(columns), len(lengths)).T, lengths, axis=0)
