"""State of a compensator between two readings, and its output for a reading."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.state import State
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.zero import ZeroMean
from thermocomp.runtime.adaptation import Adaptation
from thermocomp.runtime.feed import FeedState
from thermocomp.runtime.watchstate import WatchState

#: words of a service in place of ``active``, if no controller confirms the correction
Unconfirmed = Literal["sent, not confirmed", "not confirmed", "not sent", "no sink"]
#: states of a target
Word = Literal[
    "active", "holding", "fading", "suspended", "shadow", "restarting", "no zero", "unknown", "first start", Unconfirmed
]  # fmt: skip
#: order of a target whose models have no valid zero: its correction is held until it is re-zeroed
NO_ZERO: Word = "no zero"
#: orders under which the correction in force is not known
UNKNOWN: tuple[Word, ...] = ("unknown", "first start")
#: orders under which a correction is held
HELD: tuple[Word, ...] = ("holding", "suspended", NO_ZERO, *UNKNOWN)


class Status(NamedTuple):
    """Status of a target or axis, such as ``holding``, and the reason."""

    word: Word
    reason: str = ""


class Reference(NamedTuple):
    """Zero of a target or axis: instant and reason.

    `shift` is the output of the models at that instant plus the correction in force, so that a reset of the zero causes
    no jump.
    """

    time: float  #: on the scale of the readings' stamps [s]
    why: str
    shift: Deviation = Deviation(0.0)  #: subtracted from the output of the models


class CompensatorState(NamedTuple):
    """State of a compensator between two readings. Its times are the readings' stamps minus `origin`."""

    models: tuple[State, ...]  #: one per model
    corrections: dict[str, Correction]  #: corrections in force, by target or axis
    time: float | None  #: of the last accepted reading [s]
    clock: float | None  #: latest time of a step, on the monotonic clock of the process [s]
    taken: float | None  #: time of the last accepted reading on the same clock, or `away` after it [s]
    origin: float  #: amount by which the clock of the readings was set; nan: unknown, after a restart [s]
    averaged: tuple[ZeroMean, ...]  #: mean of the readings of an unknown zero, one per model; empty once it is known
    watches: tuple[WatchState, ...]  #: of the temperatures
    idle: dict[str, float]  #: time for which no model has driven a target or axis; absent: driven [s]
    learned: dict[str, Adaptation]  #: adaptations by probings, by target or axis
    references: dict[str, Reference]  #: zero of each target or axis; absent: still being averaged
    raw: dict[str, Deviation]  #: last output of the models, by target or axis
    orders: dict[str, Status]  #: targets or axes suspended by a person or the controller, and why
    away: float | None  #: outage before the last restart; None once corrections have caught up [s]
    #: first arrival time of each key of a probing, by target or axis [s]
    probed: Mapping[str, dict[str, float]] = MappingProxyType({})
    zeroed: float = math.nan  #: stamp of the first reading of the zero; nan: unknown [s]
    because: str = ""  #: why corrections have to catch up; empty: because of the outage `away`
    feed: FeedState = FeedState()  #: repetition of the temperatures


class Compensated(NamedTuple):
    """Output of a compensator for one reading."""

    corrections: dict[str, Correction]  #: corrections in force after this reading, by target or axis
    rejected: str  #: reason why the gate rejected the reading; empty if accepted
    outside: tuple[str, ...]  #: inputs outside the trained range of a model
    failed: dict[str, str]  #: sensors not trusted, with the kind of fault: see `thermocomp.runtime.watch`
    states: dict[str, Status]  #: status of each target or axis
    deviations: dict[str, Deviation]  #: outputs of the models, adapted by probings
    half_widths: dict[str, float]  #: of the uncertainty bands, by target or axis with a band [um]
    refused: dict[str, str]  #: targets or axes with a refused probing, and the reason
    moved: Mapping[str, float] = MappingProxyType({})  #: change of deviations by new probings [um]

    @property
    def held(self) -> dict[str, str]:
        """Targets or axes that are not driven by a model, and the reasons."""
        return {t: s.reason for t, s in self.states.items() if s.word in ("holding", "fading")}


def silence(state: CompensatorState, tick: float) -> float:
    """Return the time since the last accepted reading, restarts included; 0 before the first [s].

    Parameters
    ----------
    tick : float
        Present time of the monotonic clock of the process [s].
    """
    passed = 0.0 if state.taken is None else max(tick - state.taken, 0.0)
    return passed + (state.away or 0.0) if math.isnan(state.origin) else passed


def resume(
    state: CompensatorState,
    cold: CompensatorState,
    age: float,
    in_force: Mapping[str, Correction] | None = None,
    tick: float | None = None,
    resumable: float = THRESHOLDS.resumable,
) -> CompensatorState:
    """Return the state with which to continue after a restart.

    Up to the age `resumable` the models continue from their memory, as after an outage: their first inputs are
    assumed to have been constant during the outage, but no temperature counts as stuck because it is the same as
    before. With a greater or unknown age, the compensator starts again. In both cases the correction in force is kept
    and moves from there within the limits.

    Parameters
    ----------
    age : float
        Time since the last reading of the state [s].
    in_force : mapping of str to Correction, optional
        Present correction as reported by the controller. Default: the saved one.
    tick : float, optional
        Present time of the monotonic clock of the process; time until the first reading is also part of the outage [s].
    resumable : float
        See `Thresholds.resumable` [s].
    """
    corrections = {t: (in_force or state.corrections).get(t, c) for t, c in cold.corrections.items()}
    if not 0.0 <= age <= resumable:
        return cold._replace(corrections=corrections, orders=state.orders, away=age if age >= 0 else math.nan)
    watches = state.watches
    if age > THRESHOLDS.fault_duration:  # a value that is the same by chance was not constant meanwhile
        watches = tuple(w._replace(same=np.full_like(w.same, np.nan)) for w in watches)
    return state._replace(watches=watches, corrections=corrections, clock=None, taken=tick, origin=math.nan, away=age)
