"""Replay: every prediction that is judged comes out of `ErrorModel.step`, reading by reading, as it would live."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.model import ErrorModel, State
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: turns one reading (n_inputs,) into a batch of disturbed ones (n_variants, n_inputs); gets the test's reference too
Disturb = Callable[[FloatArray, FloatArray], FloatArray]


def replay(model: ErrorModel, samples: Samples, rows: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Replay a model over the tests that hold `rows`, from the start of each test.

    Parameters
    ----------
    model : ErrorModel
    samples : Samples
    rows : ndarray of bool of shape (n_rows,)
        Rows whose prediction is wanted.

    Returns
    -------
    deviation : ndarray of shape (n_wanted,)
        Predicted deviation at the wanted rows.
    outside : ndarray of bool of shape (n_wanted,)
        An input was outside the trained range.
    """
    wanted = int(rows.sum())
    predicted, beyond = np.empty(wanted), np.empty(wanted, dtype=np.bool_)
    for k, state in enumerate(walk(model, samples, rows)):
        predicted[k], beyond[k] = state.deviation, state.outside.any()
    return predicted, beyond


def walk(model: ErrorModel, samples: Samples, rows: BoolArray, disturb: Disturb | None = None) -> Iterator[State]:
    """Step a model through the tests that hold `rows`; yield its state at each wanted row, in their order.

    The compensator runs without a break from the start of a test, as it would on the machine; its only inputs are those
    of `samples`, never a displacement. A row with a missing input is what the gate turns away live: the last deviation
    is held.

    Parameters
    ----------
    model : ErrorModel
    samples : Samples
    rows : ndarray of bool of shape (n_rows,)
        Rows whose state is wanted.
    disturb : callable, optional
        Makes several variants of each reading; see `Disturb`.

    Yields
    ------
    State
    """
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    values = samples.values[:, columns]
    usable = np.all(np.isfinite(values), axis=1)
    reference = samples.reference()[:, columns]
    for test in np.unique(samples.test[rows]):
        mine = np.flatnonzero(samples.test == test)
        mine = mine[: np.flatnonzero(rows[mine]).max() + 1]
        state, last = model.init(None if samples.zero is None else reference[test]), samples.time[mine[0]]
        for k, needed in zip(mine, _needed(model, usable[mine], rows[mine]), strict=True):
            if needed:
                reading = values[k] if disturb is None else disturb(values[k], reference[test])
                state, _ = model.step(state, reading, float(samples.time[k] - last))
                last = samples.time[k]
            if rows[k]:
                yield state


def _needed(model: ErrorModel, usable: BoolArray, wanted: BoolArray) -> BoolArray:
    """Return the rows of a test that have to be stepped through to know the wanted ones."""
    if model.remembers or model.support.policy == "hold" or not usable.any():
        return usable
    # A model without memory needs its zero, the wanted readings, and for a wanted row without one the reading before.
    needed = usable & wanted
    needed[np.argmax(usable)] = True
    before = np.maximum.accumulate(np.where(usable, np.arange(len(usable)), 0))
    needed[before[wanted]] = True
    return needed & usable
