"""The machines of finite elements: their parts, what joins them, and what they do to the tool point."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finite_elements.assembly import Assembly, Film, FullModel, Link, lump
from finite_elements.bed import Bed
from finite_elements.column import Column
from finite_elements.materials import data, material
from finite_elements.part import Part
from finite_elements.reduction import basis, project
from finite_elements.revolution import with_joints
from finite_elements.screw import Screw
from finite_elements.spindle import spindle
from finite_elements.toolholder import toolholder
from thermocomp.virtual.axes import N_HATS, STATIONS, TEST_POSITION
from thermocomp.virtual.statespace import ReducedModel

FloatArray = NDArray[np.float64]

#: shares: of the rotating spindle's convection, of the coolant's flow, of the turning screws' convection
THETAS = ("rotation", "flow", "feed_x", "feed_y", "feed_z")


#: joints of the spindle and of the tool whose sides the models with joints know
JOINTS = {"centre": ("balls", "seat", "taper"), "tool": ("taper", "grip")}
#: surfaces and lumps of the machining centre whose loss the model with joints corrects, and the work space it goes to
EXPOSED = ("spindle.rotating", "spindle.front", "column.outside", "bed.outside")
EXPOSED_LUMPS = ("headstock_front", "headstock_rear", "table", "x_bearing", "y_bearing", "z_bearing", "enclosure")


def centre(table: dict[str, Any] | None = None, *, joints: bool = False) -> FullModel:
    """Return the full model of the machining centre.

    Returns
    -------
    FullModel
        Its observables in machine coordinates, tool minus workpiece [um, urad] at `TEST_POSITION`: ``x y z a b``
        (``a b``: tilt of the spindle about X and Y against the table); ``nose tip`` (growth of the spindle out of its
        flange); ``xx@P yy@P zz@P`` (what an axis at P mm contributes to the tool point along itself: its drive, for Y
        with the pitch of its guide); ``zy@P`` (what Y at P mm contributes to z); ``ay@P`` (pitch of the headstock with
        Y at P mm); ``slide`` (how far the column's foot grows against the bed); then the components of the axes,
        ``EXX@P`` ..., see `_components`.
    """
    table = data("centre.toml") if table is None else table
    lengths = table["lengths"]
    screws = {axis: Screw(**dimensions(values)) for axis, values in table["screw"].items()}
    column = Column(**dimensions(table["column"]))
    foot = table["bed"]["bearing"] - screws["z"].distance(TEST_POSITION["z"])
    tool = foot - column.depth / 2.0 - lengths["headstock"] - lengths["tip"]
    bed = Bed(**dimensions(table["bed"]), table=tool - lengths["table"], foot=foot, shoe=column.shoe)
    lumps = table["lump"]
    parts = Assembly(
        [
            _with_means(spindle(with_joints(data("spindle.toml")))),
            _with_means(column.part("column", material(table["column"]["material"]), STATIONS["y"])),
            _with_means(
                bed.part(
                    "bed",
                    material(table["bed"]["material"]),
                    {p: table["bed"]["bearing"] - screws["z"].distance(p) for p in STATIONS["z"]},
                )
            ),
            *(
                screw.part(f"{axis}_screw", material(table["screw"][axis]["material"]), STATIONS[axis])
                for axis, screw in screws.items()
            ),
            *(lump(name, **{k: v for k, v in values.items() if k != "air"}) for name, values in lumps.items()),
        ]
    )
    hats = {f"{axis}_screw_{k}": f"{axis}_screw.hat_{k}" for axis in screws for k in range(N_HATS)}
    more = {}
    if joints:
        more = {f"{joint}_{side}": f"spindle.{joint}_{side}" for joint in JOINTS["centre"] for side in "ab"}
        more |= {name.replace(".", "_"): name.replace(".", ".on_") for name in EXPOSED}
        more |= {name: name for name in EXPOSED_LUMPS}
    return parts.join(
        [Film(**f) for f in table["film"]] + [Film(f"{name}.air", values["air"]) for name, values in lumps.items()],
        [Link(a, b, value) for a, others in table["link"].items() for b, value in others.items()],
        table["input"] | hats | more,
        table["place"] | more,
        _observables(parts, table, column, foot - tool) | _components(parts, table, column, bed),
        THETAS,
    )


def tool(table: dict[str, Any] | None = None, *, joints: bool = False) -> FullModel:
    """Return the full model of the resting tool (see `finite_elements.toolholder`)."""
    table = data("tool.toml") if table is None else table
    part = _with_means(toolholder(with_joints(table))) if joints else toolholder(table)
    load = np.sum([part.surfaces[name].load for name in ("tool", "chuck", "shaft")], axis=0)
    part = replace(part, patches={**part.patches, "surface": load / load.sum()})
    more = [f"{joint}_{side}" for joint in JOINTS["tool"] for side in "ab"] + [f"on_{name}" for name in table["film"]]
    places = {name: f"tool.{name}" for name in part.patches}
    parts = Assembly([part])
    return parts.join(
        [Film(f"tool.{surface}", coefficient) for surface, coefficient in table["film"].items()],
        [],
        {name: places[name] for name in ("heater", "tip", "surface", *(more if joints else ()))},
        places,
        {name: parts.observable("tool", name) for name in part.observables},
        (),
    )


def reduced_centre(*, joints: bool = False) -> ReducedModel:
    """Return the machining centre as it is shipped; with joints: for the one that is not linear."""
    settings = data("centre.toml")["reduction"]
    mixes = [
        {k: v for k, v in mix.items() if k != "screws"}
        | {f"{axis}_screw_{k}": mix["screws"] for axis in STATIONS for k in range(N_HATS) if "screws" in mix}
        for mix in settings["mix"]
    ]
    full = centre(joints=joints)
    # The basis answers for what is measured at the test position; the components of the axes are sums of the same
    # displacements elsewhere, and take it as it is.
    main = replace(full, observables={name: row for name, row in full.observables.items() if name[0] != "E"})
    if not joints:
        return project(full, basis(main, settings["size"], mixes, settings["regime"]))
    more = settings["joints"]
    exposed = [*(name.replace(".", "_") for name in EXPOSED), *EXPOSED_LUMPS]
    v = basis(main, more["size"], mixes + _passing("centre", more, exposed), settings["regime"])
    return project(full, v, ("nose", "tip"))


def reduced_tool() -> ReducedModel:
    """Return the resting tool as it is shipped, with joints."""
    table = data("tool.toml")
    settings = table["reduction"]
    full, more = tool(joints=True), settings["joints"]
    mixes = settings["mix"] + _passing("tool", more, [f"on_{name}" for name in table["film"]])
    return project(full, basis(full, more["size"], mixes, settings["regime"]), ("s1", "s2", "s3"))


#: what makes each of the files in ``virtual/reduced``
MODELS: dict[str, Callable[[], ReducedModel]] = {
    "centre": reduced_centre,
    "centre_joints": partial(reduced_centre, joints=True),
    "tool_joints": reduced_tool,
}


def _passing(machine: str, settings: Mapping[str, float], exposed: Sequence[str]) -> list[dict[str, float]]:
    """Return the usual heat that passes the joints of a machine, and that its surfaces lose beside their films [W]."""
    passing = settings["passing"]
    through = [{f"{joint}_a": -passing, f"{joint}_b": passing} for joint in JOINTS[machine]]
    return through + [{name: settings["surface"]} for name in exposed]


def _with_means(part: Part) -> Part:
    """Return a part with the mean of each surface as a place, ``on_`` its name."""
    means = {f"on_{name}": surface.load / surface.area for name, surface in part.surfaces.items()}
    return replace(part, patches={**part.patches, **means})


def dimensions(values: dict[str, Any]) -> dict[str, Any]:
    """Return the dimensions of a part, without its material; lists as tuples."""
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items() if k != "material"}


def _observables(parts: Assembly, table: dict[str, Any], column: Column, overhang: float) -> dict[str, FloatArray]:
    """Compose what the parts do into what the tool point does, by levers of first order.

    A turn a about X moves a point by -a z in y and a y in z, b about Y by b z in x, c about Z by -c y in x.
    """
    lengths = table["lengths"]
    iron = 1e6 * material(table["column"]["material"]).expansion

    def of(part: str, name: str) -> FloatArray:
        return parts.observable(part, name)

    high = lengths["mount"]
    height = column.test + high
    #: column's guide to the tool
    reach = overhang - column.depth / 2.0
    front, rear, workpiece = (parts.place(p) for p in ("headstock_front", "headstock_rear", "table"))
    head = iron * (lengths["head_front"] * front + (1.0 - lengths["head_front"]) * rear)
    # The right guide leads the headstock, which grows away from it; the column carries that guide.
    aside = iron * lengths["guide_x"] * (parts.place("column.guide_right") - (front + rear) / 2.0)
    # The headstock's front rises more than its rear.
    nod = iron * high / lengths["bearing_span"] * (front - rear)
    foot, under = of("bed", "a_foot"), of("bed", "a_table")
    a, b, c = of("column", "a"), of("column", "b"), of("column", "c")
    bearing_x = iron * lengths["bearing_x"] * parts.place("bed.table")
    pitch_at_test = of("column", f"ay@{TEST_POSITION['y']}")
    # Where Y stands the headstock has the pitch of the column's guide there, and the tool its lever.
    drives = {
        "x": [(p, of("x_screw", f"at@{p}") - bearing_x) for p in STATIONS["x"]],
        "y": [
            (
                p,
                of("column", "lift") - of("y_screw", f"at@{p}") + reach * (of("column", f"ay@{p}") - pitch_at_test),
            )
            for p in STATIONS["y"]
        ],
        "z": [(p, of("bed", "z") - of("z_screw", f"at@{p}")) for p in STATIONS["z"]],
    }
    across = [
        (p, of("column", f"zy@{p}") + high * of("column", f"ay@{p}") + 1e-3 * p * (foot - under)) for p in STATIONS["y"]
    ]
    at_test = {axis: dict(rows)[TEST_POSITION[axis]] for axis, rows in drives.items()}
    return {
        "x": at_test["x"] + of("column", "x") + aside - c * high - b * reach,
        "y": at_test["y"]
        + of("bed", "y")
        + iron * high * rear
        - iron * height * workpiece
        + foot * overhang
        + (a + nod) * reach
        + under * lengths["table"],
        "z": at_test["z"]
        + of("column", "z")
        - lengths["headstock"] * head
        - of("spindle", "tip")
        - iron * lengths["table"] * workpiece
        + (foot - under) * height
        + (a + nod) * high,
        "a": foot - under + a + nod,
        "b": b,
        "nose": of("spindle", "nose"),
        "tip": of("spindle", "tip"),
        **{f"{axis}{axis}@{p}": row for axis, rows in drives.items() for p, row in rows},
        **{f"zy@{p}": row for p, row in across},
        **{f"ay@{p}": of("column", f"ay@{p}") for p in STATIONS["y"]},
        "slide": of("column", "foot") - of("bed", "foot"),
    }


def _components(parts: Assembly, table: dict[str, Any], column: Column, bed: Bed) -> dict[str, FloatArray]:
    """Compose what each axis does where it stands: its six components, tool's side against workpiece's side.

    They hold at the tip of the test bar while the other axes stand at `TEST_POSITION`: what an axis turns about there.
    Z has three, in the plane of the bed: that sheet knows no right and left. X turns at `TEST_POSITION` about X alone.
    """
    lengths = table["lengths"]
    iron = 1e6 * material(table["column"]["material"]).expansion

    def of(part: str, name: str) -> FloatArray:
        return parts.observable(part, name)

    high, behind = lengths["mount"], lengths["table"]
    overhang = bed.foot - bed.table - behind
    height, reach = column.test + high, overhang - column.depth / 2.0
    under, workpiece = of("bed", "a_table"), parts.place("table")
    bearing_x = iron * lengths["bearing_x"] * parts.place("bed.table")
    # The bed bends as a free beam across: warm on top it crowns along X, warm at its rear its guides of X are bowed.
    crown = iron / bed.height * (parts.place("bed.front") - parts.place("bed.under"))
    bow = iron / (bed.foot - bed.table) * (parts.place("bed.rear") - parts.place("bed.front"))
    rows: dict[str, FloatArray] = {}
    for p in STATIONS["x"]:
        # The table is on the other side of the middle, and the workpiece where the tool is.
        q = (p - TEST_POSITION["x"]) / 1000.0
        rows |= {
            f"EXX@{p}": of("x_screw", f"at@{p}") - bearing_x + q * (height * crown + behind * bow),
            f"EYX@{p}": behind * under - of("bed", "y_table") - iron * height * workpiece - q**2 / 2.0 * crown,
            f"EZX@{p}": -height * under - iron * behind * workpiece - q**2 / 2.0 * bow,
            f"EAX@{p}": -under,
        }
        if q:
            rows |= {f"EBX@{p}": q * bow, f"ECX@{p}": -q * crown}
    for p in STATIONS["y"]:
        a, b, c = (of("column", f"{turn}y@{p}") for turn in "abc")
        rows |= {
            f"EXY@{p}": of("column", f"xy@{p}") - high * c - reach * b,
            f"EYY@{p}": of("column", "lift") - of("y_screw", f"at@{p}") + reach * a,
            f"EZY@{p}": of("column", f"zy@{p}") + high * a,
            f"EAY@{p}": a,
            f"EBY@{p}": b,
            f"ECY@{p}": c,
        }
    for p in STATIONS["z"]:
        foot = of("bed", f"az@{p}")
        rows |= {
            f"EYZ@{p}": of("bed", f"yz@{p}") + overhang * foot,
            f"EZZ@{p}": of("bed", "z") - of("z_screw", f"at@{p}") + height * foot,
            f"EAZ@{p}": foot,
        }
    return rows
