"""Rows used for both training and judging: detect them, and leave them out or reject the judging scheme."""

import numpy as np

from thermocomp.core.arrays import BoolArray, IntArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.judging.splits import Judging
from thermocomp.recordings.overlaps import altered_copies, overlap, repeats
from thermocomp.recordings.samples import Samples

#: a test with a smaller fraction of new rows is not judged
LEAST_NEW = 0.05


def find_learned_rows(model: ErrorModel, samples: Samples) -> BoolArray:
    """Return the rows that were used for training a model.

    Returns
    -------
    ndarray of bool of shape (n_rows,)
        All rows of a test whose hash is in the model's provenance, rows that match its fingerprints, and the remaining
        rows of a test if they are few.
    """
    known = np.zeros(len(samples), dtype=np.bool_)
    if model.provenance is None:
        return known
    known |= np.isin(samples.hashes, model.provenance.data_sha256)[samples.test]
    if model.provenance.prints is not None:
        known |= overlap(model.provenance.prints, samples, 0) >= 0
    judged = np.isfinite(samples.deviations[:, 0])
    for test in np.unique(samples.test[known]):
        mine = samples.test == test
        if np.count_nonzero(mine & judged & ~known) < LEAST_NEW * np.count_nonzero(mine & judged):
            known |= mine
    return known


def refuse_leaks(samples: Samples, judging: Judging) -> None:
    """Reject data in which a row occurs twice, if one copy is used for training and the other for judging."""
    for source in (*(repeats(samples, k) for k in range(len(samples.targets))), altered_copies(samples)):
        copies = np.flatnonzero(source >= 0)
        for split in judging.splits:
            learn, judge = split.learn[copies], split.judge[copies]
            origin = source[copies]
            leaked = (judge & split.learn[origin]) | (learn & split.judge[origin])
            if leaked.any():
                raise InputError(_told(samples, copies, origin, int(np.argmax(leaked)), split.block))


def _told(samples: Samples, copies: IntArray, origin: IntArray, k: int, block: str) -> str:
    # one stretch: consecutive rows that repeat consecutive rows
    breaks = np.flatnonzero((np.diff(copies) > 1) | (np.abs(np.diff(origin)) > 100)) + 1
    a = int(breaks[breaks <= k].max(initial=0))
    b = int(breaks[breaks > k].min(initial=len(copies))) - 1
    later, earlier = (samples.test_names[samples.test[rows[k]]] for rows in (copies, origin))
    return (
        f"{later}: rows {samples.row[copies[a]]}-{samples.row[copies[b]]} repeat rows "
        f"{samples.row[origin[a]]}-{samples.row[origin[b]]} of "
        f"{'the same recording' if later == earlier else earlier} (approximate rows): with {block} left out, the "
        "same data would be used for both training and validation. Delete one of the two copies"
    )
