"""The volumetric error of a machine on one offline page."""

from pathlib import Path
from typing import Any

import numpy as np

from thermocomp import __version__
from thermocomp.assessment.volumetric import Volumetric, models_of, told_by
from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Vector
from thermocomp.report import volumetric_figures as figures
from thermocomp.report import volumetric_space as space
from thermocomp.report.html import environment
from thermocomp.volumetric.kinematics import INDEX

#: to which the whole correction is iterated [um]
SETTLED = 0.01


def headline(study: Volumetric) -> str:
    """Return one line: the largest error in the work volume, and what corrections leave of it."""
    sizes = study.worst.sizes
    none, lines, everything = (sizes[k] for k in ("nothing", "straight lines", "everything"))
    when = f"after {study.worst.time / 3600:.2f} h" if len(study.course.time) > 1 else "in the reference state"
    left = f"{everything.largest:.2f}" if everything.largest >= SETTLED else f"less than {SETTLED:g}"
    return (
        f"Largest error in the work volume {none.largest:.1f} um, RMS {none.rms:.1f} um, {when}; after the best "
        f"straight line of each axis {lines.largest:.1f} um, RMS {lines.rms:.1f} um; after a correction "
        f"that is another one at every point {left} um"
    )


def render(study: Volumetric) -> str:
    """Return the page as one HTML text that needs no network.

    Parameters
    ----------
    study : Volumetric

    Returns
    -------
    str
    """
    machine, recording, course = study.machine, study.recording, study.course
    known = machine.components
    n_axes, over_time = len(machine.structure.axes), len(course.time) > 1
    return (
        environment()
        .get_template("volumetric.html")
        .render(
            version=__version__,
            study=study,
            headline=headline(study),
            travels=", ".join(
                f"{a.name} {a.travel[0]:g} to {a.travel[1]:g} mm" for a in sorted(machine.axes, key=lambda a: a.name)
            ),
            replayed=(recording.source or recording.name) if recording is not None else "reference state",
            n_points=study.moments[0].grid.size // 3,
            tool=f"the tool's tip at {said(course.tool)} from the gauge point",
            point=said(course.point),
            at=[
                [*course.error[m.row], float(np.linalg.norm(course.error[m.row])), *course.tilt[m.row]]
                for m in study.moments
            ],
            components=listed(study),
            untested=untested(study),
            unproven=unproven(study),
            boxes=space.boxes(study) if n_axes == 3 else "",
            sections=space.sections(study, study.worst) if n_axes > 1 else "",
            over_time=figures.over_time(study) if over_time else "",
            contributions=figures.contributions(study) if known else "",
            curves=figures.curves(study) if any(c.depends_on and c.code in known for c in COMPONENTS) else "",
            scalars=figures.scalars(study)
            if over_time and any(c.is_scalar and c.code in known for c in COMPONENTS)
            else "",
        )
    )


def write(study: Volumetric, path: Path) -> None:
    """Write the page; an existing file is replaced."""
    path.write_text(render(study), encoding="utf-8")


def listed(study: Volumetric) -> list[dict[str, Any]]:
    """Return all 32 components: what tells their value, and the value at the point in each moment."""
    return [
        {
            "code": c.code,
            "description": c.description,
            "unit": c.unit,
            "source": told_by(study.machine.components.get(c.code)),
            "values": [float(study.course.values[m.row, INDEX[c.code]]) for m in study.moments],
        }
        for c in COMPONENTS
    ]


def untested(study: Volumetric) -> list[str]:
    """Return the components whose models were never judged on unseen cycles."""
    return [
        code
        for code, source in study.machine.components.items()
        if any(m.honest_error is None for m in models_of(source))
    ]


def unproven(study: Volumetric) -> list[str]:
    """Return the components whose models are taken although they are unproven, and by whom."""
    found = {
        code: next((m.honest_error.taken for m in models_of(source) if m.honest_error and m.honest_error.taken), "")
        for code, source in study.machine.components.items()
    }
    return [f"{code}, taken by {by}" for code, by in found.items() if by]


def said(point: Vector) -> str:
    """Return a point in words."""
    return "X {:g}, Y {:g}, Z {:g} mm".format(*point)
