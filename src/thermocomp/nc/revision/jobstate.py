"""State at the end of a job as JSON: versioned, bit-exact; damaged or unknown files are refused."""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import AwareDatetime

from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.files import jsonfile
from thermocomp.nc.thermal.jobstate import JobState

KIND = jsonfile.Format("thermocomp-job-state", 1, "state file of a job", "thermocomp revise")


@dataclass(frozen=True)
class SavedJob:
    """State and the time at which it was reached.

    Parameters
    ----------
    written : datetime
        End of the job, in UTC.
    """

    written: AwareDatetime
    state: JobState


def dumps(state: JobState, written: datetime) -> str:
    """Return the text of a state file, with floats that are restored to the last bit when read."""
    if written.tzinfo is None:
        raise InputError(f"state of a job: time of writing {written} has no time zone")
    entry = {"written": written.astimezone(UTC).isoformat(), "state": asdict(state)}
    return jsonfile.pack(KIND, [entry])


def loads(text: str, source: str = "state of a job") -> SavedJob:
    """Return the state at the end of a job from the text of its file."""
    jobs: list[SavedJob] = jsonfile.unpack(KIND, SavedJob, text, source).models
    if len(jobs) > 1:
        raise ModelFileError(f"{source}: the file contains the states of {len(jobs)} jobs; expected one")
    saved = jobs[0]
    return SavedJob(saved.written.astimezone(UTC), saved.state)


def write(state: JobState, written: datetime, path: str | Path, *, overwrite: bool = False) -> None:
    """Write the state at the end of a job to a file."""
    jsonfile.write(dumps(state, written), path, overwrite=overwrite)


def read(path: str | Path) -> SavedJob:
    """Return the state at the end of a job from a file."""
    return loads(*jsonfile.read(KIND, path))
