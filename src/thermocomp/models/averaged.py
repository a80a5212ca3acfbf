"""`averaged`: many ridge regressions on lagged temperatures and speed states, merged into one model."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.numerics.folds import find_neighbours, halve
from thermocomp.models.numerics.structures import Moments, fit_each, share_out
from thermocomp.models.pacedfeatures import PacedFeatures
from thermocomp.models.timed import Time, TimedRegressor

MINUTE = 60.0

#: time constants of the temperature lags [s]
LAGS = (10 * MINUTE, 30 * MINUTE, 90 * MINUTE)
#: exponents of heat against speed: friction of constant torque; oil friction, torque ~ n^(2/3) (Palmgren); air
POWERS = (1.0, 5 / 3, 3.0)
#: time constants of the speed states at rest and at top speed [s]
STOPPED = (10 * MINUTE, 30 * MINUTE, 90 * MINUTE, 270 * MINUTE)
RUNNING = (5 * MINUTE, 15 * MINUTE, 45 * MINUTE, 135 * MINUTE)

#: number of linear combinations that describe the spread of the averaged regressions in a frozen model
DIRECTIONS = 12


@dataclass(kw_only=True, eq=False, repr=False)
class AveragedDynamic(TimedRegressor):
    """Average of many ridge regressions on lagged temperatures and on states of the spindle speed.

    A few thermal cycles cannot determine the time constants of a machine: the set with the smallest error on a left-out
    cycle is best by chance and does worse on the next. Therefore no single set is chosen. Each of many regressions
    (structures) uses some lags, the same for all temperatures, some speed states (`PacedDynamic`) and a ridge penalty,
    all selected at random. Their coefficients are averaged, with a greater weight for regressions with smaller errors
    on left-out half cycles (run or stop). Since all are linear in the same states, their average is a single model of
    that form.

    Each ridge regression adds the covariance that sensor noise in use, including that of the zero (reference reading),
    causes in the features, as a regression on very many noisy copies of the data would. The model does not rely on
    differences that are lost in noise.

    Parameters
    ----------
    speed : sequence of str or int
        Names (or indices into X) of the columns that are spindle speeds; the others are temperatures.
    noise : float
        Standard deviation of the temperature noise in use beyond the noise in X, independent between readings and in
        each reading of the zero [degC].
    lags : sequence of float
        Time constants of the temperature lags [s]. Those below `thermocomp.models.pacedfeatures.SHORTEST_LAG` times
        the time between two rows are omitted.
    powers : sequence of float
        Exponents of the speed as a fraction of the top speed.
    stopped, running : sequence of float
        Time constants of the speed states at rest and at top speed [s]; all pairs are used in which the time constant
        at top speed does not exceed that at rest.
    structures : int
        Number of averaged regressions.
    random_state : int
        Seed of the random selection.
    time : {'column', 'routed', 'none'} or None
        Source of the time, see `thermocomp.models.timed.TimedRegressor`; if None, `fit` raises an error.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features,)
        Weights of the features, see `feature_labels_`.
    feature_labels_ : tuple of str
    lags_ : tuple of float
        Lags of the temperatures [s].
    top_speed_ : float
        Greatest speed in the training rows [1/min].
    cv_rms_ : float
        Cross-validation error: mean of the RMS errors on the left-out parts [unit of y].
    chosen_by_ : str
        Description of the cross-validation folds.
    left_out_ : ndarray of shape (n_rows, 2)
        Prediction for each training row by regressions fitted without its cycle and, with five cycles or more, without
        the neighbouring ones (`numerics.folds.find_neighbours`), and their standard deviation [unit of y]; nan
        elsewhere.
    gain_ : ndarray of shape (n_inputs,)
        Magnitude of the response of y to a step of each temperature, after one row [unit of y per degC]; 0 for a speed.

    References
    ----------
    Ho, T. K.: The random subspace method for constructing decision forests. IEEE Transactions on Pattern Analysis and
    Machine Intelligence 20(8), 1998, 832-844. doi:10.1109/34.709601

    Bishop, C. M.: Training with noise is equivalent to Tikhonov regularization. Neural Computation 7(1), 1995, 108-116.
    doi:10.1162/neco.1995.7.1.108

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import AveragedDynamic
    >>> dt = np.r_[np.inf, np.full(1199, 60.0)]  # a row a minute [s]
    >>> speed = np.repeat([0.0, 3.0, 0.0, 4.0, 0.0, 2.0], 200)[:, None]  # [1000/min]
    >>> y = np.zeros(1200)  # 8 um per 1000/min, reached with a time constant of 30 min
    >>> for t in range(1, 1200):
    ...     y[t] = y[t - 1] + (8 * speed[t, 0] - y[t - 1]) * (1 - np.exp(-1 / 30))
    >>> model = AveragedDynamic(speed=[0], time="routed").fit(speed, y, dt=dt, cycle=np.arange(1200) // 400)
    >>> print(y.max().round(), np.sqrt(np.mean((model.predict(speed, dt=dt) - y) ** 2)).round(1))
    32.0 0.4
    """

    columns: ClassVar[str] = "speed"

    speed: Sequence[str | int] = ()
    noise: float = 0.4
    lags: Sequence[float] = LAGS
    powers: Sequence[float] = POWERS
    stopped: Sequence[float] = STOPPED
    running: Sequence[float] = RUNNING
    structures: int = 200
    random_state: int = 0
    time: Time | None = None

    def _fit(self, rows: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        self._check()
        speeds = [self._place(s, "speed column") for s in self.speed]
        self._features, parts, self.chosen_by_ = self.lay_out(rows, step, folds, speeds)
        moments = self._features.moments(rows, deviation[:, None], step, parts, self.noise)
        structures = self._features.draw(self.structures, self.random_state)
        shares, errors = share_out(moments, structures)
        everything = np.unique(parts[parts >= 0])
        each = fit_each(moments, structures, everything)[..., 0]
        self.coef_, self.cv_rms_ = shares[:, 0] @ each, float(errors.mean())
        self._spread = _main_directions(np.sqrt(shares) * (each - self.coef_), moments)
        gone = [np.flatnonzero(near) for near in find_neighbours(folds, step)]
        without = [np.setdiff1d(everything, parts[np.isin(folds, own)]) for own in gone]
        others = np.array([fit_each(moments, structures, kept)[..., 0] for kept in without])
        self.left_out_ = self._leave_out(rows, step, folds, others, shares[:, 0])
        self.lags_, self.top_speed_ = self._features.lags, self._features.top_speed
        self.gain_ = np.zeros(rows.shape[1])
        self.gain_[list(self._features.temperatures)] = np.abs(self._features.shares(step) @ self._copies())

    def _check(self) -> None:
        if not hasattr(self.structures, "__index__") or self.structures < 1:
            raise InputError(f"structures {self.structures}: expected a whole number, at least 1")
        if not 0 <= self.noise < np.inf:
            raise InputError(f"noise {self.noise}: expected at least 0 degC")
        for name, unit in (("lags", " s"), ("powers", ""), ("stopped", " s"), ("running", " s")):
            values = getattr(self, name)
            if not all(0 < v < np.inf for v in values):
                raise InputError(f"{name} {tuple(values)}: expected finite numbers, each more than 0{unit}")

    def lay_out(
        self, rows: FloatArray, step: FloatArray, folds: IntArray, speeds: Sequence[int]
    ) -> tuple[PacedFeatures, IntArray, str]:
        """Return the features identifiable from the rows, and the parts of the rows to leave out together.

        Parameters
        ----------
        rows : ndarray of shape (n_rows, n_inputs)
            Inputs minus their reference.
        step : ndarray of shape (n_rows,)
            Time since the previous row [s], inf at the start of a test.
        folds : ndarray of int of shape (n_rows,)
            Fold of each row, as returned by `thermocomp.models.numerics.folds.number_folds`.
        speeds : sequence of int
            Columns that are spindle speeds; the others are temperatures.

        Returns
        -------
        features : PacedFeatures
        parts : ndarray of int of shape (n_rows,)
        description : str
            See `thermocomp.models.numerics.folds.halve`.
        """
        features = PacedFeatures.of(
            rows,
            step,
            folds >= 0,
            speeds,
            lags=self.lags,
            powers=self.powers,
            stopped=self.stopped,
            running=self.running,
        )
        turning = np.abs(rows[:, list(speeds)]).max(axis=1, initial=0.0) > THRESHOLDS.stopped_speed
        return features, *halve(folds, turning)

    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        return np.concatenate([table @ self.coef_ for _, table in self._features.tables(rows, step)])

    def _leave_out(
        self, rows: FloatArray, step: FloatArray, folds: IntArray, weights: FloatArray, shares: FloatArray
    ) -> FloatArray:
        """Return mean and spread of all regressions, (n_rows, 2), with the weights (n_folds, ...) of a row's fold."""
        found = np.full((len(rows), 2), np.nan)
        for own, table in self._features.tables(rows, step):
            for k, fitted in enumerate(weights):
                mine = folds[own] == k
                answers = table[mine] @ fitted.T
                mean = answers @ shares
                found[own][mine] = np.column_stack([mean, np.sqrt((answers - mean[:, None]) ** 2 @ shares)])
        return found

    def _copies(self) -> FloatArray:
        """Return the weights of the temperatures and of their lags, shape (n_copies, n_temperatures)."""
        of = self._features
        return self.coef_[: of.copies * len(of.temperatures)].reshape(of.copies, len(of.temperatures))

    @property
    def feature_labels_(self) -> tuple[str, ...]:
        """Names of the features that belong to `coef_`."""
        names, of = [str(n) for n in self._names()], self._features
        labels = [names[i] for i in of.temperatures]
        labels += [f"{names[i]} lagged {tau / MINUTE:g} min" for tau in of.lags for i in of.temperatures]
        states = [f"{names[i]}^{p:.3g} lagged {a / MINUTE:g} to {b / MINUTE:g} min" for i, p, a, b in of.states]
        return (*labels, *states)

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> PacedDynamic:
        of, copies = self._features, self._copies()
        temperatures = [(i, w) for i, w in zip(of.temperatures, copies.T.tolist(), strict=True) if any(w)]
        weights = self.coef_[len(self.coef_) - len(of.states) :].tolist()
        states = [(state, w) for state, w in zip(of.states, weights, strict=True) if w != 0]
        kept = np.append(np.tile(np.any(copies, axis=0), of.copies), np.array(weights) != 0)
        used = sorted({i for i, _ in temperatures} | {state[0] for state, _ in states})
        return PacedDynamic(
            **header,
            inputs=tuple(inputs[i] for i in used),
            time_constants=of.lags,
            temperatures=tuple(LaggedInput(used.index(i), w[0], tuple(w[1:])) for i, w in temperatures),
            top_speed=of.top_speed,
            states=tuple(
                SpeedState(input=used.index(i), power=p, stopped=slow, running=fast, weight=w)
                for (i, p, slow, fast), w in states
            ),
            spread=tuple(tuple(float(f"{w:.5g}") for w in row) for row in self._spread[:, kept].tolist()),
        )


def _main_directions(deviations: FloatArray, moments: Moments) -> FloatArray:
    """Return a few linear combinations, (n_spread, n_features), that approximate the spread of the regressions.

    They are the principal directions of the spread, enlarged to make up for the omitted ones.

    Parameters
    ----------
    deviations : ndarray of shape (n_structures, n_features)
        Weights minus their mean, times the square root of the regression's weight in the average.
    """
    scale = np.sqrt(np.diag(moments.gram.sum(axis=0)) / moments.rows.sum())
    scale[scale == 0] = 1.0
    scaled = deviations * scale
    # eigenvectors of the smaller product take a tenth of the time of a singular value decomposition
    powers, vectors = np.linalg.eigh(scaled @ scaled.T)
    whole, main = np.maximum(powers, 0.0).sum(), np.maximum(powers[: -DIRECTIONS - 1 : -1], 0.0).sum()
    enlarged = np.sqrt(whole / max(main, np.finfo(float).tiny))
    return np.asarray(enlarged * (vectors[:, : -DIRECTIONS - 1 : -1].T @ scaled) / scale)
