"""What the files of models share: JSON with a format, a version and a checksum."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from thermocomp.core.draft import write_text
from thermocomp.core.exceptions import ModelFileError


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Parameters
    ----------
    name : str
        As it stands in the file.
    version : int
    words : str
        What to call it.
    command : str
        What writes it.
    """

    name: str
    version: int
    words: str
    command: str


MODELS = Format("thermocomp-model", 1, "model file", "thermocomp fit")
POSITION_MODELS = Format("thermocomp-position-model", 1, "position model file", "thermocomp position")
_KNOWN = {f.name: f for f in (MODELS, POSITION_MODELS)}


def pack(kind: Format, body: list[Any]) -> str:
    """Return the text of a file; floats are written so that reading gives the same bits.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    content = {"format": kind.name, "version": kind.version, "sha256": digest(body), "models": body}
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def unpack(kind: Format, text: str, source: str) -> list[Any]:
    """Return the models in the text of a file, not yet understood.

    Parameters
    ----------
    kind : Format
        What it must be.
    text : str
    source : str
        What to call it in an error.

    Raises
    ------
    ModelFileError
        Not JSON, of another kind or version, altered or incomplete.
    """
    no = f"{source}: not a {kind.words}"
    try:
        content = json.loads(text)
    except RecursionError as e:
        raise ModelFileError(f"{no}: nested too deeply") from e
    except json.JSONDecodeError as e:
        where = f"line {e.lineno}, column {e.colno}"
        if e.pos >= len(text.rstrip()) - 1 or "Unterminated" in e.msg:
            raise ModelFileError(f"{source}: the file ends in the middle ({where}); copy it again, completely") from e
        raise ModelFileError(f"{no}: {e.msg} at {where}") from e
    found = content.get("format") if isinstance(content, dict) else None
    if found != kind.name:
        other = _KNOWN.get(found) if isinstance(found, str) else None
        if other is not None:
            raise ModelFileError(
                f"{no} but a {other.words}, as '{other.command}' writes it; a {kind.words} comes from '{kind.command}'"
            )
        raise ModelFileError(f'{no}: it has no "format": "{kind.name}"')
    if content.get("version") != kind.version:
        raise ModelFileError(
            f"{source}: {kind.words} version {content.get('version')!r}; this thermocomp reads version {kind.version}"
        )
    body = content.get("models")
    if not isinstance(body, list) or not body:
        raise ModelFileError(f"{source}: holds no model")
    if content.get("sha256") != digest(body):
        raise ModelFileError(
            f"{source}: its numbers do not match its checksum: the file was altered or damaged; write it anew with "
            f"'{kind.command}'"
        )
    return body


def write(text: str, path: str | Path, *, overwrite: bool) -> None:
    """Write the text of a file.

    Raises
    ------
    InputError
        See `thermocomp.core.draft.drafts`.
    """
    write_text(text, Path(path), overwrite=overwrite)


def read(kind: Format, path: str | Path) -> tuple[str, str]:
    """Return the text of a file, and what to call it.

    Raises
    ------
    ModelFileError
        There is no such file, or it is no text.
    """
    source = Path(path)
    try:
        return source.read_text(encoding="utf-8"), str(source)
    except FileNotFoundError as e:
        raise ModelFileError(f"{source}: no such file") from e
    except (OSError, UnicodeDecodeError) as e:
        raise ModelFileError(f"{source}: cannot be read as a {kind.words}: {e}") from e


def digest(body: list[Any]) -> str:
    """Return the SHA-256 of models as they stand in a file."""
    canonical = json.dumps(body, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def explain_damage(failure: ValidationError, where: str) -> ModelFileError:
    """Return the error that tells the place of pydantic's first one."""
    first = failure.errors()[0]
    place = ".".join(str(p) for p in first["loc"])
    return ModelFileError(f"{where}: {place}: {first['msg']}")
