"""Configuration sections of adapters without a network: virtual machine, recording, file, LinuxCNC.

The ``kind`` of a section is the name of an entry point of ``thermocomp.sources`` or ``thermocomp.sinks``, which names
its class. The adapter itself is imported when it is opened.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from thermocomp.core.exceptions import SettingError
from thermocomp.core.ports import Sink, Source

Names = dict[str, str]


class SourceSection(Protocol):
    """A table ``[[sources]]``: a frozen dataclass with a literal ``kind`` and defaults for optional keys."""

    @property
    def kind(self) -> str:
        """Name of the entry point."""

    def open(self, folder: Path, speed: float) -> Source:
        """Create the source; it connects later."""


class SinkSection(Protocol):
    """A table ``[[sinks]]``: a frozen dataclass with a literal ``kind`` and defaults for optional keys."""

    @property
    def kind(self) -> str:
        """Name of the entry point."""

    def open(self, folder: Path) -> Sink:
        """Create the sink; it connects later."""


@dataclass(frozen=True, kw_only=True)
class SimulatedIn:
    """Configuration of the virtual machine as a source.

    Parameters
    ----------
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
        """Create the source; it connects later."""
        from thermocomp.live.adapters.plain import SimulatedSource, find_experiment

        return SimulatedSource(experiment=find_experiment(self.experiment, folder), seed=self.seed, speed=speed)


@dataclass(frozen=True, kw_only=True)
class ReplayIn:
    """Configuration of a recording played back as a source.

    Parameters
    ----------
    file : str
        File in thermocomp's own CSV format.
    """

    kind: Literal["replay"]
    file: str

    def open(self, folder: Path, speed: float) -> Source:
        """Create the source; it connects later."""
        from thermocomp.live.adapters.plain import ReplaySource

        return ReplaySource(path=folder / self.file, speed=speed)


@dataclass(frozen=True, kw_only=True)
class SimulatedProbing:
    """Configuration of probings on the virtual machine.

    Parameters
    ----------
    every : float
        Machine time between two probings [s].
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
    """Configuration of LinuxCNC on this computer as a sink.

    Parameters
    ----------
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
        """Create the sink; it connects later."""
        from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

        return LinuxCncSink(path=folder / self.socket, axes=dict(self.axes))


@dataclass(frozen=True, kw_only=True)
class FileOut:
    """Configuration of a file as a sink.

    Parameters
    ----------
    file : str
        File to be replaced atomically each time.
    """

    kind: Literal["file"]
    file: str

    def open(self, folder: Path) -> Sink:
        """Create the sink; it connects later."""
        from thermocomp.live.adapters.plain import FileSink

        return FileSink(path=folder / self.file)
