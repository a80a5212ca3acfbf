"""``thermocomp volumetric``: the error anywhere in the work volume, in the course of a recording."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput, read_recordings, tell_trouble
from thermocomp.cli.progress import by_share
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import refuse_existing

if TYPE_CHECKING:
    from thermocomp.assessment.volumetric import Moment, Volumetric

Point = tuple[float, float, float] | None
#: contributions that are told; --json has all
TOLD = 8
GRID = 5

_console = Console(highlight=False)


def volumetric(
    machine: Path,
    /,
    *,
    recording: Path | None = None,
    mapping: Path | None = None,
    at: Point = None,
    grid: int | None = None,
    tool_length: float | None = None,
    time: list[float] | None = None,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Tell the error of the tool's tip at a point and all over the work volume, and what corrections leave of it.

    With neither --at nor --grid both are told, in the middle of the travels and on 5 points along each axis.

    Parameters
    ----------
    machine : Path
        Machine file (.toml): axes, and what is known of the 32 error components.
    recording : Path
        CSV, XLSX or Parquet file to replay through the machine's models; without it the machine is taken in its
        reference state, with its constants and profiles alone.
    mapping : Path
        TOML file that says what the recording's columns are.
    at : float
        Positions X Y Z of the axes [mm]: error, tilt and contributions there. The straight lines go through it.
    grid : int
        Points along each axis: the volume before and after correction.
    tool_length : float
        From the gauge point to the tip, along -Z [mm]; the machine file's tool if not given.
    time : list of float
        Times to look at [h]; start, largest error and end of the recording if not given.
    output : Path
        Page with figures and tables to write (.html).
    overwrite : bool
        Write over an existing page.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    if tool_length is not None and not tool_length >= 0:
        raise InputError(f"--tool-length {tool_length:g}: must not be negative")
    if recording is None and mapping is not None:
        raise InputError("--mapping is for a recording: name one by --recording")
    with needs("study"):
        from thermocomp.assessment.volumetric import study
        from thermocomp.files.machines import read_machine
    inputs = [machine] if recording is None else [machine, recording]
    if output is not None:
        refuse_existing([output], overwrite, inputs, ".html")
    known = read_machine(machine)
    tests = read_recordings([recording], mapping) if recording is not None else []
    trouble = tell_trouble(tests)
    with by_share("replaying", hidden=json) as progress:
        result = study(
            known,
            tests[0] if tests else None,
            at=at,
            grid=GRID if grid is None else grid,
            tool=None if tool_length is None else (0.0, 0.0, -tool_length),
            hours=time or (),
            progress=progress,
        )
    if output is not None:
        with needs("study"):
            from thermocomp.report import volumetric as pages
        pages.write(result, output)
    if json:
        print_json({"trouble": trouble, **_content(result)}, _console)
    else:
        _show(result, point=at is not None or grid is None, volume=grid is not None or at is None)
        if output is not None:
            _console.print(f"Page: {output}", soft_wrap=True)
    return 0


def _show(study: "Volumetric", *, point: bool, volume: bool) -> None:
    with needs("study"):
        from thermocomp.report.volumetric import headline, said, unproven, untested
    machine, recording = study.machine, study.recording
    replayed = "reference state: constants and profiles alone"
    if recording is not None:
        hours = (recording.time[-1] - recording.time[0]) / 3600
        replayed = f"{recording.source or recording.name}, {len(recording)} rows, {hours:.2f} h"
    _console.print(f"[bold]{escape(machine.name)}[/], {escape(machine.structure.code)}: {escape(replayed)}")
    _show_components(study)
    if point:
        _console.print(f"\n[bold]At {said(study.course.point)}[/], the tip at {said(study.course.tool)}")
        _console.print(_at_point(study))
    _console.print(_contributions(study, point=point))
    _console.print(_lines(study))
    if volume:
        _console.print(_volume(study))
    for what, codes in (("never judged on unseen cycles", untested(study)), ("unproven", unproven(study))):
        if codes:
            _console.print(f"[yellow]but[/] {what}: {escape(', '.join(codes))}", soft_wrap=True)
    if study.missing:
        _console.print(f"[yellow]but[/] in {study.missing} rows an input is missing: the state before is held there")
    for note in study.notes:
        _console.print(f"[yellow]note[/] {escape(note)}", soft_wrap=True)
    if volume:
        _console.print(f"[bold]{headline(study)}[/]", soft_wrap=True)


def _show_components(study: "Volumetric") -> None:
    """Print all 32 components: those that something is known of with their values, the others by code."""
    with needs("study"):
        from thermocomp.report.volumetric import listed, said
    rows = listed(study)
    table = Table(caption=f"components at {said(study.course.point)}")
    for heading in ("", "told by", *(m.label for m in study.moments), ""):
        table.add_column(heading, justify="left" if heading in ("", "told by") else "right", no_wrap=True)
    known = [r for r in rows if r["source"] != "nothing"]
    for r in known:
        table.add_row(r["code"], escape(r["source"]), *map(_number, r["values"]), r["unit"])
    if known:
        _console.print(table)
    others = [r["code"] for r in rows if r["source"] == "nothing"]
    _console.print(f"{len(known)} of {len(rows)} components are known" + "; taken as zero: " * bool(others), end="")
    _console.print(", ".join(others), soft_wrap=True)


def _at_point(study: "Volumetric") -> Table:
    course = study.course
    table = Table(caption="error of the tool's tip (um), tilt of the tool (urad)")
    table.add_column("thermal state")
    for heading in ("X", "Y", "Z", "length", "A", "B", "C"):
        table.add_column(heading, justify="right")
    for m in study.moments:
        error, tilt = course.error[m.row], course.tilt[m.row]
        cells = (*error, float((error @ error) ** 0.5), *tilt)
        table.add_row(m.name, *map(_number, cells))
    return table


def _contributions(study: "Volumetric", *, point: bool) -> Table:
    course = study.course
    at_point = max(study.moments, key=lambda m: float(course.error[m.row] @ course.error[m.row]))
    moment = at_point if point else study.worst
    found = _contributed(study, moment)
    found.sort(key=lambda c: -max(c["length_um"] * point, c["volume_rms_um"]))
    told = [c for c in found[:TOLD] if max(c["length_um"], c["volume_rms_um"]) > 0]
    table = Table(caption=f"what the components add (um); volume: RMS over it; {moment.name}")
    for heading in ("", "", *(("value", "X", "Y", "Z") if point else ()), "volume"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=bool(heading))
    for c in told:
        here = (f"{_number(c['value'])} {c['unit']}", *map(_number, c["adds_um"])) if point else ()
        table.add_row(c["code"], c["description"], *here, _number(c["volume_rms_um"]))
    return table


def _contributed(study: "Volumetric", moment: "Moment") -> list[dict[str, Any]]:
    """Return what every component adds to the error at the point, the largest first, and over the volume."""
    from thermocomp.core.components import COMPONENTS

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


def _lines(study: "Volumetric") -> Table:
    table = Table(caption="best straight lines: correction = offset + slope x (position - at)")
    for heading in ("thermal state", "axis"):
        table.add_column(heading, no_wrap=True)
    for heading in ("offset, um", "slope, um/m", "at, mm", "left, um"):
        table.add_column(heading, justify="right", no_wrap=True)
    for m in study.moments:
        for k, line in enumerate(m.straight.lines):
            c = line.correction
            cells = (_number(c.offset), _number(c.slope), f"{c.reference_position:g}", _number(line.along.largest))
            table.add_row("" if k else m.name, line.axis, *cells)
    return table


def _volume(study: "Volumetric") -> Table:
    n = study.moments[0].grid.size // 3
    table = Table(caption=f"length of the error at {n} points over the work volume")
    for heading in ("thermal state", "corrected"):
        table.add_column(heading)
    for heading in ("RMS, um", "largest, um"):
        table.add_column(heading, justify="right")
    for m in study.moments:
        for k, (name, size) in enumerate(m.sizes.items()):
            table.add_row("" if k else m.name, name, _number(size.rms), _number(size.largest))
    return table


def _content(study: "Volumetric") -> dict[str, Any]:
    with needs("study"):
        from thermocomp.report.volumetric import listed, unproven, untested
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
        "states": [
            {
                "state": m.label,
                "time_h": m.time / 3600,
                "error_um": course.error[m.row].tolist(),
                "tilt_urad": course.tilt[m.row].tolist(),
                "contributions": _contributed(study, m),
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
        ],
        "course": {
            "time_s": course.time.tolist(),
            "error_um": course.error.tolist(),
            "tilt_urad": course.tilt.tolist(),
        },
    }


def _number(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}"  # no minus zero
