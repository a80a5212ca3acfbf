"""``thermocomp iso230``: thermal tests (ISO 230-3), positioning (ISO 230-2) and time constants."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.reading import read_recordings
from thermocomp.cli.terminal import console, make_console, print_table, words
from thermocomp.core.exceptions import RecordingError
from thermocomp.iso230 import tables
from thermocomp.iso230.thermaltest import TITLES
from thermocomp.iso230.verbs import Evaluated
from thermocomp.report.layout import laid_out

if TYPE_CHECKING:
    from thermocomp.recordings.recording import Recording

Tables = Annotated[list[Path], Parameter(show_default=False)]

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
        Output page with tables and figures (.html).

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    face.write(found.report)
    face.show(found.to_dict, partial(_show, found, face.output))
    return 0


def _show(found: Evaluated, page: Path | None) -> None:
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
    if page is not None:
        console.print(f"Page: {words(page)}", soft_wrap=True)
