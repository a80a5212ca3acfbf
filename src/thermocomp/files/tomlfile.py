"""What the files of settings share: TOML, and what is said if it is none."""

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
        No such file, too large, no text, or not TOML; the message names the file.
    """
    source = Path(path)
    text = read_text(source, what, MOST)
    for n, line in enumerate(text.splitlines(), start=1):
        parts = () if line.lstrip().startswith("#") else re.split(r"[,\[\]{}]", line)
        if any(part.count(".") > DOTS for part in parts):
            raise InputError(f"{source}: line {n}: a key of more than {DOTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as e:
        raise InputError(f"{source}: not a {what}: nested too deeply") from e
    except ValueError as e:  # TOMLDecodeError, and an integer of too many digits
        raise InputError(f"{source}: not valid TOML: {e}") from e
