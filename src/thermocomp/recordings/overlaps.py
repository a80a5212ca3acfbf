"""Recognition of the training rows of a model in any file; see the decision `0019-overlap`."""

from collections.abc import Iterator

import numpy as np

from thermocomp.core.arrays import IntArray
from thermocomp.core.fingerprints import Prints, Runs, unpack_marks
from thermocomp.recordings.curves import find_curves, take_curves
from thermocomp.recordings.excerpts import find_excerpts, take_excerpts
from thermocomp.recordings.fingerprints import LENGTH, Marks, TargetRows, find_rows, fingerprint, hash_runs
from thermocomp.recordings.samples import Samples

#: minimum length of a match in runs where no input carries information, such as a spindle speed
ALONE = 5
#: relative difference of intervals below which two tests have the same sampling rate
SAME_RATE = 0.05
#: number of excerpts of each test that is compared with the others of a recording
PER_TEST = 3


def overlap(prints: Prints, samples: Samples, target: int) -> IntArray:
    """Find training rows of a model.

    Returns
    -------
    ndarray of int of shape (n_rows,)
        Approximate training row, counted through all tests; -1 where a row is new.
    """
    everything = np.ones(len(samples), dtype=np.bool_)
    source = _overlap(prints, samples, target, samples.interval(everything), own=False)
    for k in range(len(samples.test_names)):
        _add_copies(source, prints, samples, target, k)
    return source


def repeats(samples: Samples, target: int) -> IntArray:
    """Find rows that repeat earlier rows of the same or another test.

    Returns
    -------
    ndarray of int of shape (n_rows,)
        Approximate row of the samples that is repeated; -1 where there is none.
    """
    # tests with other sampling intervals may be copies with fewer rows
    intervals = [samples.interval(samples.test == k) for k in range(len(samples.test_names))]
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


def altered_copies(samples: Samples) -> IntArray:
    """Find rows that repeat rows of an earlier test, but were resampled, averaged, shifted, rounded or made noisy.

    They are recognised in the target that drifts most.

    Returns
    -------
    ndarray of int of shape (n_rows,)
        As of `repeats`.
    """
    source = np.full(len(samples), -1, dtype=np.intp)
    target = int(np.argmax([np.ptp(x[np.isfinite(x)]) if np.isfinite(x).any() else 0.0 for x in samples.deviations.T]))
    for k in range(len(samples.test_names) - 1):
        mine = samples.test == k
        rows = np.flatnonzero(mine)
        prints = Prints(
            interval=samples.interval(mine),
            learned=((int(rows[0]), int(rows[-1]) + 1),),
            steps={},
            runs=(),
            excerpts=take_excerpts(samples, target, mine, most=PER_TEST),
            curves=take_curves(samples, target, mine),
        )
        for later in range(k + 1, len(samples.test_names)):
            _add_copies(source, prints, samples, target, later)
    return source


def _add_copies(source: IntArray, prints: Prints, samples: Samples, target: int, test: int) -> None:
    """Write into `source` the rows of a test that are altered copies; excerpts only if no true copies are known."""
    rows = np.flatnonzero(samples.test == test)
    if prints.excerpts and (source[rows] < 0).all():
        source[rows] = find_excerpts(prints.excerpts, prints.learned, samples, target, rows)
    if prints.curves and (new := source[rows] < 0).any():
        found = find_curves(prints.curves, prints.learned, prints.interval, samples, target, rows)
        source[rows[new]] = found[new]


def _overlap(prints: Prints, samples: Samples, target: int, interval: float, *, own: bool) -> IntArray:
    source = np.full(len(samples), -1, dtype=np.intp)
    rows = find_rows(samples, target)
    columns = {c.name: samples.values[rows.at, j] for j, c in enumerate(samples.inputs)}
    first, *others = prints.steps
    columns = {first: samples.deviations[rows.at, target]} | {n: columns[n] for n in others if n in columns}
    for run, stride in _tries(prints, interval):
        if LENGTH * stride >= len(rows.at):
            continue
        inside = rows.starts(LENGTH * stride)
        marks = {n: np.where(inside, hash_runs(x, prints.steps[n], stride), 0) for n, x in columns.items()}
        found, of = _matches(run, marks)
        there = unpack_marks(run.rows).astype(np.intp)[of]
        # long runs are for files with a different selection of rows than the training files: fewer, or more
        new = ~np.isin(samples.test[rows.at[found]], np.unique(samples.test[source >= 0]))
        if own:
            new &= there + LENGTH * stride <= rows.at[found]
        _fill(source, prints, run, stride, rows, found[new], of[new], own=own)
    return source


def _tries(prints: Prints, interval: float) -> Iterator[tuple[Runs, int]]:
    """Yield runs and the strides at which they may match: for equal numbers of rows, and for equal durations."""
    rate = prints.interval / interval
    for run in prints.runs:
        yield run, run.stride
        stride = max(1, round(run.stride * rate))
        if stride != run.stride and abs(stride / (run.stride * rate) - 1.0) < 0.01:
            yield run, stride


def _matches(run: Runs, marks: dict[str, Marks]) -> tuple[IntArray, IntArray]:
    """Return the rows where a run of the target and a run of an input match a stored run, and the index of that run."""
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
    rows: TargetRows,
    found: IntArray,
    of: IntArray,
    *,
    own: bool,
) -> None:
    """Write into `source` the rows between consecutive matches, and adjacent rows that may also be training rows."""
    learned, moving = unpack_marks(run.rows).astype(np.intp), unpack_marks(run.moving) > 0
    scale = stride / run.stride
    usual = float(np.median(np.diff(learned))) if learned.size > 1 else 0.0
    for mine in _chains(rows.at[found], learned[of], rows.test[found], scale, max(3.0 * usual, 2.0 * LENGTH)):
        here, there = rows.at[found[mine]], learned[of[mine]]
        end = int(rows.at[found[mine[-1]] + LENGTH * stride])
        # one match may be chance; two in changing sections over more than a run are not; more without an input
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
    """Yield matches in the order of the training rows; a few rows may be missing or altered between them."""
    if not len(here):
        return
    went, should = np.diff(here), scale * np.diff(there)
    slack = LENGTH + 0.05 * should
    on = (should > 0) & (np.diff(test) == 0) & (went <= should + slack) & ((went >= should - slack) | (went <= bridge))
    yield from np.split(np.arange(len(here)), np.flatnonzero(~on) + 1)


def _reach(prints: Prints, learned: IntArray, there: IntArray) -> tuple[int, int]:
    """Return the number of training rows before the first match and after the last one that may match as well.

    The limit is the next stored run, or three times the distance of matches, because not every run is recognised; and
    always the end of the training section.
    """
    usual = 3 * max(LENGTH, int(there[-1] - there[0]) // max(len(there) - 1, 1))
    begin, last = int(there[0]), int(there[-1])
    first = next((a for a, b in prints.learned if a <= begin < b), begin)
    stop = next((b for a, b in prints.learned if a <= last < b), last + 1)
    before, after = learned[learned < begin], learned[learned > last]
    low = begin - int(before[-1]) if before.size else begin - first
    high = int(after[0]) - last if after.size else stop - 1 - last
    return min(max(low, usual), begin - first), min(max(high, usual), stop - 1 - last)
