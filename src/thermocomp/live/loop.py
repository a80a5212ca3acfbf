"""The service: receives readings, runs the compensator, sends corrections; a failed link does not stop it."""

import asyncio
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from thermocomp.core.correction import Correction
from thermocomp.core.ports import Probe, Sink, Source, Suspending, TargetStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.core.starting import describe_start
from thermocomp.live.clock import ServiceClock
from thermocomp.live.curves import Curves
from thermocomp.live.events import Events
from thermocomp.live.firstchange import step_changing
from thermocomp.live.inforce import AtController, ConfirmedCorrections, suspensions
from thermocomp.live.keeper import ASKED, CONFIGURED, StateKeeper
from thermocomp.live.latest import Latest
from thermocomp.live.ledger import ProbingLedger
from thermocomp.live.links import SELDOM, TIMEOUT, Inlet, Link, Outlet, within
from thermocomp.live.rebuild import rebuild
from thermocomp.live.recorder import Recorder
from thermocomp.live.stamps import explain_stamp
from thermocomp.live.starts import StartingTargets
from thermocomp.live.startvalues import AtStart, StartValues
from thermocomp.live.storedzero import inputs_of
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.orders import AVERAGED, order, rezero, withdraw, zero_anew
from thermocomp.runtime.state import NO_ZERO, UNKNOWN, Compensated, CompensatorState, Status
from thermocomp.runtime.watchstate import UNSURE

#: values that are older than those used by more than this are reported [s of real time]
BEHIND = 2.0


@dataclass
class Service(StartingTargets):
    """A compensator between sources and sinks.

    Parameters
    ----------
    state_path : Path or None
        Path of the saved state.
    recorder : Recorder or None
        Recorder of the journal.
    first_start, at_unknown : {'order', 'zero'}
        If the correction in force is unknown at the first start, without a state file, or at a later one: wait for an
        order, or start from zero.
    """

    compensator: Compensator
    sources: Sequence[Source]
    sinks: Sequence[Sink]
    clock: ServiceClock = field(default_factory=ServiceClock)
    state_path: Path | None = None
    probes: Sequence[Probe] = ()
    recorder: Recorder | None = None
    first_start: AtStart = "order"
    at_unknown: AtStart = "order"
    state: CompensatorState = field(init=False)
    said: Compensated | None = field(default=None, init=False)
    events: Events = field(default_factory=Events, init=False)
    counts: dict[str, int] = field(default_factory=lambda: {"readings": 0, "rejected": 0}, init=False)

    def __post_init__(self) -> None:
        self.latest = Latest(i.name for i in inputs_of(self.compensator))
        self.start_values = StartValues(self.compensator)
        self.curves = Curves(self.compensator)
        self.in_force = ConfirmedCorrections(self.sinks, self.clock, self.compensator.lines)
        self.probings = ProbingLedger(self.compensator, self.clock, partial(self.say, "probing"))
        self.keeper = StateKeeper(self.state_path, self.compensator, self.clock, partial(self.say, "service"))
        self.outlets = [Outlet(sink, self._hear if self.in_force.listens_to(sink) else None) for sink in self.sinks]
        self.inlets = self._make_inlets()
        self.state = self.keeper.begin()
        self._saved, self._dirty, self._trouble, self._ending = -1e9, False, "", False
        self._heard = self.clock.tick()
        self._unread = list[str]()
        self._untimely = "", -math.inf  # why the stamp of a reading was invalid, and when
        self._told_behind = -math.inf
        self._told_untimely, self._begun, self._shown = -math.inf, False, dict[str, Status]()
        self._since = f"{datetime.fromtimestamp(self.clock.now(), UTC):%Y-%m-%d %H:%M} UTC"

    # -- interface -----------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Run until cancelled; then save the state and leave the corrections unchanged."""
        self.keeper.put_aside()
        if self.recorder is not None:
            await asyncio.to_thread(self.recorder.journal.flush)
        if (others := self.keeper.pending) is not None:  # no reading is taken meanwhile, and the file stays as it is
            journal = None if self.recorder is None else self.recorder.journal.path
            rebuilt = await asyncio.to_thread(rebuild, self.compensator, others, journal)
            self.state = self.keeper.take_over(self.state, rebuilt)
            self._dirty = True
        self.inlets = self._make_inlets()
        for sink in self.sinks:
            await within(TIMEOUT, self.start_values.ask(sink))  # on failure its link reports the reason
        self._begin()
        try:
            async with asyncio.TaskGroup() as group:
                for one in self.links():
                    group.create_task(one.run())
                group.create_task(self._watch())
        finally:
            for outlet in self.outlets:
                await outlet.flush()
            for one in self.links():
                await within(2.0, one.end.close())
            self.keeper.save(self.state)
            if self.recorder is not None:
                self.recorder.journal.close()

    def take(self, reading: Reading) -> None:
        """Process a reading of a source together with the latest readings of the other sources."""
        if self._ending:
            return
        tick, now = self.clock.tick(), self.clock.now()
        stamp, most = self.clock.of(reading.time), self.compensator.limits.reading_age
        if why := explain_stamp(stamp, now, most):
            self.counts["rejected"] += 1
            if tick - self._told_untimely > SELDOM * self.clock.speed:
                self.say("link", f"readings are not used: {why}")
                self._told_untimely = tick
            self._untimely = why, tick
            return
        if left_out := self.latest.take(reading.values, tick, most, tick - max(now - stamp, 0.0)):
            self.say("link", f"too many names that no model uses; {left_out!r} and others are ignored")
        if self.latest.behind > BEHIND * self.clock.speed and tick - self._told_behind > SELDOM * self.clock.speed:
            self.say(
                "link", f"values are ignored: their time is {self.latest.behind:.0f} s behind that of values before"
            )
            self._told_behind = tick
        fresh = {name: value for name, (value, at) in self.latest.items() if tick - at <= most}
        self._look_for_stale_zero(fresh)
        probings, learned, started = self.probings.take(), self.state.learned, self.state.references.keys()
        self.state, said = step_changing(self.compensator, self.state, Reading(now, fresh), probings, tick, self._since)
        self._heard = tick
        for target in [t for t, o in self.state.orders.items() if o == AVERAGED and t in self.state.raw]:
            self.state, self.keeper.no_zero = rezero(self.compensator, self.state, target, now, "new zero"), None
            self.say("reference", f"{target} has a new zero")
        if self.state.references.keys() - started and (
            off := describe_start(self.compensator.models, self.state.models)
        ):
            self.say("sensor", off)
        self.counts["readings"] += 1
        self.counts["rejected"] += bool(said.rejected)
        said = self._tell(said, probings)
        if self.recorder is not None:
            self.recorder.take(now, fresh, said)
            self.recorder.count(now, self.state.references)
        self.probings.note(probings, said, learned, self.state, self.recorder)

    def order(self, target: str, status: Status | None) -> None:
        """Suspend or resume a target; see `thermocomp.runtime.orders.order`."""
        before = self.state.orders.get(target)
        self.state = order(self.compensator, self.state, target, status)
        status = self._hold_without_zero(target) or status
        if before == status:  # unchanged: no event
            return
        word = f"{status.word}: {status.reason}" if status else "runs again"
        self.say("state", f"{target} {word}, as ordered")
        self._dirty = True

    def watch_only(self, target: str) -> None:
        """Run a target in shadow from the start, as configured."""
        self.state = order(self.compensator, self.state, target, Status("shadow", CONFIGURED))

    def rezero(self, target: str, why: str, in_force: Correction | None = None) -> None:
        """Reset the reference of a target; see `thermocomp.runtime.orders.rezero`.

        If its models have no valid zero, all targets without one are re-zeroed once a new one is averaged.
        """
        if (held := self.state.orders.get(target)) is not None and held.word == NO_ZERO:
            self.state = zero_anew(self.compensator, self.state)
            self.say("reference", f"a new zero is averaged: {why}")
            self._dirty = True
            return
        self.state = rezero(self.compensator, self.state, target, self.clock.now(), why, in_force)
        self.probings.forget(target)
        self.say("reference", f"{target} is re-zeroed: {why}")
        self._dirty = True

    def measure(self, found: Measurement) -> None:
        """Use a measurement of the tool point as a probing with the next reading."""
        known = found.target in self.compensator.lines
        in_force = self.in_force.of(found.target, self.state) if known else None
        self.probings.measure(found, self.state, in_force)

    def roll_back(self, target: str) -> str:
        """Undo the last probing used for a target; return the reason if impossible, else an empty string."""
        if target not in self.probings.before:
            return "no probing was used since the start, or the last one is already undone"
        self.state = self.probings.take_back(target, self.state)
        self.say("probing", f"{target}: the last probing is undone")
        self._dirty = True
        return ""

    async def fade_out(self) -> None:
        """Fade all corrections to zero, within the limits, whether or not readings arrive."""
        self._ending, last = True, self.clock.tick()
        self.say("service", "is being stopped: corrections go to zero")
        while any(c.offset or c.slope for c in self.state.corrections.values()):
            await asyncio.sleep(0.1)
            tick = self.clock.tick()
            self.state = withdraw(self.compensator, self.state, tick - last)
            last = tick
            self._put(self.state.corrections)
        for outlet in self.outlets:
            await outlet.flush()

    def find_status(self, target: str) -> tuple[Status, AtController]:
        """Return the status of a target as it is reported everywhere, and what is known at the controllers."""
        return self.in_force.find_status(target, self.said, self.state, self.outlets)

    @property
    def untimely(self) -> str:
        """Why readings were not used lately because of their time stamps; empty if all were valid."""
        why, at = self._untimely
        return why if self.clock.tick() - at <= 10.0 * self.clock.speed else ""

    def unread(self) -> list[str]:
        """Return what was received for channels in use and is not a number, with its source."""
        ends = [(one.name, getattr(one.end, "unread", {}).items()) for one in self.inlets]
        every = [(name, text, where) for where, items in ends for name, text in items if name in self.latest.used]
        return [f"{n}: received {text} from {where}, expected a number, not in quotes" for n, text, where in every]

    def links(self) -> list[Link]:
        """Return the links of sources, probes and sinks, in this order."""
        return [*self.inlets, *self.outlets]

    # -- internals -----------------------------------------------------------------------------------------------------

    def _make_inlets(self) -> list[Inlet]:
        sources = [Inlet(source, source.readings, self.take) for source in self.sources]
        return sources + [Inlet(probe, probe.measurements, self.measure) for probe in self.probes]

    def _look_for_stale_zero(self, values: Mapping[str, float]) -> None:
        """Drop a zero taken from values that a reading shows to be old: hold the corrections, or average it anew."""
        found = self.compensator.feed.find_stale(self.state.feed, values)
        if not found or self.keeper.no_zero is not None:
            return
        why = f"{found}, after it had repeated since the start at {self._since}"
        if self.state.references:
            self.state = self.keeper.hold(self.state, f"{why}: the zero is of old values; {ASKED}")
        else:
            self.state = zero_anew(self.compensator, self.state)._replace(away=self.state.away)
        self.say("reference", f"the zero is {'not valid' if self.state.references else 'averaged anew'}: {why}")

    def _put(self, corrections: Mapping[str, Correction], statuses: Mapping[str, TargetStatus] | None = None) -> None:
        """Hand corrections to all sinks, but none for a target whose correction in force is unknown."""
        orders = self.state.orders
        known = {t: c for t, c in corrections.items() if t not in orders or orders[t].word not in UNKNOWN}
        if known:
            self.in_force.demand(known)
        for outlet in self.outlets if known else ():
            outlet.put(known, statuses)

    async def _watch(self) -> None:
        """Perform the periodic work that is independent of readings: elapsed time, saving of the state."""
        while True:
            await asyncio.sleep(min(1.0, max(0.1, 1.0 / self.clock.speed)))
            tick = self.clock.tick()
            silent = tick - self._heard
            for one in self.links():
                for text in one.news():
                    self.say("link", text)
            for text in set(unread := self.unread()).difference(self._unread):
                self.say("link", text)
            self._unread = unread
            if self._ending:
                continue
            await self._learn_start()
            said = self.said
            if silent > max(2.0, 2.0 * self.clock.speed):
                reasons = [self.untimely, *(f"{one.name}: {one.refusing}" for one in self.inlets if one.refusing)]
                why = ": ".join([f"no reading for {silent:.0f} s", *filter(None, reasons)])
                self.state, said = self.compensator.wait(self.state, tick, why)
                said = self._tell(said, {})
            elif said is not None:  # a controller may have ceased to confirm
                said = said._replace(states=self._show())
            if self.recorder is not None and said is not None:
                self.recorder.tell(self.clock.now(), said)
            if self._dirty and time.monotonic() - self._saved >= 1.0:
                self._dirty, self._saved = False, time.monotonic()
                await asyncio.to_thread(self.keeper.save, self.state)
            if self.recorder is not None:
                await asyncio.to_thread(self.recorder.journal.flush)
                if (trouble := self.recorder.journal.status().reason) != self._trouble:
                    self._trouble = trouble
                    self.say("service", f"journal: {trouble or 'all rows are written again'}")

    def _show(self) -> dict[str, Status]:
        """Return the status of each target as it is reported, with an event for each one whose word has changed."""
        shown = {t: self.find_status(t)[0] for t in self.compensator.lines}
        for target, status in shown.items():
            if self._shown.get(target, Status("active")).word != status.word:
                self.say("state", f"{target} {status.word}" + (f": {status.reason}" if status.reason else ""))
        self._shown = shown
        return shown

    def _tell(self, said: Compensated, probings: Mapping[str, Probing]) -> Compensated:
        """Send corrections, report what has changed, and return the output with the states as reported."""
        before, self.said = self.said, said
        shown = self._show()
        statuses = {t: TargetStatus(s.word, s.reason, said.half_widths.get(t)) for t, s in shown.items()}
        self._put(said.corrections, statuses)
        for name, fault in said.failed.items():
            if before is None or before.failed.get(name) != fault:
                cause = " (a drift, or heat that the training did not contain)" if fault == UNSURE else ""
                self.say("sensor", f"{name} {fault}{cause}: it is replaced by its prediction from the other sensors")
        for name in (before.failed if before else {}).keys() - said.failed.keys():
            self.say("sensor", f"{name} is used again")
        for target in probings:
            why, moved = said.refused.get(target), said.moved.get(target, 0.0)
            self.say(
                "probing",
                f"{target} refused: {why}"
                if why
                else f"probing of {target} accepted: the prediction changes by {moved:+.1f} um",
            )
        self.curves.take(self.clock.now(), said, self.latest)
        self._dirty = True
        return said._replace(states=shown)

    def _hear(self, sink: Sink, in_force: Mapping[str, Correction]) -> None:
        """Process the correction in force reported by a controller, and the reason if there is none."""
        known = {t: c for t, c in in_force.items() if t in self.state.corrections}
        self.in_force.confirm(known)
        for target in known.keys() & self.start_values.within_limits(known).keys():
            if (order := self.state.orders.get(target)) is not None and order.word in UNKNOWN:
                self._start_from(target, known[target])
                self.say("state", f"{target} starts from {known[target].offset:+.1f} um, as the controller confirms")
        if self.recorder is not None:
            self.recorder.confirm(self.clock.now(), known)
        if isinstance(sink, Suspending):
            for text in self.in_force.new_alarms(sink):
                self.say("link", text)
            for target, status in list(suspensions(sink, in_force, self.state)):
                self.order(target, status)

    def say(self, kind: str, text: str) -> None:
        """Add a line to the event list and the journal."""
        event = self.events.tell(self.clock.now(), kind, text)
        if event is not None and self.recorder is not None and kind != "state":
            self.recorder.alarm(*astuple(event))
