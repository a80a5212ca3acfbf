"""What a model is compared with in unseen cycles or files, and how far its output agrees with what it has to explain.

For each baseline two numbers per cycle or file: the ratio of the errors, and the *agreement* of the model's
contribution (its output minus that of the baseline) with the baseline's error. It is 2 e.d / (e.e + d.d) with error e
and contribution d: 1 if they are equal, 0 if they have nothing to do with each other, -1 if they are opposite. For a
model without information its mean is zero, whatever its errors, so a test of it has more power than one of the errors
(encompassing of forecasts: Harvey, Leybourne and Newbold 1998, https://doi.org/10.1080/07350015.1998.10524759).

Two baselines know the time only:

- the mean curve of the other cycles or files over the time since their start, which is perfect for a drift that is the
  same each time;
- no compensation, with slow changes removed from drift and model: cycles of one recording share its warm-up, its trend
  and its days, and a model that reproduces these is not proved by them. Removed is what is no faster than a cycle or
  file: a trend, waves with periods down to its mean duration, and warm-ups of all time constants from the start of the
  recording. A recording that is a single cycle or file shares nothing; there only a trend is removed, which several
  recordings of a day have in common. See ``docs/decisions/0048-proof.md``.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from thermocomp.core.arrays import FloatArray
from thermocomp.core.size import Size

#: baselines that know the training data
BASELINES = ("no compensation", "the learned mean", "the last learned value")
#: baseline of a single section that continues the training data: both relative to the mean of its first rows
REZEROED = "no compensation, both re-zeroed at the start of the block"
CURVE = "the mean curve of the other cycles or files over time"
SLOW = "no compensation (slow changes removed from both)"
#: baselines that know the time
OF_TIME = (CURVE, SLOW)
REZERO_ROWS = 5
#: agreement of a model that explains a twentieth of an error: one that explains less is not accepted, however surely
LEAST_AGREEMENT = 0.1
#: lower bound of the noise of a probe [um]
NO_NOISE = 1e-3
#: an error below this multiple of the noise is not explained by anything
NOTHING = 2.0
#: time constants of a warm-up, as fractions of the duration of the recording
WARM_UPS = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)


class Against(NamedTuple):
    """Comparison with a baseline in a cycle or file."""

    rms: float  #: of the model's error [um]
    other: float  #: of the baseline's error [um]
    agreement: float  #: of the model's contribution with the baseline's error, -1 to 1

    def log_ratio(self, noise: float) -> float:
        """Return the logarithm of the ratio of the errors, which are at least the noise."""
        least = max(noise, NO_NOISE)
        return float(np.log(max(self.rms, least) / max(self.other, least)))

    def worse(self, other: "Against") -> "Against":
        """Return the less favourable of two numbers each."""
        return Against(max(self.rms, other.rms), self.other, min(self.agreement, other.agreement))


class Series(NamedTuple):
    """Rows of a cycle or file: what the baselines that know the time are computed from."""

    record: str  #: fingerprint of the recording to which it belongs; files that continue each other are one
    time: FloatArray  #: (n_rows,), since the start of the recording [s]
    measured: FloatArray  #: (n_rows,), deviation [um]
    errors: tuple[FloatArray, ...]  #: each (n_rows,), of compensator and model alone [um]


def compare_errors(error: FloatArray, other: FloatArray, noise: float) -> Against:
    """Return the comparison of a model's error with a baseline's error.

    Parameters
    ----------
    error, other : ndarray of shape (n_rows,)
        [um]
    noise : float
        Standard deviation of the probe's noise [um].
    """
    given, size = other - error, Size.of(other).rms
    square = float(other @ other + given @ given)
    known = size > NOTHING * max(noise, NO_NOISE)
    return Against(Size.of(error).rms, size, 2.0 * float(other @ given) / square if known else 0.0)


def worst_of(errors: Sequence[FloatArray], other: FloatArray, noise: float) -> Against:
    """Return the less favourable comparison of several errors of a model with a baseline's error."""
    found = [compare_errors(e, other, noise) for e in errors]
    return found[0] if len(found) == 1 else found[0].worse(found[1])


def p_above_least(agreements: Sequence[float]) -> float:
    """Return the p-value of a one-sided t-test whether the mean is above `LEAST_AGREEMENT`."""
    beyond, error = float(np.mean(agreements)) - LEAST_AGREEMENT, float(stats.sem(agreements))
    return float(stats.t.sf(beyond / error, len(agreements) - 1)) if error > 0 else float(beyond <= 0)


class OfTime(NamedTuple):
    """Comparisons with the baselines that know the time."""

    units: tuple[tuple[Against, Against], ...]  #: with each of `OF_TIME`, by cycle or file
    unlike: float  #: share of the drift, without slow changes, that the mean curve of the others leaves (RMS)
    sizes: float  #: largest RMS of the drift in a cycle or file, without slow changes, relative to the smallest


def compare_with_time(units: Sequence[Series], noise: Sequence[float]) -> OfTime:
    """Compare each cycle or file with the baselines `OF_TIME`.

    Parameters
    ----------
    units : sequence of Series
        At least two cycles or files.
    noise : sequence of float
        Standard deviation of the probe's noise in each [um].
    """
    varying = _remove_slow_changes(units)
    curves = [u.measured - _mean_curve(units, k) for k, u in enumerate(units)]
    found = [
        (worst_of(u.errors, curve, least), worst_of(v.errors, v.measured, least))
        for u, v, curve, least in zip(units, varying, curves, noise, strict=True)
    ]
    left = np.concatenate([v.measured - _mean_curve(varying, k) for k, v in enumerate(varying)])
    sizes = [max(Size.of(v.measured).rms, NO_NOISE) for v in varying]
    every = Size.of(np.concatenate([v.measured for v in varying])).rms
    return OfTime(tuple(found), Size.of(left).rms / max(every, NO_NOISE), max(sizes) / min(sizes))


def _mean_curve(units: Sequence[Series], left_out: int) -> FloatArray:
    """Return the mean of the other cycles or files over the time since the start of each [um]."""
    time = units[left_out].time - units[left_out].time[0]
    others = [np.interp(time, u.time - u.time[0], u.measured) for k, u in enumerate(units) if k != left_out]
    return np.asarray(np.mean(others, axis=0))


def _remove_slow_changes(units: Sequence[Series]) -> list[Series]:
    """Return the cycles or files without the slow changes of their recordings."""
    found = list(units)
    for record in dict.fromkeys(u.record for u in units):
        mine = [k for k, u in enumerate(units) if u.record == record]
        slow = _orthonormal(_slow_terms([units[k].time for k in mine]))
        ends = np.cumsum([len(units[k].time) for k in mine])[:-1]
        every = [units[k].errors for k in mine]
        several = max(len(e) for e in every)
        series = [[units[k].measured for k in mine]]
        series += [[e[min(j, len(e) - 1)] for e in every] for j in range(several)]
        left = [np.split(x - slow @ (slow.T @ x), ends) for x in map(np.concatenate, series)]
        for k, measured, *errors in zip(mine, *left, strict=True):
            found[k] = units[k]._replace(measured=measured, errors=tuple(errors))
    return found


def _slow_terms(times: Sequence[FloatArray]) -> FloatArray:
    """Return the slow changes of a recording of several cycles or files, (n_rows, n_terms)."""
    time = np.concatenate(times)
    u = (time - time.min()) / max(float(np.ptp(time)), 1e-9)
    terms = [np.ones_like(u), u]
    if len(times) > 1:
        terms += [np.cos(np.pi * k * u) for k in range(1, 2 * len(times) + 1)]
        terms += [np.exp(-u / tau) for tau in WARM_UPS]
    return np.stack(terms, axis=1)


def _orthonormal(terms: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns."""
    vectors, sizes, _ = np.linalg.svd(terms, full_matrices=False)
    return np.asarray(vectors[:, sizes > 1e-9 * sizes[0]], dtype=np.float64)


def rezero(x: FloatArray) -> FloatArray:
    """Return values relative to the mean of their first rows."""
    return np.asarray(x - x[:REZERO_ROWS].mean())
