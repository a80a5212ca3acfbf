"""From a full model to a small state space that answers alike.

The basis holds the answers of the full model to its inputs, and those of its transpose to its outputs, at real shifts
from seconds to days and in several regimes: a rational Krylov space, of which the dominant directions are kept
(Grimme, Krylov projection methods for model reduction, thesis, University of Illinois, 1997; Penzl, Algorithms for
model reduction of large dynamical systems, Linear Algebra Appl. 415 (2006) 322: dominant subspaces). K is symmetric: a
projection with one basis on both sides keeps it so, and cannot make heat; what is missed of an answer to an input
counts only as far as it is missed of an answer to an output as well.
"""

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from finite_elements.assembly import FullModel
from finite_elements.transient import factorised
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.statespace import ReducedModel

FloatArray = NDArray[np.float64]

#: shifts: one over a time [1/s]
SHIFTS = tuple(1.0 / t for t in (5.0, 20.0, 60.0, 200.0, 600.0, 2000.0, 6000.0, 20000.0, 60000.0, 300000.0))
#: how far the air usually changes: temperature [K], rise with height, rise to the right [K/m]
AIR_CHANGE = (2.0, 0.5, 0.5)
#: fields are compared by the heat they would drive and by what they store over this time [s]
_MEMORY = 600.0


def basis(
    full: FullModel,
    size: int,
    mixes: Sequence[Mapping[str, float]],
    regimes: Sequence[Mapping[str, float]] = ({},),
    shifts: Sequence[float] = SHIFTS,
) -> FloatArray:
    """Return the basis V of shape (n, size): orthonormal in C, and it contains the constant field.

    Parameters
    ----------
    mixes : sequence of mapping of str to float
        Heat that usually comes together, by input [W]. Each mix counts as an input, and each input counts alone, with
        its largest heat in any mix.
    shifts : sequence of float
        [1/s]
    """
    together = _mixed(full, mixes)
    outputs = np.array([*full.places.values(), *full.observables.values()]).T
    energy = full.stiffness(regimes[-1]) + full.capacity / _MEMORY
    forward, backward = [], []
    scale: FloatArray | None = None
    for theta in regimes:
        solvers = [factorised(full.stiffness(theta) + s * full.capacity) for s in shifts]
        loads = np.column_stack([full.heat @ together, full.air_heat(theta) * AIR_CHANGE])
        answers = [solve(loads) for solve in solvers]
        if scale is None:
            # Each output counts by how far it usually moves.
            moved = np.max([np.sqrt(((outputs.T @ a) ** 2).sum(axis=1)) for a in answers], axis=0)
            scale = 1.0 / np.where(moved > 0.0, moved, np.inf)
        forward.append(_dominant(np.column_stack(answers), energy))
        backward.append(_dominant(np.column_stack([solve(outputs * scale) for solve in solvers]), energy))
    sides = [_dominant(np.column_stack(s), energy) for s in (forward, backward)]
    sides = [s / np.sqrt(np.einsum("ij,ij->", s, energy @ s)) for s in sides]
    kept = _dominant(np.column_stack(sides), energy, size - 1)
    v = np.column_stack([full.one, kept])
    # Twice: the first pass leaves rounding.
    for _ in range(2):
        v = np.linalg.solve(np.linalg.cholesky(v.T @ (full.capacity @ v)), v.T).T
    return np.asarray(v)


def project(full: FullModel, v: FloatArray, squared: Sequence[str] = ()) -> ReducedModel:
    """Return the model in the basis V of shape (n, r), orthonormal in C; some observables squared, too."""
    r = v.shape[1]
    squares = np.array([_symmetric((v.T * full.observables[name]) @ v) for name in squared])
    return ReducedModel(
        conduction=_symmetric(v.T @ (full.conduction @ v)),
        conduction_theta=np.array([_symmetric(v.T @ (k @ v)) for k in full.conduction_theta.values()]).reshape(
            -1, r, r
        ),
        heat=v.T @ full.heat,
        air=v.T @ full.air,
        air_theta=np.array([v.T @ a for a in full.air_theta.values()]).reshape(-1, r, full.air.shape[1]),
        temperature=np.array(list(full.places.values())) @ v,
        observable=np.array(list(full.observables.values())) @ v,
        one=v.T @ (full.capacity @ full.one),
        theta=tuple(full.conduction_theta),
        inputs=full.inputs,
        places=tuple(full.places),
        observables=tuple(full.observables),
        squares=squares if squared else None,
        squared=tuple(squared) or None,
    )


def write(model: ReducedModel, path: Path) -> None:
    """Write a model as plain arrays; equal numbers make equal files."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name in (f.name for f in fields(model) if f.init and getattr(model, f.name) is not None):
            # A fixed date: else every file would differ.
            with archive.open(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), "w") as file:
                value = np.ascontiguousarray(getattr(model, name))
                np.lib.format.write_array(file, value, version=(1, 0), allow_pickle=False)


def _mixed(full: FullModel, mixes: Sequence[Mapping[str, float]]) -> FloatArray:
    """Return every input alone, and every mix, as columns of heat [W]."""
    columns = np.zeros((len(full.inputs), len(mixes)))
    for k, mix in enumerate(mixes):
        for name, heat in mix.items():
            if name not in full.inputs:
                raise InputError(f"heat {name!r} of a mix is not an input; there are {', '.join(full.inputs)}")
            columns[full.inputs.index(name), k] = heat
    largest = np.abs(columns).max(axis=1)
    if not largest.all():
        raise InputError(f"no mix has the input {full.inputs[int(largest.argmin())]!r}: how much heat is usual there?")
    # A mix of one input is that input.
    several = (columns != 0.0).sum(axis=0) > 1
    return np.column_stack([np.diag(largest), columns[:, several]])


def _dominant(fields_: FloatArray, metric: csr_matrix, count: int | None = None) -> FloatArray:
    """Return the directions that hold most of some fields, as long as what they hold; all that matter if no count."""
    values, vectors = np.linalg.eigh(fields_.T @ (metric @ fields_))
    kept = values > 1e-10 * values[-1]
    if count is not None:
        kept &= values >= np.sort(values)[-count]
    return np.asarray(fields_ @ vectors[:, kept])


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray((matrix + matrix.T) / 2.0)
