"""TDMS files of LabVIEW, FlexLogger and DIAdem, read by npTDMS."""

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.messages import Message
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import FrameTable
from thermocomp.recordings.readers.vectors import (
    Vector,
    find_unit_text,
    find_waveform,
    make_table,
    number_to_stamp,
    translated,
)

if TYPE_CHECKING:
    from nptdms import TdmsChannel

#: seconds since 1904, as LabVIEW counts them, of 2000 to 2040; and 1970
_SECONDS, _ORIGIN = (3_029_529_600.0, 4_291_833_600.0), 2_082_844_800.0


def open_tdms(path: Path, options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Read the channels of a TDMS file: waveforms by their start and interval, others beside a channel of times."""
    with translated(path, "a TDMS file", "nptdms"):
        from nptdms import TdmsFile
        from nptdms.log import log_manager

        log_manager.set_level(logging.CRITICAL)  # it prints whole damaged files
        with path.open("rb") as f, TdmsFile.open(f) as file:
            limits.check("columns", sum(len(group.channels()) for group in file.groups()), path)
            vectors = [_vector(channel) for group in file.groups() for channel in group.channels()]
            table = make_table(path, vectors, options, limits)
            status = file.file_status
        cut_off = status.incomplete_final_segment
        return replace(table, notes=(*table.notes, Message("the file ends within a segment"))) if cut_off else table


def _vector(channel: "TdmsChannel") -> Vector:
    dtype = np.dtype(channel.dtype)
    number = dtype.kind in "fiu"
    return Vector(
        group=channel.group_name,
        name=channel.name,
        unit=find_unit_text(channel.properties.get("unit_string")),
        size=len(channel) if number or dtype.kind in "MO" else 0,
        load=partial(_load, channel),
        kind=dtype.kind,
        **find_waveform(channel.properties if number else {}),
    )


def _load(channel: "TdmsChannel") -> NDArray[Any]:
    return np.asarray(number_to_stamp(channel[:], _SECONDS, _ORIGIN, 1.0))
