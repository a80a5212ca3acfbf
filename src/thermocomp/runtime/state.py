"""State of a compensator between two readings, and its output for a reading."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.model import State
from thermocomp.core.zero import Gathered
from thermocomp.runtime.adaptation import Adaptation
from thermocomp.runtime.watch import WatchState

Word = Literal["active", "holding", "fading", "suspended", "shadow", "restarting"]

#: a state that is older is of another day: the machine starts again, but for the corrections in force [s]
FORGOTTEN = 24 * 3600.0


class Status(NamedTuple):
    """Status of a target or axis: a word of `Word`, and the reason."""

    word: Word
    reason: str = ""


class Reference(NamedTuple):
    """From which instant a target or axis counts, and why.

    `shift` is what the models said there, together with the correction that was in force: nothing jumps where a zero is
    set again.
    """

    time: float  #: on the stamps of the readings [s]
    why: str
    shift: Deviation = Deviation(0.0)  #: what is taken off what the models say


class CompensatorState(NamedTuple):
    """State of a compensator between two readings. Its times are stamps of the readings minus `origin`."""

    models: tuple[State, ...]  #: one per model
    corrections: dict[str, Correction]  #: in force, by target or axis
    time: float | None  #: of the last reading that passed the gate [s]
    clock: float | None  #: the latest at which a step was taken, on the monotone clock of the process [s]
    taken: float | None  #: on the same clock, when the last reading passed the gate, or `away` after that [s]
    origin: float  #: what the clock of the readings was set by meanwhile [s]; nan: unknown, after a restart
    gathered: tuple[Gathered, ...]  #: readings that the zero is averaged of, one per model; empty once it is known
    watches: tuple[WatchState, ...]  #: over the temperatures
    idle: dict[str, float]  #: how long no model has driven each target or axis; not there: one drives it [s]
    learned: dict[str, Adaptation]  #: from probings, by target or axis
    references: dict[str, Reference]  #: what each target or axis counts from; not there: its zero is being averaged
    raw: dict[str, Deviation]  #: what the models said last, by target or axis
    orders: dict[str, Status]  #: targets or axes that somebody, or the controller, has taken out, and why
    away: float | None  #: so long nothing ran before the last restart, until the corrections have caught up [s]
    #: when each key of a probing came first, by target or axis [s]
    probed: Mapping[str, dict[str, float]] = MappingProxyType({})


class Compensated(NamedTuple):
    """Output of a compensator for one reading."""

    corrections: dict[str, Correction]  #: in force after this reading, by target or axis
    rejected: str  #: why the gate turned the reading away; empty if it passed
    outside: tuple[str, ...]  #: inputs outside the trained range of a model
    failed: dict[str, str]  #: sensors that are not believed, and what they are: see `thermocomp.runtime.watch`
    states: dict[str, Status]  #: of each target or axis
    deviations: dict[str, Deviation]  #: what the models say, with what was learned from probings
    half_widths: dict[str, float]  #: of the band about the deviation, by target or axis that has one [um]
    refused: dict[str, str]  #: targets or axes whose probing was not used, and why
    moved: Mapping[str, float] = MappingProxyType({})  #: by how much probings move deviations from now on [um]

    @property
    def held(self) -> dict[str, str]:
        """Targets or axes that no model drives, and why."""
        return {t: s.reason for t, s in self.states.items() if s.word in ("holding", "fading")}


def silence(state: CompensatorState, tick: float) -> float:
    """Return the time since the last reading that passed the gate, restarts included; 0 before the first [s].

    Parameters
    ----------
    state : CompensatorState
    tick : float
        The monotone clock of the process, now [s].
    """
    passed = 0.0 if state.taken is None else max(tick - state.taken, 0.0)
    return passed + (state.away or 0.0) if math.isnan(state.origin) else passed


def resume(
    state: CompensatorState,
    cold: CompensatorState,
    age: float,
    in_force: Mapping[str, Correction] | None = None,
    tick: float | None = None,
) -> CompensatorState:
    """Return the state to continue with after a restart.

    Up to `FORGOTTEN` the models continue from what they remember, as after an outage: what they read then counts as
    having been there all the time. After that, or of unknown age, the machine starts again. The correction in force
    stays in either case, and moves from there within the limits.

    Parameters
    ----------
    state : CompensatorState
        As it was saved.
    cold : CompensatorState
        State of a compensator that starts.
    age : float
        Since the last reading in it [s].
    in_force : mapping of str to Correction, optional
        Correction in force as reported by the controller. Default: the saved one.
    tick : float, optional
        The monotone clock of the process, now: what goes by until the first reading is part of the outage, too [s].

    Returns
    -------
    CompensatorState
    """
    corrections = {t: (in_force or state.corrections).get(t, c) for t, c in cold.corrections.items()}
    if not 0.0 <= age <= FORGOTTEN:
        return cold._replace(corrections=corrections, orders=state.orders, away=age if age >= 0 else math.nan)
    return state._replace(corrections=corrections, clock=None, taken=tick, origin=math.nan, away=age)
