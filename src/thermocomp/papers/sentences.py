"""Templates of the sentences of a study, and the TOML files next to it that contain them."""

import operator
import sys
import tomllib
from collections import ChainMap
from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Formatter
from types import ModuleType
from typing import Any

import numpy as np

_COMPARISONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


class Sentences(Formatter):
    """Templates of `str.format`, extended by lists and by parts of sentences.

    The items of a list, or the values of a mapping, are formatted one by one, and joined by the text after a bar in the
    format: ``{errors:.2f| / }``; default: a comma. ``{rows:#}`` is their number. A field with the name of a part is
    replaced by this part: once per item, with the item as ``{0}``, ``{1}``, if the value is a list or mapping; once or
    not at all if the value is true or false. A part with several versions: the value names one or more of them.

    Parameters
    ----------
    names : mapping of str
        Values by name.
    parts : mapping of str to str or mapping
        Parts by name; one with several versions is a mapping of these.
    """

    def __init__(self, names: Mapping[str, Any], parts: Mapping[str, Any]) -> None:
        self._names, self._parts = names, parts

    def fill(self, template: str, *items: Any) -> str:
        """Return a template with its fields replaced by values."""
        return self.vformat(template, items, self._names)

    def value(self, name: str) -> Any:
        """Return the value of a name, which may be followed by attributes and indices."""
        return super().get_field(name, (), self._names)[0]

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """Return the value of a field, or the part of the same name, filled in."""
        value, first = super().get_field(field_name, args, kwargs)
        part = self._parts.get(field_name)
        if part is None:
            return value, first
        if isinstance(part, Mapping):
            if isinstance(value, list):
                return [self.fill(part[version]) for version in value], first
            version = str(value).lower() if isinstance(value, bool | np.bool_) else value
            return self.fill(part.get(version, "")), first
        if isinstance(value, Mapping):
            value = list(value.items())
        if isinstance(value, list):
            return [self.fill(part, *(item if isinstance(item, tuple) else (item,))) for item in value], first
        return self.fill(part) if value else "", first

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return the value of a field as text; the items of a list are joined."""
        if format_spec == "#":
            return str(len(value))
        if isinstance(value, Mapping):
            value = list(value.values())
        if not isinstance(value, list | tuple | np.ndarray):
            return str(super().format_field(value, format_spec))
        spec, bar, between = format_spec.partition("|")
        return (between if bar else ", ").join(self.format_field(item, spec) for item in value)

    def judge(self, criterion: str) -> bool | None:
        """Return whether a criterion is fulfilled; None if its value is None."""
        name, *limit = criterion.split()
        value = self.value(name)
        if limit:
            value = _COMPARISONS[limit[0]](value, self.value(limit[1]))
        return None if value is None else bool(value)


class Attributes(dict[str, Any]):
    """The attributes of an object by name."""

    def __init__(self, owner: object) -> None:
        super().__init__()
        self._owner = owner

    def __missing__(self, name: str) -> Any:
        return getattr(self._owner, name)


class TextFile:
    """A TOML file with the texts of a study.

    Parameters
    ----------
    name : str
        Name of the file.
    module : str
        Name of a module in the same package; its names in capitals are constants of the texts.
    *others : module
        Modules with further constants.
    """

    def __init__(self, name: str, module: str, *others: ModuleType) -> None:
        package = module.rpartition(".")[0]
        self.content: dict[str, Any] = tomllib.loads((files(package) / name).read_text(encoding="utf-8"))
        self._modules = ChainMap(vars(sys.modules[module]), *map(vars, others))

    def sentences(self, facts: dict[str, Any], owner: object, parts: Mapping[str, Any] | None = None) -> Sentences:
        """Return templates whose names are facts, constants, or else attributes of an object."""
        constants = {name: value for name, value in self._modules.items() if name.isupper()}
        return Sentences(ChainMap(facts, constants, Attributes(owner)), self.content.get("parts", {}) | (parts or {}))
