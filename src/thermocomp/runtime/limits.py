"""Limits of a correction: magnitude, rate and dead band."""

import math

from thermocomp.core.correction import Correction, Limits


def limit_offset(target: float, current: float, dt: float, limits: Limits) -> float:
    """Move a correction towards its target within the limits.

    Parameters
    ----------
    target : float
        Correction demanded by the model [um].
    current : float
        Correction in force [um].
    dt : float
        Time available for the movement [s].

    Returns
    -------
    float
        New correction [um]. If the target is not finite or the time is not positive, the correction is unchanged: in
        Python ``max(-m, min(m, nan))`` is ``+m``, so nan must be excluded before taking a minimum.
    """
    if not (math.isfinite(target) and math.isfinite(dt) and dt > 0):
        return current
    target = max(-limits.magnitude, min(limits.magnitude, target))
    if abs(target - current) <= limits.dead_band:
        return current
    reach = limits.rate * dt
    if abs(target - current) <= reach:
        return target  # exact: current + (target - current) may be rounded beyond the magnitude
    return max(-limits.magnitude, min(limits.magnitude, current + math.copysign(reach, target - current)))


def fade(current: Correction, travel: tuple[float, float], idle: float, dt: float, limits: Limits) -> Correction:
    """Fade a correction to zero after the hold time without a demand, within the rate limit.

    Parameters
    ----------
    travel : tuple of float
        Ends of the travel [mm].
    idle : float
        Time without a demand [s].
    dt : float
        Duration of this step [s].
    """
    if not (idle > limits.hold and dt > 0):
        return current
    share, largest = math.exp(-dt / limits.fade), max(abs(current.at(p)) for p in travel)
    if largest * (1.0 - share) > limits.rate * dt:
        share = 1.0 - limits.rate * dt / largest
    return Correction(share * current.offset, share * current.slope, current.reference_position)


def limit_line(
    target: Correction, current: Correction, travel: tuple[float, float], dt: float, limits: Limits
) -> Correction:
    """Move a correction with a slope towards its target within the limits at both ends of the travel.

    It is a straight line between the ends, so the limits are met everywhere on the axis.

    Parameters
    ----------
    travel : tuple of float
        Ends of the travel [mm].
    dt : float
        Time available for the movement [s].
    """
    low, high = travel
    if low == high or target.slope == current.slope == 0.0:
        offset = limit_offset(target.offset, current.offset, dt, limits)
        if offset == target.offset and target.slope == 0.0:
            return target
        return Correction(offset, 0.0, target.reference_position)
    at_low, at_high = (limit_offset(target.at(p), current.at(p), dt, limits) for p in travel)
    slope = (at_high - at_low) / (high - low)  # um/mm
    return Correction(at_low + slope * (target.reference_position - low), 1e3 * slope, target.reference_position)
