"""What the files of settings share: TOML, and what is said if it is none."""

import tomllib
from pathlib import Path
from typing import Any

from thermocomp.core.exceptions import InputError


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : str or Path
    what : str
        What to call it, such as ``machine file``.

    Returns
    -------
    dict
        Its content.

    Raises
    ------
    InputError
        No such file, no text, or not TOML; the message names the file.
    """
    try:
        return tomllib.loads(read_text(path, what))
    except tomllib.TOMLDecodeError as e:
        raise InputError(f"{path}: not valid TOML: {e}") from e


def read_text(path: str | Path, what: str) -> str:
    """Read the text of a file of settings.

    Raises
    ------
    InputError
        No such file, or no text.
    """
    source = Path(path)
    try:
        return source.read_text(encoding="utf-8-sig")
    except FileNotFoundError as e:
        raise InputError(f"{source}: no such {what}") from e
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{source}: cannot be read as a {what}: {e}") from e
