"""Diagnostics of the data: collinearity of the inputs, and their correlation with the error."""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.models.selection.collinearity import Spectrum, contributions, spectrum


@dataclass(frozen=True)
class Collinearity:
    """Collinearity of a set of inputs.

    Parameters
    ----------
    condition_number : float
        Largest over smallest eigenvalue of the correlation matrix; for X'X itself see `Diagnosis.spectrum`.
    vif : tuple of float
        Variance inflation factor of each input; inf if determined by the other inputs.
    """

    names: tuple[str, ...]
    condition_number: float
    vif: tuple[float, ...]


def collinearity(values: FloatArray, names: tuple[str, ...]) -> Collinearity:
    """Return the condition number and the variance inflation factors.

    Parameters
    ----------
    values : ndarray of shape (n_rows, n_inputs)
        Finite values; constant columns are left out.
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


@dataclass(frozen=True)
class Diagnosis:
    """Hwang's collinearity analysis of the variables of a linear model (section 3.2.3), to be printed with it (E-H10).

    Parameters
    ----------
    spectrum : Spectrum
        Eigenvalues of X'X without the column of ones, as in Table 3, with the smallest one, the sum of their inverses
        and the condition number (H-14 to H-16, E-H6).
    vif : tuple of float
        Variance inflation factor of each variable; nan for a constant one.
    contributions : tuple of float
        Correlation of each variable with the error (Eq. 9; H-17); nan for a constant one.
    """

    names: tuple[str, ...]
    spectrum: Spectrum
    vif: tuple[float, ...]
    contributions: tuple[float, ...]


def diagnose(values: FloatArray, deviation: FloatArray, names: tuple[str, ...]) -> Diagnosis:
    """Analyse the collinearity of the variables of a linear model.

    Parameters
    ----------
    values : ndarray of shape (n_rows, n_variables)
        Temperatures minus their reference, as used in the model; finite [degC].
    deviation : ndarray of shape (n_rows,)
    """
    found = collinearity(values, names)
    vif = dict(zip(found.names, found.vif, strict=True))
    return Diagnosis(
        names=names,
        spectrum=spectrum(values),
        vif=tuple(vif.get(n, float("nan")) for n in names),
        contributions=tuple(contributions(values, deviation).tolist()),
    )
