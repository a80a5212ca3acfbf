"""First set of generated recordings for `bench_verdict.py`: the one on which the rule of the verdict was chosen.

In the nulls the drift has nothing to do with the temperatures. In the truths (``true_...``) it is a linear sum of
lagged temperature rises, plus a part that no sensor measures. `KINDS` has all of them by name; the number at the end of
a name is that of the cycles or files, or for copies the difference between them [%].
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from verdict_case import FRESH, Case, File, FloatArray, Make, times

#: [s]
HOUR = 3600.0
#: noise of the probe in most kinds [um], and of the temperatures [degC]
PROBE, SENSOR = 0.2, 0.03


# -- parts -------------------------------------------------------------------------------------------------------------


def lag(x: FloatArray, dt: float, tau: float) -> FloatArray:
    """Return a first-order lag with time constant `tau` [s], which starts at zero."""
    share = 1 - np.exp(-dt / tau)
    found, state = np.empty(len(x)), 0.0
    for k, value in enumerate(x):
        state += share * (value - state)
        found[k] = state
    return found


def smooth(rng: np.random.Generator, n: int) -> FloatArray:
    """Return a curve that wanders from 0 as slowly as the temperature of a machine."""
    x = np.cumsum(np.cumsum(rng.normal(size=n)) * 0.1 + rng.normal(size=n))
    found: FloatArray = x - x[0]
    return found


def rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def sensors(rng: np.random.Generator) -> int:
    return int(rng.integers(3, 7))


def stamp(day: int, seconds: float = 0.0) -> str:
    """Return a time stamp some time after 8 o'clock of a day, to the minute."""
    late = int(8 * HOUR + seconds)
    return f"2026-03-{2 + day + late // 86400:02d}T{late % 86400 // 3600:02d}:{late % 3600 // 60:02d}:00"


def read(
    rng: np.random.Generator,
    dt: float,
    temperatures: FloatArray,
    drift: FloatArray,
    *,
    day: int,
    cycles: int = 1,
    probe: float = PROBE,
) -> File:
    """Return a file with noisy readings, zeroed at its first displacement, with cycles of equal length."""
    n = len(drift)
    y = drift + rng.normal(0, probe, n)
    T = np.round(temperatures + rng.normal(0, SENSOR, temperatures.shape), 3)
    edges = np.linspace(0, n, cycles + 1).astype(int).tolist()
    return File(times(n, dt), T, None, y - y[0], list(pairwise(edges)), stamp(day))


# -- nulls: unrelated processes ----------------------------------------------------------------------------------------


def walk(rng: np.random.Generator, n: int, m: int, _dt: float) -> FloatArray:
    """Return `m` random walks: slow changes without a scale of time."""
    x = np.cumsum(rng.normal(size=(n, m)), axis=0)
    return np.asarray(x - x[0])


def ar1(rng: np.random.Generator, n: int, m: int, _dt: float) -> FloatArray:
    """Return `m` stationary series with a memory of 33 rows."""
    noise, x = rng.normal(size=(n, m)), np.zeros((n, m))
    for k in range(1, n):
        x[k] = 0.97 * x[k - 1] + noise[k]
    return x


def daily(rng: np.random.Generator, n: int, m: int, dt: float) -> FloatArray:
    """Return `m` rhythms, each with a period of 19 to 30 h, and their second harmonics."""
    hours, found = np.arange(n) * dt / HOUR, []
    for _ in range(m):
        period = rng.uniform(19, 30)
        first = np.sin(2 * np.pi * (hours / period + rng.uniform()))
        found.append(first + 0.3 * np.sin(2 * np.pi * (2 * hours / period + rng.uniform())))
    return np.stack(found, axis=1)


def trend(rng: np.random.Generator, n: int, m: int, _dt: float) -> FloatArray:
    """Return `m` trends of size 1: linear, quadratic, or exponential with a time constant of 0.15 to 1.5 durations."""
    u, found = np.arange(n) / (n - 1), []
    for _ in range(m):
        shape, sign = rng.integers(3), rng.choice([-1, 1])
        if shape == 0:
            found.append(sign * u)
        elif shape == 1:
            found.append(sign * (u + rng.uniform(-0.6, 0.6) * u**2))
        else:
            found.append(sign * (1 - np.exp(-u / rng.uniform(0.15, 1.5))))
    x = np.stack(found, axis=1)
    return np.asarray(x / np.ptp(x, axis=0))


PROCESSES: dict[str, Callable[[np.random.Generator, int, int, float], FloatArray]] = {
    "walk": walk,
    "ar1": ar1,
    "daily": daily,
    "trend": trend,
}


def null_series(kind: str, cycles: int) -> Make:
    """Return one series of drift and unrelated temperatures, zeroed once and cut into cycles.

    Daily rhythms and trends last 8 to 48 h; their temperatures also walk.
    """

    def make(rng: np.random.Generator) -> Case:
        m, n = sensors(rng), int(rng.integers(50, 100)) * cycles
        dt = 60.0 if kind in ("walk", "ar1") else rng.uniform(8, 48) * HOUR / n
        x = PROCESSES[kind](rng, n, m + 1, dt)
        T = x[:, 1:]
        if kind == "trend":
            w = np.cumsum(rng.normal(size=(n, m)), axis=0)
            T = T + w / np.std(w, axis=0) * rng.uniform(0.1, 0.5)
        elif kind == "daily":
            T = T + 0.15 * np.cumsum(rng.normal(size=(n, m)), axis=0) / np.sqrt(n)
        T = 20 + rng.uniform(2, 8) * (T - T[0])
        drift = rng.uniform(10, 40) * (x[:, 0] - x[0, 0])
        return Case([read(rng, dt, T, drift, day=0, cycles=cycles)], null=True)

    return make


def null_starts(kind: str, files: int) -> Make:
    """Return cold starts on different days, each with own processes; daily rhythms and trends last 4 to 10 h."""

    def make(rng: np.random.Generator) -> Case:
        m, found = sensors(rng), []
        for day in range(files):
            n = int(rng.integers(50, 100))
            dt = 60.0 if kind in ("walk", "ar1") else rng.uniform(4, 10) * HOUR / n
            x = PROCESSES[kind](rng, n, m + 1, dt)
            T = x[:, 1:]
            if kind == "trend":
                T = T + 0.3 * np.cumsum(rng.normal(size=(n, m)), axis=0) / np.sqrt(n)
            found.append(read(rng, dt, 20 + 4 * (T - T[0]), 25 * (x[:, 0] - x[0, 0]), day=day))
        return Case(found, null=True)

    return make


# -- nulls: one observation counted several times ----------------------------------------------------------------------


def repeats(rng: np.random.Generator, cycles: int) -> tuple[float, FloatArray, FloatArray]:
    """Return interval, spindle (1: it runs) and temperatures of a spindle that runs 30-45 min and rests 15-20 min.

    The sensors follow with time constants of 0.2 to 2.5 h, and a daily wave of the air.
    """
    m, dt = sensors(rng), 120.0 if cycles < 10 else 90.0
    run, rest = rng.choice([45, 30, 40]), rng.choice([15, 20])
    t = np.arange(int(cycles * (run + rest) * 60 / dt)) * dt
    spindle = np.where((t / 60) % (run + rest) < run, 1.0, 0.0)
    T = np.stack([rng.uniform(3, 10) * lag(spindle, dt, tau) for tau in rng.uniform(0.2, 2.5, m) * HOUR], axis=1)
    air = rng.uniform(0.2, 1.5) * np.sin(2 * np.pi * (t / 24 / HOUR + rng.uniform()))
    return dt, spindle, 20 + T + (air - air[0])[:, None] * rng.uniform(0.3, 1, m)


def one_warmup(cycles: int) -> Make:
    """Return one warm-up of a spindle that runs and rests in turn, with the drift of a warm-up that no sensor measures.

    The drift approaches its final value with a time constant of 0.5 to 4 h, and may overshoot.
    """

    def make(rng: np.random.Generator) -> Case:
        dt, spindle, T = repeats(rng, cycles)
        t, tau = np.arange(len(T)) * dt, rng.uniform(0.5, 4) * HOUR
        drift = rng.choice([-1, 1]) * rng.uniform(12, 40) * (1 - np.exp(-t / tau))
        if rng.uniform() < 0.3:
            drift = drift - 0.4 * drift[-1] * (1 - np.exp(-t / (2 * tau)))
        file = read(rng, dt, T, drift, day=0, cycles=cycles, probe=0.1)
        return Case([replace(file, speed=1500 * spindle if rng.uniform() < 0.5 else None)], null=True, duty=True)

    return make


def one_day(files: int, stamped: bool) -> Make:
    """Return files of one day, each zeroed at its start, with or without time stamps.

    Drift and temperatures are daily waves and trends that run on through all files.
    """

    def make(rng: np.random.Generator) -> Case:
        m, n = sensors(rng), int(rng.integers(50, 90))
        dt, gap = rng.uniform(60, 120), rng.uniform(0.2, 0.8) * HOUR
        period, phase = rng.uniform(20, 28, m + 1), rng.uniform(size=m + 1)
        slope, size = rng.normal(size=m + 1), rng.uniform(0.5, 1.5, m + 1)
        found = []
        for begin in np.arange(files) * (n * dt + gap):
            hours = (begin + np.arange(n)[:, None] * dt) / HOUR
            x = size * np.sin(2 * np.pi * (hours / period + phase)) + 0.8 * slope * hours / 10
            own = 0.3 * np.cumsum(rng.normal(size=(n, m)), axis=0) / np.sqrt(n)
            file = read(rng, dt, 20 + 3 * x[:, 1:] + own, 25 * x[:, 0], day=0)
            found.append(replace(file, start=stamp(0, begin) if stamped else ""))
        return Case(found, null=True)

    return make


def curves(rng: np.random.Generator, n: int, m: int) -> FloatArray:
    """Return `m` smooth temperature changes with a standard deviation of 3 degC."""
    x = np.stack([smooth(rng, n) for _ in range(m)], axis=1)
    return np.asarray(x / np.std(x, axis=0) * 3)


def same_drift(rng: np.random.Generator) -> Case:
    """Return six days with the same drift, whatever the temperatures are: they are others on each day."""
    m, n = sensors(rng), 70
    drift = smooth(rng, n)
    drift = 25 * drift / np.std(drift)
    found = [read(rng, 60.0, 20 + curves(rng, n, m), drift, day=day) for day in range(6)]
    return Case(found, null=True, duty=True)


def copies(percent: int) -> Make:
    """Return one recording six times; the temperatures of the copies differ by smooth curves of some percent."""

    def make(rng: np.random.Generator) -> Case:
        m, n = sensors(rng), 70
        drift = smooth(rng, n)
        drift, T = 25 * drift / np.std(drift), 20 + curves(rng, n, m)
        found = [read(rng, 60.0, T + curves(rng, n, m) * percent / 100, drift, day=day) for day in range(6)]
        return Case(found, null=True, duty=True)

    return make


# -- truths ------------------------------------------------------------------------------------------------------------


def speeds(rng: np.random.Generator, n: int, dt: float) -> FloatArray:
    """Return speeds (1: the highest), each held for 0.4 to 2 h, a quarter of them stops, not all of the first hour."""
    found, k = np.zeros(n), 0
    while k < n:
        rows = int(rng.uniform(0.4, 2) * HOUR / dt)
        found[k : k + rows] = rng.choice([0, 0.2, 0.4, 0.6, 0.8, 1], p=[0.25, 0.15, 0.15, 0.15, 0.15, 0.15])
        k += rows
    if found[: int(0.5 * HOUR / dt)].max() == 0:
        found[: int(HOUR / dt)] = rng.choice([0.4, 0.7, 1])
    return found


def strongest(drifts: Sequence[FloatArray]) -> float:
    """Return the error of the strongest of the simple opponents: the RMS, as the geometric mean over the files [um].

    They are no compensation, mean, last value and mean curve of the other files.
    """
    found = []
    for k, y in enumerate(drifts):
        others = [d for j, d in enumerate(drifts) if j != k]
        curve = np.mean([np.interp(np.arange(len(y)), np.arange(len(d)), d) for d in others], axis=0)
        every = np.concatenate(others)
        found.append([np.log(rms(y - b)) for b in (0, every.mean(), every[-1], curve)])
    return float(np.exp(np.mean(found, axis=0).min()))


def true_starts(files: int, left: float, spread: float, *, same: bool = False) -> Make:
    """Return cold starts on different days, with other speeds on each, or (`same`) the same speeds in other weather.

    A share `left` of the error of the strongest opponent is a smooth curve that no sensor measures; the logarithm of
    the share has a standard deviation `spread` over the files. The best possible model does no harm in any of them.
    """

    def make(rng: np.random.Generator) -> Case:
        m, dt, n = sensors(rng), 120.0, int(rng.integers(80, 130))
        taus, power, size = rng.uniform(0.15, 2.5, m) * HOUR, rng.uniform(0.6, 1.6, m), rng.uniform(3, 10, m)
        lags, weights = rng.uniform(0.02, 1, m) * HOUR, rng.normal(size=m) / size
        t, first = np.arange(n) * dt, speeds(rng, n, dt)
        temperatures, told = [], []
        for _ in range(files + FRESH):
            s = first if same else speeds(rng, n, dt)
            air = rng.uniform(-2, 2) * lag(np.ones(n), dt, 3 * HOUR)
            air += rng.uniform(0.3, 1.5) * np.sin(2 * np.pi * (t / 24 / HOUR + rng.uniform()))
            T = heated(s, air - air[0], dt, taus, power, size) + 18 + rng.uniform(0, 6)
            temperatures.append(T)
            told.append(sum((weights[j] * lag(T[:, j] - T[0, j], dt, lags[j]) for j in range(m)), np.zeros(n)))
        scale = 25 / np.std(np.concatenate(told[:files]))
        told = [scale * x for x in told]
        base, found = strongest(told[:files]), []
        for day, (T, seen) in enumerate(zip(temperatures, told, strict=True)):
            unseen = left * np.exp(spread * rng.normal()) * base
            for _ in range(200):
                other = smooth(rng, n)
                other *= unseen / rms(other)
                if rms(seen + other) >= unseen and np.abs(seen + other).max() >= np.abs(other).max():
                    break
            found.append(read(rng, dt, T, seen + other, day=day))
        return Case(found[:files], null=False, duty=same, fresh=found[files:])

    return make


def heated(
    speed: FloatArray, air: FloatArray, dt: float, taus: FloatArray, power: FloatArray, size: FloatArray
) -> FloatArray:
    """Return temperatures that follow a power of the speed with a lag each, and the air, every other one half of it."""
    found = [c * lag(speed**p, dt, tau) for tau, p, c in zip(taus, power, size, strict=True)]
    return np.stack([x + air * (0.5 + 0.5 * (j % 2)) for j, x in enumerate(found)], axis=1)


def true_record(left: float) -> Make:
    """Return one recording of 6 to 10 runs of 0.7-2.5 h, each with a random speed and a stop of 0.5-1.5 h.

    The unseen part is a smooth curve with a standard deviation of `left` times that of the rest.
    """

    def make(rng: np.random.Generator) -> Case:
        cycles, m, dt = int(rng.integers(6, 11)), sensors(rng), 120.0
        speed: list[float] = []
        edges = [0]
        for _ in range(cycles):
            run, rest = int(rng.uniform(0.7, 2.5) * HOUR / dt), int(rng.uniform(0.5, 1.5) * HOUR / dt)
            speed += [rng.uniform(0.2, 1)] * run + [0.0] * rest
            edges.append(len(speed))
        s, n = np.array(speed), len(speed)
        taus, size, power = rng.uniform(0.15, 2.5, m) * HOUR, rng.uniform(3, 10, m), rng.uniform(0.6, 1.6, m)
        air = rng.uniform(0.3, 2) * np.sin(2 * np.pi * (np.arange(n) * dt / 24 / HOUR + rng.uniform()))
        T = 20 + heated(s, air - air[0], dt, taus, power, size)
        weights = rng.normal(size=m) / size
        told = np.zeros(n)
        for j in range(m):
            told += weights[j] * lag(T[:, j] - T[0, j], dt, rng.uniform(0.02, 1) * HOUR)
        other = smooth(rng, n)
        file = read(rng, dt, T, 25 * (told / np.std(told) + left * other / np.std(other)), day=0)
        return Case([replace(file, speed=6000 * s, cycles=list(pairwise(edges)))], null=False)

    return make


def true_warmup(cycles: int, left: float = 0.2) -> Make:
    """Return one warm-up of a spindle that runs and rests in turn; the temperatures determine the drift without a lag.

    The unseen part is a smooth curve with `left` times the size of the drift, independent of the rest.
    """

    def make(rng: np.random.Generator) -> Case:
        dt, spindle, T = repeats(rng, cycles)
        told = (T - T[0]) @ rng.normal(size=T.shape[1])
        told /= np.std(told)
        other = smooth(rng, len(T))
        other -= told * (other @ told) / (told @ told)
        drift = rng.uniform(12, 30) * (told * np.sqrt(1 - left**2) + left * other / np.std(other))
        file = read(rng, dt, T, drift, day=0, cycles=cycles, probe=0.1)
        return Case([replace(file, speed=1500 * spindle if rng.uniform() < 0.5 else None)], null=False, duty=True)

    return make


KINDS: dict[str, Make] = {
    **{f"{kind}_one_series_{n}": null_series(kind, n) for kind in PROCESSES for n in (4, 6, 10)},
    **{f"{kind}_starts_{n}": null_starts(kind, n) for kind in PROCESSES for n in (3, 4, 6)},
    **{f"one_warmup_{n}": one_warmup(n) for n in (4, 6, 10)},
    **{f"files_of_one_day_{n}": one_day(n, stamped=True) for n in (3, 4, 6)},
    **{f"files_of_one_day_{n}_no_stamps": one_day(n, stamped=False) for n in (4, 6)},
    "same_drift": same_drift,
    **{f"copies_{percent}": copies(percent) for percent in (2, 15, 40)},
    "true_six_duties_half_03": true_starts(6, 0.5, 0.3),
    "true_six_duties_half_05": true_starts(6, 0.5, 0.5),
    "true_four_duties_fifth": true_starts(4, 0.2, 0.3),
    "true_repeats_six_weathers": true_starts(6, 0.25, 0.3, same=True),
    "true_one_record": true_record(0.2),
    "true_one_record_warmup": true_warmup(8),
}
