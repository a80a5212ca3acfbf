"""``thermocomp volumetric``: the error in the work volume in the course of a recording."""

from functools import partial
from pathlib import Path

from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.reading import read_one
from thermocomp.cli.terminal import console, print_table, words
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import PrintedLine
from thermocomp.volumetric.report import volumetric_tables as told
from thermocomp.volumetric.verbs import VolumetricErrors


@command(
    "thermocomp.volumetric.verbs:volumetric",
    writes=".html",
    forms={"machine": Path, "recording": Path | None, "time": list[float] | None},
    reads={"recording": read_one},
)
def volumetric(found: VolumetricErrors, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output page with figures and tables (.html or .pdf).

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    face.write(found.report)
    face.answer(found.to_dict, lambda: _answer(found, face), partial(_show, found))
    return 0


def _answer(found: VolumetricErrors, face: CommandFace) -> CommandAnswer:
    study = found.study
    codes = {"never judged on unseen cycles": told.untested(study), "unproven": told.unproven(study)}
    known = [c["code"] for c in told.listed(study) if c["source"] != "nothing"]
    missing = f"an input is missing in {study.missing} rows, where the previous state is held"
    return CommandAnswer(
        head=told.headline(study) + "." if found.volume else f"The tool at {told.said(study.course.point)}.",
        table=told.contributions(study, point=True) if found.point else told.volume(study),
        lines=[PrintedLine(f"Known: {len(known)} components; all others are assumed to be zero.")],
        warnings=[
            *(f"{what}: {', '.join(mine)}" for what, mine in codes.items() if mine),
            *([missing] if study.missing else []),
            *study.notes,
        ],
        files=face.files,
        following=() if face.files else face.following("volumetric", output=free("volumetric.html")),
    )


def _show(found: VolumetricErrors) -> None:
    study, point, volume = found.study, found.point, found.volume
    machine, recording = study.machine, study.recording
    replayed = "reference state, with constants and profiles only"
    if recording is not None:
        hours = (recording.time[-1] - recording.time[0]) / 3600
        replayed = f"{recording.source or recording.name}, {len(recording)} rows, {hours:.2f} h"
    console.print(f"[bold]{words(machine.name)}[/], {words(machine.structure.code)}: {words(replayed)}")
    known, components = told.components(study), told.listed(study)
    if known.rows:
        print_table(known, console)
    others = [c["code"] for c in components if c["source"] == "nothing"]
    console.print(
        f"{len(known.rows)} of {len(components)} components are known" + "; assumed to be zero: " * bool(others), end=""
    )
    console.print(", ".join(others), soft_wrap=True)
    if point:
        console.print(
            f"\n[bold]At {told.said(study.course.point)}[/], tool tip at {told.said(study.course.tool)} from "
            "the gauge point"
        )
        print_table(told.at_point(study), console)
    print_table(told.contributions(study, point=point), console)
    print_table(told.lines(study), console)
    if volume:
        print_table(told.volume(study), console)
    for what, codes in (("never judged on unseen cycles", told.untested(study)), ("unproven", told.unproven(study))):
        if codes:
            console.print(f"[yellow]but[/] {what}: {words(', '.join(codes))}", soft_wrap=True)
    if study.missing:
        console.print(f"[yellow]but[/] an input is missing in {study.missing} rows, where the previous state is held")
    for note in study.notes:
        console.print(f"[yellow]note[/] {words(note)}", soft_wrap=True)
    if volume:
        console.print(f"[bold]{told.headline(study)}[/]", soft_wrap=True)
