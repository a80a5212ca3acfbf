"""Replay: what is judged comes out of `ErrorModel.step` and the compensator around it, as it would live."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.compensation import batch
from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel, State
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: turns one reading (n_inputs,) into a batch of disturbed ones (n_variants, n_inputs); gets the test's reference too
Disturb = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Replayed:
    """What would have run in the rows that are judged.

    Parameters
    ----------
    deviation : ndarray of shape (n_wanted,)
        What the model alone says: no gate but for missing values, no limits [its unit].
    compensated : ndarray of shape (n_wanted,)
        Minus the correction that the compensator had in force: gate, model, limits [its unit].
    outside : ndarray of bool of shape (n_wanted,)
        An input was outside the trained range.
    rejected : ndarray of bool of shape (n_wanted,)
        The gate turned the reading away, though it was complete.
    why : str
        The first reading it turned away; empty if none.
    limits : Limits or None
        None: they were not applied, because the model does not predict micrometres.
    """

    deviation: FloatArray
    compensated: FloatArray
    outside: BoolArray
    rejected: BoolArray
    why: str
    limits: Limits | None


def run(model: ErrorModel, samples: Samples, rows: BoolArray, limits: Limits = Limits()) -> Replayed:
    """Replay a model and a compensator with it over the tests that hold `rows`, from the start of each test.

    A live compensator gets its readings more often than every `Limits.reading_age`, however slowly a test was recorded:
    rows that lie further apart count as so many readings on time, so the rate limit has the whole time between them.

    Parameters
    ----------
    model : ErrorModel
    samples : Samples
    rows : ndarray of bool of shape (n_rows,)
        Rows that are judged.
    limits : Limits
        Of the corrections [um]; a model of another unit runs without them, behind the gate.

    Returns
    -------
    Replayed
    """
    columns, within = _columns(model, samples), limits if model.unit == "um" else None
    n, why = len(samples), ""
    deviation, compensated = np.zeros(n), np.zeros(n)
    outside, rejected = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    for test in np.unique(samples.test[rows]):
        mine = _until(samples, rows, test)
        time = samples.time[mine]
        step = float(np.median(np.diff(time))) if len(mine) > 1 else 0.0
        slow = within and replace(within, reading_age=max(within.reading_age, step))
        found = batch.run(model, slow, time, samples.values[mine][:, columns], _reference(samples, columns, test))
        deviation[mine], compensated[mine] = found.deviation, found.compensated
        outside[mine], rejected[mine] = found.outside, found.rejected
        if found.why and not why:
            why = f"{samples.test_names[test]}: {found.why}"
    return Replayed(deviation[rows], compensated[rows], outside[rows], rejected[rows], why, within)


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
    columns = _columns(model, samples)
    values = samples.values[:, columns]
    usable = np.all(np.isfinite(values), axis=1)
    reference = samples.reference()[:, columns]
    for test in np.unique(samples.test[rows]):
        mine = _until(samples, rows, test)
        state, last = model.init(_reference(samples, columns, test)), samples.time[mine[0]]
        for k, needed in zip(mine, _needed(model, usable[mine], rows[mine]), strict=True):
            if needed:
                reading = values[k] if disturb is None else disturb(values[k], reference[test])
                state, _ = model.step(state, reading, float(samples.time[k] - last))
                last = samples.time[k]
            if rows[k]:
                yield state


def _columns(model: ErrorModel, samples: Samples) -> list[int]:
    names = [c.name for c in samples.inputs]
    return [names.index(i.name) for i in model.inputs]


def _until(samples: Samples, rows: BoolArray, test: int) -> NDArray[np.intp]:
    """Return the rows of a test up to the last wanted one."""
    mine = np.flatnonzero(samples.test == test)
    return mine[: np.flatnonzero(rows[mine]).max() + 1]


def _reference(samples: Samples, columns: list[int], test: int) -> FloatArray | None:
    """Return what counts as zero in a test, if that is given; without it the first reading decides."""
    return None if samples.zero is None else samples.reference()[test, columns]


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
