"""Conversion of times to seconds: numbers, datetimes with or without a time zone, timedeltas."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def seconds(times: NDArray[Any]) -> FloatArray:
    """Return times as seconds.

    Returns
    -------
    ndarray of the same shape
        Numbers unchanged; other times relative to the first one [s], those with a time zone as elapsed UTC time, so
        that daylight-saving changes have no effect. NaN where the time is missing.
    """
    if times.dtype.kind in "mM":
        return np.asarray((times - times.ravel()[:1]) / np.timedelta64(1, "s"), dtype=np.float64)
    if times.dtype.kind == "O" and times.size and isinstance(times.flat[0], datetime | timedelta):
        every = [t.astimezone(UTC) if getattr(t, "tzinfo", None) else t for t in times.flat]
        return np.array([(t - every[0]).total_seconds() for t in every], dtype=np.float64).reshape(times.shape)
    return times.astype(np.float64)
