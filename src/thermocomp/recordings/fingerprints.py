"""Fingerprints of rows: which rows of a recording a model has learned from, whatever file they stand in.

A run is `LENGTH` differences between rows of one channel, rounded to a step: a copy with another zero has the same.
It is hashed. Rows are known again where a run of the target and a run of an input are, at the same rows, in several
places of the same order. The decision `0019-overlap` tells what is found and what is not.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.fingerprints import Prints, Runs, pack_marks, unpack_marks
from thermocomp.recordings.samples import Samples

Marks = NDArray[np.uint32]

#: differences in a run
LENGTH = 20
#: rows between the rows of the long runs: the first with which a run is at most a third of the recording
LONG = (60, 12, 6, 4, 2)
#: inputs whose runs are kept
INPUTS = 4
#: of fingerprints in a model file [byte]; as text they are a third more
BYTES = 14_000
#: a run whose half goes on in more ways than these says too little
WAYS = 4
#: a run that comes again within so many of its lengths is something periodic
PERIOD = 5
#: runs long that a match has to be where no input says anything, such as a spindle speed
ALONE = 5
#: tests whose intervals differ by less are read at one rate
SAME_RATE = 0.05
#: least mean of the third differences where rounding hides the noise [resolution]; of a smooth curve it is 1.03 at most
ROUGH = 1.2

_BASE, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)


class _Scale(NamedTuple):
    """Of a channel [its unit]."""

    step: float  #: what differences are rounded to
    noise: float  #: standard deviation of a difference that is noise
    resolution: float  #: smallest step in the file


class _Windows(NamedTuple):
    """All runs of one channel at one stride, by their first row."""

    mark: Marks  #: hash; 0 where a value is missing
    telling: BoolArray  #: it has enough information to be known again
    moving: BoolArray  #: the channel moves beyond its noise around it
    margin: FloatArray  #: how far the nearest difference is from being rounded otherwise [step]


class _Rows(NamedTuple):
    """Rows in which the target has a number, of all tests."""

    at: IntArray  #: where they stand in the samples
    test: IntArray  #: index of the first row of their test, in `at`

    def starts(self, reach: int) -> BoolArray:
        """Return the rows that have the row `reach` rows later in the same test, without the last `reach` rows."""
        return np.asarray(self.test[: len(self.test) - reach] == self.test[reach:])


def fingerprint(samples: Samples, target: int, learn: BoolArray, *, thin: bool = True) -> Prints | None:
    """Return the fingerprints of rows that are learned from.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.
    learn : ndarray of bool of shape (n_rows,)
    thin : bool
        Keep as many as a model file shall hold, evenly spread over the rows; of neighbours the one that another
        rounding of the file changes least. Without it all are kept.

    Returns
    -------
    Prints or None
        None if no run says enough to be known again.
    """
    rows = _rows(samples, target)
    if len(rows.at) <= LENGTH:
        return None
    first, *others = (samples.targets[target], *samples.inputs)
    channels = {first.name: samples.deviations[rows.at, target]}
    channels |= {c.name: samples.values[rows.at, j] for j, c in enumerate(others)}
    scales = {name: _scale(x) for name, x in channels.items()}
    short = {name: _windows(x, scales[name], 1, rows) for name, x in channels.items() if np.isfinite(x).any()}
    names = [first.name, *_best(short, first.name)]
    # temperatures that say nothing keep the target from being known again; a spindle speed never says anything
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
        share = (2 if stride == 1 else 1) / (1 if len(found) == 1 else 3)
        most = int(share * BYTES / (4 * (len(names) + 2))) if thin else len(rows.at)
        runs.append(_kept(windows, names, whole, stride, rows.at, most))
    if not any(run.rows for run in runs):
        return None
    steps = {name: float(scales[name].step) for name in names}
    return Prints(_interval(samples, learn), _stretches(samples, learn), steps, tuple(runs))


def overlap(prints: Prints, samples: Samples, target: int) -> IntArray:
    """Find rows that were learned from.

    Parameters
    ----------
    prints : Prints
        Of the rows that were learned from.
    samples : Samples
    target : int
        Index into ``samples.targets``; it is looked up under the target's prints whatever its name.

    Returns
    -------
    ndarray of int of shape (n_rows,)
        Row that was learned from, about, counted through all tests; -1 where a row is new.
    """
    everything = np.ones(len(samples), dtype=np.bool_)
    return _overlap(prints, samples, target, _interval(samples, everything), own=False)


def repeats(samples: Samples, target: int) -> IntArray:
    """Find rows that repeat earlier ones, of the same test or of another.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.

    Returns
    -------
    ndarray of int of shape (n_rows,)
        Row of the samples that is repeated, about; -1 where there is none.
    """
    # tests that were read at other intervals may be copies with fewer rows
    intervals = [_interval(samples, samples.test == k) for k in range(len(samples.test_names))]
    rates: list[float] = []
    for interval in intervals:
        if all(abs(interval / rate - 1.0) > SAME_RATE for rate in rates):
            rates.append(interval)
    group = np.array([np.abs(np.log(i / np.array(rates))).argmin() for i in intervals])[samples.test]
    source = np.full(len(samples), -1, dtype=np.intp)
    for k in range(len(rates)):
        prints = fingerprint(samples, target, group == k, thin=False)
        for other in range(k, len(rates)):
            rows = np.flatnonzero(group == other)
            if prints is None:
                continue
            if other == k:
                found = _overlap(prints, samples, target, rates[k], own=True)[rows]
            else:
                found = _overlap(prints, samples.take(rows), target, rates[other], own=False)
            source[rows] = np.where(source[rows] < 0, found, source[rows])
    return source


# -- runs ----------------------------------------------------------------------------------------------------------


def _rows(samples: Samples, target: int) -> _Rows:
    at = np.flatnonzero(np.isfinite(samples.deviations[:, target]))
    return _Rows(at, np.searchsorted(samples.test[at], samples.test[at]))


def _scale(x: FloatArray) -> _Scale:
    """Return the step that differences of a channel are rounded to.

    It is twice their noise, so that a run has some 24 bits and withstands another rounding of the file; an odd multiple
    of the file's own resolution if that is not much finer: then no difference is near a boundary.
    """
    steps = np.abs(np.concatenate([np.diff(x), np.diff(x, 2)]))
    steps = steps[steps > 1e-9 * np.nanmax(np.abs(x), initial=0.0)]
    third = np.abs(np.diff(x, 3))
    third = third[np.isfinite(third)]
    if third.size == 0 or steps.size == 0:
        return _Scale(1.0, 0.0, 1.0)
    resolution = float(steps.min())
    # of white noise the third differences have ten times the variance of the first; drift is gone from them
    noise = 1.4826 * float(np.median(third)) / np.sqrt(10.0)
    ratio = 2.0 * noise / resolution
    if ratio > 100.0:
        return _Scale(2.0 * noise, noise, resolution)
    return _Scale(resolution * (2.0 * max(round((ratio - 1.0) / 2.0), 0) + 1.0), noise, resolution)


def _rounded(x: FloatArray, step: float, stride: int) -> FloatArray:
    return np.asarray((x[stride:] - x[:-stride]) / step)


def _marks(x: FloatArray, step: float, stride: int, length: int = LENGTH) -> Marks:
    """Return the hash of the run that begins at each row; 0 where a value is missing."""
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


def _windows(x: FloatArray, scale: _Scale, stride: int, rows: _Rows) -> _Windows:
    """Return the runs of a channel, and which of them can be known again."""
    ratio = np.nan_to_num(_rounded(x, scale.step, stride))
    moves = np.rint(ratio)
    n = len(moves) - (LENGTH - 1) * stride
    inside = rows.starts(LENGTH * stride)
    mark = np.where(inside, _marks(x, scale.step, stride), np.uint32(0))
    off = 0.5 - np.abs(ratio - moves)
    bends = moves[stride:] - moves[:-stride]
    rough = np.minimum(np.abs(bends[stride:] - bends[:-stride]), 2.0)
    margin, roughness = np.full(n, 0.5), np.zeros(n)
    for k in range(LENGTH):
        margin = np.minimum(margin, off[k * stride :][:n])
        if k < LENGTH - 2:
            roughness += rough[k * stride :][:n]
    telling = (mark > 0) & _seldom(mark, _marks(x, scale.step, stride, LENGTH // 2), stride)
    if scale.step <= scale.resolution:
        telling &= roughness >= ROUGH * (LENGTH - 2)
    return _Windows(mark, telling, _moving(x, scale, rows)[LENGTH * stride // 2 :][:n], margin)


def _seldom(mark: Marks, halves: Marks, stride: int) -> BoolArray:
    """Return the runs of which neither half goes on in many ways, and which do not come again soon.

    However often all of a run comes, it counts: so do the copies of a recording.
    """
    n, later = len(mark), LENGTH // 2 * stride
    number = np.unique(halves, return_inverse=True)[1]
    whole = np.flatnonzero(mark > 0)
    ways = np.zeros(number.max(initial=-1) + 1, dtype=np.intp)
    for at in (0, later):  # as the beginning of a run, and as its end
        pairs = np.unique((number[whole + at].astype(np.uint64) << np.uint64(32)) | mark[whole])
        halves_of = (pairs >> np.uint64(32)).astype(np.intp)
        ways = np.maximum(ways, np.bincount(halves_of, minlength=len(ways)))
    seldom = ways[number] <= WAYS
    order = whole[np.argsort(mark[whole], kind="stable")]
    soon = (np.diff(mark[order]) == 0) & (np.diff(order) < PERIOD * LENGTH * stride)
    periodic = np.zeros(n, dtype=np.bool_)
    periodic[order[1:][soon]] = periodic[order[:-1][soon]] = True
    return np.asarray(seldom[:n] & seldom[later:][:n] & ~periodic)


def _moving(x: FloatArray, scale: _Scale, rows: _Rows) -> BoolArray:
    """Return the rows around which a channel moves: its mean before and after differs by more than its noise."""
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


# -- what is kept --------------------------------------------------------------------------------------------------


def _best(windows: dict[str, _Windows], target: str) -> list[str]:
    """Return the inputs that say most where the target does, and moves."""
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
    """Return at most `most` runs, one of each of as many stretches of rows."""
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


def _interval(samples: Samples, rows: BoolArray) -> float:
    steps = samples.dt()[rows]
    return float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 1.0


# -- looking up ----------------------------------------------------------------------------------------------------


def _overlap(prints: Prints, samples: Samples, target: int, interval: float, *, own: bool) -> IntArray:
    source = np.full(len(samples), -1, dtype=np.intp)
    rows = _rows(samples, target)
    columns = {c.name: samples.values[rows.at, j] for j, c in enumerate(samples.inputs)}
    first, *others = prints.steps
    columns = {first: samples.deviations[rows.at, target]} | {n: columns[n] for n in others if n in columns}
    for run, stride in _tries(prints, interval):
        if LENGTH * stride >= len(rows.at):
            continue
        inside = rows.starts(LENGTH * stride)
        marks = {n: np.where(inside, _marks(x, prints.steps[n], stride), 0) for n, x in columns.items()}
        found, of = _matches(run, marks)
        there = unpack_marks(run.rows).astype(np.intp)[of]
        # long runs are for files that have other rows than those that were learned from: fewer, or more
        new = ~np.isin(samples.test[rows.at[found]], np.unique(samples.test[source >= 0]))
        if own:
            new &= there + LENGTH * stride <= rows.at[found]
        _fill(source, prints, run, stride, rows, found[new], of[new], own=own)
    return source


def _tries(prints: Prints, interval: float) -> Iterator[tuple[Runs, int]]:
    """Yield runs, and the rows between rows by which they may be found: as they are, and for as much time."""
    rate = prints.interval / interval
    for run in prints.runs:
        yield run, run.stride
        stride = max(1, round(run.stride * rate))
        if stride != run.stride and abs(stride / (run.stride * rate) - 1.0) < 0.01:
            yield run, stride


def _matches(run: Runs, marks: dict[str, Marks]) -> tuple[IntArray, IntArray]:
    """Return where a run of the target and one of an input are those of a run that is kept, and of which."""
    first, *others = run.marks
    stored = {name: unpack_marks(text) for name, text in run.marks.items()}
    known, which = np.unique(stored[first], return_index=True)
    if known.size == 0:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    place = np.minimum(np.searchsorted(known, marks[first]), known.size - 1)
    same = which[place]
    alike = np.full(len(same), not others)
    for name in others:
        if name in marks:
            alike |= (marks[name] == stored[name][same]) & (marks[name] > 0)
    found = np.flatnonzero((marks[first] == known[place]) & (marks[first] > 0) & alike)
    return found, same[found]


def _fill(
    source: IntArray,
    prints: Prints,
    run: Runs,
    stride: int,
    rows: _Rows,
    found: IntArray,
    of: IntArray,
    *,
    own: bool,
) -> None:
    """Write into `source` the rows between matches that follow each other, and those beside them that may be known."""
    learned, moving = unpack_marks(run.rows).astype(np.intp), unpack_marks(run.moving) > 0
    scale = stride / run.stride
    usual = float(np.median(np.diff(learned))) if learned.size > 1 else 0.0
    for mine in _chains(rows.at[found], learned[of], rows.test[found], scale, max(3.0 * usual, 2.0 * LENGTH)):
        here, there = rows.at[found[mine]], learned[of[mine]]
        end = int(rows.at[found[mine[-1]] + LENGTH * stride])
        # one place may be chance: two that move, more than a run long, are not; without an input it takes more
        least = (1.5 if len(run.marks) > 1 else ALONE) * LENGTH * stride
        if np.count_nonzero(moving[of[mine]]) < 2 or end - here[0] < least:
            continue
        low, high = (0, 0) if own else _reach(prints, learned, there)
        whole = rows.at[rows.test == rows.test[found[mine[0]]]]
        a = max(int(here[0] - low * scale), int(whole[0]))
        b = min(max(int(here[-1] + high * scale), end), int(whole[-1]))
        span = np.arange(a, b + 1)
        beyond = np.minimum(span - here[0], 0) + np.maximum(span - here[-1], 0)
        guess = np.interp(span, here, there) + beyond / scale
        source[a : b + 1] = np.where(source[a : b + 1] < 0, np.maximum(guess, 0).astype(np.intp), source[a : b + 1])


def _chains(here: IntArray, there: IntArray, test: IntArray, scale: float, bridge: float) -> Iterator[IntArray]:
    """Yield matches that follow each other as the learned rows did; a few rows may be gone or altered between them."""
    if not len(here):
        return
    went, should = np.diff(here), scale * np.diff(there)
    slack = LENGTH + 0.05 * should
    on = (should > 0) & (np.diff(test) == 0) & (went <= should + slack) & ((went >= should - slack) | (went <= bridge))
    yield from np.split(np.arange(len(here)), np.flatnonzero(~on) + 1)


def _reach(prints: Prints, learned: IntArray, there: IntArray) -> tuple[int, int]:
    """Return how many learned rows before the first match and after the last one may be known too.

    Up to the next run that is kept, or three times as far as matches are apart, as not every run is found again; never
    beyond what was learned from.
    """
    usual = 3 * max(LENGTH, int(there[-1] - there[0]) // max(len(there) - 1, 1))
    begin, last = int(there[0]), int(there[-1])
    first = next((a for a, b in prints.learned if a <= begin < b), begin)
    stop = next((b for a, b in prints.learned if a <= last < b), last + 1)
    before, after = learned[learned < begin], learned[learned > last]
    low = begin - int(before[-1]) if before.size else begin - first
    high = int(after[0]) - last if after.size else stop - 1 - last
    return min(max(low, usual), begin - first), min(max(high, usual), stop - 1 - last)
