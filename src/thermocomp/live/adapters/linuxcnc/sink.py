"""Corrections for LinuxCNC: client of the HAL component installed by ``thermocomp linuxcnc setup``."""

import asyncio
import contextlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import SettingError, ThermocompError
from thermocomp.core.ports import LinkStatus
from thermocomp.core.shown import escape
from thermocomp.live.adapters.connection import Connection

#: maximum interval between two keep-alive messages [s], and the same as a share of the component's timeout
BEAT, SHARE = 0.5, 0.25
#: maximum time to an answer; then the connection counts as lost [s]
ANSWER = 2.0
#: difference from the demand above which the measured correction is reported instead [um]
ASIDE = 1.0


class AxisReport(NamedTuple):
    """Correction in force at an axis."""

    correction: Correction
    in_force: float  #: correction at the present axis position [um]
    position: float  #: commanded [mm]
    alarm: str  #: reason why the demand is not reached; empty if it is


@dataclass(kw_only=True)
class LinuxCncSink:
    """Corrections for LinuxCNC on this computer.

    Parameters
    ----------
    path : Path
        Socket of the HAL component.
    axes : dict of str to str
        Letter of the axis by target, such as ``{"z_um": "Z"}``; other targets are ignored.
    magnitude : float or None
        Largest correction [um], if less than the limit of the component.
    rate : float or None
        Fastest change [um/s], if less than the limit of the component.

    Raises
    ------
    SettingError
        No axes, or two targets for the same axis.
    """

    label: ClassVar[str] = "LinuxCNC"
    path: Path
    axes: dict[str, str]
    magnitude: float | None = None
    rate: float | None = None
    ticks: int = field(default=-1, init=False)  #: counter of the component: increases while it is alive
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)
    _streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = field(default=None, init=False, repr=False)
    _beating: asyncio.Task[None] | None = field(default=None, init=False, repr=False)
    _lock: asyncio.Lock = field(default_factory=asyncio.Lock, init=False, repr=False)
    _beat: int = field(default=0, init=False, repr=False)
    _timeout: float = field(default=math.inf, init=False, repr=False)
    _why: str = field(default="", init=False, repr=False)
    _still: bool = field(default=False, init=False, repr=False)
    _reports: dict[str, AxisReport] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        letters = [a.upper() for a in self.axes.values()]
        if not letters or set(letters) - set("XYZUVW") or len(set(letters)) < len(letters):
            raise SettingError(f'axes = {self.axes}: expected a linear axis for each target, such as {{"z_um": "Z"}}')

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        await self.close()
        self._connection.to("connecting")
        try:
            async with asyncio.timeout(timeout):
                self._streams = await asyncio.open_unix_connection(self.path, limit=1 << 20)
        except FileNotFoundError as e:
            raise self._fail(
                "there is no socket: start LinuxCNC with the files that 'thermocomp linuxcnc setup' wrote"
            ) from e
        except PermissionError as e:
            raise self._fail(
                "this user has no permission to connect: run 'thermocomp linuxcnc setup' with --group, and make this "
                "user a member of that group"
            ) from e
        except (OSError, TimeoutError, ValueError) as e:
            raise self._fail(str(e) or "no answer") from e
        self._beat = 0
        await self._hear(b"")
        if missing := {a.upper() for a in self.axes.values()} - self._reports.keys():
            await self._hang_up()
            raise self._fail(
                f"LinuxCNC does not correct axis {', '.join(sorted(missing))}; run 'thermocomp linuxcnc setup' again "
                "with --axes"
            )
        self._connection.to("connected")
        self._beating = asyncio.create_task(self._live())

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Hand corrections to the component, or raise `ThermocompError` with the reason."""
        lines = {
            self.axes[target].upper(): (c.offset, c.slope, c.reference_position)
            for target, c in corrections.items()
            if target in self.axes
        }
        await self._ask({"axes": lines})

    async def confirmed(self) -> dict[str, Correction] | None:
        """Return the corrections in force, by target; None if unknown."""
        try:
            await self._ask({})
        except ThermocompError:
            return None
        if self._still:
            return None
        return {target: self._reports[letter.upper()].correction for target, letter in self.axes.items()}

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    def suspended(self) -> dict[str, str]:
        """Return targets that have no correction in force at the controller, and the reason, as last reported."""
        return dict.fromkeys(self.axes, f"the controller is {self._why}") if self._why else {}

    def alarms(self) -> dict[str, str]:
        """Return targets whose correction in force differs from the commanded one, and the reason, as last reported."""
        if self._still:
            return dict.fromkeys(self.axes, "the controller does not respond")
        found = {t: self._reports[a.upper()].alarm for t, a in self.axes.items() if a.upper() in self._reports}
        return {t: f"axis {self.axes[t].upper()} {alarm}" for t, alarm in found.items() if alarm}

    def reports(self) -> dict[str, AxisReport]:
        """Return the last report of each axis, by its letter."""
        return dict(self._reports)

    async def close(self) -> None:
        """Close the connection; idempotent. Applied corrections stay in force."""
        beating, self._beating = self._beating, None
        if beating is not None and beating is not asyncio.current_task():
            beating.cancel()
            await asyncio.gather(beating, return_exceptions=True)
        await self._hang_up()
        self._connection.to("closed")

    # -- inside --------------------------------------------------------------------------------------------------------

    async def _hang_up(self) -> None:
        streams, self._streams = self._streams, None
        if streams is not None:
            streams[1].close()
            with contextlib.suppress(OSError):  # connection lost earlier
                await streams[1].wait_closed()

    def _fail(self, why: str) -> ThermocompError:
        reason = f"LinuxCNC at {self.path}: {why}"
        self._connection.to("failed", reason)
        return ThermocompError(reason)

    async def _live(self) -> None:
        """Send keep-alive messages while connected."""
        with contextlib.suppress(ThermocompError):
            while True:
                await asyncio.sleep(min(BEAT, SHARE * self._timeout))
                await self._ask({})

    async def _ask(self, message: dict[str, Any]) -> None:
        """Send a message and process the answer."""
        async with self._lock:
            self._beat += 1
            limits = {n: v for n in ("magnitude", "rate") if (v := getattr(self, n)) is not None}
            await self._hear(json.dumps({"beat": self._beat, **limits, **message}).encode() + b"\n")

    async def _hear(self, line: bytes) -> None:
        """Send a line and process the answer; close the connection unless the answer matches."""
        if self._streams is None:
            raise self._fail("the service is not connected to LinuxCNC")
        reader, writer = self._streams
        heard = False
        try:
            async with asyncio.timeout(ANSWER):
                writer.write(line)
                await writer.drain()
                answer = json.loads(await reader.readline() or b'{"error": "connection lost"}')
            if answer.get("beat") != self._beat:
                raise ValueError(_text(answer.get("error", "unexpected answer")))
            self._why, self.ticks = _text(answer["suspended"]), int(answer["ticks"])
            self._still = bool(answer["still"])
            self._timeout = float(answer["timeout"])
            axes = answer["axes"]
            self._reports = {letter: _read(axes[letter]) for letter in "XYZUVW" if letter in axes}
            heard = True
        except (OSError, TimeoutError, ValueError, LookupError, AttributeError, TypeError, OverflowError) as e:
            raise self._fail(str(e) or "no answer") from e
        except (RecursionError, ThermocompError) as e:
            raise self._fail(f"the answer of LinuxCNC is not as expected: {e}") from e
        finally:  # also if cancelled: a late answer would be taken as the reply to the next message
            if not heard:
                await self._hang_up()


def _read(one: Mapping[str, Any]) -> AxisReport:
    demand, in_force, alarm = float(one["demand"]), float(one["in_force"]), _text(one["alarm"])
    aside = in_force - demand if abs(in_force - demand) > ASIDE or alarm else 0.0
    correction = Correction(float(one["offset"]) + aside, float(one["slope"]), float(one["reference"]))
    return AxisReport(correction, in_force, float(one["position"]), alarm)


def _text(found: object) -> str:
    """Return a text received from the component, escaped for display."""
    return escape(found, 200)
