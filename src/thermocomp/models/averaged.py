"""`averaged`: many ridge regressions on lagged temperatures and states of the spindle speed, merged into one model."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.bounds import LEAST
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.dynamic import MINUTE, SHORTEST_LAG
from thermocomp.models.numerics.folds import halve
from thermocomp.models.numerics.structures import Moments, Structure, average
from thermocomp.models.timed import Time, TimedRegressor

#: of the lags of the temperatures [s]
LAGS = (10 * MINUTE, 30 * MINUTE, 90 * MINUTE)
#: what heat grows with: friction of a constant torque; of oil, whose torque grows with n^(2/3) (Palmgren); of air
POWERS = (1.0, 5 / 3, 3.0)
#: time constants of the speed states at rest and at top speed [s]
STOPPED = (10 * MINUTE, 30 * MINUTE, 90 * MINUTE, 270 * MINUTE)
RUNNING = (5 * MINUTE, 15 * MINUTE, 45 * MINUTE, 135 * MINUTE)

# what a structure is drawn from
_FEWEST_COPIES, _MOST_COPIES = 2, 4  # of each temperature: itself and its lags
_FEWEST_STATES, _MOST_STATES = 2, 12
_WEAKEST, _STRONGEST = -7.0, -1.0  # strength of the ridge per feature, power of ten

_CHUNK = 20_000  # rows of features held at once


class AveragedDynamic(TimedRegressor):
    """Average of many ridge regressions on lagged temperatures and on states of the spindle speed.

    A few thermal cycles cannot tell which time constants a machine has: the set that errs least on a cycle left out is
    the luckiest, and errs more on the next. So none is chosen. Each of many structures takes some lags, the same for
    all temperatures, some states of the speed (`PacedDynamic`) and a strength of its ridge at random; the weights of
    all are averaged, those that err less where half a cycle, its run or its stop, was left out with the greater share.
    Since every structure is linear in the same states, their average is one model of that form.

    To each ridge the covariance is added that noise of the sensors in use gives the features, the zero's included: what
    a regression on inputs with that noise would come to. Nothing leans on a difference that is lost in noise.

    Parameters
    ----------
    speed : sequence of str or int
        Names (or indices into X) of the columns that are spindle speeds; the others are temperatures.
    noise : float
        Standard deviation of the temperatures in use, beyond what they have in X, independent from reading to reading
        and in each reading of the zero [degC].
    lags : sequence of float
        Time constants of the temperatures' lags [s]. One below `SHORTEST_LAG` times the time between two rows is left
        out.
    powers : sequence of float
        Of the speed's share of the top speed.
    stopped, running : sequence of float
        Time constants of the speed states at rest and at top speed [s]; all pairs are taken that do not slow down as
        the spindle turns.
    structures : int
        How many are averaged.
    random_state : int
        Of the draw.
    time : {'column', 'routed', 'none'} or None
        Where it finds the time, see `thermocomp.models.timed.TimedRegressor`; without it, it refuses to work.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features,)
        Weights of the features, see `feature_labels_`.
    feature_labels_ : tuple of str
    lags_ : tuple of float
        Of the temperatures [s].
    top_speed_ : float
        Greatest speed of the rows learned from [1/min].
    cv_rms_ : float
        Mean over what was left out of the root mean square error there [unit of y].
    chosen_by_ : str
        What was left out.
    gain_ : ndarray of shape (n_features_in_,)
        How much y follows each temperature within one step between rows, in absolute value [unit of y per degC]; 0 for
        a speed.

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
    >>> bool(np.abs(model.predict(speed, dt=dt) - y).max() < 1.0)
    True
    """

    columns: ClassVar[str] = "speed"

    def __init__(
        self,
        *,
        speed: Sequence[str | int] = (),
        noise: float = 0.4,
        lags: Sequence[float] = LAGS,
        powers: Sequence[float] = POWERS,
        stopped: Sequence[float] = STOPPED,
        running: Sequence[float] = RUNNING,
        structures: int = 200,
        random_state: int = 0,
        time: Time | None = None,
    ) -> None:
        self.speed = speed
        self.noise = noise
        self.lags = lags
        self.powers = powers
        self.stopped = stopped
        self.running = running
        self.structures = structures
        self.random_state = random_state
        self.time = time

    def _fit(self, rows: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        if self.structures < 1 or not 0 <= self.noise < np.inf:
            raise InputError(f"structures {self.structures}, noise {self.noise}: want at least 1, and at least 0 degC")
        self._speeds = [self._place(s, "speed column") for s in self.speed]
        self._temperatures = [i for i in range(rows.shape[1]) if i not in self._speeds]
        usual = _usual_step(step)
        self.lags_ = tuple(float(t) for t in self.lags if t >= SHORTEST_LAG * usual or not np.isfinite(usual))
        learned = folds >= 0
        self.top_speed_ = max(float(np.abs(rows[learned][:, self._speeds]).max(initial=0.0)), LEAST)
        self._states = [
            (i, float(p), float(stopped), float(running))
            for i in self._speeds
            for p in self.powers
            for stopped in self.stopped
            for running in self.running
            if running <= stopped
        ]
        turning = np.abs(rows[:, self._speeds]).max(axis=1, initial=0.0) > 0
        parts, self.chosen_by_ = halve(folds, turning)
        moments = self._moments(rows, deviation[:, None], step, parts, self._covariance(rows, step))
        weights, errors = average(moments, self._draw())
        self.coef_, self.cv_rms_ = weights[:, 0], float(errors.mean())
        self.gain_ = self._gain(usual)

    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        return np.concatenate([features @ self.coef_ for features in self._features(rows, step)])

    @property
    def feature_labels_(self) -> tuple[str, ...]:
        """Names of the features behind `coef_`."""
        names = [str(n) for n in self._names()]
        labels = [names[i] for i in self._temperatures]
        labels += [f"{names[i]} lagged {tau / MINUTE:g} min" for tau in self.lags_ for i in self._temperatures]
        return (
            *labels,
            *(f"{names[i]}^{p:.3g} lagged {a / MINUTE:g} to {b / MINUTE:g} min" for i, p, a, b in self._states),
        )

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> PacedDynamic:
        count = len(self._temperatures)
        copies = self.coef_[: count * (1 + len(self.lags_))].reshape(-1, count).T.tolist()
        states = self.coef_[count * (1 + len(self.lags_)) :].tolist()
        temperatures = [(i, w) for i, w in zip(self._temperatures, copies, strict=True) if any(w)]
        weighted = [(state, w) for state, w in zip(self._states, states, strict=True) if w != 0]
        used = sorted({i for i, _ in temperatures} | {state[0] for state, _ in weighted})
        return PacedDynamic(
            **header,
            inputs=tuple(inputs[i] for i in used),
            time_constants=self.lags_,
            temperatures=tuple(LaggedInput(used.index(i), w[0], tuple(w[1:])) for i, w in temperatures),
            top_speed=self.top_speed_,
            states=tuple(SpeedState(used.index(i), p, slow, fast, w) for (i, p, slow, fast), w in weighted),
        )

    # -- features ------------------------------------------------------------------------------------------------------

    def _features(self, rows: FloatArray, step: FloatArray) -> Iterator[FloatArray]:
        """Yield the table of all features, a chunk of rows at a time: temperatures, their lags by lag, states."""
        where = [state[0] for state in self._states]
        powers, stopped, running = np.array([state[1:] for state in self._states], dtype=np.float64).reshape(-1, 3).T
        slow = np.repeat(self.lags_, len(self._temperatures))
        memory = None
        for start in range(0, len(rows), _CHUNK):
            chunk, dt = rows[start : start + _CHUNK], step[start : start + _CHUNK]
            temperatures = chunk[:, self._temperatures]
            share = np.abs(chunk[:, where]) / self.top_speed_
            signals = np.hstack([temperatures] * len(self.lags_) + [share**powers])
            paced = 1.0 / (1.0 / stopped + share * (1.0 / running - 1.0 / stopped))
            lags = lagbank.run(signals, dt, np.hstack([np.tile(slow, (len(chunk), 1)), paced]), memory)
            memory = lags[-1].copy()
            yield np.hstack([temperatures, lags])

    def _moments(
        self, rows: FloatArray, deviation: FloatArray, step: FloatArray, parts: IntArray, noise: FloatArray
    ) -> Moments:
        n_parts, n_features, start = int(parts.max()) + 1, len(noise), 0
        products = np.zeros((n_parts, n_features + deviation.shape[1], n_features + deviation.shape[1]))
        for features in self._features(rows, step):
            own = slice(start, start + len(features))
            table = np.hstack([features, deviation[own]])
            for k in range(n_parts):
                mine = table[parts[own] == k]
                products[k] += mine.T @ mine
            start += len(features)
        return Moments(
            products[:, :n_features, :n_features],
            products[:, :n_features, n_features:],
            np.diagonal(products, axis1=1, axis2=2)[:, n_features:],
            np.bincount(parts[parts >= 0], minlength=n_parts).astype(np.float64),
            noise,
        )

    def _covariance(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        """Return the covariance of the features by noise of the readings, and of those of the zero."""
        count, n_lags = len(self._temperatures), 1 + len(self.lags_)
        share = np.r_[1.0, lagbank.step_response(_usual_step(step), np.array(self.lags_, dtype=np.float64))]
        kept = np.outer(1 - share, 1 - share)
        own = np.outer(share, share) / (1 - kept) + _zero_noise(rows[:, self._temperatures], step)
        covariance = np.zeros((count * n_lags + len(self._states),) * 2)
        for k in range(count):
            at = np.arange(n_lags) * count + k
            covariance[np.ix_(at, at)] = self.noise**2 * own
        return covariance

    def _draw(self) -> list[Structure]:
        rng = np.random.default_rng(self.random_state)
        count, n_copies, n_states = len(self._temperatures), 1 + len(self.lags_), len(self._states)
        drawn = []
        for _ in range(self.structures):
            copies = np.sort(_pick(rng, n_copies if count else 0, _FEWEST_COPIES, _MOST_COPIES))
            states = np.sort(_pick(rng, n_states, _FEWEST_STATES, _MOST_STATES))
            strengths = 10 ** rng.uniform(_WEAKEST, _STRONGEST, 2)
            columns = [(copies[:, None] * count + np.arange(count)).ravel(), n_copies * count + states]
            drawn.append(
                Structure(
                    np.concatenate(columns),
                    np.concatenate([np.full(len(c), s * len(c)) for c, s in zip(columns, strengths, strict=True)]),
                )
            )
        return drawn

    def _gain(self, usual: float) -> FloatArray:
        count = len(self._temperatures)
        share = np.r_[1.0, lagbank.step_response(usual, np.array(self.lags_, dtype=np.float64))]
        gain = np.zeros(len(self._names()))
        gain[self._temperatures] = np.abs(share @ self.coef_[: count * len(share)].reshape(len(share), count))
        return gain


def _pick(rng: np.random.Generator, count: int, fewest: int, most: int) -> IntArray:
    """Return some of `count` numbers at random, as many as there are at most."""
    return rng.choice(count, min(count, int(rng.integers(fewest, most + 1))), replace=False)


def _usual_step(step: FloatArray) -> float:
    """Return the median time between two rows [s]; inf where every row is a test of its own."""
    between = step[np.isfinite(step) & (step > 0)]
    return float(np.median(between)) if between.size else float("inf")


def _zero_noise(temperatures: FloatArray, step: FloatArray) -> float:
    """Return the mean variance of the tests' zeros, in units of that of a reading.

    The readings that a zero is the mean of all say that mean, so they are the rows at the start that do not change.
    """
    starts = np.append(np.flatnonzero(np.isinf(step)), len(step))
    shares = []
    for first, last in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        changed = (temperatures[first:last] != temperatures[first]).any(axis=1)
        shares.append(1.0 / (int(np.argmax(changed)) if changed.any() else last - first))
    return float(np.mean(shares))
