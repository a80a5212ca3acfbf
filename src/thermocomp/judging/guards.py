"""Inputs of models during sensor failures: the readings that the watch (sensor monitoring) passes on."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.watch import Watch
from thermocomp.judging.replay import rows_until
from thermocomp.judging.watchrun import run_watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples

#: largest number of temperatures for which simultaneous failures of two are tried; with more, their effect is predicted
FEW = 8


@dataclass(frozen=True)
class Guard:
    """Readings that a watch passes on while sensors read their zero from the start of each test (C-34).

    Parameters
    ----------
    readings : dict of (tuple of str) to dict of int to ndarray of shape (n_rows,)
        By failed sensors, then by column of the samples: the readings passed on, if any differs from the recorded ones.
    """

    watch: Watch
    readings: dict[tuple[str, ...], dict[int, FloatArray]]

    def among(self, place: Sequence[int]) -> "Guard":
        """Return the guard for samples with more inputs: `place` gives the new index of each column."""
        moved = {lost: {place[c]: v for c, v in of.items()} for lost, of in self.readings.items()}
        return Guard(self.watch, moved)


def find_guard(samples: Samples, learn: BoolArray, rows: BoolArray) -> Guard | None:
    """Return the readings that a watch passes on while each temperature, or with few temperatures each pair, fails.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)
        Training rows of the watch.
    rows : ndarray of bool of shape (n_rows,)
        Judged rows: their tests are replayed up to the last of these rows.

    Returns
    -------
    Guard or None
        None if no sensor can be monitored; see `thermocomp.models.watching.find_watch`.
    """
    watch = find_watch(samples, learn)
    return None if watch is None else let_fail(watch, samples, rows)


def let_fail(watch: Watch, samples: Samples, rows: BoolArray) -> Guard:
    """Return the readings that a given watch passes on while each temperature, or each pair of a few, fails.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Judged rows: their tests are replayed up to the last of these rows.
    """
    together = combinations(watch.names, 2) if len(watch.names) <= FEW else ()
    failing = [*((name,) for name in watch.failing), *together]
    names = [c.name for c in samples.inputs]
    columns = [names.index(i.name) for i in watch.inputs]
    cut = np.array([[names[c] in lost for c in columns] for lost in failing])
    found = np.broadcast_to(samples.values[:, columns], (len(failing), len(samples), len(columns))).copy()
    for test in np.unique(samples.test[rows]).tolist():
        mine = rows_until(samples, rows, test, watch.zeroing, columns)
        mine = mine[samples.valid[mine]]
        zero, given = samples.reference()[test][columns], samples.given_zero(test, columns)
        begun = samples.time[mine] > samples.time[mine[0]] + watch.zeroing.at_rest if len(mine) else mine > 0
        missing = begun[:, None] & np.isin(np.arange(len(columns)), watch.speeds)
        for k, failed in enumerate(cut):  # temperatures read their zero, speeds are missing once the zero is known
            values = np.where(failed & ~missing, zero, samples.values[mine][:, columns])
            values[failed & missing] = np.nan
            passed, _ = run_watch(watch, samples.time[mine], values, samples.stands[mine], given)
            found[k, mine] = np.where(np.isnan(passed), zero, passed)  # not replaced, such as a speed not yet explained
    changed = found != samples.values[:, columns]
    changed &= ~np.isnan(found)
    return Guard(
        watch,
        {
            lost: {columns[c]: found[k, :, c].copy() for c in range(len(columns)) if changed[k, :, c].any()}
            for k, lost in enumerate(failing)
        },
    )
