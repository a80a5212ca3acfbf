"""Few sensors for `averaged`: loss of accuracy when omitted sensors are estimated from the remaining ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.models.numerics.structures import Moments, average, share_out
from thermocomp.models.pacedfeatures import PacedFeatures

#: number of averaged regressions for the errors of sensor sets on left-out parts: fewer than for a model suffice
_STRUCTURES = 30


@dataclass(frozen=True, eq=False)
class SensorSets:
    """One set of temperatures for each set size, for several targets at once.

    Parameters
    ----------
    sets : tuple of tuple of int
        Sets of 1, 2, ... temperatures, as indices into ``PacedFeatures.temperatures``; the last set contains all.
    error : ndarray of shape (n_sets, n_targets)
        Mean of the root mean square errors on the left-out parts [unit of the target].
    loss : ndarray of shape (n_sets, n_targets)
        RMS change of the output compared with all temperatures [unit of the target].
    answer : StandInAnswer
        Output with all temperatures.
    """

    sets: tuple[tuple[int, ...], ...]
    error: FloatArray
    loss: FloatArray
    answer: "StandInAnswer"


@dataclass(frozen=True, eq=False)
class StandIns:
    """Substitutes for temperatures; a kept one is estimated from the other kept ones, as if its sensor had failed.

    Parameters
    ----------
    single : tuple of int
        Best single substitute for each temperature; the temperature itself if there is no other.
    single_residual : ndarray of shape (n_temperatures,)
        Root mean square residual of each temperature with this substitute [degC]; inf if there is no other.
    weights : ndarray of shape (n_temperatures, n_temperatures)
        Column j: weights of the kept temperatures in the substitute of temperature j.
    residual : ndarray of shape (n_temperatures,)
        Root mean square residual of each temperature with these weights [degC].
    loss : ndarray of shape (n_temperatures, n_targets)
        Loss of accuracy of the model with all temperatures if only this temperature is replaced [unit of the target].
    """

    single: tuple[int, ...]
    single_residual: FloatArray
    weights: FloatArray
    residual: FloatArray
    loss: FloatArray


@dataclass(frozen=True, eq=False)
class StandInAnswer:
    """Contribution of the temperatures and their lags to the output of a model with all temperatures.

    Parameters
    ----------
    copies : ndarray of shape (n_copies, n_temperatures, n_targets)
        Weights of the temperatures and of their lags, lag by lag.
    gram : ndarray of shape (n_copies * n_temperatures, n_copies * n_temperatures)
        Mean products of these features [degC^2].
    noise : float
        Standard deviation of the temperature noise in use [degC].
    """

    copies: FloatArray
    gram: FloatArray
    noise: float

    @property
    def temperatures(self) -> FloatArray:
        """Mean products of the temperatures with each other, without their lags [degC^2]."""
        return self.gram[: self.copies.shape[1], : self.copies.shape[1]]

    def lose(self, made: FloatArray) -> FloatArray:
        """Return the RMS change of the output with temperatures estimated by a matrix of `make_up`, (n_targets,)."""
        missed = np.eye(len(made)) - made
        lost = np.concatenate([missed @ copy for copy in self.copies])
        return _root((lost * (self.gram @ lost)).sum(axis=0))

    def stand_ins(self, kept: Sequence[int]) -> StandIns:
        """Return the substitutes for each temperature: by a single other sensor, and by the kept sensors."""
        gram, everything = self.temperatures, range(self.copies.shape[1])
        pairs = np.full(gram.shape, np.inf)  # residual of one predicted by another
        for k in everything:
            others = [j for j in everything if j != k]
            pairs[others, k] = _left(gram, make_up(gram, [k], self.noise))[others]
        weights, losses = np.zeros_like(gram), []
        for j in everything:
            made = np.eye(len(gram))
            weights[:, j] = made[:, j] = make_up(gram, [k for k in kept if k != j], self.noise)[:, j]
            losses.append(self.lose(made))
        single = tuple(int(k) for k in pairs.argmin(axis=1))
        return StandIns(
            single=single,
            single_residual=pairs.min(axis=1),
            weights=weights,
            residual=_left(gram, weights),
            loss=np.array(losses),
        )


def reduce_sensors(
    features: PacedFeatures, moments: Moments, noise: float, most: int, *, structures: int, random_state: int = 0
) -> SensorSets:
    """Remove temperatures one at a time, each time the one with the smallest loss.

    The errors on left-out parts alone are too few for a selection: the set with the smallest error would be best by
    chance. Therefore the model with all temperatures is used as well: each removed temperature is estimated from the
    remaining ones (linear, with noise in use), and the resulting change of the model's output is added to the error.
    With many temperatures, the first ones are removed by this change alone.

    Parameters
    ----------
    noise : float
        Standard deviation of the temperature noise in use [degC].
    """
    everything = list(range(len(features.temperatures)))
    weights, _ = average(moments, features.draw(structures, random_state))
    count = features.copies * len(everything)
    answer = StandInAnswer(
        weights[:count].reshape(features.copies, len(everything), -1),
        moments.gram.sum(axis=0)[:count, :count] / moments.rows.sum(),
        noise,
    )

    def lose(kept: Sequence[int]) -> FloatArray:
        return answer.lose(make_up(answer.temperatures, kept, noise))

    def err(kept: Sequence[int]) -> FloatArray:
        _, errors = share_out(moments, features.draw(_STRUCTURES, random_state, kept))
        return np.asarray(errors.mean(axis=0))

    kept, found = everything, [everything]
    while len(kept) > 1:
        smaller = [[k for k in kept if k != out] for out in kept]
        # if all parts are needed for training, no error can be determined
        costs = [lose(s).mean() + (np.nan_to_num(err(s).mean()) if len(kept) <= 2 * most else 0.0) for s in smaller]
        kept = smaller[int(np.argmin(costs))]
        if len(kept) <= most:
            found.insert(0, kept)
    errors, losses = np.array([err(s) for s in found]), np.array([lose(s) for s in found])
    return SensorSets(tuple(map(tuple, found)), errors, losses, answer)


def make_up(gram: FloatArray, kept: Sequence[int], noise: float) -> FloatArray:
    """Return the matrix that estimates all temperatures from selected ones, (n_temperatures, n_temperatures).

    Parameters
    ----------
    gram : ndarray of shape (n_temperatures, n_temperatures)
        Mean products of the temperatures [degC^2].
    noise : float
        Standard deviation of the noise of their readings in use [degC].
    """
    known = list(kept)
    made = np.zeros_like(gram)
    if known:
        tiny = 1e-12 * float(np.trace(gram)) + np.finfo(np.float64).tiny
        made[known] = np.linalg.solve(gram[np.ix_(known, known)] + (noise**2 + tiny) * np.eye(len(known)), gram[known])
    made[:, known] = np.eye(len(gram))[:, known]
    return made


def _left(gram: FloatArray, made: FloatArray) -> FloatArray:
    """Return the RMS residual of each estimated temperature, (n_temperatures,) [degC]."""
    missed = np.eye(len(gram)) - made
    return _root((missed * (gram @ missed)).sum(axis=0))


def _root(squares: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))
