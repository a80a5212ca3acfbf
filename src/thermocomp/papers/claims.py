"""Claims of a paper as data: entries of ``claims.toml`` beside a study, filled in and judged by what the study found.

The file has a table per section, usually the name of the module with the results, and in it an entry per claim, in
order of presentation:

``ids``, ``text``, ``paper``
    See `thermocomp.papers.study.Claim`; several ids separated by spaces.
``ours``
    Our result.
``holds``
    Criterion: the name of a truth value, or two names and a comparison between them, such as ``"error <= LIMIT"``.
    Default: what the facts of the entry call ``holds``; without that the claim is a number for information.
``note``, ``otherwise``
    Limitation, and the reason shown only if the claim does not hold.
``parts``
    Parts of the sentences, by name; see `Sentences`. Those of a section ``parts`` are for all entries.
``each``
    Repeats the entry for each of several values, which its sentences call ``{each}``.

All texts are templates of `str.format`. A name in capitals is a constant of the module; any other one is in the facts
of the entry, or else an attribute of the results.
"""

import operator
import sys
import tomllib
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from string import Formatter
from types import ModuleType
from typing import Any, Generic, TypeVar

import numpy as np

from thermocomp.papers.study import Claim

#: named values that the sentences of a claim need beside the attributes of the results
Facts = dict[str, Any]
#: type of the results by which claims are judged
_Found = TypeVar("_Found")

_COMPARISONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


class Sentences(Formatter):
    """Templates of `str.format`, extended by lists and by parts of sentences.

    The items of a list, or the values of a mapping, are formatted one by one, and joined by what follows a bar in the
    format: ``{errors:.2f| / }``; default: a comma. ``{rows:#}`` is their number. A field with the name of a part is
    replaced by it: once per item if the value is a list or mapping, with the item as ``{0}``, ``{1}``; if the value is
    true; or, if there are several versions of the part, by the version, or the versions, that the value names.

    Parameters
    ----------
    names : mapping of str
        Values by name.
    parts : mapping of str to str or mapping
        Parts by name; one with several versions is a mapping of these.
    """

    def __init__(self, names: Mapping[str, Any], parts: Mapping[str, str | Mapping[str, str]]) -> None:
        self._names, self._parts = names, parts

    def fill(self, template: str, *items: Any) -> str:
        """Return a template filled in."""
        return self.vformat(template, items, self._names)

    def value(self, name: str) -> Any:
        """Return the value of a name, which may have attributes and indices after it."""
        return super().get_field(name, (), self._names)[0]

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """Return the value of a field, with the part of its name filled in."""
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
        """Return a value as text; the items of a list are joined."""
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


class _Attributes(dict[str, Any]):
    """The attributes of an object by name."""

    def __init__(self, owner: object) -> None:
        super().__init__()
        self._owner = owner

    def __missing__(self, name: str) -> Any:
        return getattr(self._owner, name)


class Claims(Generic[_Found]):
    """Claims of one section, each judged by the results of a study.

    Parameters
    ----------
    module : str
        Name of the module that has the constants; ``claims.toml`` is in its package.
    *others : module
        Modules with further constants.
    section : str
        Section of the file. Default: the last part of the name of the module.
    """

    def __init__(self, module: str, *others: ModuleType, section: str = "") -> None:
        package, _, last = module.rpartition(".")
        content = (files(package) / "claims.toml").read_text(encoding="utf-8")
        self._modules = ChainMap(vars(sys.modules[module]), *map(vars, others))
        sections = tomllib.loads(content)
        self._entries: dict[str, dict[str, Any]] = sections[section or last]
        self._parts = sections.get("parts", {})
        self._facts: dict[str, Callable[..., Facts]] = {}

    def facts(self, function: Callable[..., Facts]) -> Callable[..., Facts]:
        """Use a function of the results (and of `each`) for the facts of the entry with its name; a decorator."""
        key = function.__name__.strip("_")
        if key not in self._entries:
            raise KeyError(f"no claim is named {key}")
        self._facts[key] = function
        return function

    def __call__(self, found: _Found) -> tuple[Claim, ...]:
        """Return all claims, judged by the results."""
        return tuple(claim for key in self._entries for claim in self.judged(key, found))

    def judged(self, key: str, found: _Found) -> list[Claim]:
        """Return the claims of one entry, judged by the results."""
        entry = self._entries[key]
        function = self._facts.get(key)
        claims = []
        for each in entry.get("each", [None]):
            given = () if each is None else (each,)
            facts = {"each": each} | (function(found, *given) if function else {})
            claims.append(self._claim(entry, facts, found))
        return claims

    def _claim(self, entry: Mapping[str, Any], facts: Facts, found: _Found) -> Claim:
        constants = {name: value for name, value in self._modules.items() if name.isupper()}
        said = Sentences(ChainMap(facts, constants, _Attributes(found)), self._parts | entry.get("parts", {}))
        criterion = entry.get("holds", "holds" if "holds" in facts else "")
        holds = said.judge(criterion) if criterion else None
        reasons = (entry.get("note", ""), entry.get("otherwise", "") if holds is False else "")
        return Claim(
            ids=tuple(entry["ids"].split()),
            text=said.fill(entry["text"]),
            paper=said.fill(entry.get("paper", "")),
            ours=said.fill(entry["ours"]),
            holds=holds,
            finding=" ".join(filter(None, map(said.fill, reasons))),
        )
