"""Which sensors and probes the virtual machining centre carries; plausible values of their data sheets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.simulation.machine import Air, Truth
from thermocomp.simulation.sensors import Sensor

FloatArray = NDArray[np.float64]

#: place of a temperature sensor -> where it is, in words. Shaft and screws turn: nobody measures them.
PLACES: dict[str, str] = {
    "front_seat": "spindle housing round the front bearing",
    "rear_seat": "spindle housing round the rear bearing",
    "motor": "spindle motor, stator",
    "housing": "spindle housing, flange",
    "headstock_front": "headstock, front wall",
    "headstock_rear": "headstock, at the column's guide",
    "column_front_right": "column, upper front right",
    "column_front_left": "column, upper front left",
    "column_rear_right": "column, upper rear right",
    "column_rear_left": "column, upper rear left",
    "bed_front": "bed under the table",
    "bed_rear": "bed under the column",
    "table": "table",
    "x_nut": "nut of the X screw",
    "x_bearing": "bearing of the X screw",
    "y_nut": "nut of the Y screw",
    "y_bearing": "bearing of the Y screw",
    "z_nut": "nut of the Z screw",
    "z_bearing": "bearing of the Z screw",
    "coolant": "coolant of the spindle, in the tank",
    "enclosure": "work space",
    "air": "environment, at the height of the machine's middle",
    "air_top": "environment, above the machine",
    "air_floor": "environment, at the floor",
}
_AIR_HEIGHT = {"air": Air.REFERENCE_HEIGHT, "air_top": 2.6, "air_floor": 0.2}

#: Chen 1996, Table 1 (C-11): dT1..dT4, dT6..dT9; dT5 is the mean of the last four
CHEN_PLACES = (
    "air",
    "housing",
    "y_nut",
    "y_bearing",
    "column_front_right",
    "column_front_left",
    "column_rear_right",
    "column_rear_left",
)
#: Hwang (H-08): T1..T14
HWANG_PLACES = (
    "x_bearing",
    "x_nut",
    "y_bearing",
    "y_nut",
    "z_bearing",
    "z_nut",
    "front_seat",
    "rear_seat",
    "column_front_right",
    "column_front_left",
    "column_rear_right",
    "column_rear_left",
    "bed_front",
    "bed_rear",
)
#: a usual outfit: what a user would mount on a machine
USUAL_PLACES = (
    "front_seat",
    "motor",
    "housing",
    "column_front_right",
    "column_front_left",
    "column_rear_right",
    "column_rear_left",
    "bed_front",
    "bed_rear",
    "table",
    "x_bearing",
    "y_bearing",
    "z_bearing",
    "coolant",
    "enclosure",
    "air",
)

#: distance of the two probes of X, and of Y, along the test bar [m]
PROBE_DISTANCE = 0.1


@dataclass(frozen=True)
class Probe:
    """A displacement probe in the nest of ISO 230-3.

    Parameters
    ----------
    place : str
        In words.
    reads : callable
        From what is true to its value [um].
    cold : float
        Its value in the state in which the test begins [um].
    """

    place: str
    reads: Callable[[Truth], float]
    cold: float = 0.0


#: positions at which the pre-compensation study models Z (P-04) [mm]
Z_POSITIONS = (0, 200, 400, 600)
#: positions of a laser measurement of Y [mm]
Y_POSITIONS = tuple(range(0, 551, 50))
#: cold positioning error of Y in mm, for y in mm: Chen 1996, Eq. 6 (C-22), constant first
CHEN_COLD_PROFILE = (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)


def cold_profile(position: float) -> float:
    """Return the geometric positioning error of Y [um] at a position [mm]."""
    return 1e3 * sum(c * position**k for k, c in enumerate(CHEN_COLD_PROFILE))


def _at_position(position: int) -> Probe:
    return Probe(f"Z at the tip of the test bar with the Z axis at {position} mm", lambda t: t.z.at(position))


def _laser(position: int) -> Probe:
    # A laser measures each profile from its first position: the shift of the origin is not in it.
    return Probe(
        f"positioning of Y at {position} mm, laser", lambda t: t.y.at(position) - t.y.offset, cold_profile(position)
    )


#: X1 and Y1 at the tip of the test bar, X2 and Y2 towards the spindle: tilts A = (y1 - y2) / L, B = (x2 - x1) / L
_NEST = {
    "x1": Probe("X at the tip of the test bar", lambda t: t.x.offset),
    "x2": Probe("X towards the spindle", lambda t: t.x.offset + PROBE_DISTANCE * t.tilt_b),
    "y1": Probe("Y at the tip of the test bar", lambda t: t.y.offset),
    "y2": Probe("Y towards the spindle", lambda t: t.y.offset - PROBE_DISTANCE * t.tilt_a),
    "z": Probe("Z at the tip of the test bar; negative: the tool nears the workpiece", lambda t: t.z.offset),
}
NEST = tuple(_NEST)
PROBES: dict[str, Probe] = (
    _NEST | {f"z_at_{p}": _at_position(p) for p in Z_POSITIONS} | {f"y_laser_{p}": _laser(p) for p in Y_POSITIONS}
)


@dataclass(frozen=True)
class Mounting:
    """How the temperature sensor at a place is fixed: the same in every test, whatever its seed.

    Parameters
    ----------
    lag : float
        [s]
    bias : float
        [degC]
    contact : float
        Weight of the part's temperature in what it feels; the rest is the air round it.
    """

    lag: float
    bias: float
    contact: float


def mounting(place: str) -> Mounting:
    """Return how the sensor at a place is mounted."""
    rng = np.random.default_rng([*place.encode()])
    lag, bias, contact = rng.uniform((20.0, -0.15, 0.88), (60.0, 0.15, 0.97))
    return Mounting(float(lag), float(bias), 1.0 if place == "coolant" else float(contact))


def temperature(place: str, *, perfect: bool, noise: float | None) -> Sensor:
    """Return the temperature sensor at a place.

    Parameters
    ----------
    place : str
        Key of `PLACES`.
    perfect : bool
        Without lag, bias and steps.
    noise : float or None
        Standard deviation [degC]; None: the sensor's own.
    """
    channel = Channel(f"t_{place}_C", "temperature", "degC", PLACES[place])
    if perfect:
        return Sensor(channel, noise=noise or 0.0)
    mounted = mounting(place)
    return Sensor(channel, 0.05 if noise is None else noise, mounted.lag, resolution=0.02, bias=mounted.bias)


def displacement(probe: str, *, perfect: bool) -> Sensor:
    """Return a displacement probe."""
    channel = Channel(f"{probe}_um", "displacement", "um", PROBES[probe].place)
    return Sensor(channel) if perfect else Sensor(channel, noise=0.15, resolution=0.01)


def felt(
    place: str, machine_places: Sequence[str], temperatures: FloatArray, air: Sequence[Air], *, perfect: bool
) -> FloatArray:
    """Return the temperature round a sensor [degC], of shape (n_ticks,).

    Parameters
    ----------
    place : str
        Key of `PLACES`.
    machine_places : sequence of str
        `VirtualMachine.places`
    temperatures : ndarray of shape (n_ticks, n_places)
        Of the machine [degC].
    air : sequence of Air
        One per tick.
    perfect : bool
        The sensor feels nothing of the air.
    """
    if place in _AIR_HEIGHT:
        return np.array([a.at(_AIR_HEIGHT[place]) for a in air])
    part = temperatures[:, list(machine_places).index(place)]
    contact = 1.0 if perfect else mounting(place).contact
    return contact * part + (1.0 - contact) * np.array([a.temperature for a in air])
