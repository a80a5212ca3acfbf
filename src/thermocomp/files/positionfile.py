"""Position models as JSON: versioned, bit-exact, damaged or unknown files refused."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config

from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile, Profile, SplineProfile
from thermocomp.core.provenance import Provenance
from thermocomp.files import jsonfile, modelfile

#: as it stands in the file
FORMAT = jsonfile.POSITION_MODELS.name
#: every kind of profile that a file may hold
PROFILES: dict[str, type[Profile]] = {p.kind: p for p in (PolynomialProfile, SplineProfile)}
_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)


@with_config(_CONFIG)
@dataclass(frozen=True)
class _Header:
    """What a position model has besides profile and models of time."""

    target: str
    unit: Literal["um", "urad"]
    axis: str
    travel: tuple[float, float]
    reference_position: float
    provenance: Provenance | None


_HEADER = TypeAdapter(_Header)
_ADAPTERS: dict[str, TypeAdapter[Profile]] = {k: TypeAdapter(with_config(_CONFIG)(p)) for k, p in PROFILES.items()}


def dumps(models: Sequence[PositionModel]) -> str:
    """Return position models as the text of a file.

    Floats are written so that reading gives the same bits.

    Raises
    ------
    ModelFileError
        A model of time is of a family that no file holds.
    """
    return jsonfile.pack(jsonfile.POSITION_MODELS, [_entry(m) for m in models])


def loads(text: str, source: str = "position model") -> tuple[PositionModel, ...]:
    """Read the text of a file of position models.

    Parameters
    ----------
    text : str
    source : str
        What to call it in an error.

    Returns
    -------
    tuple of PositionModel

    Raises
    ------
    ModelFileError
        Not JSON, no position model, of another version, altered or incomplete.
    """
    body = jsonfile.unpack(jsonfile.POSITION_MODELS, text, source)
    return tuple(_model(entry, f"{source}: model {k}") for k, entry in enumerate(body, start=1))


def write(models: Sequence[PositionModel], path: str | Path, *, overwrite: bool = False) -> None:
    """Write position models to a file.

    Raises
    ------
    InputError
        The file exists and `overwrite` is False.
    """
    jsonfile.write(dumps(models), path, overwrite=overwrite)


def read(path: str | Path) -> tuple[PositionModel, ...]:
    """Read a file of position models.

    Raises
    ------
    ModelFileError
        There is no such file, or it cannot be used; see `loads`.
    """
    return loads(*jsonfile.read(jsonfile.POSITION_MODELS, path))


def _entry(model: PositionModel) -> dict[str, Any]:
    return {
        "target": model.target,
        "unit": model.unit,
        "axis": model.axis,
        "travel": model.travel,
        "reference_position": model.reference_position,
        "profile": None if model.profile is None else {"kind": model.profile.kind, **asdict(model.profile)},
        "offset": None if model.offset is None else modelfile.entry_of(model.offset),
        "slopes": [modelfile.entry_of(m) for m in model.slopes],
        "provenance": None if model.provenance is None else asdict(model.provenance),
    }


def _model(entry: Any, where: str) -> PositionModel:
    if not isinstance(entry, dict):
        raise ModelFileError(f"{where}: is no table of keys")
    for key in ("profile", "offset", "slopes"):
        if key not in entry:
            raise ModelFileError(f"{where}: {key}: is missing")
    if not isinstance(entry["slopes"], list):
        raise ModelFileError(f"{where}: slopes: must be a list")
    fields = {k: v for k, v in entry.items() if k not in ("profile", "offset", "slopes")}
    try:
        header = _HEADER.validate_python(fields)
        return PositionModel(
            target=header.target,
            unit=header.unit,
            axis=header.axis,
            travel=header.travel,
            reference_position=header.reference_position,
            provenance=header.provenance,
            profile=None if entry["profile"] is None else _profile(entry["profile"], f"{where}: profile"),
            offset=None if entry["offset"] is None else modelfile.model_of(entry["offset"], f"{where}: offset"),
            slopes=tuple(modelfile.model_of(m, f"{where}: slope {k}") for k, m in enumerate(entry["slopes"], start=1)),
        )
    except ValidationError as e:
        raise jsonfile.explain_damage(e, where) from e
    except ModelFileError:
        raise
    except InputError as e:
        raise ModelFileError(f"{where}: {e}") from e


def _profile(entry: Any, where: str) -> Profile:
    adapter = _ADAPTERS.get(str(entry.get("kind"))) if isinstance(entry, dict) else None
    if adapter is None:
        raise ModelFileError(f'{where}: its "kind" is unknown; known are {", ".join(PROFILES)}')
    fields = {k: v for k, v in entry.items() if k != "kind"}
    try:
        return adapter.validate_python(fields)
    except ValidationError as e:
        raise jsonfile.explain_damage(e, where) from e
    except InputError as e:
        raise ModelFileError(f"{where}: {e}") from e
