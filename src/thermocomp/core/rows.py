"""Replay of a model through the rows of a table."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.columns import Columns, count_rows, read_clock, read_numbers
from thermocomp.core.exceptions import InputError
from thermocomp.core.expression import Node
from thermocomp.core.inputs import Input
from thermocomp.core.state import RunOutputs, State
from thermocomp.core.thresholds import Thresholds
from thermocomp.core.zero import Zeroing, find_zero


class Runnable(Protocol):
    """Interface of a model for a replay; see `thermocomp.core.model.ErrorModel`."""

    @property
    def remembers(self) -> bool:
        """False: the output depends only on the current reading."""

    @property
    def target(self) -> str:
        """Displacement channel that the model predicts."""

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs, in the order of their values."""

    @property
    def zeroing(self) -> Zeroing:
        """Averaging time of the reference of the inputs."""

    @property
    def thresholds(self) -> Thresholds:
        """Fixed numbers by which the compensator decides."""

    def init(self, reference: ArrayLike | None = None) -> State:
        """Return the state of a machine that has just been zeroed."""

    def run(self, state: State, inputs: FloatArray, steps: FloatArray, further: Sequence[Node] = ()) -> RunOutputs:
        """Process readings one after another."""

    def widen(self, run: RunOutputs) -> FloatArray:
        """Return the half-widths of the band for the outputs of `run`."""


class TableRun(NamedTuple):
    """Outputs of a model for the tests of a table."""

    runs: list[RunOutputs]
    places: NDArray[np.intp]  #: (n_rows,), last complete reading of the test, over all runs; -1: none yet

    def spread(self, value: Callable[[RunOutputs], FloatArray], before: float) -> FloatArray:
        """Return a value of each reading for the rows; `before` the first complete reading of a test."""
        known = np.concatenate([np.empty(0), *(value(run) for run in self.runs)])
        return np.append(known, before)[self.places]


def run_table(
    model: Runnable,
    table: Columns,
    time: ArrayLike | str | None = None,
    *,
    reference: ArrayLike | None = None,
    further: Sequence[Node] = (),
) -> TableRun:
    """Run a model through a table as `ErrorModel.predict` does."""
    columns = [read_numbers(table, i.name, f"model of {model.target}") for i in model.inputs]
    columns = [np.abs(c) if i.unsigned else c for i, c in zip(model.inputs, columns, strict=True)]
    clock = read_clock(table, time, f"model of {model.target}", needed=model.remembers)
    n = len(columns[0]) if columns else len(clock) if clock is not None else count_rows(table)
    for name, values in [*zip((i.name for i in model.inputs), columns, strict=True), ("the time", clock)]:
        if values is not None and values.shape != (n,):
            raise InputError(
                f"model of {model.target}: {name} has shape {values.shape}; expected one value for each of {n} rows"
            )
    values = np.column_stack(columns) if columns else np.empty((n, 0))
    steps: FloatArray = np.full(n, 1.0) if clock is None else np.diff(clock, prepend=np.inf)
    starts = (steps <= 0).tolist()
    usable: BoolArray = np.all(np.isfinite(values), axis=1)
    resting = np.zeros(n, dtype=np.bool_)
    if model.zeroing.speed in table:
        speed = read_numbers(table, model.zeroing.speed, f"model of {model.target}")
        resting = np.array(
            [model.zeroing.stands(v, model.thresholds.stopped_speed) for v in speed.tolist()], dtype=np.bool_
        )
    runs, places, done = list[RunOutputs](), np.full(n, -1), 0
    for a, b in pairwise([0, *(k for k in range(1, n) if starts[k]), n]):
        own, rows = slice(a, b), a + np.flatnonzero(usable[a:b])
        if not rows.size:
            continue
        zero, since = reference, rows.astype(np.float64)
        if clock is not None:
            since = clock[rows]
            zero, values[own] = find_zero(
                model.zeroing, model.init(reference).reference, clock[own], values[own], resting[own], usable[own]
            )
        runs.append(model.run(model.init(zero), values[rows], np.diff(since, prepend=since[0]), further))
        places[rows] = done + np.arange(len(rows))
        places[own] = np.maximum.accumulate(places[own])
        done += len(rows)
    return TableRun(runs, places)


class Replayable:
    """A model that is replayed through a table."""

    def predict(
        self: Runnable, table: Columns, time: ArrayLike | str | None = None, *, reference: ArrayLike | None = None
    ) -> FloatArray:
        """Replay the model through a table, row by row, as it would run at the machine without gate and limits.

        Parameters
        ----------
        table : mapping of str to array-like of shape (n_rows,)
            A DataFrame, or any object that returns a column by name; columns with the names and units of `inputs`. A
            row with a missing value (NaN) is skipped: the previous deviation is held, 0 at the start.
        time : str or array-like of shape (n_rows,), optional
            Time: numbers [s], or datetimes with or without a time zone; or the name of its column. Default: the column
            ``time_s``. A row that is not later than the previous one starts a new test, from rest and with a separate
            zero (reference reading): the mean over its start, see `Zeroing`; its spindle column, if present, shows
            whether the spindle is stopped. A model without memory needs no time; then the first row is the zero.
        reference : array-like of shape (n_inputs,), optional
            Reference of the inputs, as in `init`.

        Returns
        -------
        ndarray of shape (n_rows,)
            Deviation [unit].

        Raises
        ------
        InputError
            A column is missing or contains a non-numeric value; or a model with memory has no time.
        """
        return run_table(self, table, time, reference=reference).spread(lambda run: run.deviation, 0.0)

    def half_widths(
        self: Runnable, table: Columns, time: ArrayLike | str | None = None, *, reference: ArrayLike | None = None
    ) -> FloatArray:
        """Return the half-widths of the band about the result of `predict` for the same table.

        Parameters
        ----------
        table, time, reference
            As for `predict`.

        Returns
        -------
        ndarray of shape (n_rows,)
            [unit]; NaN without a band, and before the first complete row of a test.
        """
        found = run_table(self, table, time, reference=reference)
        return found.spread(self.widen, np.nan)
