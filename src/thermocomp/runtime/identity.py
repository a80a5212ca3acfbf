"""Identity of probings: a probing that is delivered twice counts once.

A broker may repeat an unconfirmed message, and a program may repeat a command. A probing is identical to an earlier one
if it has the same id or the same time or, if it has neither, the same content. It is remembered for a day
(`Thresholds.resumable`).
"""

from collections.abc import Mapping

from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.state import CompensatorState

#: maximum number of keys remembered for each target
MOST_KEYS = 600
KNOWN = "this probing was delivered before; give each probing its own id or time"


def is_known(state: CompensatorState, target: str, probing: Probing) -> bool:
    """Return whether a probing of a target or axis was delivered before."""
    return not state.probed.get(target, {}).keys().isdisjoint(probing.identity)


def sift(state: CompensatorState, probings: Mapping[str, Probing] | None) -> tuple[dict[str, Probing], dict[str, str]]:
    """Return the new probings, and the reasons why the others are refused, by target or axis."""
    given = probings or {}
    fresh = {t: p for t, p in given.items() if not is_known(state, t, p)}
    return fresh, {t: KNOWN for t in given if t not in fresh}


def remember(
    state: CompensatorState, probings: Mapping[str, Probing], time: float, memory: float = THRESHOLDS.resumable
) -> dict[str, dict[str, float]]:
    """Return the first arrival times of all remembered keys, including those of new probings, by target or axis.

    Parameters
    ----------
    time : float
        Present time of the state [s].
    memory : float
        Time for which a key is remembered [s].
    """
    found = dict(state.probed)
    for target, probing in probings.items():
        known = {k: t for k, t in found.get(target, {}).items() if time - t <= memory}
        known |= dict.fromkeys(probing.identity, time)
        found[target] = dict(list(known.items())[-MOST_KEYS:])
    return found
