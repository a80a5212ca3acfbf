"""State file of a service: read at the start, set aside if unusable, written while the service runs."""

import contextlib
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.live import statefile
from thermocomp.live.clock import ServiceClock
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import CompensatorState, resume, silence

#: reason why a target runs in shadow: by configuration
CONFIGURED = "by configuration"


class StateKeeper:
    """Stores the state of a compensator in a file.

    Parameters
    ----------
    path : Path or None
        None: the state is not stored.
    say : callable
        Called with a line of text for the event list.
    """

    def __init__(
        self, path: Path | None, compensator: Compensator, clock: ServiceClock, say: Callable[[str], None]
    ) -> None:
        self._path, self._compensator, self._clock, self._say = path, compensator, clock, say
        self._refused: Path | None = None
        #: reason why the last save failed; empty if it succeeded
        self.not_saved = ""
        #: whether the state comes from the file, and whether there was no file
        self.resumed, self.first, self.configured = False, True, path is not None

    def begin(self) -> CompensatorState:
        """Return the initial state of the compensator: from the file, or that of a cold start."""
        cold = self._compensator.start()
        if self._path is None:
            return cold
        if not self._path.exists():
            self._say(f"cold start: there is no {self._path}")
            return cold
        self.first = False
        try:
            saved = statefile.read(self._path, self._compensator)
        except ThermocompError as e:
            if not statefile.is_ours(self._path):
                raise InputError(
                    f"{self._path}: this is not a state file and would be overwritten; name another file"
                ) from e
            self._say(f"cold start: {e}")
            self._refused = self._path
            return cold
        age = (datetime.now(UTC) - saved.written).total_seconds() * self._clock.speed
        state = resume(saved.state, cold, age, None, self._clock.tick(), self._compensator.thresholds.resumable)
        # orders by the controller or the configuration are not restored: they are issued again
        own = {t: o for t, o in state.orders.items() if o.word != "suspended" and o.reason != CONFIGURED}
        self.resumed = True
        state = state._replace(orders=cold.orders | own)
        how = "continues" if state.references else "starts again, with the corrections that are in force"
        self._say(f"start after {age:.0f} s: {how}")
        return state

    def put_aside(self) -> None:
        """Rename a state file that could not be used."""
        if self._refused is not None:
            with contextlib.suppress(OSError):
                self._refused.replace(self._refused.with_name(f"{self._refused.name}.refused"))

    def save(self, state: CompensatorState) -> None:
        """Write the state to the file; on failure `not_saved` contains the reason."""
        if self._path is None:
            self.not_saved = "no state file is configured"
            return
        try:
            old = timedelta(seconds=silence(state, self._clock.tick()) / self._clock.speed)
            statefile.write(state, self._compensator, self._path, datetime.now(UTC) - old)
            self.not_saved = ""
        except (ThermocompError, OSError) as e:
            if not self.not_saved:
                self._say(f"the state is not saved: {e}")
            self.not_saved = str(e)
