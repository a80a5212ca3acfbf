"""What `thermocomp simulate` prints."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.terminal import print_table, words
from thermocomp.recordings.recording import Recording
from thermocomp.report import records
from thermocomp.report.layout import Column, Layout
from thermocomp.virtual.protocol import Experiment


def show_simulated(tests: Sequence[Recording], paths: Sequence[Path], console: Console, *, as_json: bool) -> None:
    """Print what was recorded on the virtual machine."""
    if as_json:
        content = [{"file": str(p), **records.recording(r, ())} for r, p in zip(tests, paths, strict=True)]
        print_json({"recordings": content})
        return
    for r, p in zip(tests, paths, strict=True):
        hours = (r.time[-1] - r.time[0]) / 3600
        console.print(
            f"{words(p)}: {len(r)} rows, {hours:.1f} h, {len(r.temperatures)} temperatures, "
            f"{len(r.displacements)} displacements, {len(r.cycles)} thermal cycle(s)"
        )


def show_experiments(experiments: Sequence[Experiment], console: Console, *, as_json: bool) -> None:
    """Print what can be recorded on the virtual machines."""
    if as_json:
        content = [{"name": e.name, "description": e.description, "tests": len(e.tests)} for e in experiments]
        print_json({"experiments": content})
        return
    columns = (
        Column("experiment", lambda e: e.name),
        Column("tests", lambda e: len(e.tests), ">"),
        Column("what it is", lambda e: e.description),
    )
    print_table(Layout(columns, experiments), console, box=None)
