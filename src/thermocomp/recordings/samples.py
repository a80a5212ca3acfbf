"""`Samples`: several tests stacked into arrays for fitting and replaying models."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import RecordingError
from thermocomp.core.inputs import Input
from thermocomp.core.learned import Learned, probe_noise
from thermocomp.core.machine import Channel
from thermocomp.core.starting import find_usual
from thermocomp.core.zero import FIRST_READING, Zeroing, first_rows, mean_over_time
from thermocomp.recordings.starts import Start


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of one or several tests.

    Parameters
    ----------
    inputs : tuple of Channel
        Channels that models may use; never a displacement.
    targets : tuple of Channel
        Channels to be predicted.
    values : ndarray of shape (n_rows, n_inputs)
        Inputs as recorded, in house units.
    deviations : ndarray of shape (n_rows, n_targets)
        Targets, in house units.
    time : ndarray of shape (n_rows,)
        Seconds since the start of the test to which the row belongs [s].
    test, cycle, row : ndarray of int of shape (n_rows,)
        Index into `test_names`, index into `cycle_names`, row in the table of the file. The last two are -1 in rows of
        an earlier file that a test continues: these are replayed, but neither used for training nor for judging.
    test_names, cycle_names : tuple of str
    hashes : tuple of str
        Fingerprint of each test: SHA-256 of its times and values.
    rezero : bool
        Temperatures are relative to the start of each test, or to `zero`.
    zero : ndarray of shape (n_tests, n_inputs), optional
        Reference values, if they are not taken from the start of each test; NaN for a test that uses its start. Without
        `rezero` they are the same for all tests, and also apply live.
    zeroing : Zeroing
        Averaging time at the start.
    resting : ndarray of bool of shape (n_rows,), optional
        The spindle is known to be stopped; None: unknown in all rows.
    starts : tuple of Start
        Initial state of each test; empty: cold.
    stamps : tuple of str
        ISO timestamp of the first row of each test, or of an earlier file it continues; empty: unknown.
    clocks : tuple of str
        How the clocks of the loggers of each test were brought together, see `Recording`; empty: nothing is known.
    trouble : tuple of (str, str)
        Channel (empty: the whole recording) and its persistent fault; see `thermocomp.recordings.checks.sound`.
    """

    inputs: tuple[Channel, ...]
    targets: tuple[Channel, ...]
    values: FloatArray
    deviations: FloatArray
    time: FloatArray
    test: IntArray
    cycle: IntArray
    row: IntArray
    test_names: tuple[str, ...]
    cycle_names: tuple[str, ...]
    hashes: tuple[str, ...]
    rezero: bool = True
    zero: FloatArray | None = None
    zeroing: Zeroing = FIRST_READING
    resting: BoolArray | None = None
    starts: tuple[Start, ...] = ()
    stamps: tuple[str, ...] = ()
    clocks: tuple[str, ...] = ()
    trouble: tuple[tuple[str, str], ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    @property
    def valid(self) -> BoolArray:
        """Mask of the rows in which every input is a finite number."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    @property
    def rezeroed(self) -> BoolArray:
        """Mask of the inputs that are relative to the start of their test."""
        return np.array([self.rezero and c.quantity == "temperature" for c in self.inputs], dtype=np.bool_)

    def reference(self) -> FloatArray:
        """Return the reference (zero), (n_tests, n_inputs): the mean over each test's start; 0 for absolute inputs."""
        temperatures = [c.quantity == "temperature" for c in self.inputs]
        if self.zero is not None and not self.rezero:
            return np.where(temperatures, self.zero, 0.0)
        zero = np.zeros((len(self.test_names), len(self.inputs)))
        for k in range(len(self.test_names)):
            if self.zero is not None and not np.isnan(self.zero[k]).any():
                zero[k] = np.where(temperatures, self.zero[k], 0.0)
                continue
            if not (mine := self.test == k).any():
                continue  # nothing is relative to it
            rows = np.flatnonzero(mine & self.valid)
            if rows.size == 0:
                names = ", ".join(c.name for c in self.inputs)
                raise RecordingError(
                    f"{self.test_names[k]}: no row has a number in all of the inputs {names}; leave out inputs without "
                    "values"
                )
            window = rows[: first_rows(self.zeroing, self.time[rows], self.stands[rows])[0]]
            zero[k] = np.where(self.rezeroed, mean_over_time(self.time[window], self.values[window]), 0.0)
        return zero

    def given_zero(self, test: int, inputs: Sequence[int]) -> FloatArray | None:
        """Return the given zero of some inputs in a test; None if the first readings determine it."""
        given = self.zero is not None and not np.isnan(self.zero[test]).any()
        return self.reference()[test, inputs] if given else None

    @property
    def stands(self) -> BoolArray:
        """Mask of the rows in which the spindle is known to be stopped."""
        return np.zeros(len(self), dtype=np.bool_) if self.resting is None else self.resting

    def anew(self, test: int) -> int | None:
        """Return the row from which a test is re-zeroed, whether or not earlier rows are known; None if it is not."""
        if not self.starts or self.starts[test].word != "rezeroed":
            return None
        return int(np.flatnonzero((self.test == test) & (self.cycle >= 0))[0])

    def change(self) -> FloatArray:
        """Return inputs minus their reference, (n_rows, n_inputs); rows used for the zero have its mean."""
        return self._change.copy()

    @cached_property
    def _change(self) -> FloatArray:
        values, reference = self.values.copy(), self.reference()  # raises an error for a test without usable rows
        for window in self._windows() if self.rezeroed.any() else []:
            values[window] = mean_over_time(self.time[window], values[window])
        return values - reference[self.test]

    def _windows(self) -> Iterator[IntArray]:
        """Yield the rows averaged for the zero of each test, unless it is specified."""
        for k in range(len(self.test_names)):
            rows = np.flatnonzero((self.test == k) & self.valid)
            if rows.size and (self.zero is None or np.isnan(self.zero[k]).any()):
                yield rows[: first_rows(self.zeroing, self.time[rows], self.stands[rows])[0]]

    def days(self) -> "NDArray[np.datetime64]":
        """Return the day of each row, (n_rows,); NaT where the recording has no time stamps."""
        return self.clock().astype("datetime64[D]")

    def clock(self) -> "NDArray[np.datetime64]":
        """Return date and time of each row, (n_rows,); NaT where the recording has no time stamps."""
        found = np.full(len(self), "NaT", "datetime64[s]")
        for k, stamp in enumerate(self.stamps):
            mine = self.test == k
            if stamp:
                begin = np.datetime64(datetime.fromisoformat(stamp).replace(tzinfo=None), "s")
                found[mine] = begin + self.time[mine].astype("timedelta64[s]")
        return found

    def begin(self, test: int) -> tuple[str, float]:
        """Return the fingerprint of the first of the files that a test continues, and the test's time 0 in it [s]."""
        start = self.starts[test] if self.starts else None
        if start is None or start.word != "continued":
            return self.hashes[test], 0.0
        earlier = start.earlier[0].fingerprint
        if earlier not in self.hashes:
            return earlier, 0.0
        before = self.hashes.index(earlier)
        first, begin = self.begin(before)
        return first, begin + float(self.time[(self.test == before) & (self.cycle >= 0)][0])

    def dt(self) -> FloatArray:
        """Return the time since the previous row of the same test [s]; inf in the first row of each test."""
        steps = np.diff(self.time, prepend=np.inf)
        steps[np.flatnonzero(np.diff(self.test, prepend=-1))] = np.inf
        return steps

    def interval(self, rows: BoolArray) -> float:
        """Return the usual time between rows of a test [s]; 1 if there is none."""
        steps = self.dt()[rows]
        return float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 1.0

    def learned(self, target: int, rows: BoolArray, before: int | None = None) -> Learned:
        """Return the training statistics of a target in some rows.

        Parameters
        ----------
        target : int
            Index into `targets`.
        rows : ndarray of bool of shape (n_rows,)
            Training rows; those without a number are ignored.
        before : int, optional
            The last value is taken from the last row before this one in its test, or in the files it continues, 0 if
            there is none. Default: the last row of all.
        """
        y = self.deviations[:, target]
        known = rows & np.isfinite(y)
        if not known.any():
            return Learned(0.0, 0.0, 0.0, 0.0)
        noise = [probe_noise(y[known & (self.test == k)]) for k in np.unique(self.test[known])]
        candidates = np.flatnonzero(known)
        if before is not None:
            test = int(self.test[before])
            mine = candidates[(candidates < before) & (self.test[candidates] == test)]
            for r in reversed(self.starts[test].earlier if self.starts else ()):  # recordings that it continues
                if not mine.size:
                    others = [k for k, own in enumerate(self.hashes) if own == r.fingerprint]
                    mine = candidates[np.isin(self.test[candidates], others)]
            candidates = mine
        last = float(y[candidates[-1]]) if candidates.size else 0.0
        return Learned(float(y[known].mean()), last, float(np.median(noise)), float(np.abs(y[known]).max()))

    def take(self, rows: BoolArray | IntArray) -> "Samples":
        """Return the samples with a selection of their rows, in the same order."""
        return replace(
            self,
            values=self.values[rows],
            deviations=self.deviations[rows],
            time=self.time[rows],
            test=self.test[rows],
            cycle=self.cycle[rows],
            row=self.row[rows],
            resting=None if self.resting is None else self.resting[rows],
        )

    def only(self, names: Sequence[str]) -> "Samples":
        """Return the same rows with a selection of inputs, in their present order."""
        kept = [j for j, c in enumerate(self.inputs) if c.name in names]
        zero = None if self.zero is None else self.zero[:, kept]
        return replace(self, inputs=tuple(self.inputs[j] for j in kept), values=self.values[:, kept], zero=zero)

    def model_inputs(self, columns: Sequence[int], rows: BoolArray | IntArray) -> tuple[Input, ...]:
        """Return the inputs of a model fitted to `rows`, with the reference and trained range of each."""
        change = self.change()[rows]
        zero = _usual(self.reference()[np.unique(self.test[rows])], self.rezeroed)
        return tuple(
            Input(
                name=self.inputs[j].name,
                quantity=self.inputs[j].quantity,
                unit=self.inputs[j].unit,
                reference=float(zero[j]),
                rezero=bool(self.rezeroed[j]),
                low=float(np.nanmin(change[:, j])),
                high=float(np.nanmax(change[:, j])),
            )
            for j in columns
        )

    def frame(self) -> pd.DataFrame:
        """Return inputs minus reference as a table with the names of the inputs."""
        return pd.DataFrame(self.change(), columns=[c.name for c in self.inputs])


def _usual(zeros: FloatArray, own: BoolArray) -> FloatArray:
    """Return the usual zero of each input, although a sensor may be shifted in some tests.

    Parameters
    ----------
    zeros : ndarray of shape (n_tests, n_inputs)
    own : ndarray of bool of shape (n_inputs,)
        Inputs relative to the start of their test, which are as warm as the day.
    """
    if len(zeros) < 2 or not own.any():
        return np.asarray(np.median(zeros, axis=0))
    day = np.where(own, np.median(zeros[:, own], axis=1, keepdims=True), 0.0)
    return np.asarray(find_usual(zeros - day) + np.median(day, axis=0))


def usual_step(step: FloatArray) -> float:
    """Return the median time between two rows [s]; inf where every row is a separate test."""
    between = step[np.isfinite(step) & (step > 0)]
    return float(np.median(between)) if between.size else float("inf")
