"""Sources and sinks that need no network: a recording played back, the virtual machine, a file."""

import asyncio
import csv
import json
import math
import time
from collections.abc import AsyncIterator, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import BinaryIO, ClassVar

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.core.ports import LinkStatus, TargetStatus
from thermocomp.core.reading import Reading
from thermocomp.core.shown import explain_unfit
from thermocomp.files.draft import write_text
from thermocomp.live.adapters.connection import Connection
from thermocomp.live.adapters.messages import write_message
from thermocomp.virtual.experiments import simulate
from thermocomp.virtual.protocol import Experiment
from thermocomp.virtual.protocolfile import read_protocol


@dataclass(kw_only=True)
class Played:
    """Source of readings that plays back the rows of a recording at their times.

    Parameters
    ----------
    speed : float
        Replay speed relative to real time.
    """

    speed: float = 1.0
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)
    _rows: Iterator[tuple[float, dict[str, float]]] | None = field(default=None, init=False, repr=False)
    _at: float = field(default=-math.inf, init=False, repr=False)  #: time of the row played last [s]
    _broken: ThermocompError | None = field(default=None, init=False, repr=False)
    _begun: float = field(default=math.nan, init=False, repr=False)  #: clock at which the row of time 0 was due [s]

    def _open(self) -> Iterator[tuple[float, dict[str, float]]]:
        raise NotImplementedError

    async def connect(self, timeout: float) -> None:  # noqa: ARG002 - part of the interface
        """Start with the first row, or continue after the row played last."""
        self._connection.to("connecting")
        if self._broken is not None:  # an unreadable recording stays unreadable, and is not played again
            self._connection.to("failed", str(self._broken))
            raise self._broken
        if self._rows is None:
            try:
                self._rows = await asyncio.to_thread(self._open)
            except (OSError, ThermocompError) as e:
                self._connection.to("failed", str(e))
                raise ThermocompError(str(e)) from e
        self._connection.to("connected")

    async def readings(self) -> AsyncIterator[Reading]:
        """Return the rows as readings when they are due, up to the last one."""
        if self._rows is None:
            raise ThermocompError("the recording is not open: connect first")
        while (row := self._next()) is not None:
            at, values = row
            if math.isnan(self._begun):
                self._begun = time.monotonic() - at / self.speed
            await asyncio.sleep(max(0.0, self._begun + at / self.speed - time.monotonic()))
            yield Reading(time.time(), values)
        self._connection.to("closed", "replayed to the end")

    def _next(self) -> tuple[float, dict[str, float]] | None:
        """Return the next row of the recording; None after the last one."""
        assert self._rows is not None
        try:
            return next(self._rows, None)
        except ThermocompError as e:
            self._broken = e
            self._connection.to("failed", str(e))
            raise

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    async def close(self) -> None:
        """Stop the playback; idempotent."""
        self._connection.to("closed")


@dataclass(kw_only=True)
class ReplaySource(Played):
    """Source that plays back a recording in thermocomp's own CSV format."""

    label: ClassVar[str] = "recording"
    path: Path

    def _open(self) -> Iterator[tuple[float, dict[str, float]]]:
        return read_rows(self.path)


@dataclass(kw_only=True)
class SimulatedSource(Played):
    """Source that runs an experiment on the virtual machine.

    Parameters
    ----------
    experiment : Experiment
        Experiment to run; all its tests in sequence.
    """

    label: ClassVar[str] = "virtual machine"
    experiment: Experiment
    seed: int = 0
    #: noise-free displacements of the row played last, as an ideal probe would measure them [um]
    truth: dict[str, float] = field(default_factory=dict, init=False)

    def _open(self) -> Iterator[tuple[float, dict[str, float]]]:
        return self._simulated()

    def _simulated(self) -> Iterator[tuple[float, dict[str, float]]]:
        begin = 0.0
        for test in simulate(self.experiment, seed=self.seed):
            inputs = [k for k, c in enumerate(test.channels) if c.quantity in ("temperature", "spindle_speed", "feed")]
            names = [test.channels[k].name for k in inputs]
            moved = [c.name for c in test.displacements]
            for at, row, true in zip(
                test.time.tolist(), test.values[:, inputs].tolist(), test.truth.tolist(), strict=True
            ):
                self.truth = dict(zip(moved, true, strict=True))
                yield begin + at, dict(zip(names, row, strict=True))
            begin += float(test.time[-1]) + 1.0


@dataclass(kw_only=True)
class FileSink:
    """Sink that writes the corrections in force to a file, replaced atomically each time."""

    label: ClassVar[str] = "file"
    only_sent: ClassVar[bool] = True
    path: Path
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)
    _statuses: dict[str, TargetStatus] = field(default_factory=dict, init=False, repr=False)

    def inform(self, statuses: Mapping[str, TargetStatus]) -> None:
        """Store the statuses for the next corrections."""
        self._statuses = dict(statuses)

    async def connect(self, timeout: float) -> None:  # noqa: ARG002 - part of the interface
        """Check that the folder of the file exists."""
        if not self.path.parent.is_dir():
            reason = f"{self.path}: there is no folder {self.path.parent}"
            self._connection.to("failed", reason)
            raise ThermocompError(reason)
        self._connection.to("connected")

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Write the corrections to the file, or raise `ThermocompError` with the reason."""
        text = write_message(corrections, time.time(), self._statuses) + "\n"
        try:
            await asyncio.to_thread(write_text, text, self.path, overwrite=True)
        except (OSError, ThermocompError) as e:
            self._connection.to("failed", str(e))
            raise ThermocompError(str(e)) from e

    async def confirmed(self) -> dict[str, Correction] | None:
        """Return the corrections in the file; None if the file does not exist yet."""
        try:
            table = json.loads(self.path.read_text(encoding="utf-8"))["corrections"]
            return {
                name: Correction(c["offset_um"], c["slope_um_per_m"], c["reference_position_mm"])
                for name, c in table.items()
            }
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, InputError):
            return None

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    async def close(self) -> None:
        """Close the connection; the file is left as it is."""
        self._connection.to("closed")


def read_rows(path: Path) -> Generator[tuple[float, dict[str, float]], None, None]:
    """Return time [s] and values by channel of a recording in thermocomp's own CSV format, row by row."""
    try:
        file = path.open("rb")
    except OSError as e:
        raise InputError(f"{path}: the file cannot be read: {e.strerror or e}") from e
    rows = _rows_of(path, file)
    next(rows)  # consume the heading, so that faults in it are raised here
    return rows


def _rows_of(path: Path, file: BinaryIO) -> Generator[tuple[float, dict[str, float]], None, None]:
    line = 0

    def lines() -> Iterator[str]:
        nonlocal line
        for line, content in enumerate(file, start=1):  # noqa: B007 - reported if a line cannot be read
            if not content.startswith(b"#"):
                yield content.decode("utf-8")

    with file:
        table = csv.reader(lines())
        try:
            names = next(table, [])
            if "time_s" not in names:
                raise InputError(f"{path}: the file has no column time_s; expected a recording written by thermocomp")
            if why := next(filter(None, map(explain_unfit, names)), ""):
                raise InputError(f"{path}: line {line}: {why}")
            place = names.index("time_s")
            yield math.nan, {}
            for row in table:
                if (at := _parsed(row, place)) is not None:
                    found = {name: _parsed(row, k) for k, name in enumerate(names) if k != place}
                    yield at, {name: v for name, v in found.items() if v is not None}
        except (OSError, UnicodeDecodeError, csv.Error) as e:
            raise InputError(f"{path}: line {line} cannot be read: {e}") from e


def _parsed(row: Sequence[str], place: int) -> float | None:
    try:
        value = float(row[place])
    except (ValueError, IndexError):
        return None
    return value if math.isfinite(value) else None


def find_experiment(name: str, folder: Path) -> Experiment:
    """Return an experiment of the virtual machine: one included in the package, or a custom protocol."""
    if name.endswith(".toml"):
        return read_protocol(folder / name)
    home = files("thermocomp.virtual") / "protocols"
    known = sorted(p.name.removesuffix(".toml") for p in home.iterdir() if p.name.endswith(".toml"))
    if name not in known:
        raise InputError(f"experiment {name!r}: expected a path that ends in .toml, or one of {', '.join(known)}")
    with as_file(home / f"{name}.toml") as path:
        return read_protocol(path)
