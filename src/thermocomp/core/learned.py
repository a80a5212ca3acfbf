"""What the training of a model showed of its target: what it is held against when it is judged."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Learned:
    """A target in the rows that were learned from.

    Parameters
    ----------
    mean : float
        Mean deviation: the best that a constant could do [unit of the model].
    last : float
        The last value learned.
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
        if not np.isfinite([self.mean, self.last, self.noise, self.largest]).all():
            raise InputError(f"what was learned must be finite numbers, found {self}")
        if self.noise < 0 or self.largest < 0:
            raise InputError(f"noise {self.noise} and largest deviation {self.largest} must not be negative")


def probe_noise(y: FloatArray) -> float:
    """Return the noise of a displacement, from its second differences: a drift has next to none.

    Parameters
    ----------
    y : ndarray of shape (n_rows,)
        One test's deviations at a steady interval, nan where they are unknown [um].

    Returns
    -------
    float
        Standard deviation [um]; 0 with too few rows.
    """
    bends = np.diff(y, 2)
    bends = np.abs(bends[np.isfinite(bends)])
    if bends.size < 5:
        return 0.0
    # white noise of 1 um bends by sqrt(6) um; the median does not see spikes and steps
    return float(1.4826 * np.median(bends) / np.sqrt(6))
