"""Position models as JSON: versioned and bit-exact; damaged or unknown files are rejected."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated

from pydantic import Discriminator

from thermocomp.core.position import PositionModel
from thermocomp.core.profile import Profile
from thermocomp.core.provenance import Provenance
from thermocomp.files import jsonfile, modelfile


@dataclass(frozen=True, kw_only=True)
class _Entry(PositionModel):
    """A position model as stored in a file: no key may be missing, and its parts specify their types."""

    reference_position: float = field()
    profile: Annotated[Profile, Discriminator("kind")] | None = field()
    offset: modelfile.Entry | None = field()
    slopes: tuple[modelfile.Entry, ...] = field()
    provenance: Provenance | None = field()


def dumps(models: Sequence[PositionModel]) -> str:
    """Return position models as the text of a file.

    Floats are written such that reading restores them bit for bit.
    """
    for model in models:
        for part in model.models:
            modelfile.entry_of(part)  # raises an error if the family cannot be stored
    return jsonfile.pack(jsonfile.POSITION_MODELS, [asdict(m) for m in models])


def loads(text: str, source: str = "position model") -> tuple[PositionModel, ...]:
    """Read the text of a file of position models."""
    entries = jsonfile.unpack(jsonfile.POSITION_MODELS, _Entry, text, source).models
    return tuple(PositionModel(**{f.name: getattr(e, f.name) for f in fields(e)}) for e in entries)


def write(models: Sequence[PositionModel], path: str | Path, *, overwrite: bool = False) -> None:
    """Write position models to a file."""
    jsonfile.write(dumps(models), path, overwrite=overwrite)


def read(path: str | Path) -> tuple[PositionModel, ...]:
    """Read a file of position models."""
    return loads(*jsonfile.read(jsonfile.POSITION_MODELS, path))
