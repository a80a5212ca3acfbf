"""From a full model to a small state space that answers alike.

The basis holds the answers of the full model to all inputs, and those of its transpose to all outputs, at real shifts
from seconds to a day and in several regimes: a rational Krylov space, of which the dominant directions are kept
(Grimme, Krylov projection methods for model reduction, thesis, Univ. of Illinois, 1997; Penzl, Algorithms for model
reduction of large dynamical systems, Linear Algebra Appl. 415 (2006) 322: dominant subspaces). K is symmetric, so a
projection with the same basis on both sides keeps it so, and passive; an error of the inputs' answers counts
only multiplied by an error of the outputs' ones.
"""

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermocomp.simulation.fem.assembly import FullModel
from thermocomp.simulation.fem.transient import factorised
from thermocomp.simulation.statespace import ReducedModel

FloatArray = NDArray[np.float64]

#: shifts: one over a time [1/s]
SHIFTS = tuple(1.0 / t for t in (10.0, 40.0, 150.0, 600.0, 2400.0, 9600.0, 38400.0, 400000.0))


def reduce(
    full: FullModel,
    size: int,
    regimes: Sequence[Mapping[str, float]] = ({},),
    shifts: Sequence[float] = SHIFTS,
) -> ReducedModel:
    """Return a model of at most `size` states.

    Parameters
    ----------
    full : FullModel
    size : int
        Number of states.
    regimes : sequence of mapping of str to float
        Shares in which the answers are taken.
    shifts : sequence of float
        [1/s]
    """
    return project(full, basis(full, size, regimes, shifts))


def basis(
    full: FullModel, size: int, regimes: Sequence[Mapping[str, float]], shifts: Sequence[float] = SHIFTS
) -> FloatArray:
    """Return V of shape (n, size): orthonormal in C, the first column constant."""
    snapshots = []
    # Each input and each output counts alike: by the answer of the slowest shift in the first regime.
    slow = factorised(full.stiffness(regimes[0]) + min(shifts) * full.capacity)
    scales = [_inverse_norms(full, slow(side)) for side in _sides(full, regimes[0])]
    for theta in regimes:
        stiffness = full.stiffness(theta)
        for shift in shifts:
            solve = factorised(stiffness + shift * full.capacity)
            snapshots += [solve(side) * scale for side, scale in zip(_sides(full, theta), scales, strict=True)]
    one = full.one / np.sqrt(full.one @ (full.capacity @ full.one))
    answers = np.column_stack(snapshots)
    answers -= np.outer(one, one @ (full.capacity @ answers))
    values, vectors = np.linalg.eigh(answers.T @ (full.capacity @ answers))
    strongest = np.argsort(values)[::-1][: size - 1]
    v = np.column_stack([one, answers @ vectors[:, strongest]])
    # Orthonormal but for rounding, which a second pass takes away.
    for _ in range(2):
        v = np.linalg.solve(np.linalg.cholesky(v.T @ (full.capacity @ v)), v.T).T
    return np.asarray(v)


def _sides(full: FullModel, theta: Mapping[str, float]) -> list[FloatArray]:
    """Return what goes in, and the transpose of what comes out."""
    return [
        np.column_stack([full.heat, full.air_heat(theta)]),
        np.array([*full.places.values(), *full.observables.values()]).T,
    ]


def _inverse_norms(full: FullModel, fields: FloatArray) -> FloatArray:
    # An input that moves nothing (layers of the air round a part that has no height) stays nothing.
    norms = np.sqrt(np.einsum("ij,ij->j", fields, full.capacity @ fields))
    return np.asarray(1.0 / np.where(norms > 0.0, norms, 1.0))


def _symmetric(matrix: FloatArray) -> FloatArray:
    return (matrix + matrix.T) / 2.0


def project(full: FullModel, v: FloatArray) -> ReducedModel:
    """Return the model in the basis V of shape (n, r), orthonormal in C."""
    return ReducedModel(
        conduction=_symmetric(v.T @ (full.conduction @ v)),
        conduction_theta=np.array([_symmetric(v.T @ (k @ v)) for k in full.conduction_theta.values()]).reshape(
            -1, v.shape[1], v.shape[1]
        ),
        heat=v.T @ full.heat,
        air=v.T @ full.air,
        air_theta=np.array([v.T @ a for a in full.air_theta.values()]).reshape(-1, v.shape[1], full.air.shape[1]),
        temperature=np.array(list(full.places.values())) @ v,
        observable=np.array(list(full.observables.values())) @ v,
        one=v.T @ (full.capacity @ full.one),
        theta=tuple(full.conduction_theta),
        inputs=full.inputs,
        places=tuple(full.places),
        observables=tuple(full.observables),
    )
