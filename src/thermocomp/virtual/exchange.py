"""Nonlinear heat exchange in a linear model: conductances that change, in addition to the constant ones.

The model keeps its constant conductances; what the real ones differ by is put in as heat on one side and taken from the
other. That heat depends on the temperatures at the end of the step, for which a small linear system is solved: however
well a joint conducts, the step stays stable, and what leaves one side arrives at the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.virtual.statespace import Operators, ReducedModel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Exchange:
    """Paths of heat during steps of one kind.

    Parameters
    ----------
    into : ndarray of shape (n_states + n_watched, n_paths)
        Effect of a watt along each path in a step.
    difference : ndarray of shape (n_paths, n_watched)
        First side minus second one; the air is no place.
    to_air : ndarray of shape (n_paths, 3)
        Air on the second side.
    mutual : ndarray of shape (n_paths, n_paths)
        Effect of a watt along each path on the difference at each.
    """

    into: FloatArray
    difference: FloatArray
    to_air: FloatArray
    mutual: FloatArray

    @classmethod
    def of(
        cls, model: ReducedModel, operators: Operators, watched: Sequence[str], paths: Sequence[tuple[str, str | None]]
    ) -> "Exchange":
        """Prepare paths.

        Parameters
        ----------
        model : ReducedModel
        operators : Operators
            Operators of the step.
        watched : sequence of str
            Places that `operators` give after the step.
        paths : sequence of (str, str or None)
            From a place that is watched, and an input of the same name, to another one, or to the room's air.
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
        """Add what passes in a step to the state after it; return it, from the second side to the first [W].

        Parameters
        ----------
        after : ndarray of shape (n_states + n_watched,)
            State after the step without it; is changed.
        extra : ndarray of shape (n_paths,)
            Difference of each conductance from that of the model [W/K].
        air : ndarray of shape (3,)
        """
        apart = self.difference @ after[-self.difference.shape[1] :] - self.to_air @ air
        passed = -np.linalg.solve(np.eye(len(extra)) + extra[:, None] * self.mutual, extra * apart)
        after += self.into @ passed
        return np.asarray(passed)
