"""Modelling methods by name: those of this package and those of plug-ins."""

import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from inspect import signature
from typing import Any, Literal

from thermocomp.core.exceptions import InputError
from thermocomp.core.plugins import describe_plugin, find_plugins, load_plugin
from thermocomp.models.foreign import adopt_estimator, title
from thermocomp.models.method import Method

#: selects every method where method names are expected
ALL_METHODS = "all"


class NamedEstimator(str):
    """Name of an estimator that was passed in, with the estimator attached; usable wherever a method name is.

    Parameters
    ----------
    estimator : estimator
        See `thermocomp.models.foreign.adopt_estimator`.
    """

    estimator: Any

    def __new__(cls, name: str, estimator: Any) -> "NamedEstimator":
        """Create the string."""
        made = super().__new__(cls, name)
        made.estimator = estimator
        return made

    def __getnewargs__(self) -> tuple[str, Any]:  # type: ignore[override]
        return str(self), self.estimator


def _registered() -> dict[str, Method]:
    """Return the methods of all packages by name; those that cannot be loaded are skipped with a warning."""
    found: dict[str, Method] = {}
    for entry in find_plugins("methods", warnings.warn).values():
        try:
            methods: Sequence[Method] = load_plugin(entry)
        except InputError as e:
            warnings.warn(str(e), stacklevel=2)
            continue
        for method in methods:
            if found.setdefault(method.name, method) is not method:
                warnings.warn(
                    f"{describe_plugin(entry)}: the method name {method.name} is already in use; it is ignored",
                    stacklevel=2,
                )
    return found


#: methods by name: an entry point of ``thermocomp.methods`` refers to a sequence of `Method`
METHODS = _registered()


def find_method(name: str) -> Method:
    """Find a method; an estimator that was passed in uses all inputs."""
    if isinstance(name, NamedEstimator):
        kind = type(name.estimator)
        known: tuple[Literal["dt", "cycle"], ...] = ("dt", "cycle")
        takes = tuple(p for p in known if p in signature(name.estimator.fit).parameters)
        return Method(str(name), "", f"{kind.__module__}:{kind.__qualname__}", speed="inputs", takes=takes)
    found = METHODS.get(name)
    if found is None:
        near = get_close_matches(name, METHODS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"unknown model {name!r}{hint} The models are {', '.join(METHODS)}")
    return found


def expand(names: Sequence[Any]) -> list[str]:
    """Return the names of methods without duplicates; ``all`` denotes all methods."""
    if not names:
        raise InputError("no model given: name at least one method, such as dynamic, or 'all'")
    listed: dict[str, None] = {}
    for entry in names:
        if isinstance(entry, NamedEstimator):
            listed[entry] = None
        elif isinstance(entry, str):
            listed.update(dict.fromkeys(METHODS if entry == ALL_METHODS else [find_method(entry).name]))
        else:
            estimator = adopt_estimator(entry)
            same = sum(n.partition(" #")[0] == title(estimator) for n in listed)
            listed[NamedEstimator(title(estimator) + (f" #{same + 1}" if same else ""), estimator)] = None
    return list(listed)


def deployable(name: str) -> bool:
    """Return whether models of this method can run at a machine: False for methods that cannot be frozen."""
    if isinstance(name, NamedEstimator):
        return bool(getattr(name.estimator, "freezable", True))
    return name not in METHODS or METHODS[name].kind.freezable
