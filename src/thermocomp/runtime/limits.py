"""What a correction may never do: leave its magnitude, move faster than its rate, chatter."""

import math

from thermocomp.core.correction import Limits


def limited(target: float, current: float, dt: float, limits: Limits) -> float:
    """Move a correction towards its target as far as the limits allow.

    Parameters
    ----------
    target : float
        Where the model wants it [um].
    current : float
        Where it is [um].
    dt : float
        Time it has had to move [s].
    limits : Limits

    Returns
    -------
    float
        The new correction [um]. Anything that is not a finite target or a positive time leaves it where it is: in
        Python ``max(-m, min(m, nan))`` is ``+m``, so a nan has to be turned away before it meets a minimum.
    """
    if not (math.isfinite(target) and math.isfinite(dt) and dt > 0):
        return current
    target = max(-limits.magnitude, min(limits.magnitude, target))
    if abs(target - current) <= limits.dead_band:
        return current
    reach = limits.rate * dt
    if abs(target - current) <= reach:
        return target  # exactly: current + (target - current) may round past the magnitude
    return max(-limits.magnitude, min(limits.magnitude, current + math.copysign(reach, target - current)))
