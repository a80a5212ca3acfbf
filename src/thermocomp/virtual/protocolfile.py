"""Protocols of tests on the virtual machines as TOML files; see :doc:`/protocols`."""

import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from thermocomp.core.exceptions import InputError, SettingError, UnitError, explain_unknown
from thermocomp.core.units import read_with_unit
from thermocomp.files.plaintext import find_keys, strict_adapter
from thermocomp.files.tomlfile import as_json, read_toml
from thermocomp.virtual.climate import CLIMATES, Climate
from thermocomp.virtual.instruments import Touch
from thermocomp.virtual.protocol import Experiment, PlannedTest
from thermocomp.virtual.segments import Feed, Lot, Stretch, Stroke
from thermocomp.virtual.segments import Path as Keys
from thermocomp.virtual.sensors import SensorFault

#: validator of external protocols
ADAPTER = strict_adapter(Experiment)

#: keys of durations, which are written with a unit
TIMES = ("sampling", "duration", "every", "start", "end", "memory", "begin")
#: keys of Boolean values, and of texts that may look like numbers
SWITCHES = ("perfect", "cooled", "powered")
TEXTS = ("description", "name", *TIMES)
#: keys of the whole file; all others may also belong to a test
_OF_ALL = ("description", "machine", "physics", "tests")
#: type of the table under a key; tables under other keys are random numbers
_TABLES: dict[str, type] = {
    "tests": PlannedTest,
    "segments": Stretch,
    "soak": Stretch,
    "feed": Feed,
    "stroke": Stroke,
    "climate": Climate,
    "touch": Touch,
    "faults": SensorFault,
}
#: expansion of a bare text under a key
_SHORT: dict[str, Callable[[str], Any]] = {
    "soak": lambda text: {"duration": text},
    "climate": lambda text: {"like": text},
    "places": lambda text: [text],
    "probes": lambda text: [text],
}
#: plain wording of pydantic's errors
_PLAIN = {
    "dataclass_type": "must be a table, such as {key = 1}",
    "tuple_type": "must be a list: [...]",
    "missing": "has too few values",
}


def read_protocol(path: str | Path) -> Experiment:
    """Read a protocol TOML.

    Examples
    --------
    Four jobs of random speed, each followed by a stop::

        sampling = "10 s"
        probes = ["x1", "z"]
        repeat = 4
        segments = [
            {duration = "30 min", speed = {between = [600, 2600], step = 50}},
            {duration = "15 min"},
        ]
    """
    source = Path(path)
    content = read_toml(source, "protocol file")
    try:
        _check_types(content, ())
        given = _in_house_units(content)
        try:
            return ADAPTER.validate_json(as_json({"name": source.stem, **given}))
        except ValidationError as e:
            keys, message = _explain(e, given)
            raise SettingError(message, keys) from e
    except SettingError as e:
        raise InputError(": ".join(part for part in (str(source), _where(e.path, content), str(e)) if part)) from e


def _check_types(value: Any, path: Keys) -> None:
    """Raise an error for Booleans where numbers belong, and for quoted numbers: both could be misinterpreted."""
    if isinstance(value, dict):
        for key, v in value.items():
            _check_types(v, (*path, key))
    elif isinstance(value, list):
        for k, v in enumerate(value):
            _check_types(v, (*path, k))
    else:
        key = next((k for k in reversed(path) if isinstance(k, str)), "")
        if key in SWITCHES and not isinstance(value, bool):
            raise SettingError("must be true or false, without quotes", path)
        if isinstance(value, bool) and key not in SWITCHES:
            raise SettingError("must be a value other than true and false", path)
        if isinstance(value, str) and key not in TEXTS and re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", value):
            raise SettingError(f"expected a number, found the text {value!r}; write it without quotes", path)


def _in_house_units(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content with shared settings copied into each test, times in seconds, and names replaced."""
    known = [*_OF_ALL, *(f.name for f in fields(PlannedTest))]
    for key in content:
        if key not in known:
            raise explain_unknown("key", key, known, (key,))
    shared = {key: value for key, value in content.items() if key not in _OF_ALL}
    tests = content.get("tests", [{}])
    if not isinstance(tests, list) or not all(isinstance(t, dict) for t in tests):
        raise SettingError("must be a list of tables: [[tests]]", ("tests",))
    head = {key: content[key] for key in _OF_ALL if key in content}
    return head | {"tests": [_table({**shared, **test}, ("tests", k)) for k, test in enumerate(tests)]}


def _table(table: Mapping[str, Any], path: Keys) -> dict[str, Any]:
    return {key: _value(key, value, (*path, key)) for key, value in table.items()}


def _value(key: str, value: Any, path: Keys) -> Any:
    """Return the value of a key in internal units, with names expanded."""
    if key in TIMES:
        return _seconds(value, path)
    if isinstance(value, str) and key in _SHORT:
        value = _SHORT[key](value)
    if key in _TABLES and isinstance(value, list):
        return [_table(v, (*path, k)) if isinstance(v, dict) else v for k, v in enumerate(value)]
    if key not in _TABLES or not isinstance(value, dict):
        return value
    table = _table(value, path)
    if key == "climate":
        like = str(table.pop("like", "workshop"))
        if like not in CLIMATES:
            raise explain_unknown("climate", like, CLIMATES, path)
        table = asdict(CLIMATES[like]) | table
    return table


def _seconds(value: Any, path: Keys) -> Any:
    """Return a duration in seconds, or all durations of a random choice."""
    if isinstance(value, dict):
        return {key: _seconds(v, (*path, key)) for key, v in value.items()}
    if isinstance(value, list):
        return [_seconds(v, (*path, k)) for k, v in enumerate(value)]
    try:
        seconds = read_with_unit(value, "time")
    except UnitError as e:
        raise SettingError(str(e), path) from e
    if seconds is None:
        raise SettingError('write a time with its unit, such as "30 min", "6 h" or "10 s"', path)
    return seconds


def _explain(failure: ValidationError, given: Mapping[str, Any]) -> tuple[Keys, str]:
    """Return location and remedy of pydantic's first error; for a union, of the nearest type."""
    errors = failure.errors()
    first = find_keys(errors[0]["loc"], given)
    error = max(
        (e for e in errors if find_keys(e["loc"], given)[: len(first)] == first),
        key=lambda e: (len(find_keys(e["loc"], given)), e["type"] == "value_error"),
    )
    keys, cause = find_keys(error["loc"], given), error.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return (*keys, *cause.path), str(cause)
    if error["type"] == "unexpected_keyword_argument":
        above = [k for k in keys[:-1] if isinstance(k, str)]
        return keys, str(explain_unknown("key", str(keys[-1]), [f.name for f in fields(_TABLES.get(above[-1], Lot))]))
    if error["type"] == "missing" and isinstance(error["loc"][-1], str):
        return (*keys, error["loc"][-1]), "is missing"
    return keys, _PLAIN.get(error["type"], error["msg"])


def _where(keys: Keys, content: Mapping[str, Any]) -> str:
    """Return the table of a key, and the value found there."""
    if keys[:1] == ("tests",) and len(keys) > 2 and _found(keys[:3], content) is None:
        keys = keys[2:]  # shared settings are at the top level
    said = []
    for k, key in enumerate(keys):
        nxt = keys[k + 1] if k + 1 < len(keys) else None
        if isinstance(key, int):
            continue
        if isinstance(nxt, int) and key in _TABLES:
            said.append(f"[[{key}]] {nxt + 1}")
        elif any(isinstance(later, str) for later in keys[k + 1 :]):
            said.append(f"[{key}]")
        else:
            found = _found(keys[: k + 1], content)
            said.append(f"key {key!r}" + (f" = {found!r}" if found is not None and len(repr(found)) < 80 else ""))
    return ", ".join(said)


def _found(keys: Keys, content: Any) -> Any:
    for key in keys:
        try:
            content = content[key]
        except (KeyError, IndexError, TypeError):
            return None
    return content
