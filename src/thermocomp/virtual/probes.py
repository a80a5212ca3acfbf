"""Readings of probes and lasers on the virtual machining centre, as weights of its observables."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import SettingError
from thermocomp.virtual.axes import AXES, STATIONS, TEST_POSITION, TRAVEL, weigh_stations
from thermocomp.virtual.geometry import SQUARENESS, cold_profile, find_cold_component

FloatArray = NDArray[np.float64]

#: distance between the two X probes, and between the two Y probes, along the test bar [m]
PROBE_DISTANCE = 0.1


@dataclass(frozen=True)
class VirtualProbe:
    """A displacement probe, a laser line, or a touch probe on an artefact.

    Parameters
    ----------
    place : str
        Location as text.
    reads : mapping of str to float
        Weights of the machine's observables: um per um, or um per (urad m).
    cold : float
        Value in the initial state of the test, in its unit.
    noise : float
        Standard deviation, in its unit.
    zeroed : bool
        Whether the value is relative to the start of the test, where it is `cold`; False: relative to 20 degC.
    """

    place: str
    reads: Mapping[str, float]
    cold: float = 0.0
    unit: str = "um"
    noise: float = 0.15
    zeroed: bool = True


def positioning(axis: str, position: float) -> dict[str, float]:
    """Return the weights of the observables for the positioning error of an axis [um], linear between stations.

    Parameters
    ----------
    position : float
        [mm]
    """
    return _between(axis, axis, position)


def _between(along: str, axis: str, position: float) -> dict[str, float]:
    """Return the weights for the contribution of an axis at a position to the deviation along an axis."""
    if not 0.0 <= position <= TRAVEL[axis]:
        raise SettingError(f"{axis.upper()} = {position:g} mm is beyond the travel from 0 to {TRAVEL[axis]:g} mm")
    stations = STATIONS[axis]
    below = max(k for k in range(len(stations) - 1) if stations[k] <= position)
    low, high = stations[below : below + 2]
    share = (position - low) / (high - low)
    return {f"{along}{axis}@{p}": w for p, w in ((low, 1.0 - share), (high, share)) if w}


def station_name(axis: str, station: int) -> str:
    """Return the name of the observable for the positioning error of an axis at a station."""
    return f"{axis}{axis}@{station}"


def _summed(*parts: tuple[float, Mapping[str, float]]) -> dict[str, float]:
    """Return the sum of several sets of weights, each multiplied by a factor."""
    total: dict[str, float] = {}
    for factor, weights in parts:
        for name, w in weights.items():
            total[name] = total.get(name, 0.0) + factor * w
    return {name: w for name, w in total.items() if w}


def laser(axis: str, position: float) -> VirtualProbe:
    """Return a laser that measures the positioning of an axis at a position [mm]."""
    # The reflector is at the tool point. A laser measures each profile relative to its first position: the shift of the
    # origin is not included.
    reads = _summed((1.0, positioning(axis, position)), (-1.0, positioning(axis, 0.0)))
    geometry = float(cold_profile(position)) if axis == "y" else 0.0
    return VirtualProbe(f"positioning of {axis.upper()} at {position:g} mm, laser", reads, geometry)


def weigh_tool_point(axis: str, point: Mapping[str, float]) -> dict[str, float]:
    """Return the weights for the tool-point deviation along an axis, for any axis positions.

    Cross-axis deviations of Z and X are not included, as the machine model has no such observables.

    Parameters
    ----------
    axis : {'x', 'y', 'z'}
        Direction of the deviation.
    point : mapping of str to float
        Positions of the axes [mm]; an axis not named is at `TEST_POSITION`.
    """
    parts = [(1.0, {axis: 1.0})]
    for moved, lead in ((axis, axis), ("y", "z")) if axis == "z" else ((axis, axis),):
        if moved in point:
            parts += [(1.0, _between(lead, moved, point[moved])), (-1.0, _between(lead, moved, TEST_POSITION[moved]))]
    return _summed(*parts)


def at_position(axis: str, position: float) -> VirtualProbe:
    """Return a displacement probe at the tip of the test bar, with the axis at a position [mm]."""
    where = f"{axis.upper()} at the tip of the test bar with the {axis.upper()} axis at {position:g} mm"
    return VirtualProbe(where, weigh_tool_point(axis, {axis: position}))


#: motion of an axis along or about a direction; the ISO 230-1 code is completed by the axis
MOTIONS = {
    "EX": "motion along X",
    "EY": "motion along Y",
    "EZ": "motion along Z",
    "EA": "turn about X",
    "EB": "turn about Y",
    "EC": "turn about Z",
}
#: the 18 components of the linear axes, in the order of ISO 230-1
COMPONENTS = tuple(f"{motion}{axis.upper()}" for axis in AXES for motion in MOTIONS)
#: noise of the six-degree-of-freedom laser [um, urad]
SIX_NOISE = {"um": 0.3, "urad": 0.5}
#: components without thermal change: the bed is symmetric, and X at the test position has no B and C rotation
STILL = frozenset(f"{code}Z@{p}" for code in ("EX", "EB", "EC") for p in STATIONS["z"]) | {"EBX@300", "ECX@300"}


def station(code: str, position: int) -> tuple[str, ...]:
    """Return the name of the observable of a component at a station [mm]; none if the component does not change."""
    name = f"{code}@{position}"
    return () if name in STILL else (name,)


#: axes between each axis and the workpiece: the structure is ``w X' b Z Y (C1) t``
NEARER = {"x": "", "z": "x", "y": "xz"}


def component(code: str, position: float, z: float = TEST_POSITION["z"]) -> VirtualProbe:
    """Return a component of an axis as measured by a six-degree-of-freedom laser between table and spindle.

    It is set to zero at the test position in each run. The tool point is the tip of the test bar, and the other axes
    are at `TEST_POSITION`. Rotations of axes nearer to the workpiece tilt the path of the moving axis; the laser
    measures this effect, too.

    Parameters
    ----------
    position : float
        Position of its axis [mm].
    z : float
        Position of Z, if different [mm]; the bed yields under the column. Possible for X only; the effect of its
        rotations by the lever is then included in the reading.
    """
    axis, unit = code[2].lower(), "um" if code[1] in "XYZ" else "urad"
    for a, p in ((axis, position), ("z", z)):
        if not 0.0 <= p <= TRAVEL[a]:
            raise SettingError(f"{a.upper()} = {p:g} mm is beyond the travel from 0 to {TRAVEL[a]:g} mm")
    if axis != "x" and z != TEST_POSITION["z"]:
        raise SettingError(f"{code} cannot be measured with Z at {z:g} mm: only the errors of X can")
    test, point = (np.array([TEST_POSITION[a] for a in AXES], dtype=np.float64) for _ in range(2))
    point[AXES.index(axis)], point[2] = position, position if axis == "z" else z
    weights, geometry = _between_two(code, position), float(find_cold_component(code, point))
    if unit == "um":
        for turn, arm in swing(code[1], point - test):
            # of the stationary axes nearer to the workpiece; of X itself if Z is elsewhere
            for nearer in NEARER[axis]:
                weights = _summed((1.0, weights), (arm, _at_station(f"E{turn}{nearer.upper()}", TEST_POSITION[nearer])))
        if axis == "x":
            for turn, arm in swing(code[1], np.array([0.0, 0.0, z - TEST_POSITION["z"]])):
                weights = _summed((1.0, weights), (arm, _between_two(f"E{turn}X", position)))
                geometry += arm * float(find_cold_component(f"E{turn}X", point))
    aside = "" if z == TEST_POSITION["z"] else f", Z at {z:g} mm"
    words = f"{code}: {MOTIONS[code[:2]]} of {axis.upper()} at {position:g} mm{aside}"
    return VirtualProbe(place=words, reads=weights, cold=geometry, unit=unit, noise=SIX_NOISE[unit], zeroed=False)


def _between_two(code: str, position: float) -> dict[str, float]:
    """Return the weights for a component at a position relative to the test position."""
    axis = code[2].lower()
    weights = weigh_stations(axis, [position])[0] - weigh_stations(axis, [TEST_POSITION[axis]])[0]
    found = zip(STATIONS[axis], weights.tolist(), strict=True)
    return {name: w for p, w in found if w for name in station(code, p)}


def _at_station(code: str, position: int) -> dict[str, float]:
    """Return the weight of the observable of a component at a station."""
    return dict.fromkeys(station(code, position), 1.0)


def swing(along: str, way: FloatArray) -> list[tuple[str, float]]:
    """Return the rotations that move the end of a lever along an axis, with their effect: rotation x lever.

    Parameters
    ----------
    way : ndarray of shape (3,)
        Lever [mm].

    Returns
    -------
    list of (str, float)
        A, B or C, and um per urad; rotations without effect are omitted.
    """
    x, y, z = (1e-3 * way).tolist()
    arms = {"X": (("B", z), ("C", -y)), "Y": (("C", x), ("A", -z)), "Z": (("A", y), ("B", -x))}
    return [(turn, arm) for turn, arm in arms[along] if arm]


def make_squareness_probe(code: str) -> VirtualProbe:
    """Return a probe of the squareness of two axes at 20 degC; straightness readings contain the thermal changes."""
    return VirtualProbe(
        place=f"{code}: squareness at 20 degC, artefact",
        reads={},
        cold=SQUARENESS[code],
        unit="urad",
        noise=SIX_NOISE["urad"],
    )


#: X1 and Y1 at the tip of the test bar, X2 and Y2 towards the spindle: tilts A = (y1 - y2) / L, B = (x2 - x1) / L
NEST = {
    "x1": VirtualProbe("X at the tip of the test bar", {"x": 1.0}),
    "x2": VirtualProbe("X towards the spindle", {"x": 1.0, "b": PROBE_DISTANCE}),
    "y1": VirtualProbe("Y at the tip of the test bar", {"y": 1.0}),
    "y2": VirtualProbe("Y towards the spindle", {"y": 1.0, "a": -PROBE_DISTANCE}),
    "z": VirtualProbe("Z at the tip of the test bar; negative: the tool approaches the workpiece", {"z": 1.0}),
}
#: measured relative to the spindle housing: in a calculation, or on the spindle itself
SPINDLE = {
    "nose": VirtualProbe("axial growth of the spindle nose from the housing's flange", {"nose": 1.0}),
    "tip": VirtualProbe("axial growth of the tool's tip from the housing's flange", {"tip": 1.0}),
}
