"""State file of a service: read at the start, set aside if unusable, written while the service runs."""

import contextlib
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.live import statefile
from thermocomp.live.clock import ServiceClock
from thermocomp.live.storedzero import StateOfOthers, StoredZero
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import NO_ZERO, UNKNOWN, CompensatorState, Status, resume, silence

#: reason why a target runs in shadow: by configuration
CONFIGURED = "by configuration"

#: orders that remain although there is no zero: the correction is not in force, or not known
_STRONGER = ("shadow", *UNKNOWN)
ASKED = "let the machine cool down, set its zero anew, then order 're-zero'"
#: in a state file, while the only zero there is was taken on a machine that may have been warm
_INVALID = StoredZero(begun=math.nan, read=math.nan, inputs={}, targets={})
#: correction in force above which the machine may be warm [um]
WARM = 1.0


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
        #: whether there was no file
        self.first, self.configured = True, path is not None
        #: targets whose correction in force comes from the file
        self.known: frozenset[str] = frozenset()
        #: zero of other models that is to be taken over
        self.pending: StateOfOthers | None = None
        #: order of targets whose models have no valid zero
        self.no_zero: Status | None = None
        #: why the models take a new zero at the start; empty if they continue from the state
        self.cold = "" if path is not None else "no state file is configured"
        self._aged: Mapping[str, Correction] | None = None  # corrections of a state that is older than a day
        self._zero: StoredZero | None = None
        self._age = self._begun = 0.0  # age of the state when it was read, and the time of the clock [s]

    def begin(self) -> CompensatorState:
        """Return the initial state of the compensator: from the file, or that of a cold start."""
        cold = self._compensator.start()
        if self._path is None:
            return cold
        if not self._path.exists():
            self.cold = f"there is no {self._path.name}"
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
            if (others := statefile.read_zero(self._path)) is not None:
                return self._begin_with_others(others, cold)
            self._say(f"cold start: {e}")
            self._refused, self.cold = self._path, f"{self._path.name} cannot be used"
            return cold
        age, self._zero = self._date(saved.written), None if saved.others is None else saved.others.zero
        most = self._compensator.thresholds.resumable
        state, recent = resume(saved.state, cold, age, None, self._begun, most), 0.0 <= age <= most
        self.known = frozenset(state.corrections)
        state = state._replace(orders=cold.orders | _restored(state.orders, cold=not recent))
        held = [o for o in state.orders.values() if o.word == NO_ZERO]
        if not recent:
            self.cold, self._aged = f"{self._path.name} is {_tell_age(age)}", state.corrections
            if age < 0.0 and any(max(abs(d.offset), abs(d.slope)) > WARM for d in saved.state.raw.values()):
                state = self.hold(state, f"{self.cold}, and the machine was warm when it was written: {ASKED}")
        elif self._zero is None:
            self.no_zero = held[0] if held else None
        elif self._zero.begun != state.zeroed:
            state = self.hold(state, held[0].reason if held else f"these models took their zero warm: {ASKED}")
        how = "continues" if state.references else "starts again, with the corrections that are in force"
        self._say(f"start after {age:.0f} s: {how}")
        return state

    def _date(self, written: datetime) -> float:
        """Return the age of a state that was just read [s]."""
        self._begun = self._clock.tick()
        self._age = (datetime.now(UTC) - written).total_seconds() * self._clock.speed
        return self._age

    def _begin_with_others(self, others: StateOfOthers, cold: CompensatorState) -> CompensatorState:
        """Return a cold start from the corrections in force at other models; `take_over` adds their zero."""
        age, lines, most = self._date(others.written), self._compensator.lines, self._compensator.limits.magnitude
        targets = {t: s for t, s in others.zero.targets.items() if t in lines}
        found = {t: s.correction for t, s in targets.items()}
        found = {t: c for t, c in found.items() if max(abs(c.at(p)) for p in lines[t].travel) <= most}
        orders = _restored({t: s.order for t, s in targets.items() if s.order is not None}, cold=True)
        orders = {t: o for t, o in orders.items() if t not in cold.orders or o.word in UNKNOWN}
        self.known, self._zero = frozenset(found), others.zero
        if 0.0 <= age <= self._compensator.thresholds.resumable:
            self.pending = others
            self._say(f"start with other models after {age:.0f} s: they take over the zero of {others}")
        else:
            self.cold, self._aged = f"{others} belongs to other models, and is {_tell_age(age)}", found
            self._say(f"cold start: {others} belongs to other models, and is {age:.0f} s old")
        return cold._replace(
            corrections=cold.corrections | found, orders=cold.orders | orders, away=age if age >= 0.0 else math.nan
        )

    def take_over(self, state: CompensatorState, rebuilt: CompensatorState | str) -> CompensatorState:
        """Return the state of new models with the corrections in force; or hold these, if something is missing."""
        zero, self.pending = self._zero, None
        if isinstance(rebuilt, str):
            self._say(f"the models have no valid zero: {rebuilt}")
            return self.hold(state, f"{rebuilt}: {ASKED}")
        self._say("the slow states are rebuilt from the journal")
        assert zero is not None
        assert rebuilt.time is not None
        age = self._age + max(zero.read - rebuilt.time - rebuilt.origin, 0.0)
        why = "the models are new: the correction moves to theirs"
        kept = rebuilt._replace(orders=state.orders, because=why if age <= self._compensator.limits.hold else "")
        return resume(kept, state, age, state.corrections, self._begun, math.inf)

    def hold_if_warm(
        self, state: CompensatorState, target: str, in_force: Correction, *, lately: bool
    ) -> CompensatorState:
        """Return the state with the corrections held if the models take a new zero on a machine that may be warm.

        After more than a day the machine counts as cold, unless it was compensated since then.

        Parameters
        ----------
        in_force : Correction
            As known to a sink.
        lately : bool
            It was in force, or sent, less than a day ago.
        """
        if not self.cold or self.no_zero is not None or _size(in_force) <= WARM:
            return state
        if self._aged is not None and not lately and _size(in_force, self._aged.get(target)) <= WARM:
            return state
        what = f"{in_force.offset:+.1f} um" + (f" and {in_force.slope:+.1f} um/m" if in_force.slope else "")
        return self.hold(state, f"{self.cold}, but {target} has {what} in force, so the machine may be warm: {ASKED}")

    def hold(self, state: CompensatorState, why: str) -> CompensatorState:
        """Return the state with the corrections held, until there is a valid zero; shadow comes before that."""
        self.no_zero = Status(NO_ZERO, why)
        free = [t for t in state.corrections if (o := state.orders.get(t)) is None or o.word not in _STRONGER]
        return state._replace(orders=state.orders | dict.fromkeys(free, self.no_zero))

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
            # without a valid zero, the last valid one stays in the file; the state does not begin with it, and so tells
            before = self._zero if self.no_zero is not None or math.isnan(state.origin) else None
            if before is None and self.no_zero is not None:
                before = _INVALID
            statefile.write(state, self._compensator, self._path, datetime.now(UTC) - old, before)
            self.not_saved = ""
        except (ThermocompError, OSError) as e:
            if not self.not_saved:
                self._say(f"the state is not saved: {e}")
            self.not_saved = str(e)


def _size(found: Correction, other: Correction | None = None) -> float:
    """Return the size of a correction, or of its difference from another one [um, um/m]."""
    other = other or Correction(0.0)
    return max(abs(found.at(0.0) - other.at(0.0)), abs(found.slope - other.slope))


def _tell_age(age: float) -> str:
    return f"{age / 3600.0:,.0f} h old" if age >= 0.0 else "of a time to come"


def _restored(orders: Mapping[str, Status], *, cold: bool) -> dict[str, Status]:
    """Return the orders that remain after a restart; those by the controller or the configuration are issued again.

    Parameters
    ----------
    cold : bool
        A new zero is taken, so that none is missing.
    """
    dropped = ("suspended", NO_ZERO) if cold else ("suspended",)
    return {t: o for t, o in orders.items() if o.word not in dropped and o.reason != CONFIGURED}
