"""The slow states of new models on a warm machine: the journal's readings replayed from the zero that is taken over."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.inputs import Input
from thermocomp.core.reading import Reading
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.storedzero import StateOfOthers, StoredZero
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.powerup import find_slowest
from thermocomp.runtime.state import CompensatorState, Reference
from thermocomp.runtime.watchstate import begin

#: after this multiple of its time constant, a slow state no longer depends on its first value
FORGOTTEN = 5.0
#: longest interval of the replayed readings [s], and the interval as a fraction of their age
COARSEST, FINENESS = 60.0, 0.01


def rebuild(compensator: Compensator, others: StateOfOthers, journal: Path | None) -> CompensatorState | str:
    """Return the state of new models with the zero of an earlier state, advanced by the readings in the journal.

    If that is not possible, return what is missing.

    Parameters
    ----------
    journal : Path or None
        None: there is no journal.
    """
    if unknown := others.zero.find_missing(compensator):
        return "; ".join(f"{_find_users(compensator, n)} uses {n}, {others} {why}" for n, why in unknown.items())
    if journal is None:
        return "no journal is configured to rebuild the slow states from"
    try:
        return _replay(compensator, others.zero, JournalReader(journal))
    except (ThermocompError, OSError, ValueError, OverflowError) as e:  # the last two: of a time that is no date
        return f"the journal cannot be used: {e}"


def _find_users(compensator: Compensator, name: str) -> str:
    users = [m.target for m in compensator.models if name in (i.name for i in m.inputs)]
    return f"the model of {' and '.join(users)}" if users else "sensor monitoring"


def _zeroed(compensator: Compensator, zero: StoredZero) -> CompensatorState:
    """Return the state before the first reading, with a known zero."""
    known = {name: i.value for name, i in zero.inputs.items()}

    def reference(inputs: tuple[Input, ...]) -> FloatArray:
        return np.array([known[i.name] if i.rezero else i.reference for i in inputs])

    references = {t: s.reference for t, s in zero.targets.items() if s.reference is not None}
    taken = Reference(zero.begun, "taken over from earlier models")
    state = compensator.start()._replace(
        zeroed=zero.begun, references={t: references.get(t, taken) for t in compensator.lines}
    )
    models = [m.init(reference(m.inputs)) for m in compensator.models]
    watches = tuple(begin(w, reference(w.inputs)) for w in compensator.watches)
    return compensator.share(models, state._replace(watches=watches))


def _replay(compensator: Compensator, zero: StoredZero, journal: JournalReader) -> CompensatorState | str:
    """Advance the state at the zero by the readings since the zero, or since the slowest state has forgotten it.

    Recent readings count most: the interval grows with their age, from `Thresholds.check_interval` to a minute. A gap
    up to `Limits.hold`, for which a service holds its corrections, is bridged; after a longer one, the slow states are
    not known.
    """
    every, longest = compensator.thresholds.check_interval, compensator.limits.hold
    since = max(zero.begun, zero.read - FORGOTTEN * find_slowest(compensator) - longest)
    state, first, at, rejected = _zeroed(compensator, zero), True, since, ""
    for row in journal.readings(since, lambda t: min(max(every, FINENESS * (zero.read - t)), COARSEST)):
        if first and since == zero.begun:  # at rest in the zero, as after a start with these models
            values = {**row.values, **{name: i.value for name, i in zero.inputs.items()}}
            state, _ = compensator.step(state, Reading(row.time - every, values), row.time - every)
        state, said = compensator.step(state, Reading(row.time, row.values), row.time)
        first, rejected = False, said.rejected or rejected
        if not said.rejected:
            if gap := _explain_gap(at, row.time, longest, rejected):
                return gap
            at, rejected = row.time, ""
    if state.time is None:  # however short the time since the zero, nothing is known of it
        longest = -1.0
    return _explain_gap(at, zero.read, longest, rejected) or state


def _explain_gap(begin: float, end: float, longest: float, rejected: str) -> str:
    """Return what is missing between two accepted readings; empty if they are close enough."""
    if end - begin <= longest:
        return ""
    begins, ends = (f"{datetime.fromtimestamp(t, UTC):%Y-%m-%d %H:%M}" for t in (begin, end))
    why = f" ({rejected})" if rejected else ""
    return f"the journal has no usable readings from {begins} to {ends} UTC{why} to rebuild the slow states from"
