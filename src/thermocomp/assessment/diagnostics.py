"""What the data can carry at all: collinearity of the inputs, effective sample size."""

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
    with np.errstate(divide="ignore"):
        condition = float(eigenvalues[0] / smallest) if smallest > 0 else float("inf")
        vif = (directions**2 / eigenvalues[:, None]).sum(axis=0)
    return Collinearity(kept, condition, tuple(float(v) for v in vif))


def effective_sample_size(residual: FloatArray) -> float:
    """Return how many independent rows a residual is worth (E-C12).

    n / (1 + 2 sum of autocorrelations), summed up to the first negative one (Geyer 1992).

    Parameters
    ----------
    residual : ndarray of shape (n_rows,)

    Returns
    -------
    float
        Between 1 and n_rows.
    """
    n = len(residual)
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n]
    if correlation[0] <= 0:
        return float(n)
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation < 0)
    stop = int(negative[0]) if negative.size else n
    return float(np.clip(n / (1.0 + 2.0 * correlation[1:stop].sum()), 1.0, n))
