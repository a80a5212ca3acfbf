"""Recordings of the virtual machine, in Python."""

from pathlib import Path

from thermocomp.recordings.recording import Recording
from thermocomp.virtual import datasets
from thermocomp.virtual.protocol import Physics


def simulate(
    experiment: str | Path = "demo",
    *,
    physics: Physics | None = None,
    seed: int = 0,
    noise: float | None = None,
) -> list[Recording]:
    """Record an experiment on a virtual machine.

    Parameters
    ----------
    experiment : str or Path
        One that comes with the package, such as ``demo``, or a protocol of one's own (.toml).
    physics : {'linear', 'nonlinear'}, optional
        Of the machine; what the experiment says without it.
    seed : int
        Of weather and noise.
    noise : float, optional
        Standard deviation of the temperature noise [degC]; the sensor's own without it.

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
    return datasets.record(experiment, physics=physics, seed=seed, sensor_noise=noise)
