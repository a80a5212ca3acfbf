"""Recordings made while a correction was in force, and the part usable for training.

A model learns the uncompensated deviation. In addition to this deviation, ``z_um``, such a recording may contain the
measured residual, ``z_residual_um``, and the correction in force, ``z_correction_um``; `uncompensated` separates them.
"""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.correction import uncompensated
from thermocomp.core.exceptions import RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.recording import Recording

#: tolerance of the deviation against residual minus correction, including rounding [um]
ROUNDED = 0.5
#: error message for a recording or a column whose state of compensation is unknown
UNKNOWN = Message(
    "compensation: unknown: the correction in force during the measurement is not known, so the uncompensated "
    "deviation is not known either; record with a controller that confirms its corrections and with its own "
    'temperature compensation off. If no correction was in force, set compensation = "off" in a mapping'
)


def beside(target: str) -> tuple[str, str]:
    """Return the names of the residual and of the correction of a target: ``z_residual_um`` of ``z_um``."""
    base = target.removesuffix("_um")
    return f"{base}_residual_um", f"{base}_correction_um"


def refuse_compensated(recordings: Sequence[Recording], targets: Sequence[str]) -> None:
    """Reject recordings whose displacements are not those of an uncompensated machine."""
    for recording in recordings:
        where = recording.source or recording.name
        if recording.compensation == "unknown":
            raise RecordingError(f"{where}: {UNKNOWN}")
        for target in targets:
            _refuse(recording, target, where)


def _refuse(recording: Recording, target: str, where: str) -> None:
    name = recording.channel(target).name if recording.has(target) else target
    residual, correction = beside(name)
    sound = f"name the uncompensated deviation, {residual} - {correction}"
    if not recording.has(name):
        if recording.has(residual):
            raise RecordingError(
                f"{where}: there is {residual}, measured with compensation active, but no {name}: add a column "
                f"{name} = {residual} - {correction}"
            )
        return
    channel = recording.channel(name)
    if channel.quantity in ("residual", "correction"):
        own = channel.name.replace(f"_{channel.quantity}_um", "_um")
        raise RecordingError(
            f"{where}: {channel.name} was recorded with compensation active ({channel.quantity}): name the "
            f"uncompensated deviation as the target, {own}"
        )
    if not recording.has(correction):
        return
    c = _values(recording, correction)
    if not recording.has(residual):
        if (c != 0.0).any():
            raise RecordingError(
                f"{where}: {name} was measured while {correction} was in force, so it is not known whether its "
                f"values are compensated: if they are, name it {residual}, and add a column {name} = {residual} - "
                f"{correction}"
            )
        return
    d, r = _values(recording, name), _values(recording, residual)
    if not np.isfinite(d).any() and np.isfinite(r).any():
        raise RecordingError(f"{where}: {name} is empty where {residual} has a value: {UNKNOWN}")
    off = d - uncompensated(r, c)
    known = np.flatnonzero(np.isfinite(off))
    if not known.size or recording.changed:
        return
    off -= np.median(off[known])  # they may have different zeros
    worst = int(known[np.argmax(np.abs(off[known]))])
    if abs(off[worst]) > ROUNDED:
        raise RecordingError(
            f"{where}: in row {worst} {name} is {d[worst]:g} um, and {residual} - {correction} is {r[worst]:g} - "
            f"({c[worst]:g}) um: they must be equal; {sound}"
        )


def _values(recording: Recording, name: str) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return recording.table[recording.channel(name).name].to_numpy(dtype=np.float64)
