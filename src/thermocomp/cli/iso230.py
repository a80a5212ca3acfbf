"""``thermocomp iso230``: thermal tests (ISO 230-3), positioning (ISO 230-2) and time constants."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter
from rich.console import Console
from rich.markup import escape

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import (
    Compensator,
    OptionalOutput,
    read_recordings,
    tell_trouble,
)
from thermocomp.core.exceptions import InputError, RecordingError, UnitError
from thermocomp.core.units import measured
from thermocomp.files.draft import refuse_existing

if TYPE_CHECKING:
    from thermocomp.iso230.part2 import PositioningResult
    from thermocomp.iso230.settling import Settling
    from thermocomp.iso230.thermaltest import Pair, ThermalTest
    from thermocomp.recording.recording import Recording

Tables = Annotated[list[Path], Parameter(show_default=False)]
Test = Literal["etve", "spindle", "axis"]

_console = Console(highlight=False)
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
    compensator: Compensator = Compensator(),  # noqa: B008 - frozen
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
    compensator : Compensator
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
    with needs("study"):
        from thermocomp.files import modelfile
        from thermocomp.files import positioning as positioning_files
        from thermocomp.iso230 import part2, part3
        from thermocomp.iso230.settling import Phase, find_phases, time_constants
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
    models = modelfile.read(model) if model is not None else ()
    start, limits = beginning.of(tests, mapping), compensator.limits()
    thermal: list[ThermalTest] = []
    settlings: list[tuple[Recording, tuple[Settling, ...]]] = []
    for recording in tests:
        paired = _pairs(recording, distance, pairs)
        mine = part3.assess(recording, test, pairs=paired, ambient=ambient, models=models, start=start, limits=limits)
        # where nothing was recorded of the drives, a test is told to be a warm-up
        phases = find_phases(recording) or tuple(Phase("warm-up", 1, t.start, t.stop) for t in mine if t.kind != "etve")
        thermal += mine
        settlings.append((recording, time_constants(recording, phases, part3.find_stations(recording))))
    positioned = [part2.assess(p) for path in positioning for p in positioning_files.read(path)]
    if output is not None:
        with needs("study"):
            from thermocomp.report import iso230 as pages
        pages.write(thermal, settlings, positioned, output)
    if json:
        _print_json(thermal, settlings, positioned, trouble)
    else:
        _show(thermal, settlings, positioned, output)
    return 0


def length(text: str, what: str) -> float:
    """Return a length in mm from a text such as ``100 mm``.

    Raises
    ------
    InputError
        It is no number with a unit of length.
    """
    try:
        found = measured(text, "position")
    except UnitError as e:
        raise InputError(f"{what} {text!r}: {e}") from e
    if found is None or found < 0:
        raise InputError(f'{what} {text!r}: write a number and its unit, such as "100 mm"')
    return found


def _pairs(recording: "Recording", distance: str | None, pairs: list[str] | None) -> "tuple[Pair, ...]":
    from thermocomp.iso230 import part3
    from thermocomp.iso230.thermaltest import Pair

    if pairs:
        found = []
        for text in pairs:
            parts = text.split(":")
            if len(parts) != 3:
                raise InputError(
                    f"--pairs {text!r}: write the probe at the tip, the one nearer to the spindle and their distance, "
                    "such as x1:x2:100mm"
                )
            tip, spindle = (part3.find_probe(recording, name.strip()) for name in parts[:2])
            found.append(Pair(tip, spindle, length(parts[2], f"--pairs {text!r}: distance")))
        return tuple(found)
    if distance is None:
        return ()
    paired = part3.find_pairs(recording, length(distance, "--distance"))
    if not paired:
        raise InputError(
            f"--distance: {recording.name} has no probes named x1 and x2, or y1 and y2; name them by --pairs "
            f"TIP:SPINDLE:DISTANCE, of {', '.join(c.name for c in recording.displacements)}"
        )
    return paired


def _show(
    thermal: "list[ThermalTest]",
    settlings: "list[tuple[Recording, tuple[Settling, ...]]]",
    positioned: "list[PositioningResult]",
    page: Path | None,
) -> None:
    from thermocomp.cli.terminal import print_table
    from thermocomp.iso230 import tables
    from thermocomp.iso230.thermaltest import TITLES
    from thermocomp.report.layout import laid_out

    # numbers must not be cut: a narrow terminal wraps whole lines instead
    wide = Console(highlight=False, width=max(_console.width, TABLE_WIDTH))
    for t in thermal:
        _console.print(f"\n[bold]{escape(t.name)}: {TITLES[t.kind]}[/]")
        _console.print(escape(t.described))
        for table in tables.thermal_tables(t):
            _console.print(f"\n[bold]{escape(table.title)}[/]")
            print_table(laid_out(table), wide)
        for note in t.notes:
            _console.print(f"[yellow]note[/] {escape(note)}")
    for recording, mine in settlings:
        for table in tables.time_constant_tables(mine):
            _console.print(f"\n[bold]{escape(recording.name)}: {escape(table.title)}[/]")
            print_table(laid_out(table), wide)
    for table in tables.positioning_tables(positioned):
        _console.print(f"\n[bold]{escape(table.title)}[/]")
        print_table(laid_out(table), wide)
    for r in positioned:
        for note in r.notes:
            where = " ".join(part for part in (r.test.axis, r.test.state) if part)
            _console.print(f"[yellow]note[/] {escape(f'{where}: {note}' if where else note)}")
    if page is not None:
        _console.print(f"Page: {page}", soft_wrap=True)


def _print_json(
    thermal: "list[ThermalTest]",
    settlings: "list[tuple[Recording, tuple[Settling, ...]]]",
    positioned: "list[PositioningResult]",
    trouble: list[str],
) -> None:
    from thermocomp.iso230 import tables

    content = {
        "trouble": trouble,
        "thermal": [tables.thermal_content(t) for t in thermal],
        "time_constants": [
            {"recording": r.name, "channels": [tables.settling_content(s) for s in mine]} for r, mine in settlings
        ],
        "positioning": [tables.positioning_content(r) for r in positioned],
    }
    print_json(content, _console)
