"""Nonlinear heat exchange in a linear model: variable conductances in addition to the constant ones.

The model keeps its constant conductances; the difference from the actual ones is applied as a heat source on one side
and an equal sink on the other. This heat depends on the temperatures at the end of the step, so that a small linear
system is solved: the step is stable for any conductance, and heat is conserved.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.virtual.statespace import Operators, ReducedModel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Exchange:
    """Heat paths during steps of one kind.

    Parameters
    ----------
    into : ndarray of shape (n_states + n_watched, n_paths)
        Effect of one watt along each path during a step.
    difference : ndarray of shape (n_paths, n_watched)
        First side minus second side, in terms of the watched places; the air is not one of them.
    to_air : ndarray of shape (n_paths, 3)
        Weights of the air, for paths whose second side is the air.
    mutual : ndarray of shape (n_paths, n_paths)
        Effect of one watt along each path on the temperature difference of each path.
    """

    into: FloatArray
    difference: FloatArray
    to_air: FloatArray
    mutual: FloatArray

    @classmethod
    def of(
        cls, model: ReducedModel, operators: Operators, watched: Sequence[str], paths: Sequence[tuple[str, str | None]]
    ) -> "Exchange":
        """Return the operators of the heat exchange along paths.

        Parameters
        ----------
        paths : sequence of (str, str or None)
            From a watched place, which is also the name of a heat input, to another such place, or to the room air
            (None).
        """
        n = len(model.one)
        heat = np.zeros((len(model.inputs), len(paths)))
        difference, to_air = np.zeros((len(paths), len(watched))), np.zeros((len(paths), 3))
        for k, (a, b) in enumerate(paths):
            for place, sign in ((a, 1.0), (b, -1.0)):
                if place is None:
                    to_air[k, 0] = 1.0
                    continue
                difference[k, watched.index(place)] = sign
                heat[model.inputs.index(place), k] = sign
        into = operators.heat @ heat
        return cls(into, difference, to_air, difference @ into[n:])

    def settle(self, after: FloatArray, extra: FloatArray, air: FloatArray) -> FloatArray:
        """Add the heat exchanged during a step to the state after it; return the heat from second to first side [W].

        Parameters
        ----------
        after : ndarray of shape (n_states + n_watched,)
            State after the step without the exchange; modified in place.
        extra : ndarray of shape (n_paths,)
            Difference of each conductance from its value in the model [W/K].
        air : ndarray of shape (3,)
        """
        apart = self.difference @ after[-self.difference.shape[1] :] - self.to_air @ air
        passed = -np.linalg.solve(np.eye(len(extra)) + extra[:, None] * self.mutual, extra * apart)
        after += self.into @ passed
        return np.asarray(passed)
