"""The tests of the papers, and others, run on the virtual machine tool (X-01)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.simulation.centre import MachiningCentre
from thermocomp.simulation.instruments import PROBES, displacement, felt, temperature
from thermocomp.simulation.machine import Air, Drive, Truth, VirtualMachine
from thermocomp.simulation.programmes import EXPERIMENTS, Programme, Segment
from thermocomp.simulation.sensors import Fault, Sensor, measure, with_faults

FloatArray = NDArray[np.float64]
S = TypeVar("S")

__all__ = ["EXPERIMENTS", "SimulatedTest", "run", "simulate"]

#: the machine is asked at least this often [s]
LONGEST_TICK = 20.0


@dataclass(frozen=True, eq=False)
class SimulatedTest:
    """A recorded test, in plain arrays.

    Parameters
    ----------
    name : str
    time : ndarray of shape (n_rows,)
        [s], from 0
    channels : tuple of Channel
        Temperatures [degC], displacements [um], spindle speed [1/min], feed [mm/min] where the axes move.
    values : ndarray of shape (n_rows, n_channels)
        What sensors and probes said; displacements are zero at the start but for the probes' noise.
    truth : ndarray of shape (n_rows, n_displacements)
        The displacements without noise and faults, in the order of their channels [um].
    """

    name: str
    time: FloatArray
    channels: tuple[Channel, ...]
    values: FloatArray
    truth: FloatArray

    @property
    def displacements(self) -> tuple[Channel, ...]:
        """Channels that `truth` belongs to."""
        return tuple(c for c in self.channels if c.quantity == "displacement")


def simulate(
    experiment: str, *, seed: int = 0, sensor_noise: float | None = None, faults: Sequence[Fault] = ()
) -> list[SimulatedTest]:
    """Run an experiment on the virtual machining centre.

    Parameters
    ----------
    experiment : str
        A key of `EXPERIMENTS`.
    seed : int
        Of weather, noise, and what is drawn by lot; the machine and its sensors stay the same ones.
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC] (C-33: 0.4); the sensors' own if not given. The truth does
        not depend on it.
    faults : sequence of Fault
        Befall every test.

    Returns
    -------
    list of SimulatedTest

    Raises
    ------
    InputError
        The experiment or a fault's channel is unknown, or seed or noise are negative.
    """
    if experiment not in EXPERIMENTS:
        near = get_close_matches(experiment, EXPERIMENTS, n=3, cutoff=0.4) or list(EXPERIMENTS)
        raise InputError(f"unknown experiment {experiment!r}; the nearest are {', '.join(near)}")
    if seed < 0:
        raise InputError(f"seed {seed}: must not be negative")
    if sensor_noise is not None and not (sensor_noise >= 0 and np.isfinite(sensor_noise)):
        raise InputError(f"sensor noise {sensor_noise} degC: must be finite and not negative")
    machine = MachiningCentre()
    tests = []
    for number, programme in enumerate(EXPERIMENTS[experiment].programmes(np.random.default_rng([seed, 0])), start=1):
        weather, noise = (np.random.default_rng([seed, number, stream]) for stream in (1, 2))
        tests.append(run(machine, programme, weather, noise, sensor_noise=sensor_noise, faults=faults))
    return tests


def run(
    machine: VirtualMachine[S],
    programme: Programme,
    weather: np.random.Generator,
    noise: np.random.Generator,
    *,
    sensor_noise: float | None = None,
    faults: Sequence[Fault] = (),
) -> SimulatedTest:
    """Run one test on a machine.

    Parameters
    ----------
    machine : VirtualMachine
    programme : Programme
        What is done and what is recorded.
    weather, noise : numpy.random.Generator
        Of the air round the machine, and of sensors and probes.
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC]; the sensors' own if not given.
    faults : sequence of Fault

    Returns
    -------
    SimulatedTest

    Raises
    ------
    InputError
        A segment does not last a whole number of samplings.
    """
    every = math.ceil(programme.sampling / LONGEST_TICK)
    tick = programme.sampling / every
    drives = _drives(programme, tick)
    lead = round(programme.soak / tick)
    airs = programme.climate.air(tick * np.arange(-lead, len(drives) + 1, dtype=np.float64), weather)
    state = machine.init(programme.climate.middle)
    for air in airs[: lead + 1]:
        state, truth = machine.step(state, Drive(air, cooled=programme.cooled), tick)
    truths = [truth]
    for air, segment in zip(airs[lead + 1 :], drives, strict=True):
        state, truth = machine.step(state, Drive(air, segment.speed, segment.feed, programme.cooled), tick)
        truths.append(truth)

    true, sensors = _true_values(machine, programme, truths, airs[lead:], sensor_noise)
    values = measure(sensors, true, tick, every, noise)
    time: FloatArray = programme.sampling * np.arange(len(values), dtype=np.float64)
    # A row tells the speed that led to it.
    in_force = [Segment(0.0), *drives][::every]
    channels = [s.channel for s in sensors]
    columns = [values, np.array([[s.speed] for s in in_force])]
    channels.append(Channel("spindle_rpm", "spindle_speed", "1/min", "spindle"))
    if any(s.feed != (0.0, 0.0, 0.0) for s in drives):
        columns.append(np.array([[math.hypot(*s.feed)] for s in in_force]))
        channels.append(Channel("feed_mm_min", "feed", "mm/min", "of the axes, along the path"))
    recorded = with_faults(time, channels, np.hstack(columns), faults)
    return SimulatedTest(programme.name, time, tuple(channels), recorded, true[::every, len(programme.places) :])


def _drives(programme: Programme, tick: float) -> list[Segment]:
    """Return the segment in force during each tick."""
    drives = []
    for segment in programme.segments:
        rows = segment.duration / programme.sampling
        if abs(rows - round(rows)) > 1e-9 or rows < 1:
            raise InputError(
                f"{programme.name}: a segment of {segment.duration} s is no multiple of the {programme.sampling} s "
                "between two rows"
            )
        drives += [segment] * round(segment.duration / tick)
    return drives


def _true_values(
    machine: VirtualMachine[S],
    programme: Programme,
    truths: Sequence[Truth],
    airs: Sequence[Air],
    sensor_noise: float | None,
) -> tuple[FloatArray, list[Sensor]]:
    """Return what is true at each sensor at each tick, and the sensors."""
    perfect = programme.perfect
    sensors = [temperature(p, perfect=perfect, noise=sensor_noise) for p in programme.places]
    sensors += [displacement(p, perfect=perfect) for p in programme.probes]
    true = np.empty((len(truths), len(sensors)))
    temperatures = np.array([t.temperatures for t in truths])
    for k, place in enumerate(programme.places):
        true[:, k] = felt(place, machine.places, temperatures, airs, perfect=perfect)
    for k, probe in enumerate(programme.probes, start=len(programme.places)):
        reads = [PROBES[probe].reads(t) for t in truths]
        true[:, k] = np.array(reads) - reads[0] + PROBES[probe].cold
    return true, sensors
