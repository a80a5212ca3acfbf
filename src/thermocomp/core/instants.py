"""Times as seconds, whatever they come as: numbers, datetimes with or without a time zone, timedeltas."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def seconds(times: NDArray[Any]) -> FloatArray:
    """Return times as seconds.

    Parameters
    ----------
    times : ndarray
        Numbers, datetimes or timedeltas, also as objects of Python or pandas.

    Returns
    -------
    ndarray of the same shape
        Numbers as they are; the others since the first one [s], and those with a time zone as they pass in UTC: a
        clock that is put forward or back does not count. nan where there is no time.

    Raises
    ------
    TypeError, ValueError
        One of them is neither a number nor a time, or only some have a time zone.
    """
    if times.dtype.kind in "mM":
        return np.asarray((times - times.ravel()[:1]) / np.timedelta64(1, "s"), dtype=np.float64)
    if times.dtype.kind == "O" and times.size and isinstance(times.flat[0], datetime | timedelta):
        every = [t.astimezone(UTC) if getattr(t, "tzinfo", None) else t for t in times.flat]
        return np.array([(t - every[0]).total_seconds() for t in every], dtype=np.float64).reshape(times.shape)
    return times.astype(np.float64)
