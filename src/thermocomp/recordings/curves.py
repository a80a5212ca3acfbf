"""Whole curves of training sections: recognition of copies in which the noise of the sensors is lost.

Smoothed, thinned or very noisy copies no longer have the noise of the sensors. But under one linear relation of times
their temperatures follow those of the original all the way, and in all of them the fluctuations over some minutes,
mostly of the weather, have the same signs. Two tests of one duty have another weather. See the decision `0019-overlap`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.fingerprints import Excerpt, pack_values, unpack_values
from thermocomp.recordings.excerpts import typical_change
from thermocomp.recordings.samples import Samples

#: least rows that are averaged, and most blocks of all sections together
ROWS, BLOCKS = 5, 600
#: number of temperatures: at least, of another file; at most, stored
LEAST_INPUTS, CHANNELS = 3, 8
#: least number of blocks
LEAST = 30
#: clocks that are searched: duration in the other test, relative to the original
CLOCKS = (1.0, 0.99, 1.01, 0.98, 1.02, 0.97, 1.03, 0.95, 1.05, 0.93, 1.07, 0.9, 1.1, 0.8, 1.25)
#: parts of a curve at the first search, places that are searched further, and first change of their clock
PARTS, PLACES, TURN = 60, 2, 0.02
#: least correlation with a copy at the first search, and at the end of it
SIMILAR, ALIKE = 0.92, 0.98
#: least share of the shorter of the two tests that is compared
OVERLAP = 0.4
#: largest difference from a copy, relative to the movement of a temperature, in three quarters of them; and the number
#: of parts of the curve whose means are compared
APART, POINTS = 0.04, 40
#: largest factor between the movements; noiseless tests at two speeds may differ by nothing else
GAIN = 1.25
#: scales of the fluctuations [block]
SCALES = (1, 2, 4)
#: a copy: in three quarters of the temperatures, signs agree more often than by chance by this number of standard
#: deviations, and by this share
CERTAIN, LEAST_SHARE = 4.0, 0.15
#: two tests with the same noise, by this factor, are from the same instruments; unless they are copies they differ by
#: the noise of both, a copy by less than this share of it (variance)
SAME_NOISE, INDEPENDENT = 1.4, 0.4


class _Map(NamedTuple):
    """A linear relation of times."""

    score: float
    begin: float  #: where the curve begins in the other test [s]
    clock: float  #: duration in the other test, relative to the original


class _Table(NamedTuple):
    """Channels of one test, the target first."""

    time: FloatArray  #: (n_rows,) [s]
    columns: dict[str, FloatArray]


class _Curve(NamedTuple):
    """Means of successive blocks of a training section, the target first."""

    width: float  #: [s]
    means: dict[str, FloatArray]
    noise: dict[str, float]  #: standard deviation of the noise of a mean

    @property
    def length(self) -> int:
        """Return the number of blocks."""
        return len(next(iter(self.means.values())))

    def inside(self, to: _Map, table: _Table) -> slice:
        """Return the blocks that are in another test."""
        edges = to.begin + to.clock * self.width * np.arange(self.length + 1)
        slack = 1e-6 * self.width
        first, end = np.searchsorted(edges, [table.time[0] - slack, table.time[-1] + slack])
        return slice(int(first), max(int(end) - 1, int(first)))


def take_curves(samples: Samples, target: int, learn: BoolArray) -> tuple[Excerpt, ...]:
    """Return block means of each training section.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)

    Returns
    -------
    tuple of Excerpt
        Their interval is the width of a block, their step the noise of a mean.
    """
    tests = [np.flatnonzero(learn & (samples.test == k)) for k in np.unique(samples.test[learn])]
    total = sum(float(np.ptp(samples.time[rows])) for rows in tests)
    found = []
    for rows in tests:
        table = _table(samples, target, rows)
        if len(table.time) < LEAST * ROWS:
            continue
        width = max(ROWS * float(np.median(np.diff(table.time))), total / BLOCKS)
        at = table.time[0] + width * (np.arange(int(np.ptp(table.time) / width)) + 0.5)
        means = {n: _means(table.time, x, at, width) for n, x in table.columns.items()}
        if len(at) >= LEAST and len(names := _chosen(means)) > LEAST_INPUTS:
            noise = {n: _noise(table.time, table.columns[n], width) for n in names}
            values = {n: pack_values(means[n] - means[n][0], noise[n]) for n in names}
            found.append(Excerpt(int(rows[0]), width, values))
    return tuple(found)


def _table(samples: Samples, target: int, rows: IntArray) -> _Table:
    rows = rows[np.isfinite(samples.deviations[rows, target])]
    columns = {samples.targets[target].name: samples.deviations[rows, target]}
    columns |= {
        c.name: samples.values[rows, j]
        for j, c in enumerate(samples.inputs)
        if c.quantity == "temperature" and np.isfinite(samples.values[rows, j]).all()
    }
    return _Table(samples.time[rows], columns)


def _means(time: FloatArray, x: FloatArray, at: FloatArray, width: float) -> FloatArray:
    """Return means over intervals around instants [s]."""
    total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(time))])
    return np.asarray((np.interp(at + width / 2, time, total) - np.interp(at - width / 2, time, total)) / width)


def _noise(time: FloatArray, x: FloatArray, width: float) -> float:
    """Return the standard deviation of the noise of a mean over a width [s]."""
    rows = max(width / float(np.median(np.diff(time))), 1.0)
    # the median does not contain the steps of a duty; it is 0 if most rows repeat their predecessors
    noise = float(np.median(np.abs(np.diff(x, 3)))) / 3.0 or typical_change(x, 3) / 3.6
    return max(noise / float(np.sqrt(rows)), 1e-9 * float(np.abs(x).max()), 1e-12)


def _chosen(means: Mapping[str, FloatArray]) -> list[str]:
    """Return the target and the temperatures that fluctuate, at most `CHANNELS`, from steady to restless."""
    first, *others = means
    others = sorted((n for n in others if typical_change(means[n], 3) > 0.0), key=lambda n: typical_change(means[n], 3))
    n = min(CHANNELS, len(others))
    return [first, *(others[round(k * (len(others) - 1) / max(n - 1, 1))] for k in range(n))]


# -- recognition -------------------------------------------------------------------------------------------------------


def find_curves(
    curves: Sequence[Excerpt],
    learned: Sequence[tuple[int, int]],
    interval: float,
    samples: Samples,
    target: int,
    rows: IntArray,
) -> IntArray:
    """Return the approximate training row of each of `rows`, which belong to one test; -1 where a row is new.

    Parameters
    ----------
    learned : sequence of (int, int)
        Training sections: see `thermocomp.core.fingerprints.Prints`.
    interval : float
        Time between two training rows [s].
    """
    source = np.full(len(rows), -1, dtype=np.intp)
    table = _table(samples, target, rows)
    if len(table.time) < LEAST:
        return source
    for excerpt in curves:
        to = _copied(_unpacked(excerpt, table), table)
        if to is None:
            continue
        there = excerpt.row + np.rint((samples.time[rows] - to.begin) / to.clock / interval)
        for a, b in ((a, b) for a, b in learned if a <= excerpt.row < b):
            source = np.where((source < 0) & (there >= a) & (there < b), there.astype(np.intp), source)
    return source


def _unpacked(excerpt: Excerpt, table: _Table) -> _Curve:
    """Return the channels of a curve that another test has as well."""
    shared = {n: text for n, text in excerpt.values.items() if n in table.columns}
    means = {n: unpack_values(text) for n, text in shared.items()}
    return _Curve(excerpt.interval, means, {n: float(text.split()[0]) for n, text in shared.items()})


def _copied(curve: _Curve, table: _Table) -> _Map | None:
    """Return the relation of times if a test is a copy."""
    first, *_ = table.columns
    inputs = [n for n in curve.means if n != first]
    if first not in curve.means or len(inputs) < LEAST_INPUTS:
        return None
    to = _locate(curve, table, first)
    if to.score < ALIKE:
        return None
    near = [to._replace(begin=to.begin + k * curve.width * to.clock / 4) for k in range(-4, 5)]
    pairs = [_pairs(curve, table, t, inputs) for t in near]
    sure = [_surely(p) for p in pairs]
    k = int(np.argmax(sure))
    if sure[k] < CERTAIN or not _same_course(pairs[k]) or not _same_noise(curve, table, near[k], inputs, pairs[k]):
        return None
    return near[k]


def _pairs(curve: _Curve, table: _Table, to: _Map, names: Sequence[str]) -> list[tuple[FloatArray, FloatArray]]:
    """Return means of a curve and of another test over the same blocks."""
    part = curve.inside(to, table)
    at = to.begin + to.clock * curve.width * (np.arange(part.start, part.stop) + 0.5)
    return [(curve.means[n][part], _means(table.time, table.columns[n], at, to.clock * curve.width)) for n in names]


def _same_course(pairs: Sequence[tuple[FloatArray, FloatArray]]) -> bool:
    """Return whether temperatures follow each other all the way, apart from an offset and a factor near 1."""
    apart, gains = [], []
    for x, y in pairs:
        size = max(len(x) // POINTS, 1)
        n = len(x) // size * size
        a, b = (v[:n].reshape(-1, size).mean(axis=1) for v in (x, y))
        apart.append(float(np.sqrt(max(1.0 - _correlation(a, b) ** 2, 0.0))))
        gains.append(float(np.std(a) / max(float(np.std(b)), 1e-12)))
    return float(np.quantile(apart, 0.75)) <= APART and 1.0 / GAIN <= float(np.median(gains)) <= GAIN


def _surely(pairs: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Return by how many standard deviations fluctuations agree more often than by chance, at the best scale.

    It is that of the temperature below which a quarter of them is; 0 if the share is too small.
    """
    found = 0.0
    for scale in SCALES:
        count = len(pairs[0][0]) / scale - 4
        if count < LEAST:
            continue
        shares = [float(np.mean(np.sign(_third(x, scale)) * np.sign(_third(y, scale)))) for x, y in pairs]
        share = float(np.quantile(shares, 0.25, method="lower"))
        found = max(found, share * float(np.sqrt(count)) if share > LEAST_SHARE else 0.0)
    return found


def _same_noise(
    curve: _Curve, table: _Table, to: _Map, names: Sequence[str], pairs: Sequence[tuple[FloatArray, FloatArray]]
) -> bool:
    """Return whether two tests with equally noisy sensors differ by less than the noise of both; else True."""
    ratios = []
    for name, (x, y) in zip(names, pairs, strict=True):
        gain = _correlation(x, y) * float(np.std(x) / max(float(np.std(y)), 1e-12))
        mine, other = curve.noise[name], abs(gain) * _noise(table.time, table.columns[name], curve.width * to.clock)
        if mine / SAME_NOISE < other < mine * SAME_NOISE:
            differs = float(np.median(np.abs(np.diff(x - gain * y, 3)))) / 3.0
            ratios.append(differs**2 / (mine**2 + other**2))
    return max(ratios, default=0.0) < INDEPENDENT


def _correlation(x: FloatArray, y: FloatArray) -> float:
    """Return the correlation of two arrays; 0 if one is constant."""
    a, b = x - x.mean(), y - y.mean()
    size = float((a @ a) * (b @ b))
    return float(a @ b) / float(np.sqrt(size)) if size > 0.0 else 0.0


def _third(x: FloatArray, scale: int) -> FloatArray:
    """Return third differences of sums over `scale` blocks, at each block."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    y = total[scale:] - total[:-scale]
    for _ in range(3):
        y = y[scale:] - y[:-scale]
    return np.asarray(y)


# -- relation of times -------------------------------------------------------------------------------------------------


def _locate(curve: _Curve, table: _Table, lead: str) -> _Map:
    """Return where a channel of a curve fits best, with the size of the correlation there."""
    x, y, length = curve.means[lead], table.columns[lead], curve.width * curve.length
    part, middle = length / PARTS, curve.width * (np.arange(len(x)) + 0.5)
    edges = np.concatenate([[0.0], middle, [length]])
    coarse = _means(edges, np.pad(x, 1, "edge"), np.asarray(part * (np.arange(PARTS) + 0.5)), part)
    tries = list[_Map]()
    for clock in CLOCKS:
        width = part * clock
        n = int(np.ptp(table.time) / width)
        if n >= 5:
            there = _means(table.time, y, table.time[0] + width * (np.arange(n) + 0.5), width)
            shift, like = _likeness(coarse, there)
            k = int(np.argmax(like))
            tries.append(_Map(float(like[k]), float(table.time[0] + shift[k] * width), clock))
    best = _Map(0.0, 0.0, 1.0)
    for to in sorted(tries, reverse=True)[:PLACES]:
        if to.score > SIMILAR:
            best = max(best, _refined(curve, table, lead, to))
    return best


def _likeness(x: FloatArray, y: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return shifts of x relative to y, and the size of the correlation of what overlaps."""
    x, y = x - x.mean(), y - y.mean()
    one, other = np.ones(len(x)), np.ones(len(y))
    n = np.correlate(other, one, "full")
    a, b = np.correlate(other, x, "full") / n, np.correlate(y, one, "full") / n
    over = np.correlate(y, x, "full") / n - a * b
    size = (np.correlate(other, x**2, "full") / n - a**2) * (np.correlate(y**2, one, "full") / n - b**2)
    like = np.abs(over) / np.sqrt(np.maximum(size, max(1e-12 * float(size.max()), 1e-300)))
    enough = n >= max(OVERLAP * min(len(x), len(y)), 5)
    return np.arange(len(n)) - (len(x) - 1), np.where(enough, like, 0.0)


def _refined(curve: _Curve, table: _Table, lead: str, to: _Map) -> _Map:
    """Return the relation of times near another one at which a channel fits best."""
    half, step, turn = curve.width * curve.length / 2, curve.width * curve.length / PARTS, TURN
    y = table.columns[lead]
    total = np.concatenate([[0.0], np.cumsum((y[1:] + y[:-1]) / 2 * np.diff(table.time))])

    def scored(begin: float, clock: float) -> _Map:
        found = _Map(0.0, begin, clock)
        part = curve.inside(found, table)
        n, most = part.stop - part.start, min(curve.length, float(np.ptp(table.time)) / (clock * curve.width))
        if n < max(LEAST, OVERLAP * most):
            return found
        edges = begin + clock * curve.width * np.arange(part.start, part.stop + 1)
        there = np.diff(np.interp(edges, table.time, total))
        return found._replace(score=abs(_correlation(curve.means[lead][part], there)))

    best = scored(to.begin, to.clock)
    while step > curve.width / 16:
        turns = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        near = [scored(best.begin + i * step - j * turn * half, best.clock + j * turn) for i, j in turns]
        if max(near).score > best.score:
            best = max(near)
        else:
            step, turn = step / 2, turn / 2
    return best
