"""Commands to a compensator by a person or the controller: suspend a target, reset its zero, remove corrections."""

from dataclasses import replace

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.limits import limit_line
from thermocomp.runtime.state import NO_ZERO, CompensatorState, Reference, Status


def withdraw(compensator: Compensator, state: CompensatorState, passed: float) -> CompensatorState:
    """Move all corrections towards zero, within the limits.

    Parameters
    ----------
    passed : float
        Time since the previous step [s]; outages do not accumulate travel.
    """
    free, passed = replace(compensator.limits, dead_band=0.0), min(passed, compensator.limits.reading_age)
    found = {
        target: limit_line(Correction(0.0), c, compensator.lines[target].travel, passed, free)
        for target, c in state.corrections.items()
    }
    return state._replace(corrections=found)


def order(compensator: Compensator, state: CompensatorState, target: str, status: Status | None) -> CompensatorState:
    """Suspend or resume a target or axis.

    Parameters
    ----------
    status : Status or None
        ``holding``: the correction is held until a further command; ``shadow``: the target is predicted, and its
        correction moves to zero within the limits; ``suspended``: no correction is in force at the controller;
        after resuming, it starts at zero. None: run.
    """
    if target not in compensator.lines:
        raise InputError(f"there is no target {target}: expected one of {', '.join(compensator.lines)}")
    if status is not None and status.word not in ("holding", "shadow", "suspended"):
        raise InputError(
            f"{target}: {status.word!r} is not a state that can be ordered: expected holding, shadow or suspended"
        )
    if target in compensator.shadow and (status is None or status.word != "suspended"):
        raise InputError(f"{target} runs in shadow only: {compensator.shadow[target].reason}")
    orders = {t: s for t, s in state.orders.items() if t != target} | ({} if status is None else {target: status})
    corrections = dict(state.corrections)
    if status is not None and status.word == "suspended":
        corrections[target] = Correction(0.0)
    if status is None and target in compensator.shadow:
        orders[target] = compensator.shadow[target]
    return state._replace(orders=orders, corrections=corrections)


def wait_for_start(state: CompensatorState, target: str, status: Status) -> CompensatorState:
    """Hold a target whose correction in force is unknown until `start_from`; nothing may be sent for it meanwhile."""
    return state._replace(orders=state.orders | {target: status})


def start_from(
    compensator: Compensator, state: CompensatorState, target: str, in_force: Correction
) -> CompensatorState:
    """Start a target from the correction in force, once it is known."""
    orders = {t: s for t, s in state.orders.items() if t != target}
    if target in compensator.shadow:
        orders[target] = compensator.shadow[target]
    return state._replace(orders=orders, corrections=state.corrections | {target: in_force})


#: order of a target without a valid zero while a new one is averaged
AVERAGED = Status(NO_ZERO, "a new zero was ordered, and is being averaged")


def zero_anew(compensator: Compensator, state: CompensatorState) -> CompensatorState:
    """Start all models anew, to take a new zero; corrections are kept. Targets without a zero wait for `rezero`."""
    orders = {t: AVERAGED if s.word == NO_ZERO else s for t, s in state.orders.items()}
    begun = compensator.start()._replace(feed=state.feed)  # a source that has stopped is still known
    return begun._replace(corrections=state.corrections, orders=orders, clock=state.clock, probed=state.probed)


def rezero(
    compensator: Compensator,
    state: CompensatorState,
    target: str,
    time: float,
    why: str,
    in_force: Correction | None = None,
) -> CompensatorState:
    """Reset the zero of a target or axis: its correction is kept and moves on from there.

    Parameters
    ----------
    time : float
        Time on the scale of the readings' stamps [s].
    in_force : Correction, optional
        Present correction as reported by the controller. Default: the last one.
    """
    if target not in compensator.lines:
        raise InputError(f"there is no target {target}: expected one of {', '.join(compensator.lines)}")
    if target not in state.raw:
        raise InputError(f"{target}: its zero is still being averaged; wait until the zero is known")
    now, correction = state.raw[target], in_force or state.corrections[target]
    at = now.reference_position
    shift = Deviation(now.offset + correction.at(at), now.slope + correction.slope, at)
    return state._replace(
        references=state.references | {target: Reference(time, why, shift)},
        corrections=state.corrections | {target: correction},
        learned={t: a for t, a in state.learned.items() if t != target},
        orders={t: s for t, s in state.orders.items() if t != target or s.word != NO_ZERO},
    )
