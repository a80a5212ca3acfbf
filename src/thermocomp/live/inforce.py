"""Corrections in force at the controller, as confirmed by the sinks."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

from thermocomp.core.correction import Correction
from thermocomp.core.ports import Confirming, Sink, Suspending
from thermocomp.live.clock import ServiceClock
from thermocomp.live.links import Outlet
from thermocomp.live.recorder import CONFIRM_WITHIN
from thermocomp.runtime.lines import DeviationLine
from thermocomp.runtime.orders import AVERAGED
from thermocomp.runtime.state import NO_ZERO, UNKNOWN, Compensated, CompensatorState, Status, Unconfirmed

#: difference from the corrections sent lately above which another one is in force [um]
ASIDE = 1.0
#: time without a confirmation after which a target is no longer active; sinks are asked every 2 s [s of real time]
ACTIVE_WITHIN = 4.0


class AtController(NamedTuple):
    """What is known of a correction at the controller."""

    word: Literal["confirmed"] | Unconfirmed
    reason: str = ""
    correction: Correction | None = None  #: as confirmed
    age: float | None = None  #: real time since the confirmation [s]


class ConfirmedCorrections:
    """Corrections that controllers have confirmed, and their alarms."""

    def __init__(self, sinks: Sequence[Sink], clock: ServiceClock, lines: Mapping[str, DeviationLine]) -> None:
        # the report of a controller takes precedence over that of a file
        controllers: list[Sink] = [s for s in sinks if confirms(s)]
        self._sure, self._clock, self._lines = controllers or list(sinks), clock, lines
        self._alarms = dict[str, str]()
        self._demanded = deque[tuple[float, Mapping[str, Correction]]](maxlen=1000)
        #: how a person orders 'start' or 'rezero' for a target, as text
        self.way: Callable[[str, str], str] = lambda _target, _order: ""
        #: correction and time of its confirmation, by target [um, s]
        self.confirmed = dict[str, tuple[Correction, float]]()

    def listens_to(self, sink: Sink) -> bool:
        """Return whether a sink can confirm corrections and its confirmations are used."""
        return sink in self._sure

    def confirm(self, found: Mapping[str, Correction]) -> None:
        """Store corrections in force as confirmed by a controller."""
        self.confirmed |= {t: (c, self._clock.tick()) for t, c in found.items()}

    def demand(self, corrections: Mapping[str, Correction]) -> None:
        """Store corrections that are being sent: what a controller confirms must be one of the latest."""
        self._demanded.append((self._clock.tick(), corrections))

    def _differs(self, target: str, found: Correction) -> str:
        """Return how a confirmed correction differs from all those sent lately; empty if it does not."""
        since = self._clock.tick() - 2 * CONFIRM_WITHIN * self._clock.speed
        lately = [c[target] for at, c in self._demanded if target in c and at >= since]
        lately = lately or [c[target] for _, c in list(self._demanded)[-1:] if target in c]
        for p in self._lines[target].travel if lately else ():
            low, high = min(c.at(p) for c in lately), max(c.at(p) for c in lately)
            if not low - ASIDE <= found.at(p) <= high + ASIDE:
                at = f"at {p:g} mm, " if found.slope or lately[-1].slope else ""
                sent = f"{lately[-1].at(p):+.1f} um were sent"
                return f"{at}the controller has {found.at(p):+.1f} um in force, where {sent}"
        return ""

    def of(self, target: str, state: CompensatorState) -> Correction | None:
        """Return the correction in force: recently confirmed, or demanded if no sink confirms; None if unknown."""
        if not any(isinstance(sink, Confirming) for sink in self._sure):
            return state.corrections[target]
        found, at = self.confirmed.get(target, (None, -math.inf))
        return found if self._clock.tick() - at <= CONFIRM_WITHIN * self._clock.speed else None

    def at_controller(self, target: str, outlets: Sequence[Outlet]) -> AtController:
        """Return what is known of the correction of a target at the controllers and other sinks that receive it."""
        mine = [one for one in outlets if one.receives(target)]
        if not mine:
            axes = next((a for o in outlets if (a := getattr(o.sink, "axes", None))), None)
            more = f'add it to axes of the LinuxCNC sink, {target} = "..." for its axis, or add' if axes else "add"
            return AtController("no sink", f"no sink carries {target}: {more} a table [[sinks]] to the configuration")
        for one in mine:
            link = one.status()
            lost = link.state != "connected" and (link.reason or link.state)
            if why := lost or getattr(one.sink, "other_sender", ""):
                return AtController("not confirmed", f"{one.name}: {why}")
        controllers = [one for one in mine if confirms(one.sink)]
        if not controllers:
            return AtController("sent, not confirmed", f"{mine[0].name} does not confirm what the controller has")
        found, at = self.confirmed.get(target, (None, -math.inf))
        age = (self._clock.tick() - at) / self._clock.speed
        if found is None or age > ACTIVE_WITHIN:
            topic = getattr(controllers[0].sink, "confirm_topic", "") or controllers[0].name
            out = "no report of the correction in force" if found is None else f"the last report is {age:.0f} s old"
            return AtController("not confirmed", f"{topic}: {out}")
        own = isinstance(controllers[0].sink, Suspending)  # compares demand and correction itself
        if alarm := self._alarms.get(target, "") if own else self._differs(target, found):
            return AtController("not confirmed", alarm, found, age)
        return AtController("confirmed", "", found, age)

    def find_status(
        self, target: str, said: Compensated | None, state: CompensatorState, outlets: Sequence[Outlet]
    ) -> tuple[Status, AtController]:
        """Return the status of a target as it is reported everywhere, and what is known at the controllers.

        Parameters
        ----------
        said : Compensated or None
            Latest output of the compensator.
        """
        there, order = self.at_controller(target, outlets), state.orders.get(target)
        status = said.states.get(target) if said else order
        if order is not None and order.word in (*UNKNOWN, NO_ZERO):
            status = order
            there = there if order.word == NO_ZERO else AtController("not sent", order.reason)
        status = status or Status("restarting", "waits for its first reading")
        if status.word in (*UNKNOWN, NO_ZERO) and status != AVERAGED:
            way = self.way(target, "rezero" if status.word == NO_ZERO else "start")
            return status._replace(reason=f"{status.reason}{way}"), there
        starts = there.word == "no sink" and status.word == "restarting"  # in vain
        if there.word != "confirmed" and (starts or status.word == "active"):
            status = Status(there.word, there.reason)
        return status, there

    def new_alarms(self, sink: Suspending) -> Iterator[str]:
        """Yield changes of alarms: a correction in force that differs from the commanded one, or no longer does."""
        alarms = dict(sink.alarms())
        for target in alarms.keys() | self._alarms.keys():
            if alarms.get(target) != self._alarms.get(target):
                yield f"{target}: {alarms.get(target, 'the correction is in force again as commanded')}"
        self._alarms = alarms


def confirms(sink: Sink) -> bool:
    """Return whether a sink reports what the controller has."""
    return isinstance(sink, Confirming) and not getattr(sink, "only_sent", False)


def suspensions(
    sink: Suspending, in_force: Mapping[str, Correction], state: CompensatorState
) -> Iterator[tuple[str, Status | None]]:
    """Yield targets suspended or resumed by a controller, with their new status; None: resumed."""
    away = sink.suspended()
    for target in state.corrections.keys() & (in_force.keys() | away.keys()):
        order = state.orders.get(target)
        if target in away and (order is None or order.word not in ("suspended", "shadow", "holding", NO_ZERO)):
            yield target, Status("suspended", away[target])
        elif target not in away and order is not None and order.word == "suspended":
            yield target, None
