"""The two interfaces the shop floor fills."""

from collections.abc import Iterator, Mapping
from typing import Protocol, runtime_checkable

from thermocomp.core.correction import Correction
from thermocomp.core.reading import Reading


@runtime_checkable
class TemperatureSource(Protocol):
    """Where readings come from."""

    def readings(self) -> Iterator[Reading]:
        """Yield readings, oldest first, until the source ends."""
        ...


@runtime_checkable
class CorrectionSink(Protocol):
    """Where corrections go."""

    def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Hand one correction per axis (or channel) to the controller."""
        ...
