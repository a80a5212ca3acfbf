"""Data-quality check of recordings: contents and problems."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from thermocomp.api.base import Paged, Result
from thermocomp.api.inputs import Given, recordings_of
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.recordings.checks import quality
from thermocomp.recordings.checks.findings import SEVERITIES, Finding
from thermocomp.recordings.checks.offsets import compare_starts
from thermocomp.recordings.joining import suggest_join
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class CheckedRecordings(Result, Paged):
    """Recordings and the findings of the data-quality check.

    Parameters
    ----------
    recordings : tuple of Recording
    findings : tuple of sequence of Finding
        Findings of each recording, the most serious first.
    """

    recordings: tuple[Recording, ...]
    findings: tuple[Sequence[Finding], ...]

    @property
    def trouble(self) -> bool:
        """Whether a problem was found that would impair a model."""
        return any(f.severity == "trouble" for found in self.findings for f in found)

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        from thermocomp.report import records

        pairs = zip(self.recordings, self.findings, strict=True)
        return {"recordings": [records.recording(r, found) for r, found in pairs]}

    def to_frame(self) -> pd.DataFrame:
        """Return a row per finding."""
        rows = [
            {"recording": r.name, "severity": f.severity, "kind": f.kind, "channel": f.channel, "text": f.text}
            for r, found in zip(self.recordings, self.findings, strict=True)
            for f in found
        ]
        return pd.DataFrame(rows, columns=["recording", "severity", "kind", "channel", "text"])

    def plot(self, recording: int = 0) -> "Figure":
        """Return a figure of every channel of a recording, with the findings marked at their rows.

        Parameters
        ----------
        recording : int
            Index of the recording, from 0.
        """
        from thermocomp.report import checks

        if not 0 <= recording < len(self.recordings):
            raise InputError(f"recording {recording}: there are {len(self.recordings)} recordings, numbered from 0")
        return checks.figure(self.recordings[recording], self.findings[recording])

    def page(self) -> str:
        """Return the page that ``thermocomp check -o`` writes."""
        from thermocomp.report import checks

        return checks.render(self.recordings, self.findings)

    def __str__(self) -> str:
        worst = [
            Message(
                "{name}: {what}",
                name=r.name,
                what=join([*filter(None, (found[0].channel, found[0].text))], " ")
                if found
                else Message("nothing wrong found"),
            )
            for r, found in zip(self.recordings, self.findings, strict=True)
        ]
        return join([join(worst or [""], ". "), "."])


def check(recordings: Given, *, mapping: str | Path | Mapping | None = None) -> CheckedRecordings:
    """Summarise recordings and report data-quality problems; more than three files get one line each.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
        Files (CSV, XLSX, ODS, Parquet, TDMS, HDF5, MAT) or tables; each one is a separate test.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column.

    Returns
    -------
    CheckedRecordings

    Raises
    ------
    InputError
        A recording is invalid.

    Examples
    --------
    >>> import thermocomp as tc
    >>> found = tc.check(tc.simulate("hwang"))
    >>> len(found.to_frame()), found.trouble
    (2, False)
    """
    tests = recordings_of(recordings, mapping)
    apart = [Finding("warning", "", "loggers", text)] if (text := suggest_join(tests)) else []
    found = ((*quality.check(t), *off, *apart) for t, off in zip(tests, compare_starts(tests), strict=True))
    return CheckedRecordings(tuple(tests), tuple(sorted(f, key=lambda f: SEVERITIES.index(f.severity)) for f in found))
