"""Polynomial family: squares, products, differences; no memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from thermocomp.core.bounds import ENTRIES, NODES, check_count, check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Node, sum_weighted
from thermocomp.core.model import ErrorModel
from thermocomp.core.terms import Term, TermTable, Variable


@dataclass(frozen=True, kw_only=True)
class Polynomial(ErrorModel):
    """Deviation = intercept + sum of coefficient * product of variables (Chen 1996, Eq. 4; C-09).

    Chen's form has no intercept: the deviation is zero in the reference state.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    variables : tuple of Variable
        Linear combinations of the inputs (C-12).
    terms : tuple of tuple of int
        Per term, the indices of the variables that are multiplied.
    coefficients : tuple of float
        One per term.

    Examples
    --------
    >>> from thermocomp import Polynomial
    >>> from thermocomp.core.inputs import Input
    >>> from thermocomp.core.terms import Variable
    >>> front = Input("t_front_C", "temperature", "degC", reference=20.0, rezero=True, low=0.0, high=15.0)
    >>> model = Polynomial(
    ...     target="z_um",
    ...     unit="um",
    ...     inputs=(front,),
    ...     variables=(Variable.single("t_front_C", 0),),
    ...     terms=((0,), (0, 0)),
    ...     coefficients=(2.0, 0.1),
    ... )
    >>> model.predict({"t_front_C": [20.0, 25.0, 30.0]}).round(1).tolist()  # the first row counts as zero [um]
    [0.0, 12.5, 30.0]
    """

    family: Literal["polynomial"] = "polynomial"

    variables: tuple[Variable, ...]
    terms: tuple[Term, ...]
    coefficients: tuple[float, ...]

    def _check(self) -> None:
        owner = f"model of {self.target}"
        if len(self.terms) != len(self.coefficients):
            raise SettingError(f"{owner}: {len(self.terms)} terms but {len(self.coefficients)} coefficients")
        check_count(owner, NODES, variables=self.variables)
        check_count(owner, ENTRIES, terms=self.terms)
        check_finite(owner, coefficients=self.coefficients, intercept=self.intercept)
        self._table  # noqa: B018 - rejects invalid indices

    @cached_property
    def _table(self) -> TermTable:
        return TermTable(len(self.inputs), self.variables, self.terms)

    def _expression(self, change: Sequence[Node]) -> Node:
        return sum_weighted(self.coefficients, self._table.expressions(change), self.intercept)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
        used = {i for k, c in enumerate(self.coefficients) if c != 0 for i in self._table.inputs_of(k)}
        return tuple(self.inputs[i].name for i in sorted(used))

    def coefficients_by_name(self) -> dict[str, float]:
        """Return the coefficient of each term, by its name."""
        return dict(zip(self._table.names(), self.coefficients, strict=True))
