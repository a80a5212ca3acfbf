"""Models as JSON: versioned, bit-exact, damaged or unknown files refused."""

from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
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
from thermocomp.files import jsonfile

#: as it stands in the file
FORMAT = jsonfile.MODELS.name
#: every family that a file may hold
FAMILIES: dict[str, type[ErrorModel]] = {
    f.family: f for f in (Polynomial, LinearDynamic, Network, Additive, Autoregressive, AutoregressiveNet)
}


@cache
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
    return jsonfile.pack(jsonfile.MODELS, [entry_of(m) for m in models])


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
    body = jsonfile.unpack(jsonfile.MODELS, text, source)
    return tuple(model_of(entry, f"{source}: model {k}") for k, entry in enumerate(body, start=1))


def write(models: Sequence[ErrorModel], path: str | Path, *, overwrite: bool = False) -> None:
    """Write models to a file.

    Raises
    ------
    InputError
        The file exists and `overwrite` is False.
    """
    jsonfile.write(dumps(models), path, overwrite=overwrite)


def read(path: str | Path) -> tuple[ErrorModel, ...]:
    """Read a model file.

    Raises
    ------
    ModelFileError
        There is no such file, or it cannot be used; see `loads`.
    """
    return loads(*jsonfile.read(jsonfile.MODELS, path))


def entry_of(model: ErrorModel) -> dict[str, Any]:
    """Return a model as it stands in a file.

    Raises
    ------
    ModelFileError
        It is of a family that no file holds.
    """
    if model.family not in FAMILIES:
        raise ModelFileError(
            f"model of {model.target}: the family {model.family!r} cannot be written, it is not plain numbers; "
            f"a file may hold {', '.join(FAMILIES)}"
        )
    return {"family": model.family, **asdict(model)}


def model_of(entry: Any, where: str) -> ErrorModel:
    """Return the model that stands in a file.

    Raises
    ------
    ModelFileError
        It is none; the message begins with `where`.
    """
    if not isinstance(entry, dict) or not isinstance(entry.get("family"), str):
        raise ModelFileError(f'{where}: has no "family"')
    family = FAMILIES.get(entry["family"])
    if family is None:
        raise ModelFileError(f"{where}: unknown family {entry['family']!r}; known are {', '.join(FAMILIES)}")
    fields = {k: v for k, v in entry.items() if k != "family"}
    try:
        return _adapter(family).validate_python(fields)
    except ValidationError as e:
        raise jsonfile.explain_damage(e, where) from e
    except InputError as e:
        raise ModelFileError(f"{where}: {e}") from e
