"""Excerpts of training rows: recognition of copies that were resampled, averaged, shifted in time, rounded or noisy.

Such a copy keeps the noise of the sensors. Two tests of one duty have the same drift, but each has its own noise. So an
excerpt is placed where its drift fits best, and then the signs of the third differences, which are mostly noise, must
agree much more often than by chance. See the decision `0019-overlap`.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.fingerprints import Excerpt, pack_values, unpack_values
from thermocomp.recordings.samples import Samples

#: excerpts per target, rows of each, and channels: the target and the noisiest inputs
EXCERPTS, ROWS, CHANNELS = 6, 120, 3
LEAST_ROWS = 30
#: values are stored in steps of this fraction of their noise
FINE = 2.0
#: noise is visible in third differences that are larger than second differences, and than the smallest step of the
#: channel, by this factor: 1.8 times as large as second differences in white noise, 0 times in a curve
ROUGH = 1.2
#: an excerpt moves by more than this multiple of its noise, otherwise its place is unknown
MOVES = 10.0
#: points of an excerpt for the first search, and places that are searched further
POINTS, PLACES = 24, 3
#: largest difference from a copy at the first search, relative to the excerpt (standard deviations)
UNLIKE = 0.3
#: a copy: signs that agree more often than by chance, by this number of standard deviations, and at least this share
CERTAIN, LEAST_SHARE = 8.0, 0.35
#: the same for the inputs alone
CERTAIN_INPUTS = 4.0


class _Table(NamedTuple):
    """Channels of one test."""

    time: FloatArray  #: (n_rows,) [s]
    interval: float  #: median [s]
    columns: dict[str, FloatArray]


class _Place(NamedTuple):
    """Where an excerpt may have been copied to."""

    excerpt: Excerpt
    values: dict[str, FloatArray]
    begin: float  #: time of its first row in the other test [s]


def take_excerpts(samples: Samples, target: int, learn: BoolArray, most: int = EXCERPTS) -> tuple[Excerpt, ...]:
    """Return excerpts of the training rows in which the target moves.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)
    """
    found = list[tuple[float, Excerpt]]()
    for k in np.unique(samples.test[learn]):
        rows = np.flatnonzero(learn & (samples.test == k) & np.isfinite(samples.deviations[:, target]))
        size = min(ROWS, len(rows))
        if size < LEAST_ROWS:
            continue
        table = _table(samples, target, rows)
        names = _noisiest(table)
        if not names:
            continue
        for a in range(0, len(rows) - size + 1, size):
            part = slice(a, a + size)
            gaps = np.diff(table.time[part])
            if gaps.max() < 1.5 * gaps.min():
                found.append(_excerpt(table, names, part, int(rows[a])))
    parts = [g for g in np.array_split(np.arange(len(found)), most) if g.size]
    best = [max((found[j] for j in g), key=lambda f: f[0]) for g in parts]
    return tuple(excerpt for moves, excerpt in best if moves > MOVES)


def _table(samples: Samples, target: int, rows: IntArray) -> _Table:
    columns = {samples.targets[target].name: samples.deviations[rows, target]}
    columns |= {
        c.name: samples.values[rows, j]
        for j, c in enumerate(samples.inputs)
        if c.quantity == "temperature" and np.isfinite(samples.values[rows, j]).all()
    }
    time = samples.time[rows]
    return _Table(time, float(np.median(np.diff(time))) if len(time) > 1 else 1.0, columns)


def _noisiest(table: _Table) -> list[str]:
    """Return the channels in which noise is visible, the noisiest first, the target in any case among them."""
    first, *_ = table.columns
    rough = {n: typical_change(x, 3) / max(typical_change(x, 2), 1e-12) for n, x in table.columns.items()}
    noisy = [n for n, x in table.columns.items() if rough[n] > ROUGH and typical_change(x, 3) > ROUGH * _resolution(x)]
    others = sorted((n for n in noisy if n != first), key=lambda n: -rough[n])
    return [first, *others[: CHANNELS - 1]] if noisy else []


def _resolution(x: FloatArray) -> float:
    """Return the smallest step of a channel."""
    steps = np.abs(np.diff(x))
    steps = steps[steps > 1e-9 * np.abs(x).max()]
    return float(steps.min()) if steps.size else np.inf


def typical_change(x: FloatArray, order: int) -> float:
    """Return the mean absolute difference of an order, without the largest ones: those of a step, for example."""
    size = np.sort(np.abs(np.diff(x, order)))
    return float(size[: max(int(0.95 * len(size)), 1)].mean()) if size.size else 0.0


def _excerpt(table: _Table, names: Sequence[str], part: slice, row: int) -> tuple[float, Excerpt]:
    values, moves = dict[str, str](), 0.0
    for name in names:
        x = table.columns[name][part]
        noise = max(typical_change(x, 3) / 3.6, 1e-9 * float(np.abs(x).max()), 1e-12)  # 3.6: of white noise
        moves = moves or float(np.ptp(x)) / noise
        values[name] = pack_values(x - x[0], noise / FINE)
    return moves, Excerpt(row, float(np.mean(np.diff(table.time[part]))), values)


# -- recognition -------------------------------------------------------------------------------------------------------


def find_excerpts(
    excerpts: Sequence[Excerpt], learned: Sequence[tuple[int, int]], samples: Samples, target: int, rows: IntArray
) -> IntArray:
    """Return the approximate training row of each of `rows`, which belong to one test; -1 where a row is new.

    Parameters
    ----------
    learned : sequence of (int, int)
        Training sections: see `thermocomp.core.fingerprints.Prints`.
    """
    source = np.full(len(rows), -1, dtype=np.intp)
    rows_in = rows[np.isfinite(samples.deviations[rows, target])]
    if len(rows_in) < LEAST_ROWS // 2 or not excerpts:
        return source
    table = _table(samples, target, rows_in)
    places = [p for e in excerpts for p in _places(e, table)]
    while places:
        lead = places[0]
        # excerpts of one section that are shifted by the same time
        mine = [p for p in places if abs(_shift(p) - _shift(lead)) < max(p.excerpt.interval, table.interval)]
        places = [p for p in places if p not in mine]
        mine = _copied(list({p.excerpt.row: p for p in mine}.values()), table)
        if not mine:
            continue
        lead = mine[0]
        there = lead.excerpt.row + (samples.time[rows] - lead.begin) / lead.excerpt.interval
        known = {p.excerpt.row for p in mine}
        for a, b in ((a, b) for a, b in learned if a <= lead.excerpt.row < b):
            # as far as the next excerpt that is not there
            missing = [e.row for e in excerpts if a <= e.row < b and e.row not in known]
            for row in known:
                first = max([a, *(m for m in missing if m < row)])
                end = min([b, *(m for m in missing if m > row)])
                source = np.where((source < 0) & (there >= first) & (there < end), there.astype(np.intp), source)
    return source


def _shift(place: _Place) -> float:
    """Return the time of training row 0 in the other test [s]."""
    return place.begin - place.excerpt.row * place.excerpt.interval


def _places(excerpt: Excerpt, table: _Table) -> Iterator[_Place]:
    """Yield the places in a test where an excerpt fits best, if it fits at all."""
    values = {n: unpack_values(text) for n, text in excerpt.values.items() if n in table.columns}
    name = next(iter(excerpt.values))
    if name not in values:
        return
    x, y = values[name], table.columns[name]
    span = (len(x) - 1) * excerpt.interval
    step = span / (POINTS - 1)
    grid = np.arange(table.time[0], table.time[-1], step / 2)
    if len(grid) < 2 * POINTS:
        grid = table.time[0] + np.arange(2 * POINTS - 1) * step / 2  # a part of the excerpt is missing at the end
        if table.time[-1] - table.time[0] < 0.9 * span:
            return
    coarse = np.interp(np.arange(POINTS) * step, np.arange(len(x)) * excerpt.interval, x)
    there = sliding_window_view(np.interp(grid, table.time, y), 2 * POINTS - 1)[:, ::2]
    apart = np.std(there - coarse, axis=1) / max(float(np.std(coarse)), 1e-12)
    for j in np.argsort(apart, kind="stable")[:PLACES]:
        if apart[j] < UNLIKE:
            around = grid[j] + np.arange(-step, step, min(excerpt.interval, table.interval))
            least = min(around, key=lambda begin: _misfit(x, excerpt.interval, begin, table, name))
            yield _Place(excerpt, values, float(least))


def _misfit(x: FloatArray, interval: float, begin: float, table: _Table, name: str) -> float:
    found = _at(x, interval, begin, table, name, averaged=False)
    return float(np.std(found[0] - found[1])) if len(found[0]) >= LEAST_ROWS // 2 else np.inf


def _at(
    x: FloatArray, interval: float, begin: float, table: _Table, name: str, *, averaged: bool
) -> tuple[FloatArray, FloatArray]:
    """Return an excerpt and the other test at the same instants, the rows of the one with the longer interval.

    Parameters
    ----------
    averaged : bool
        Rows of the other test are means of rows of the excerpt.
    """
    y, own = table.columns[name], begin + np.arange(len(x)) * interval
    if table.interval < 0.99 * interval:
        inside = (own >= table.time[0]) & (own <= table.time[-1])
        return x[inside], np.interp(own[inside], table.time, y)
    half = table.interval / 2 if averaged else 0.0
    inside = (table.time - half >= own[0]) & (table.time + half <= own[-1])
    at = table.time[inside]
    if not averaged:
        return np.interp(at, own, x), y[inside]
    total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * interval)])
    return (np.interp(at + half, own, total) - np.interp(at - half, own, total)) / table.interval, y[inside]


def _copied(places: Sequence[_Place], table: _Table) -> list[_Place]:
    """Return the places at which the noise of the excerpts is found again, at one shift in time that they share."""
    shortest = min(table.interval, *(p.excerpt.interval for p in places))
    offsets = shortest * np.arange(-4, 5) / 4
    middle = float(np.median([_shift(p) for p in places]))
    longer = table.interval > 1.5 * places[0].excerpt.interval
    best, most = list[tuple[_Place, FloatArray, FloatArray]](), CERTAIN
    for averaged in (False, True) if longer else (False,):
        for offset in offsets:
            found = [(p, *_signs(p, middle + offset, table, averaged=averaged)) for p in places]
            found = [(p, t, i) for p, t, i in found if _share([t, i]) >= LEAST_SHARE]
            if found and (surely := _surely([x for _, *both in found for x in both])) > most:
                best, most = found, surely
    # the target alone may be the same on two days
    known = not any(len(p.values) > 1 for p, *_ in best) or _surely([i for *_, i in best]) > CERTAIN_INPUTS
    return [p for p, *_ in best if known]


def _signs(place: _Place, shift: float, table: _Table, *, averaged: bool) -> tuple[FloatArray, FloatArray]:
    """Return 1 where third differences of excerpt and test have the same sign, -1 where not: of target and inputs."""
    begin, found = shift + place.excerpt.row * place.excerpt.interval, []
    for name, x in place.values.items():
        a, b = _at(x, place.excerpt.interval, begin, table, name, averaged=averaged)
        signs = np.sign(np.diff(a, 3)) * np.sign(np.diff(b, 3)) if len(a) > 3 else np.empty(0)
        found.append(signs[signs != 0.0])
    return found[0], np.concatenate([np.empty(0), *found[1:]])


def _share(signs: Sequence[FloatArray]) -> float:
    """Return the mean of signs."""
    return float(np.concatenate(signs).sum() / max(sum(map(len, signs)), 1))


def _surely(signs: Sequence[FloatArray]) -> float:
    """Return by how many standard deviations signs agree more often than by chance."""
    return float(np.concatenate(signs).sum() / np.sqrt(max(sum(map(len, signs)), 1)))
