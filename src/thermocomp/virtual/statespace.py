"""A machine reduced to a small state-space model in plain numbers, with microseconds of computing time per step."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]

#: temperature of the reference state without deviations (ISO 1) [degC]
REFERENCE_TEMPERATURE = 20.0


@dataclass(frozen=True, eq=False)
class Operators:
    """Operators of one step with constant conductances and heat: ``[z, w]+ = state z + heat u + air a``.

    Parameters
    ----------
    state : ndarray of shape (n_states + n_watched, n_states)
    heat : ndarray of shape (n_states + n_watched, n_inputs)
        [1/W]
    air : ndarray of shape (n_states + n_watched, 3)
    """

    state: FloatArray
    heat: FloatArray
    air: FloatArray


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """``dz/dt = -(K + sum_j theta_j K_j) z + B u + (A + sum_j theta_j A_j) a``, all K symmetric.

    Created by ``tools/finite_elements`` of the repository; scaled to a unit mass matrix.

    Parameters
    ----------
    conduction : ndarray of shape (n_states, n_states)
        K [1/s].
    conduction_theta : ndarray of shape (n_theta, n_states, n_states)
        K_j [1/s].
    heat : ndarray of shape (n_states, n_inputs)
        B, for heat u [W].
    air : ndarray of shape (n_states, 3)
        A, for `thermocomp.virtual.machine.Air.values` a.
    air_theta : ndarray of shape (n_theta, n_states, 3)
        A_j
    temperature : ndarray of shape (n_places, n_states)
        Temperatures [degC] are ``temperature @ z``.
    observable : ndarray of shape (n_observables, n_states)
        Displacements [um] and angles [urad] are ``observable @ (z - 20 one)``.
    one : ndarray of shape (n_states,)
        State of a machine at 1 degC everywhere.
    theta, inputs, places, observables : tuple of str
        Names.
    squares : ndarray of shape (n_squared, n_states, n_states), optional
        ``d @ square @ d`` with ``d = z - 20 one`` is the response of an observable to the squared temperatures [um K],
        for materials whose expansion coefficient increases with temperature.
    squared : tuple of str, optional
        Names of the observables of `squares`.
    """

    conduction: FloatArray
    conduction_theta: FloatArray
    heat: FloatArray
    air: FloatArray
    air_theta: FloatArray
    temperature: FloatArray
    observable: FloatArray
    one: FloatArray
    theta: tuple[str, ...]
    inputs: tuple[str, ...]
    places: tuple[str, ...]
    observables: tuple[str, ...]
    squares: FloatArray | None = None
    squared: tuple[str, ...] | None = None
    _kept: dict[tuple[tuple[float, ...], float, tuple[str, ...]], Operators] = field(
        default_factory=dict, init=False, repr=False
    )

    #: number of operators kept; a programme has a few speeds, a live source may have any
    _KEEP = 128

    @classmethod
    def load(cls, name: str) -> "ReducedModel":
        """Load a model included in the package: ``centre``, ``centre_joints`` or ``tool_joints``."""
        with as_file(files("thermocomp.virtual") / "reduced" / f"{name}.npz") as path:
            return cls.read(path)

    @classmethod
    def read(cls, path: Path) -> "ReducedModel":
        """Read a file of plain arrays; its keys are the names of the parameters."""
        names = ("theta", "inputs", "places", "observables", "squared")
        with np.load(path, allow_pickle=False) as data:
            texts = {k: tuple(str(n) for n in data[k]) for k in names if k in data.files}
            # mixed value types in one dict; the dataclass defines the type of each
            values: dict[str, Any] = {k: data[k] for k in data.files if k not in names} | texts
        return cls(**values)

    def rows(self, places: Sequence[str]) -> FloatArray:
        """Return the rows of `temperature` for some places."""
        for place in places:
            if place not in self.places:
                raise InputError(f"virtual machine: there is no place {place!r} among {', '.join(self.places)}")
        return self.temperature[[self.places.index(p) for p in places]]

    def stiffness(self, theta: Sequence[float]) -> FloatArray:
        """Return ``K + sum_j theta_j K_j`` [1/s], of shape (n_states, n_states)."""
        return self.conduction + np.tensordot(np.asarray(theta, dtype=np.float64), self.conduction_theta, 1)

    def to_air(self, theta: Sequence[float]) -> FloatArray:
        """Return ``A + sum_j theta_j A_j``, of shape (n_states, 3)."""
        return self.air + np.tensordot(np.asarray(theta, dtype=np.float64), self.air_theta, 1)

    def steady(self, heat: FloatArray, air: FloatArray, theta: Sequence[float]) -> FloatArray:
        """Return the steady state for constant heat [W] and air."""
        loads = self.heat @ heat + self.to_air(theta) @ air
        return np.asarray(np.linalg.solve(self.stiffness(theta), loads), dtype=np.float64)

    def time_constants(self, theta: Sequence[float]) -> FloatArray:
        """Return the time constants of the modes [s], longest first."""
        return np.asarray(1.0 / np.linalg.eigvalsh(self.stiffness(theta)), dtype=np.float64)

    def operators(self, theta: tuple[float, ...], dt: float, watched: tuple[str, ...] = ()) -> Operators:
        """Return the operators of a step of `dt` [s], exact for constant heat, air and `theta`.

        Parameters
        ----------
        dt : float
            [s]
        """
        key = (theta, dt, watched)
        found = self._kept.get(key)
        if found is None:
            found = self._exponential(theta, dt, watched)
            if len(self._kept) >= self._KEEP:
                self._kept.clear()  # cleared in one operation: another thread may read it
            self._kept[key] = found
        return found

    def _exponential(self, theta: tuple[float, ...], dt: float, watched: tuple[str, ...]) -> Operators:
        rates, modes = np.linalg.eigh(self.stiffness(theta))
        decay = (modes * np.exp(-rates * dt)) @ modes.T
        # A machine without air has a zero rate (within rounding): there the integral equals the step.
        slow = np.abs(rates * dt) < 1e-12
        integral = (modes * np.where(slow, dt, -np.expm1(-rates * dt) / np.where(slow, 1.0, rates))) @ modes.T
        watch = np.vstack([np.eye(len(rates)), self.rows(watched)])
        return Operators(watch @ decay, watch @ integral @ self.heat, watch @ integral @ self.to_air(theta))
