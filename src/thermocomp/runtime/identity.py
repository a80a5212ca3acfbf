"""Identity of probings: one that is delivered twice counts once.

A broker repeats a message that was not confirmed, a program repeats a command. A probing is the same as one before if
it has the same id, or the same time, or, where it has neither, the same content. It is known for a day.
"""

from collections.abc import Mapping

from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.state import FORGOTTEN, CompensatorState

#: keys that are remembered of each target
MOST_KEYS = 600
KNOWN = "it was delivered before; give each probing its own id or time"


def is_known(state: CompensatorState, target: str, probing: Probing) -> bool:
    """Return whether a probing of a target or axis came before.

    Parameters
    ----------
    state : CompensatorState
    target : str
    probing : Probing
    """
    return not state.probed.get(target, {}).keys().isdisjoint(probing.identity)


def sift(state: CompensatorState, probings: Mapping[str, Probing] | None) -> tuple[dict[str, Probing], dict[str, str]]:
    """Return the probings that did not come before, and why the others are refused, by target or axis."""
    given = probings or {}
    fresh = {t: p for t, p in given.items() if not is_known(state, t, p)}
    return fresh, {t: KNOWN for t in given if t not in fresh}


def remember(state: CompensatorState, probings: Mapping[str, Probing], time: float) -> dict[str, dict[str, float]]:
    """Return the first arrival times of the keys of probings, with those of some more, by target or axis.

    Parameters
    ----------
    state : CompensatorState
    probings : mapping of str to Probing
    time : float
        Present time of the state [s].
    """
    found = dict(state.probed)
    for target, probing in probings.items():
        known = {k: t for k, t in found.get(target, {}).items() if time - t <= FORGOTTEN}
        known |= dict.fromkeys(probing.identity, time)
        found[target] = dict(list(known.items())[-MOST_KEYS:])
    return found
