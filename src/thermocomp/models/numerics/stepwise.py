"""Stepwise regression on a triangular factor, with fixed thresholds on partial F or significance levels.

The data are factorised once (`thermocomp.models.numerics.leastsquares.triangle`); every step then works on the small
triangular factor. Columns enter by a Householder reflection and leave by Givens rotations, so all candidates remain
orthogonal to the model by construction after any number of steps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import blas, lapack
from scipy.special import fdtrc, stdtrit

from thermocomp.core.exceptions import InputError
from thermocomp.models.numerics.leastsquares import Triangle

#: smallest share of a candidate's norm that the model must leave unexplained for the candidate to enter
TOLERANCE = 1e-8
_TINY = float(np.finfo(np.float64).tiny)
_SAME = 1e-10  # gains closer than this count as equal, and the first candidate is chosen regardless of rounding


@dataclass(frozen=True)
class FThresholds:
    """Fixed thresholds on partial F (stepwise2017, section 3.2; T-03).

    Their effect depends on the number of rows: a first variable needs R2 >= F / (F + n - 2), so F = 100 requires .90 at
    n = 13 but .11 at n = 810 (E-T3).

    Parameters
    ----------
    enter : float
        F_E, threshold to enter.
    delete : float
        F_D, threshold to stay; at most `enter`, otherwise a term could enter and leave endlessly (E-T4).

    Raises
    ------
    InputError
        ``enter >= delete >= 0`` does not hold.
    """

    enter: float = 100.0
    delete: float = 50.0

    def __post_init__(self) -> None:
        if not self.enter >= self.delete >= 0:
            raise InputError(
                f"F-to-enter {self.enter} and F-to-delete {self.delete}: expected enter >= delete >= 0, otherwise a "
                "term could enter and leave endlessly"
            )

    def enter_f(self, df: int) -> float:  # noqa: ARG002
        """Return F_E, the threshold on partial F to enter."""
        return self.enter

    def delete_f(self, df: int) -> float:  # noqa: ARG002
        """Return F_D, the threshold on partial F to stay."""
        return self.delete

    def __str__(self) -> str:
        return f"F-TO-ENTER= {self.enter:g} AND F-TO-DELETE= {self.delete:g}"


@dataclass(frozen=True)
class AlphaThresholds:
    """Significance levels, converted to thresholds on F at every step (Chen 1996, Fig. 2; C-15).

    p-values are never compared: they underflow to zero on long recordings, and all candidates would be equal.

    Parameters
    ----------
    enter : float
        Alpha-to-enter.
    remove : float
        Alpha-to-remove; at least `enter`.

    Raises
    ------
    InputError
        ``0 < enter <= remove <= 1`` does not hold.
    """

    enter: float = 0.001
    remove: float = 0.015

    def __post_init__(self) -> None:
        if not 0 < self.enter <= self.remove <= 1:
            raise InputError(
                f"alpha-to-enter {self.enter} and alpha-to-remove {self.remove}: expected 0 < enter <= remove <= 1, "
                "otherwise a term could enter and leave endlessly"
            )

    def enter_f(self, df: int) -> float:
        """Return the F whose tail probability is alpha-to-enter, with 1 and `df` degrees of freedom."""
        return f_of_alpha(self.enter, df)

    def delete_f(self, df: int) -> float:
        """Return the F whose tail probability is alpha-to-remove, with 1 and `df` degrees of freedom."""
        return f_of_alpha(self.remove, df)

    def __str__(self) -> str:
        return f"ALPHA-TO-ENTER= {_bare(self.enter)} AND ALPHA-TO-REMOVE= {_bare(self.remove)}"


Rule = FThresholds | AlphaThresholds


def f_of_alpha(alpha: float, df: int) -> float:
    """Return the F with 1 and `df` degrees of freedom whose tail probability is `alpha`: the square of Student's t."""
    return float(stdtrit(df, alpha / 2) ** 2)


def alpha_of_f(f: float, df: int) -> float:
    """Return the tail probability of F with 1 and `df` degrees of freedom; it underflows to 0 for large `f`."""
    return float(fdtrc(1, df, f))


def r_squared_of_f(f: float, df: int) -> float:
    """Return the R2 of a first variable with partial F `f` that leaves `df` degrees of freedom (E-T3)."""
    return f / (f + df)


def _bare(value: float) -> str:
    return f"{value:g}".removeprefix("0")


@dataclass(frozen=True)
class StepwiseStep:
    """One step of the selection, as logged.

    Parameters
    ----------
    number : int
        Number of the step (1-based).
    index : int
        Index of the term among the candidates.
    term : str
        Name of the term.
    f : float
        Partial F of the term, in the model that contains it (T-02; the symbols of Eq. 1: E-T1).
    df : int
        Residual degrees of freedom of that model.
    alpha : float
        Significance that corresponds to `f` if the rows were independent; the rows of a time series are not (E-C12).
    r_squared : float
        R2 of the model after the step; uncentred if it has no intercept (E-C10).
    r_squared_step : float
        Change of `r_squared` (E-T3).
    """

    number: int
    action: Literal["enter", "remove"]
    index: int
    term: str
    f: float
    df: int
    alpha: float
    r_squared: float
    r_squared_step: float

    @property
    def r(self) -> float:
        """Multiple correlation R of the model after the step."""
        return math.sqrt(max(self.r_squared, 0.0))


@dataclass(frozen=True)
class StepwiseSelection:
    """Result of stepwise regression.

    Parameters
    ----------
    selected : tuple of int
        Terms in the model, in ascending order.
    cycled : bool
        True if the selection stopped because a model occurred for the second time.
    """

    selected: tuple[int, ...]
    steps: tuple[StepwiseStep, ...]
    cycled: bool


def stepwise(
    triangle: Triangle,
    rule: Rule,
    names: Sequence[str],
    *,
    needs: Sequence[frozenset[int]] | None = None,
    tolerance: float = TOLERANCE,
) -> StepwiseSelection:
    """Select terms by partial F.

    Each step is one action. If the worst term in the model has an F below the threshold, it is deleted; otherwise the
    candidate with the greatest F enters if it reaches the threshold; otherwise the selection ends (T-04 to T-06). After
    each entry, the terms in the model are thus tested again until all stay.

    Candidates that are constant, or whose remainder outside the span of the model is below `tolerance` times their
    norm, do not enter. No candidate enters once the residual is reduced to rounding or no degree of freedom would
    remain, so there may be more candidates than rows.

    Parameters
    ----------
    needs : sequence of frozenset of int, optional
        For each candidate, the candidates that must be in the model before it enters and as long as it stays (C-21).
    """
    work = _Tableau(triangle, tolerance)
    steps: list[StepwiseStep] = []
    seen = {frozenset[int]()}
    cycled = False
    while not cycled:
        before, df = work.sse, work.df
        held = {j for k in work.active for j in needs[k]} if needs else None
        found = work.worst(held)
        action: Literal["enter", "remove"] = "remove"
        if found is not None and found[1] < rule.delete_f(df):
            work.remove(found[0])
        else:
            action, df = "enter", df - 1
            barred = [j for j, needed in enumerate(needs) if not needed.issubset(work.active)] if needs else None
            found = work.best(barred) if df > 0 else None
            if found is None or not found[1] >= rule.enter_f(df):
                break
            work.enter(found[0])
        index, f = found
        alpha = alpha_of_f(f, df)
        steps.append(
            StepwiseStep(
                number=len(steps) + 1,
                action=action,
                index=index,
                term=names[index],
                f=f,
                df=df,
                alpha=alpha,
                r_squared=1 - work.sse,
                r_squared_step=before - work.sse,
            )
        )
        inside = frozenset(work.active)
        cycled = inside in seen
        seen.add(inside)
    return StepwiseSelection(tuple(sorted(work.active)), tuple(steps), cycled)


class _Tableau:
    """Triangular factor, rotated so that the columns of the model are triangular in their order of entry.

    With k terms in the model, rows k and below contain the part of every other column (y last) that the model leaves
    unexplained. All columns are scaled to norm 1.
    """

    def __init__(self, triangle: Triangle, tolerance: float) -> None:
        norms, noise = triangle.norms, triangle.noise
        alive = norms > noise
        scale = np.where(alive, norms, 1.0)
        self._rows = np.ascontiguousarray(triangle.factor / scale)
        # required square of a column's remainder; infinite for columns that cannot enter
        self._least = np.where(alive, np.maximum(tolerance, noise / scale) ** 2, np.inf)
        self._least[-1] = (noise[-1] / scale[-1]) ** 2 if alive[-1] else np.inf
        self._now = self._least[:-1].copy()
        self._free = triangle.n_rows - int(triangle.intercept)
        self.active: list[int] = []
        self.sse = float(self._rows[:, -1] @ self._rows[:, -1])

    @property
    def df(self) -> int:
        """Residual degrees of freedom of the model."""
        return self._free - len(self.active)

    def best(self, barred: Sequence[int] | None) -> tuple[int, float] | None:
        """Return the candidate with the greatest F, and its F value; `None` if no candidate may enter."""
        if not self.sse > self._least[-1]:
            return None
        rest = self._rows[len(self.active) :]
        left = np.einsum("ij,ij->j", rest, rest)[:-1]
        gain = (rest[:, -1] @ rest[:, :-1]) ** 2
        gain /= np.maximum(left, _TINY)
        gain[left <= self._now] = -np.inf
        if barred:
            gain[barred] = -np.inf
        most = gain.max(initial=-np.inf)
        if not np.isfinite(most):
            return None
        # F increases with the gain, so the greatest gain has the greatest F
        index = int(np.argmax(np.minimum(gain, most * (1 - _SAME))))
        return index, _ratio(float(gain[index]), max(self.sse - float(gain[index]), 0.0), self.df - 1)

    def worst(self, held: set[int] | None) -> tuple[int, float] | None:
        """Return the term of the model with the smallest F, and its F value; `None` if no term may leave."""
        k = len(self.active)
        if k == 0:
            return None
        inverse = lapack.dtrtri(self._rows[:k, self.active])[0]
        losses = (inverse @ self._rows[:k, -1]) ** 2 / np.einsum("ij,ij->i", inverse, inverse)
        if held:
            losses[[j in held for j in self.active]] = np.inf
        place = int(losses.argmin())
        loss = float(losses[place])
        return None if np.isinf(loss) else (self.active[place], _ratio(loss, self.sse, self.df))

    def enter(self, index: int) -> None:
        """Add a column to the model by a Householder reflection of the rows below the model."""
        rest = self._rows[len(self.active) :]
        v = rest[:, index].copy()
        length = math.copysign(math.sqrt(v @ v), v[0])
        v[0] += length
        # rest -= 2 v (v' rest) / (v' v), in place
        blas.dger(-2.0 / float(v @ v), v @ rest, v, a=rest.T, overwrite_a=1)
        rest[0, index] = -length
        rest[1:, index] = 0.0
        self._changed([*self.active, index])

    def remove(self, index: int) -> None:
        """Remove a column from the model; Givens rotations restore the triangular form of the others."""
        place = self.active.index(index)
        active = [j for j in self.active if j != index]
        for row, column in enumerate(active[place:], start=place):
            a, b = self._rows[row : row + 2, column]
            rotation = np.array([[a, b], [-b, a]]) / math.hypot(a, b)
            self._rows[row : row + 2] = rotation @ self._rows[row : row + 2]
            self._rows[row + 1, column] = 0.0
        self._changed(active)

    def _changed(self, active: list[int]) -> None:
        self.active = active
        self._now[:] = self._least[:-1]
        self._now[active] = np.inf
        y = self._rows[len(active) :, -1]
        self.sse = float(y @ y)


def _ratio(squares: float, sse: float, df: int) -> float:
    return squares * df / sse if sse > 0 else np.inf
