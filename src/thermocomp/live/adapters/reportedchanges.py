"""Sources that report by exception: only changes; a counter shows that the other values are valid."""

from collections.abc import Mapping

from thermocomp.core.reading import Reading


class ReportedChanges:
    """Latest values of such a source; those that have not changed are as new as the last advance of the counter.

    Parameters
    ----------
    counter : str
        Channel whose value changes with each message, or with each heartbeat.
    """

    def __init__(self, counter: str) -> None:
        self._counter = counter
        self._latest = dict[str, float]()

    def keep(self, values: Mapping[str, float]) -> None:
        """Store values of an unknown time, as retained by a broker: valid once the counter advances."""
        self._latest.update(values)

    def complete(self, reading: Reading) -> Reading:
        """Return the values that are valid now: all if the counter has advanced, else those that have changed."""
        changes = {name: v for name, v in reading.values.items() if self._latest.get(name) != v}
        self._latest.update(changes)
        advances = self._counter in changes
        repeats = self._counter in reading.values and not advances
        return Reading(reading.time, dict(self._latest) if advances else {} if repeats else changes)
