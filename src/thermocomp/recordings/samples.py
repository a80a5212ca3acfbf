"""`Samples`: several tests stacked into the arrays that models are fitted to and replayed on."""

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
from thermocomp.core.zero import FIRST_READING, Zeroing, first_rows, robust_mean
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
        Seconds since the start of the row's test [s].
    test, cycle, row : ndarray of int of shape (n_rows,)
        Index into `test_names`, index into `cycle_names`, row in the file's table. The last two are -1 in rows of an
        earlier file, which a test continues from: they are gone through, and neither learned from nor judged.
    test_names, cycle_names : tuple of str
    hashes : tuple of str
        Fingerprint of each test: SHA-256 of its times and values.
    rezero : bool
        Temperatures are counted from the start of each test, or from `zero`.
    zero : ndarray of shape (n_tests, n_inputs), optional
        What they are counted from, if it is not the start of each test; nan for a test whose start it is. Without
        `rezero` it is the same for all tests, and holds live too.
    zeroing : Zeroing
        Over how long the start is averaged.
    resting : ndarray of bool of shape (n_rows,), optional
        The spindle is known to be stopped; None: it is known nowhere.
    starts : tuple of Start
        Initial state of each test; empty: cold.
    stamps : tuple of str
        ISO timestamp of each test's first row, that of an earlier file it continues from; empty: not known.
    trouble : tuple of (str, str)
        Channel (empty: all) and what is wrong with it as a whole; see `thermocomp.recordings.checks.sound`.
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
    trouble: tuple[tuple[str, str], ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    @property
    def valid(self) -> BoolArray:
        """Rows in which every input is a finite number."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    @property
    def rezeroed(self) -> BoolArray:
        """Inputs that are counted from the start of their test."""
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
            rows = np.flatnonzero((self.test == k) & self.valid)
            if rows.size == 0:
                names = ", ".join(c.name for c in self.inputs)
                raise RecordingError(f"{self.test_names[k]}: no row has a number in all of the inputs {names}")
            count, _ = first_rows(self.zeroing, self.time[rows], self.stands[rows])
            zero[k] = np.where(self.rezeroed, robust_mean(self.values[rows[:count]]), 0.0)
        return zero

    @property
    def stands(self) -> BoolArray:
        """Rows in which the spindle is known to be stopped."""
        return np.zeros(len(self), dtype=np.bool_) if self.resting is None else self.resting

    def anew(self, test: int) -> int | None:
        """Return the row from which a test is re-zeroed, what went before being known or not; None: it does not."""
        if not self.starts or self.starts[test].word != "rezeroed":
            return None
        return int(np.flatnonzero((self.test == test) & (self.cycle >= 0))[0])

    def change(self) -> FloatArray:
        """Return inputs minus their reference, (n_rows, n_inputs); the rows of a zero give its mean."""
        return self._change.copy()

    @cached_property
    def _change(self) -> FloatArray:
        values, reference = self.values.copy(), self.reference()  # raises where a test has no row to count from
        for window in self._windows() if self.rezeroed.any() else []:
            values[window] = robust_mean(values[window])
        return values - reference[self.test]

    def _windows(self) -> Iterator[IntArray]:
        """Yield the rows that the zero of each test is averaged of, where it is not stated."""
        for k in range(len(self.test_names)):
            if self.zero is None or np.isnan(self.zero[k]).any():
                rows = np.flatnonzero((self.test == k) & self.valid)
                yield rows[: first_rows(self.zeroing, self.time[rows], self.stands[rows])[0]]

    def days(self) -> "NDArray[np.datetime64]":
        """Return the day of each row, (n_rows,); not a time where the recording has no time stamps."""
        found = np.full(len(self), "NaT", "datetime64[D]")
        for k, stamp in enumerate(self.stamps):
            mine = self.test == k
            if stamp:
                begin = np.datetime64(datetime.fromisoformat(stamp).replace(tzinfo=None), "s")
                found[mine] = (begin + self.time[mine].astype("timedelta64[s]")).astype("datetime64[D]")
        return found

    def dt(self) -> FloatArray:
        """Return the time since the previous row of the same test [s]; inf in each test's first row."""
        steps = np.diff(self.time, prepend=np.inf)
        steps[np.flatnonzero(np.diff(self.test, prepend=-1))] = np.inf
        return steps

    def interval(self, rows: BoolArray) -> float:
        """Return the usual time between rows of a test [s]; 1 where there is none."""
        steps = self.dt()[rows]
        return float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 1.0

    def learned(self, target: int, rows: BoolArray, before: int | None = None) -> Learned:
        """Return the training statistics of a target in some rows.

        Parameters
        ----------
        target : int
            Index into `targets`.
        rows : ndarray of bool of shape (n_rows,)
            Learned from; those without a number are passed over.
        before : int, optional
            The last value is that of the last row before this one in its test, or in the files it continues from, 0
            without any; without it, that of the last row of all.
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
            for r in reversed(self.starts[test].earlier if self.starts else ()):  # what it continues from
                if not mine.size:
                    others = [k for k, own in enumerate(self.hashes) if own == r.fingerprint]
                    mine = candidates[np.isin(self.test[candidates], others)]
            candidates = mine
        last = float(y[candidates[-1]]) if candidates.size else 0.0
        return Learned(float(y[known].mean()), last, float(np.median(noise)), float(np.abs(y[known]).max()))

    def take(self, rows: BoolArray | IntArray) -> "Samples":
        """Return some of the rows, in their order."""
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
        """Return the same rows with some of the inputs, in the order they had."""
        kept = [j for j, c in enumerate(self.inputs) if c.name in names]
        zero = None if self.zero is None else self.zero[:, kept]
        return replace(self, inputs=tuple(self.inputs[j] for j in kept), values=self.values[:, kept], zero=zero)

    def model_inputs(self, columns: Sequence[int], rows: BoolArray | IntArray) -> tuple[Input, ...]:
        """Describe inputs for a model fitted to `rows`: reference and trained range of each."""
        change = self.change()[rows]
        zero = self.reference()[int(self.test[rows][0])]
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
        """Return inputs minus reference as a table with the inputs' names."""
        return pd.DataFrame(self.change(), columns=[c.name for c in self.inputs])


def usual_step(step: FloatArray) -> float:
    """Return the median time between two rows [s]; inf where every row is a separate test."""
    between = step[np.isfinite(step) & (step > 0)]
    return float(np.median(between)) if between.size else float("inf")
