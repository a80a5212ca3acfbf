"""One step of 10,000 machines with 24 temperatures each, compared with the same machines one by one.

Run with ``python benchmarks/bench_fleet.py``. Both are timed alternately in one run. Goal: at most 1 ms in ``float32``.
"""

import sys
import time

import numpy as np

from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.reading import Reading
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.fleet import Fleet

MACHINES, CHANNELS, GOAL_MS = 10_000, 24, 1.0


def model() -> LinearDynamic:
    """Return a model with a lag of each temperature."""
    rng = np.random.default_rng(0)
    return LinearDynamic(
        target="z_um",
        unit="um",
        inputs=tuple(Input(f"t{k}_C", "temperature", "degC", 20.0, True, -5.0, 25.0) for k in range(CHANNELS)),
        signals=tuple((k,) for k in range(CHANNELS)),
        direct=tuple(rng.normal(0, 0.3, CHANNELS).tolist()),
        lag_signals=tuple(range(CHANNELS)),
        time_constants=tuple(rng.uniform(300.0, 9000.0, CHANNELS).tolist()),
        lagged=tuple(rng.normal(0, 0.3, CHANNELS).tolist()),
        honest_error=HonestError("benchmark", 1.0, 1.0, 2.0, 5.0, 5.0, {}, "accepted", "", 3, rules=RULES),
    )


def main() -> int:
    """Print the times; 1 if the goal is missed."""
    rng, own = np.random.default_rng(1), model()
    zeros = 20.0 + rng.normal(0, 1.0, (MACHINES, CHANNELS))
    readings = [(zeros + rng.normal(3.0, 1.0, zeros.shape)).T.astype(np.float32) for _ in range(8)]
    missing = [r.copy() for r in readings]
    for r in missing:
        r[rng.integers(CHANNELS, size=100), rng.integers(MACHINES, size=100)] = np.nan
    machine = Compensator.of([own], Limits())
    state, _ = machine.step(machine.start(), Reading(0.0, _table(own, zeros[0])), 0.0)
    fleets = {kind: Fleet(own, zeros, Limits(), kind) for kind in ("float32", "float64")}
    times: dict[str, list[float]] = {}
    for stretch in range(20):  # alternately, but no step with caches that another one has filled
        for kind, fleet in fleets.items():
            for name, given in ((kind, readings), (f"{kind}, 1 % of the readings refused", missing)):
                for k in range(20):
                    begin = time.perf_counter_ns()
                    fleet.tick(given[k % 8], 10.0)
                    times.setdefault(name, []).append(time.perf_counter_ns() - begin)
        for k in range(20):
            at = 10.0 * (20 * stretch + k)
            reading = Reading(at, _table(own, readings[k % 8][:, 0]))
            begin = time.perf_counter_ns()
            state, _ = machine.step(state, reading, at)
            times.setdefault("one by one", []).append((time.perf_counter_ns() - begin) * MACHINES)
    for name, found in times.items():
        print(f"{name:36} {np.median(found) / 1e6:10.2f} ms  p99 {np.quantile(found, 0.99) / 1e6:10.2f} ms")
    return int(bool(np.median(times["float32"]) / 1e6 > GOAL_MS))


def _table(own: LinearDynamic, row: np.ndarray) -> dict[str, float]:
    return dict(zip((i.name for i in own.inputs), row.tolist(), strict=True))


if __name__ == "__main__":
    sys.exit(main())
