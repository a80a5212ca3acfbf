"""The volumetric error of a machine as a single offline page."""

from thermocomp.core.components import COMPONENTS
from thermocomp.report.html import page
from thermocomp.volumetric.judging.volumetric import Volumetric
from thermocomp.volumetric.report import volumetric_figures as figures
from thermocomp.volumetric.report import volumetric_space as space
from thermocomp.volumetric.report import volumetric_tables as tables


def render(study: Volumetric) -> str:
    """Return the page as a self-contained HTML text."""
    machine, recording, course = study.machine, study.recording, study.course
    known = machine.components
    n_axes, over_time = len(machine.structure.axes), len(course.time) > 1
    return page(
        "volumetric.html",
        study=study,
        headline=tables.headline(study),
        travels=", ".join(
            f"{a.name} {a.travel[0]:g} to {a.travel[1]:g} mm" for a in sorted(machine.axes, key=lambda a: a.name)
        ),
        replayed=(recording.source or recording.name) if recording is not None else "reference state",
        n_points=study.moments[0].grid.size // 3,
        tool=f"the tool tip at {tables.said(course.tool)} from the gauge point",
        point=tables.said(course.point),
        volume=tables.volume(study),
        at=tables.at_point(study, page=True),
        lines=tables.lines(study, page=True),
        components=tables.components(study, page=True),
        untested=tables.untested(study),
        unproven=tables.unproven(study),
        boxes=space.boxes(study) if n_axes == 3 else "",
        sections=space.sections(study, study.worst) if n_axes > 1 else "",
        over_time=figures.over_time(study) if over_time else "",
        contributions=figures.contributions(study) if known else "",
        curves=figures.curves(study) if any(c.depends_on and c.code in known for c in COMPONENTS) else "",
        scalars=figures.scalars(study)
        if over_time and any(c.is_scalar and c.code in known for c in COMPONENTS)
        else "",
    )
