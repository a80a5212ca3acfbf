"""Temperatures over time of the full model: C dT/dt = -K T + heat(t), with an account of the energy.

Alexander's two-stage singly diagonally implicit Runge-Kutta method (SIAM J. Numer. Anal. 14 (1977) 1006): of second
order, L-stable, so that the fast decays of small elements do not ring, and with one matrix for both stages.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

FloatArray = NDArray[np.float64]
#: heat put in [W], of shape (n,): constant over a step, or a function of time [s]
Heat = FloatArray | Callable[[float], FloatArray]

#: Alexander's gamma: the stages stand at this share of the step, and at its end
GAMMA = 1.0 - np.sqrt(0.5)
#: weights of the two stages in whatever is integrated over the step
WEIGHTS = (1.0 - GAMMA, GAMMA)


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the method.

    Parameters
    ----------
    temperatures : ndarray of shape (n,)
        At its end [degC].
    mean : ndarray of shape (n,)
        Temperatures that the method has counted with on average, such that
        ``C (end - start) = dt (heat - K mean)`` holds to rounding: any flow of heat times `dt` taken at `mean` is
        the energy that the method has moved.
    heat : ndarray of shape (n,)
        Put in on average [W].
    """

    temperatures: FloatArray
    mean: FloatArray
    heat: FloatArray


class Stepper:
    """Steps of one length under one conduction: the matrix is factorised once.

    Parameters
    ----------
    capacity : csr_matrix of shape (n, n)
        C [J/K], symmetric, positive definite.
    conduction : csr_matrix of shape (n, n)
        K [W/K] with films to the air, symmetric, positive semi-definite.
    dt : float
        [s]
    """

    def __init__(self, capacity: csr_matrix, conduction: csr_matrix, dt: float) -> None:
        self.dt = dt
        self._capacity = capacity
        self._conduction = conduction
        self._solve = factorised(capacity + GAMMA * dt * conduction)

    def advance(self, temperatures: FloatArray, heat: Heat, time: float = 0.0) -> Step:
        """Advance by one step.

        Parameters
        ----------
        temperatures : ndarray of shape (n,)
            At the start [degC].
        heat : Heat
            Put in, with what the air brings [W].
        time : float
            At the start [s].
        """
        first, last = (heat(time + c * self.dt) if callable(heat) else heat for c in (GAMMA, 1.0))
        stored = self._capacity @ temperatures
        early = self._solve(stored + GAMMA * self.dt * first)
        flow = first - self._conduction @ early
        end = self._solve(stored + self.dt * (WEIGHTS[0] * flow + WEIGHTS[1] * last))
        return Step(end, WEIGHTS[0] * early + WEIGHTS[1] * end, WEIGHTS[0] * first + WEIGHTS[1] * last)

    def march(self, temperatures: FloatArray, heat: Heat, steps: int, time: float = 0.0) -> list[Step]:
        """Return a number of steps, one after the other.

        Parameters
        ----------
        temperatures : ndarray of shape (n,)
            At the start [degC].
        heat : Heat
            Put in, with what the air brings [W].
        time : float
            At the start [s].
        """
        done: list[Step] = []
        for k in range(steps):
            done.append(self.advance(temperatures, heat, time + k * self.dt))
            temperatures = done[-1].temperatures
        return done


def factorised(matrix: csr_matrix) -> Callable[[FloatArray], FloatArray]:
    """Return the solver of a symmetric, positive definite system."""
    # No pivoting for stability is needed, so the order is chosen for few fill-ins alone.
    options: dict[str, Any] = {"SymmetricMode": True}
    solve: Callable[[FloatArray], FloatArray] = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
    ).solve
    return solve
