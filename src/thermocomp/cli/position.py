"""``thermocomp position``: position-dependent errors from profiles in several thermal states."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from thermocomp.cli import progress
from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import (
    OptionalOutput,
    Study,
    tell_trouble,
)
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import refuse_existing

if TYPE_CHECKING:
    from thermocomp.recording.profiles import Profiles

Switch = Annotated[bool | None, Parameter(negative="--no-offset")]

#: stands for every component that has columns of its own
ALL = "all"
#: with so many recordings each is left out in turn, else each thermal cycle
MANY = 3

_console = Console(highlight=False)


def position(
    recordings: list[Path],
    /,
    *,
    component: list[str],
    columns: str = "",
    positions: Path | None = None,
    layout: Literal["wide", "long"] | None = None,
    mapping: Path | None = None,
    model: str = "dynamic",
    inputs: list[str] | None = None,
    slopes: int | None = None,
    offset: Switch = None,
    profile: Literal["polynomial", "spline"] = "polynomial",
    order: int | None = None,
    reference: list[int] | None = None,
    reference_position: float | None = None,
    split: str | None = None,
    leave_one_cycle_out: bool = False,
    leave_one_file_out: bool = False,
    absolute: bool = False,
    jobs: int = -1,
    accept_unproven: str | None = None,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Fit position-dependent errors: cold profiles and thermal slopes, judged on what they have not seen.

    Settings that are not given are found out from the profiles, and anew wherever a part is left out: how many slopes
    are worth it, whether the profile shifts as a whole, and about which position it turns.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files with profiles in several thermal states; each is one test.
    component : list of str
        Codes of the errors, such as EYY, EXX or EAZ, or all that have columns of their own: a code says along which
        axis and in which unit. One file holds the models of all.
    columns : str
        Names of the columns of one component, * standing for the position in mm, such as 'y_laser_*'; of a long table
        the column of the error. Without it those that are called after the component, such as EYY_250_um, or else
        those that end in a position and the unit, such as y_laser_250_um.
    positions : Path
        TOML file that says where each column was measured, for columns that have no position in their name.
    layout : str
        wide: a row per thermal state, a column per position; long: a row per position. Found out if not given.
    mapping : Path
        TOML file that says what the columns are.
    model : str
        Method for the slopes, as in ``thermocomp compare``, all but gp.
    inputs : list of str
        Channels to predict the slopes from; all temperatures and the spindle speed if not given.
    slopes : int
        Highest power of the position; 0: the cold profile alone. As many as are worth it if not given.
    offset : bool
        Model a shift of the whole profile too. If not given: where it is more than noise.
    profile : str
        polynomial or spline, for the cold profile.
    order : int
        Of the polynomial, or number of knots of the spline; chosen by points left out if not given.
    reference : list of int
        States of each test that count as cold, from 0: their mean is the cold profile. The first if not given.
    reference_position : float
        Where the slopes turn [mm]; where the thermal part is smallest if not given.
    split : str
        Judge by time: shares of the states such as 0.6/0.4, or hours such as 10h/6h.
    leave_one_cycle_out : bool
        Judge on each thermal cycle in turn (what is done with fewer than three recordings, if nothing is said).
    leave_one_file_out : bool
        Judge on each recording in turn (what is done with three and more).
    absolute : bool
        Count all tests from one cold state, the mean of theirs, with temperatures as they are: for a machine that is
        not the same every morning. Without it each test counts from its own.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    accept_unproven : str
        Who takes an unproven model all the same, and why: "NAME, REASON". It is written into the model file.
    output : Path
        File to write the models to (.json).
    overwrite : bool
        Write over an existing file.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 1 a model was refused, 2 unusable input.
    """
    if not recordings:
        raise InputError("no recording given: name at least one CSV, XLSX or Parquet file")
    if output is not None:
        refuse_existing([output], overwrite, recordings, ".json")
    with needs("study"):
        from thermocomp.assessment import position as assessing
        from thermocomp.cli import positiontables as told
        from thermocomp.files import positionfile
        from thermocomp.models.methods import method
        from thermocomp.models.position import PositionOptions
        from thermocomp.models.positionoptions import Setting
        from thermocomp.report import records
    if jobs == 0:
        raise InputError("--jobs 0: name a number of processes, or -1 for all cores")
    if not method(model).kind.freezable:
        raise InputError(f"{model} cannot be frozen to plain numbers: choose another method")
    several = len(component) > 1 or ALL in component
    tests = _read(recordings, component, columns, positions, mapping, layout)
    trouble = tell_trouble([test.states for test in tests[0]])
    how = PositionOptions(
        method=model,
        inputs=inputs,
        slopes=1 if slopes is None else slopes,
        offset=bool(offset),
        profile=profile,
        order="auto" if order is None else order,
        reference=reference or 0,
        reference_position=reference_position,
        rezero=not absolute,
    )
    given: dict[Setting, object] = {"slopes": slopes, "offset": offset, "reference_position": reference_position}
    left_open = tuple(name for name, value in given.items() if value is None)
    by_file = leave_one_file_out or (len(recordings) >= MANY and split is None and not leave_one_cycle_out)
    asked = Study(
        target=component,
        split=split,
        leave_one_file_out=by_file,
        leave_one_cycle_out=leave_one_cycle_out,
        jobs=jobs,
    )
    with progress.by_steps(assessing.n_pieces(tests, how, asked.judging), hidden=json) as tell:
        found = assessing.study_all(tests, how, left_open=left_open, judging=asked.judging, jobs=jobs, progress=tell)
    if output is not None:
        positionfile.write([f.fit.model.taken(accept_unproven or "") for f in found], output, overwrite=overwrite)
    if json:
        entries = [records.position(f, left_open) for f in found]
        content = {"components": entries} if several else entries[0]
        file = None if output is None else str(output)
        print_json({"trouble": trouble, "judging": found[0].assessment.protocol, **content, "file": file}, _console)
    else:
        if several:
            told.show_all(found, tests, left_open, _console)
        else:
            told.show(found[0], tests[0], left_open, _console)
        if output is not None:
            _console.print(f"Model file: {output}", soft_wrap=True)
    return 1 if any(f.assessment.verdict.word == "refused" for f in found) else 0


def _read(
    paths: list[Path],
    components: list[str],
    columns: str,
    positions: Path | None,
    mapping: Path | None,
    layout: Literal["wide", "long"] | None,
) -> "list[tuple[Profiles, ...]]":
    """Read one component, however its columns are called, or several by columns that are called after them."""
    with needs("study"):
        from thermocomp.files import mapping as mappings
        from thermocomp.files import profiles as tables
    given = mappings.read_mapping(mapping) if mapping is not None else None
    if len(components) > 1 or ALL in components:
        if columns or positions is not None or layout == "long":
            raise InputError(
                "--columns, --positions and long tables are for one component: name a single one, or call the columns "
                "after their components, such as EXX_250_um"
            )
        wanted = [] if ALL in components else list(dict.fromkeys(components))
        return list(tables.read_components(paths, wanted, given).values())
    places = tables.read_places(positions) if positions is not None else None
    options = tables.ProfileOptions(target=components[0], columns=columns, places=places)
    return [tuple(tables.read(path, options, given, layout=layout) for path in paths)]
