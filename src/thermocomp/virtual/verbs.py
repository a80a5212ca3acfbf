"""Python functions that record experiments on the virtual machines."""

from collections.abc import Callable
from pathlib import Path

from thermocomp.api.keywords import Listener, silent
from thermocomp.recordings.recording import Recording
from thermocomp.virtual import datasets
from thermocomp.virtual.protocol import Experiment, Physics


def simulate(
    experiment: str | Path = "demo",
    *,
    physics: Physics | None = None,
    seed: int = 0,
    noise: float | None = None,
    progress: Callable[..., None] = silent,
) -> list[Recording]:
    """Record an experiment on a virtual machine.

    Parameters
    ----------
    experiment : str or Path
        A custom protocol, as a path that ends in .toml, or one of: chen1996, chen1996-law, chen1996-new,
        chen1996-slope, demo, etve, hwang, iso230-axis, iso230-spindle, precompensation, precompensation-cut, probing,
        random, stepwise2017, stepwise2017-online, volumetric, volumetric-new, wessel-fem, wessel-milling, wessel-sets,
        wessel-tool.
    physics : {'linear', 'nonlinear'}, optional
        Physics of the machine: joints, bearings and convection with constant conductances (linear), or depending on
        temperature and speed (nonlinear). Default: as defined by the experiment.
    seed : int
        Random seed of the weather, the noise and all other random draws.
    noise : float, optional
        Standard deviation of the temperature noise [degC]. Default: that of the sensor.
    progress : callable
        Called with the name of each completed test.

    Returns
    -------
    list of Recording
        One per test.

    Raises
    ------
    InputError
        There is no such experiment.

    Examples
    --------
    >>> import thermocomp as tc
    >>> (recording,) = tc.simulate("hwang", seed=1)
    >>> recording
    <Recording hwang: 37 rows, 6.0 h, 14 temperatures, 1 displacements, 4 thermal cycle(s)>
    """
    found = datasets.find_experiment(experiment)
    Listener(progress).begin(lambda: len(found.names))
    return datasets.record(found, physics=physics, seed=seed, sensor_noise=noise, progress=progress)


def experiments() -> list[Experiment]:
    """Return the experiments included in the package."""
    return [datasets.find_experiment(name) for name in datasets.EXPERIMENTS]
