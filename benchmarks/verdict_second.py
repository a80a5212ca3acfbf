"""Second set of generated recordings for `bench_verdict.py`, by an author who had not seen the code of the verdict.

In the nulls the drift [um] has nothing to do with the temperatures. In the truths (``true_...``) it is a linear sum of
lagged temperature rises, plus a part that no sensor sees, scaled until the best possible model (the true coefficients)
leaves a stated share of what the strongest simple opponent leaves: the geometric mean over the cycles is the share, the
standard deviation of the logarithm of the ratio is the spread, and in no cycle does it leave more than 0.9 of what any
of the opponents leaves (in one record also with each cycle re-zeroed). The opponents are no compensation, the mean of
the other cycles, the last value of the cycle before, and the mean curve of the other cycles over the time since their
start. `KINDS` has all of them by name.
"""

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np

from verdict_case import FRESH, Case, File, FloatArray, Make, times
from verdict_machine import (
    PROCESSES,
    RNG,
    H,
    days,
    lag,
    logu,
    one_record,
    plant,
    process,
    profile,
    read,
    repeats,
    rms,
    schedule,
    smooth,
    steps,
    weather,
)

# -- nulls -------------------------------------------------------------------------------------------------------------


def null_starts(kind: str) -> Make:
    """Return separate cold starts on different days.

    The drift of each is an independent process from an unseen cause, zeroed at the start; the temperatures are others
    of that kind or (not daily, trend) a true warm-up by the spindle.
    """

    def make(rng: RNG) -> Case:
        k, m, same, size = int(rng.integers(4, 11)), int(rng.integers(3, 9)), rng.random() < 0.5, logu(rng, 3, 40)
        (dt, n), stamps = steps(rng), days(rng, 10) if rng.random() < 0.7 else [""] * 10
        machine, warm = plant(rng, m, same), kind not in ("daily", "trend") and rng.random() < 0.5
        duty = rng.random() < 0.3 and warm
        v, files, spread, told = profile(rng, n, dt, 5000), [], logu(rng, 0.5, 5), warm or rng.random() < 0.4
        plan = schedule(rng, n, dt, m) if duty else None
        for i in range(k):
            n_i = n if duty else int(np.clip(n * rng.uniform(0.8, 1.25), 40, 150))
            v = v if duty else profile(rng, n_i, dt, 5000)
            air = weather(rng, n_i, dt)
            if warm:
                T = machine(rng, v, dt, air, air[0], plan)
            else:
                T = air[0] + spread * process(kind, rng, n_i, dt, m, same)
            T, y = read(rng, T, size * process(kind, rng, n_i, dt, 1)[:, 0])
            files.append(File(times(n_i, dt), T, v if told else None, y, [(0, n_i)], stamps[i]))
        return Case(files, null=True, duty=bool(duty))

    return make


def null_series(kind: str, k: int, split: bool = False) -> Make:
    """Return one record, zeroed once, cut into k cycles or (`split`) into files that continue each other.

    Drift and temperatures are unrelated processes that run on through all cycles, so the cycles prove nothing one by
    one.
    """

    def make(rng: RNG) -> Case:
        (dt, n), m, same = steps(rng), int(rng.integers(3, 9)), rng.random() < 0.5
        bounds = [(i * n, (i + 1) * n) for i in range(k)]
        T = rng.uniform(18, 25) + logu(rng, 0.5, 5) * process(kind, rng, k * n, dt, m, same) + rng.uniform(-0.7, 0.7, m)
        T, y = read(rng, T, logu(rng, 3, 40) * process(kind, rng, k * n, dt, 1)[:, 0])
        v = profile(rng, k * n, dt, 5000) if rng.random() < 0.3 else None
        start = days(rng, 1)[0] if rng.random() < 0.7 else ""
        return Case(one_record(T, y, v, dt, bounds, start, split), null=True)

    return make


def one_warmup(k: int, split: bool = False) -> Make:
    """Return one warm-up: the spindle runs about 45 min and rests 15, k times.

    The sensors show its sawtooth on a slow warm-up. The drift comes from something unseen switched on in the morning
    (hydraulic unit): slow, of its own time constant, any sign, may overshoot, no sawtooth. One warm-up of two slow
    things, not k proofs.
    """

    def make(rng: RNG) -> Case:
        dt, n, v = repeats(rng, k)
        m, same, N = int(rng.integers(3, 9)), rng.random() < 0.6, k * n
        air, t = weather(rng, N, dt, 0.3), np.arange(N) * dt
        machine = plant(rng, m, same)
        t1, t2 = N * dt * logu(rng, 0.12, 0.8), N * dt * logu(rng, 0.1, 1.5)
        y = (1 - np.exp(-t / t1)) - (rng.random() < 0.4) * rng.uniform(0.3, 0.9) * (1 - np.exp(-t / t2))
        y = y + rng.uniform(0, 0.08) * smooth(rng, N, dt, 2 * H, 1)[:, 0]
        T = machine(rng, v, dt, air, air[0], np.zeros((N, m)))
        T, y = read(rng, T, rng.choice([-1, 1]) * logu(rng, 5, 40) * y / np.abs(y).max())
        bounds = [(i * n, (i + 1) * n) for i in range(k)]
        return Case(one_record(T, y, v, dt, bounds, days(rng, 1)[0], split), null=True, duty=True)

    return make


def one_day(k: int, stamped: bool) -> Make:
    """Return k files cut from one day with breaks, with or without time stamps.

    The displacement is re-zeroed at the start of each file, temperatures are as read. Below all of them run a daily
    wave and a trend of the drift, and others of the temperatures: one day, not k trials.
    """

    def make(rng: RNG) -> Case:
        dt, m, same = float(rng.choice([60, 75, 90])), int(rng.integers(3, 9)), rng.random() < 0.5
        rows = rng.integers(40, int(min(110, 13 * H / dt / k)), k)
        first = np.cumsum(np.r_[0, rows[:-1] + rng.integers(int(600 // dt), int(3000 // dt), k - 1)])
        parts = list(zip(first.tolist(), rows.tolist(), strict=True))
        N = int(first[-1] + rows[-1])

        def wave(m: int, same: bool = False) -> FloatArray:
            return process("daily", rng, N, dt, m, same) + rng.uniform(0.3, 1) * process("trend", rng, N, dt, m, same)

        y = logu(rng, 5, 30) * wave(1)[:, 0]
        T = rng.uniform(18, 24) + logu(rng, 1, 5) * wave(m, same)
        v, row = profile(rng, N, dt, 5000), np.arange(N)
        v = v * np.any([(row >= a) & (row < a + n) for a, n in parts], axis=0)
        if rng.random() < 0.5:  # the spindle warms the sensors too
            T = T + rng.uniform(0.1, 0.4) * (plant(rng, m, same)(rng, v, dt, np.zeros(N), 0.0))
        t0, files = datetime.fromisoformat(days(rng, 1)[0][:10] + "T06:10:00"), []
        for a, n in parts:
            T_i, y_i = read(rng, T[a : a + n], y[a : a + n])
            stamp = (t0 + timedelta(seconds=a * dt)).isoformat() if stamped else ""
            files.append(File(times(n, dt), T_i, v[a : a + n], y_i, [(0, n)], stamp))
        return Case(files, null=True)

    return make


def same_drift(rng: RNG) -> Case:
    """Return days with the same drift curve whatever the machine does, say a clocked tank heater moves the bed.

    Spindle speeds, or with one duty other causes unrelated to it, make other temperatures each day. The mean curve is
    right.
    """
    k, m, same, (dt, n) = int(rng.integers(4, 9)), int(rng.integers(3, 9)), rng.random() < 0.4, steps(rng)
    duty = rng.random() < 0.5
    v, machine, stamps = profile(rng, n, dt, 5000), plant(rng, m, same), days(rng, 9)
    t, size = times(n, dt), logu(rng, 5, 40) * rng.choice([-1, 1])
    y = size * (1 - np.exp(-t / logu(rng, 0.2 * H, 3 * H)) + rng.uniform(0, 0.5) * smooth(rng, n, dt, 0.5 * H, 1)[:, 0])
    files = []
    for i in range(k):
        air, v_i = weather(rng, n, dt), v
        if duty:
            T = air[0] + logu(rng, 1, 5) * process(str(rng.choice(["walk", "trend"])), rng, n, dt, m, same)
        else:
            v_i = profile(rng, n, dt, 5000)
            T = machine(rng, v_i, dt, air, air[0])
        T_i, y_i = read(rng, T, y)
        files.append(File(t, T_i, v_i, y_i, [(0, n)], stamps[i]))
    return Case(files, null=True, duty=duty)


def near_copies(percent: int, shifted: bool = False) -> Make:
    """Return one null cycle six times: one observation, not six.

    The sensors differ from copy to copy by smooth curves of some percent of their spread (another clamp, another
    draught), the drift only by its noise. With `shifted`, each copy begins at another row of the first quarter and is
    re-zeroed there, so that the mean curve does not give it away.
    """

    def make(rng: RNG) -> Case:
        m, same, (dt, n) = int(rng.integers(3, 9)), rng.random() < 0.4, steps(rng)
        kind = str(rng.choice(["walk", "trend", "daily", "ar1"]))
        N = n + (n // 4 if shifted else 0)
        warm, v, air = rng.random() < 0.5, profile(rng, N, dt, 5000), weather(rng, N, dt)
        T = plant(rng, m, same)(rng, v, dt, air, air[0]) if warm else air[0] + 3 * process("walk", rng, N, dt, m, same)
        y, files = logu(rng, 5, 40) * process(kind, rng, N, dt, 1)[:, 0], []
        stamps = days(rng, 6) if rng.random() < 0.6 else [""] * 6
        for i in range(6):
            a = int(rng.integers(0, N - n + 1))
            other = percent / 100 * T.std(axis=0) * smooth(rng, n, dt, n * dt / 5, m)
            T_i, y_i = read(rng, T[a : a + n] + other, y[a : a + n])
            files.append(File(times(n, dt), T_i, v[a : a + n] if warm else None, y_i, [(0, n)], stamps[i]))
        return Case(files, null=True, duty=not shifted)

    return make


# -- truths ------------------------------------------------------------------------------------------------------------


def opponents(ys: Sequence[FloatArray]) -> FloatArray:
    """Return the RMS that each opponent leaves in each cycle, see the top of this file."""
    size, out = np.array([len(y) for y in ys]), []
    P = np.stack([np.r_[y, np.zeros(size.max() - len(y))] for y in ys])
    there, total = np.arange(size.max()) < size[:, None], P.sum()
    for i, y in enumerate(ys):
        top = np.delete(size, i).max()
        curve = (P.sum(axis=0) - P[i])[:top] / (there.sum(axis=0) - there[i])[:top]
        mean = (total - y.sum()) / (size.sum() - len(y))
        last = ys[i - 1][-1] if i else 0.0
        out.append([rms(y), rms(y - mean), rms(y - last), rms(y - curve[np.minimum(np.arange(len(y)), top - 1)])])
    return np.array(out).T


def calibrate(
    rng: RNG,
    seen: Sequence[FloatArray],
    unseen: Callable[[FloatArray], Sequence[FloatArray]],
    noise: Sequence[FloatArray],
    share: float,
    spread: float,
    record: bool,
) -> list[FloatArray] | None:
    """Return the drift of each cycle, with the unseen part scaled to share and spread, see the top of this file.

    None if that cannot be had, or if the best possible model would do harm somewhere.
    """
    z = rng.normal(size=len(seen))
    goal = np.log(share) + spread * (z - z.mean()) / z.std(ddof=1)
    if goal.max() > np.log(0.9):
        return None
    a = np.full(len(z), share * rms(np.concatenate(seen)))
    for _ in range(40):
        left = [u + e for u, e in zip(unseen(a), noise, strict=True)]
        ys = [s + r for s, r in zip(seen, left, strict=True)]
        opp = opponents(ys)
        best = opp[np.argmin(np.sqrt(np.mean(opp**2, axis=1)))]
        miss = goal - np.log([rms(r) for r in left] / best)
        if np.abs(miss).max() < 0.03:
            break
        a = a * np.exp(0.7 * np.clip(miss, -1, 1))
    harm = best.max() > 4 * best.min() or any(rms(r) > 0.9 * o for r, o in zip(left, opp.min(axis=0), strict=True))
    if record:  # nor when each cycle is zeroed at its own start
        least = opponents([y - y[0] for y in ys]).min(axis=0)
        harm = harm or any(rms(r - r[0]) > 0.9 * o for r, o in zip(left, least, strict=True))
    return None if harm or np.abs(miss).max() > 0.06 else ys


def hidden(rng: RNG, n: int, dt: float) -> FloatArray:
    """Return what no sensor sees (coolant hunting, chips, draughts): a curve of 3-10 min memory, 0 at the start."""
    return smooth(rng, n, dt, 60 * logu(rng, 3, 10), 1)[:, 0]


def law(rng: RNG, m: int) -> Callable[[Sequence[FloatArray], float], list[FloatArray]]:
    """Return the law of the drift: a weighted sum of the sensors' rises since the file's start, 10 to 60 um RMS.

    Each rise goes through a lag of 0 to 40 min.
    """
    b, tau, size = rng.normal(size=m), 60 * rng.uniform(0, 40, m) * (rng.random(m) < 0.7), logu(rng, 10, 60)

    def drift(Ts: Sequence[FloatArray], dt: float) -> list[FloatArray]:
        raw = [lag(T - T[0], dt, tau) @ b for T in Ts]
        return [size * r / rms(np.concatenate(raw)) for r in raw]

    return drift


def insist(once: Callable[[RNG], Case | None]) -> Make:
    """Return a function that draws until the stated share can be had."""

    def make(rng: RNG) -> Case:
        while (case := once(rng)) is None:
            pass
        return case

    return make


def true_starts(k: int, share: tuple[float, float], spread: float, repeat: bool = False) -> Make:
    """Return cold starts on different days, each with its own speeds or (`repeat`) of one duty in different weather.

    Spindle, axes, coolant and air are heated on their own, so the sensors are not collinear and determine the drift
    through lags; a part that no sensor sees remains, a share between two bounds. With `repeat`, the machine starts up
    to 5 K off the air, which goes its own way each day.
    """

    def once(rng: RNG) -> Case | None:
        (dt, n), m = steps(rng), int(rng.integers(3, 9))
        n = max(n, int(1.2 * H / dt))
        machine, v = plant(rng, m, False), profile(rng, n, dt, 5000)
        rows = [n if repeat else int(np.clip(n * rng.uniform(0.85, 1.2), 40, 150)) for _ in range(k + FRESH)]
        vs = [v if repeat else profile(rng, r, dt, rng.uniform(2000, 5000)) for r in rows]
        airs = [weather(rng, r, dt, 2.0 if repeat else 1.0) for r in rows]
        plan = schedule(rng, n, dt, m) if repeat else None
        Ts = [
            machine(rng, s, dt, a, a[0] + (rng.uniform(-5, 5) if repeat else 0.0), plan)
            for s, a in zip(vs, airs, strict=True)
        ]
        seen, noise, e = law(rng, m)(Ts, dt), logu(rng, 0.05, 0.5), logu(rng, 0.01, 0.05)
        raw, errs = [hidden(rng, r, dt) for r in rows], [noise * rng.normal(size=r) for r in rows]
        left = rng.uniform(*share) if share[0] < share[1] else share[0]

        def unseen(a: FloatArray) -> list[FloatArray]:
            return [s * u for s, u in zip(a, raw, strict=False)]

        zeroed = [x - x[0] for x in errs]
        ys = calibrate(rng, seen[:k], unseen, zeroed[:k], left, spread, False)
        if ys is None:
            return None
        size = np.exp(np.mean([np.log(rms(y - s) / rms(u)) for y, s, u in zip(ys, seen, raw, strict=False)]))
        fresh = unseen(size * np.exp(spread * rng.normal(size=len(rows))))
        ys += [s + u + e for s, u, e in zip(seen, fresh, zeroed, strict=True)][k:]
        Ts = [np.round(T + e * rng.normal(size=T.shape), 2) for T in Ts]
        parts = zip(rows, Ts, vs, ys, days(rng, k + FRESH), strict=True)
        files = [File(times(r, dt), T, s, y, [(0, r)], d) for r, T, s, y, d in parts]
        return Case(files[:k], null=False, duty=repeat, fresh=files[k:])

    return insist(once)


def true_record(share: float, spread: float, repeat: bool = False, split: bool = False) -> Make:
    """Return one record of 12 to 48 h: speeds in random order, or (`repeat`) about 45 min on and 15 off.

    Runs and stops are of random length, there are other sources and the daily wave of the air, and the drift follows
    the sensors through lags. With `split`, it is kept as files that continue each other.
    """

    def once(rng: RNG) -> Case | None:
        k, m = int(rng.integers(6, 11)), int(rng.integers(3, 9))
        if repeat:
            dt, n, v = repeats(rng, k)
            rows = [n] * k
        else:
            dt, v, rows = float(rng.choice([75, 90, 120])), np.empty(0), []
            for s in rng.permutation(np.linspace(rng.uniform(200, 1200), rng.uniform(3500, 5000), k)):
                run, stop = rng.integers(35, 100), rng.integers(10, 50)
                v = np.r_[v, np.full(run, round(s / 10) * 10), np.zeros(stop)]
                rows.append(int(run + stop))
        N, cut = len(v), np.cumsum(rows)[:-1]
        if not repeat and not 12 * H <= N * dt <= 48 * H:
            return None
        air, same = weather(rng, N, dt), rng.random() < 0.3
        plan = np.tile(schedule(rng, n, dt, m), (k, 1)) if repeat else None
        T = plant(rng, m, same)(rng, v, dt, air, air[0], plan)
        seen, raw = law(rng, m)([T], dt)[0], hidden(rng, N, dt)
        noise, e = logu(rng, 0.05, 0.5) * rng.normal(size=N), logu(rng, 0.01, 0.05)
        mid = np.cumsum(rows) - np.array(rows) / 2

        def unseen(a: FloatArray) -> list[FloatArray]:  # one curve whose size changes smoothly from cycle to cycle
            return np.split(raw * np.exp(np.interp(np.arange(N), mid, np.log(a))), cut)

        ys = calibrate(rng, np.split(seen, cut), unseen, np.split(noise - noise[0], cut), share, spread, True)
        if ys is None:
            return None
        T = np.round(T + e * rng.normal(size=T.shape), 2)
        bounds = list(pairwise([0, *cut.tolist(), N]))
        return Case(one_record(T, np.concatenate(ys), v, dt, bounds, days(rng, 1)[0], split), null=False, duty=repeat)

    return insist(once)


KINDS: dict[str, Make] = {
    **{kind.replace("daily", "daily_drift"): null_starts(kind) for kind in PROCESSES},
    **{f"{kind}_one_series_{n}": null_series(kind, n) for kind in PROCESSES for n in (4, 6, 10)},
    **{f"{kind}_continued_files_6": null_series(kind, 6, split=True) for kind in ("walk", "daily", "trend")},
    **{f"one_warmup_{n}": one_warmup(n) for n in (4, 6, 10)},
    "one_warmup_continued_files_6": one_warmup(6, split=True),
    **{f"files_of_one_day_{n}{s}": one_day(n, not s) for n in (4, 6) for s in ("", "_no_stamps")},
    "same_drift_each_cycle": same_drift,
    **{f"near_copies_{s}{p}": near_copies(p, bool(s)) for s in ("", "shifted_") for p in (2, 15, 40)},
    "true_six_duties_half_03": true_starts(6, (0.5, 0.5), 0.3),
    "true_six_duties_half_05": true_starts(6, (0.5, 0.5), 0.5),
    "true_four_duties_fifth": true_starts(4, (0.2, 0.2), 0.3),
    "true_repeats_six_weathers": true_starts(6, (0.2, 0.3), 0.3, repeat=True),
    "true_one_record_random_order": true_record(0.2, 0.3),
    "true_one_record_random_order_continued": true_record(0.2, 0.3, split=True),
    "true_one_record_warmup": true_record(0.2, 0.3, repeat=True),
}
