"""Common part of the settings files: TOML, and its error messages."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from thermocomp.core.exceptions import InputError
from thermocomp.files.plaintext import read_text

#: maximum size of a file [bytes]: a mapping of 10,000 columns has one million
MOST = 1_500_000
#: maximum number of dots in a key: the time and memory of the standard library's reader grow with its square
DOTS = 32
#: maximum nesting depth of tables and lists
DEPTH = 32


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Return the content of a TOML file; raise an error with the position of a fault."""
    source = Path(path)
    text = read_text(source, what, MOST)
    for n, line in enumerate(text.splitlines(), start=1):
        parts = () if line.lstrip().startswith("#") else re.split(r"[,\[\]{}]", line)
        if any(part.count(".") > DOTS for part in parts):
            raise InputError(f"{source}: line {n}: a key with more than {DOTS} parts; shorten it")
    try:
        content = tomllib.loads(text)
        if _depth(content) > DEPTH:
            raise RecursionError
        return content
    except RecursionError as e:
        raise InputError(f"{source}: not a {what}: nested too deeply") from e
    except ValueError as e:  # TOMLDecodeError, or an integer with too many digits
        raise InputError(f"{source}: not valid TOML: {e}") from e


def _depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max(map(_depth, inner), default=0)


def as_json(content: dict[str, Any]) -> str:
    """Return TOML content as JSON for strict validation by pydantic: lists match tuples, text does not match numbers.

    A date, which JSON does not support, becomes a list, so that it never passes as text.
    """
    return json.dumps(content, default=lambda date: [str(date)])
