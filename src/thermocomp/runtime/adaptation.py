"""Adaptation of a model by probings (measurements of the tool point): estimated model error, and its decay.

A Kalman filter estimates the components of the model error: an offset with the size of the error on left-out cycles,
and, for a model that is the average of many regressions, a coefficient for each principal direction of their
differences. A probing measures the sum of these. The offset decays with a time constant of hours, since it represents
the present state of the machine; the coefficients represent what the training left undetermined and decay over days.
Without a probing, the output of the model is unchanged.

A probing can be wrong: a chip on the sphere, the wrong tool, another unit, and it can be so again and again. One beyond
`Thresholds.suspect` standard deviations of the expected error counts the less, the further beyond that it is; one that
is implausible, or beyond the largest possible error of the model (`find_most`), is refused, however often it is
repeated. Together, probings move a model by no more than its band (`Thresholds.most_moved`). A tool point that really
moved further, with another fixture for example, needs an order: re-zero.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.thresholds import THRESHOLDS, Thresholds

FloatArray = NDArray[np.float64]


class Probing(NamedTuple):
    """Measured deviation of the tool point without the correction in force [um].

    It has the same zero as the model.
    """

    deviation: float  #: [um]
    repeatability: float = 0.5  #: of the probe, as standard deviation [um]
    position: float = 0.0  #: position on the axis [mm]
    #: identification, such as an id or its time: a further probing with one of these keys counts as the same probing
    keys: tuple[str, ...] = ()

    @property
    def identity(self) -> tuple[str, ...]:
        """Keys that identify the probing; if it has none, its values."""
        return self.keys or (f"{self.deviation} um at {self.position} mm, give or take {self.repeatability} um",)


class Adaptation(NamedTuple):
    """Estimated error of a model since the last probing: the coefficients of the directions, then the offset."""

    mean: FloatArray  #: (n_directions + 1,)
    covariance: FloatArray  #: (n_directions + 1, n_directions + 1)
    size: float  #: root mean square of the error without probings [um]
    time: float  #: of the last probing that was used [s]
    refused: float = np.nan  #: error measured by the last probing, if not used in full [um]
    refused_since: float = -np.inf  #: time of the first probing with that error [s]
    most: float = np.inf  #: largest possible error of the model [um]
    usual: float = 1.0  #: variance of the errors on the present day, relative to that of the size

    def at(self, time: FloatArray | float, thresholds: Thresholds = THRESHOLDS) -> tuple[FloatArray, FloatArray]:
        """Return mean, (..., n), and covariance, (..., n, n), at later times [s], decaying to their prior values."""
        kept = self._kept(time, thresholds)
        prior = np.ones(len(self.mean))
        prior[-1] = self.size**2
        covariance = kept[..., :, None] * self.covariance * kept[..., None, :]
        return kept * self.mean, covariance + np.eye(len(prior)) * ((1.0 - kept**2) * prior)[..., None, :]

    def shift(
        self, time: FloatArray | float, directions: FloatArray, thresholds: Thresholds = THRESHOLDS
    ) -> FloatArray:
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
        found = (self._kept(time, thresholds) * self.mean * _beside(directions, 1.0)).sum(axis=-1)
        most = self.reach(thresholds)
        return np.asarray(np.clip(found, -most, most))

    def reach(self, thresholds: Thresholds = THRESHOLDS) -> float:
        """Return the largest change of the model by probings [um]."""
        return min(self.most, thresholds.most_moved * self.size)

    def narrowing(
        self, time: FloatArray | float, directions: FloatArray, floor: float, thresholds: Thresholds = THRESHOLDS
    ) -> FloatArray:
        """Return the factor on the half-width of an uncertainty band; `floor` is the floor of the band [um].

        It exceeds 1 if probings have shown that the machine behaves differently than in the validation of the band.
        """
        _, covariance = self.at(time, thresholds)
        weights = _beside(directions, floor / self.size)
        left = np.einsum("...i,...ij,...j->...", weights, covariance, weights)
        return np.asarray(np.sqrt(left / ((directions**2).sum(axis=-1) + floor**2)))

    def _kept(self, time: FloatArray | float, thresholds: Thresholds = THRESHOLDS) -> FloatArray:
        gone = np.maximum(np.asarray(time) - self.time, 0.0)[..., None]
        constants = np.full(len(self.mean), thresholds.direction_decay)
        constants[-1] = thresholds.offset_decay
        return np.asarray(np.exp(-gone / constants))


def find_most(size: float, drift: float, magnitude: float, thresholds: Thresholds = THRESHOLDS) -> float:
    """Return the largest possible error of a model [um].

    Parameters
    ----------
    size : float
        Root mean square error on unseen cycles [um].
    drift : float
        The same without compensation: the error of a thermal model cannot exceed the thermal drift of the machine [um].
    magnitude : float
        Largest permitted correction [um].
    """
    size = max(size, thresholds.least_error)
    usual = max(thresholds.most_probing, thresholds.most_usual * size)
    return min(
        thresholds.most_error * size, usual, thresholds.most_drift * max(drift, thresholds.least_error), magnitude
    )


def begin(
    size: float,
    n_directions: int,
    typical: float = np.inf,
    most: float = np.inf,
    thresholds: Thresholds = THRESHOLDS,
) -> Adaptation:
    """Return the initial estimate, without a probing.

    Parameters
    ----------
    size : float
        Root mean square error on unseen cycles [um].
    typical : float
        Root mean square error on most of these cycles, limited to the size [um].
    most : float
        See `find_most` [um].
    """
    size = max(size, thresholds.least_error)
    prior = np.diag([*[1.0] * n_directions, size**2])
    usual = min(max(typical / size, thresholds.least_usual), 1.0) ** 2
    return Adaptation(
        mean=np.zeros(n_directions + 1), covariance=prior, size=size, time=-np.inf, most=most, usual=usual
    )


def take(
    before: Adaptation,
    directions: FloatArray,
    time: float,
    error: float,
    repeatability: float,
    thresholds: Thresholds = THRESHOLDS,
) -> tuple[Adaptation, str]:
    """Process a probing.

    Parameters
    ----------
    directions : ndarray of shape (n_directions,)
        Directions of the model at the time of the probing [um].
    time : float
        Time of the probing [s].
    error : float
        Measured error minus the output of the model without probings [um].
    repeatability : float
        Repeatability of the probe, standard deviation [um].
    """
    if not (np.isfinite(error) and 0.0 <= repeatability < np.inf):
        return (
            before,
            f"{error} um with a repeatability of {repeatability} um: expected finite numbers, and a repeatability that "
            "is not negative",
        )
    mean, covariance = before.at(time, thresholds)
    weights, own = _beside(directions, 1.0), (thresholds.unexplained * before.size) ** 2 + repeatability**2
    expected, known, reach = float(weights @ mean), float(weights @ covariance @ weights), before.reach(thresholds)
    surprise = error - expected
    check = "check the probe, the tool and the unit (um); if the tool point did move this far, re-zero the target"
    if expected * error > 0 and abs(expected) > 0.5 * reach:
        check = f"it grew from probing to probing: ageing of the machine, or the probe; {check}"
    if abs(error) > before.most + thresholds.implausible * repeatability:
        return before, (
            f"{error:+.1f} um from the prediction of the model, whose error can be at most {before.most:.1f} um: "
            f"{check}"
        )
    typical, noise, doubt = (known * before.usual + own) ** 0.5, own, (np.nan, -np.inf)
    alike = abs(error - before.refused) <= thresholds.agreement * (2 * own) ** 0.5
    first = not time - before.time <= thresholds.offset_decay
    suspect = thresholds.suspect_first if first else thresholds.suspect
    if abs(surprise) > thresholds.implausible * typical:
        why = (
            f"{surprise:+.1f} um from the expected value, where at most {thresholds.implausible * typical:.1f} um are "
            f"plausible: {check}"
        )
        return before._replace(refused=error, refused_since=time), why
    if alike and (
        time - before.refused_since < thresholds.probing_interval or abs(surprise) > suspect * typical
    ):  # possibly the same chip as before
        return before._replace(refused_since=time), (
            f"{surprise:+.1f} um from the expected value, as the previous probing: it counts only once; check the "
            "probe and the tool"
        )
    if abs(surprise) > suspect * typical:  # possibly a bad probing
        far = abs(surprise) / typical
        weight = (suspect / far) ** 2
        if first:
            weight *= max(thresholds.implausible - far, 1e-6) / (thresholds.implausible - suspect)
        noise, doubt = own + (known + own) * (1.0 / weight - 1.0), (error, time)
    seen = min(surprise**2 / (known + own), thresholds.suspect**2)
    usual = before.usual + (seen - before.usual) / thresholds.probings_averaged
    usual = max(usual, thresholds.least_usual**2)
    gain = covariance @ weights
    variance = float(weights @ gain) + noise
    after = covariance - np.outer(gain, gain) / variance
    mean = mean + gain * (surprise / variance)
    mean = mean * min(1.0, reach / max(abs(float(weights @ mean)), 1e-12))  # what is expected is what is corrected
    refused, refused_since = doubt
    return before._replace(
        mean=mean,
        covariance=(after + after.T) / 2,
        time=time,
        refused=refused,
        refused_since=refused_since,
        usual=usual,
    ), ""


def _beside(directions: FloatArray, last: float) -> FloatArray:
    """Return the values of the directions, followed by a value for the offset."""
    return np.concatenate([directions, np.full((*directions.shape[:-1], 1), last)], axis=-1)
