"""Parts of the second set of generated recordings (`verdict_second`): a machine, its weather, and random processes."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from verdict_case import File, FloatArray, times

RNG = np.random.Generator
#: [s]
H = 3600.0


def lag(x: FloatArray, dt: float, tau: Any, s0: FloatArray | None = None) -> FloatArray:
    """Return a first-order lag of the rows, input held over the step; it starts at x[0] or s0."""
    a, y, s = 1 - np.exp(-dt / np.maximum(tau, 1e-3)), np.empty(x.shape), x[0] if s0 is None else s0
    for i in range(len(x)):
        y[i], s = s, s + a * (x[i] - s)
    return y


def logu(rng: RNG, lo: float, hi: float, size: Any = None) -> Any:
    """Return numbers whose logarithms are uniformly distributed."""
    return np.exp(rng.uniform(np.log(lo), np.log(hi), size))


def rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def ar(e: FloatArray, rho: float) -> FloatArray:
    """Return autoregressive series of first order made of the noise `e`."""
    y = np.zeros_like(e)
    for i in range(1, len(e)):
        y[i] = rho * y[i - 1] + np.sqrt(1 - rho**2) * e[i]
    return y


def smooth(rng: RNG, n: int, dt: float, tau: float, m: int) -> FloatArray:
    """Return smooth random curves of unit RMS that start at 0."""
    y = lag(ar(rng.normal(size=(n, m)), np.exp(-dt / tau)), dt, tau / 3)
    return np.asarray(y / np.sqrt(np.mean(y**2, axis=0)))


def profile(rng: RNG, n: int, dt: float, top: float) -> FloatArray:
    """Return speeds held for 8-50 min in a random order, a fifth of them stops."""
    v = np.empty(0)
    while len(v) < n:
        s = 0.0 if len(v) and v[-1] and rng.random() < 0.25 else top * rng.uniform(0.1, 1)
        v = np.r_[v, np.full(max(2, int(rng.uniform(8, 50) * 60 / dt)), round(s / 10) * 10)]
    return v[:n]


# -- processes ---------------------------------------------------------------------------------------------------------


def _walk(rng: RNG, n: int, _dt: float, m: int) -> FloatArray:
    """Return random walks."""
    return np.asarray(np.cumsum(rng.normal(size=(n, m)), axis=0) / np.sqrt(n / 2))


def _ar1(rng: RNG, n: int, dt: float, m: int) -> FloatArray:
    """Return stationary series with a memory of 3 to 90 min."""
    return ar(rng.normal(size=(n, m)), np.exp(-dt / (60 * logu(rng, 3, 90))))


def _white(rng: RNG, n: int, _dt: float, m: int) -> FloatArray:
    """Return white noise."""
    return rng.normal(size=(n, m))


def _heavy_tails(rng: RNG, n: int, _dt: float, m: int) -> FloatArray:
    """Return noise with outliers (Student's t with 1.5 to 3 degrees of freedom), with or without memory."""
    noise = rng.standard_t(rng.uniform(1.5, 3), (n, m))
    return np.asarray(np.clip(ar(noise, rng.choice([0, 0.5, 0.9])) / 2, -15, 15))


def _regime_switching(rng: RNG, n: int, dt: float, m: int) -> FloatArray:
    """Return levels that change at random times, approached with a lag."""
    jump = rng.random((n, m)) < dt / (60 * logu(rng, 15, 90))
    idx = np.maximum.accumulate(np.where(jump, np.arange(n)[:, None], 0), axis=0)
    return lag(np.take_along_axis(rng.normal(size=(n, m)), idx, axis=0), dt, 60 * logu(rng, 1, 15))


def _daily(rng: RNG, n: int, dt: float, m: int) -> FloatArray:
    """Return a rhythm of 19 to 30 h, its second harmonic, and a little walk."""
    t = np.arange(n)[:, None] * dt
    p = (rng.uniform(19, 30, m) if rng.random() < 0.7 else np.full(m, 24.0)) * H
    f = rng.uniform(0, 2 * np.pi, (2, m))
    w = np.sin(2 * np.pi * t / p + f[0]) + rng.uniform(0, 0.3, m) * np.sin(4 * np.pi * t / p + f[1])
    return np.asarray(w + rng.uniform(0, 0.1) * _walk(rng, n, dt, m))


def _trend(rng: RNG, n: int, dt: float, m: int) -> FloatArray:
    """Return a linear, quadratic or exponential change, with a little walk."""
    x, sign = np.arange(n)[:, None] * dt / (n * dt), rng.choice([-1, 1], m)
    e = 1 - np.exp(-x / logu(rng, 0.1, 1, m))
    shape = np.choose(rng.integers(0, 3, m), [x + 0 * e, x * (1 + rng.uniform(-1, 1, m) * (1 - x)), e / e[-1]])
    return np.asarray(sign * rng.uniform(0.5, 1.5, m) * shape + rng.uniform(0, 0.25) * _walk(rng, n, dt, m))


PROCESSES: dict[str, Callable[[RNG, int, float, int], FloatArray]] = {
    "walk": _walk,
    "ar1": _ar1,
    "white": _white,
    "heavy_tails": _heavy_tails,
    "regime_switching": _regime_switching,
    "daily": _daily,
    "trend": _trend,
}


def process(kind: str, rng: RNG, n: int, dt: float, m: int, same: bool = False) -> FloatArray:
    """Return m series of one kind, about unit size; `same`: nearly collinear, a common series and a little of own."""
    if same and m > 1:
        common = process(kind, rng, n, dt, 1) * rng.uniform(0.5, 1.5, m)
        return np.asarray(common + logu(rng, 0.02, 0.2) * process(kind, rng, n, dt, m))
    return PROCESSES[kind](rng, n, dt, m)


# -- machine -----------------------------------------------------------------------------------------------------------


def schedule(rng: RNG, n: int, dt: float, m: int) -> FloatArray:
    """Return when and how hard m sources other than the spindle run, which is part of the duty."""
    return np.stack([profile(rng, n, dt, 1000) * (profile(rng, n, dt, 1000) > 400) for _ in range(m)], axis=1) / 700


def plant(rng: RNG, m: int, same: bool, top: float = 5000.0) -> Callable[..., FloatArray]:
    """Return a machine: the temperatures [degC] as a function of rng, speed, dt, air, start [degC], other sources.

    Each sensor is the sum of ambient air with a lag, spindle heat (a fast and a slow part), and a source of its own
    that is switched on and off: axis drive, coolant, hydraulics. With `same`, all sensors measure nearly the same.
    """
    base = 60 * np.array([logu(rng, 4, 15), logu(rng, 40, 200), logu(rng, 30, 200)])
    if same:
        g, fast = rng.uniform(6, 12) * rng.uniform(0.8, 1.2, m), rng.uniform(0.3, 0.6) + rng.uniform(-0.04, 0.04, m)
        tau = base[:, None] * rng.uniform(0.9, 1.1, (3, m))
        own, air_g = rng.uniform(0, 0.2, m), rng.uniform(0.9, 1.1, m)
    else:
        g, fast = np.where(rng.random(m) < 0.75, rng.uniform(1, 15, m), rng.uniform(0.3, 2, m)), rng.uniform(0, 1, m)
        tau = base[:, None] * logu(rng, 0.3, 3, (3, m))
        own, air_g = rng.uniform(2, 6, m), rng.uniform(0.2, 1.2, m)
        g[0] = rng.uniform(8, 15)
    tau_own, power, off = 60 * logu(rng, 6, 60, m), rng.uniform(1, 1.7), rng.uniform(-0.7, 0.7, m)

    def temps(
        rng: RNG, speed: FloatArray, dt: float, air: FloatArray, start: float, on: FloatArray | None = None
    ) -> FloatArray:
        heat = ((speed / top) ** power)[:, None] * np.ones(m)
        on = schedule(rng, len(speed), dt, m) if on is None else on
        out = start + off + air_g * (lag(air[:, None] * np.ones(m), dt, tau[2], s0=np.full(m, start)) - start)
        out += g * (fast * lag(heat, dt, tau[0], s0=np.zeros(m)) + (1 - fast) * lag(heat, dt, tau[1], s0=np.zeros(m)))
        return np.asarray(out + own * lag(on, dt, tau_own, s0=np.zeros(m)))

    return temps


def weather(rng: RNG, n: int, dt: float, size: float = 1.0) -> FloatArray:
    """Return the shop's air: a level, a piece of a daily wave, doors and heating [degC]."""
    t = np.arange(n) * dt / H
    return np.asarray(
        rng.uniform(17, 26)
        + size
        * (
            rng.uniform(0.5, 3) * np.sin(2 * np.pi * (t / 24 + rng.random()))
            + rng.uniform(0.1, 0.5) * smooth(rng, n, dt, 40 * 60, 1)[:, 0]
        )
    )


def repeats(rng: RNG, k: int) -> tuple[float, int, FloatArray]:
    """Return interval, rows per cycle and speed of a spindle that runs about 45 min and rests about 15, k times."""
    dt, n, top = float(rng.choice([60, 75])), int(rng.integers(42, 70)), rng.uniform(1500, 5000)
    on = int(n * rng.uniform(0.65, 0.85))
    return dt, n, np.tile(np.r_[np.full(on, round(top)), np.zeros(n - on)], k)


# -- readings ----------------------------------------------------------------------------------------------------------


def days(rng: RNG, k: int) -> list[str]:
    """Return the time stamps of k mornings."""
    d = int(rng.integers(0, 300)) + np.cumsum(rng.integers(1, 5, k))
    return [(datetime(2024, 1, 8) + timedelta(days=int(x), minutes=int(rng.integers(360, 560)))).isoformat() for x in d]


def read(rng: RNG, T: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return readings: with noise, temperatures rounded to 0.01 degC, relative to the first displacement."""
    y = y + logu(rng, 0.05, 0.5) * rng.normal(size=len(y))
    return np.round(T + logu(rng, 0.01, 0.05) * rng.normal(size=T.shape), 2), y - y[0]


def steps(rng: RNG) -> tuple[float, int]:
    """Return an interval [s] and a number of rows."""
    return float(rng.choice([60, 75, 90, 120])), int(rng.integers(40, 151))


def one_record(
    T: FloatArray,
    y: FloatArray,
    v: FloatArray | None,
    dt: float,
    bounds: list[tuple[int, int]],
    start: str,
    split: bool,
) -> list[File]:
    """Return one record as one file with cycles, or (`split`) as files that continue each other."""
    t0 = datetime.fromisoformat(start) if start else None
    if not split:
        return [File(times(len(y), dt), T, v, y, bounds, start)]
    stamps = [(t0 + timedelta(seconds=a * dt)).isoformat() if t0 else "" for a, _ in bounds]
    return [
        File(times(b - a, dt), T[a:b], None if v is None else v[a:b], y[a:b], [(0, b - a)], stamp, a > 0)
        for (a, b), stamp in zip(bounds, stamps, strict=True)
    ]
