"""Few sensors for `averaged`: what its answer loses when the sensors left out are made up from those that stay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.models.numerics.structures import Moments, average, share_out
from thermocomp.models.pacedfeatures import PacedFeatures

FloatArray = NDArray[np.float64]

#: structures that tell how a set of sensors errs on what was left out; the ranking of sets needs fewer than a model
_STRUCTURES = 30


@dataclass(frozen=True, eq=False)
class SensorSets:
    """One set of temperatures for each number of them, for several targets at once.

    Parameters
    ----------
    sets : tuple of tuple of int
        Of 1, 2, ... temperatures, each their places in ``PacedFeatures.temperatures``; the last holds all.
    error : ndarray of shape (n_sets, n_targets)
        Mean root mean square error on what was left out [unit of the target].
    loss : ndarray of shape (n_sets, n_targets)
        Root mean square of what the answer with all temperatures loses [unit of the target].
    """

    sets: tuple[tuple[int, ...], ...]
    error: FloatArray
    loss: FloatArray


def reduce_sensors(
    features: PacedFeatures, moments: Moments, noise: float, most: int, *, structures: int, random_state: int = 0
) -> SensorSets:
    """Take temperatures away, one after the other, the one each time that is missed least.

    Errors on what was left out alone are too few to choose by: the set that errs least there is the luckiest. So the
    model with all temperatures is asked as well. Each temperature left out is made up from those that stay (linear,
    with noise in use), and what the model's answer loses by that is added to the error. From many temperatures the
    first go by the loss alone.

    Parameters
    ----------
    features : PacedFeatures
    moments : Moments
        Of all targets.
    noise : float
        Standard deviation of the temperatures in use [degC].
    most : int
        Largest set, beside that of all.
    structures : int
        Of the model with all temperatures.
    random_state : int

    Returns
    -------
    SensorSets
    """
    everything = list(range(len(features.temperatures)))
    weights, _ = average(moments, features.draw(structures, random_state))
    copies = weights[: features.copies * len(everything)].reshape(features.copies, len(everything), -1)
    gram = moments.gram.sum(axis=0)[: features.copies * len(everything), : features.copies * len(everything)]
    gram = gram / moments.rows.sum()

    def lose(kept: Sequence[int]) -> FloatArray:
        missed = np.eye(len(everything)) - make_up(gram[: len(everything), : len(everything)], kept, noise)
        lost = np.concatenate([missed @ copy for copy in copies])
        return np.asarray(np.sqrt(np.maximum((lost * (gram @ lost)).sum(axis=0), 0.0)))

    def err(kept: Sequence[int]) -> FloatArray:
        _, errors = share_out(moments, features.draw(_STRUCTURES, random_state, kept))
        return np.asarray(errors.mean(axis=0))

    kept, found = everything, [everything]
    while len(kept) > 1:
        smaller = [[k for k in kept if k != out] for out in kept]
        costs = [lose(s).mean() + (err(s).mean() if len(kept) <= 2 * most else 0.0) for s in smaller]
        kept = smaller[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
        if len(kept) <= most:
            found.insert(0, kept)
    return SensorSets(tuple(map(tuple, found)), np.array([err(s) for s in found]), np.array([lose(s) for s in found]))


def make_up(gram: FloatArray, kept: Sequence[int], noise: float) -> FloatArray:
    """Return the matrix that makes all temperatures from some of them, (n_temperatures, n_temperatures).

    Parameters
    ----------
    gram : ndarray of shape (n_temperatures, n_temperatures)
        Mean products of the temperatures [degC^2].
    kept : sequence of int
        Those that are known.
    noise : float
        Standard deviation of their readings in use [degC].

    Returns
    -------
    ndarray
        Column j holds the weights that make temperature j; of one that is known, 1 for itself.
    """
    known = list(kept)
    made = np.zeros_like(gram)
    if known:
        tiny = 1e-12 * float(np.trace(gram)) + np.finfo(np.float64).tiny
        made[known] = np.linalg.solve(gram[np.ix_(known, known)] + (noise**2 + tiny) * np.eye(len(known)), gram[known])
    made[:, known] = np.eye(len(gram))[:, known]
    return made
