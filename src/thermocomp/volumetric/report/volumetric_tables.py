"""Volumetric error of a machine in numbers: tables for terminal and page, and plain numbers for JSON."""

from typing import Any

import numpy as np

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Vector
from thermocomp.report.layout import Column, Layout
from thermocomp.runtime.geometry.kinematics import INDEX
from thermocomp.volumetric.judging.volumetric import Moment, Volumetric, describe_source, models_of

#: number of contributions shown; --json has all
TOLD = 8
UM = Column("", 0, "um")
#: convergence limit for the iteration of the complete correction [um]
SETTLED = 0.01


def headline(study: Volumetric) -> str:
    """Return a summary line: the largest error in the work volume, and its residual after corrections."""
    sizes = study.worst.sizes
    none, lines, everything = (sizes[k] for k in ("nothing", "straight lines", "everything"))
    when = f"after {study.worst.time / 3600:.2f} h" if len(study.course.time) > 1 else "in the reference state"
    left = f"{everything.largest:.2f}" if everything.largest >= SETTLED else f"less than {SETTLED:g}"
    return (
        f"Largest error in the work volume {when}: {none.largest:.1f} um (RMS {none.rms:.1f} um); with a correction by "
        f"the best straight line of each axis: {lines.largest:.1f} um (RMS {lines.rms:.1f} um); with a correction "
        f"computed for every point: {left} um"
    )


def components(study: Volumetric, *, page: bool = False) -> Layout:
    """Return the components with their values in each state: on a page all, else those with a source."""
    rows = [r for r in listed(study) if page or r["source"] != "nothing"]
    nothing = dict.fromkeys((k for k, r in enumerate(rows) if r["source"] == "nothing"), "soft")

    def value(k: int) -> Column:
        return Column(
            study.moments[k].label,
            lambda r: None if r["source"] == "nothing" else r["values"][k],
            "um",
            whole=True,
        )

    columns = (
        Column("component" if page else "", "code", whole=True),
        *((Column("description", "description"),) if page else ()),
        Column("source", "source", whole=True),
        *map(value, range(len(study.moments))),
        Column("unit", "unit") if page else Column("", "unit", whole=True),
    )
    return Layout(columns, rows, caption=f"error components at {said(study.course.point)}", tones=nothing)


def at_point(study: Volumetric, *, page: bool = False) -> Layout:
    """Return a table of the error and the tilt of the tool at the point, in each state."""
    course = study.course
    rows = [
        (m.name, *course.error[m.row], float(np.linalg.norm(course.error[m.row])), *course.tilt[m.row])
        for m in study.moments
    ]
    headings = {"X": "um", "Y": "um", "Z": "um", "length": "um", "A": "urad", "B": "urad", "C": "urad"}
    numbers = (Column(h, k, "um", u if page else "") for k, (h, u) in enumerate(headings.items(), start=1))
    caption = "error of the tool's tip (um), tilt of the tool (urad)"
    return Layout((Column("thermal state", 0), *numbers), rows, caption=caption)


def contributions(study: Volumetric, *, point: bool) -> Layout:
    """Return the largest contributions: at the point and over the volume, or over the volume only."""
    course = study.course
    largest = max(study.moments, key=lambda m: float(course.error[m.row] @ course.error[m.row]))
    moment = largest if point else study.worst
    found = contributed(study, moment)
    found.sort(key=lambda c: -max(c["length_um"] * point, c["volume_rms_um"]))
    here = (
        Column("value", lambda c: f"{UM.text((c['value'],))} {c['unit']}", ">", whole=True),
        Column("X", lambda c: c["adds_um"][0], "um", whole=True),
        Column("Y", lambda c: c["adds_um"][1], "um", whole=True),
        Column("Z", lambda c: c["adds_um"][2], "um", whole=True),
    )
    columns = (
        Column("", "code"),
        Column("", "description"),
        *(here if point else ()),
        Column("volume", "volume_rms_um", "um", whole=True),
    )
    told = [c for c in found[:TOLD] if max(c["length_um"], c["volume_rms_um"]) > 0]
    return Layout(
        columns, told, caption=f"contributions of the components (um), {moment.name}; volume: RMS in the work volume"
    )


def lines(study: Volumetric, *, page: bool = False) -> Layout:
    """Return the best straight lines and the residual error after them, on a page also over the volume."""
    rows = [
        {"name": "" if k else m.name, **line}
        for m, state in zip(study.moments, states(study), strict=True)
        for k, line in enumerate(state["straight_lines"])
    ]
    columns = [
        Column("thermal state", "name", whole=True),
        Column("axis", "axis", whole=True),
        Column("offset", "offset_um", "um", "um", whole=True),
        Column("slope", "slope_um_per_m", "um", "um/m", whole=True),
    ]
    if page:
        columns += [
            Column("reference position", "reference_position_mm", "um", "mm"),
            Column("largest residual along the line", "left_along_max_um", "um", "um"),
            Column("RMS residual in the volume", "left_volume_rms_um", "um", "um"),
            Column("largest in the volume", "left_volume_max_um", "um", "um"),
        ]
    else:
        columns += [
            Column("at", "reference_position_mm", "g", "mm", whole=True),
            Column("left", "left_along_max_um", "um", "um", whole=True),
        ]
    caption = "best straight lines: correction = offset + slope x (position - reference position)"
    return Layout(columns, rows, caption=caption + ("" if page else "; at: reference position; left: largest residual"))


def volume(study: Volumetric) -> Layout:
    """Return the errors over the work volume before and after correction."""
    rows = [
        ("" if k else m.name, name, size.rms, size.largest)
        for m in study.moments
        for k, (name, size) in enumerate(m.sizes.items())
    ]
    columns = (
        Column("thermal state", 0),
        Column("correction", 1),
        Column("RMS", 2, "um", "um"),
        Column("largest", 3, "um", "um"),
    )
    n = study.moments[0].grid.size // 3
    return Layout(columns, rows, caption=f"length of the error at {n} points over the work volume")


def listed(study: Volumetric) -> list[dict[str, Any]]:
    """Return all 32 components: the source of the value, and the value at the point at each moment."""
    return [
        {
            "code": c.code,
            "description": c.description,
            "unit": c.unit,
            "source": describe_source(study.machine.components.get(c.code)),
            "values": [float(study.course.values[m.row, INDEX[c.code]]) for m in study.moments],
        }
        for c in COMPONENTS
    ]


def content(study: Volumetric) -> dict[str, Any]:
    """Return all errors of a machine for JSON."""
    course, recording = study.course, study.recording
    return {
        "machine": study.machine.name,
        "structure": study.machine.structure.code,
        "recording": (recording.source or recording.name) if recording is not None else None,
        "rows_missing_an_input": study.missing,
        "point_mm": course.point,
        "tool_mm": course.tool,
        "never_judged": untested(study),
        "unproven": unproven(study),
        "notes": study.notes,
        "components": listed(study),
        "states": states(study),
        "course": {
            "time_s": course.time.tolist(),
            "error_um": course.error.tolist(),
            "tilt_urad": course.tilt.tolist(),
        },
    }


def states(study: Volumetric) -> list[dict[str, Any]]:
    """Return the evaluated thermal states: errors at the point, their contributions, and the volume."""
    course = study.course
    return [
        {
            "state": m.label,
            "time_h": m.time / 3600,
            "error_um": course.error[m.row].tolist(),
            "tilt_urad": course.tilt[m.row].tolist(),
            "contributions": contributed(study, m),
            "straight_lines": [
                {
                    "axis": line.axis,
                    "offset_um": line.correction.offset,
                    "slope_um_per_m": line.correction.slope,
                    "reference_position_mm": line.correction.reference_position,
                    "left_along_rms_um": line.along.rms,
                    "left_along_max_um": line.along.largest,
                    "left_volume_rms_um": line.volume.rms,
                    "left_volume_max_um": line.volume.largest,
                }
                for line in m.straight.lines
            ],
            "volume": {
                name: {"rms_um": size.rms, "max_um": size.largest, "points": m.grid.size // 3}
                for name, size in m.sizes.items()
            },
        }
        for m in study.moments
    ]


def contributed(study: Volumetric, moment: Moment) -> list[dict[str, Any]]:
    """Return the contribution of each component at the point, largest first, and over the volume."""
    course = study.course
    found = [
        {
            "code": c.code,
            "description": c.description,
            "value": float(course.values[moment.row, k]),
            "unit": c.unit,
            "adds_um": adds.tolist(),
            "length_um": float((adds @ adds) ** 0.5),
            "volume_rms_um": float(moment.shares[k]),
        }
        for k, (c, adds) in enumerate(zip(COMPONENTS, course.contributions(moment.row), strict=True))
    ]
    return sorted(found, key=lambda c: -c["length_um"])


def untested(study: Volumetric) -> list[str]:
    """Return the components with models that were never judged on unseen cycles."""
    return [
        code
        for code, source in study.machine.components.items()
        if any(m.honest_error is None for m in models_of(source))
    ]


def unproven(study: Volumetric) -> list[str]:
    """Return the components with unproven models approved for use, and who approved them."""
    found = {
        code: next((m.honest_error.taken for m in models_of(source) if m.honest_error and m.honest_error.taken), "")
        for code, source in study.machine.components.items()
    }
    return [f"{code}, approved by {by}" for code, by in found.items() if by]


def said(point: Vector) -> str:
    """Return the axis positions of a point as text."""
    return "X {:g}, Y {:g}, Z {:g} mm".format(*point)
