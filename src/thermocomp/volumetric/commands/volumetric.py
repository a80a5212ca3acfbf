"""``thermocomp volumetric``: the error anywhere in the work volume, in the course of a recording."""

from pathlib import Path
from typing import TYPE_CHECKING

from thermocomp.cli import loudness
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.progress import show_share
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.cli.terminal import console, print_table, words
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import refuse_existing

if TYPE_CHECKING:
    from thermocomp.volumetric.judging.volumetric import Volumetric

Point = tuple[float, float, float] | None
GRID = 5


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
    from thermocomp.files.machines import read_machine
    from thermocomp.volumetric.judging.volumetric import study
    from thermocomp.volumetric.report import volumetric_tables

    inputs = [machine] if recording is None else [machine, recording]
    if output is not None:
        refuse_existing([output], overwrite, inputs, ".html")
    known = read_machine(machine)
    loudness.tell(f"read {machine}: {len(known.axes)} axes, {len(known.components)} components")
    tests = read_recordings([recording], mapping) if recording is not None else []
    trouble = tell_trouble(tests)
    with show_share("replaying", hidden=json) as progress:
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
        from thermocomp.volumetric.report import volumetric as pages

        pages.write(result, output, overwrite=overwrite)
    if json:
        print_json({"trouble": trouble, **volumetric_tables.content(result)})
    else:
        _show(result, point=at is not None or grid is None, volume=grid is not None or at is None)
        if output is not None:
            console.print(f"Page: {words(output)}", soft_wrap=True)
    return 0


def _show(study: "Volumetric", *, point: bool, volume: bool) -> None:
    from thermocomp.volumetric.report import volumetric_tables as told

    machine, recording = study.machine, study.recording
    replayed = "reference state: constants and profiles alone"
    if recording is not None:
        hours = (recording.time[-1] - recording.time[0]) / 3600
        replayed = f"{recording.source or recording.name}, {len(recording)} rows, {hours:.2f} h"
    console.print(f"[bold]{words(machine.name)}[/], {words(machine.structure.code)}: {words(replayed)}")
    known, components = told.components(study), told.listed(study)
    if known.rows:
        print_table(known, console)
    others = [c["code"] for c in components if c["source"] == "nothing"]
    console.print(
        f"{len(known.rows)} of {len(components)} components are known" + "; taken as zero: " * bool(others), end=""
    )
    console.print(", ".join(others), soft_wrap=True)
    if point:
        console.print(f"\n[bold]At {told.said(study.course.point)}[/], the tip at {told.said(study.course.tool)}")
        print_table(told.at_point(study), console)
    print_table(told.contributions(study, point=point), console)
    print_table(told.lines(study), console)
    if volume:
        print_table(told.volume(study), console)
    for what, codes in (("never judged on unseen cycles", told.untested(study)), ("unproven", told.unproven(study))):
        if codes:
            console.print(f"[yellow]but[/] {what}: {words(', '.join(codes))}", soft_wrap=True)
    if study.missing:
        console.print(f"[yellow]but[/] in {study.missing} rows an input is missing: the state before is held there")
    for note in study.notes:
        console.print(f"[yellow]note[/] {words(note)}", soft_wrap=True)
    if volume:
        console.print(f"[bold]{told.headline(study)}[/]", soft_wrap=True)
