"""The watch over the temperatures: how soon failures are found, and what is accused that is sound.

Run with ``python benchmarks/bench_watch.py``. Each thermal cycle is left out in turn: of the virtual machine, and of
fl_thermal (rows 0-6668, six sensors and all) where the measured data are there. In the cycle left out every temperature
fails in every way at instants drawn at random; a failure that begins less than four hours before the end of the
recording is not drawn.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.watch import Watch
from thermocomp.datasets.virtual import record
from thermocomp.files import recordings
from thermocomp.models.watching import find_watch
from thermocomp.recording.samples import Samples
from thermocomp.recording.stacking import stack
from thermocomp.runtime.watch import GOOD, begin, look

FloatArray = NDArray[np.float64]

#: by kind of failure: delay that is wanted at most [s]
GOALS = {"dead": 0.0, "3 degC off": 600.0, "stuck": 1800.0, "1 degC/h": 3 * 3600.0}
#: instants per sensor and cycle
INSTANTS = 5
SIX = ("t4_C", "t5_C", "t7_C", "t9_C", "t11_C", "t16_C")
#: of the virtual machine
FEW = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")
LEARNED = 6669


def cases() -> Iterator[tuple[str, Samples]]:
    for physics in ("linear", "nonlinear"):
        whole = stack(record("demo", physics=physics), ["z_um"])
        yield f"demo, {physics}, six", whole.take(np.arange(len(whole)) % 3 == 0).only([*FEW, "spindle_rpm"])
    shared = Path(__file__).resolve().parents[2] / "shared" / "data"
    path = Path(os.environ.get("THERMOCOMP_DATA", shared)) / "fl_thermal" / "recording.csv"
    if not path.is_file():
        print(f"skipped: {path} is not here; set THERMOCOMP_DATA to the folder of the measured data")
        return
    whole = stack([recordings.read(path)], ["ch1_um"])
    samples = whole.take((np.arange(len(whole)) < LEARNED) & (np.arange(len(whole)) % 4 == 0))
    yield "fl_thermal, six", samples.only([*SIX, "spindle_rpm"])
    yield "fl_thermal, all", samples


def found(watch: Watch, samples: Samples, failures: list[tuple[int, int, str]]) -> FloatArray:
    """Return when each sensor was found to fail, per run, (1 + n_failures, n_sensors) [s]; the first run is sound."""
    names = [c.name for c in samples.inputs]
    columns = [names.index(i.name) for i in watch.inputs]
    runs = 1 + len(failures)
    state, when = begin(watch, runs=(runs,)), np.full((runs, len(watch.sensors)), np.nan)
    for k, time in enumerate(samples.time.tolist()):
        values = np.repeat(samples.values[k : k + 1, columns], runs, axis=0)
        for run, (row, sensor, kind) in enumerate(failures, start=1):
            if k >= row:
                values[run, sensor] = {
                    "dead": np.nan,
                    "3 degC off": values[run, sensor] + 3.0,
                    "stuck": samples.values[row, columns[sensor]],
                    "1 degC/h": values[run, sensor] + (time - samples.time[row]) / 3600.0,
                }[kind]
        state, _ = look(watch, state, time, values, resting=bool(samples.stands[k]))
        when[(state.fault != GOOD) & np.isnan(when)] = time
    return when


def main() -> int:
    reached = True
    for title, samples in cases():
        delays: dict[str, list[float]] = {kind: [] for kind in GOALS}
        late: dict[str, set[str]] = {kind: set() for kind in GOALS}
        wrong, alarms = 0, list[str]()
        for cycle in np.unique(samples.cycle[samples.cycle >= 0]).tolist():
            watch = find_watch(samples, samples.cycle != cycle)
            if watch is None:
                raise SystemExit(f"{title}: nothing to watch")
            rng = np.random.default_rng(cycle)
            mine = np.flatnonzero((samples.cycle == cycle) & (samples.time < samples.time[-1] - 4 * 3600.0))
            failures = [
                (int(row), sensor, kind)
                for sensor in range(len(watch.sensors))
                for kind in GOALS
                for row in rng.choice(mine[len(mine) // 10 :], INSTANTS if len(mine) > 20 else 0)
            ]
            when = found(watch, samples, failures)
            alarms += [watch.names[k] for k in np.flatnonzero(np.isfinite(when[0])).tolist()]
            for run, (row, sensor, kind) in enumerate(failures, start=1):
                delay = float(when[run, sensor] - samples.time[row])
                delays[kind].append(delay)
                if not delay <= GOALS[kind]:
                    late[kind].add(watch.names[sensor])
                wrong += bool(np.isfinite(np.delete(when[run], sensor)).any())
        print(
            f"{title}: sound cycles with a false alarm: {alarms or 'none'}; runs with a sound sensor accused: {wrong}"
        )
        for kind, goal in GOALS.items():
            of = np.array(delays[kind])
            share, median = float((of <= goal).mean()), float(np.nanmedian(of)) / 60
            print(
                f"  {kind:<11} {len(of)} failures, {100 * share:.0f} % in {goal / 60:.0f} min, median {median:.0f} min"
                f"{'; late: ' + ' '.join(sorted(late[kind])) if late[kind] else ''}"
            )
            reached &= share == 1.0
        reached &= not alarms
    print(f"goal, all in time, no false alarm: {'reached' if reached else 'MISSED'}")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
