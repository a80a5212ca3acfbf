"""Samples after a model's watch (sensor monitoring): values of failed sensors are replaced, and the band is wider."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.model import ErrorModel
from thermocomp.core.watch import Watch
from thermocomp.judging.watchrun import run_watch
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.runtime.watchstate import WORDS


def believe(
    model: ErrorModel, samples: Samples, rows: BoolArray, watched: Samples | None = None
) -> tuple[Samples, FloatArray]:
    """Return samples as passed on by a model's watch, and the widening of its band, in the tests of `rows`.

    The samples are unchanged, and nothing is widened, without a watch, or without the speeds that the watch needs. Rows
    without a speed are passed on unchanged.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)

    Returns
    -------
    widening : ndarray of shape (n_rows,)
        See `ErrorModel.widening`; infinite where the model must not run and its correction is held.
    """
    widening, watch, seen = np.ones(len(samples)), model.watch, watched or samples
    if watch is None or not can_look(watch, seen):
        return samples, widening
    names, values = [c.name for c in samples.inputs], samples.values.copy()
    known = [i.name in names for i in watch.inputs]
    places = [names.index(i.name) for i in watch.inputs if i.name in names]
    for test in np.unique(samples.test[rows]).tolist():
        mine, passed, faults = look_through(watch, seen, test)
        values[mine[:, None], places] = passed[:, known]
        cases, which = np.unique(faults, axis=0, return_inverse=True)
        for case, found in enumerate(cases.tolist()):
            failed = {n: WORDS[f] for n, f in zip(watch.failing, found, strict=True) if f and n in model.sensors}
            if failed:
                runs_on = model.may_lose(failed) and not model.wrong_speeds(failed)
                widening[mine[which.ravel() == case]] = model.widening(failed) if runs_on else np.inf
    return replace(samples, values=values), widening


def stack_watched(
    watch: Watch, target: str, recordings: Sequence[Recording], starts: Sequence[Start] | Start | None
) -> Samples | None:
    """Return all rows of recordings with the inputs of a watch, as recorded; None if there are no such inputs."""
    known = [i.name for i in watch.inputs if all(r.has(i.name) for r in recordings)]
    if not known:
        return None
    rezero = any(i.rezero for i in watch.inputs)
    samples = stack(recordings, [target], known, rezero=rezero, zeroing=watch.zeroing, starts=starts)
    called = zip(samples.inputs, known, strict=True)
    return replace(samples, inputs=tuple(replace(channel, name=own) for channel, own in called))


def can_look(watch: Watch, samples: Samples) -> bool:
    """Return whether samples have the spindle speeds that a watch needs."""
    names = [c.name for c in samples.inputs]
    return all(i.name in names for i in watch.inputs if i.quantity != "temperature")


def look_through(watch: Watch, samples: Samples, test: int) -> tuple[NDArray[np.intp], FloatArray, NDArray[np.int8]]:
    """Replay a watch over a test; inputs of the watch that the samples lack are treated as missing.

    Returns
    -------
    rows : ndarray of int of shape (n_rows,)
        Rows of the test.
    passed : ndarray of shape (n_rows, n_inputs)
        Readings passed on, in the order of the watch's inputs.
    faults : ndarray of int of shape (n_rows, n_sensors)
        See `thermocomp.runtime.watchstate.WORDS`.
    """
    names = [c.name for c in samples.inputs]
    known = [i.name in names for i in watch.inputs]
    places = [names.index(i.name) for i in watch.inputs if i.name in names]
    rows = np.flatnonzero(samples.test == test)
    given = np.full((len(rows), len(watch.inputs)), np.nan)
    given[:, known] = samples.values[rows][:, places]
    zero = samples.given_zero(test, places) if all(known) else None
    return rows, *run_watch(watch, samples.time[rows], given, samples.stands[rows], zero)
