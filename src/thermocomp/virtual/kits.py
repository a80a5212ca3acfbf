"""Equipment of the virtual machines: temperature places, probes, lasers, loads."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from thermocomp.core.exceptions import SettingError, explain_unknown
from thermocomp.virtual.axes import AXES, STATIONS
from thermocomp.virtual.geometry import SQUARENESS
from thermocomp.virtual.heat import HeatSources
from thermocomp.virtual.machine import Air
from thermocomp.virtual.probes import (
    COMPONENTS,
    NEST,
    SPINDLE,
    VirtualProbe,
    at_position,
    component,
    laser,
    make_squareness_probe,
    station,
    station_name,
)

T = TypeVar("T")

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
#: a usual set of sensors, as a user would mount it on a machine
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


@dataclass(frozen=True)
class Kit:
    """Equipment of one of the virtual machines, and its loads.

    Parameters
    ----------
    places : mapping of str to str
        Description of the location, by place of a temperature sensor.
    air : mapping of str to float
        Height above the floor of the `places` in the air [m].
    observables : tuple of str
        Quantities from which probes can be made.
    outfits, nests : mapping of str to tuple of str
        Names that denote several places or several probes.
    loads : mapping of str to str
        Places where additional heat can be applied.
    inner : mapping of str to str
        Rotating places, whose temperatures can only be calculated.
    top_speed : float
        Maximum spindle speed [1/min]; 0: no spindle.
    mountings : tuple of str
        Chucks in which the tool can be mounted, the usual one first; empty: no choice, and no foundation of its own.
    """

    places: Mapping[str, str]
    air: Mapping[str, float]
    probes: Mapping[str, VirtualProbe]
    observables: tuple[str, ...]
    outfits: Mapping[str, tuple[str, ...]]
    nests: Mapping[str, tuple[str, ...]]
    loads: Mapping[str, str]
    inner: Mapping[str, str] = field(default_factory=dict)
    top_speed: float = 0.0
    mountings: tuple[str, ...] = ()

    def place(self, name: str, *, perfect: bool) -> str:
        """Return the description of a place where a temperature sensor can be mounted."""
        if name in self.inner and not perfect:
            raise SettingError(
                f"{name!r} is on a rotating part: its temperature can only be calculated, with perfect = true"
            )
        known = {**self.places, **self.inner} if perfect else self.places
        if name not in known:
            raise explain_unknown("place", name, [*known, *self.outfits])
        return known[name]

    def probe(self, name: str | Mapping[str, float]) -> VirtualProbe:
        """Return a probe by its name, such as ``z``, ``y_laser_250``, ``z_at_400`` or ``EXX_0``, or by its weights."""
        if not isinstance(name, str):
            for observable in name:
                if observable not in self.observables:
                    raise explain_unknown("observable", observable, self.observables)
            return VirtualProbe(" + ".join(f"{w:g} {n}" for n, w in name.items()), name)
        if name in self.probes:
            return self.probes[name]
        six = re.fullmatch(r"(E[XYZABC][XYZ])(?:_z(\d+))?_(\d+)", name) if self.top_speed else None
        if six:
            code, z, at = six.groups()
            return component(code, float(at), *([float(z)] if z else []))
        found = re.fullmatch(r"([xyz])_(laser|at)_(\d+)", name) if self.top_speed else None
        if not found:
            raise explain_unknown("probe", name, [*self.probes, *self.nests])
        axis, kind, position = found.groups()
        return (laser if kind == "laser" else at_position)(axis, float(position))


def labelled(names: Sequence[str] | Mapping[str, T], sets: Mapping[str, tuple[str, ...]]) -> dict[str, str | T]:
    """Return the names of mounted instruments by the label used in their channel names."""
    if not isinstance(names, Mapping):
        return {n: n for given in names for n in sets.get(given, (given,))}
    check_labels(names)
    return dict(names)


def check_labels(labels: Iterable[str]) -> None:
    """Raise `SettingError` if a label cannot be part of a channel name."""
    for label in labels:
        if not re.fullmatch(r"[A-Za-z0-9_]+", label):
            raise SettingError(f"{label!r} cannot name a channel: use letters, digits and underscores")


_COLUMN = {
    "column_front_right": "column, upper front right",
    "column_front_left": "column, upper front left",
    "column_rear_right": "column, upper rear right",
    "column_rear_left": "column, upper rear left",
}
#: usual places of the machining centre; shaft and screws rotate and are not measured
PLACES: dict[str, str] = {
    "front_seat": "spindle housing round the front bearing",
    "rear_seat": "spindle housing round the rear bearing",
    "motor": "spindle motor, stator",
    "housing": "spindle housing, flange",
    "headstock_front": "headstock, front wall",
    "headstock_rear": "headstock, at the column's guide",
    **_COLUMN,
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


def _profile(code: str) -> tuple[str, ...]:
    """Return the names of the probes that measure a component at all stations of its axis."""
    return tuple(f"{code}_{p}" for p in STATIONS[code[2].lower()])


CENTRE = Kit(
    places=PLACES | {f"{p}_low": words.replace("upper", "lower") for p, words in _COLUMN.items()},
    air={"air": Air.REFERENCE_HEIGHT, "air_top": 2.6, "air_floor": 0.2},
    probes=NEST | SPINDLE | {code: make_squareness_probe(code) for code in SQUARENESS},
    observables=(
        *("x", "y", "z", "a", "b", "nose", "tip", "slide"),
        *(station_name(a, p) for a in AXES for p in STATIONS[a]),
        *(f"{what}@{p}" for what in ("zy", "ay") for p in STATIONS["y"]),
        *(name for code in COMPONENTS for p in STATIONS[code[2].lower()] for name in station(code, p)),
    ),
    outfits={"all": tuple(PLACES), "usual": USUAL_PLACES, "chen": CHEN_PLACES, "hwang": HWANG_PLACES},
    nests={
        "nest": tuple(NEST),
        **{f"{a}_laser": tuple(f"{a}_laser_{p}" for p in STATIONS[a]) for a in AXES},
        **{code: _profile(code) for code in COMPONENTS},
        **{f"EYX_z{z}": tuple(f"EYX_z{z}_{p}" for p in STATIONS["x"]) for z in STATIONS["z"]},
        **{f"{a.upper()}_six": tuple(n for c in COMPONENTS if c[2] == a.upper() for n in _profile(c)) for a in AXES},
        "squareness": tuple(SQUARENESS),
    },
    loads={
        "tool_tip": "cutting edge: share of the cutting power that enters the tool",
        "coolant": "coolant tank; negative: heat removed",
        "cabinet": "electric cabinet, on the column's rear",
        "hydraulics": "hydraulic unit, at the bed's rear",
        **{f"{a}_bearing": f"motor and bearing of the {a.upper()} screw" for a in AXES},
    },
    inner={
        "tool": "tool, or test bar",
        "shaft": "spindle shaft",
        "front_bearing": "front bearing, rings",
        "rear_bearing": "rear bearing, rings",
        **{f"{a}_screw": f"screw of {a.upper()}, mean over its travel" for a in AXES},
    },
    top_speed=HeatSources().top_speed,
)

#: Wessel's resting tool (W-08), from the tool down to the bearing fit; T9 is the room
_TOOL_PLACES = {
    "t1": "tool shank",
    "t2": "chuck, front",
    "t3": "chuck, middle",
    "t4": "flange of the chuck",
    "t5": "shaft, nose",
    "t6": "shaft, between nose and bearing fit",
    "t7": "shaft, foot",
    "t8": "shaft, bearing fit",
    "t9": "room",
}
_AXIAL = {
    "s1": VirtualProbe("axial, tip of the tool", {"s1": 1.0}),
    "s2": VirtualProbe("axial, front of the chuck", {"s2": 1.0}),
    "s3": VirtualProbe("axial, flange of the chuck", {"s3": 1.0}),
}

TOOL = Kit(
    places=_TOOL_PLACES,
    air={"t9": Air.REFERENCE_HEIGHT},
    probes=_AXIAL,
    observables=tuple(_AXIAL),
    outfits={"all": tuple(_TOOL_PLACES)},
    nests={"nest": tuple(_AXIAL)},
    loads={
        "heater": "heating elements at the bearing's fit of the shaft",
        "hot_air": "hot-air gun at the cutting edges",
        "tip": "soldering iron at the tip",
    },
    mountings=("hydraulic", "shrink", "collet"),
)

#: equipment by machine name in protocols
KITS: dict[str, Kit] = {"centre": CENTRE, "tool": TOOL}
