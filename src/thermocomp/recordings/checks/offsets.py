"""Temperatures that start off the others, compared with the other recordings: shifted sensors, and since when."""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.messages import Message
from thermocomp.core.starting import find_day, find_usual, may_be_right
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.recording import Recording

#: time over which the start of a recording is averaged [s]
START = 60.0
#: more temperatures than this are not off because their sensors were shifted
MOST = 3
#: smallest offset, as a multiple of the usual difference between the starts of two recordings (robust sd)
_USUAL = 4.0


def compare_starts(recordings: Sequence[Recording]) -> tuple[tuple[Finding, ...], ...]:
    """Return for each recording the temperatures whose offset from the others begins there, or ends.

    The start of each temperature is compared with its usual start, the one nearest to the median of all recordings,
    after the change common to all temperatures (their median) is removed. It is off if it differs by more than
    `Thresholds.start_reported` and 4 times the robust standard deviation of all such differences. A recording in which
    more than `MOST` of the temperatures are off started from another thermal state: only those that are off by more
    than `Thresholds.zero_change`, as no machine is, are named then.
    """
    common = {c.name for c in recordings[0].temperatures} if recordings else set[str]()
    for r in recordings[1:]:
        common &= {c.name for c in r.temperatures}
    names = [c.name for c in recordings[0].temperatures if c.name in common] if recordings else []
    found: list[list[Finding]] = [[] for _ in recordings]
    if len(recordings) < 2 or len(names) < 3:
        return tuple(map(tuple, found))
    off = _offsets(np.array([[_start(r, name) for name in names] for r in recordings]))
    for j, name in enumerate(names):
        before = 0.0
        for k, offset in enumerate(off[:, j].tolist()):
            if offset and not before:
                last = next((i for i in range(k, len(off)) if not off[i, j]), len(off))
                until = Message("to the last one")
                if last < len(off):
                    until = Message("until {recording}", recording=recordings[last - 1].name)
                mine = [o for o in off[k].tolist() if o]
                other = may_be_right(mine, len(names), THRESHOLDS.zero_change)
                instead = (
                    Message(" (or the others are off, by {offset:+.1f} degC: which, cannot be told)", offset=-offset)
                    if other
                    else ""
                )
                text = Message(
                    "starts {offset:+.1f} degC off the other temperatures, compared with the other recordings"
                    "{instead}, from here {until} ({n} of {of}): a sensor that was moved, replaced or wired "
                    "differently, or a machine that had not cooled. Only its rises from the start are used",
                    offset=offset,
                    instead=instead,
                    until=until,
                    n=last - k,
                    of=len(off),
                )
                found[k].append(Finding("warning", name, "offset", text, row=0))
            before = offset
    return tuple(map(tuple, found))


def _start(recording: Recording, name: str) -> float:
    """Return the first temperature of a recording: the median over `START`; nan if there is none."""
    x = recording.table[name].to_numpy(dtype=np.float64)[recording.time <= recording.time[0] + START]
    x = x[np.isfinite(x)]
    return float(np.median(x)) if x.size else float("nan")


def _offsets(start: FloatArray) -> FloatArray:
    """Return how far each temperature is off at the start of each recording, (n_recordings, n_sensors); 0: it is not.

    Parameters
    ----------
    start : ndarray of shape (n_recordings, n_sensors)
        First temperatures [degC].
    """
    sound = np.isfinite(start).all(axis=0)
    if not sound.any():
        return np.zeros(start.shape)
    change = np.where(sound, start - start[0], 0.0)
    change -= np.array([find_day(own, THRESHOLDS.zero_change) for own in change[:, sound].tolist()])[:, None]
    off = np.where(sound, change - find_usual(change), 0.0)
    spread = 1.4826 * float(np.median(np.abs(off[:, sound])))
    off[np.abs(off) <= max(THRESHOLDS.start_reported, _USUAL * spread)] = 0.0
    many = (off != 0).sum(axis=1, keepdims=True) > MOST
    off[many & (np.abs(off) <= THRESHOLDS.zero_change)] = 0.0
    return off
