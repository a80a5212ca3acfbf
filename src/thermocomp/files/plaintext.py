"""Small text files, read completely: limited size, no pipes or devices, UTF-8; and their error messages."""

import stat
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, with_config

from thermocomp.core.exceptions import InputError
from thermocomp.core.shown import replace_unprintable

_T = TypeVar("_T")
#: maximum number of errors listed
_LISTED = 20
#: maximum number of characters per error
_MOST = 600


def read_text(path: str | Path, what: str, most: int, failure: type[InputError] = InputError) -> str:
    """Return the text of a small UTF-8 file; raise an error that names the file and the fault."""
    source = Path(path)
    try:
        if not stat.S_ISREG(source.stat().st_mode):
            raise failure(f"{source}: this cannot be read as a {what}: it is a folder, a pipe or a device")
        with source.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise failure(f"{source}: the file cannot be read as a {what}: it has more than {most:,} bytes")
        return content.decode("utf-8-sig")
    except FileNotFoundError as e:
        raise failure(f"{source}: no such {what}") from e
    except UnicodeDecodeError as e:
        found = f"it is not a text file ({e})"
        raise failure(f"{source}: the file cannot be read as a {what}: {found}; name a {what}") from e
    except OSError as e:
        raise failure(f"{source}: the file cannot be read as a {what}: {e}") from e
    except ValueError as e:  # a null character
        raise failure(f"{str(source)!a} cannot be the name of a {what}: {e}") from e


def strict_adapter(kind: type[_T]) -> TypeAdapter[_T]:
    """Return the validator of a file's content: an unknown key, a number in quotes and NaN are rejected."""
    return TypeAdapter(with_config(ConfigDict(strict=True, extra="forbid", allow_inf_nan=False))(kind))


def find_keys(location: Iterable[str | int], content: Any) -> tuple[str | int, ...]:
    """Return the keys of an error's location that are in the content; the others are members of a union."""
    keys = []
    for key in location:
        try:
            content = content[key]
        except (KeyError, IndexError, TypeError):
            continue
        keys.append(key)
    return tuple(keys)


def list_errors(source: str | Path, errors: Sequence[str]) -> str:
    """Return one printable text of all errors of a file, up to `_LISTED`."""
    told = [replace_unprintable(e if len(e) <= _MOST else f"{e[:_MOST]}...") for e in dict.fromkeys(errors)]
    if len(told) == 1:
        return f"{source}: {told[0]}"
    more = [f"and {len(told) - _LISTED:,} more"] if len(told) > _LISTED else []
    return "\n  ".join([f"{source}: {len(told):,} errors", *told[:_LISTED], *more])
