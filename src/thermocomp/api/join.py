"""Joining of recordings made by several loggers in the same hours."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from thermocomp.api.base import Result
from thermocomp.api.inputs import Given, recordings_of
from thermocomp.core.exceptions import InputError
from thermocomp.recordings.joining import Alignment, join_two
from thermocomp.recordings.readers import recordings as files
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class JoinedRecordings(Result):
    """A recording made of several, and how their clocks were brought together.

    Parameters
    ----------
    recording : Recording
    alignments : tuple of Alignment
        For each recording after the first, see `thermocomp.recordings.joining.Alignment`.
    """

    recording: Recording
    alignments: tuple[Alignment, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        from thermocomp.report import records

        return {"recording": records.recording(self.recording, ()), "clocks": [_plain(a) for a in self.alignments]}

    def to_frame(self) -> pd.DataFrame:
        """Return a row per recording after the first."""
        return pd.DataFrame([_plain(a) for a in self.alignments])

    def plot(self) -> "Figure":
        """Return a figure of every channel of the joined recording."""
        from thermocomp.report import checks

        return checks.figure(self.recording, ())

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the joined recording (.csv or .parquet), and return the path."""
        files.write(self.recording, path, overwrite=overwrite)
        return Path(path)

    def __str__(self) -> str:
        return ". ".join(map(str, self.alignments)) + "."


def _plain(a: Alignment) -> dict[str, Any]:
    e = a.estimate
    return {
        "recording": a.name,
        "estimated_offset_s": None if e is None else e.offset,
        "interval_s": None if e is None else [*e.interval],
        "estimated_drift_ppm": None if e is None else 1e6 * e.drift,
        "drift_interval_ppm": None if e is None else [1e6 * (e.drift - e.drift_half), 1e6 * (e.drift + e.drift_half)],
        "evidence": "" if e is None else e.evidence,
        "clear": e is not None and e.clear,
        "given": a.given,
        "applied_offset_s": a.applied,
        "applied_drift_ppm": 1e6 * a.applied_drift,
        "kept_once": [*a.once],
        "renamed": dict(a.renamed),
        "text": str(a),
    }


def join(
    recordings: Given,
    *,
    offset: float | Sequence[float] | None = None,
    mapping: str | Path | Mapping | None = None,
) -> JoinedRecordings:
    """Make one recording of those of several loggers in the same hours, such as temperatures and probes.

    The clock of the first recording is kept. The offset and the drift of the others are estimated from a channel that
    both recordings have, or from responses to the spindle, and corrected if the offset is clear: its 90 % interval is
    within 30 s, or two sampling intervals, and does not include zero. Otherwise the clocks are taken as equal, and the
    recording says so.

    The rows are those of the logger with the longer sampling interval. Channels of the others are interpolated between
    their readings, but not across gaps; a spindle speed is that of the nearest reading. A channel with the same name in
    both recordings is kept once if the values agree; otherwise the second one is renamed.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
        Two or more files (CSV, XLSX, ODS or Parquet) or tables of the same hours.
    offset : float or sequence of float, optional
        Seconds by which the clock of each recording after the first is ahead of that of the first; negative: behind.
        Default: as estimated.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column.

    Returns
    -------
    JoinedRecordings

    Raises
    ------
    InputError
        Fewer than two recordings are given, one is invalid, they have no hours in common, or the number of offsets is
        wrong.

    Examples
    --------
    >>> import thermocomp as tc
    >>> from thermocomp import Recording
    >>> table = tc.simulate("hwang")[0].to_frame()
    >>> speed, probes = ["time_s", "spindle_rpm"], ["time_s", "z_um"]
    >>> temperatures = Recording.from_dataframe(table[[*speed, "t_front_seat_C"]], name="temperatures")
    >>> found = tc.join([temperatures, Recording.from_dataframe(table[probes], name="probes")], offset=0)
    >>> found.recording
    <Recording temperatures+probes: 37 rows, 6.0 h, 1 temperatures, 1 displacements, 4 thermal cycle(s)>
    """
    tests = recordings_of(recordings, mapping)
    if len(tests) < 2:
        raise InputError("a single recording is given: name two or more of the same hours")
    several = [None] * (len(tests) - 1) if offset is None else [*np.atleast_1d(offset).tolist()]
    if len(several) != len(tests) - 1:
        raise InputError(
            f"{len(several)} offset(s) for {len(tests)} recordings: give one for each recording after the first, in "
            "their order"
        )
    joined, told = tests[0], []
    for test, given in zip(tests[1:], several, strict=True):
        joined, alignment = join_two(joined, test, given)
        told.append(alignment)
    return JoinedRecordings(joined, tuple(told))
