"""Computation of the study of Hwang, Lee and Yang; `thermocomp.papers.hwang.redo` presents it.

Tests of six hours in three states in random order, 14 sensors, drift Z, a row every 30 min (H-09); several are fitted
together, because one has too few rows (E-H7). T14 (bed) is the reference: each variable is ``T_i - T14``, with absolute
temperatures, not relative to the start of the test (H-08). The threshold of the paper is unknown (E-H1): the one used
gives as many groups as its Table 1, or the nearest number; the sweep includes all others. The performance on new tests,
with other orders of the states and other weather, is reported in addition. Each test has the seed of the study plus its
number: first those for training, then the new ones.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.core.terms import TermTable, Variable
from thermocomp.judging.sensitivity import Sensitivity, sensitivity
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.numerics.leastsquares import effective_sample_size, join_columns, lstsq, triangle
from thermocomp.models.selection.collinearity import correlation
from thermocomp.models.selection.grouping import Groups, Interval, choose, group, intervals
from thermocomp.papers import common
from thermocomp.papers.study import FloatArray, Progress
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.datasets import record
from thermocomp.virtual.kits import HWANG_PLACES

#: names of the temperatures in `HWANG_PLACES` (H-08)
NAMES = tuple(f"T{k}" for k in range(1, 15))
REFERENCE = "T14"
TARGET = "z_um"
#: groups of the paper (Table 1, H-10); of its underlined representatives only four are known, from the text (E-H4)
TABLE_1 = ((7,), (9, 10, 11, 12), (13,), (8, 4), (5,), (2,), (1, 6), (3,))
#: variables of the best model (H-11) relative to these groups
PAPERS_SHARE = 4 / 8
#: variables without and with grouping (H-15: Eq. 8 and 6)
PAPERS_VARIABLES = (7, 4)
#: standard errors in Table 2 (H-12, H-13): linear model, engineering judgement [um]
PAPERS_ERRORS = (6.39, 6.72)
#: eigenvalues in Table 3 of the paper (H-16): with and without grouping, Eq. 6 and 8 despite its header (E-H5)
TABLE_3 = ((1.1e4, 155.8, 18.6, 3.3), (8861.812, 76.397, 19.835, 2.359, 1.129, 0.114, 0.019))
#: temperatures of the engineering judgement model, which also uses their squares (H-13)
JUDGEMENT = ("T6", "T7", "T13")
#: magnitudes of the sensor error [degC] and its distributions (E-H8)
NOISES = (0.1, 0.2, 0.4, 0.8)
LAWS: tuple[Literal["uniform", "normal"], ...] = ("uniform", "normal")
DRAWS = 100
#: time between two rows (H-09) [s]
INTERVAL = 1800.0
#: number of rows that R2 and standard errors of Table 2 imply (E-H7)
PAPERS_ROWS = 32
#: number of tests for training, the fewest that have so many rows, and of new, unseen tests
RUNS, NEW = 3, 5
#: number of timed searches, of which the shortest counts
TIMINGS = 5
#: names of the models
OPTIMAL, JUDGED, SINGLE = "optimal selection", "engineering judgement", "without grouping"
NONE = "no compensation"
#: methods of thermocomp, for comparison
OURS = ("dynamic", "averaged")
#: the models of Fig. 6, and the quadratic one without its squares
LINEAR, QUADRATIC, PLAIN = "linear", "quadratic", "quadratic without its squares"
#: criterion for "nearly the same" in Table 2: maximum ratio of the standard errors
SAME = 1.1


@dataclass(frozen=True)
class PaperFit:
    """A model with R2 and standard error in its training rows.

    Parameters
    ----------
    r_squared, error : float
        R2 about the mean and standard error of estimate [um] in the training rows.
    """

    model: ErrorModel
    r_squared: float
    error: float


def samples_of(tests: Sequence[Recording]) -> Samples:
    """Return samples with the names of the paper and absolute temperatures, a row every `INTERVAL`."""
    names = {f"t_{p}_C": n for p, n in zip(HWANG_PLACES, NAMES, strict=True)} | {TARGET: TARGET}
    return _thinned(common.stacked([common.rename_channels(r, names) for r in tests], [TARGET], NAMES, rezero=False))


def _thinned(samples: Samples) -> Samples:
    return samples.take(samples.time % INTERVAL == 0)


def nearest(found: Sequence[Interval], groups: int) -> Interval:
    """Return the threshold interval whose number of groups is nearest to `groups`; if there are several, the widest."""
    return min(found, key=lambda i: (abs(len(i.groups) - groups), i.low - i.high))


def polynomial(samples: Samples, names: Sequence[str], degree: int) -> PaperFit:
    """Fit powers of differences from the reference; degree 2 gives the engineering judgement model (H-13)."""
    used = [n for n in NAMES if n in (*names, REFERENCE)]
    variables = tuple(Variable.difference(used, n, REFERENCE) for n in names)
    terms = tuple((k,) * power for power in range(1, degree + 1) for k in range(len(names)))
    columns = [NAMES.index(n) for n in used]
    X = TermTable(len(used), variables, terms).evaluate(samples.change()[:, columns])
    y = samples.deviations[:, 0]
    solved = lstsq(X, y)
    found = solved.coefficients.tolist()
    model = common.frozen(samples, columns, found, solved.intercept, variables=variables, terms=terms)
    total = float(np.sum((y - y.mean()) ** 2))
    return PaperFit(model, 1 - solved.rss / total, float(np.sqrt(solved.rss / (len(y) - len(terms) - 1))))


def agreement(groups: Groups) -> float:
    """Return the share of sensor pairs that are in the same group, or in different groups, as in Table 1."""
    ours = {n: k for k, g in enumerate(groups) for n in g}
    paper = {n - 1: k for k, g in enumerate(TABLE_1) for n in g}
    pairs = [(a, b) for a in paper for b in paper if a < b]
    return sum((ours[a] == ours[b]) == (paper[a] == paper[b]) for a, b in pairs) / len(pairs)


@dataclass(frozen=True, eq=False)
class Computed:
    """All results of the study of Hwang.

    Parameters
    ----------
    fit, new : Samples
        Tests used for training, and new tests.
    grouped, single : CorrelationGrouping
        At the selected threshold, and without grouping, i.e. with each temperature as a separate group.
    interval : Interval
        Thresholds that give the same groups.
    swept : list of (Interval, CorrelationGrouping)
        Results at all thresholds.
    fits : dict of str to PaperFit
        The three models, by name.
    shaken : dict of (str, float) to dict of str to Sensitivity
        R2 under random sensor error, by distribution and magnitude [degC].
    seconds : dict of str to float
        Times of the searches with and without grouping, by model [s] (H-19).
    ours : dict of str to ndarray
        Residuals of `OURS` in the new tests [um], which the paper does not have.
    """

    fit: Samples
    new: Samples
    grouped: CorrelationGrouping
    single: CorrelationGrouping
    interval: Interval
    swept: list[tuple[Interval, CorrelationGrouping]]
    fits: dict[str, PaperFit]
    shaken: dict[tuple[str, float], dict[str, Sensitivity]]
    seconds: dict[str, float]
    ours: dict[str, FloatArray]

    @property
    def drift(self) -> FloatArray:
        """Deviation of Z in the training rows [um]."""
        return self.fit.deviations[:, 0]

    @cached_property
    def worth(self) -> float:
        """Effective sample size of the training rows, from the residuals of the optimal model."""
        return effective_sample_size(self.drift - self.fitted(OPTIMAL))

    @cached_property
    def change(self) -> FloatArray:
        """Differences of T1 .. T13 from the reference, (n_rows, 13) [degC]."""
        return self.fit.values[:, :-1] - self.fit.values[:, -1:]

    def fitted(self, name: str) -> FloatArray:
        """Return the deviation computed by a model in the training rows [um]."""
        return common.predict_deviation(self.fits[name].model, self.fit)

    @cached_property
    def residuals(self) -> dict[str, FloatArray]:
        """Residuals of each model in the new tests [um]."""
        z = self.new.deviations[:, 0]
        left = {name: z - common.predict_deviation(f.model, self.new) for name, f in self.fits.items()}
        return {NONE: z} | left | self.ours

    @cached_property
    def errors(self) -> dict[str, common.Errors]:
        """Error metrics of each model in the new tests."""
        return {name: common.Errors.of(e) for name, e in self.residuals.items()}


def compute(seed: int, progress: Progress) -> Computed:
    """Run the tests and the computations of the paper."""
    progress(0.0, "tests for training, and new ones")
    tests = [replace(record("hwang", seed=seed + k)[0], name=f"order {k + 1}") for k in range(RUNS + NEW)]
    fit, new = samples_of(tests[:RUNS]), samples_of(tests[RUNS:])
    progress(0.3, "groups at every threshold")
    found = intervals(_grouped(fit, 0.9).correlation_)
    interval = nearest(found, len(TABLE_1))
    grouped, single = _grouped(fit, interval.low), _grouped(fit, 1.0)
    swept = [(i, _grouped(fit, i.low)) for i in found]
    fits = {
        OPTIMAL: _fit_of(grouped, fit),
        JUDGED: polynomial(fit, JUDGEMENT, 2),
        SINGLE: _fit_of(single, fit),
    }
    progress(0.6, "random sensor error")
    shown = {LINEAR: fits[OPTIMAL].model, QUADRATIC: fits[JUDGED].model, PLAIN: polynomial(fit, JUDGEMENT, 1).model}
    shaken: dict[tuple[str, float], dict[str, Sensitivity]] = {
        (law, size): sensitivity(shown, fit, common.every(fit), size=size, law=law, draws=DRAWS, seed=seed)
        for law in LAWS
        for size in NOISES
    }
    progress(0.9, "new tests")
    return Computed(
        fit=fit,
        new=new,
        grouped=grouped,
        single=single,
        interval=interval,
        swept=swept,
        fits=fits,
        shaken=shaken,
        seconds={OPTIMAL: _seconds(fit, interval.low), SINGLE: _seconds(fit, 1.0)},
        ours=_ours(tests),
    )


def _grouped(samples: Samples, threshold: float) -> CorrelationGrouping:
    return CorrelationGrouping(threshold=threshold, reference=REFERENCE).fit(samples.frame(), samples.deviations[:, 0])


def _fit_of(g: CorrelationGrouping, samples: Samples) -> PaperFit:
    inputs = samples.model_inputs(range(len(NAMES)), common.every(samples))
    model = g.freeze(target=TARGET, inputs=inputs, support=common.PAPERS_SUPPORT)
    return PaperFit(model, float(g.r_squared_), float(g.standard_error_))


def _seconds(samples: Samples, threshold: float) -> float:
    """Return the shortest time of a search in prepared data [s]; searches differ by their threshold only (H-19)."""
    change = samples.change()
    regressors = change[:, :-1] - change[:, -1:]
    tri = triangle(join_columns(regressors, samples.deviations[:, 0]), intercept=True)
    close = correlation(change[:, :-1])
    found = []
    for _ in range(TIMINGS):
        begin = time.perf_counter()
        choose(tri, group(close, threshold))
        found.append(time.perf_counter() - begin)
    return min(found)


def _ours(tests: Sequence[Recording]) -> dict[str, FloatArray]:
    """Return the residuals of our methods in the new tests; trained relative to each start, on both sets of rows."""
    inputs = [*(f"t_{p}_C" for p in HWANG_PLACES), "spindle_rpm"]
    often = [common.stacked(r, [TARGET], inputs) for r in (tests[:RUNS], tests[RUNS:])]
    rows = {"30 min": [_thinned(s) for s in often], "10 min": often}
    return {
        f"{method}, every {every}": common.residual(common.trained(method, learn), new)
        for method in OURS
        for every, (learn, new) in rows.items()
    }


def named(columns: Sequence[int]) -> str:
    """Return the names of the sensors in the given columns as text."""
    return " ".join(NAMES[k] for k in columns) or "none"
