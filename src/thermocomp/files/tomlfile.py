"""Common part of the settings files: TOML, and its error messages."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from thermocomp.core.exceptions import InputError
from thermocomp.files.plaintext import read_text

#: bytes of a file: a mapping of 10,000 columns has one million
MOST = 1_500_000
#: dots of a key: the standard library's reader takes time and memory by their square
DOTS = 32
#: tables and lists within each other
DEPTH = 32


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : str or Path
    what : str
        Name of the kind of file, such as ``machine file``.

    Returns
    -------
    dict
        Its content.

    Raises
    ------
    InputError
        No such file, too large, no text, or not TOML; the message names the file.
    """
    source = Path(path)
    text = read_text(source, what, MOST)
    for n, line in enumerate(text.splitlines(), start=1):
        parts = () if line.lstrip().startswith("#") else re.split(r"[,\[\]{}]", line)
        if any(part.count(".") > DOTS for part in parts):
            raise InputError(f"{source}: line {n}: a key of more than {DOTS} parts")
    try:
        content = tomllib.loads(text)
        if _depth(content) > DEPTH:
            raise RecursionError
        return content
    except RecursionError as e:
        raise InputError(f"{source}: not a {what}: nested too deeply") from e
    except ValueError as e:  # TOMLDecodeError, and an integer of too many digits
        raise InputError(f"{source}: not valid TOML: {e}") from e


def _depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max(map(_depth, inner), default=0)


def as_json(content: dict[str, Any]) -> str:
    """Return the content of a TOML file for strict validation by pydantic: a list for a tuple, no text for a number.

    A date, which JSON has not, becomes a list: nothing that takes a text takes it.
    """
    return json.dumps(content, default=lambda date: [str(date)])
