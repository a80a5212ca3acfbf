"""Speed of the virtual machine compared with its full finite-element model, and memory for a month.

Run with ``python benchmarks/bench_simulation.py``. The reduced and the full model compute the same heat input in one
run; their drifts must agree to 1 %. Goals: a 16-hour test of 14 temperatures every 10 s in less than 1 s; 35,000 steps
a second, 3,000 on the nonlinear machine; for a month of rows every 10 s, at most three times the memory of the
resulting table.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.experiments import simulate
from thermocomp.virtual.machine import Air, FeedDrive
from thermocomp.virtual.nonlinear import NonlinearCentre
from thermocomp.virtual.protocolfile import read_protocol

GOAL_SECONDS, GOAL_STEPS, GOAL_NONLINEAR, GOAL_MEMORY, GOAL_DRIFT = 1.0, 35_000.0, 3_000.0, 3.0, 0.01

PROTOCOL = """
description = "a benchmark"
sampling = "10 s"
places = "hwang"
probes = ["x1", "y1", "z"]
segments = [
    {{ duration = "6 h", speed = 2600, feed = {{ x = 600, y = 1000, z = 600 }} }},
    {{ duration = "{stop} h" }},
]
"""


def protocol(folder: str, hours: int) -> Path:
    path = Path(folder) / f"hours{hours}.toml"
    path.write_text(PROTOCOL.format(stop=hours - 6), encoding="utf-8")
    return path


def whole_test(path: Path) -> tuple[float, int]:
    """Return the computing time [s] and the rows of a test; the time includes the soak, the rows do not."""
    experiment = read_protocol(path)
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        (test,) = simulate(experiment)
        times.append(time.perf_counter() - begin)
    return min(times), len(test.time)


def steps(machine: MachiningCentre, *programmes: list[float]) -> list[float]:
    """Return steps per second of a machine, at constant and at changing speeds."""
    air = Air(22.0)
    found = []
    for speeds in programmes:
        drives = [FeedDrive(s) for s in speeds for _ in range(6000 // len(speeds))]
        best = np.inf
        for _ in range(3):
            begin = time.perf_counter()
            machine.run(machine.init(air), drives, np.tile(air.values, (len(drives), 1)), 10.0)
            best = min(best, time.perf_counter() - begin)
        found.append(len(drives) / best)
    return found


def full_model(n_steps: int = 360) -> tuple[float, float, float]:
    """Return microseconds a step of both models, and the largest difference of z as a share of its drift."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
    from finite_elements import machines
    from finite_elements.transient import Stepper
    from thermocomp.virtual.statespace import ReducedModel

    full, small = machines.centre(), ReducedModel.load("centre")
    shares = {"rotation": 0.8125, "flow": 1.0}
    theta = tuple(shares.get(name, 0.0) for name in small.theta)
    given = {"front_bearing": 250.0, "rear_bearing": 100.0, "rotor": 80.0, "stator": 150.0}
    heat = np.array([given.get(name, 0.0) for name in small.inputs])
    air = np.array([20.0, 0.0, 0.0])
    stepper = Stepper(full.capacity, full.stiffness(shares), 10.0)
    load, row = full.heat @ heat + full.air_heat(shares) @ air, full.observables["z"]
    temperatures = 20.0 * full.one
    begin, drift_full = time.perf_counter(), np.empty(n_steps)
    for k in range(n_steps):
        temperatures = stepper.advance(temperatures, load).temperatures
        drift_full[k] = row @ (temperatures - 20.0)
    seconds_full = time.perf_counter() - begin
    operators = small.operators(theta, 10.0)
    forcing = operators.heat @ heat + operators.air @ air
    state, fields = 20.0 * small.one, np.empty((n_steps, len(small.one)))
    begin = time.perf_counter()
    for k in range(n_steps):
        fields[k] = state = operators.state @ state + forcing
    drift = (fields - 20.0 * small.one) @ small.observable[small.observables.index("z")]
    seconds = time.perf_counter() - begin
    off = float(np.abs(drift - drift_full).max() / np.ptp(drift_full))
    return 1e6 * seconds_full / n_steps, 1e6 * seconds / n_steps, off


CHILD = """
import sys, tracemalloc
from pathlib import Path
from thermocomp.virtual.protocolfile import read_protocol
from thermocomp.virtual.experiments import simulate
next(simulate(read_protocol(Path(sys.argv[1]))))
tracemalloc.start()
(test,) = simulate(read_protocol(Path(sys.argv[2])))
print(tracemalloc.get_traced_memory()[1], test.values.nbytes)
"""


def memory(short: Path, month: Path) -> tuple[float, float]:
    """Return the peak memory for a month and the size of its table [bytes]; runs in a separate process."""
    done = subprocess.run([sys.executable, "-c", CHILD, short, month], check=True, capture_output=True, text=True)
    taken, table = done.stdout.split()
    return float(taken), float(table)


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        seconds, rows = whole_test(protocol(folder, 16))
        print(f"16 h, 14 temperatures, 10 s: {rows} rows in {seconds:.2f} s (goal {GOAL_SECONDS:g} s)")
        same, changing = steps(MachiningCentre(), [2600.0], [1000.0 + 20.0 * k for k in range(100)])
        (nonlinear,) = steps(NonlinearCentre(), [2600.0])
        print(f"machine alone: {same:,.0f} steps/s; new speed every 10 min: {changing:,.0f} (goal {GOAL_STEPS:,.0f})")
        print(f"nonlinear machine: {nonlinear:,.0f} steps/s (goal {GOAL_NONLINEAR:,.0f})")
        big, small, off = full_model()
        print(f"a step of the full model {big:,.0f} us, of the reduced one {small:.1f} us: {big / small:,.0f}x")
        print(f"z differs by {100 * off:.2f} % of its drift (goal {100 * GOAL_DRIFT:g} %)")
        taken, table = memory(protocol(folder, 24), protocol(folder, 720))
        print(f"a month: peak {taken / 1e6:.0f} MB, table {table / 1e6:.0f} MB (goal {GOAL_MEMORY:g} times)")
    goals = (
        seconds <= GOAL_SECONDS,
        same >= GOAL_STEPS,
        nonlinear >= GOAL_NONLINEAR,
        off <= GOAL_DRIFT,
        taken <= GOAL_MEMORY * table,
    )
    print("goals reached" if all(goals) else "goal MISSED")
    return 0 if all(goals) else 1


if __name__ == "__main__":
    sys.exit(main())
