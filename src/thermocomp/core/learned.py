"""Training statistics of the target, used as reference when a model is judged."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import COEFFICIENT, check_between, check_finite

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Learned:
    """Statistics of a target over the training rows.

    Parameters
    ----------
    mean : float
        Mean deviation: the best constant prediction [unit of the model].
    last : float
        Last training value.
    noise : float
        Standard deviation of the probe's noise.
    largest : float
        Largest deviation.
    """

    mean: float
    last: float
    noise: float
    largest: float

    def __post_init__(self) -> None:
        check_finite("deviation in the training data", mean=self.mean, last=self.last)
        check_between("deviation in the training data", 0.0, COEFFICIENT, noise=self.noise, largest=self.largest)


def probe_noise(y: FloatArray) -> float:
    """Return the noise of a displacement from its second differences, to which drift contributes almost nothing.

    Parameters
    ----------
    y : ndarray of shape (n_rows,)
        Deviations of one test at a constant interval, NaN where unknown [um].

    Returns
    -------
    float
        Standard deviation [um]; 0 with too few rows.
    """
    bends = np.diff(y, 2)
    bends = np.abs(bends[np.isfinite(bends)])
    if bends.size < 5:
        return 0.0
    # for white noise of 1 um, second differences have a standard deviation of sqrt(6) um; the median ignores outliers
    return float(1.4826 * np.median(bends) / np.sqrt(6))
