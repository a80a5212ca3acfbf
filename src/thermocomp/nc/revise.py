"""Python function for the command `thermocomp revise`."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from thermocomp.core.exceptions import InputError
from thermocomp.nc.revision import outcome
from thermocomp.nc.revision.job import revise as revise_program
from thermocomp.nc.revision.options import Controller, Timing, Way
from thermocomp.nc.revision.prepare import prepare_job
from thermocomp.nc.revision.thermaloptions import Drifting, Starting

#: groups of options of the command; their fields are the keywords of `revise`
GROUPS = (Drifting, Starting, Way, Controller, Timing)
#: option names whose values are file paths
_PATHS = ("model", "forecast", "carried", "machine", "subroutines")


@dataclass(frozen=True, eq=False, repr=False)
class RevisedProgram:
    """Result of a revision of an NC program.

    Parameters
    ----------
    path : Path
        Path of the revised program.
    written : bool
        Whether files were written; False: no correction was needed.
    files : tuple of Path
        All files written.
    summary : dict
        Summary, as printed by ``thermocomp revise --json``.
    """

    path: Path
    written: bool
    files: tuple[Path, ...]
    summary: dict[str, Any]

    def __repr__(self) -> str:
        return f"<RevisedProgram: {self.path if self.written else 'nothing was corrected, nothing was written'}>"


def revise(
    program: str | Path,
    model: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    overwrite: bool = False,
    date: str | None = None,
    **words: Any,
) -> RevisedProgram:
    r"""Correct an NC program for the thermal drift it will cause, before it is run.

    Parameters
    ----------
    program : str or Path
        NC program to correct.
    model : str, Path, or sequence of them
        Model files of `fit`.
    output : str or Path
        Output program.
    overwrite : bool
        Overwrite existing files, but never the original program.
    date : str, optional
        Date for the header. Default: today.
    **words
        The options of ``thermocomp revise`` with underscores: ``cold=True``, ``controller="fanuc"``,
        ``axis=["ch3=Z"]``.

    Returns
    -------
    RevisedProgram

    Raises
    ------
    InputError
        An option, the program or another input is invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> import thermocomp as tc
    >>> learned, _ = tc.simulate("precompensation")
    >>> fitted = tc.fit(
    ...     learned, "z_at_0_um", "dynamic", inputs="spindle_rpm", accept_unproven="M. Weber, trial on machine 7"
    ... )
    >>> fitted.save("speed.json").name
    'speed.json'
    >>> lines = ["G21 G90 G94 G54", "S4000 M3", "G0 X0 Y0 Z5", "G1 Z-1 F100", "X50", "G0 Z50", "M2"]
    >>> _ = Path("part.ngc").write_text("\n".join(lines))
    >>> options = {"controller": "linuxcnc", "axis": ["z_at_0_um=Z"], "cold": True, "unproved": True}
    >>> done = tc.revise("part.ngc", "speed.json", "revised.ngc", **options)
    >>> done.summary["changed"], f"{done.summary['axes'][0]['left_um']:.1f} um"  # lines changed, drift left
    (2, '0.1 um')
    >>> print("\n".join(Path("revised.ngc").read_text().splitlines()[-4:]))
    G1 Z-1 F100
    X50 Z-0.9984
    G0 Z50.0016
    M2
    """
    models = [model] if isinstance(model, str | Path) else list(model)
    given = {"model": models, **words}
    for name in given.keys() & set(_PATHS):
        value = given[name]
        given[name] = [Path(v) for v in value] if isinstance(value, list | tuple) else value and Path(value)
    known = {f.name for group in GROUPS for f in fields(group)}
    for name in given.keys() - known:
        near = get_close_matches(name, known, n=3, cutoff=0.5)
        raise InputError(f"revise: there is no option {name!r}; the nearest are {', '.join(near) or ', '.join(known)}")
    groups: list[Any] = [group(**{f.name: given[f.name] for f in fields(group) if f.name in given}) for group in GROUPS]
    job, notes = prepare_job(Path(program), Path(output), *groups, when=date, overwrite=overwrite)
    done = revise_program(job, lambda _: nullcontext(lambda *_: None))
    files = tuple(job.paths.all()) if done.written else ()
    return RevisedProgram(Path(output), done.written, files, outcome.content(job, done, notes))
