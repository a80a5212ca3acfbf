"""Features of `averaged`: temperatures, their lags, and states of the spindle speed with speed-dependent lags."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.bounds import LEAST
from thermocomp.models.numerics.moments import accumulate
from thermocomp.models.numerics.structures import LagStructure, Moments
from thermocomp.recordings.samples import usual_step

#: Temperature lags shorter than this many row intervals are omitted: the rows contain no information about them, and a
#: model that runs at another rate would behave in an untested way.
SHORTEST_LAG = 2.0

# ranges from which a structure is drawn
_FEWEST_COPIES, _MOST_COPIES = 2, 4  # copies of each temperature: itself and its lags
_FEWEST_STATES, _MOST_STATES = 2, 12
_WEAKEST, _STRONGEST = -6.0, -1.0  # ridge penalty per feature, as a power of ten

_CHUNK = 20_000  # feature rows held in memory at once: bounds the memory of a fit for any length of recording


@dataclass(frozen=True)
class PacedFeatures:
    """Features in this order: temperatures, their lags (lag by lag), speed states.

    Parameters
    ----------
    temperatures : tuple of int
        Columns of the temperatures.
    lags : tuple of float
        Time constants of the temperature lags [s].
    states : tuple of (int, float, float, float)
        Column of the speed, power, and time constants at rest and at top speed [s].
    top_speed : float
        [1/min]
    """

    temperatures: tuple[int, ...]
    lags: tuple[float, ...]
    states: tuple[tuple[int, float, float, float], ...]
    top_speed: float

    @classmethod
    def of(
        cls,
        rows: FloatArray,
        step: FloatArray,
        learned: BoolArray,
        speeds: Sequence[int],
        *,
        lags: Sequence[float],
        powers: Sequence[float],
        stopped: Sequence[float],
        running: Sequence[float],
    ) -> "PacedFeatures":
        """Return the features identifiable from the rows.

        Parameters
        ----------
        rows : ndarray of shape (n_rows, n_inputs)
            Inputs minus their reference.
        step : ndarray of shape (n_rows,)
            Time since the previous row [s], inf at the start of a test.
        learned : ndarray of bool of shape (n_rows,)
            Training rows.
        """
        usual = usual_step(step)
        # if the spindle was stopped in all training rows, use the other rows
        turned = np.abs(rows[:, list(speeds)]).max(axis=1, initial=0.0)
        return cls(
            tuple(i for i in range(rows.shape[1]) if i not in speeds),
            tuple(float(t) for t in lags if t >= SHORTEST_LAG * usual or not np.isfinite(usual)),
            tuple(
                (int(i), float(p), float(slow), float(fast))
                for i in speeds
                for p in powers
                for slow in stopped
                for fast in running
                if fast <= slow  # lags at speed are not longer than at rest
            ),
            max(float(turned[learned].max(initial=0.0)) or float(turned.max(initial=0.0)), LEAST),
        )

    @property
    def copies(self) -> int:
        """Number of features per temperature: itself and its lags."""
        return 1 + len(self.lags)

    def __len__(self) -> int:
        return self.copies * len(self.temperatures) + len(self.states)

    def tables(self, rows: FloatArray, step: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
        """Yield the table of all features, (n_rows, n_features), in chunks of rows, with the rows of each."""
        where = [state[0] for state in self.states]
        powers, slow, fast = np.array([state[1:] for state in self.states], dtype=np.float64).reshape(-1, 3).T
        taus = np.repeat(self.lags, len(self.temperatures))
        memory = None
        for start in range(0, len(rows), _CHUNK):
            own = slice(start, start + _CHUNK)
            chunk, dt = rows[own], step[own]
            temperatures = chunk[:, self.temperatures]
            share = np.abs(chunk[:, where]) / self.top_speed
            signals = np.hstack([temperatures] * len(self.lags) + [share**powers])
            paced = 1.0 / (1.0 / slow + share * (1.0 / fast - 1.0 / slow))
            states = lagbank.run(signals, dt, np.hstack([np.tile(taus, (len(chunk), 1)), paced]), memory)
            memory = states[-1].copy() if len(states) else memory
            yield own, np.hstack([temperatures, states])

    def table(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        """Return the table of all features, (n_rows, n_features)."""
        return np.vstack([features for _, features in self.tables(rows, step)])

    def moments(
        self, rows: FloatArray, targets: FloatArray, step: FloatArray, parts: IntArray, noise: float
    ) -> Moments:
        """Return the moments of the rows for ridge regressions.

        Parameters
        ----------
        rows : ndarray of shape (n_rows, n_inputs)
        targets : ndarray of shape (n_rows, n_targets)
            Predicted quantities.
        step : ndarray of shape (n_rows,)
            [s]
        parts : ndarray of int of shape (n_rows,)
            Part of each row; each part is left out as a whole; rows with -1 are not used for training.
        noise : float
            Standard deviation of the temperature noise in use [degC].
        """
        n_features, products = len(self), accumulate(self.tables(rows, step), targets, parts)
        return Moments(
            gram=products[:, :n_features, :n_features],
            cross=products[:, :n_features, n_features:],
            power=np.diagonal(products, axis1=1, axis2=2)[:, n_features:],
            rows=np.bincount(parts[parts >= 0], minlength=len(products)).astype(np.float64),
            noise=noise**2 * self._covariance(rows, step),
        )

    def _covariance(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        """Return the covariance of the features for noise of 1 degC in the readings, including those of the zero."""
        share = self.shares(step)
        kept = np.outer(1 - share, 1 - share)
        own = np.outer(share, share) / (1 - kept) + _zero_noise(rows[:, self.temperatures], step)
        covariance = np.zeros((len(self), len(self)))
        count = self.copies * len(self.temperatures)
        covariance[:count, :count] = np.kron(own, np.eye(len(self.temperatures)))
        return covariance

    def shares(self, step: FloatArray) -> FloatArray:
        """Return the response of each copy of a temperature to a unit step, after the usual time step, (n_copies,)."""
        return np.append(1.0, lagbank.step_response(usual_step(step), np.array(self.lags, dtype=np.float64)))

    def draw(self, count: int, random_state: int, keep: Sequence[int] | None = None) -> list[LagStructure]:
        """Select regressions at random: their lags (the same for all temperatures), speed states, ridge penalties.

        Parameters
        ----------
        keep : sequence of int, optional
            Indices in `temperatures` to use; default: all. The random selection does not depend on this.
        """
        rng = np.random.default_rng(random_state)
        kept = np.arange(len(self.temperatures)) if keep is None else np.asarray(keep, dtype=np.intp)
        first = self.copies * len(self.temperatures)
        drawn = []
        for _ in range(count):
            copies = _pick(rng, self.copies, _FEWEST_COPIES, _MOST_COPIES)
            states = _pick(rng, len(self.states), _FEWEST_STATES, _MOST_STATES)
            strengths = 10 ** rng.uniform(_WEAKEST, _STRONGEST, 2)
            columns = [(copies[:, None] * len(self.temperatures) + kept).ravel(), first + states]
            each = [np.full(len(c), s * len(c)) for c, s in zip(columns, strengths, strict=True)]
            drawn.append(LagStructure(np.concatenate(columns), np.concatenate(each)))
        return drawn


def _pick(rng: np.random.Generator, count: int, fewest: int, most: int) -> IntArray:
    """Return a random, sorted subset of ``range(count)`` with `fewest` to `most` elements."""
    return np.sort(rng.choice(count, min(count, int(rng.integers(fewest, most + 1))), replace=False))


def _zero_noise(temperatures: FloatArray, step: FloatArray) -> float:
    """Return the mean variance of the tests' zeros, relative to the variance of a reading.

    The readings averaged for a zero are replaced by their mean, so they are the constant rows at the start of a test.
    """
    starts = np.append(np.flatnonzero(np.isinf(step)), len(step))
    shares = []
    for first, last in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        changed = (temperatures[first:last] != temperatures[first]).any(axis=1)
        shares.append(1.0 / (int(np.argmax(changed)) if changed.any() else last - first))
    return float(np.mean(shares))
