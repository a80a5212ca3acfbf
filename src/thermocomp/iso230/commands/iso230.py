"""``thermocomp iso230``: thermal tests (ISO 230-3), positioning (ISO 230-2) and time constants."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import CompensatorOptions, OptionalOutput
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.cli.terminal import console, make_console, print_table, words
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.files.draft import refuse_existing

if TYPE_CHECKING:
    from thermocomp.iso230.verbs import Evaluated

Tables = Annotated[list[Path], Parameter(show_default=False)]
Test = Literal["etve", "spindle", "axis"]

#: columns that the widest table needs
TABLE_WIDTH = 136


def iso230(
    recordings: list[Path] = [],  # noqa: B006 - never changed
    /,
    *,
    test: Test | None = None,
    distance: str | None = None,
    pairs: list[str] | None = None,
    ambient: str | None = None,
    model: Path | None = None,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    positioning: Tables = [],  # noqa: B006 - never changed
    mapping: Path | None = None,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Evaluate thermal tests after ISO 230-3 and positioning tests after ISO 230-2, and the time constants of channels.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files of thermal tests.
    test : str
        What they are: etve (machine at rest), spindle, or axis. Found out if not given: the spindle turns, else an
        axis moves, else neither.
    distance : str
        Between the probes x1 and x2, and y1 and y2, such as "100 mm"; without it no tilt is told.
    pairs : list of str
        Probes of other names: the one at the tip of the test bar, the one nearer to the spindle, and their distance,
        such as x_front:x_rear:100mm.
    ambient : str
        Temperature of the surroundings; the first whose name says air, ambient or room if not given.
    model : Path
        Model file from thermocomp fit: what it leaves of each displacement is told beside it.
    compensator : CompensatorOptions
        Its limits: what it would leave is told, not what the model alone would.
    beginning : Beginning
        How the recordings begin; it matters to a model.
    positioning : list of Path
        CSV tables of positioning tests, with the columns position_mm, deviation_um, direction (+ or -), run, and if
        there are several, state and axis.
    mapping : Path
        TOML file that says what the columns of the recordings are.
    output : Path
        Page with tables and figures to write (.html).
    overwrite : bool
        Write over an existing page.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    if not recordings and not positioning:
        raise InputError("nothing given: name a recording of a thermal test, or a table by --positioning")
    if not recordings:
        asked = {"--test": test, "--distance": distance, "--pairs": pairs, "--ambient": ambient, "--model": model}
        for option in (o for o, value in asked.items() if value is not None):
            raise InputError(f"{option} is for recordings of thermal tests: name one")
    if distance is not None and pairs:
        raise InputError("--distance is for probes named x1, x2, y1, y2; those of --pairs carry their own")
    from thermocomp.files import modelfile
    from thermocomp.iso230.verbs import evaluate

    given = [Path(p) for p in (model, mapping) if p is not None]
    if output is not None:
        refuse_existing([output], overwrite, [*recordings, *positioning, *given], ".html")
    try:
        tests = read_recordings(recordings, mapping) if recordings else []
    except RecordingError as e:
        if "no time column" in str(e):
            raise RecordingError(f"{e}; a table of a positioning test is named by --positioning") from e
        raise
    trouble = tell_trouble(tests)
    found = evaluate(
        tests,
        test=test,
        distance=distance,
        pairs=pairs,
        ambient=ambient,
        models=modelfile.read(model) if model is not None else (),
        start=beginning.of(tests, mapping),
        limits=compensator.value(),
        positioning=positioning,
    )
    if output is not None:
        found.report(output, overwrite=overwrite)
    if json:
        print_json({"trouble": trouble, **found.content()})
    else:
        _show(found, output)
    return 0


def _show(found: "Evaluated", page: Path | None) -> None:
    from thermocomp.iso230 import tables
    from thermocomp.iso230.thermaltest import TITLES
    from thermocomp.report.layout import laid_out

    # numbers must not be cut: a narrow terminal wraps whole lines instead
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
