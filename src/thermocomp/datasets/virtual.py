"""Recordings of the virtual machine tool."""

import pandas as pd

from thermocomp.recording.cycles import find_cycles, whole
from thermocomp.recording.recording import Recording
from thermocomp.simulation.experiments import simulate


def record(experiment: str, *, seed: int = 0, sensor_noise: float | None = None) -> list[Recording]:
    """Run an experiment on the virtual machine tool.

    Parameters
    ----------
    experiment : str
        Name of an experiment, see `thermocomp.simulation.experiments.EXPERIMENTS`.
    seed : int
        Of the sensors' noise.
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC]; the sensors' own if not given.

    Returns
    -------
    list of Recording
        One per test.

    Raises
    ------
    InputError
        There is no such experiment.
    """
    recordings = []
    for test in simulate(experiment, seed=seed, sensor_noise=sensor_noise):
        table = pd.DataFrame(test.values, columns=[c.name for c in test.channels])
        speeds = [c.name for c in test.channels if c.quantity == "spindle_speed"]
        cycles = find_cycles(test.time, table[speeds[0]].to_numpy()) if speeds else whole(len(table))
        recordings.append(Recording(test.name, test.time, table, test.channels, cycles))
    return recordings
