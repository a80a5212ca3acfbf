"""Before a temperature has changed once, nobody knows whether the source measures: the corrections are held."""

from collections.abc import Mapping

from thermocomp.core.reading import Reading
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Compensated, CompensatorState


def step_changing(
    compensator: Compensator,
    state: CompensatorState,
    reading: Reading,
    probings: Mapping[str, Probing],
    tick: float,
    since: str,
) -> tuple[CompensatorState, Compensated]:
    """Process a reading as `Compensator.step`; corrections are held, later fade, until a temperature has changed once.

    The models process the readings meanwhile, so that a machine at rest, whose temperatures are constant within their
    resolution, loses no time. Probings are refused: the drift that they measure would be corrected twice when the
    temperatures change.

    Parameters
    ----------
    tick : float
        Present time of the monotonic clock of the process [s].
    since : str
        Time of the start, for the reason.
    """
    feed = compensator.feed
    fresh = {} if feed.unchanged(state.feed) else probings
    after, said = compensator.step(state, reading, reading.time, fresh, tick)
    if said.rejected or after.feed.repeated < 1.0 or not feed.unchanged(after.feed):
        return after, said
    why = f"no temperature has changed since the start at {since}: check the source"
    held, waited = compensator.wait(state, tick, why)
    after = after._replace(corrections=held.corrections, idle=held.idle, away=state.away, because=state.because)
    return after, said._replace(
        corrections=waited.corrections, states=waited.states, half_widths={}, refused=dict.fromkeys(probings, why)
    )
