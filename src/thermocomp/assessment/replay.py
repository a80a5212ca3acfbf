"""Replay: every prediction that is judged comes out of `ErrorModel.step`, reading by reading, as it would live."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.model import ErrorModel
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: turns one reading (n_inputs,) into a batch of disturbed ones (n_variants, n_inputs); gets the test's reference too
Disturb = Callable[[FloatArray, FloatArray], FloatArray]


def replay(
    model: ErrorModel, samples: Samples, rows: BoolArray, disturb: Disturb | None = None
) -> tuple[FloatArray, BoolArray]:
    """Replay a model over the tests that hold `rows`, from the start of each test.

    The compensator runs without a break from the start of a test, as it would on the machine; its only inputs are those
    of `samples`, never a displacement. A row with a missing input is what the gate turns away live: the last deviation
    is held.

    Parameters
    ----------
    model : ErrorModel
    samples : Samples
    rows : ndarray of bool of shape (n_rows,)
        Rows whose prediction is wanted.
    disturb : callable, optional
        Makes several variants of each reading; see `Disturb`.

    Returns
    -------
    deviation : ndarray of shape (n_wanted,) or (n_wanted, n_variants)
        Predicted deviation at the wanted rows.
    outside : ndarray of bool of shape (n_wanted,) or (n_wanted, n_variants)
        An input was outside the trained range.
    """
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    values = samples.values[:, columns]
    usable = np.all(np.isfinite(values), axis=1)
    reference = samples.reference()[:, columns]
    predicted, beyond = [], []
    for test in np.unique(samples.test[rows]):
        mine = np.flatnonzero(samples.test == test)
        mine = mine[: np.flatnonzero(rows[mine]).max() + 1]
        state, last = model.init(), samples.time[mine[0]]
        for k, needed in zip(mine, _needed(model, usable[mine], rows[mine]), strict=True):
            if needed:
                reading = values[k] if disturb is None else disturb(values[k], reference[test])
                state, _ = model.step(state, reading, float(samples.time[k] - last))
                last = samples.time[k]
            if rows[k]:
                predicted.append(state.deviation)
                beyond.append(np.any(state.outside, axis=-1))
    return np.array(predicted), np.array(beyond)


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
