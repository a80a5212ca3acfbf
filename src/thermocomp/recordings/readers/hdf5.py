"""HDF5 files, read by h5py: the datasets of a group, the columns of a matrix, or the fields of a compound dataset."""

import struct
from collections.abc import Iterator, Sequence
from functools import partial
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import FrameTable
from thermocomp.recordings.readers.vectors import (
    Vector,
    as_columns,
    find_unit_text,
    find_waveform,
    make_table,
    translated,
)

if TYPE_CHECKING:
    from h5py import Dataset, File

_UNITS = ("unit_string", "units", "unit", "Units", "Unit")
#: attributes that name the columns of a matrix
_NAMES = ("columns", "column_names", "names", "channels", "channel_names", "labels")
#: texts in memory at the same time [byte]
_TEXTS = 64 << 20
#: start of a global heap (HDF5 File Format Specification 3.0, III.E), version 1; head of an object: number, size [byte]
_HEAP, _OBJECT = b"GCOL\x01\0\0\0", struct.Struct("<H6xQ")


def open_hdf5(path: Path, options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Read a table of an HDF5 file. Links to other files are not followed."""
    with translated(path, "an HDF5 file", "h5py"):
        from h5py import Dataset, File

        check_heaps(path)
        with File(path, "r", locking=False) as file:
            found: list[Dataset] = []

            def keep(_: str, item: object) -> None:
                if isinstance(item, Dataset) and item.shape and not item.is_virtual and not item.external:
                    limits.check("columns", len(found) + 1, path)
                    found.append(item)

            file.visititems(keep)
            if any("table" in _text(d.parent.attrs.get("pandas_type", b"")) for d in found):
                raise RecordingError(
                    f"{path}: written by pandas in its table format, whose names of columns only pandas reads; write "
                    "the data frame with to_parquet, or with format='fixed'"
                )
            texts = _read_lists(found, path, limits)
            vectors = [v for d in found for v in _split(d, texts, path, limits)]
            return make_table(path, vectors, options, limits)


def _split(
    dataset: "Dataset", texts: dict[str, list[tuple[str, list[str]]]], path: Path, limits: FileLimits
) -> Iterator[Vector]:
    """Yield the vectors of a dataset."""
    group, name = _place(dataset)
    said = next((dataset.attrs[key] for key in _UNITS if key in dataset.attrs), "")
    unit, kind = find_unit_text(said), _kind(dataset.dtype)
    if dataset.dtype.names and dataset.ndim == 1:
        for field in dataset.dtype.names:
            inner = dataset.dtype[field]
            if inner.subdtype is None and _kind(inner) in "fiubS":
                load = partial(_load, dataset, field)
                yield Vector(group=dataset.name, name=field, size=dataset.size, load=load, kind=_kind(inner))
    elif dataset.ndim == 2 and kind in "fiu" and min(dataset.shape) <= limits.columns:
        named = [(name, _texts(dataset.attrs[key])) for key in _NAMES if key in dataset.attrs]
        units = _texts(said)
        size, columns = max(dataset.shape), as_columns(name, dataset.shape, named or texts.get(group, []))
        for k, (label, index) in enumerate(columns):
            own = units[k].strip("[] ") if len(units) == len(columns) else unit
            load = partial(_load, dataset, index)
            yield Vector(group=group, name=label, unit=own, size=size, load=load, kind=kind)
    elif dataset.ndim == 1 and kind in "OS":
        load = partial(_load_texts, dataset, path, limits)
        yield Vector(group=group, name=name, size=dataset.size, load=load, kind="O")
    elif dataset.ndim == 1 and kind in "fiub":
        stamps = _text(dataset.attrs.get("kind", b"")).startswith("datetime64")  # an index of pandas
        load = partial(_load_stamps, dataset) if stamps else partial(_load, dataset, ())
        whole = {"size": dataset.size, "load": load, "kind": "M" if stamps else kind}
        yield Vector(group=group, name=name, unit=unit, **whole, **find_waveform({} if stamps else dataset.attrs))


def _place(dataset: "Dataset") -> tuple[str, str]:
    group, _, name = dataset.name.rpartition("/")
    return group or "/", name


def _read_lists(found: "Sequence[Dataset]", path: Path, limits: FileLimits) -> dict[str, list[tuple[str, list[str]]]]:
    """Return the short lists of texts of each group, which may name the columns of a matrix."""
    lists: dict[str, list[tuple[str, list[str]]]] = {}
    for d in found:
        if d.ndim == 1 and _kind(d.dtype) in "OS" and d.size <= limits.columns:
            group, name = _place(d)
            lists.setdefault(group, []).append((name, list(_load_texts(d, path, limits))))
    return lists


def _kind(dtype: "np.dtype[Any]") -> str:
    """Return the kind of a type; ``O`` for texts of any length, ``?`` for what is not read, such as references."""
    from h5py import check_string_dtype

    return ("O" if check_string_dtype(dtype) else "?") if dtype.kind in "OS" else dtype.kind


def _text(said: object) -> str:
    return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)


def _texts(said: Any) -> list[str]:
    return [_text(part) for part in np.ravel(said)]


def _load(dataset: "Dataset", field: Any) -> NDArray[Any]:
    values = np.asarray(dataset[field])
    return np.array([_text(v) for v in values], dtype=object) if values.dtype.kind in "OS" else values


def _load_stamps(dataset: "Dataset") -> NDArray[Any]:
    return np.asarray(dataset[()]).astype(np.int64).astype("M8[ns]")


def _load_texts(dataset: "Dataset", path: Path, limits: FileLimits) -> NDArray[Any]:
    """Return texts, read in parts: many may refer to one long text of the file.

    A damaged length of a text makes HDF5 allocate up to 4 GiB for a moment, before it refuses the file.
    """
    part = max(_TEXTS // max(path.stat().st_size, dataset.dtype.itemsize, 1), 100)
    found: list[str] = []
    size = 0
    for first in range(0, dataset.size, part):
        texts = [_text(t) for t in dataset[first : first + part]]
        size += sum(map(len, texts))
        limits.check_unpacked(size, path)
        found.extend(texts)
    return np.array(found, dtype=object)


def check_heaps(path: Path) -> None:
    """Reject a file with an object of a global heap that takes no space: the library would read it over and over.

    The texts of any length are in these heaps. The library cannot be interrupted from Python while it reads one.
    """
    with path.open("rb") as f, mmap(f.fileno(), 0, access=ACCESS_READ) as data:
        at = data.find(_HEAP)
        while at >= 0:
            here = at + len(_HEAP) + 8
            end = min(at + int.from_bytes(data[here - 8 : here], "little"), len(data)) - _OBJECT.size
            while here <= end:
                number, size = _OBJECT.unpack_from(data, here)
                # the size of free space (number 0) includes its head; the library adds with 64 bits
                taken = (_OBJECT.size + (size + 7) // 8 * 8) % 2**64 if number else size
                if not taken:
                    raise RecordingError(f"{path}: the file is damaged (at byte {here}); export it again")
                here += taken
            at = data.find(_HEAP, at + 1)


def check_references(file: "File", path: Path, limits: FileLimits) -> None:
    """Reject a MAT file of version 7.3 that becomes too large when its references are followed."""
    from h5py import Dataset, Group, HardLink, check_ref_dtype

    weights: dict[str, int | None] = {}

    def weigh(item: "Group | Dataset") -> int:
        name = item.name
        known = weights.setdefault(name, -1)
        if known is None:
            raise RecordingError(f"{path}: {name} refers to itself; the file is damaged, export it again")
        if known >= 0:
            return known
        weights[name] = None
        if isinstance(item, Dataset):
            if item.is_virtual or item.external:
                raise RecordingError(f"{path}: {name} is in another file; export all data to one file")
            size = item.size * item.dtype.itemsize if item.shape is not None else 0
            limits.check_unpacked(size, path)
            if check_ref_dtype(item.dtype) is not None:
                size += sum(weigh(file[r]) for r in np.ravel(item[()]) if r)
        else:
            if not all(isinstance(item.get(key, getlink=True), HardLink) for key in item):
                raise RecordingError(f"{path}: {name} is linked to another place; export all data to one file")
            size = sum(weigh(item[key]) for key in item if item[key].name != "/#refs#")
        limits.check_unpacked(size, path)
        weights[name] = size
        return size

    weigh(file["/"])
