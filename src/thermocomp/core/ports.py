"""Interfaces of a compensator to the shop floor: sources of readings and sinks of corrections.

Both are asynchronous and can be lost at any time: the caller connects, checks the status, and reconnects.
"""

from collections.abc import AsyncIterator, Mapping
from typing import Literal, NamedTuple, Protocol, runtime_checkable

from thermocomp.core.correction import Correction
from thermocomp.core.reading import Measurement, Reading


class LinkStatus(NamedTuple):
    """Status of a connection."""

    state: Literal["closed", "connecting", "connected", "failed"]
    reason: str = ""  #: reason of a failure
    since: float | None = None  #: start of the present status, on the clock of the readings [s]


@runtime_checkable
class Source(Protocol):
    """Source of readings."""

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        ...

    def readings(self) -> AsyncIterator[Reading]:
        """Return an iterator over readings as they arrive, oldest first, until the source ends or fails."""
        ...

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        ...

    async def close(self) -> None:
        """Close the connection; idempotent."""
        ...


@runtime_checkable
class Probe(Protocol):
    """Source of measurements of the tool point while the machine runs."""

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        ...

    def measurements(self) -> AsyncIterator[Measurement]:
        """Return an iterator over measurements as they arrive, until the probe ends or fails."""
        ...

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        ...

    async def close(self) -> None:
        """Close the connection; idempotent."""
        ...


@runtime_checkable
class Confirming(Protocol):
    """A sink that can report the correction in force at the controller."""

    async def confirmed(self) -> Mapping[str, Correction] | None:
        """Return the correction in force per axis or target; None if unknown.

        A sink with a true attribute ``only_sent`` reads back what it has written, such as a file; its controller may
        not have used it.
        """
        ...


@runtime_checkable
class Remembering(Protocol):
    """A sink that can return what was last sent to it, by an earlier run of the service.

    Its attribute ``last_time``, if it has one, is the time at which that was sent [s since 1970].
    """

    async def last_sent(self) -> Mapping[str, Correction] | None:
        """Return the corrections last sent, per axis or target; None if there are none."""
        ...


class TargetStatus(NamedTuple):
    """Status of a target or axis, as a sink may pass it on with the correction."""

    word: str  #: such as ``active`` or ``holding``
    reason: str = ""
    half_width: float | None = None  #: of the uncertainty band [um]; None without one


@runtime_checkable
class Informing(Protocol):
    """A sink that passes on the status of the targets with their corrections."""

    def inform(self, statuses: Mapping[str, TargetStatus]) -> None:
        """Store the statuses for the next corrections."""
        ...


@runtime_checkable
class Suspending(Protocol):
    """A sink that detects when no correction can be in force at the controller, such as before homing."""

    def suspended(self) -> Mapping[str, str]:
        """Return axes or targets without a correction in force, and the reason, as last reported."""
        ...

    def alarms(self) -> Mapping[str, str]:
        """Return axes or targets whose correction in force differs from the demanded one, and why, as last reported."""
        ...


@runtime_checkable
class Sink(Protocol):
    """Receiver of corrections."""

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        ...

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Send one correction per axis or target to the controller, or raise `ThermocompError` with the reason."""
        ...

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        ...

    async def close(self) -> None:
        """Close the connection; idempotent. Applied corrections stay in force."""
        ...
