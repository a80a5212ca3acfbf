"""Remaining duration of the drift of a machine, estimated from the predicted deviation alone."""

import math
from collections.abc import Sequence

#: period over which the drift is evaluated [s]
WINDOW = 600.0


def minutes_until(times: Sequence[float], deviations: Sequence[float], below: float) -> float:
    """Return the number of minutes until the deviation changes by less than `below` within ten minutes.

    The decay is determined from two windows of ten minutes and extrapolated as an exponential.

    Parameters
    ----------
    times : sequence of float
        Increasing [s].
    deviations : sequence of float
        Predicted deviations [um].
    below : float
        Threshold [um].

    Returns
    -------
    float
        0 if already below; nan if unknown because the curve is too short; infinite if the change does not decrease.
    """
    if not below > 0:
        raise ValueError(f"below = {below}: expected more than 0 um")
    if not times or times[-1] - times[0] < 2 * WINDOW:
        return math.nan
    now, middle, begin = (_at(times, deviations, times[-1] - k * WINDOW) for k in range(3))
    last, before = abs(now - middle), abs(middle - begin)
    if last < below:
        return 0.0
    if last >= before:
        return math.inf
    return WINDOW / 60.0 * math.log(last / below) / math.log(before / last)


def _at(times: Sequence[float], values: Sequence[float], time: float) -> float:
    """Return the last value at or before a time."""
    return next(v for t, v in zip(reversed(times), reversed(values), strict=True) if t <= time)
