"""``thermocomp position``: position-dependent errors from profiles in several thermal states."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from thermocomp.cli import loudness, progress
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.reading import tell_trouble
from thermocomp.cli.terminal import console
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import refuse_existing
from thermocomp.volumetric.positionsettings import PositionSettings

Switch = Annotated[bool | None, Parameter(negative="--no-offset")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Fitting(PositionSettings):  # noqa: D101 - that of the settings, which the help is made from
    __doc__ = PositionSettings.__doc__

    offset: Switch = None


def position(
    recordings: list[Path],
    /,
    *,
    component: list[str],
    settings: Fitting = Fitting(),
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
    settings : Fitting
        How it is fitted and judged.
    accept_unproven : str
        Person who approves the use of an unproven model, and the reason: "NAME, REASON"; kept in
        the model file.
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
    from thermocomp.volumetric.commands import positiontables
    from thermocomp.volumetric.position import prepare

    if settings.jobs == 0:
        raise InputError("--jobs 0: name a number of processes, or -1 for all cores")
    job = prepare(recordings, component, settings)
    loudness.tell_read(job.recordings)
    trouble = tell_trouble(job.recordings)
    with progress.show_steps(job.n_pieces, hidden=json) as tell:
        result = job.run(tell)
    if output is not None:
        result.save(output, accept_unproven=accept_unproven, overwrite=overwrite)
    if json:
        file = None if output is None else str(output)
        print_json({"trouble": trouble, **result.content(), "file": file})
    else:
        positiontables.show_positioned(result, output, console)
    return 1 if any(f.assessment.verdict.word == "refused" for f in result.found) else 0
