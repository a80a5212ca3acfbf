"""Instruments applied to the true values, with plausible data-sheet values.

Each instrument reads a weighted sum of the outputs of the machine model (temperatures of places, displacements) and of
the air; all instruments together form one matrix.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import SettingError
from thermocomp.core.machine import Channel
from thermocomp.virtual.axes import AXES, TRAVEL
from thermocomp.virtual.kits import Kit, check_labels
from thermocomp.virtual.machine import Air
from thermocomp.virtual.probes import VirtualProbe, weigh_tool_point
from thermocomp.virtual.sensors import Sensor

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Mounting:
    """Mounting of the temperature sensor at a place: the same in every test, whatever its seed.

    Parameters
    ----------
    lag : float
        [s]
    bias : float
        [degC]
    contact : float
        Weight of the part's temperature in the sensor value; the rest is the surrounding air.
    drift : float
        Zero drift [degC per day].
    """

    lag: float
    bias: float
    contact: float
    drift: float


def mounting(place: str) -> Mounting:
    """Return the mounting of the sensor at a place."""
    rng = np.random.default_rng([*place.encode()])
    low, high = (20.0, -0.15, 0.88, -0.03), (60.0, 0.15, 0.97, 0.03)
    lag, bias, contact, drift = (float(v) for v in rng.uniform(low, high))
    return Mounting(lag, bias, 1.0 if place == "coolant" else contact, drift)


@dataclass(frozen=True)
class Instrument:
    """A sensor and the weights of the quantities that it reads.

    Parameters
    ----------
    reads : mapping of str to float
        Weights by the names of places and observables of the machine.
    air : tuple of float
        Weights of `Air.values`.
    cold : float
        Value in the reference state [um].
    zeroed : bool
        Whether the reference is the state at the start of the test; False: machine and air values of zero.
    touches : bool
        Whether it gives readings in probing cycles only.
    """

    sensor: Sensor
    reads: Mapping[str, float] = field(default_factory=dict)
    air: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cold: float = 0.0
    zeroed: bool = False
    touches: bool = False


def thermometer(kit: Kit, label: str, place: str, *, perfect: bool, noise: float | None) -> Instrument:
    """Return the temperature sensor at a place.

    Parameters
    ----------
    noise : float or None
        Standard deviation [degC]; None: as defined for the sensor.
    """
    channel = Channel(f"t_{label}_C", "temperature", "degC", kit.place(place, perfect=perfect))
    mounted = mounting(place)
    if perfect:
        sensor = Sensor(channel, noise=noise or 0.0)
    else:
        own = 0.05 if noise is None else noise
        sensor = Sensor(
            channel=channel, noise=own, lag=mounted.lag, resolution=0.02, bias=mounted.bias, drift=mounted.drift
        )
    if place in kit.air:
        return Instrument(sensor, air=(1.0, kit.air[place] - Air.REFERENCE_HEIGHT, 0.0))
    contact = 1.0 if perfect else mounted.contact
    return Instrument(sensor, {place: contact}, air=(1.0 - contact, 0.0, 0.0))


def displacement(label: str, probe: VirtualProbe, *, perfect: bool) -> Instrument:
    """Return a displacement probe or a laser line; its channel is ``LABEL_um``, for an angle ``LABEL_urad``."""
    quantity = "angle" if probe.unit == "urad" else "displacement"
    channel = Channel(f"{label}_{probe.unit}", quantity, probe.unit, probe.place)
    drift = float(np.random.default_rng([*label.encode()]).uniform(-0.15, 0.15))
    sensor = Sensor(channel) if perfect else Sensor(channel, noise=probe.noise, resolution=0.01, drift=drift)
    return Instrument(sensor, probe.reads, cold=probe.cold, zeroed=probe.zeroed)


@dataclass(frozen=True)
class Touch:
    """A probing cycle: a touch probe in the spindle repeatedly measures points of an artefact on the table.

    Each point gives three channels, ``x_LABEL_um``, ``y_LABEL_um`` and ``z_LABEL_um``: the deviation of the tool point
    since the start, actual minus commanded; a spindle that grows towards the artefact gives a negative z. Between two
    cycles the channels have no value. A cycle that is due while the spindle rotates waits until the spindle has
    stopped.

    Parameters
    ----------
    every : float
        [s]
    points : mapping of str to tuple of float
        Positions X, Y, Z of the axes at each point [mm].
    noise : float
        Repeatability of the probe, one standard deviation [um]; data sheets specify 1 um for two standard deviations.
    resolution : float
        Resolution of the controller [um].
    """

    every: float
    points: Mapping[str, tuple[float, float, float]]
    noise: float = 0.5
    resolution: float = 0.1

    def __post_init__(self) -> None:
        if not self.every > 0:
            raise SettingError(f"expected a positive interval, found {self.every:g} s", ("every",))
        for name in ("noise", "resolution"):
            if not (value := getattr(self, name)) >= 0:
                raise SettingError(f"expected at least 0 um, found {value:g} um", (name,))
        if not self.points:
            raise SettingError("write at least one point, such as points = {p1 = [300, 250, 250]}", ("points",))
        check_labels(self.points)
        for label, point in self.points.items():
            for k, axis in enumerate(AXES):
                if not 0.0 <= point[k] <= TRAVEL[axis]:
                    raise SettingError(f"is beyond the travel from 0 to {TRAVEL[axis]:g} mm", ("points", label, k))

    def instruments(self, *, perfect: bool) -> list[Instrument]:
        """Return one instrument per axis and probed point."""
        return [
            Instrument(
                Sensor(
                    Channel(f"{axis}_{label}_um", "displacement", "um", f"{axis.upper()} of the artefact's {label}"),
                    noise=0.0 if perfect else self.noise,
                    resolution=0.0 if perfect else self.resolution,
                ),
                weigh_tool_point(axis, dict(zip(AXES, point, strict=True))),
                zeroed=True,
                touches=True,
            )
            for label, point in self.points.items()
            for k, axis in enumerate(AXES)
        ]

    def rows(self, time: FloatArray, still: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the rows at which a cycle is performed.

        Parameters
        ----------
        time : ndarray of shape (n_rows,)
            [s]
        still : ndarray of shape (n_rows,)
            Whether the spindle is stopped.
        """
        run = np.zeros(len(time), dtype=np.bool_)
        due = 0.0
        for k in np.flatnonzero(still):
            if time[k] >= due:
                run[k] = True
                due = (time[k] // self.every + 1.0) * self.every
        return run
