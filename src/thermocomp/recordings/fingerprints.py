"""Fingerprints of rows: identification of the training rows of a model in any recording or file.

A run is `LENGTH` differences between rows of one channel, rounded to a step, so that a copy with another zero has the
same run. Each run is hashed. Rows are recognised where a run of the target and a run of an input match at the same
rows, at several locations in the same order. The decision `0019-overlap` describes what is detected and what is not.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.fingerprints import Prints, Runs, pack_marks
from thermocomp.recordings.curves import take_curves
from thermocomp.recordings.excerpts import take_excerpts
from thermocomp.recordings.samples import Samples

Marks = NDArray[np.uint32]

#: number of differences in a run
LENGTH = 20
#: strides of the long runs [rows]; the first at which a run spans at most a third of the recording is used
LONG = (60, 12, 6, 4, 2)
#: number of inputs whose runs are stored
INPUTS = 3
#: maximum size of the fingerprints in a model file [byte]; base64 text is a third larger
BYTES = 11_700
#: a run with a half that has more distinct continuations than this carries too little information
WAYS = 4
#: a run that recurs within this number of its lengths is periodic
PERIOD = 5
#: smallest mean third difference where rounding hides the noise [resolution]; at most 1.03 for a smooth curve
ROUGH = 1.2

_BASE, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)


class _Scale(NamedTuple):
    """Rounding step and noise of a channel [its unit]."""

    step: float  #: rounding step of differences
    noise: float  #: standard deviation of the noise of a difference
    resolution: float  #: smallest step in the file


class _Windows(NamedTuple):
    """All runs of differences of one channel at one row spacing (stride), by first row."""

    mark: Marks  #: hash; 0 where a value is missing
    telling: BoolArray  #: the run has enough information to be recognised
    moving: BoolArray  #: the channel changes by more than its noise around the run
    margin: FloatArray  #: smallest distance of a difference from a rounding boundary [step]


class TargetRows(NamedTuple):
    """Rows of all tests in which the target has a number."""

    at: IntArray  #: row numbers in the samples
    test: IntArray  #: index of the first row of the same test, in `at`

    def starts(self, reach: int) -> BoolArray:
        """Return the rows with a row of the same test `reach` rows later; the last `reach` rows are omitted."""
        return np.asarray(self.test[: len(self.test) - reach] == self.test[reach:])


def fingerprint(samples: Samples, target: int, learn: BoolArray, *, thin: bool = True) -> Prints | None:
    """Return the fingerprints of training rows.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)

    Returns
    -------
    Prints or None
        None if no run has enough information to be recognised.
    """
    rows = find_rows(samples, target)
    if len(rows.at) <= LENGTH:
        return None
    first, *others = (samples.targets[target], *samples.inputs)
    channels = {first.name: samples.deviations[rows.at, target]}
    channels |= {c.name: samples.values[rows.at, j] for j, c in enumerate(others)}
    scales = {name: _scale(x) for name, x in channels.items()}
    short = {name: _windows(x, scales[name], 1, rows) for name, x in channels.items() if np.isfinite(x).any()}
    names = [first.name, *_best(short, first.name)]
    # temperatures without information prevent recognition of the target; a spindle speed never carries information
    if first.name not in short or (len(names) == 1 and any(c.quantity == "temperature" for c in others)):
        return None
    found = {1: short}
    for stride in [s for s in LONG if 3 * s * LENGTH <= len(rows.at)][:1]:
        found[stride] = {name: _windows(channels[name], scales[name], stride, rows) for name in names}
    learned = np.concatenate([[0], np.cumsum(~learn[rows.at])])
    runs = []
    for stride, windows in found.items():
        reach = LENGTH * stride
        whole = learned[reach + 1 :] == learned[: len(rows.at) - reach]
        share = 1.0 if len(found) == 1 else 0.6 if stride == 1 else 0.4
        most = int(share * BYTES / (4 * (len(names) + 2))) if thin else len(rows.at)
        runs.append(_kept(windows, names, whole, stride, rows.at, most))
    if not any(run.rows for run in runs):
        return None
    steps = {name: float(scales[name].step) for name in names}
    return Prints(
        interval=samples.interval(learn),
        learned=_stretches(samples, learn),
        steps=steps,
        runs=tuple(runs),
        excerpts=take_excerpts(samples, target, learn) if thin else (),
        curves=take_curves(samples, target, learn) if thin else (),
    )


# -- runs ----------------------------------------------------------------------------------------------------------


def find_rows(samples: Samples, target: int) -> TargetRows:
    """Return the rows in which the target with an index into ``samples.targets`` has a number."""
    at = np.flatnonzero(np.isfinite(samples.deviations[:, target]))
    return TargetRows(at, np.searchsorted(samples.test[at], samples.test[at]))


def _scale(x: FloatArray) -> _Scale:
    """Return the rounding step for the differences of a channel.

    The step is twice their noise, so that a run has about 24 bits and withstands another rounding of the file. If the
    resolution of the file is not much finer, the step is an odd multiple of it: no difference is near a boundary then.
    """
    steps = np.abs(np.concatenate([np.diff(x), np.diff(x, 2)]))
    steps = steps[steps > 1e-9 * np.nanmax(np.abs(x), initial=0.0)]
    third = np.abs(np.diff(x, 3))
    third = third[np.isfinite(third)]
    if third.size == 0 or steps.size == 0:
        return _Scale(1.0, 0.0, 1.0)
    resolution = float(steps.min())
    # for white noise, third differences have ten times the variance of first differences, and contain no drift
    noise = 1.4826 * float(np.median(third)) / np.sqrt(10.0)
    ratio = 2.0 * noise / resolution
    if ratio > 100.0:
        return _Scale(2.0 * noise, noise, resolution)
    return _Scale(resolution * (2.0 * max(round((ratio - 1.0) / 2.0), 0) + 1.0), noise, resolution)


def _rounded(x: FloatArray, step: float, stride: int) -> FloatArray:
    return np.asarray((x[stride:] - x[:-stride]) / step)


def hash_runs(x: FloatArray, step: float, stride: int, length: int = LENGTH) -> Marks:
    """Return the hash of the run that starts at each row; 0 where a value is missing.

    Parameters
    ----------
    x : ndarray of shape (n_rows,)
    step : float
        Rounding step of differences [unit of x].
    """
    ratio = _rounded(x, step, stride)
    finite = np.isfinite(ratio)
    moves = np.rint(np.where(finite, np.clip(ratio, -1e15, 1e15), 0.0)).astype(np.int64).astype(np.uint64)
    n = len(moves) - (length - 1) * stride
    mark, whole = np.full(n, np.uint64(length)), np.ones(n, dtype=np.bool_)
    for k in range(0, length * stride, stride):
        mark = mark * _BASE + moves[k : k + n]
        whole &= finite[k : k + n]
    mark = (mark ^ (mark >> np.uint64(29))) * _MIX
    short = np.maximum(mark >> np.uint64(32), np.uint64(1)).astype(np.uint32)
    return np.where(whole, short, np.uint32(0))


def _windows(x: FloatArray, scale: _Scale, stride: int, rows: TargetRows) -> _Windows:
    """Return the runs of a channel: whether each identifies its rows, its movement and its rounding margin."""
    ratio = np.nan_to_num(_rounded(x, scale.step, stride))
    moves = np.rint(ratio)
    n = len(moves) - (LENGTH - 1) * stride
    inside = rows.starts(LENGTH * stride)
    mark = np.where(inside, hash_runs(x, scale.step, stride), np.uint32(0))
    off = 0.5 - np.abs(ratio - moves)
    bends = moves[stride:] - moves[:-stride]
    rough = np.minimum(np.abs(bends[stride:] - bends[:-stride]), 2.0)
    margin, roughness = np.full(n, 0.5), np.zeros(n)
    for k in range(LENGTH):
        margin = np.minimum(margin, off[k * stride :][:n])
        if k < LENGTH - 2:
            roughness += rough[k * stride :][:n]
    telling = (mark > 0) & _seldom(mark, hash_runs(x, scale.step, stride, LENGTH // 2), stride)
    if scale.step <= scale.resolution:
        telling &= roughness >= ROUGH * (LENGTH - 2)
    return _Windows(mark, telling, _moving(x, scale, rows)[LENGTH * stride // 2 :][:n], margin)


def _seldom(mark: Marks, halves: Marks, stride: int) -> BoolArray:
    """Return the runs that can identify rows: their halves have few distinct continuations, and they do not recur soon.

    Repetitions of a complete run do not exclude it: copies of a recording repeat it as well.
    """
    n, later = len(mark), LENGTH // 2 * stride
    number = np.unique(halves, return_inverse=True)[1]
    whole = np.flatnonzero(mark > 0)
    ways = np.zeros(number.max(initial=-1) + 1, dtype=np.intp)
    for at in (0, later):  # as the first half of a run, and as the second half
        pairs = np.unique((number[whole + at].astype(np.uint64) << np.uint64(32)) | mark[whole])
        halves_of = (pairs >> np.uint64(32)).astype(np.intp)
        ways = np.maximum(ways, np.bincount(halves_of, minlength=len(ways)))
    seldom = ways[number] <= WAYS
    order = whole[np.argsort(mark[whole], kind="stable")]
    soon = (np.diff(mark[order]) == 0) & (np.diff(order) < PERIOD * LENGTH * stride)
    periodic = np.zeros(n, dtype=np.bool_)
    periodic[order[1:][soon]] = periodic[order[:-1][soon]] = True
    return np.asarray(seldom[:n] & seldom[later:][:n] & ~periodic)


def _moving(x: FloatArray, scale: _Scale, rows: TargetRows) -> BoolArray:
    """Return the rows around which a channel changes: its means before and after differ by more than its noise."""
    finite = np.isfinite(x)
    filled = np.interp(np.arange(len(x)), np.flatnonzero(finite), x[finite])
    total = np.concatenate([[0.0], np.cumsum(filled - filled.mean())])
    reach = max(LENGTH, len(x) // 50)
    here = np.arange(len(x))
    last = np.searchsorted(rows.test, rows.test, side="right")
    before, after = np.maximum(here - reach, rows.test), np.minimum(here + reach, last)
    with np.errstate(invalid="ignore", divide="ignore"):
        change = (total[after] - total[here]) / (after - here) - (total[here] - total[before]) / (here - before)
    enough = (here - before >= LENGTH // 2) & (after - here >= LENGTH // 2)
    noise = max(scale.noise, 0.5 * scale.resolution)
    return np.asarray(enough & (np.abs(change) * np.sqrt(np.minimum(here - before, after - here)) > 6.0 * noise))


# -- selection of runs -------------------------------------------------------------------------------------------------


def _best(windows: dict[str, _Windows], target: str) -> list[str]:
    """Return the most informative inputs at runs where the target is informative and changes."""
    mine = windows[target]
    said = {}
    for name, w in windows.items():
        both = mine.telling & w.telling
        if name != target and both.any():
            said[name] = int(both.sum() + (both & mine.moving & w.moving).sum())
    return sorted(said, key=lambda name: -said[name])[:INPUTS]


def _kept(
    windows: dict[str, _Windows], names: list[str], whole: BoolArray, stride: int, at: IntArray, most: int
) -> Runs:
    """Return at most `most` runs, each from a separate section of rows."""
    target, *inputs = (windows[name] for name in names)
    usable, moving, margin = target.telling & whole, target.moving, target.margin
    if inputs:
        usable &= np.logical_or.reduce([w.telling for w in inputs])
        moving = np.logical_or.reduce([w.telling & w.moving for w in inputs]) & target.moving
        margin = np.minimum(margin, np.max([np.where(w.telling, w.margin, 0.0) for w in inputs], axis=0))
    score = margin + moving
    rows = np.flatnonzero(usable)
    if len(rows) > most:
        cell = rows // -(-len(whole) // most)
        order = np.lexsort((-score[rows], cell))
        rows = rows[order[np.flatnonzero(np.diff(cell[order], prepend=-1))]]
    marks = {name: pack_marks(np.where(windows[name].telling, windows[name].mark, 0)[rows]) for name in names}
    return Runs(stride, pack_marks(at[rows].astype(np.uint32)), pack_marks(moving[rows].astype(np.uint32)), marks)


def _stretches(samples: Samples, learn: BoolArray) -> tuple[tuple[int, int], ...]:
    test = np.where(learn, samples.test, -1)
    ends = [0, *(np.flatnonzero(np.diff(test)) + 1).tolist(), len(test)]
    return tuple((a, b) for a, b in pairwise(ends) if test[a] >= 0)
