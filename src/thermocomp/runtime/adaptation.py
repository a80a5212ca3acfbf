"""Adaptation: information from probings about a model's error, and its validity over time.

A Kalman filter over what may be wrong with a model: an offset of the size of its error on cycles that were left out,
and, in a model that is the average of many structures, how much of each main direction of their differences is true. A
probing says their sum. The offset is forgotten with a time constant of hours: it stands for what the machine does now;
the rest is what the training left open, and is known for days. Without a probing the model says what it said.

A probing can be wrong: a chip on the sphere, the wrong tool, another unit. One probing alone moves a model by no more
than `SUSPECT` standard deviations of what is expected; two that were made apart from each other and agree count in
full; and none, however often it is repeated, moves it beyond what the model can be wrong by (`find_most`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: with which the offset is forgotten, and what was learned of the structures [s]
OFFSET, STRUCTURES = 4 * 3600.0, 7 * 86400.0
#: what no offset and no structure explains, as a share of the error on cycles that were left out
UNEXPLAINED = 0.2
#: a probing this many standard deviations from what is expected counts less, the further it is from it
SUSPECT = 2.5
#: a probing further than this many standard deviations from what is expected is refused
IMPLAUSIBLE = 4.0
#: errors of most cycles and days are smaller than their root mean square over all: down to this share of it
LEAST_USUAL = 0.5
#: probings over which it is learned how large the errors of this day are
MEMORY = 5.0
#: two probings confirm each other if they agree within this many standard deviations, and this much time lies between
#: them [s]
AGREED, APART = 5.0, 600.0
#: two that confirm each other show that the machine is unlike what the model was judged on: from then on errors of
#: this many standard deviations are what it was seen to be wrong by
UNLIKE = 3.0
#: a model is wrong by at most this many times its error on cycles that were left out, and this many times the drift
#: without compensation (both root mean squares)
MOST, MOST_OF_DRIFT = 10.0, 3.0
#: no error is counted on to be smaller [um]
LEAST = 1e-3


class Probing(NamedTuple):
    """The deviation of the tool point as measured: without the correction that was in force [um].

    It counts from the same zero as the model.
    """

    deviation: float  #: [um]
    repeatability: float = 0.5  #: of the probe, standard deviation [um]
    position: float = 0.0  #: where on the axis [mm]
    #: what tells it from others, such as an id or its time: a probing with one of them again is the same
    keys: tuple[str, ...] = ()

    @property
    def identity(self) -> tuple[str, ...]:
        """Its keys; its numbers if it has none."""
        return self.keys or (f"{self.deviation} um at {self.position} mm, give or take {self.repeatability} um",)


class Adaptation(NamedTuple):
    """Estimated error of a model since the last probing: the coefficients of the directions, then the offset."""

    mean: FloatArray  #: (n_directions + 1,)
    covariance: FloatArray  #: (n_directions + 1, n_directions + 1)
    size: float  #: of the error without probings, root mean square [um]
    spread: float  #: standard deviation of the offset without probings: the size, or more once it was seen [um]
    time: float  #: of the last probing that was taken [s]
    refused: float = np.nan  #: the error by the last probing, if that was not taken in full [um]
    refused_since: float = -np.inf  #: when a probing said so first [s]
    most: float = np.inf  #: no probing moves the model further [um]
    usual: float = 1.0  #: variance of the errors of this day, as a share of that of the size

    def at(self, time: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return mean, (..., n), and covariance, (..., n, n), at later times [s]: on their way back to no probing."""
        kept = self._kept(time)
        prior = np.ones(len(self.mean))
        prior[-1] = self.spread**2
        covariance = kept[..., :, None] * self.covariance * kept[..., None, :]
        return kept * self.mean, covariance + np.eye(len(prior)) * ((1.0 - kept**2) * prior)[..., None, :]

    def shift(self, time: FloatArray | float, directions: FloatArray) -> FloatArray:
        """Return the value added to the deviation at later times.

        Parameters
        ----------
        time : array of shape (...,)
            [s]
        directions : ndarray of shape (..., n_directions)
            Directions of the model at that time, see `ErrorModel.directions` [um].

        Returns
        -------
        ndarray of shape (...,)
            [um]
        """
        found = (self._kept(time) * self.mean * _beside(directions, 1.0)).sum(axis=-1)
        return np.asarray(np.clip(found, -self.most, self.most))

    def narrowing(self, time: FloatArray | float, directions: FloatArray, floor: float) -> FloatArray:
        """Return the remaining fraction of the half-width of a band; `floor` is that of the band [um].

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


def find_most(size: float, drift: float, magnitude: float) -> float:
    """Return the largest possible error of a model [um].

    Parameters
    ----------
    size : float
        Root mean square error on cycles that the model had not seen [um].
    drift : float
        The same without compensation: an error of a thermal model is no larger than what heat does to the machine [um].
    magnitude : float
        Largest permitted correction [um].

    Returns
    -------
    float
    """
    return min(MOST * max(size, LEAST), MOST_OF_DRIFT * max(drift, LEAST), magnitude)


def begin(size: float, n_directions: int, typical: float = np.inf, most: float = np.inf) -> Adaptation:
    """Return the initial estimate, without a probing.

    Parameters
    ----------
    size : float
        Root mean square error on cycles that the model had not seen [um].
    n_directions : int
        0 to learn an offset alone.
    typical : float
        Root mean square error on most of these cycles; the size if that is less [um].
    most : float
        See `find_most` [um].

    Returns
    -------
    Adaptation
    """
    size = max(size, LEAST)
    prior = np.diag([*[1.0] * n_directions, size**2])
    usual = min(max(typical / size, LEAST_USUAL), 1.0) ** 2
    return Adaptation(
        mean=np.zeros(n_directions + 1), covariance=prior, size=size, spread=size, time=-np.inf, most=most, usual=usual
    )


def take(
    before: Adaptation, directions: FloatArray, time: float, error: float, repeatability: float
) -> tuple[Adaptation, str]:
    """Process a probing.

    Parameters
    ----------
    before : Adaptation
    directions : ndarray of shape (n_directions,)
        Directions of the model at the time of the probing [um].
    time : float
        Time of the probing [s].
    error : float
        Measured error minus the output of the model without any probing [um].
    repeatability : float
        Repeatability of the probe, standard deviation [um].

    Returns
    -------
    Adaptation
    str
        Reason why the probing is refused and not used; empty if it is used.
    """
    if not (np.isfinite(error) and 0.0 <= repeatability < np.inf):
        return before, f"{error} um with a repeatability of {repeatability} um: want finite numbers"
    if abs(error) > before.most + IMPLAUSIBLE * repeatability:
        return before, (
            f"{error:+.1f} um from the model, which can be wrong by {before.most:.1f} um at most: check the probe, the "
            "tool and the unit; if the tool point did move so far, set the zero again"
        )
    (mean, covariance), spread = before.at(time), before.spread
    weights, own = _beside(directions, 1.0), (UNEXPLAINED * before.size) ** 2 + repeatability**2
    surprise, known = error - float(weights @ mean), float(weights @ covariance @ weights)
    typical, noise, doubt = (known * before.usual + own) ** 0.5, own, (np.nan, -np.inf)
    alike = abs(error - before.refused) <= AGREED * (2 * own) ** 0.5
    since = before.refused_since if alike else time
    if alike and time - since < APART:  # in the same chip
        return before, f"as suspect as the one before: measure again {APART / 60:.0f} min or more after that"
    plausible = abs(surprise) <= IMPLAUSIBLE * typical
    if alike and not plausible:  # confirmed
        covariance[-1, -1] += surprise**2
        spread = max(spread, abs(surprise) / UNLIKE)
    elif not alike and not plausible:
        limit = f"{IMPLAUSIBLE * typical:.1f} um are plausible"
        why = f"{surprise:+.1f} um from what is expected, where {limit}: measure again after {APART / 60:.0f} min"
        return before._replace(refused=error, refused_since=since), why
    elif not alike and abs(surprise) > SUSPECT * typical:  # as of a bad probe
        noise, doubt = own + (known + own) * ((surprise / SUSPECT / typical) ** 2 - 1.0), (error, since)
    usual = before.usual + (min(surprise**2 / (known + own), SUSPECT**2) - before.usual) / MEMORY
    usual = max(usual, LEAST_USUAL**2)
    gain = covariance @ weights
    variance = float(weights @ gain) + noise
    after = covariance - np.outer(gain, gain) / variance
    mean = mean + gain * (surprise / variance)
    refused, refused_since = doubt
    return before._replace(
        mean=mean,
        covariance=(after + after.T) / 2,
        spread=spread,
        time=time,
        refused=refused,
        refused_since=refused_since,
        usual=usual,
    ), ""


def _beside(directions: FloatArray, last: float) -> FloatArray:
    """Return directions and behind them the weight of the offset."""
    return np.concatenate([directions, np.full((*directions.shape[:-1], 1), last)], axis=-1)
