"""Declarations of the variables of a program, in groups."""

import inspect
from functools import cache
from typing import TYPE_CHECKING

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.tree import Kind
from thermocomp.runtime.program.values import Condition, Number, Numbers, Truths, Whole, Wholes


class Var:
    """Declaration of a variable or an array.

    Parameters
    ----------
    kind : {'real', 'time', 'int', 'bool'}
    about : str
        Meaning and unit.
    dims : tuple of str
        Dimensions: names of sizes.
    cap : bool
        Upper bound never to be exceeded: rounding makes it smaller, never larger.
    """

    def __init__(self, kind: Kind, about: str, dims: tuple[str, ...] = (), *, cap: bool = False) -> None:
        self.kind, self.about, self.dims, self.cap = kind, about, dims, cap

    def __set_name__(self, owner: type["Record"], name: str) -> None:
        self.node = n.Name(self.kind, name, owner.owner, self.dims)


class number(Var):  # noqa: N801 - reads as a type in a declaration
    """Declaration of a number."""

    def __init__(self, about: str, *, time: bool = False, cap: bool = False) -> None:
        super().__init__("time" if time else "real", about, cap=cap)

    def __get__(self, record: object, owner: object = None) -> Number:
        return Number(self.node)

    def __set__(self, record: object, value: Number | float) -> None:
        Number(self.node).set(value)


class whole(Var):  # noqa: N801
    """Declaration of an integer."""

    def __init__(self, about: str) -> None:
        super().__init__("int", about)

    def __get__(self, record: object, owner: object = None) -> Whole:
        return Whole(self.node)

    def __set__(self, record: object, value: Whole | int) -> None:
        Whole(self.node).set(value)


class truth(Var):  # noqa: N801
    """Declaration of a condition."""

    def __init__(self, about: str) -> None:
        super().__init__("bool", about)

    def __get__(self, record: object, owner: object = None) -> Condition:
        return Condition(self.node)

    def __set__(self, record: object, value: Condition | bool) -> None:
        Condition(self.node).set(value)


class numbers(Var):  # noqa: N801
    """Declaration of an array of numbers."""

    def __init__(self, about: str, *dims: str, time: bool = False) -> None:
        super().__init__("time" if time else "real", about, dims)

    def __get__(self, record: object, owner: object = None) -> Numbers:
        return Numbers(self.node)


class wholes(Var):  # noqa: N801
    """Declaration of an array of integers."""

    def __init__(self, about: str, *dims: str) -> None:
        super().__init__("int", about, dims)

    def __get__(self, record: object, owner: object = None) -> Wholes:
        return Wholes(self.node)


class truths(Var):  # noqa: N801
    """Declaration of an array of conditions."""

    def __init__(self, about: str, *dims: str) -> None:
        super().__init__("bool", about, dims)

    def __get__(self, record: object, owner: object = None) -> Truths:
        return Truths(self.node)


class size(whole):  # noqa: N801
    """Declaration of a size: constant for a compensator, printed as a number."""


class option(truth):  # noqa: N801
    """Declaration of a feature that a compensator has or has not: a branch that depends on it is resolved."""


class Record:
    """A group of variables, with the letter of its name in the program."""

    owner = ""

    @classmethod
    @cache
    def variables(cls) -> dict[str, Var]:
        """Return the declarations of its variables by name, without sizes."""
        found = {k: v for c in reversed(cls.__mro__) for k, v in vars(c).items() if isinstance(v, Var)}
        return {k: v for k, v in found.items() if not isinstance(v, size | option)}

    if not TYPE_CHECKING:  # a type checker knows the variables and would accept any other name

        def __setattr__(self, name: str, value: object) -> None:
            if not isinstance(inspect.getattr_static(self, name, None), Var):
                raise TypeError(f"{name} is not a declared variable of {type(self).__name__}")
            super().__setattr__(name, value)
