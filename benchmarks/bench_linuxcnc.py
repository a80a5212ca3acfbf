"""Delay of a correction to a real LinuxCNC, from `apply` to HAL, and a trace of its effect at the drive.

Run with ``PYTHONPATH=tests/helpers python benchmarks/bench_linuxcnc.py [--figure trace.png]``; requires LinuxCNC. The
component answers after it has set the pins, so the time until the answer is an upper bound; the servo
thread reads the pins within its next period. Goal: 99 % within 20 ms at 100 corrections a second.
"""

import asyncio
import math
import sys
import time
from pathlib import Path

import numpy as np
from linuxcnclive import AXES, PERIOD, Live, Trace, live
from numpy.typing import NDArray

from thermocomp.core.correction import Correction
from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

GOAL_MS, SECONDS, EVERY = 20.0, 20.0, 0.01
PROGRAM = "G21 G90 G64\n" + "G1 X60 Z-40 F3600\nG1 X-60 Z40\n" * 100 + "M2\n"


async def correct(machine: Live) -> NDArray[np.float64]:
    """Correct a moving machine, and return the delay of each correction [ms]."""
    sink = LinuxCncSink(path=machine.socket, axes={"z_um": "Z"})
    await sink.connect(5.0)
    machine.do("trace", "trace")
    machine.do("start", "part.ngc")
    took, begin = [], time.monotonic()
    while (t := time.monotonic() - begin) < SECONDS:
        wanted = Correction(-25.0 * (1.0 - math.exp(-t / 5.0)), -100.0 * (1.0 - math.exp(-t / 8.0)))
        at = time.perf_counter()
        await sink.apply({"z_um": wanted})
        took.append(1e3 * (time.perf_counter() - at))
        await asyncio.sleep(EVERY - (time.monotonic() - begin - t))
    machine.do("stop")
    await sink.close()
    return np.array(took)


def draw(trace: Trace, path: Path) -> None:
    """Plot the demanded correction, the correction sent to the drive, and their difference."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(1, 2, 1))
    t = PERIOD * np.arange(len(trace.period))
    demanded, added = trace.demanded("Z"), trace.added("Z")
    axes[0].plot(t, trace.commanded["Z"], color="0.4", linewidth=1.0)
    axes[0].set_ylabel("Z [mm]")
    axes[1].plot(t, demanded, color="tab:orange", linewidth=3.0, label="demanded: offset + slope x position")
    axes[1].plot(t, added, color="tab:blue", linewidth=1.0, label="in force: correction sent to the drive")
    axes[1].set_ylabel("correction [um]")
    axes[1].legend(loc="upper right")
    axes[2].plot(t, added - demanded, color="tab:blue", linewidth=0.8)
    axes[2].axhspan(-0.5, 0.5, color="0.92", zorder=0)
    axes[2].set_ylim(-0.6, 0.6)
    axes[2].set_ylabel("difference [um]")
    axes[2].set_xlabel("time [s]")
    for one in axes:
        one.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main() -> int:
    with live(HalSettings(axes=AXES, rate=20.0), {"part": PROGRAM}) as machine:
        machine.ready()
        took = asyncio.run(correct(machine))
        trace = machine.trace()
    p50, p99 = np.quantile(took, (0.5, 0.99))
    aside = np.abs(trace.added("Z") - trace.demanded("Z"))[round(1.0 / PERIOD) :]
    print(
        f"{len(took)} corrections: p50 {p50:.2f} ms, p99 {p99:.2f} ms, longest {took.max():.1f} ms (goal {GOAL_MS} ms)"
    )
    print(f"{len(aside)} periods: the correction at the drive is within {aside.max():.3f} um of the demanded one")
    if "--figure" in sys.argv:
        draw(trace, Path(sys.argv[sys.argv.index("--figure") + 1]))
    return int(p99 > GOAL_MS)


if __name__ == "__main__":
    sys.exit(main())
