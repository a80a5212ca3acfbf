"""Power-up of a controller: how the reference of its corrections is known again, or why not."""

import math
from collections.abc import Collection

from thermocomp.core.correction import Correction
from thermocomp.core.expression import Lag, Node, PacedLag
from thermocomp.core.starting import seems_warm
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.limits import limit_line
from thermocomp.runtime.orders import rezero
from thermocomp.runtime.state import NO_ZERO, Compensated, CompensatorState, Status, resume

#: order of a target after a power-up on a machine that may be warm
NO_REFERENCE = Status(NO_ZERO, "the machine may be warm: let it cool down, measure with the probe, or re-zero")
#: time within which every correction is reached [s]
AT_ONCE = 1e20
#: after this multiple of its longest time constant without power, a machine is cold
COLD = 4.0


def find_slowest(compensator: Compensator) -> float:
    """Return the longest time constant of the models and watches [s]; infinite if a model forgets nothing."""

    def slowest(node: Node) -> float:
        if isinstance(node, Lag):
            return node.time_constant
        return max(node.stopped, node.running) if isinstance(node, PacedLag) else math.inf

    own = [slowest(node) for m in compensator.models for node in m.remembered]
    watched = [float(1.0 / rate) for w in compensator.watches for rate in w.bank.rates]
    usual = [compensator.thresholds.difference_time] if compensator.watches else []
    return max([*own, *watched, *usual], default=0.0)


def find_cold_after(compensator: Compensator) -> float:
    """Return the time without power after which a machine is cold [s].

    Four times the longest time constant; `Thresholds.resumable` if the models have none, or forget nothing.
    """
    slowest = find_slowest(compensator)
    return COLD * slowest if 0.0 < slowest < math.inf else compensator.thresholds.resumable


def power_up(compensator: Compensator, retained: CompensatorState | None, off: float) -> CompensatorState:
    """Return the state with which to continue after a time without power.

    A retained state continues as that of a service (`thermocomp.runtime.state.resume`). Without one that can be used,
    the machine is cold if it was off for long enough; otherwise the reference of all targets is unknown, and their
    corrections are held until they are re-zeroed or the compensator is started on a cold machine.

    Parameters
    ----------
    retained : CompensatorState or None
        None: there is none, or it is damaged or belongs to other models.
    off : float
        Time without power [s], by which the clock of the controller is ahead; nan or at most 0: unknown.
    """
    cold, most = compensator.start(), compensator.thresholds.resumable
    held = [t for t in compensator.lines if t not in compensator.shadow]
    if retained is not None and 0.0 < off <= most and any(is_referenced(retained, t) for t in held):
        found = resume(retained, cold, off, resumable=most)
        clock = None if retained.clock is None else retained.clock + off
        return found._replace(clock=clock, taken=retained.taken, origin=retained.origin, away=None)
    if find_cold_after(compensator) < off < math.inf:
        return cold
    return cold._replace(orders=cold.orders | dict.fromkeys(held, NO_REFERENCE))


def is_referenced(state: CompensatorState, target: str) -> bool:
    """Return whether the reference of a target is known."""
    order = state.orders.get(target)
    return order is None or order.word != NO_ZERO


def rezero_measured(
    compensator: Compensator, state: CompensatorState, target: str, time: float, remaining: float
) -> CompensatorState:
    """Re-zero a target by a deviation that was measured with the correction in force, without a jump.

    Parameters
    ----------
    remaining : float
        Actual minus commanded position [um]; 0: the datums were set anew.
    """
    now = state.corrections[target]
    wanted = Correction(now.offset - remaining, now.slope, now.reference_position)
    return rezero(compensator, state, target, time, "measured", wanted)._replace(corrections=state.corrections)


def take_at_once(
    compensator: Compensator,
    before: CompensatorState,
    after: CompensatorState,
    said: Compensated,
    targets: Collection[str],
) -> tuple[CompensatorState, Compensated]:
    """Return a step in which the corrections of some targets reach their models at once, as far as these are active.

    For the first step after more than `Limits.hold` without power, when no axis is referenced yet: the retained
    correction may be that of a machine that was warm hours ago. If no reading can be used for `Limits.reading_age`, the
    axes may be in use by then, and the correction moves at its rate.
    """
    limits, lines = compensator.limits, compensator.lines
    found = dict(after.corrections)
    for t in targets:
        if said.states[t].word == "active":
            wanted = Correction.opposing(said.deviations[t])
            found[t] = limit_line(wanted, before.corrections[t], lines[t].travel, AT_ONCE, limits)
    return after._replace(corrections=found), said._replace(corrections=found)


def machine_seems_warm(compensator: Compensator, state: CompensatorState) -> bool:
    """Return whether the temperatures of the zero, known or so far, are those of a warm machine: see `seems_warm`."""
    pairs = zip(compensator.models, state.models, state.averaged, strict=True)
    return any(seems_warm(m.inputs, s.reference.tolist(), z.mean.tolist()) for m, s, z in pairs)
