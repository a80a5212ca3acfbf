"""Stepwise regression: one engine on a triangular factor, two rules.

The data are factorised once (`thermocomp.models.numerics.leastsquares.triangle`); after that every step works on the
small triangle. Columns enter by a Householder reflection and leave by Givens rotations, so all candidates are always
orthogonal to the model by construction, however many steps are taken.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack
from scipy.special import fdtrc, stdtrit

from thermocomp.core.exceptions import InputError
from thermocomp.models.numerics.leastsquares import Triangle

FloatArray = NDArray[np.float64]

#: least share of a candidate's own norm that the model must leave of it, else it does not enter
TOLERANCE = 1e-8
_TINY = float(np.finfo(np.float64).tiny)
_SAME = 1e-10  # gains closer than this are equal, and the first candidate is taken whatever the rounding


class Rule(Protocol):
    """When a term enters and when it leaves, as partial F."""

    def enter_f(self, df: int) -> float:
        """Return the least F that lets a term enter, `df` being the degrees of freedom left with it."""
        ...

    def delete_f(self, df: int) -> float:
        """Return the F below which a term is deleted, `df` being the degrees of freedom left with it."""
        ...

    def __str__(self) -> str: ...


@dataclass(frozen=True)
class FThresholds:
    """Fixed thresholds on partial F (stepwise2017, section 3.2; T-03).

    What they ask for depends on the number of rows: a first variable needs R2 >= F / (F + n - 2), so F = 100 means
    .90 at n = 13 but .11 at n = 810 (E-T3).

    Parameters
    ----------
    enter : float
        F_E, to enter.
    delete : float
        F_D, to stay; not above `enter`, else a term could enter and leave for ever (E-T4).

    Raises
    ------
    InputError
        Unless ``enter >= delete >= 0``.
    """

    enter: float = 100.0
    delete: float = 50.0

    def __post_init__(self) -> None:
        if not self.enter >= self.delete >= 0:
            raise InputError(
                f"F-to-enter {self.enter} and F-to-delete {self.delete}: expected enter >= delete >= 0, "
                "else a term could enter and leave for ever"
            )

    def enter_f(self, df: int) -> float:  # noqa: ARG002
        """Return F_E."""
        return self.enter

    def delete_f(self, df: int) -> float:  # noqa: ARG002
        """Return F_D."""
        return self.delete

    def __str__(self) -> str:
        return f"F-TO-ENTER= {self.enter:g} AND F-TO-DELETE= {self.delete:g}"


@dataclass(frozen=True)
class AlphaThresholds:
    """Significance levels, turned into thresholds on F at every step (Chen 1996, Fig. 2; C-15).

    Never compared as p-values: those underflow to zero on long recordings, and every candidate would be equal.

    Parameters
    ----------
    enter : float
        Alpha-to-enter.
    remove : float
        Alpha-to-remove; not below `enter`.

    Raises
    ------
    InputError
        Unless ``0 < enter <= remove <= 1``.
    """

    enter: float = 0.001
    remove: float = 0.015

    def __post_init__(self) -> None:
        if not 0 < self.enter <= self.remove <= 1:
            raise InputError(
                f"alpha-to-enter {self.enter} and alpha-to-remove {self.remove}: expected 0 < enter <= remove <= 1, "
                "else a term could enter and leave for ever"
            )

    def enter_f(self, df: int) -> float:
        """Return the F whose tail is alpha-to-enter, with 1 and `df` degrees of freedom."""
        return f_of_alpha(self.enter, df)

    def delete_f(self, df: int) -> float:
        """Return the F whose tail is alpha-to-remove, with 1 and `df` degrees of freedom."""
        return f_of_alpha(self.remove, df)

    def __str__(self) -> str:
        return f"ALPHA-TO-ENTER= {_bare(self.enter)} AND ALPHA-TO-REMOVE= {_bare(self.remove)}"


def f_of_alpha(alpha: float, df: int) -> float:
    """Return the F with 1 and `df` degrees of freedom whose tail is `alpha`: the square of Student's t."""
    return float(stdtrit(df, alpha / 2) ** 2)


def alpha_of_f(f: float, df: int) -> float:
    """Return the tail of F with 1 and `df` degrees of freedom; it underflows to 0 for large `f`."""
    return float(fdtrc(1, df, f))


def r_squared_of_f(f: float, df: int) -> float:
    """Return the R2 of a first variable with partial F `f` that leaves `df` degrees of freedom (E-T3)."""
    return f / (f + df)


def _bare(value: float) -> str:
    return f"{value:g}".removeprefix("0")


@dataclass(frozen=True)
class StepwiseStep:
    """One line of the log.

    Parameters
    ----------
    number : int
        From 1.
    action : {'enter', 'remove'}
    index : int
        Index of the term among the candidates.
    term : str
        Its name.
    f : float
        Partial F of the term, in the model that contains it (T-02).
    df : int
        Degrees of freedom left in that model.
    alpha : float
        Significance that corresponds to `f` if the rows were independent, which those of a time series are not (E-C12).
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
        """Multiple correlation after the step."""
        return math.sqrt(max(self.r_squared, 0.0))


@dataclass(frozen=True)
class StepwiseSelection:
    """Result of stepwise regression.

    Parameters
    ----------
    selected : tuple of int
        Terms in the model, in rising order.
    steps : tuple of StepwiseStep
    cycled : bool
        True if it was stopped because a model came up a second time.
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

    One action a step. If the worst term inside has an F below the threshold, it is deleted; else the candidate with
    the greatest F enters, if that reaches the threshold; else it is over (T-04 to T-06). After each entering, the
    terms inside are thus tested again until all hold.

    Candidates that are constant, or of which the model leaves less than `tolerance` of their norm, do not enter.
    Nothing enters any more once the residual is down to rounding or no degree of freedom would be left, so there may
    be more candidates than rows.

    Parameters
    ----------
    triangle : Triangle
        Triangle of the candidates and y.
    rule : Rule
    names : sequence of str
        Names of the candidates.
    needs : sequence of frozenset of int, optional
        Per candidate, the candidates that must be in the model for it to enter, and must stay while it is in (C-21).
    tolerance : float

    Returns
    -------
    StepwiseSelection
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
    """The triangle, rotated such that the columns of the model are triangular in their order of entering.

    With k terms in the model, rows k and below hold what the model leaves of every other column, y being the last.
    All columns have been scaled to the norm 1.
    """

    def __init__(self, triangle: Triangle, tolerance: float) -> None:
        norms, noise = triangle.norms, triangle.noise
        alive = norms > noise
        scale = np.where(alive, norms, 1.0)
        self._rows = np.ascontiguousarray(triangle.factor / scale)
        # square of what must be left of a column; infinite for those that cannot enter
        self._least = np.where(alive, np.maximum(tolerance, noise / scale) ** 2, np.inf)
        self._least[-1] = (noise[-1] / scale[-1]) ** 2 if alive[-1] else np.inf
        self._now = self._least[:-1].copy()
        self._free = triangle.n_rows - int(triangle.intercept)
        self.active: list[int] = []
        self.sse = float(self._rows[:, -1] @ self._rows[:, -1])

    @property
    def df(self) -> int:
        """Degrees of freedom that the model leaves."""
        return self._free - len(self.active)

    def best(self, barred: Sequence[int] | None) -> tuple[int, float] | None:
        """Return the candidate with the greatest F, and its F; `None` if no candidate may enter."""
        if not self.sse > self._least[-1]:
            return None
        rest = self._rows[len(self.active) :]
        left = np.einsum("ij,ij->j", rest, rest)[:-1]
        gain = (rest[:, -1] @ rest[:, :-1]) ** 2
        gain /= np.maximum(left, _TINY)
        gain[left <= self._now] = -1.0
        if barred:
            gain[barred] = -1.0
        most = gain.max(initial=-1.0)
        if most < 0:
            return None
        # F rises with the gain, so the greatest gain has the greatest F
        index = int(np.argmax(gain >= most * (1 - _SAME)))
        return index, _ratio(float(gain[index]), max(self.sse - float(gain[index]), 0.0), self.df - 1)

    def worst(self, held: set[int] | None) -> tuple[int, float] | None:
        """Return the term of the model with the smallest F, and its F; `None` if no term may leave."""
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
        """Add a column to the model: a Householder reflection of the rows below the model."""
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
        """Remove a column from the model: Givens rotations make the others triangular again."""
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
