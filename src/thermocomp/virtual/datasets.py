"""Recordings of the virtual machines."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import pandas as pd

from thermocomp.core.exceptions import InputError, explain_unknown
from thermocomp.recordings.cycles import find_cycles, make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.experiments import SimulatedTest, simulate
from thermocomp.virtual.protocol import Experiment, Physics
from thermocomp.virtual.protocolfile import read_protocol
from thermocomp.virtual.sensors import SensorFault

_FOLDER = Path(__file__).parent / "protocols"
_FILES = {path.stem: path for path in sorted(_FOLDER.glob("*.toml"), key=lambda path: path.stem)}


class _BuiltIn(Mapping[str, Experiment]):
    """Experiments included in the package; each file is read once, on first access."""

    def __getitem__(self, name: str) -> Experiment:
        return _read(_FILES[name])

    def __iter__(self) -> Iterator[str]:
        return iter(_FILES)

    def __len__(self) -> int:
        return len(_FILES)


_read = cache(read_protocol)
#: experiments included in the package, by name
EXPERIMENTS: Mapping[str, Experiment] = _BuiltIn()


def find_experiment(experiment: str | Path) -> Experiment:
    """Return an experiment by its name, or from a custom file."""
    if Path(experiment).suffix == ".toml":
        return read_protocol(experiment)
    if str(experiment) not in EXPERIMENTS:
        message = explain_unknown("experiment", str(experiment), EXPERIMENTS)
        raise InputError(f"{message}; name a custom protocol by its file, such as my_test.toml")
    return EXPERIMENTS[str(experiment)]


def record(
    experiment: str | Path | Experiment,
    *,
    physics: Physics | None = None,
    mounting: str = "",
    seed: int = 0,
    sensor_noise: float | None = None,
    faults: Sequence[SensorFault] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> list[Recording]:
    """Run an experiment on a virtual machine.

    Parameters
    ----------
    physics : {'linear', 'nonlinear'}, optional
        Physics of the machine. Default: as defined by the experiment. See :doc:`/virtual_machine`.
    mounting : str
        Chuck of the resting tool in all tests: hydraulic, shrink or collet. Default: as defined by the experiment.
    sensor_noise : float, optional
        Standard deviation of the temperature noise [degC]. Default: as defined for each sensor.
    """
    found = experiment if isinstance(experiment, Experiment) else find_experiment(experiment)
    if physics is not None:
        found = replace(found, physics=physics)
    if mounting:
        found = replace(found, tests=tuple(replace(t, mounting=mounting) for t in found.tests))
    recordings = []
    for test in simulate(found, seed=seed, sensor_noise=sensor_noise, faults=faults):
        recordings.append(make_recording(test))
        progress(test.name)
    return recordings


def make_recording(test: SimulatedTest) -> Recording:
    """Return a simulated test as a recording, split into its thermal cycles."""
    table = pd.DataFrame(test.values, columns=[c.name for c in test.channels])
    speeds = [c.name for c in test.channels if c.quantity == "spindle_speed"]
    cycles = find_cycles(test.time, table[speeds[0]].to_numpy()) if speeds else make_single_cycle(len(table))
    return Recording(name=test.name, time=test.time, table=table, channels=test.channels, cycles=cycles)
