"""Corrections in force at the controller, as confirmed by the sinks."""

import math
from collections.abc import Iterator, Mapping, Sequence

from thermocomp.core.correction import Correction
from thermocomp.core.ports import Confirming, Sink, Suspending
from thermocomp.live.clock import ServiceClock
from thermocomp.live.recorder import CONFIRM_WITHIN
from thermocomp.runtime.state import CompensatorState, Status


class ConfirmedCorrections:
    """Corrections that controllers have confirmed, and their alarms."""

    def __init__(self, sinks: Sequence[Sink], clock: ServiceClock) -> None:
        # the report of a controller takes precedence over that of a file
        controllers: list[Sink] = [s for s in sinks if isinstance(s, Suspending)]
        self._sure, self._clock = controllers or list(sinks), clock
        self._alarms = dict[str, str]()
        #: correction and time of its confirmation, by target [um, s]
        self.confirmed = dict[str, tuple[Correction, float]]()

    def listens_to(self, sink: Sink) -> bool:
        """Return whether a sink can confirm corrections and its confirmations are used."""
        return sink in self._sure

    def confirm(self, found: Mapping[str, Correction]) -> None:
        """Store corrections in force as confirmed by a controller."""
        self.confirmed |= {t: (c, self._clock.tick()) for t, c in found.items()}

    def of(self, target: str, state: CompensatorState) -> Correction | None:
        """Return the correction in force: recently confirmed, or demanded if no sink confirms; None if unknown."""
        if not any(isinstance(sink, Confirming) for sink in self._sure):
            return state.corrections[target]
        found, at = self.confirmed.get(target, (None, -math.inf))
        return found if self._clock.tick() - at <= CONFIRM_WITHIN * self._clock.speed else None

    def new_alarms(self, sink: Suspending) -> Iterator[str]:
        """Yield changes of alarms: a correction in force that differs from the commanded one, or no longer does."""
        alarms = dict(sink.alarms())
        for target in alarms.keys() | self._alarms.keys():
            if alarms.get(target) != self._alarms.get(target):
                yield f"{target}: {alarms.get(target, 'the correction is in force again as commanded')}"
        self._alarms = alarms


def suspensions(
    sink: Suspending, in_force: Mapping[str, Correction], state: CompensatorState
) -> Iterator[tuple[str, Status | None]]:
    """Yield targets suspended or resumed by a controller, with their new status; None: resumed."""
    away = sink.suspended()
    for target in state.corrections.keys() & (in_force.keys() | away.keys()):
        order = state.orders.get(target)
        if target in away and (order is None or order.word not in ("suspended", "shadow", "holding")):
            yield target, Status("suspended", away[target])
        elif target not in away and order is not None and order.word == "suspended":
            yield target, None
