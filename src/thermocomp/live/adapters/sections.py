"""Sections of a configuration for what needs no network: the virtual machine, a recording, a file, LinuxCNC.

A section names what it makes: an entry point of ``thermocomp.sources`` or ``thermocomp.sinks`` leads from its ``kind``
to its class. The adapter itself is imported when it is opened.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from thermocomp.core.exceptions import SettingError
from thermocomp.core.ports import Sink, Source

Names = dict[str, str]


class SourceSection(Protocol):
    """A table ``[[sources]]``: a frozen dataclass with a literal ``kind`` and a default for what may be left out."""

    @property
    def kind(self) -> str:
        """Name of the entry point."""

    def open(self, folder: Path, speed: float) -> Source:
        """Make the source; it connects later.

        Parameters
        ----------
        folder : Path
            Folder of the configuration: relative paths start from there.
        speed : float
            Seconds of the machine in a second of the world, for what is played back.
        """


class SinkSection(Protocol):
    """A table ``[[sinks]]``: a frozen dataclass with a literal ``kind`` and a default for what may be left out."""

    @property
    def kind(self) -> str:
        """Name of the entry point."""

    def open(self, folder: Path) -> Sink:
        """Make the sink; it connects later."""


@dataclass(frozen=True, kw_only=True)
class SimulatedIn:
    """The virtual machine.

    Parameters
    ----------
    kind : {'simulated'}
    experiment : str
        Experiment to run: one included in the package, or a protocol (.toml).
    seed : int
        Random seed of weather and noise.
    """

    kind: Literal["simulated"]
    experiment: str = "demo"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise SettingError(f"seed = {self.seed}: expected 0 or more")

    def open(self, folder: Path, speed: float) -> Source:
        """Make the source."""
        from thermocomp.live.adapters.plain import SimulatedSource, find_experiment

        return SimulatedSource(experiment=find_experiment(self.experiment, folder), seed=self.seed, speed=speed)


@dataclass(frozen=True, kw_only=True)
class ReplayIn:
    """A recording played back.

    Parameters
    ----------
    kind : {'replay'}
    file : str
        In thermocomp's own CSV.
    """

    kind: Literal["replay"]
    file: str

    def open(self, folder: Path, speed: float) -> Source:
        """Make the source."""
        from thermocomp.live.adapters.plain import ReplaySource

        return ReplaySource(path=folder / self.file, speed=speed)


@dataclass(frozen=True, kw_only=True)
class SimulatedProbing:
    """Probings of the virtual machine.

    Parameters
    ----------
    kind : {'simulated'}
    every : float
        Time of the machine between two [s].
    repeatability : float
        Repeatability of the probe, standard deviation [um].
    """

    kind: Literal["simulated"]
    every: float = 7200.0
    repeatability: float = 0.5

    def __post_init__(self) -> None:
        if not self.every > 0 or not self.repeatability >= 0:
            raise SettingError(
                f"every = {self.every:g}, repeatability = {self.repeatability:g}: expected more than 0 s and at "
                "least 0 um"
            )


@dataclass(frozen=True, kw_only=True)
class LinuxCncOut:
    """Corrections to a LinuxCNC on this computer.

    Parameters
    ----------
    kind : {'linuxcnc'}
    socket : str
        Socket of the HAL component that ``thermocomp linuxcnc setup`` installs.
    axes : dict of str to str
        Axis by target, such as ``{z_um = "Z"}``.
    """

    kind: Literal["linuxcnc"]
    socket: str
    axes: Names

    def __post_init__(self) -> None:
        letters = [a.upper() for a in self.axes.values()]
        if not letters or set(letters) - set("XYZUVW") or len(set(letters)) < len(letters):
            raise SettingError(f'axes = {self.axes}: expected a linear axis for each target, such as {{z_um = "Z"}}')

    def open(self, folder: Path) -> Sink:
        """Make the sink."""
        from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

        return LinuxCncSink(path=folder / self.socket, axes=dict(self.axes))


@dataclass(frozen=True, kw_only=True)
class FileOut:
    """Corrections to a file.

    Parameters
    ----------
    kind : {'file'}
    file : str
        Replaced as a whole each time.
    """

    kind: Literal["file"]
    file: str

    def open(self, folder: Path) -> Sink:
        """Make the sink."""
        from thermocomp.live.adapters.plain import FileSink

        return FileSink(path=folder / self.file)
