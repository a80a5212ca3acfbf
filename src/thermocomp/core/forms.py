"""Linear forms: weighted sums of values plus a constant."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray


class Form(NamedTuple):
    """A linear form: constant + sum of weight * value."""

    weights: tuple[tuple[int, float], ...]  #: (slot of a value, weight)
    constant: float

    def scaled(self, factor: float) -> "Form":
        """Return the form multiplied by a number."""
        return Form(tuple((k, factor * w) for k, w in self.weights), factor * self.constant)

    def moved(self, places: Sequence[int]) -> "Form":
        """Return the form with its slots renumbered."""
        return Form(tuple((places[k], w) for k, w in self.weights), self.constant)


def add_forms(forms: Sequence[Form]) -> Form:
    """Return the sum of linear forms."""
    weights: dict[int, float] = {}
    for form in forms:
        for k, w in form.weights:
            weights[k] = weights.get(k, 0.0) + w
    return Form(tuple(weights.items()), sum(f.constant for f in forms))


class Forms:
    """Several linear forms of values.

    Parameters
    ----------
    forms : sequence of Form
    exact : bool
        The result for each reading of a batch is bit-identical to that of the reading alone; a matrix product does not
        ensure this.
    """

    def __init__(self, forms: Sequence[Form], exact: bool = False) -> None:
        self._exact = exact
        self._single = all(len(f.weights) == 1 for f in forms)
        self._constant = np.array([f.constant for f in forms], dtype=np.float64)
        self._any_constant = bool(self._constant.any())
        if self._single:
            self._slots = np.array([f.weights[0][0] for f in forms], dtype=np.intp)
            self._weights = np.array([f.weights[0][1] for f in forms], dtype=np.float64)
            self._scales = bool((self._weights != 1.0).any())
            return
        used = sorted({k for f in forms for k, _ in f.weights})
        self._slots = np.array(used, dtype=np.intp)
        self._weights = np.zeros((len(used), len(forms)))
        for j, form in enumerate(forms):
            for k, w in form.weights:
                self._weights[used.index(k), j] = w

    def evaluate(self, values: FloatArray) -> FloatArray:
        """Return the results of the forms, (..., n_forms), for values of shape (..., n_slots)."""
        found = values.take(self._slots, axis=-1)
        if not self._single:
            found = (found[..., None] * self._weights).sum(axis=-2) if self._exact else found @ self._weights
        elif self._scales:
            found = found * self._weights
        return found + self._constant if self._any_constant else found
