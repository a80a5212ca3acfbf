"""Offset and drift between the clocks of two loggers, from what both record and from responses to the spindle."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.arrays import FloatArray
from thermocomp.core.machine import Channel
from thermocomp.recordings.recording import Recording

#: largest offset [s] and drift [s/s] searched
FAR, FASTEST = 10_800.0, 300e-6
#: an offset is clear if the half-width of its 90 % interval is at most this [s], or two sampling intervals
CLEAR = 30.0
#: time constants of the responses to the spindle [s]
_LAGS = (30.0, 120.0, 400.0, 1200.0, 3600.0, 10800.0)
#: half-width of the 90 % interval of the delay of a displacement or temperature behind the spindle, and of a
#: displacement behind or before the temperatures [s]
_DELAYED, _HEATED = 25.0, 600.0
#: width of the rows in the coarse and in the fine search, and step of the shifts [s]
_COARSE, _FINE = 60.0, 10.0
_MOST = 6000
#: number of parts of a recording whose agreement gives the interval
_PARTS = 12
#: smallest number of rows, also of means over `_COARSE`
_LEAST = 5 * _PARTS
#: half-width of the 90 % interval of an event between two rows, in sampling intervals
_SAMPLED = 0.45
#: smallest share of rows in which a channel must have a value
_THERE = 0.8
#: width of the means of a temperature that both loggers have, if five rows are not longer [s]
_SMOOTHED = 300.0
#: half-width of the 90 % interval of the difference in delay of two sensors in one place [s]
_SENSORS = 10.0
#: 95 % quantile of the normal distribution, and its standard deviation relative to the median absolute deviation
_NORMAL, _ROBUST = 1.645, 1.4826
#: number of channels examined closely
_CHANNELS = 3


@dataclass(frozen=True)
class ClockOffset:
    """How far the clock of one recording is ahead of that of another.

    Parameters
    ----------
    offset : float
        In the middle of the common hours [s]; positive: the second clock is ahead.
    half : float
        Half-width of the 90 % interval of `offset` [s].
    drift, drift_half : float
        Rate at which the second clock gains on the first, and half-width of its 90 % interval [s/s].
    limit : float
        Largest half-width with which the offset is clear [s].
    evidence : str
        Channels that tell it.
    shared : tuple of str
        Channel of the first and of the second recording that contain the same quantity; empty if none tells it.
    middle : float
        Time to which `offset` applies, in the clock of the first recording [s since its first row].
    """

    offset: float
    half: float
    drift: float
    drift_half: float
    limit: float
    evidence: str
    shared: tuple[str, ...] = ()
    middle: float = 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval of `offset` [s]."""
        return self.offset - self.half, self.offset + self.half

    @property
    def clear(self) -> bool:
        """Whether the offset is known well enough to be applied without being asked for."""
        return self.half <= self.limit


@dataclass(frozen=True, eq=False)
class _Pair:
    """Features recorded by one logger that explain channels recorded by the other.

    Parameters
    ----------
    time : ndarray of shape (n,)
        Times of the features [s].
    features : ndarray of shape (n, n_features)
    clock : ndarray of shape (m,)
        Times of the responses, by the clock of the other logger [s].
    responses : ndarray of shape (m, n_responses)
    doubt : float
        Half-width of the 90 % interval of a shift that data cannot show: sampling, delay of heat [s].
    phi : float
        Correlation of a residual with the next, to begin with.
    names, cause : tuple of str, str
        Channels of the responses, and what explains them.
    shared : tuple of str
        The channel in both recordings, if it is the same quantity.
    swapped : bool
        The features come from the second recording.
    """

    time: FloatArray
    features: FloatArray
    clock: FloatArray
    responses: FloatArray
    doubt: float
    phi: float
    names: tuple[str, ...]
    cause: str
    shared: tuple[str, ...] = ()
    swapped: bool = False

    def binned(self, width: float, *only: int) -> "_Pair":
        """Return the pair with the responses, or one of them, averaged over intervals of some width [s]."""
        clock, responses = _binned(self.clock, self.responses[:, list(only)] if only else self.responses, width)
        return replace(self, clock=clock, responses=responses)


def find_offset(first: Recording, second: Recording) -> ClockOffset | None:
    """Return how far the clock of the second recording is ahead; None if nothing tells it."""
    lead = begin(first, second)
    middle = (max(0.0, lead) + min(float(first.time[-1]), lead + float(second.time[-1]))) / 2
    limit = max(CLEAR, 2 * max(first.sampling_interval, second.sampling_interval))
    best: ClockOffset | None = None
    tiers = _shared(first, second, lead), *(_caused(first, second, lead, heat=heat) for heat in (False, True))
    for tier in tiers:
        for pair in tier:
            rough = _coarse(pair)
            found = None if rough is None else _fine(pair, *rough, middle, limit)
            if found is not None and (best is None or found.half < best.half):
                best = found
        if best is not None and best.clear:
            break
    return best


def agree(x: FloatArray, y: FloatArray, *, noise: bool = False) -> bool:
    """Return whether two channels are of the same quantity in the same place: their values rise and fall together.

    Parameters
    ----------
    noise : bool
        A correlation below 0.99 is accepted only if the difference of the channels is noise, without memory, or small
        in most rows: at the steps of a spindle speed it is large.
    """
    both = np.isfinite(x) & np.isfinite(y)
    x, y = x[both], y[both]
    if len(x) < 3 or not (np.ptp(x) > 0 and np.ptp(y) > 0):
        return bool(len(x) and np.allclose(x, y))
    r, ratio = float(np.corrcoef(x, y)[0, 1]), float(x.std() / y.std())
    rest = x - y - (x - y).mean()
    small = np.median(np.abs(x - y - np.median(x - y))) < 0.05 * x.std()
    lasting = noise and r < 0.99 and not small and float(rest[1:] @ rest[:-1]) > 0.5 * float(rest @ rest)
    return r > 0.9 and 0.8 < ratio < 1.25 and not lasting


def begin(first: Recording, second: Recording) -> float:
    """Return when the second recording begins, by the clocks of both [s]; 0 if one has no timestamps."""
    if not (first.start and second.start):
        return 0.0
    a, b = datetime.fromisoformat(first.start), datetime.fromisoformat(second.start)
    if (a.tzinfo is None) != (b.tzinfo is None):  # a clock without a zone is taken as one of the other's
        a, b = a.replace(tzinfo=None), b.replace(tzinfo=None)
    return (b - a).total_seconds()


def _shared(first: Recording, second: Recording, lead: float) -> Iterator[_Pair]:
    """Yield channels of the same quantity that both recordings contain."""
    there = {(c.name, c.quantity) for c in second.channels}
    names = [(c.name, c.name) for c in first.channels if (c.name, c.quantity) in there]
    if first.speed is not None and second.speed is not None and first.speed.name != second.speed.name:
        names.append((first.speed.name, second.speed.name))
    for a, b in names:
        time, x = _values(first, (a,))
        clock, y = _values(second, (b,))
        if min(len(x), len(y)) >= _LEAST and np.ptp(x) > 0 and np.ptp(y) > 0:
            doubt = _SAMPLED * (_step(time) + _step(clock))  # a new speed began between two rows of either
            if first.channel(a).quantity != "spindle_speed":
                width, doubt = max(_SMOOTHED, 5 * _step(time), 5 * _step(clock)), _SENSORS
                time, x = _smoothed(time, x, width)
                clock, y = _binned(clock, y, width)
            yield _Pair(
                time=time,
                features=x,
                clock=lead + clock,
                responses=y,
                doubt=doubt,
                phi=0.0,
                names=(b,),
                cause="in both" if a == b else f"and {a}",
                shared=(a, b),
            )


def _caused(first: Recording, second: Recording, lead: float, *, heat: bool) -> Iterator[_Pair]:
    """Yield what follows in one recording from the spindle speed in the other, or from its temperatures (`heat`)."""
    for cause, effect, swapped in ((first, second, False), (second, first, True)):
        clock, responses, names = _responses(effect, effect.displacements + effect.temperatures * (not heat))
        channels = cause.temperatures if heat else cause.of_quantity("spindle_speed")[:1]
        time, features, causes = _responses(cause, channels)
        if not (names and causes) or (heat and effect.temperatures):
            continue
        doubt, why = _HEATED, "with the temperatures"
        if heat:
            time, features = _binned(time, features, _COARSE)
        else:
            steps, why = (_step(time), _step(clock)), f"after {causes[0]}"
            doubt = float(np.hypot(_DELAYED, _SAMPLED * sum(steps)))
            features = _felt(time, features, max(steps))
        yield _Pair(
            time=time + lead * swapped,
            features=features,
            clock=clock + lead * (not swapped),
            responses=responses,
            doubt=doubt,
            phi=1.0,
            names=names,
            cause=why,
            swapped=swapped,
        )


def _felt(time: FloatArray, speed: FloatArray, step: float) -> FloatArray:
    """Return what may follow from the spindle speed, (n_rows, n_features): speed and its square, and lags of both."""
    turning = np.abs(speed) / np.abs(speed).max()
    both = np.column_stack([turning, turning**2])
    between = np.vstack([both[:1], (both[1:] + both[:-1]) / 2])  # a new speed began between two rows
    lags = [lag for lag in _LAGS if lag >= step]  # shorter ones are not seen
    slow = lagbank.run(np.tile(between, len(lags)), np.diff(time, prepend=-np.inf), np.repeat(lags, 2))
    return np.column_stack([both, slow])


def _responses(recording: Recording, channels: Sequence[Channel]) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return times, values and names of the channels with few missing values, in the rows where all have one."""
    table = recording.table
    names = tuple(c.name for c in channels if table[c.name].notna().mean() > _THERE and table[c.name].nunique() > 1)
    time, values = _values(recording, names)
    return (time, values, names) if len(time) >= _LEAST else (time, values, ())


def _values(recording: Recording, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return the times and values of channels in the rows where none is missing."""
    x = recording.table[list(names)].to_numpy(dtype=np.float64)
    there = np.isfinite(x).all(axis=1)
    return recording.time[there], x[there]


def _step(time: FloatArray) -> float:
    return float(np.median(np.diff(time)))


def _binned(time: FloatArray, values: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the means of rows over intervals of some width [s], at most `_MOST` of them."""
    width = max(width, float(time[-1] - time[0]) / _MOST)
    if _step(time) >= width:
        return time, values
    edges = np.flatnonzero(np.diff(np.floor((time - time[0]) / width), prepend=-1.0))
    size = np.diff(edges, append=len(time))
    return np.add.reduceat(time, edges) / size, np.add.reduceat(values, edges, axis=0) / size[:, None]


def _smoothed(time: FloatArray, values: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return moving means, 20 per width [s]: interpolated noise would be smallest midway between two rows."""
    grid = np.arange(time[0] + width / 2, time[-1] - width / 2, width / 20)  # empty if it is too short
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:, 0] + values[:-1, 0]) * np.diff(time))])
    ends = [grid - width / 2, grid + width / 2]
    rows = np.searchsorted(time, ends[1]) - np.searchsorted(time, ends[0])
    there = rows > 0.6 * width / _step(time)
    means = (np.interp(ends[1], time, area) - np.interp(ends[0], time, area)) / width
    return grid[there], means[there, None]


def _costs(pair: _Pair, shift: float, phi: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return squared residuals, (n_parts, n_responses), number of rows per part, and correlation with the next row.

    Residuals of the regression of the responses on the features `shift` earlier, both reduced by `phi` times the row
    before (Cochrane and Orcutt): slow drifts of the environment otherwise pass for a response.
    """
    when = pair.clock - shift
    k = np.clip(np.searchsorted(pair.time, when), 1, len(pair.time) - 1)
    a, b = pair.time[k - 1], pair.time[k]
    w = ((when - a) / (b - a))[:, None]
    X, Y = pair.features[k - 1] * (1 - w) + pair.features[k] * w, pair.responses
    good = (w[:, 0] >= 0) & (w[:, 0] <= 1) & (b - a <= 3 * _step(pair.time))
    follows = good[1:] & good[:-1] & (np.diff(pair.clock) < 2.5 * _step(pair.clock))
    part = (np.arange(len(when)) * _PARTS // len(when))[1:][follows]
    n = np.bincount(part, minlength=_PARTS).astype(np.float64)
    if n.sum() < 3 * X.shape[1] + 10:
        return np.full((_PARTS, Y.shape[1]), np.nan), n, np.full(Y.shape[1], phi)
    A, y = ((Z[1:] - phi * Z[:-1])[follows] for Z in (X, Y))
    A, y = A - A.mean(axis=0), y - y.mean(axis=0)
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    size, turn = np.linalg.eigh((A / scale).T @ (A / scale))
    kept = size > 1e-9 * size[-1]
    beta = turn[:, kept] @ (turn[:, kept].T @ ((A.T @ y) / scale[:, None]) / size[kept, None]) / scale[:, None]
    left = Y - X @ beta
    before = left[:-1][follows] - left[:-1][follows].mean(axis=0)
    correlation = (before * left[1:][follows]).sum(axis=0) / np.maximum((before**2).sum(axis=0), 1e-300)
    cost = np.zeros((_PARTS, Y.shape[1]))
    np.add.at(cost, part, (y - A @ beta) ** 2)
    return cost, n, correlation


def _curves(pair: _Pair, shifts: FloatArray, phi: float) -> FloatArray:
    """Return the squared residuals for each shift, (n_shifts, n_parts, n_responses), as if all rows were there."""
    found = [_costs(pair, s, phi) for s in shifts.tolist()]
    cost, n = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    whole = n.sum(axis=1)
    usual = cost.sum(axis=1, keepdims=True) / np.maximum(whole, 1)[:, None, None]
    n = np.minimum(n, most := n.max(axis=0))
    cost = cost + usual * (most - n)[..., None]
    cost[whole < 0.5 * whole.max()] = np.nan
    return np.asarray(cost)


def _coarse(pair: _Pair) -> tuple[list[int], float] | None:
    """Return the responses that tell the shift best, and the shift [s]; None if parts of the recording do not agree."""
    if min(len(pair.time), len(pair.clock)) < _LEAST or len((rough := pair.binned(_COARSE)).clock) < _LEAST:
        return None
    shifts = np.arange(-FAR, FAR + 1, _COARSE)
    cost = _curves(rough, shifts, pair.phi)
    cost = cost[known := np.isfinite(cost).all(axis=(1, 2))]
    shifts = shifts[known]
    if len(shifts) < 2:
        return None
    total = np.log(np.maximum(cost.sum(axis=1), 1e-300))
    best = int(total.sum(axis=1).argmin())
    others = [int(np.log(np.maximum(cost.sum(axis=1) - c, 1e-300)).sum(axis=1).argmin()) for c in cost.swapaxes(0, 1)]
    near = 2.5 * max(_COARSE, _step(rough.clock), _step(pair.time), pair.doubt)
    if np.abs(shifts[others] - shifts[best]).max() > near or best in (0, len(shifts) - 1):
        return None
    sharp = np.minimum(total[max(best - 2, 0)], total[min(best + 2, len(total) - 1)]) - total[best]
    return np.argsort(-sharp)[:_CHANNELS].tolist(), float(shifts[best])


def _fine(pair: _Pair, chosen: Sequence[int], shift: float, middle: float, limit: float) -> ClockOffset | None:
    """Return offset and drift near a shift, with intervals from their likelihood and from leaving out each part."""
    one = pair.binned(_FINE, *chosen)
    clock = one.clock
    long = float(clock[-1] - clock[0])
    reach = 3 * max(_COARSE, _step(clock), _step(pair.time)) + FASTEST * long / 2
    shifts = shift + np.linspace(-reach, reach, 81)
    cost = np.zeros((_PARTS, len(shifts)))
    for k in range(len(chosen)):
        found = _likelihood(replace(one, responses=one.responses[:, [k]]), shifts)
        if not np.isfinite(found).all():
            return None
        cost += found
    part = np.arange(len(clock)) * _PARTS // len(clock)
    away = np.bincount(part, clock) / np.bincount(part) - (middle if pair.swapped else middle + shift)
    drifts = np.linspace(-FASTEST, FASTEST, 61)
    moved = np.array(
        [[np.interp(shifts + d * a, shifts, c) for a, c in zip(away, cost, strict=True)] for d in drifts]
    )  # (n_drifts, n_parts, n_shifts)
    (offset, drift), (half, drift_half) = _estimate(moved, shifts, drifts)
    drift_half = float(np.hypot(drift_half, pair.doubt / long))
    if abs(drift) <= drift_half:  # not told
        (offset, _), (half, _) = _estimate(moved[len(drifts) // 2][None], shifts, drifts[:1])
    if pair.shared:
        there = (clock - offset >= pair.time[0]) & (clock - offset <= pair.time[-1])
        same = np.interp(clock[there] - offset, pair.time, pair.features[:, 0])
        if not agree(same, one.responses[there, 0], noise=True):
            return None
    sign, grid = -1.0 if pair.swapped else 1.0, float(shifts[1] - shifts[0])
    return ClockOffset(
        offset=sign * offset,
        half=float(np.hypot(np.hypot(half, pair.doubt), grid / 2)),
        drift=sign * drift,
        drift_half=drift_half,
        limit=limit,
        evidence=f"{', '.join(pair.names[k] for k in chosen)} {pair.cause}",
        shared=pair.shared,
        middle=middle,
    )


def _likelihood(one: _Pair, shifts: FloatArray) -> FloatArray:
    """Return -2 log-likelihood of a response per part and shift, (n_parts, n_shifts), but for a constant."""
    phi = one.phi
    for _ in range(2):
        rough = _curves(one, shifts[::4], phi).sum(axis=1)
        if not np.isfinite(rough).all():
            return np.full((_PARTS, len(shifts)), np.nan)
        phi = float(np.clip(_costs(one, float(shifts[::4][rough.argmin()]), phi)[2][0], 0.0, 0.999))
    cost = _curves(one, shifts, phi)[..., 0].T
    return cost / max(float(cost.sum(axis=0).min()), 1e-12) * len(one.clock)


def _estimate(cost: FloatArray, shifts: FloatArray, drifts: FloatArray) -> list[list[float]]:
    """Return mean shift and drift by their likelihood, and the half-widths of their intervals.

    Parameters
    ----------
    cost : ndarray of shape (n_drifts, n_parts, n_shifts)
        -2 log-likelihood.
    """
    total = cost.sum(axis=1)
    mean, spread = _mean(total, shifts, drifts)
    without = np.array([_mean(total - cost[:, k], shifts, drifts)[0] for k in range(_PARTS)])
    # the robust spread of what remains without each part: a jackknife in which one odd part does not decide
    left_out = _ROBUST * np.sqrt(_PARTS - 1) * np.median(np.abs(without - np.median(without, axis=0)), axis=0)
    return [mean.tolist(), (_NORMAL * np.hypot(left_out, spread)).tolist()]


def _mean(cost: FloatArray, shifts: FloatArray, drifts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of shift and drift, weighted by their likelihood."""
    weight = np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    along = np.array([(weight.sum(axis=0) @ shifts), (weight.sum(axis=1) @ drifts)])
    square = np.array([weight.sum(axis=0) @ (shifts - along[0]) ** 2, weight.sum(axis=1) @ (drifts - along[1]) ** 2])
    return along, np.sqrt(square)
