"""`dynamic`: ridge regression on temperatures, their lagged copies and the lagged spindle speed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.terms import Term
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.numerics import moments as ridge
from thermocomp.models.pacedfeatures import SHORTEST_LAG
from thermocomp.models.shrinkage import Rule, choose
from thermocomp.models.timed import Time, TimedRegressor
from thermocomp.recordings.samples import usual_step

MINUTE = 60.0

#: candidate sets of time constants for the temperature copies [s]: none, a single one of minutes to hours, or several
TEMPERATURE_LAGS: tuple[tuple[float, ...], ...] = (
    (),
    (10 * MINUTE,),
    (20 * MINUTE,),
    (40 * MINUTE,),
    (80 * MINUTE,),
    (5 * MINUTE, 20 * MINUTE, 80 * MINUTE),
    (10 * MINUTE, 40 * MINUTE, 160 * MINUTE),
)
#: candidate sets of time constants for the spindle speed [s]
SPEED_LAGS: tuple[tuple[float, ...], ...] = (
    (10 * MINUTE,),
    (30 * MINUTE,),
    (90 * MINUTE,),
    (5 * MINUTE, 20 * MINUTE, 80 * MINUTE),
    (10 * MINUTE, 40 * MINUTE, 160 * MINUTE),
    (3 * MINUTE, 10 * MINUTE, 30 * MINUTE, 100 * MINUTE, 300 * MINUTE),
)
#: candidate regularization strengths, per row and relative to each feature's mean square
STRENGTHS: tuple[float, ...] = tuple(float(10.0 ** (k / 2)) for k in range(-12, 5))

_CHUNK = 20_000  # feature rows held in memory at once: bounds the memory of a fit for any length of recording


@dataclass(frozen=True)
class _Candidate:
    """One set of time constants, and its columns in the table of all features."""

    temperature_lags: tuple[float, ...]
    speed_lags: tuple[float, ...]
    columns: IntArray


@dataclass(kw_only=True, eq=False, repr=False)
class DynamicRidge(TimedRegressor):
    """Ridge regression on temperatures, their lagged or high-passed copies, and the lagged spindle speed.

    Temperature sensors and structure have different time constants, and the heat at a bearing increases more than
    proportionally with the speed; both effects become linear in first-order lags of the temperatures, of the speed and
    of its square. The regularization strength and the set of time constants are chosen by cross-validation over thermal
    cycles, within the data given to `fit`: the set with the smallest mean RMS, and within it the greatest strength
    whose mean RMS is within one standard error of the smallest (one-standard-error rule of Breiman et al. 1984). Sets
    with a temperature lag below `SHORTEST_LAG` times the time between two rows (median) are not tried; if no set
    remains, the temperatures are not lagged.

    Parameters
    ----------
    speed : sequence of str or int
        Names (or indices into X) of the columns that are spindle speeds; the others are temperatures.
    temperature_lags, speed_lags : sequence of sequence of float
        Sets of time constants to choose from [s].
    speed_powers : sequence of int
        Powers of the speed that are lagged.
    copies : {'high-passed', 'lagged'}
        Quantity shrunk by the ridge: the temperature minus its lagged copy, or the lagged copy itself.
    strengths : sequence of float
        Regularization strengths to choose from.
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the regularization strength.
    fit_intercept : bool
        False: the model returns zero in the reference state.
    time : {'column', 'routed', 'none'} or None
        Source of the time, see `thermocomp.models.timed.TimedRegressor`; if None, `fit` raises an error.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features_used,)
        Weights of the chosen features, see `feature_labels_`.
    intercept_ : float
    feature_labels_ : tuple of str
    temperature_lags_, speed_lags_ : tuple of float
        Chosen time constants [s].
    strength_ : float
        Chosen regularization strength.
    cv_rms_ : float
        Mean of the RMS values of the left-out cycles with the chosen settings [unit of y].
    chosen_by_ : str
        Description of the cross-validation folds.

    References
    ----------
    Hoerl, A. E., Kennard, R. W.: Ridge regression: biased estimation for nonorthogonal problems. Technometrics 12(1),
    1970, 55-67. doi:10.1080/00401706.1970.10488634

    Breiman, L., Friedman, J. H., Olshen, R. A., Stone, C. J.: Classification and Regression Trees. Wadsworth, 1984
    (the one-standard-error rule).

    Brecher, C., Hirsch, P., Weck, M.: Compensation of thermo-elastic machine tool deformation based on control internal
    data. CIRP Annals 53(1), 2004, 299-304 (lags of the spindle speed).

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import DynamicRidge
    >>> dt = np.r_[np.inf, np.full(299, 60.0)]  # a row a minute [s]
    >>> speed = np.repeat([0.0, 3.0, 1.0, 4.0, 0.0, 2.0], 50)[:, None]  # [1000/min]
    >>> y = np.zeros(300)  # 8 um per 1000/min, reached with a time constant of 30 min
    >>> for t in range(1, 300):
    ...     y[t] = y[t - 1] + (8 * speed[t, 0] - y[t - 1]) * (1 - np.exp(-1 / 30))
    >>> model = DynamicRidge(speed=[0], speed_lags=([600.0], [1800.0]), speed_powers=(1,), time="routed")
    >>> print(model.fit(speed, y, dt=dt).speed_lags_, model.coef_.round(1).tolist())
    (1800.0,) [8.0]
    """

    columns: ClassVar[str] = "speed"

    speed: Sequence[str | int] = ()
    temperature_lags: Sequence[Sequence[float]] = TEMPERATURE_LAGS
    speed_lags: Sequence[Sequence[float]] = SPEED_LAGS
    speed_powers: Sequence[int] = (1, 2)
    copies: Literal["high-passed", "lagged"] = "high-passed"
    strengths: Sequence[float] = STRENGTHS
    rule: Rule = "one-standard-error"
    fit_intercept: bool = False
    time: Time | None = None

    def _fit(self, rows: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        self._split_columns()
        candidates = self._candidates(step)
        targets = np.column_stack([np.ones(len(deviation)), deviation])
        moments = ridge.accumulate(self._features(rows, step), targets, folds)
        chosen, self.strength_, self.cv_rms_ = self._choose(candidates, moments)
        self.temperature_lags_, self.speed_lags_ = chosen.temperature_lags, chosen.speed_lags
        self._columns = chosen.columns
        total = ridge.part(moments.sum(axis=0), chosen.columns)
        weights, intercepts = ridge.solve(total, (self.strength_,), self.fit_intercept)
        self.coef_, self.intercept_ = weights[:, 0], float(intercepts[0])

    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        tables = self._features(rows, step)
        return np.concatenate([table[:, self._columns] @ self.coef_ + self.intercept_ for _, table in tables])

    @property
    def feature_labels_(self) -> tuple[str, ...]:
        """Names of the features that belong to `coef_`."""
        names = [str(n) for n in self._names()]
        labels = [names[i] for i in self._temperatures]
        kind = "high-passed" if self.copies == "high-passed" else "lagged"
        labels += [f"{names[i]} {kind} {tau / MINUTE:g} min" for tau in self._t_taus for i in self._temperatures]
        labels += [
            f"{names[i]}^{power} lagged {tau / MINUTE:g} min"
            for tau in self._n_taus
            for power in self.speed_powers
            for i in self._speeds
        ]
        return tuple(labels[k] for k in self._columns)

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> LinearDynamic:
        direct: dict[Term, float] = {}
        lagged: list[tuple[Term, float, float]] = []  # signal, time constant, weight
        weights = iter(self.coef_.tolist())
        for i in self._temperatures:
            direct[(i,)] = next(weights)
        for tau in self.temperature_lags_:
            for i in self._temperatures:
                w = next(weights)
                if self.copies == "high-passed":  # w (s - lag of s)
                    direct[(i,)] += w
                    w = -w
                lagged.append(((i,), tau, w))
        for tau in self.speed_lags_:
            lagged += [((i,) * power, tau, next(weights)) for power in self.speed_powers for i in self._speeds]
        lagged = [lag for lag in lagged if lag[2] != 0]
        signals = sorted(
            {s for s, w in direct.items() if w != 0} | {s for s, _, _ in lagged}, key=lambda s: (len(s), s)
        )
        sensors = sorted({i for s in signals for i in s})
        return LinearDynamic(
            **header,
            inputs=tuple(inputs[i] for i in sensors),
            signals=tuple(tuple(sensors.index(i) for i in s) for s in signals),
            direct=tuple(direct.get(s, 0.0) for s in signals),
            lag_signals=tuple(signals.index(s) for s, _, _ in lagged),
            time_constants=tuple(tau for _, tau, _ in lagged),
            lagged=tuple(w for _, _, w in lagged),
            intercept=self.intercept_,
        )

    # -- features ------------------------------------------------------------------------------------------------------

    def _split_columns(self) -> None:
        self._speeds = [self._place(s, "speed column") for s in self.speed]
        self._temperatures = [i for i in range(len(self._names())) if i not in self._speeds]
        self._t_taus = tuple(sorted({float(t) for lags in self.temperature_lags for t in lags}))
        self._n_taus = tuple(sorted({float(t) for lags in self.speed_lags for t in lags})) if self._speeds else ()

    def _candidates(self, dt: FloatArray) -> list[_Candidate]:
        n_t, n_n = len(self._temperatures), len(self._speeds) * len(self.speed_powers)
        usual = usual_step(dt)
        shortest = SHORTEST_LAG * usual if np.isfinite(usual) else 0.0
        found = []
        for t_lags in [lags for lags in self.temperature_lags if n_t and min(lags, default=np.inf) >= shortest] or [()]:
            for n_lags in self.speed_lags if n_n else [()]:
                columns = list(range(n_t))
                for tau in sorted(t_lags):
                    start = n_t * (1 + self._t_taus.index(float(tau)))
                    columns += range(start, start + n_t)
                for tau in sorted(n_lags):
                    start = n_t * (1 + len(self._t_taus)) + n_n * self._n_taus.index(float(tau))
                    columns += range(start, start + n_n)
                found.append(_Candidate(tuple(sorted(t_lags)), tuple(sorted(n_lags)), np.array(columns, dtype=np.intp)))
        return found

    def _features(self, X: FloatArray, dt: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
        """Yield the table of all candidate features, in chunks of rows."""
        memory = None
        for start in range(0, len(X), _CHUNK):
            own = slice(start, start + _CHUNK)
            rows = X[own]
            temperatures = rows[:, self._temperatures]
            speeds = np.hstack([rows[:, self._speeds] ** power for power in self.speed_powers])
            signals = np.hstack([temperatures] * len(self._t_taus) + [speeds] * len(self._n_taus) + [speeds[:, :0]])
            taus = np.repeat(self._t_taus, temperatures.shape[1]).tolist()
            taus += np.repeat(self._n_taus, speeds.shape[1]).tolist()
            lags = lagbank.run(signals, dt[own], np.array(taus), memory)
            memory = lags[-1].copy()
            copies = temperatures.shape[1] * len(self._t_taus)
            if self.copies == "high-passed":
                lags[:, :copies] = signals[:, :copies] - lags[:, :copies]
            yield own, np.hstack([temperatures, lags])

    # -- choice --------------------------------------------------------------------------------------------------------

    def _choose(self, candidates: list[_Candidate], moments: FloatArray) -> tuple[_Candidate, float, float]:
        strengths = tuple(sorted((float(s) for s in self.strengths), reverse=True))
        if len(candidates) * len(strengths) == 1 or len(moments) == 1:
            return candidates[0], strengths[(len(strengths) - 1) // 2], float("nan")
        total = moments.sum(axis=0)
        rms = np.empty((len(candidates), len(strengths), len(moments)))
        for i, candidate in enumerate(candidates):
            for k in range(len(moments)):
                weights, intercepts = ridge.solve(
                    ridge.part(total - moments[k], candidate.columns), strengths, self.fit_intercept
                )
                left_out = ridge.part(moments[k], candidate.columns)
                full = np.vstack([weights, intercepts, -np.ones(len(strengths))])
                squares = (full * (left_out @ full)).sum(axis=0)
                rms[i, :, k] = np.sqrt(np.maximum(squares, 0.0) / left_out[-2, -2])
        i, j = choose(rms, self.rule)
        return candidates[i], strengths[j], float(rms[i, j].mean())
