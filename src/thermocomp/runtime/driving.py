"""Movement of corrections in a step: a driven one follows its model within the limits; others are held, then fade."""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.runtime.adaptation import Adaptation
from thermocomp.runtime.gate import is_number
from thermocomp.runtime.limits import fade, limit_line
from thermocomp.runtime.lines import DeviationLine
from thermocomp.runtime.state import HELD, CompensatorState, Reference, Status

ACTIVE = Status("active")


@dataclass(kw_only=True, slots=True)
class Driven:
    """Changes by one reading, by target; see `CompensatorState` and `Compensated`."""

    corrections: dict[str, Correction]
    learned: dict[str, Adaptation]
    references: dict[str, Reference]
    raw: dict[str, Deviation]
    refused: dict[str, str]
    arrived: bool  #: no correction is still catching up after a restart
    held: dict[str, str] = field(default_factory=dict)  #: reasons why corrections are not driven
    states: dict[str, Status] = field(default_factory=dict)
    deviations: dict[str, Deviation] = field(default_factory=dict)
    half_widths: dict[str, float] = field(default_factory=dict)
    moved: dict[str, float] = field(default_factory=dict)

    @classmethod
    def begin(cls, state: CompensatorState, probed: Iterable[str]) -> "Driven":
        """Return the values before the models are evaluated: those of the previous state."""
        return cls(
            corrections=dict(state.corrections),
            learned=dict(state.learned),
            references=dict(state.references),
            raw=dict(state.raw),
            refused=dict.fromkeys(probed, "no model computes the correction"),
            arrived=state.away is not None,
        )


class Rest(NamedTuple):
    """Corrections after a step, and the status of those not driven; see `CompensatorState`."""

    corrections: dict[str, Correction]  #: of all targets or axes
    clock: float | None
    idle: dict[str, float]
    states: dict[str, Status]  #: of those that are not driven


def travel_time(state: CompensatorState, tick: float, limits: Limits) -> float:
    """Return the time that counts in a step [s]; outages and rejected readings do not accumulate travel."""
    if state.clock is None or not is_number(tick):
        return 0.0
    return max(0.0, min(tick - state.clock, limits.reading_age))


def drive(
    state: CompensatorState,
    target: str,
    line: DeviationLine,
    deviation: Deviation,
    travel: float,
    limits: Limits,
    near: float,
) -> tuple[Correction, Status]:
    """Return the correction for a deviation, within the limits, and the status of the target.

    Parameters
    ----------
    travel : float
        Time that counts for the movement [s].
    near : float
        See `Thresholds.caught_up` [um].
    """
    before, order = state.corrections[target], state.orders.get(target)
    wanted = Correction.opposing(deviation)
    if order is not None and order.word in HELD:
        return before, order
    if order is not None:  # shadow
        return limit_line(Correction(0.0), before, line.travel, travel, replace(limits, dead_band=0.0)), order
    after = limit_line(wanted, before, line.travel, travel, limits)
    if state.away is not None and _apart(wanted, after, line.travel) > max(near, limits.dead_band):
        out = "an unknown time" if math.isnan(state.away) else f"{state.away:.0f} s"
        why = state.because or f"compensation did not run for {out}; measure with the probe, or re-zero"
        return after, Status("restarting", why)
    return after, ACTIVE


def rest(
    state: CompensatorState,
    corrections: Mapping[str, Correction],
    tick: float,
    lines: Mapping[str, DeviationLine],
    limits: Limits,
    held: Mapping[str, str],
    driven: Collection[str] = (),
) -> Rest:
    """Fade corrections that have not been driven for longer than the hold time.

    Parameters
    ----------
    tick : float
        Present time of the monotonic clock of the process [s].
    """
    # each step counts for at most the maximum age of a reading: a clock jump does not cause fading
    travel = travel_time(state, tick, limits)
    clock = state.clock if not is_number(tick) else tick if state.clock is None else max(state.clock, tick)
    moved, states = dict(corrections), dict[str, Status]()
    idle = {t: s for t, s in state.idle.items() if t not in driven}
    for target, why in held.items():
        order = state.orders.get(target)
        if order is not None and order.word in HELD:
            states[target] = order
            continue
        idle[target] = idle.get(target, 0.0) + travel
        ends = lines[target].travel
        moved[target] = fade(moved[target], ends, idle[target], travel, limits)
        if order is not None:
            states[target] = order
            continue
        word: Literal["fading", "holding"] = "fading" if idle[target] > limits.hold else "holding"
        states[target] = Status(word, f"no model has updated the correction for {idle[target]:.0f} s: {why}")
    return Rest(moved, clock, idle, states)


def _apart(one: Correction, other: Correction, travel: tuple[float, float]) -> float:
    """Return the largest difference of two corrections along the travel [um]."""
    return max(abs(one.at(p) - other.at(p)) for p in travel)
