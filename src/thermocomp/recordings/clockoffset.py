"""Offset and drift between the clocks of two loggers, from what both record and from responses to the spindle."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.recordings.clockpairs import (
    COARSE,
    LEAST,
    PARTS,
    ClockPair,
    begin,
    find_caused,
    find_shared,
    usual_interval,
)
from thermocomp.recordings.recording import Recording

#: largest offset [s] and drift [s/s] searched
FAR, FASTEST = 10_800.0, 300e-6
#: an offset is clear if the half-width of its 90 % interval is at most this [s], or two sampling intervals
CLEAR = 30.0
#: width of the rows in the fine search [s]
_FINE = 10.0
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


def find_offset(first: Recording, second: Recording) -> ClockOffset | None:
    """Return how far the clock of the second recording is ahead; None if nothing tells it."""
    lead = begin(first, second)
    middle = (max(0.0, lead) + min(float(first.time[-1]), lead + float(second.time[-1]))) / 2
    limit = max(CLEAR, 2 * max(first.sampling_interval, second.sampling_interval))
    best: ClockOffset | None = None
    tiers = find_shared(first, second, lead), *(find_caused(first, second, lead, heat=heat) for heat in (False, True))
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


def _costs(pair: ClockPair, shift: float, phi: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return squared residuals, (n_parts, n_responses), number of rows per part, and correlation with the next row.

    Residuals of the regression of the responses on the features `shift` earlier, both reduced by `phi` times the row
    before (Cochrane and Orcutt): slow drifts of the environment otherwise pass for a response.
    """
    when = pair.clock - shift
    k = np.clip(np.searchsorted(pair.time, when), 1, len(pair.time) - 1)
    a, b = pair.time[k - 1], pair.time[k]
    w = ((when - a) / (b - a))[:, None]
    X, Y = pair.features[k - 1] * (1 - w) + pair.features[k] * w, pair.responses
    good = (w[:, 0] >= 0) & (w[:, 0] <= 1) & (b - a <= 3 * usual_interval(pair.time))
    follows = good[1:] & good[:-1] & (np.diff(pair.clock) < 2.5 * usual_interval(pair.clock))
    part = (np.arange(len(when)) * PARTS // len(when))[1:][follows]
    n = np.bincount(part, minlength=PARTS).astype(np.float64)
    if n.sum() < 3 * X.shape[1] + 10:
        return np.full((PARTS, Y.shape[1]), np.nan), n, np.full(Y.shape[1], phi)
    A, y = ((Z[1:] - phi * Z[:-1])[follows] for Z in (X, Y))
    A, y = A - A.mean(axis=0), y - y.mean(axis=0)
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    size, turn = np.linalg.eigh((A / scale).T @ (A / scale))
    kept = size > 1e-9 * size[-1]
    beta = turn[:, kept] @ (turn[:, kept].T @ ((A.T @ y) / scale[:, None]) / size[kept, None]) / scale[:, None]
    left = Y - X @ beta
    before = left[:-1][follows] - left[:-1][follows].mean(axis=0)
    correlation = (before * left[1:][follows]).sum(axis=0) / np.maximum((before**2).sum(axis=0), 1e-300)
    cost = np.zeros((PARTS, Y.shape[1]))
    np.add.at(cost, part, (y - A @ beta) ** 2)
    return cost, n, correlation


def _curves(pair: ClockPair, shifts: FloatArray, phi: float) -> FloatArray:
    """Return the squared residuals for each shift, (n_shifts, n_parts, n_responses), as if all rows were there."""
    found = [_costs(pair, s, phi) for s in shifts.tolist()]
    cost, n = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    whole = n.sum(axis=1)
    usual = cost.sum(axis=1, keepdims=True) / np.maximum(whole, 1)[:, None, None]
    n = np.minimum(n, most := n.max(axis=0))
    cost = cost + usual * (most - n)[..., None]
    cost[whole < 0.5 * whole.max()] = np.nan
    return np.asarray(cost)


def _coarse(pair: ClockPair) -> tuple[list[int], float] | None:
    """Return the responses that tell the shift best, and the shift [s]; None if parts of the recording do not agree."""
    if min(len(pair.time), len(pair.clock)) < LEAST or len((rough := pair.binned(COARSE)).clock) < LEAST:
        return None
    shifts = np.arange(-FAR, FAR + 1, COARSE)
    cost = _curves(rough, shifts, pair.phi)
    cost = cost[known := np.isfinite(cost).all(axis=(1, 2))]
    shifts = shifts[known]
    if len(shifts) < 2:
        return None
    total = np.log(np.maximum(cost.sum(axis=1), 1e-300))
    best = int(total.sum(axis=1).argmin())
    others = [int(np.log(np.maximum(cost.sum(axis=1) - c, 1e-300)).sum(axis=1).argmin()) for c in cost.swapaxes(0, 1)]
    near = 2.5 * max(COARSE, usual_interval(rough.clock), usual_interval(pair.time), pair.doubt)
    if np.abs(shifts[others] - shifts[best]).max() > near or best in (0, len(shifts) - 1):
        return None
    sharp = np.minimum(total[max(best - 2, 0)], total[min(best + 2, len(total) - 1)]) - total[best]
    return np.argsort(-sharp)[:_CHANNELS].tolist(), float(shifts[best])


def _fine(pair: ClockPair, chosen: Sequence[int], shift: float, middle: float, limit: float) -> ClockOffset | None:
    """Return offset and drift near a shift, with intervals from their likelihood and from leaving out each part."""
    one = pair.binned(_FINE, *chosen)
    clock = one.clock
    long = float(clock[-1] - clock[0])
    reach = 3 * max(COARSE, usual_interval(clock), usual_interval(pair.time)) + FASTEST * long / 2
    shifts = shift + np.linspace(-reach, reach, 81)
    cost = np.zeros((PARTS, len(shifts)))
    for k in range(len(chosen)):
        found = _likelihood(replace(one, responses=one.responses[:, [k]]), shifts)
        if not np.isfinite(found).all():
            return None
        cost += found
    part = np.arange(len(clock)) * PARTS // len(clock)
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
    half = max(half, _apart(moved[len(drifts) // 2], shifts, 4 * max(half, _FINE) + FASTEST * long))
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


def _apart(cost: FloatArray, shifts: FloatArray, usual: float) -> float:
    """Return how far the part that disagrees most about the shift is off [s]: a clock was set; 0 if within `usual`."""
    means, spreads = np.array([_mean(c[None], shifts, np.zeros(1)) for c in cost])[..., 0].T
    off = np.abs(means - np.median(means))
    known = off[off > usual + 4 * spreads]  # a part without a run of the spindle tells nothing
    return float(known.max(initial=0.0))


def _likelihood(one: ClockPair, shifts: FloatArray) -> FloatArray:
    """Return -2 log-likelihood of a response per part and shift, (n_parts, n_shifts), but for a constant."""
    phi = one.phi
    for _ in range(2):
        rough = _curves(one, shifts[::4], phi).sum(axis=1)
        if not np.isfinite(rough).all():
            return np.full((PARTS, len(shifts)), np.nan)
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
    without = np.array([_mean(total - cost[:, k], shifts, drifts)[0] for k in range(PARTS)])
    # the robust spread of what remains without each part: a jackknife in which one odd part does not decide
    left_out = _ROBUST * np.sqrt(PARTS - 1) * np.median(np.abs(without - np.median(without, axis=0)), axis=0)
    return [mean.tolist(), (_NORMAL * np.hypot(left_out, spread)).tolist()]


def _mean(cost: FloatArray, shifts: FloatArray, drifts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of shift and drift, weighted by their likelihood."""
    weight = np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    along = np.array([(weight.sum(axis=0) @ shifts), (weight.sum(axis=1) @ drifts)])
    square = np.array([weight.sum(axis=0) @ (shifts - along[0]) ** 2, weight.sum(axis=1) @ (drifts - along[1]) ** 2])
    return along, np.sqrt(square)
