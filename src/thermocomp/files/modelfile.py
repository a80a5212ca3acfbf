"""Models as JSON: versioned and bit-exact; damaged or unknown files are rejected."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import Discriminator

from thermocomp.core.additive import Additive
from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet
from thermocomp.core.exceptions import ModelFileError
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Network
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.provenance import accepted
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.watch import Watch
from thermocomp.files import jsonfile

#: all families that a file can contain
Family = Polynomial | LinearDynamic | PacedDynamic | Network | Additive | Autoregressive | AutoregressiveNet
#: entry of a file, distinguished by its ``family``
Entry = Annotated[Family, Discriminator("family")]
FAMILIES: dict[str, type[ErrorModel]] = {f.family: f for f in get_args(Family)}


def dumps(models: Sequence[ErrorModel]) -> str:
    """Return models as the text of a model file.

    Floats are written such that reading restores them bit for bit.

    Raises
    ------
    ModelFileError
        A model belongs to a family that cannot be stored, such as a Gaussian process, which has no coefficients; or two
        models have different watches (sensor monitoring) or thresholds.
    """
    _check_judged(models, "model file")
    watch = next((m.watch for m in models if m.watch is not None), None)
    if any(m.watch != watch or m.thresholds != models[0].thresholds for m in models):
        raise ModelFileError(
            "model file: its models have different watches (sensor monitoring) or thresholds; write them to separate "
            "files"
        )
    shared: dict[str, Any] = {} if watch is None else {"watch": watch_entry(watch)}
    shared["thresholds"] = asdict(models[0].thresholds if models else THRESHOLDS)
    return jsonfile.pack(jsonfile.MODELS, [entry_of(m) for m in models], shared)


def loads(text: str, source: str = "model") -> tuple[ErrorModel, ...]:
    """Read the text of a model file.

    Parameters
    ----------
    text : str
    source : str
        Name of the source in an error.

    Raises
    ------
    ModelFileError
        Not JSON, not a model file, of a newer version, altered or incomplete; the message lists all faults.
    """
    found = jsonfile.unpack(jsonfile.MODELS, Entry, text, source, watch=Watch, thresholds=Thresholds)
    if any(m.watch is not None for m in found.models):
        raise ModelFileError(
            f"{source}: a watch (sensor monitoring) is stored inside a model; it must be stored once in the file, "
            "next to the models"
        )
    thresholds = found.thresholds or THRESHOLDS  # files of versions before they were stored
    watch = replace(found.watch, thresholds=thresholds) if found.watch else None
    models = tuple(replace(m, watch=watch, thresholds=thresholds) for m in found.models)
    _check_judged(models, source)
    return models


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
        The file does not exist or cannot be used; see `loads`.
    """
    return loads(*jsonfile.read(jsonfile.MODELS, path))


def entry_of(model: ErrorModel) -> dict[str, Any]:
    """Return a model as stored in a file.

    Raises
    ------
    ModelFileError
        The family of the model cannot be stored.
    """
    if model.family not in FAMILIES:
        raise ModelFileError(
            f"model of {model.target}: the family {model.family!r} cannot be stored as coefficients; "
            f"a file may hold {', '.join(FAMILIES)}"
        )
    entry = asdict(replace(model, watch=None))
    del entry["watch"], entry["thresholds"]  # stored once per file
    prints = entry["provenance"] and entry["provenance"]["prints"]
    for name in ("excerpts", "curves"):
        if prints and not prints[name]:
            del prints[name]  # as in a file from before there were any
    return drop_unused(entry)


def drop_unused(entry: dict[str, Any]) -> dict[str, Any]:
    """Remove fields of a model that have no effect and that files of earlier versions lack: its hash is the same."""
    if entry["band"] and not entry["band"]["widening"]:
        del entry["band"]["widening"]
    if entry["validity"] and entry["validity"]["axes"] == "not recorded":
        del entry["validity"]["axes"]
    for part, names in (("provenance", ("clocks", "tests")), ("honest_error", ("noise", "scatter"))):
        for name in names if entry[part] else ():
            if not entry[part][name]:
                del entry[part][name]
    return entry


def watch_entry(watch: Watch) -> dict[str, Any]:
    """Return a watch as stored in a file."""
    entry = asdict(watch)
    del entry["thresholds"]  # stored once per file
    if entry["repeats"] == 1.0 and not any(s["frozen"] for s in entry["sensors"]):
        del entry["repeats"]  # as in a file from before these numbers
        for sensor in entry["sensors"]:
            del sensor["frozen"]
    if not any(s["step"] for s in entry["sensors"]):
        for sensor in entry["sensors"]:
            del sensor["step"]
    return {k: v for k, v in entry.items() if v or k not in ("checks", "speed_faults")}


def _check_judged(models: Sequence[ErrorModel], source: str) -> None:
    """Reject a verdict inconsistent with the stored errors; that of a position model covers several factors."""
    for k, model in enumerate(models, start=1):
        found = model.honest_error
        if found is None:
            continue
        if accepted(found.verdict) and found.current and not (found.units and found.cycles):
            raise ModelFileError(f"{source}: model {k}: honest_error: accepted, but never judged: the file was altered")
        if found.taken and not all(part.strip() for part in (*found.taken.split(",", 1), "")[:2]):
            raise ModelFileError(
                f"{source}: model {k}: honest_error: taken by {found.taken[:60]!a}: expected a name and a reason"
            )
        if accepted(found.verdict) and found.rms > found.none_rms:
            raise ModelFileError(
                f"{source}: model {k}: honest_error: accepted with an RMS of {found.rms:g} {model.unit}, above the "
                f"{found.none_rms:g} {model.unit} without compensation: the file was altered"
            )
