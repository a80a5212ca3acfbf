"""Named tuples and dataclasses with arrays as JSON, decoded strictly by their types."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

#: largest permitted number
_LARGEST = 1e15
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def encode(value: Any) -> Any:
    """Return a value as JSON: arrays with their shape, NaN and infinities as words."""
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "values": [encode(v) for v in value.ravel().tolist()]}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if hasattr(value, "_asdict"):
        value = value._asdict()
    elif is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping):
        return {k: encode(v) for k, v in value.items()}
    return [encode(v) for v in value] if isinstance(value, tuple) else value


def decode(kind: Any, value: Any, place: str) -> Any:
    """Return a value of a given type.

    Parameters
    ----------
    kind : type
        Type made of named tuples, dataclasses, tuples, dicts, arrays, plain values and ``None``.
    """
    if get_origin(kind) in (Union, UnionType):
        (inner,) = (p for p in get_args(kind) if p is not NoneType)
        return None if value is None else decode(inner, value, place)
    if get_origin(kind) is not None:
        return _several(get_origin(kind), get_args(kind), value, place)
    if kind in (float, bool, str):
        return _plain(kind, value, place)
    hints = get_type_hints(kind)
    names = list(getattr(kind, "_fields", None) or [f.name for f in fields(kind)])
    if isinstance(value, dict):  # a file from before these fields existed
        defaults = getattr(kind, "_field_defaults", {})
        names = [n for n in names if n in value or n not in defaults]
    want(isinstance(value, dict) and list(value) == names, value, place, f"a table of {', '.join(names)}")
    return kind(**{name: decode(hints[name], value[name], f"{place}.{name}") for name in names})


def want(right: bool, value: Any, place: str, what: str) -> None:
    """Raise `ValueError` unless a condition holds.

    Parameters
    ----------
    value : Any
        Value found; None is not shown.
    """
    if not right:
        raise ValueError(f"{place}: expected {what}" + ("" if value is None else f", found {value!r:.40}"))


def _several(origin: Any, parts: tuple[Any, ...], value: Any, place: str) -> Any:
    if origin is Literal:
        want(value in parts, value, place, f"one of {', '.join(parts)}")
        return value
    if origin is np.ndarray:
        return _array(get_args(parts[1])[0], value, place)
    if origin is tuple:
        want(isinstance(value, list), value, place, "a list")
        return tuple(decode(parts[0], v, f"{place}.{k}") for k, v in enumerate(value))
    want(isinstance(value, dict), value, place, "a table")
    return {k: decode(parts[1], v, f"{place}.{k:.40}") for k, v in value.items()}


def _plain(kind: type, value: Any, place: str) -> Any:
    if kind is not float:
        want(type(value) is kind, value, place, "text" if kind is str else "true or false")
        return value
    if isinstance(value, str) and value in _WORDS:
        return _WORDS[value]
    want(type(value) in (float, int) and abs(value) <= _LARGEST, value, place, "a number")
    return float(value)


def _array(scalar: Any, value: Any, place: str) -> Any:
    if not isinstance(value, dict):  # a single number
        value = {"shape": [], "values": [value]}
    want(list(value) == ["shape", "values"], value, place, "an array")
    shape, values = value["shape"], value["values"]
    want(isinstance(shape, list) and all(type(n) is int and 0 <= n < 10**6 for n in shape), shape, place, "a shape")
    want(isinstance(values, list) and len(values) == math.prod(shape), None, place, f"{math.prod(shape)} numbers")
    if issubclass(scalar, np.integer):
        least, most = np.iinfo(scalar).min, np.iinfo(scalar).max
        want(all(type(v) is int and least <= v <= most for v in values), values, place, "whole numbers")
    else:
        values = [_plain(bool if scalar is np.bool_ else float, v, place) for v in values]
    return np.array(values, dtype=scalar).reshape(shape)
