"""`thermocomp simulate`: an experiment on a virtual machine."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from thermocomp.cli.answers import fold, free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_table
from thermocomp.recordings.recording import Recording
from thermocomp.report import records
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout
from thermocomp.virtual.datasets import find_experiment
from thermocomp.virtual.protocol import Experiment

#: length of a description without ``--details`` [characters]
SHORT = 49


def files_of(output: Path, given: Mapping[str, Any]) -> list[Path]:
    """Return the path of the output file for each test of an experiment."""
    return _number(output, len(find_experiment(given["experiment"]).names))


def _number(output: Path, tests: int) -> list[Path]:
    if tests == 1:
        return [output]
    return [output.with_name(f"{output.stem}-{k}{output.suffix}") for k in range(1, tests + 1)]


@command(
    "thermocomp.virtual.verbs:simulate",
    writes=files_of,
    needs_output=True,
    forms={"experiment": str},
    words=("experiment",),
    instead={"list_": "thermocomp.virtual.verbs:experiments"},
)
def simulate(found: list[Recording] | list[Experiment], face: CommandFace, *, list_: bool = False) -> int:  # noqa: ARG001 - asks for the other verb
    """Write and show the recordings, or list the experiments.

    Parameters
    ----------
    output : Path
        Output file (.parquet or .csv); one file per test if the experiment has several tests.
    list_ : bool
        List the experiments with their descriptions.

    Returns
    -------
    int
        0 done.
    """
    experiments = [e for e in found if isinstance(e, Experiment)]
    tests = [r for r in found if isinstance(r, Recording)]
    if face.output is None:
        content = [{"name": e.name, "description": e.description, "tests": len(e.tests)} for e in experiments]
        face.answer(
            lambda: {"experiments": content}, lambda: _list(experiments), lambda: _show_experiments(experiments)
        )
        return 0
    from thermocomp.recordings.readers import recordings

    files = dict(zip(_number(face.output, len(tests)), tests, strict=True))
    for path, test in files.items():
        recordings.write(test, path, overwrite=face.overwrite)
    face.answer(
        lambda: {"recordings": [{"file": str(p), **records.recording(r, ())} for p, r in files.items()]},
        lambda: _answer(files, face),
        lambda: None,
    )
    return 0


def _answer(files: Mapping[Path, Recording], face: CommandFace) -> CommandAnswer:
    columns = (
        Column("written", lambda item: item[0].name),
        Column("rows", lambda item: len(item[1]), ">"),
        Column("hours", lambda item: (item[1].time[-1] - item[1].time[0]) / 3600, ".1f"),
        Column("temperatures", lambda item: len(item[1].temperatures), ">"),
        Column("displacements", lambda item: len(item[1].displacements), ">"),
        Column("cycles", lambda item: len(item[1].cycles), ">"),
    )
    name = face.given["experiment"]
    return CommandAnswer(
        head=f"{name}: {len(files)} recording(s) of the virtual machine.",
        table=Layout(columns, list(files.items())),
        following=face.following("check", recordings=list(files)),
    )


def _list(experiments: list[Experiment]) -> CommandAnswer:
    columns = (
        Column("experiment", lambda e: e.name),
        Column("tests", lambda e: len(e.tests), ">"),
        Column("description", lambda e: fold(e.description, 1, SHORT)[0]),
    )
    following = ("thermocomp", "simulate", experiments[0].name, "-o", str(free(f"{experiments[0].name}.csv")))
    return CommandAnswer(
        head=f"{len(experiments)} experiments.", table=Layout(columns, experiments), following=following
    )


def _show_experiments(experiments: list[Experiment]) -> None:
    columns = (
        Column("experiment", lambda e: e.name),
        Column("tests", lambda e: len(e.tests), ">"),
        Column("description", lambda e: e.description),
    )
    print_table(Layout(columns, experiments), console, box=None)
