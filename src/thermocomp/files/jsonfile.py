"""Common part of the model files: JSON with a format, a version and a checksum."""

import hashlib
import json
import re
from dataclasses import dataclass, field, make_dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from pydantic import ValidationError
from pydantic_core import ErrorDetails, SchemaValidator

from thermocomp.core.exceptions import InputError, ModelFileError, SettingError
from thermocomp.core.shown import replace_unprintable
from thermocomp.files.draft import write_text
from thermocomp.files.plaintext import find_keys, list_errors, read_text, strict_adapter

#: maximum size of a file [bytes]; additive models fitted to 9,000 rows had 8 million each before their curves were
#: thinned
MOST = 64_000_000
#: maximum counts of characters in the content, so that the memory for any file is bounded
_COUNTS = {",": 4_000_000, "[": 500_000, "{": 20_000, '"': 300_000}
#: maximum number of digits of an integer
_DIGITS = 18
#: maximum number of characters quoted from a file in an error
_REPEATED = 60


@dataclass(frozen=True)
class Format:
    """A file format.

    Parameters
    ----------
    name : str
        Name as in the file.
    words : str
        Name of the format in messages.
    command : str
        Command that writes the format.
    shared : tuple of str
        Keys stored once for all models of a file.
    """

    name: str
    version: int
    words: str
    command: str
    shared: tuple[str, ...] = ()


MODELS = Format("thermocomp-model", 1, "model file", "thermocomp fit", shared=("watch", "thresholds"))
POSITION_MODELS = Format("thermocomp-position-model", 1, "position model file", "thermocomp position")
_KNOWN = {f.name: f for f in (MODELS, POSITION_MODELS)}


def pack(kind: Format, body: list[Any], shared: dict[str, Any] | None = None) -> str:
    """Return the text of a file; floats are written such that reading restores them bit for bit."""
    shared = shared or {}
    content = {"format": kind.name, "version": kind.version, "sha256": digest(body, shared), "models": body, **shared}
    text = _lay_out(content) + "\n"
    if len(text) > MOST:
        raise InputError(
            f"{kind.words}: {len(text):,} characters, but at most {MOST:,} can be read back; write the models to "
            "separate files"
        )
    return text


def _lay_out(value: Any, depth: int = 1) -> str:
    """Return JSON with one line per key and per entry of a list of tables; other lists take one line."""
    if isinstance(value, dict) and value:
        parts = [f"{json.dumps(k, ensure_ascii=False)}: {_lay_out(v, depth + 1)}" for k, v in value.items()]
    elif isinstance(value, list | tuple) and any(isinstance(v, dict) for v in value):
        parts = [_lay_out(v, depth + 1) for v in value]
    else:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    first, last = "{}" if isinstance(value, dict) else "[]"
    line = "\n" + " " * depth
    return f"{first}{line}{f',{line}'.join(parts)}{line[:-1]}{last}"


def unpack(kind: Format, entry: Any, text: str, source: str, **shared: Any) -> Any:
    """Parse the text of a file; return its ``models`` and the data common to all of them."""
    content = _parse(text, f"{source}: not a {kind.words}", source, kind.command)
    _check_kind(kind, content, source)
    body = content.get("models")
    if not isinstance(body, list) or not body:
        raise ModelFileError(f"{source}: the file contains no model")
    try:
        found_digest = digest(body, {k: content[k] for k in kind.shared if k in content})
    except (ValueError, RecursionError) as e:  # 1e999, half a surrogate pair, a hundred brackets
        raise ModelFileError(f"{source}: not a {kind.words}: invalid content: {_short(str(e))}") from e
    if content.get("sha256") != found_digest:
        raise ModelFileError(
            f"{source}: its numbers do not match its checksum: the file was altered or damaged; write it again with "
            f"'{kind.command}'"
        )
    try:
        return _reader_of(entry, **shared).validate_json(text)  # the text keeps the order of the keys
    except ValidationError as e:
        errors = [_tell(error, content) for error in e.errors(include_url=False)]
        raise ModelFileError(list_errors(source, errors)) from e


@cache
def _reader_of(entry: Any, **shared: Any) -> SchemaValidator:
    """Return the reader of the models of a file, each of the type `entry`, and of the data common to all of them.

    Validation is strict: a number in quotes, a missing or an unknown key is an error and is not guessed. In a list of
    numbers only the first invalid one is reported: the errors of a million would take a gigabyte.
    """
    head = [("format", str), ("version", int), ("sha256", str), ("models", list[entry])]
    rest = [(name, kind | None, field(default=None)) for name, kind in shared.items()]
    whole = make_dataclass("whole", [*head, *rest])
    schema = strict_adapter(whole).core_schema
    _stop_at_first(schema)
    return SchemaValidator(schema)


def _stop_at_first(schema: Any) -> None:
    if isinstance(schema, dict):
        items = [i.get("type") for i in schema.get("items_schema", ())] if schema.get("type") == "tuple" else ()
        if items and all(i in ("float", "int", "str", "tuple") for i in items):
            schema["fail_fast"] = True
        for inner in schema.values():
            _stop_at_first(inner)
    elif isinstance(schema, list):
        for inner in schema:
            _stop_at_first(inner)


def write(text: str, path: str | Path, *, overwrite: bool) -> None:
    """Write the text of a model file; raise `InputError` if the file exists and `overwrite` is False."""
    write_text(text, Path(path), overwrite=overwrite)


def read(kind: Format, path: str | Path) -> tuple[str, str]:
    """Return the text of a model file, and its name for messages."""
    return read_text(path, kind.words, MOST, ModelFileError), str(path)


def digest(body: list[Any], shared: dict[str, Any] | None = None) -> str:
    """Return the SHA-256 of models as stored in a file, with the data common to all of them."""
    whole = [body, shared] if shared else body
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


# -- JSON --------------------------------------------------------------------------------------------------------------


def _parse(text: str, no: str, source: str, command: str) -> Any:
    for sign, most in _COUNTS.items():
        if text.count(sign) > most:
            raise ModelFileError(f"{no}: it contains {sign} more than {most:,} times")
    try:
        return json.loads(text, object_pairs_hook=_table, parse_constant=_refuse, parse_int=_whole)
    except RecursionError as e:
        raise ModelFileError(f"{no}: nested too deeply") from e
    except json.JSONDecodeError as e:
        if not text.lstrip().startswith("{"):
            raise ModelFileError(f"{no}: {_found(text)}; name the file that '{command}' wrote") from e
        where = f"line {e.lineno}, column {e.colno}"
        if e.pos >= len(text.rstrip()) - 1 or "Unterminated" in e.msg:
            raise ModelFileError(f"{source}: the file is incomplete (it ends at {where}); copy it again") from e
        raise ModelFileError(f"{no}: {e.msg} at {where}") from e
    except ValueError as e:
        raise ModelFileError(f"{no}: {e}") from e


def _found(text: str) -> str:
    """Return a description of a text that is not JSON, for an error message."""
    line = next((line.strip() for line in text.splitlines() if line.strip()), "")
    if not line:
        return "it is empty"
    if re.match(r"\[[\w.\"]+\]$|[\w.]+\s*=", line):
        return f"it is TOML, such as a machine file or a mapping: it begins with {_short(line)}"
    if any(line.count(sign) for sign in ",;\t"):
        return f"it looks like a table, such as a recording: it begins with {_short(line)}"
    return f"it begins with {_short(line)}"


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        keys = [k for k, _ in pairs]
        twice = next(k for k in found if keys.count(k) > 1)
        raise ValueError(f"the key {_short(twice)} appears twice in one table")
    return found


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a number")


def _whole(digits: str) -> int:
    if len(digits) > _DIGITS:
        raise ValueError(f"{digits[:_DIGITS]}...: an integer with {len(digits):,} digits; at most {_DIGITS} are read")
    return int(digits)


def _check_kind(kind: Format, content: Any, source: str) -> None:
    found = content.get("format") if isinstance(content, dict) else None
    if found != kind.name:
        no, other = f"{source}: not a {kind.words}", _KNOWN.get(found) if isinstance(found, str) else None
        if other is not None:
            raise ModelFileError(
                f"{no} but a {other.words}, as '{other.command}' writes it; a {kind.words} comes from '{kind.command}'"
            )
        raise ModelFileError(
            f'{no}: it has no "format": "{kind.name}", found {_short(found) if found else "none"}; name the file that '
            f"'{kind.command}' wrote"
        )
    version = content.get("version")
    if type(version) is not int or version < 1:
        raise ModelFileError(f"{source}: {kind.words} without a version; write it again with '{kind.command}'")
    if version > kind.version:
        raise ModelFileError(
            f"{source}: written by a newer thermocomp, version {version} of a {kind.words}; this thermocomp reads "
            f"version {kind.version}: update it"
        )


# -- errors in the models ----------------------------------------------------------------------------------------------


def _tell(error: ErrorDetails, content: Any) -> str:
    message, found, context = error["msg"], error["input"], error.get("ctx", {})
    keys = list(find_keys(error["loc"], content))
    match error["type"]:
        case "value_error":
            cause = context["error"]
            message = str(cause)
            keys += cause.path if isinstance(cause, SettingError) else ()
        case "union_tag_invalid":
            kind, known = (context[k].replace("'", "") for k in ("discriminator", "expected_tags"))
            message = f"unknown {kind} {_short(context['tag'])}; expected one of {known}"
        case "union_tag_not_found":
            message = f"has no {context['discriminator']}"
        case "unexpected_keyword_argument" | "extra_forbidden":
            message = "unknown key"
        case "missing":
            keys.append(error["loc"][-1])
            message = "is missing"
        case _ if isinstance(found, str | int | float):
            message += f", found {_short(found)}"
    place = [f"model {keys[1] + 1}"] if keys[:1] == ["models"] and isinstance(keys[1], int) else []
    inner = keys[2:] if place else keys
    place += [".".join(str(k) if isinstance(k, int) or k.isidentifier() else _short(k) for k in inner)] if inner else []
    return ": ".join([*place, message])


def _short(text: object) -> str:
    """Return a text or number from a file, quoted and shortened for an error."""
    shown = ascii(text) if isinstance(text, str) and not text.isprintable() else repr(text)
    return replace_unprintable(shown if len(shown) <= _REPEATED else f"{shown[:_REPEATED]}...")
