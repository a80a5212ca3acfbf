"""Replay of a model through the rows of a table."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.columns import Columns, count_rows, read_clock, read_numbers
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.state import State
from thermocomp.core.zero import Zeroing, find_zero


class Stepped(Protocol):
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

    def init(self, reference: ArrayLike | None = None) -> State:
        """Return the state of a machine that has just been zeroed."""

    def step(self, state: State, inputs: FloatArray, dt: float) -> tuple[State, FloatArray]:
        """Process one reading and return the deviation at its time."""


def walk(
    model: Stepped, table: Columns, time: ArrayLike | str | None = None, *, reference: ArrayLike | None = None
) -> Iterator[tuple[State, FloatArray]]:
    """Replay a model through a table as `ErrorModel.predict` does, and yield its state after each row.

    Yields
    ------
    values : ndarray of shape (n_inputs,)
        Last complete reading [units of the inputs]; NaN before the first.
    """
    columns = [read_numbers(table, i.name, f"model of {model.target}") for i in model.inputs]
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
        resting = np.array([model.zeroing.stands(v) for v in speed.tolist()], dtype=np.bool_)
    zeros: dict[int, ArrayLike | None] = {0: reference}
    for a, b in pairwise([0, *(k for k in range(1, n) if starts[k]), n]):
        zeros[a] = reference
        if clock is not None and usable[a:b].any():
            zeros[a], values[a:b] = find_zero(
                model.zeroing, model.init(reference).reference, clock[a:b], values[a:b], resting[a:b], usable[a:b]
            )
    state, since, last = model.init(reference), 0.0, np.full(len(columns), np.nan)
    for k in range(n):
        if k in zeros:
            state, since = model.init(zeros[k]), 0.0
        else:
            since += float(steps[k]) if np.isfinite(steps[k]) else 0.0
        if usable[k]:
            state, _ = model.step(state, values[k], since)
            since, last = 0.0, values[k]
        yield state, last
