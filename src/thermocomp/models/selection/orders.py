"""Orders k and m of an autoregressive model by FPE, AIC or BIC; all orders from one triangular factor."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import linalg

from thermocomp.core.arrays import FloatArray
from thermocomp.core.autoregressive import find_largest_root
from thermocomp.models.numerics.leastsquares import Triangle

_TINY = float(np.finfo(np.float64).tiny)

Criterion = Literal["fpe", "aic", "bic"]


@dataclass(frozen=True)
class Order:
    """One row of the table of orders.

    Parameters
    ----------
    k, m : int
        Number of past deviations, and of past values of each input in addition to the present one.
    n_parameters, n_rows : int
        d, including the intercept and excluding dependent inputs, and N.
    sse : float
        Sum of squared one-step errors; at least the effect of rounding.
    fpe, aic, bic : float
        See `final_prediction_error`; AIC = N ln(SSE/N) + 2 d, BIC = N ln(SSE/N) + d ln N.
    largest_root : float
        Largest modulus of the roots of the polynomial in dz; with 1 or more, the free run diverges. inf if the
        coefficients are undetermined because the columns are dependent.
    admissible : bool
        Whether the free run decays fast enough.
    """

    k: int
    m: int
    n_parameters: int
    n_rows: int
    sse: float
    fpe: float
    aic: float
    bic: float
    largest_root: float
    admissible: bool


def final_prediction_error(sse: float, n: int, d: int) -> float:
    """Return Akaike's FPE = (SSE/N) (N + d) / (N - d) (P-02)."""
    return sse / n * (n + d) / (n - d) if d < n else math.inf


def compute_orders(
    tri: Triangle, n_inputs: int, ks: Sequence[int], ms: Sequence[int], largest_root: float
) -> tuple[Order, ...]:
    """Compute all orders from the triangular factor of the greatest one, on the same rows, so that they are comparable.

    For each m, the small triangular factor is recomputed with the inputs first; its last column then gives the SSE of
    every k.
    """
    K, n = max(ks), tri.n_rows
    floor = float(tri.noise[-1] ** 2)
    found = []
    for m in ms:
        # dependent columns would remove directions of dz
        driven = tri.part(range(K, K + (m + 1) * n_inputs)).find_independent() + K
        small = tri.part([*driven, *range(K)])
        R = np.asarray(np.linalg.qr(small.factor, mode="r"))
        left = np.append(np.cumsum(R[::-1, -1] ** 2)[::-1], np.zeros(len(driven) + K + 1))
        for k in ks:
            own = slice(len(driven), len(driven) + k)
            d = own.stop + int(tri.intercept)
            sse = max(float(left[own.stop]), floor)
            log = n * math.log(max(sse, _TINY) / n)
            root = _largest_root(R[own, own], R[own, -1], small.noise[own])
            fpe = final_prediction_error(sse, n, d)
            able = d < n and root < largest_root
            found.append(
                Order(
                    k=k,
                    m=m,
                    n_parameters=d,
                    n_rows=n,
                    sse=sse,
                    fpe=fpe,
                    aic=log + 2 * d,
                    bic=log + d * math.log(n),
                    largest_root=root,
                    admissible=able,
                )
            )
    return tuple(sorted(found, key=lambda o: (o.k, o.m)))


def coefficients(tri: Triangle, columns: Sequence[int]) -> tuple[FloatArray, float]:
    """Solve for selected columns; dependent columns get the coefficient 0.

    Returns
    -------
    weights : ndarray of shape (n_columns,)
    """
    part = tri.part(columns)
    kept = part.find_independent()
    R = np.asarray(np.linalg.qr(part.factor[:, [*kept, -1]], mode="r"))
    weights = np.zeros(len(columns))
    weights[kept] = linalg.solve_triangular(R[: len(kept), : len(kept)], R[: len(kept), -1]) if len(kept) else 0.0
    return weights, float(part.centre[-1] - part.centre[:-1] @ weights)


def _largest_root(R: FloatArray, head: FloatArray, noise: FloatArray) -> float:
    if len(head) == 0:
        return 0.0
    if R.shape[0] != R.shape[1] or (np.abs(np.diag(R)) <= noise).any():
        return math.inf
    return find_largest_root(linalg.solve_triangular(R, head))


def best(orders: Sequence[Order], criterion: Criterion) -> Order | None:
    """Return the admissible order with the smallest criterion; of equal ones, that with fewer parameters."""
    able = [o for o in orders if o.admissible]
    return min(able, key=lambda o: (getattr(o, criterion), o.n_parameters), default=None)
