"""A drift test that is computed in a moment and whose physics is known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from thermocomp.core import lagbank
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording


def small_machine(
    speeds: Sequence[float] = (1000.0, 2500.0, 1800.0, 3000.0),
    *,
    seed: int = 0,
    dt: float = 60.0,
    noise: float = 0.02,
) -> Recording:
    """Return a drift test: lags of 20 and 90 minutes in the drift, of 20 and 45 minutes in the sensors.

    A larger `dt` [s] is enough where the size of the recording is not what is tested; `noise` is that of the sensors
    [degC].
    """
    rng = np.random.default_rng(seed)
    half = round(6000 / dt)
    speed = np.concatenate([np.r_[np.full(half, n), np.zeros(half)] for n in speeds])
    speed[0] = 0.0
    time = np.arange(len(speed), dtype=np.float64) * dt
    steps = np.full(len(speed), dt)
    ambient = 0.8 * np.sin(2 * np.pi * time / 40_000)
    heat = np.column_stack([speed**2 / 1e6, speed / 1e3])
    fast, slow = lagbank.run(heat, steps, np.array([1200.0, 5400.0])).T
    between = lagbank.run(heat[:, 1:], steps, np.array([2700.0]))[:, 0]
    table = pd.DataFrame(
        {
            "t1_C": 22 + 2.0 * fast + ambient + noise * rng.normal(size=len(time)),
            "t2_C": 21 + 1.5 * between + ambient + noise * rng.normal(size=len(time)),
            "t3_C": 20.5 + ambient + noise * rng.normal(size=len(time)),
            "spindle_rpm": speed,
            "z_um": 4.0 * fast + 6.0 * slow + 1.5 * ambient + 0.1 * rng.normal(size=len(time)),
            "x_um": -2.0 * fast + 0.05 * fast**2 + 0.1 * rng.normal(size=len(time)),
        }
    )
    quantities = {"C": ("temperature", "degC"), "rpm": ("spindle_speed", "1/min"), "um": ("displacement", "um")}
    channels = tuple(Channel(str(c), *quantities[str(c).split("_")[1]]) for c in table.columns)
    return Recording("small", time, table, channels, find_cycles(time, speed))


def crowded_machine() -> Recording:
    """Return the same with two more sensors that say the same as t1_C, and one of the weather elsewhere."""
    plain = small_machine()
    rng = np.random.default_rng(7)
    near, far, other = rng.normal(size=(3, len(plain)))
    table = plain.table.copy()
    table["t4_C"] = table["t1_C"] + 0.05 * near
    table["t5_C"] = table["t1_C"] + 0.2 * far
    table["t6_C"] = 20 + np.cumsum(0.01 * other)
    more = tuple(Channel(n, "temperature", "degC") for n in ("t4_C", "t5_C", "t6_C"))
    return replace(plain, table=table, channels=(*plain.channels, *more))


def two_that_matter(seed: int) -> Recording:
    """Return six cycles in which two of eight sensors make the drift; the others feel a little of all, and the room."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6 * 200 * 60.0, 60.0)
    speed = np.concatenate([np.r_[np.full(100, n), np.zeros(100)] for n in rng.uniform(500, 3000, 6)])
    steps = np.full(len(time), 60.0)
    heat = np.column_stack([speed**2 / 1e6, speed / 1e3])
    fast, slow = lagbank.run(heat, steps, np.array([1200.0, 5400.0])).T
    columns = {"t1_C": 20 + 3 * fast, "t2_C": 20 + 2 * slow}
    room = np.cumsum(0.01 * rng.normal(size=len(time)))
    columns |= {f"t{k}_C": 20 + rng.uniform(0, 0.4) * fast + rng.uniform(0, 0.4) * slow + room for k in range(3, 9)}
    table = pd.DataFrame(columns) + 0.03 * rng.normal(size=(len(time), 8))
    table["spindle_rpm"] = speed
    # its zero is the first row, as that of the temperatures
    table["x_um"] = 6 * (fast - fast[0]) + 8 * (slow - slow[0]) + 0.3 * rng.normal(size=len(time))
    quantities = {"C": ("temperature", "degC"), "rpm": ("spindle_speed", "1/min"), "um": ("displacement", "um")}
    channels = tuple(Channel(str(c), *quantities[str(c).split("_")[1]]) for c in table.columns)
    return Recording("two", time, table, channels, find_cycles(time, speed))
