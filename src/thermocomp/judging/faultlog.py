"""Failed sensors in recordings, replacement values, and loss of accuracy, from a replay of the watch."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.model import ErrorModel
from thermocomp.core.watch import Watch
from thermocomp.judging.assessing import Judged
from thermocomp.judging.metrics import rms
from thermocomp.judging.results import Assessment
from thermocomp.judging.watched import can_look, look_through, stack_watched
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.runtime.watchstate import GOOD, MISSING, WORDS

IntArray = NDArray[np.int8]


class Fault(NamedTuple):
    """A period in which a sensor was not trusted."""

    sensor: str
    word: str  #: see `thermocomp.runtime.watchstate.WORDS`
    begin: float  #: time of detection, on the clock of its recording [s]
    end: float  #: time when it was trusted again, or end of the recording [s]
    returned: bool  #: whether it was trusted again
    beside: float  #: mean of its reading minus the replacement value; nan if the reading was missing
    unit: str  #: of the reading


@dataclass(frozen=True, eq=False)
class FaultLog:
    """Findings of a watch (sensor monitoring) in a recording.

    Parameters
    ----------
    recording : int
        Index of the recording.
    time : ndarray of shape (n_rows,)
        [s]
    watch : Watch
        Watch that detected the faults.
    fault : ndarray of int of shape (n_rows, n_sensors)
        See `thermocomp.runtime.watchstate.WORDS`.
    read, stood_in : ndarray of shape (n_rows, n_sensors)
        Recorded and replacement values [their units]; nan where there was none, or the sensor was trusted.
    faults : tuple of Fault
        In order of detection.
    """

    recording: int
    name: str
    time: FloatArray
    watch: Watch
    fault: IntArray
    read: FloatArray
    stood_in: FloatArray
    faults: tuple[Fault, ...]

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the sensors that failed, in order of the first failure."""
        return tuple(dict.fromkeys(f.sensor for f in self.faults))


class Cost(NamedTuple):
    """Residual of a model during the failure of a given set of its sensors."""

    failed: tuple[str, ...]  #: failed sensors of the model; empty: all were good
    hours: float  #: total duration of the judged rows in this state [h]
    rms: float  #: RMS with the compensator as it would run [unit of the model]
    none_rms: float  #: RMS without compensation in these rows [unit of the model]
    honest: float | None  #: RMS on unseen cycles without these sensors [unit of the model]; None: never judged
    runs_on: bool  #: True: runs on with replacement values; False: the correction is held, then fades


def find_faults(judged: Judged, recordings: Sequence[Recording]) -> tuple[FaultLog, ...]:
    """Replay the watch of models over the recordings on which they were judged, as it would run at the machine.

    Data-quality problems that `thermocomp.recordings.checks.quality.check` detects afterwards are not excluded, since
    they would be unknown at the machine.
    """
    watches = list[Watch]()
    for m in judged.models:
        if m.watch is not None and m.watch not in watches:
            watches.append(m.watch)
    return tuple(log for watch in watches for log in _logs(watch, judged, recordings))


def find_costs(model: ErrorModel, assessment: Assessment, logs: Sequence[FaultLog]) -> tuple[Cost, ...]:
    """Return the residual of a model before and after its sensors failed, by the set of failed sensors."""
    own = {log.recording: log for log in logs if log.watch == model.watch}
    if assessment.failure or not own:
        return ()
    places = list(zip(assessment.test.tolist(), assessment.row.tolist(), strict=True))
    lost = {k: _lost(model, log) for k, log in own.items()}
    failed = [lost[k][row] for k, row in places]
    steps = {k: np.diff(log.time, prepend=log.time[0]) for k, log in own.items()}
    hours = np.array([steps[k][row] for k, row in places]) / 3600
    known, found = model.honest_error, list[Cost]()
    for names, runs_on in dict.fromkeys(failed):
        rows = np.array([f == (names, runs_on) for f in failed], dtype=np.bool_)
        honest = None if known is None else known.lost.get(", ".join(names)) if names else known.rms
        measured = assessment.measured[rows]
        left, none = rms(measured, assessment.predicted[rows]), rms(measured, np.zeros_like(measured))
        found.append(
            Cost(failed=names, hours=float(hours[rows].sum()), rms=left, none_rms=none, honest=honest, runs_on=runs_on)
        )
    return tuple(found)


def _logs(watch: Watch, judged: Judged, recordings: Sequence[Recording]) -> Iterator[FaultLog]:
    target = next(a.target for a in judged.overall() if not a.failure)
    samples = stack_watched(watch, target, recordings, [start for _, start in judged.starts])
    if samples is not None and can_look(watch, samples):
        for k, recording in enumerate(recordings):
            yield _log(watch, samples, k, recording)


def _log(watch: Watch, samples: Samples, test: int, recording: Recording) -> FaultLog:
    heat = watch.supervised
    names = [c.name for c in samples.inputs]
    read = np.full((len(recording), len(heat)), np.nan)
    for j, name in enumerate(watch.failing):
        if name in names:
            read[:, j] = samples.values[(samples.test == test) & (samples.row >= 0), names.index(name)]
    fault, stood_in = np.zeros(read.shape, np.int8), np.full(read.shape, np.nan)
    rows, passed, faults = look_through(watch, samples, test)
    mine = samples.row[rows] >= 0  # not a row of the file that it continues from
    own = samples.row[rows[mine]]
    fault[own] = faults[mine]
    stood_in[own] = np.where(faults[mine] != GOOD, passed[mine][:, heat], np.nan)
    found = [
        Fault(
            sensor=name,
            word=WORDS[fault[a, j]],
            begin=float(recording.time[a]),
            end=float(recording.time[min(b, len(recording) - 1)]),
            returned=b < len(recording) and fault[b, j] == GOOD,
            beside=float("nan") if fault[a, j] == MISSING else float(np.nanmean(read[a:b, j] - stood_in[a:b, j])),
            unit=watch.inputs[heat[j]].unit,
        )
        for j, name in enumerate(watch.failing)
        for a, b in _runs(fault[:, j])
    ]
    ordered = tuple(sorted(found, key=lambda f: f.begin))
    return FaultLog(
        recording=test,
        name=samples.test_names[test],
        time=recording.time,
        watch=watch,
        fault=fault,
        read=read,
        stood_in=stood_in,
        faults=ordered,
    )


def _runs(fault: IntArray) -> Iterator[tuple[int, int]]:
    """Yield the first row, and the row after the last, of each run of the same fault."""
    edges = [0, *(np.flatnonzero(np.diff(fault)) + 1).tolist(), len(fault)]
    for a, b in pairwise(edges):
        if fault[a] != GOOD:
            yield a, b


def _lost(model: ErrorModel, log: FaultLog) -> list[tuple[tuple[str, ...], bool]]:
    """Return the failed sensors of a model in each row, in the order of its inputs, and whether it runs without."""
    own = [i.name for i in model.inputs if i.name in model.sensors and i.name in log.watch.failing]
    faults = log.fault[:, [log.watch.failing.index(n) for n in own]]
    cases, which = np.unique(faults, axis=0, return_inverse=True)
    found = list[tuple[tuple[str, ...], bool]]()
    for case in cases.tolist():
        failed = {n: WORDS[fault] for n, fault in zip(own, case, strict=True) if fault != GOOD}
        found.append((tuple(failed), not failed or (model.may_lose(failed) and not model.wrong_speeds(failed))))
    return [found[k] for k in which.ravel().tolist()]
