"""Models as JSON: versioned, bit-exact, damaged or unknown files refused."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config

from thermocomp.core.additive import Additive
from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet
from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Network
from thermocomp.core.polynomial import Polynomial
from thermocomp.files.draft import draft

FORMAT = "thermocomp-model"
VERSION = 1

#: every family that a file may hold
FAMILIES: dict[str, type[ErrorModel]] = {
    f.family: f for f in (Polynomial, LinearDynamic, Network, Additive, Autoregressive, AutoregressiveNet)
}


def _adapter(family: type[ErrorModel]) -> TypeAdapter[ErrorModel]:
    # Strict numbers: "1.0" in quotes or a missing field is damage, not something to guess at.
    return TypeAdapter(with_config(ConfigDict(extra="forbid", allow_inf_nan=False))(family))


def dumps(models: Sequence[ErrorModel]) -> str:
    """Return models as the text of a model file.

    Floats are written so that reading gives the same bits.

    Raises
    ------
    ModelFileError
        A model is of a family that no file holds: not plain numbers, such as a Gaussian process.
    """
    for m in models:
        if m.family not in FAMILIES:
            raise ModelFileError(
                f"model of {m.target}: the family {m.family!r} cannot be written, it is not plain numbers; "
                f"a file may hold {', '.join(FAMILIES)}"
            )
    body = [{"family": m.family, **asdict(m)} for m in models]
    content = {"format": FORMAT, "version": VERSION, "sha256": _digest(body), "models": body}
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def loads(text: str, source: str = "model") -> tuple[ErrorModel, ...]:
    """Read the text of a model file.

    Parameters
    ----------
    text : str
    source : str
        What to call it in an error.

    Returns
    -------
    tuple of ErrorModel

    Raises
    ------
    ModelFileError
        Not JSON, not a model file, of another version, altered or incomplete.
    """
    try:
        content = json.loads(text)
    except RecursionError as e:
        raise ModelFileError(f"{source}: not a model file: nested too deeply") from e
    except json.JSONDecodeError as e:
        where = f"line {e.lineno}, column {e.colno}"
        if e.pos >= len(text.rstrip()) - 1 or "Unterminated" in e.msg:
            raise ModelFileError(f"{source}: the file ends in the middle ({where}); copy it again, completely") from e
        raise ModelFileError(f"{source}: not a model file: {e.msg} at {where}") from e
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ModelFileError(f'{source}: not a model file: it has no "format": "{FORMAT}"')
    if content.get("version") != VERSION:
        raise ModelFileError(
            f"{source}: model file version {content.get('version')!r}; this thermocomp reads version {VERSION}"
        )
    body = content.get("models")
    if not isinstance(body, list) or not body:
        raise ModelFileError(f"{source}: holds no model")
    if content.get("sha256") != _digest(body):
        raise ModelFileError(
            f"{source}: its numbers do not match its checksum: the file was altered or damaged; write it anew with "
            "'thermocomp fit'"
        )
    return tuple(_model(entry, f"{source}: model {k}") for k, entry in enumerate(body, start=1))


def write(models: Sequence[ErrorModel], path: str | Path, *, overwrite: bool = False) -> None:
    """Write models to a file.

    Raises
    ------
    InputError
        The file exists and `overwrite` is False.
    """
    target = Path(path)
    if target.exists() and not overwrite:
        raise InputError(f"{target}: exists already; choose another name or allow overwriting with --overwrite")
    text = dumps(models)
    with draft(target) as started:
        started.write_text(text, encoding="utf-8")


def read(path: str | Path) -> tuple[ErrorModel, ...]:
    """Read a model file.

    Raises
    ------
    ModelFileError
        There is no such file, or it cannot be used; see `loads`.
    """
    source = Path(path)
    try:
        text = source.read_text(encoding="utf-8")
    except FileNotFoundError as e:
        raise ModelFileError(f"{source}: no such file") from e
    except (OSError, UnicodeDecodeError) as e:
        raise ModelFileError(f"{source}: cannot be read as a model file: {e}") from e
    return loads(text, str(source))


def _digest(body: list[Any]) -> str:
    canonical = json.dumps(body, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _model(entry: Any, where: str) -> ErrorModel:
    if not isinstance(entry, dict) or not isinstance(entry.get("family"), str):
        raise ModelFileError(f'{where}: has no "family"')
    family = FAMILIES.get(entry["family"])
    if family is None:
        raise ModelFileError(f"{where}: unknown family {entry['family']!r}; known are {', '.join(FAMILIES)}")
    fields = {k: v for k, v in entry.items() if k != "family"}
    try:
        return _adapter(family).validate_python(fields)
    except ValidationError as e:
        first = e.errors()[0]
        place = ".".join(str(p) for p in first["loc"])
        raise ModelFileError(f"{where}: {place}: {first['msg']}") from e
    except InputError as e:
        raise ModelFileError(f"{where}: {e}") from e
