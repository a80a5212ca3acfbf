"""Measurement uncertainty of an RMS and of a largest error, from what the mapping declares (ISO/TR 230-9, GUM).

Each contribution is an error of the measured displacements, with a standard uncertainty and a course over the rows:

- *known course* s (sensitivity and misalignment: proportional to the measured displacement, whatever is left of it
  after compensation; zero: constant over a test): the figure is evaluated for the errors e + s and e - s, and the
  larger change is u, the standard uncertainty of the figure. It includes the second order: a constant of 1 um changes
  an RMS of 2 um about a mean of zero by 0.24 um.
- *unknown course* (instrument, mounting, expansion of instrument, fixture and artefact): it may be that of the error
  itself, so u is the standard uncertainty of the displacement, the most by which such an error changes an RMS.
- *independent from row to row* (repeatability s): u of an RMS R over n rows is the root sum of squares of
  R - sqrt(R^2 - s^2), by which s has raised it, and s / sqrt(n); u of a largest error is that of one reading, s.

The combined standard uncertainty is the root sum of squares of all u, and U = k u with k = 2. Expansions of several
bodies follow the same air: they are added first. A range has the standard uncertainty range / (2 sqrt(3)), so that its
U is 0.577 of it, which ISO/TR 230-9 rounds to 0.6.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.judging import metrics
from thermocomp.judging.settling.averaging import K, noise_of
from thermocomp.recordings.declared import Declared
from thermocomp.recordings.recording import Recording

#: standard uncertainty of a value that is anywhere within a range, as a fraction of the range
OF_RANGE = 1.0 / (2.0 * math.sqrt(3.0))
#: figures with an uncertainty
FIGURES = ("rms", "max_abs")


@dataclass(frozen=True, eq=False)
class FigureUncertainty:
    """Measurement uncertainty of RMS and largest error without and with compensation.

    Parameters
    ----------
    contributions : dict of str to ndarray of shape (2, 2)
        Standard uncertainty by contribution: without and with compensation; of RMS and largest error [um].
    repeatability : float
        Standard deviation of a single reading, where it is from the scatter of the rows [um]; nan if it is stated.
    absent : tuple of str
        Contributions that are not stated, and so not contained.
    """

    contributions: dict[str, FloatArray]
    repeatability: float
    absent: tuple[str, ...]

    def expanded(self, figure: str, *, none: bool = False) -> float | None:
        """Return the expanded uncertainty (k = 2) of ``rms`` or ``max_abs`` [um]; None for other figures."""
        if figure not in FIGURES:
            return None
        place = 0 if none else 1, FIGURES.index(figure)
        return float(K * math.hypot(*(u[place] for u in self.contributions.values())))


def find_scatter(recording: Recording, target: str) -> float:
    """Return the standard deviation of single readings, apart from their drift [um]; 0 for less than three rows."""
    values = recording.values([recording.channel(target)])[:, 0]
    alone = replace(noise_of(recording.time, values), inflation=1.0)  # without what neighbouring rows have in common
    return float(np.nan_to_num(alone.of_mean(1.0)))


def find_uncertainty(
    target: str,
    measured: FloatArray,
    predicted: FloatArray,
    test: IntArray,
    recordings: Sequence[Recording],
    *,
    scatter: Callable[[Recording, str], float] = find_scatter,
) -> FigureUncertainty | None:
    """Return the measurement uncertainty of the figures of a target.

    Parameters
    ----------
    measured, predicted : ndarray of shape (n_judged,)
        Displacement without compensation, and its correction [um].
    test : ndarray of int of shape (n_judged,)
        Recording of each row.
    recordings : sequence of Recording
        They declare the contributions.
    scatter : callable
        `find_scatter`, or the same with a cache.

    Returns
    -------
    FigureUncertainty or None
        None if a recording with judged rows states no contribution.
    """
    used, place = np.unique(test, return_inverse=True)
    tests = [recordings[k] for k in used]
    if not tests or not all(r.declared.states_uncertainty for r in tests):
        return None
    declared = [r.declared for r in tests]
    known = [d.uncertainty.repeatability_um for d in declared]
    spread = [scatter(r, target) if s is None else s for s, r in zip(known, tests, strict=True)]
    errors = (measured, measured - predicted)

    def rows(values: Sequence[float]) -> FloatArray:
        return np.asarray(values, dtype=np.float64)[place]

    found = {}
    for name, values in _by_name([_proportional(d) for d in declared]).items():
        found[name] = _of_course(errors, rows(values) * measured)
    for name, values in _by_name([_within_range(d) for d in declared]).items():
        u = rows(values)
        found[name] = np.tile([np.sqrt(np.mean(u**2)), u.max()], (2, 1))
    zeros = [_of_course(errors, np.where(place == k, s, 0.0)) for k, s in enumerate(spread)]
    found["zero"] = np.sqrt(np.sum(np.square(zeros), axis=0))
    found["repeatability"] = np.stack([_of_noise(e, rows(spread)) for e in errors])
    return FigureUncertainty(
        contributions=found,
        repeatability=max((s for s, k in zip(spread, known, strict=True) if k is None), default=math.nan),
        absent=tuple(dict.fromkeys(name for d in declared for name in _absent(d))),
    )


def _proportional(d: Declared) -> dict[str, float]:
    """Return the relative standard uncertainties of errors proportional to the displacement."""
    found, u = {}, d.uncertainty
    if u.sensitivity_pct is not None:
        found["sensitivity"] = u.sensitivity_pct / 100.0 / K
    if u.misalignment_deg is not None:
        found["misalignment"] = (1.0 - math.cos(math.radians(u.misalignment_deg))) * OF_RANGE
    return found


def _within_range(d: Declared) -> dict[str, float]:
    """Return the standard uncertainties of errors of unknown course [um]."""
    found, u = {}, d.uncertainty
    if u.probe_um is not None:
        found["probe"] = u.probe_um / K
    if u.mounting_um is not None:
        found["mounting"] = u.mounting_um * OF_RANGE
    if u.instrument_drift_um is not None:
        found["instrument drift"] = u.instrument_drift_um * OF_RANGE
    if d.expansion:
        found["expansion"] = sum(body.range for body in d.expansion.values()) * OF_RANGE
    return found


def _absent(d: Declared) -> list[str]:
    keys = [key for key, value in vars(d.uncertainty).items() if value is None and key != "repeatability_um"]
    return keys if d.expansion else [*keys, "expansion"]


def _by_name(tests: Sequence[dict[str, float]]) -> dict[str, list[float]]:
    """Return the values of each contribution in every test; 0 where only other tests state it."""
    return {name: [t.get(name, 0.0) for t in tests] for t in tests for name in t}


def _figures(error: FloatArray) -> FloatArray:
    return np.array([metrics.METRICS[name](error, np.zeros_like(error)) for name in FIGURES])


def _of_course(errors: Sequence[FloatArray], course: FloatArray) -> FloatArray:
    """Return the larger change of each figure if an error of a known course has either sign."""
    changes = [np.abs([_figures(e + sign * course) - _figures(e) for e in errors]) for sign in (1.0, -1.0)]
    return np.asarray(np.maximum(*changes))


def _of_noise(error: FloatArray, scatter: FloatArray) -> FloatArray:
    """Return the standard uncertainties of the figures of an error due to the scatter of its rows."""
    square, rms = float(np.mean(scatter**2)), _figures(error)[0]
    raised = rms - math.sqrt(max(rms**2 - square, 0.0))
    return np.array([math.hypot(raised, math.sqrt(square / len(error))), scatter.max()])
