"""Start of the targets of a service: from the correction in force, or held until this is known."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from thermocomp.core.correction import Correction
from thermocomp.core.ports import Confirming, Remembering
from thermocomp.live.inforce import confirms
from thermocomp.live.keeper import StateKeeper
from thermocomp.live.links import Outlet
from thermocomp.live.startvalues import WAITS, AtStart, StartValues
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.orders import start_from, wait_for_start
from thermocomp.runtime.state import UNKNOWN, CompensatorState, Status


class StartingTargets(ABC):
    """The part of a service that starts its targets; the attributes are those of `thermocomp.live.loop.Service`."""

    compensator: Compensator
    state: CompensatorState
    keeper: StateKeeper
    start_values: StartValues
    outlets: Sequence[Outlet]
    first_start: AtStart
    at_unknown: AtStart
    _begun: bool
    _dirty: bool

    @abstractmethod
    def say(self, kind: str, text: str) -> None:
        """Add a line to the event list and the journal."""

    def start_from_zero(self, target: str) -> str:
        """Start a target whose correction in force is unknown: a person states that it is zero; return why not."""
        order = self.state.orders.get(target)
        if not self._begun:
            return "the sinks are still being asked for the correction in force: wait some seconds"
        if order is None or order.word not in UNKNOWN:
            return "the correction in force is known"
        self._start_from(target, Correction(0.0))
        self.say("state", f"{target} starts from zero, as ordered")
        self._dirty = True
        return ""

    def _begin(self) -> None:
        """Start each target from the correction in force, or hold it until this is known."""
        for target in self.compensator.lines:
            known = self.start_values.of(target)
            order = self.state.orders.get(target)
            waits = order is not None and order.word in UNKNOWN
            if known is not None:
                if waits:
                    self._start_from(target, known)
                else:
                    self.state = self.state._replace(corrections=self.state.corrections | {target: known})
                moves = known.offset or known.slope
                if moves and target not in self.keeper.known:  # not active before it has caught up
                    self.state = self.state._replace(away=math.nan)
                self._hold_if_warm(target, known)
                continue
            if waits or target in self.keeper.known or not any(o.receives(target) for o in self.outlets):
                continue
            first = self.keeper.first
            if self._zero_allowed and self._asked(target):
                continue
            self.state = wait_for_start(self.state, target, WAITS[first])
            self.say("state", f"{target} {WAITS[first].word}: {WAITS[first].reason}")
        self._begun = True

    def _start_from(self, target: str, in_force: Correction) -> None:
        """Start a target from the correction in force."""
        self.state = start_from(self.compensator, self.state, target, in_force)
        self._hold_if_warm(target, in_force)
        self._hold_without_zero(target)

    def _hold_if_warm(self, target: str, in_force: Correction) -> None:
        """Hold the corrections if the models would take a new zero while a sink knows of a correction in force."""
        before, lately = self.keeper.no_zero, target in self.start_values.lately
        self.state = self.keeper.hold_if_warm(self.state, target, in_force, lately=lately)
        if before is None and (held := self.keeper.no_zero) is not None:
            self.say("reference", f"no zero is taken: {held.reason}")

    def _hold_without_zero(self, target: str) -> Status | None:
        """Hold a target that would run although its models have no valid zero; return its order then."""
        if (held := self.keeper.no_zero) is None or target in self.state.orders:
            return None
        self.state = wait_for_start(self.state, target, held)
        return held

    @property
    def _zero_allowed(self) -> bool:
        """Whether a target starts from zero if no sink knows its correction in force."""
        return (self.first_start if self.keeper.first else self.at_unknown) == "zero"

    def _asked(self, target: str) -> bool:
        """Return whether a sink that may know the correction in force was asked; one out of reach blocks no other."""
        may = [o.sink for o in self.outlets if o.receives(target) and isinstance(o.sink, Confirming | Remembering)]
        return not may or any(sink is asked for asked in self.start_values.asked for sink in may)

    async def _learn_start(self) -> None:
        """Start targets that wait, once a sink that was out of reach at the start knows what it was sent last."""
        waiting = {t for t, o in self.state.orders.items() if o.word in UNKNOWN}
        for outlet in self.outlets if waiting else ():
            if outlet.status().state != "connected":
                continue
            if isinstance(outlet.sink, Remembering):
                found = self.start_values.within_limits(await outlet.sink.last_sent() or {})
                for target in waiting & found.keys():
                    self._start_from(target, found[target])
                    self.state = self.state._replace(away=math.nan)
                    self.say("state", f"{target} starts from {found[target].offset:+.1f} um, as last sent")
            if not confirms(outlet.sink) and not any(outlet.sink is asked for asked in self.start_values.asked):
                self.start_values.asked.append(outlet.sink)
        for target in waiting if self._zero_allowed else ():
            order = self.state.orders.get(target)
            if order is not None and order.word in UNKNOWN and self._asked(target):
                self._start_from(target, Correction(0.0))
                self.say("state", f"{target} starts from zero, as configured: no sink knows a correction in force")
