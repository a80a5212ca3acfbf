"""Probings of a running service: pending ones, used ones, and their results."""

from collections import deque
from collections.abc import Callable, Mapping

from thermocomp.core.correction import Correction, uncompensated
from thermocomp.core.reading import Measurement
from thermocomp.live.clock import ServiceClock
from thermocomp.live.probe import KEPT, Checked, check
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.adaptation import Adaptation, Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.identity import KNOWN, is_known
from thermocomp.runtime.state import NO_ZERO, Compensated, CompensatorState


class ProbingLedger:
    """Collects probing measurements of the tool point and stores their results.

    Parameters
    ----------
    say : callable
        Called with a line of text for the event list.
    """

    def __init__(self, compensator: Compensator, clock: ServiceClock, say: Callable[[str], None]) -> None:
        self._compensator, self._clock, self._say = compensator, clock, say
        #: probings that wait for the next reading, by target
        self.waiting = dict[str, Probing]()
        #: adaptation before the probing used last, by target
        self.before = dict[str, Adaptation | None]()
        #: results of probings, newest last
        self.checked = deque[Checked](maxlen=KEPT)
        self._measured = dict[str, tuple[Measurement, Correction | None]]()

    def measure(self, found: Measurement, state: CompensatorState, in_force: Correction | None) -> None:
        """Queue a measurement as a probing for the next reading.

        A measurement that includes the correction (``left`` is false: LinuxCNC's ``#5063`` is a motor position) is the
        uncompensated deviation.

        Parameters
        ----------
        in_force : Correction or None
            Correction at the time of the measurement; None: unknown.
        """
        probing = Probing(found.measured, found.repeatability, found.position, found.keys)
        if found.left and in_force is not None:
            deviation = uncompensated(found.measured, in_force.at(found.position))
            probing = probing._replace(deviation=deviation, keys=probing.identity)
        if why := self._refuse(found, probing, state, in_force):
            self._say(f"{found.target} refused: {why}")
            return
        self._measured[found.target] = (found, in_force)
        self.waiting[found.target] = probing

    def _refuse(
        self, found: Measurement, probing: Probing, state: CompensatorState, in_force: Correction | None
    ) -> str:
        """Return the reason why a measurement cannot be used with the next reading; empty if it can."""
        target, old = found.target, self._clock.now() - self._clock.of(found.time)
        if target not in self._compensator.lines:
            return f"no target is named {target}"
        if abs(old) > self._compensator.limits.reading_age:
            return (
                f"the measurement is {old:.0f} s old"
                if old > 0
                else f"the time of the measurement is {-old:.0f} s ahead of the clock"
            )
        counted, order = state.references.get(target), state.orders.get(target)
        early = counted is not None and self._clock.of(found.time) < counted.time
        if early or (order is not None and order.word == NO_ZERO):
            return (
                "the measurement was made before the present zero was set" if early else "its model has no valid zero"
            )
        waiting = self.waiting.get(target)
        if is_known(state, target, probing) or (waiting and set(waiting.identity) & set(probing.identity)):
            return KNOWN
        if waiting:
            return "another measurement is waiting for the next reading"
        unknown = found.left and in_force is None
        return "it is not known which correction was in force at the controller" if unknown else ""

    def take(self) -> dict[str, Probing]:
        """Return the pending probings for a reading, and clear them."""
        taken, self.waiting = self.waiting, {}
        return taken

    def note(
        self,
        probings: Mapping[str, Probing],
        said: Compensated,
        learned: Mapping[str, Adaptation],
        state: CompensatorState,
        recorder: Recorder | None,
    ) -> None:
        """Store the results of probings for display and roll-back."""
        for target, probing in probings.items():
            if target in said.deviations:
                refused, after = said.refused.get(target, ""), state.learned.get(target)
                found = check(self._clock.now(), target, probing, said.deviations[target], after, refused)
                self._record(found, said.deviations[target].offset + said.moved.get(target, 0.0), recorder)
                if not refused:
                    self.before[target] = learned.get(target)

    def _record(self, found: Checked, after: float, recorder: Recorder | None) -> None:
        self.checked.append(found)
        if recorder is not None:
            recorder.update(found, after)
            if not found.refused and found.target in self._measured:  # a rejected measurement gives no deviation
                recorder.measure(found.time, *self._measured[found.target])
        if found.beyond:
            limit = f"more than the limit of {found.limit:.1f} um"
            self._say(f"{found.target} was wrong by {found.residual:+.1f} um, {limit}: look for the cause")

    def forget(self, target: str) -> None:
        """Drop the probings of a target that refer to a previous zero."""
        self.before.pop(target, None)
        self.waiting.pop(target, None)

    def take_back(self, target: str, state: CompensatorState) -> CompensatorState:
        """Return the state without the last probing of a target, which must be in `before`."""
        learned, before = dict(state.learned), self.before.pop(target)
        learned.pop(target, None)
        return state._replace(learned=learned if before is None else learned | {target: before})
