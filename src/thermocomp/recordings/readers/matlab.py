"""MAT files of MATLAB (versions 4 to 7.3), read by mat-io: tables, timetables, structs, vectors and matrices."""

import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.hdf5 import check_heaps, check_references
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import FrameTable
from thermocomp.recordings.readers.vectors import Vector, as_columns, make_table, number_to_stamp, translated

#: days since the year 0 (``datenum``), of 1980 to 2100; and 1970
_DAYS, _ORIGIN = (723_181.0, 767_011.0), 719_529.0
#: fields of a struct that is one channel (dSPACE, Simulink): its values, its name, its unit
_DATA, _NAME, _UNIT = ("Data", "data", "values"), ("Name", "name", "label"), ("Unit", "unit", "Units", "units")
_HEADER, _COMPRESSED, _BLOCK = 128, 15, 1 << 20


def open_matlab(path: Path, options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Read a table of a MAT file, after a check of its unpacked size."""
    with translated(path, "a MAT file", "matio"):
        import h5py

        if h5py.is_hdf5(path):
            check_heaps(path)
            with h5py.File(path, "r", locking=False) as file:
                check_references(file, path, limits)
        else:
            _check_unpacked(path, limits)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an option of pandas, of a time zone that is left out
            from matio import load_from_mat

            found = load_from_mat(path, add_table_attrs=True)
        vectors = list(_collect("/", {k: v for k, v in found.items() if not k.startswith("__")}))
        limits.check("columns", len(vectors), path)
        return make_table(path, vectors, options, limits)


def _check_unpacked(path: Path, limits: FileLimits) -> None:
    """Reject a file of version 5 whose compressed variables are too large, or that ends within one."""
    size = path.stat().st_size
    with path.open("rb") as f:
        order = f.read(_HEADER)[126:]
        if order not in (b"IM", b"MI"):
            return  # version 4, which is not compressed
        unpacked = 0
        while tag := f.read(8):
            kind, length = (int.from_bytes(tag[k : k + 4], "little" if order == b"IM" else "big") for k in (0, 4))
            end = f.tell() + length
            if end > size:
                raise RecordingError(f"{path}: the file ends within a variable; save it again")
            inflater = zlib.decompressobj()
            while kind == _COMPRESSED and f.tell() < end:
                block = f.read(min(_BLOCK, end - f.tell()))
                while block:
                    unpacked += len(inflater.decompress(block, _BLOCK))
                    limits.check_unpacked(unpacked, path)
                    block = inflater.unconsumed_tail
            unpacked += length if kind != _COMPRESSED else 0
            f.seek(end)


def _collect(group: str, fields: dict[str, Any]) -> Iterator[Vector]:
    """Yield the vectors of the variables of a file, or of the fields of a struct."""
    texts = [(key, found) for key, found in ((k, _texts(v)) for k, v in fields.items()) if found]
    for name, value in fields.items():
        inner = name if group == "/" else f"{group}.{name}"
        if isinstance(value, pd.DataFrame):
            yield from _table(inner, value)
        elif not isinstance(value, np.ndarray) or not value.size:
            continue
        elif value.dtype.names or (value.dtype == object and all(_is_struct(v) for v in value.flat)):
            structs = [_fields(v) for v in value.flat]
            channels = [_channel(s) for s in structs]
            if all(channels):
                for channel in filter(None, channels):
                    yield from _matrix(group, *channel, texts)
            elif len(structs) == 1:
                yield from _collect(inner, structs[0])
        elif value.dtype.kind in "fiubmM" and value.ndim == 2:
            yield from _matrix(group, name, value, "", texts)
        elif value.ndim == 1 or (value.ndim == 2 and min(value.shape) == 1):
            found = _texts(value)
            yield from [_vector(group, name, np.array(found, dtype=object), "")] if found else ()


def _is_struct(value: object) -> bool:
    return isinstance(value, np.void) or (isinstance(value, np.ndarray) and bool(value.dtype.names) and value.size == 1)


def _fields(struct: Any) -> dict[str, Any]:
    one = struct if isinstance(struct, np.void) else struct.flat[0]
    return {name: one[name] for name in one.dtype.names or ()}


def _channel(struct: dict[str, Any]) -> tuple[str, NDArray[Any], str] | None:
    """Return name, values and unit of a struct that is one channel."""
    data, name, unit = (next((struct[k] for k in keys if k in struct), None) for keys in (_DATA, _NAME, _UNIT))
    if not isinstance(data, np.ndarray) or data.dtype.kind not in "fiu" or data.ndim != 2 or name is None:
        return None
    said, meant = (next(iter(_texts(part)), "") for part in (name, unit))
    return (said.strip(), data, meant.strip("[] ")) if said else None


def _matrix(
    group: str, name: str, value: NDArray[Any], unit: str, texts: list[tuple[str, list[str]]]
) -> Iterator[Vector]:
    shape = (value.shape[0], value.shape[1])
    for label, index in as_columns(name, shape, texts):
        yield _vector(group, label, value[index], unit)


def _table(group: str, table: pd.DataFrame) -> Iterator[Vector]:
    """Yield the columns of a table or timetable, the times of its rows first."""
    units = [*(table.attrs.get("VariableUnits") or table.attrs.get("varUnits") or ())]
    units += [""] * (len(table.columns) - len(units))
    if table.index.dtype.kind in "mM":
        yield _vector(group, str(table.index.name or "Time"), table.index.to_numpy(), "")
    for (name, cells), unit in zip(table.items(), units, strict=False):
        values = cells.to_numpy()
        if values.dtype.kind in "fiubmM" or _texts(values):
            yield _vector(group, str(name), values, str(unit).strip("[] "))


def _vector(group: str, name: str, values: NDArray[Any], unit: str) -> Vector:
    values = number_to_stamp(values, _DAYS, _ORIGIN, 86_400.0)
    return Vector(group=group, name=name, unit=unit, size=len(values), load=lambda: values, kind=values.dtype.kind)


def _texts(value: object) -> list[str]:
    """Return the texts of a cell array or of an array of strings; none if it holds anything else."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "OUT":
        return []
    cells = [c.item() if isinstance(c, np.ndarray) and c.size == 1 else c for c in value.flat]
    return cells if all(isinstance(c, str) for c in cells) else []
