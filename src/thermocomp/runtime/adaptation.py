"""Adaptation: what probings say of a model's error, and how long that holds.

A Kalman filter over what may be wrong with a model: an offset of the size of its error on cycles that were left out,
and, in a model that is the average of many structures, how much of each main direction of their differences is true. A
probing says their sum. The offset is forgotten with a time constant of hours: it stands for what the machine does now;
the rest is what the training left open, and is known for days. Without a probing the model says what it said.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: with which the offset is forgotten, and what was learned of the structures [s]
OFFSET, STRUCTURES = 4 * 3600.0, 7 * 86400.0
#: what no offset and no structure explains, as a share of the error on cycles that were left out
UNEXPLAINED = 0.2
#: a probing further from what is expected than so many standard deviations is refused
IMPLAUSIBLE = 5.0
#: two that agree on more show that the machine is unlike what the model was judged on: from then on errors of this
#: many standard deviations are what it was seen to be wrong by
AGREED = 3.0
#: no error is counted on to be smaller [um]
LEAST = 1e-3


class Probing(NamedTuple):
    """The deviation of the tool point as measured: without the correction that was in force [um].

    It counts from the same zero as the model.
    """

    deviation: float  #: [um]
    repeatability: float = 0.5  #: of the probe, standard deviation [um]
    position: float = 0.0  #: where on the axis [mm]


class Adaptation(NamedTuple):
    """What is known of a model's error since the last probing: the directions' shares, and last the offset."""

    mean: FloatArray  #: (n_directions + 1,)
    covariance: FloatArray  #: (n_directions + 1, n_directions + 1)
    size: float  #: of the error without probings, root mean square [um]
    spread: float  #: standard deviation of the offset without probings: the size, or more once it was seen [um]
    time: float  #: of the last probing that was taken [s]
    refused: float = (
        np.nan
    )  #: the error by the last probing, if that was refused: what a second one says, too, is taken

    def at(self, time: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return mean, (..., n), and covariance, (..., n, n), at later times [s]: on their way back to no probing."""
        kept = self._kept(time)
        prior = np.ones(len(self.mean))
        prior[-1] = self.spread**2
        covariance = kept[..., :, None] * self.covariance * kept[..., None, :]
        return kept * self.mean, covariance + np.eye(len(prior)) * ((1.0 - kept**2) * prior)[..., None, :]

    def shift(self, time: FloatArray | float, directions: FloatArray) -> FloatArray:
        """Return what is added to the deviation at later times.

        Parameters
        ----------
        time : array of shape (...,)
            [s]
        directions : ndarray of shape (..., n_directions)
            Of the model there, see `ErrorModel.directions` [um].

        Returns
        -------
        ndarray of shape (...,)
            [um]
        """
        return np.asarray((self._kept(time) * self.mean * _beside(directions, 1.0)).sum(axis=-1))

    def narrowing(self, time: FloatArray | float, directions: FloatArray, floor: float) -> FloatArray:
        """Return what is left of the half-width of a band, as a share of it; `floor` is that of the band [um].

        More than 1 where probings have shown that the machine is unlike what the band was judged on.
        """
        _, covariance = self.at(time)
        weights = _beside(directions, floor / self.size)
        left = np.einsum("...i,...ij,...j->...", weights, covariance, weights)
        return np.asarray(np.sqrt(left / ((directions**2).sum(axis=-1) + floor**2)))

    def _kept(self, time: FloatArray | float) -> FloatArray:
        gone = np.maximum(np.asarray(time) - self.time, 0.0)[..., None]
        constants = np.full(len(self.mean), STRUCTURES)
        constants[-1] = OFFSET
        return np.asarray(np.exp(-gone / constants))


def begin(size: float, n_directions: int) -> Adaptation:
    """Return what is known without a probing.

    Parameters
    ----------
    size : float
        Root mean square error on cycles that the model had not seen [um].
    n_directions : int
        0 to learn an offset alone.

    Returns
    -------
    Adaptation
    """
    size = max(size, LEAST)
    return Adaptation(np.zeros(n_directions + 1), np.diag([*[1.0] * n_directions, size**2]), size, size, -np.inf)


def take(
    before: Adaptation, directions: FloatArray, time: float, error: float, repeatability: float
) -> tuple[Adaptation, str]:
    """Take a probing in.

    Parameters
    ----------
    before : Adaptation
    directions : ndarray of shape (n_directions,)
        Of the model when it was made [um].
    time : float
        When it was made [s].
    error : float
        What was measured, minus what the model said without any probing [um].
    repeatability : float
        Of the probe, standard deviation [um].

    Returns
    -------
    Adaptation
    str
        Why the probing is refused, and nothing is learned from it; empty if it is taken.
    """
    if not (np.isfinite(error) and 0.0 <= repeatability < np.inf):
        return before, f"{error} um with a repeatability of {repeatability} um: want finite numbers"
    (mean, covariance), spread = before.at(time), before.spread
    weights, own = _beside(directions, 1.0), (UNEXPLAINED * before.size) ** 2 + repeatability**2
    surprise = error - float(weights @ mean)
    plausible = IMPLAUSIBLE * float(weights @ covariance @ weights + own) ** 0.5
    if abs(surprise) > plausible:
        if not abs(error - before.refused) <= IMPLAUSIBLE * (2 * own) ** 0.5:
            why = f"{surprise:+.1f} um from what is expected, where {plausible:.1f} um are plausible: measure again"
            return before._replace(refused=error), why
        covariance[-1, -1] += surprise**2
        spread = max(spread, abs(surprise) / AGREED)
    gain = covariance @ weights
    variance = float(weights @ gain) + own
    after = covariance - np.outer(gain, gain) / variance
    return Adaptation(mean + gain * (surprise / variance), (after + after.T) / 2, before.size, spread, time), ""


def _beside(directions: FloatArray, last: float) -> FloatArray:
    """Return directions and behind them the weight of the offset."""
    return np.concatenate([directions, np.full((*directions.shape[:-1], 1), last)], axis=-1)
