"""The service: readings come in, the compensator takes each, corrections go out; whatever fails, the rest goes on."""

import asyncio
import contextlib
import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

from thermocomp.core.correction import Correction, uncompensated
from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.core.ports import Confirming, Probe, Sink, Source, Suspending
from thermocomp.core.reading import Measurement, Reading
from thermocomp.live import statefile
from thermocomp.live.clock import ServiceClock
from thermocomp.live.events import Events
from thermocomp.live.latest import Latest
from thermocomp.live.links import TIMEOUT, Inlet, Link, Outlet, within
from thermocomp.live.probe import KEPT, Checked, check
from thermocomp.live.recorder import CONFIRM_WITHIN, Recorder
from thermocomp.runtime.adaptation import Adaptation, Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.identity import KNOWN, is_known
from thermocomp.runtime.orders import order, rezero, withdraw
from thermocomp.runtime.state import Compensated, CompensatorState, Status, resume, silence

#: points of each curve that are kept to be shown, and time between two [s of the machine]
POINTS, EVERY = 720, 30.0
#: why a target is in shadow that the configuration put there
CONFIGURED = "by configuration"


@dataclass
class Service:
    """A compensator between sources and sinks.

    Parameters
    ----------
    compensator : Compensator
    sources : sequence of Source
    sinks : sequence of Sink
    clock : ServiceClock
    state_path : Path or None
        Where the state is kept.
    probes : sequence of Probe
    recorder : Recorder or None
        Of the journal.
    """

    compensator: Compensator
    sources: Sequence[Source]
    sinks: Sequence[Sink]
    clock: ServiceClock = field(default_factory=ServiceClock)
    state_path: Path | None = None
    probes: Sequence[Probe] = ()
    recorder: Recorder | None = None
    state: CompensatorState = field(init=False)
    said: Compensated | None = field(default=None, init=False)
    events: Events = field(default_factory=Events, init=False)
    curves: deque[dict[str, float]] = field(init=False)  #: what is drawn: a row of numbers, ``time`` first
    latest: Latest = field(init=False)  #: value and when, by channel
    counts: dict[str, int] = field(default_factory=lambda: {"readings": 0, "rejected": 0}, init=False)
    probings: dict[str, Probing] = field(default_factory=dict, init=False)  #: that wait for the next reading
    checked: deque[Checked] = field(init=False)  #: what probings said
    before: dict[str, Adaptation | None] = field(default_factory=dict, init=False)  #: the last one was taken
    measured: dict[str, tuple[Measurement, Correction | None]] = field(default_factory=dict, init=False)  #: as well
    not_saved: str = field(default="", init=False)  #: why the state was not, last; empty if it was
    confirmed: dict[str, tuple[Correction, float]] = field(default_factory=dict, init=False)  #: in force, and when

    def __post_init__(self) -> None:
        self.curves, self.checked = deque(maxlen=POINTS), deque(maxlen=KEPT)
        models = self.compensator.models
        self.latest = Latest(i.name for m in models for i in (*m.inputs, *(m.watch.inputs if m.watch else ())))
        # what a controller says is in force goes before what a file says
        controllers: list[Sink] = [s for s in self.sinks if isinstance(s, Suspending)]
        self._sure = controllers or list(self.sinks)
        self.outlets = [Outlet(sink, self._hear if sink in self._sure else None) for sink in self.sinks]
        self.inlets = self._make_inlets()
        self._refused: Path | None = None
        self.state = self._begin()
        self._saved, self._dirty, self._trouble, self._ending = -1e9, False, "", False
        self._alarms = dict[str, str]()
        self._heard = self.clock.tick()

    # -- what happens --------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Run until it is cancelled; then save the state and leave the corrections as they are."""
        self._put_aside()
        if self.recorder is not None:
            await asyncio.to_thread(self.recorder.journal.flush)
        self.inlets = self._make_inlets()
        for sink in self.sinks:
            await within(TIMEOUT, self._adopt(sink))  # if it fails, its link says why
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
            self._save()
            if self.recorder is not None:
                self.recorder.journal.close()

    def take(self, reading: Reading) -> None:
        """Take a reading of a source in: with it goes the latest of the others."""
        if self._ending:
            return
        tick, now = self.clock.tick(), self.clock.now()
        stamp, most = self.clock.of(reading.time), self.compensator.limits.reading_age
        if not -most <= now - stamp <= most:
            self.counts["rejected"] += 1
            return
        if left_out := self.latest.take(reading.values, tick, most):
            self.say("link", f"more names that nothing uses than are kept; {left_out!r} and others are left out")
        fresh = {name: value for name, (value, at) in self.latest.items() if tick - at <= most}
        (probings, self.probings), learned = (self.probings, {}), self.state.learned
        self.state, said = self.compensator.step(self.state, Reading(now, fresh), now, probings, tick)
        self._heard = tick
        self.counts["readings"] += 1
        self.counts["rejected"] += bool(said.rejected)
        self._tell(said, probings)
        if self.recorder is not None:
            self.recorder.take(now, fresh, said)
            self.recorder.count(now, self.state.references)
        self._chart(said, probings, learned)

    def order(self, target: str, status: Status | None) -> None:
        """Suspend or resume a target; see `thermocomp.runtime.orders.order`."""
        before = self.state.orders.get(target)
        self.state = order(self.compensator, self.state, target, status)
        if before == status:  # it is so: no news
            return
        word = f"{status.word}: {status.reason}" if status else "runs again"
        self.say("state", f"{target} {word}, as ordered")
        self._dirty = True

    def watch_only(self, target: str) -> None:
        """Let a target run in shadow from the start, as configured."""
        self.state = order(self.compensator, self.state, target, Status("shadow", CONFIGURED))

    def rezero(self, target: str, why: str, in_force: Correction | None = None) -> None:
        """Reset the reference of a target; see `thermocomp.runtime.orders.rezero`."""
        self.state = rezero(self.compensator, self.state, target, self.clock.now(), why, in_force)
        for counted_before in (self.before, self.probings):  # from the zero before
            counted_before.pop(target, None)
        self.say("reference", f"{target} counts anew: {why}")
        self._dirty = True

    def measure(self, found: Measurement) -> None:
        """Take a measurement of the tool point as a probing, with the next reading.

        One that contains the correction (``left`` is false: LinuxCNC's ``#5063`` is a position of the motor) is the
        deviation as it is.
        """
        in_force = self.in_force(found.target) if found.target in self.compensator.lines else None
        probing = Probing(found.measured, found.repeatability, found.position, found.keys)
        if found.left and in_force is not None:
            deviation = uncompensated(found.measured, in_force.at(found.position))
            probing = probing._replace(deviation=deviation, keys=probing.identity)
        if why := self._refuse(found, probing, in_force):
            self.say("probing", f"{found.target} refused: {why}")
            return
        self.measured[found.target] = (found, in_force)
        self.probings[found.target] = probing

    def _refuse(self, found: Measurement, probing: Probing, in_force: Correction | None) -> str:
        """Say why a measurement is not used with the next reading; the empty string if it is."""
        target, old = found.target, self.clock.now() - self.clock.of(found.time)
        if target not in self.compensator.lines:
            return f"no target is named {target}"
        if abs(old) > self.compensator.limits.reading_age:
            return f"it is {old:.0f} s old" if old > 0 else f"its time is {-old:.0f} s ahead of the clock"
        counted = self.state.references.get(target)
        if counted is not None and self.clock.of(found.time) < counted.time:
            return "it was made before the zero that is counted from now"
        waiting = self.probings.get(target)
        if is_known(self.state, target, probing) or (waiting and set(waiting.identity) & set(probing.identity)):
            return KNOWN
        if waiting:
            return "another one waits for the next reading"
        unknown = found.left and in_force is None
        return "what is in force at the controller is not known" if unknown else ""

    def in_force(self, target: str) -> Correction | None:
        """Return the correction in force: as confirmed lately, or as asked for if no sink confirms; None: not known."""
        if not any(isinstance(sink, Confirming) for sink in self._sure):
            return self.state.corrections[target]
        found, at = self.confirmed.get(target, (None, -math.inf))
        return found if self.clock.tick() - at <= CONFIRM_WITHIN * self.clock.speed else None

    def roll_back(self, target: str) -> str:
        """Forget the last probing of a target that was taken; return why not, or the empty string."""
        if target not in self.before:
            return "no probing was taken since the start, or it was taken back before"
        learned, before = dict(self.state.learned), self.before.pop(target)
        learned.pop(target, None)
        self.state = self.state._replace(learned=learned if before is None else learned | {target: before})
        self.say("probing", f"{target}: the last probing is taken back")
        self._dirty = True
        return ""

    async def fade_out(self) -> None:
        """Let all corrections go to zero, within the limits, whatever readings come or do not."""
        self._ending, last = True, self.clock.tick()
        self.say("service", "is being stopped: corrections go to zero")
        while any(c.offset or c.slope for c in self.state.corrections.values()):
            await asyncio.sleep(0.1)
            tick = self.clock.tick()
            self.state = withdraw(self.compensator, self.state, tick - last)
            last = tick
            for outlet in self.outlets:
                outlet.put(self.state.corrections)
        for outlet in self.outlets:
            await outlet.flush()

    def links(self) -> list[Link]:
        """Return the links of sources, probes and sinks, in this order."""
        return [*self.inlets, *self.outlets]

    # -- inside --------------------------------------------------------------------------------------------------------

    def _make_inlets(self) -> list[Inlet]:
        sources = [Inlet(source, source.readings, self.take) for source in self.sources]
        return sources + [Inlet(probe, probe.measurements, self.measure) for probe in self.probes]

    def _begin(self) -> CompensatorState:
        cold = self.compensator.start()
        if self.state_path is None:
            return cold
        if not self.state_path.exists():
            self.say("service", f"cold start: there is no {self.state_path}")
            return cold
        try:
            saved = statefile.read(self.state_path, self.compensator)
        except ThermocompError as e:
            if not statefile.is_ours(self.state_path):
                raise InputError(f"{self.state_path}: is no state file, and would be written over; name another") from e
            self.say("service", f"cold start: {e}")
            self._refused = self.state_path
            return cold
        age = (datetime.now(UTC) - saved.written).total_seconds() * self.clock.speed
        state = resume(saved.state, cold, age, tick=self.clock.tick())
        # what the controller or the configuration ordered is theirs to say again
        own = {t: o for t, o in state.orders.items() if o.word != "suspended" and o.reason != CONFIGURED}
        state = state._replace(orders=cold.orders | own)
        how = "goes on" if state.references else "begins anew, with the corrections that are in force"
        self.say("service", f"start after {age:.0f} s: {how}")
        return state

    def _put_aside(self) -> None:
        """Keep a state file that could not be used."""
        if self._refused is not None:
            with contextlib.suppress(OSError):
                self._refused.replace(self._refused.with_name(f"{self._refused.name}.refused"))

    async def _adopt(self, sink: Sink) -> None:
        """Begin at what the controller says is in force: what was saved may be a second older."""
        if not isinstance(sink, Confirming):
            return
        await sink.connect(TIMEOUT)
        found = await sink.confirmed() or {}
        allowed = {t: c for t, c in found.items() if t in self.state.corrections and self._allowed(t, c)}
        self.state = self.state._replace(corrections=self.state.corrections | allowed)

    def _allowed(self, target: str, correction: Correction) -> bool:
        ends = self.compensator.lines[target].travel
        return max(abs(correction.at(p)) for p in ends) <= self.compensator.limits.magnitude

    async def _watch(self) -> None:
        """Look after what no reading does: time goes by, the state is saved."""
        while True:
            await asyncio.sleep(min(1.0, max(0.1, 1.0 / self.clock.speed)))
            tick = self.clock.tick()
            silent = tick - self._heard
            for one in self.links():
                for text in one.news():
                    self.say("link", text)
            if self._ending:
                continue
            if silent > max(2.0, 2.0 * self.clock.speed):
                why = f"no reading for {silent:.0f} s"
                self.state, said = self.compensator.wait(self.state, tick, why)
                self._tell(said, {})
                if self.recorder is not None:
                    self.recorder.tell(self.clock.now(), said)
            if self._dirty and time.monotonic() - self._saved >= 1.0:
                self._dirty, self._saved = False, time.monotonic()
                await asyncio.to_thread(self._save)
            if self.recorder is not None:
                await asyncio.to_thread(self.recorder.journal.flush)
                if (trouble := self.recorder.journal.status().reason) != self._trouble:
                    self._trouble = trouble
                    self.say("service", f"journal: {trouble or 'all is written again'}")

    def _tell(self, said: Compensated, probings: Mapping[str, Probing]) -> None:
        before, self.said = self.said, said
        for outlet in self.outlets:
            outlet.put(said.corrections)
        for target, status in said.states.items():
            if before is None or before.states.get(target, Status("active")).word != status.word:
                self.say("state", f"{target} {status.word}" + (f": {status.reason}" if status.reason else ""))
        for name, fault in said.failed.items():
            if before is None or before.failed.get(name) != fault:
                self.say("sensor", f"{name} {fault}: what the others predict stands in")
        for name in (before.failed if before else {}).keys() - said.failed.keys():
            self.say("sensor", f"{name} is believed again")
        for target in probings:
            why, moved = said.refused.get(target), said.moved.get(target, 0.0)
            self.say("probing", f"{target} refused: {why}" if why else f"{target} taken: it moves by {moved:+.1f} um")
        now = self.clock.now()
        if said.deviations and (not self.curves or now - self.curves[-1]["time"] >= EVERY):
            self.curves.append({"time": now, **self._numbers(said)})
        self._dirty = True

    def _chart(self, said: Compensated, probings: Mapping[str, Probing], learned: Mapping[str, Adaptation]) -> None:
        for target, probing in probings.items():
            if target not in said.deviations:
                continue
            refused, after = said.refused.get(target, ""), self.state.learned.get(target)
            found = check(self.clock.now(), target, probing, said.deviations[target], after, refused)
            self.checked.append(found)
            if self.recorder is not None:
                self.recorder.update(found, said.deviations[target].offset + said.moved.get(target, 0.0))
                if not refused and target in self.measured:  # what is not believed is no deviation
                    self.recorder.measure(found.time, *self.measured[target])
            if not refused:
                self.before[target] = learned.get(target)
            if found.beyond:
                limit = f"where {found.limit:.1f} um ask for action"
                self.say("probing", f"{target} was wrong by {found.residual:+.1f} um, {limit}: look for the cause")

    def _hear(self, sink: Sink, in_force: Mapping[str, Correction]) -> None:
        """Take what a controller says is in force, and why it has none."""
        known = {t: c for t, c in in_force.items() if t in self.state.corrections}
        self.confirmed |= {t: (c, self.clock.tick()) for t, c in known.items()}
        if self.recorder is not None:
            self.recorder.confirm(self.clock.now(), known)
        if not isinstance(sink, Suspending):
            return
        away, alarms = sink.suspended(), dict(sink.alarms())
        for target in alarms.keys() | self._alarms.keys():
            if alarms.get(target) != self._alarms.get(target):
                self.say("link", f"{target}: {alarms.get(target, 'is in force as it shall be again')}")
        self._alarms = alarms
        for target in self.compensator.lines.keys() & in_force.keys() | away.keys() & self.compensator.lines.keys():
            order = self.state.orders.get(target)
            if target in away and (order is None or order.word not in ("suspended", "shadow", "holding")):
                self.order(target, Status("suspended", away[target]))
            elif target not in away and order is not None and order.word == "suspended":
                self.order(target, None)

    def _numbers(self, said: Compensated) -> dict[str, float]:
        heat = {i.name for m in self.compensator.models for i in m.inputs if i.quantity == "temperature"}
        found = {name: self.latest[name][0] for name in sorted(heat & self.latest.keys())}
        for target, deviation in said.deviations.items():
            found[f"{target} predicted"] = deviation.offset
            if target in said.half_widths:
                found[f"{target} +-"] = said.half_widths[target]
        return found | {f"{target} correction": c.offset for target, c in said.corrections.items()}

    def say(self, kind: str, text: str) -> None:
        """Put a line into the event list and the journal."""
        event = self.events.tell(self.clock.now(), kind, text)
        if event is not None and self.recorder is not None and kind != "state":
            self.recorder.alarm(*astuple(event))

    def _save(self) -> None:
        if self.state_path is None:
            self.not_saved = "no file is configured for it"
            return
        try:
            old = timedelta(seconds=silence(self.state, self.clock.tick()) / self.clock.speed)
            statefile.write(self.state, self.compensator, self.state_path, datetime.now(UTC) - old)
            self.not_saved = ""
        except (ThermocompError, OSError) as e:
            if self.not_saved != str(e):
                self.say("service", f"the state is not saved: {e}")
            self.not_saved = str(e)
