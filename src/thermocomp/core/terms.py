"""Variables and terms: the elements of the polynomial families.

A *variable* is a linear combination of inputs, such as T2 or T6-T7 (C-12: differences are first-class variables). A
*term* is a product of variables, written as a tuple of their indices: ``(1,)`` is the second variable, ``(1, 1)`` its
square, ``(0, 1)`` a product.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import DEGREE, INPUTS, NAME, check_count, check_finite, check_name
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.expression import Difference, Named, Node, Power, Product, Sum, scale_node

FloatArray = NDArray[np.float64]
Term = tuple[int, ...]


@dataclass(frozen=True)
class Variable:
    """A linear combination of inputs.

    Parameters
    ----------
    name : str
        Name, such as ``T6-T7``.
    weights : tuple of (int, float)
        Pairs of input index and factor.

    Raises
    ------
    SettingError
        A name or an input index is invalid, or a factor is NaN or infinite.
    """

    name: str
    weights: tuple[tuple[int, float], ...]

    def __post_init__(self) -> None:
        if self.name:
            check_name("variable", self.name, INPUTS * NAME)  # a projection is named after all its inputs
        check_count(f"variable {self.name}", INPUTS, weights=self.weights)
        check_finite(f"variable {self.name}", weights=[w for _, w in self.weights])
        if not self.weights:
            raise SettingError(f"variable {self.name} has no input")

    @classmethod
    def single(cls, name: str, index: int) -> "Variable":
        """Return the variable that equals one of the inputs."""
        return cls(name, ((index, 1.0),))

    @classmethod
    def difference(cls, names: Sequence[str], plus: str, minus: str) -> "Variable":
        """Return the difference of two of the inputs `names`."""
        for name in (plus, minus):
            if name not in names:
                raise InputError(
                    f"difference {plus}-{minus}: no input is named {name!r}; the inputs are {', '.join(names)}"
                )
        return cls(f"{plus}-{minus}", ((names.index(plus), 1.0), (names.index(minus), -1.0)))

    def check_inputs(self, count: int) -> None:
        """Raise `SettingError` if the variable refers to an input beyond `count`."""
        for i, _ in self.weights:
            if not 0 <= i < count:
                raise SettingError(f"variable {self.name}: input index {i}: expected 0 to {count - 1}")

    def expression(self, change: Sequence[Node]) -> Node:
        """Return the variable as a node of an expression."""
        match self.weights:
            case ((index, 1.0),):
                return change[index]
            case ((plus, 1.0), (minus, -1.0)):
                return Named(self.name, Difference(change[plus], change[minus]))
        return Named(self.name, Sum(tuple(scale_node(w, change[i]) for i, w in self.weights)))

    def written(self) -> str:
        """Return the name, in brackets if required in a product."""
        return f"({self.name})" if len(self.weights) > 1 else self.name


@dataclass(frozen=True)
class TermTable:
    """Computes the values of terms for one or many readings."""

    n_inputs: int
    variables: tuple[Variable, ...]
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        for v in self.variables:
            v.check_inputs(self.n_inputs)
        for t in self.terms:
            check_count("term", DEGREE, factors=t)
            if not t or any(not 0 <= i < len(self.variables) for i in t):
                raise SettingError(
                    f"term {t}: expected at least one variable index, from 0 to {len(self.variables) - 1}"
                )

    @cached_property
    def _mixing(self) -> FloatArray | None:
        """Matrix (n_inputs, n_variables), or None where the variables are the inputs themselves."""
        if [v.weights for v in self.variables] == [((i, 1.0),) for i in range(self.n_inputs)]:
            return None
        matrix = np.zeros((self.n_inputs, len(self.variables)))
        for column, v in enumerate(self.variables):
            for row, weight in v.weights:
                matrix[row, column] = weight
        return matrix

    @cached_property
    def _is_identity(self) -> bool:
        return self.terms == tuple((i,) for i in range(len(self.variables)))

    @cached_property
    def _factors(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Per degree: the terms of at least this degree, and the variable that is their factor at this place."""
        by_degree = []
        for k in range(max((len(t) for t in self.terms), default=0)):
            rows = [i for i, t in enumerate(self.terms) if len(t) > k]
            by_degree.append((np.array(rows, dtype=np.intp), np.array([self.terms[i][k] for i in rows], dtype=np.intp)))
        return by_degree

    def evaluate(self, change: FloatArray) -> FloatArray:
        """Return the values of the terms.

        Parameters
        ----------
        change : ndarray of shape (..., n_inputs)
            Inputs minus their reference.

        Returns
        -------
        ndarray of shape (..., n_terms)
        """
        values = change if self._mixing is None else change @ self._mixing
        if self._is_identity:
            return values
        out: FloatArray | None = None
        for rows, factors in self._factors:
            if out is None:
                out = values[..., factors]
            elif rows.size == out.shape[-1]:
                out *= values[..., factors]
            else:
                out[..., rows] *= values[..., factors]
        return np.empty((*change.shape[:-1], 0)) if out is None else out

    def names(self) -> tuple[str, ...]:
        """Return the terms as text, such as ``T2*(T6-T7)``."""
        return tuple("*".join(self.variables[i].written() for i in t) for t in self.terms)

    def expressions(self, change: Sequence[Node]) -> tuple[Node, ...]:
        """Return the terms as nodes of an expression."""
        made = [v.expression(change) for v in self.variables]
        return tuple(_multiplied([made[i] for i in t]) for t in self.terms)

    def inputs_of(self, term: int) -> set[int]:
        """Return the indices of the inputs used by a term."""
        return {i for v in self.terms[term] for i, _ in self.variables[v].weights}


def _multiplied(factors: Sequence[Node]) -> Node:
    first, *others = factors
    if not others:
        return first
    if all(f == first for f in others):
        return Power(first, len(factors))
    return Product(tuple(factors))


def second_order_terms(n_variables: int) -> tuple[Term, ...]:
    """Return all linear, square and product terms of `n_variables` variables: n + n(n+1)/2 terms (C-09, C-10)."""
    linear = [(i,) for i in range(n_variables)]
    squares = [(i, i) for i in range(n_variables)]
    products = [(i, j) for i in range(n_variables) for j in range(i + 1, n_variables)]
    return (*linear, *squares, *products)
