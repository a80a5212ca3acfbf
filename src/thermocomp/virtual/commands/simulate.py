"""`thermocomp simulate`: an experiment on a virtual machine."""

from typing import Annotated, Literal

from cyclopts import Parameter

from thermocomp.cli.options import OptionalOutput, Quiet
from thermocomp.cli.progress import show_steps
from thermocomp.cli.terminal import console
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import refuse_existing


def simulate(
    experiment: str | None = None,
    *,
    output: OptionalOutput = None,
    list_: Annotated[bool, Parameter(name="--list")] = False,
    physics: Literal["linear", "nonlinear"] | None = None,
    seed: int = 0,
    noise: float | None = None,
    overwrite: bool = False,
    json: bool = False,
    quiet: Quiet = False,
) -> int:
    """Record an experiment on a virtual machine.

    Parameters
    ----------
    experiment : str
        A protocol of your own, as a path that ends in .toml, or one of: chen1996, chen1996-law, chen1996-new,
        chen1996-slope, demo, etve, hwang, iso230-axis, iso230-spindle, precompensation, precompensation-cut, probing,
        random, stepwise2017, stepwise2017-online, volumetric, volumetric-new, wessel-fem, wessel-milling, wessel-sets,
        wessel-tool.
    output : Path
        File to write (.parquet or .csv); an experiment of several tests gets one file per test.
    list_ : bool
        List the experiments and what they are.
    physics : {'linear', 'nonlinear'}
        Of the machine: joints, bearings and films by constant conductances, or as they depend on temperature and speed.
        What the experiment says if not given.
    seed : int
        Of weather, noise, and what is drawn by lot.
    noise : float
        Standard deviation of the temperature noise [degC]; the sensor's own if not given.
    overwrite : bool
        Write over existing files.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 done.
    """
    from thermocomp.recordings.readers import recordings
    from thermocomp.virtual import datasets as virtual
    from thermocomp.virtual.commands import output as out

    if list_:
        out.show_experiments([virtual.find_experiment(name) for name in virtual.EXPERIMENTS], console, as_json=json)
        return 0
    if experiment is None or output is None:
        raise InputError("name an experiment and a file: thermocomp simulate demo -o drift.parquet; see --list")
    found = virtual.find_experiment(experiment)
    n_tests = len(found.names)
    paths = (
        [output]
        if n_tests == 1
        else [output.with_name(f"{output.stem}-{k}{output.suffix}") for k in range(1, n_tests + 1)]
    )
    refuse_existing(paths, overwrite)
    with show_steps(n_tests, hidden=json or quiet) as progress:
        tests = virtual.record(found, physics=physics, seed=seed, sensor_noise=noise, progress=progress)
    for test, path in zip(tests, paths, strict=True):
        recordings.write(test, path, overwrite=overwrite)
    if not quiet:
        out.show_simulated(tests, paths, console, as_json=json)
    return 0
