"""`Size`: magnitude of an error."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Size:
    """Magnitude of an error over some points.

    Parameters
    ----------
    rms : float
        Root mean square [unit of the errors].
    largest : float
        Largest absolute value [unit of the errors].
    """

    rms: float
    largest: float

    @classmethod
    def of(cls, errors: FloatArray) -> "Size":
        """Return the RMS and the largest absolute value of errors of any shape [their unit]; NaN for an empty array."""
        if not errors.size:
            return cls(math.nan, math.nan)
        return cls(float(np.sqrt(np.mean(errors**2))), float(np.abs(errors).max()))
