"""``thermocomp iso230``: thermal tests (ISO 230-3), positioning (ISO 230-2) and time constants."""

from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.reading import read_recordings
from thermocomp.cli.terminal import console, make_console, print_table, words
from thermocomp.core.exceptions import RecordingError
from thermocomp.iso230 import tables
from thermocomp.iso230.thermaltest import TITLES
from thermocomp.iso230.verbs import Evaluated
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout, laid_out

if TYPE_CHECKING:
    from thermocomp.recordings.recording import Recording

Tables = Annotated[list[Path], Parameter(show_default=False)]

#: values of a positioning test in the answer, by symbol
_VALUES = {"A": "accuracy", "R": "repeatability", "B": "reversal"}
#: width of the widest table [characters]
TABLE_WIDTH = 136


def read_tests(paths: list[Path], mapping: Path | None, *, tell: bool = True) -> "list[Recording]":
    """Read recordings of thermal tests."""
    try:
        return read_recordings(paths, mapping, tell=tell)
    except RecordingError as e:
        if "no time column" in str(e):
            raise RecordingError(f"{e}; give the table of a positioning test with --positioning") from e
        raise


@command(
    "thermocomp.iso230.verbs:iso230",
    writes=".html",
    forms={"recordings": list[Path] | None, "model": Path | None, "positioning": Tables, "pairs": list[str] | None},
    words=("recordings",),
    reads={"recordings": read_tests},
)
def iso230(found: Evaluated, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output page with tables and figures (.html or .pdf).

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    face.write(found.report)
    face.answer(found.to_dict, lambda: _answer(found, face), partial(_show, found))
    return 0


def _answer(found: Evaluated, face: CommandFace) -> CommandAnswer:
    kinds = [f"{t.name}: {TITLES[t.kind]}" for t in found.thermal]
    axes = [" ".join(part for part in ("axis", r.test.axis, r.test.state) if part) for r in found.positioned]
    curves = [(t, c) for t in found.thermal for c in (*t.curves, *t.tilts, *(x.length for x in t.targets))]
    thermal = (
        Column("", lambda row: row[1].name),
        Column("range, 60 min", lambda row: row[1].figures.range_60, ".2f"),
        Column("range, all", lambda row: row[1].figures.range_all, ".2f"),
        Column("with model", lambda row: row[1].after_figures and row[1].after_figures.range_all, ".2f"),
        Column("unit", lambda row: row[1].unit),
        *([Column("test", lambda row: row[0].name)] if len(found.thermal) > 1 else []),
    )
    positioning = (
        Column("", lambda r: " ".join(part for part in ("axis", r.test.axis, r.test.state) if part)),
        *(Column(f"{what} {key}", attrgetter(key), ".2f") for key, what in _VALUES.items()),
        Column("unit", lambda r: r.test.unit),
    )
    return CommandAnswer(
        head="; ".join([*kinds, *(f"positioning of {axis}" for axis in axes)]) + ".",
        table=Layout(thermal, curves) if curves else Layout(positioning, found.positioned),
        warnings=[*(n for t in found.thermal for n in t.notes), *(n for r in found.positioned for n in r.notes)],
        files=face.files,
        following=() if face.files else face.following("iso230", output=free("iso230.html")),
    )


def _show(found: Evaluated) -> None:
    # numbers must not be truncated: a narrow terminal wraps whole lines instead
    wide = make_console(width=max(console.width, TABLE_WIDTH))
    for t in found.thermal:
        console.print(f"\n[bold]{words(t.name)}: {TITLES[t.kind]}[/]")
        console.print(words(t.described))
        for table in tables.thermal_tables(t):
            console.print(f"\n[bold]{words(table.title)}[/]")
            print_table(laid_out(table), wide)
        for note in t.notes:
            console.print(f"[yellow]note[/] {words(note)}")
    for recording, mine in found.settlings:
        for table in tables.time_constant_tables(mine):
            console.print(f"\n[bold]{words(recording.name)}: {words(table.title)}[/]")
            print_table(laid_out(table), wide)
    for table in tables.positioning_tables(found.positioned):
        console.print(f"\n[bold]{words(table.title)}[/]")
        print_table(laid_out(table), wide)
    for r in found.positioned:
        for note in r.notes:
            where = " ".join(part for part in (r.test.axis, r.test.state) if part)
            console.print(f"[yellow]note[/] {words(f'{where}: {note}' if where else note)}")
