"""What the data can carry at all: how far the inputs repeat each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Collinearity:
    """How far a set of inputs repeats itself.

    Parameters
    ----------
    names : tuple of str
    condition_number : float
        Largest over smallest eigenvalue of the correlation matrix (H-16).
    vif : tuple of float
        Variance inflation factor of each input; inf for one that the others determine.
    """

    names: tuple[str, ...]
    condition_number: float
    vif: tuple[float, ...]


def collinearity(values: FloatArray, names: tuple[str, ...]) -> Collinearity:
    """Return condition number and variance inflation factors.

    Parameters
    ----------
    values : ndarray of shape (n_rows, n_inputs)
        Finite values; constant columns are left out.
    names : tuple of str

    Returns
    -------
    Collinearity
    """
    spread = values.std(axis=0)
    varying = spread > 1e-12 * np.abs(values).max(axis=0, initial=1e-300)
    kept = tuple(n for n, v in zip(names, varying, strict=True) if v)
    if not kept:
        return Collinearity((), float("nan"), ())
    z = (values[:, varying] - values[:, varying].mean(axis=0)) / spread[varying]
    singular, directions = np.linalg.svd(z / np.sqrt(len(z)), full_matrices=False)[1:]
    eigenvalues = singular**2
    smallest = eigenvalues[-1] if len(eigenvalues) == len(kept) else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = float(eigenvalues[0] / smallest) if smallest > 0 else float("inf")
        vif = (directions**2 / eigenvalues[:, None]).sum(axis=0)
    return Collinearity(kept, condition, tuple(float(v) for v in np.nan_to_num(vif, nan=np.inf, posinf=np.inf)))
