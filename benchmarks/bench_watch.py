"""The watch over the temperatures: time to the detection of failures, and false alarms.

Run with ``python benchmarks/bench_watch.py``. Each thermal cycle is left out in turn: of the virtual machine, and, if
the measured data are available, of fl_thermal (rows 0-6668, six sensors and all). In the left-out cycle every
temperature fails in every way at random instants, at least four hours before the end of the recording. In addition,
every pair of sensors is swapped, each relative to its own zero, as if the swap had existed in the earlier cycles
without being detected. ``bench_standin.py`` evaluates the effect of failures on the error.
"""

import sys
from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from measured import find_measured
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.watch import Watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, SWAPPED, WatchState, begin
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]

#: by kind of failure: required time to detection [s]
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
        thinned = whole.take(np.arange(len(whole)) % 3 == 0)
        yield f"demo, {physics}, six", thinned.only([*FEW, "spindle_rpm"])
        yield f"demo, {physics}, sixteen", thinned
    if (path := find_measured("fl_thermal/recording.csv")) is None:
        return
    whole = stack([recordings.read(path)], ["ch1_um"])
    samples = whole.take((np.arange(len(whole)) < LEARNED) & (np.arange(len(whole)) % 4 == 0))
    yield "fl_thermal, six", samples.only([*SIX, "spindle_rpm"])
    yield "fl_thermal, all", samples


def found(watch: Watch, samples: Samples, failures: list[tuple[int, int, str]]) -> FloatArray:
    """Return when each sensor was reported, (1 + n_failures, n_sensors) [s]; no sensor fails in the first run."""
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


def swapped_before(watch: Watch, samples: Samples, stop: int, pairs: list[tuple[int, int]]) -> WatchState:
    """Return the states at a row, (1 + n_pairs,): without a swap, and with each pair swapped from the start."""
    names = [c.name for c in samples.inputs]
    columns, n = [names.index(i.name) for i in watch.inputs], len(watch.sensors)
    state, runs = begin(watch, samples.reference()[0][columns], (1 + len(pairs),)), 1 + len(pairs)
    for k in range(stop):
        values = np.repeat(samples.values[k : k + 1, columns], runs, axis=0)
        state, _ = look(watch, state, float(samples.time[k]), values, resting=bool(samples.stands[k]))
    for run, (i, j) in enumerate(pairs, start=1):
        for lagged in (state.memory, state.traces, state.used):
            for lag in range(0, n * len(watch.time_constants) if lagged is not state.used else n, n):
                lagged[run, [lag + i, lag + j]] = lagged[run, [lag + j, lag + i]]
    return state._replace(evidence=np.zeros_like(state.evidence))


def swaps(watch: Watch, samples: Samples, cycle: int) -> Iterator[tuple[str, bool, float]]:
    """Yield per pair the result, whether the two differ by more than both limits, and the time to detection [s]."""
    pairs = list(combinations(range(len(watch.sensors)), 2))
    rows = np.flatnonzero(samples.cycle == cycle)
    names = [c.name for c in samples.inputs]
    columns = [names.index(i.name) for i in watch.inputs]
    state, off = swapped_before(watch, samples, int(rows[0]), pairs), watch.limits("off")
    first, when = np.zeros((1 + len(pairs), len(watch.sensors)), dtype=np.intp), np.full(1 + len(pairs), np.inf)
    change, zero = samples.change()[:, columns], samples.reference()[0][columns]
    for k in rows.tolist():
        values = np.repeat(change[k : k + 1], 1 + len(pairs), axis=0)
        for run, (i, j) in enumerate(pairs, start=1):
            values[run, [i, j]] = values[run, [j, i]]
        state, _ = look(watch, state, float(samples.time[k]), values + zero, resting=bool(samples.stands[k]))
        new = (state.fault != GOOD) & (first == GOOD)
        first[new] = state.fault[new]
        when[new.any(axis=-1)] = np.minimum(when[new.any(axis=-1)], samples.time[k])
    for run, (i, j) in enumerate(pairs, start=1):
        apart = rows[np.abs(change[rows, i] - change[rows, j]) > max(off[i], off[j])]
        accused = set(np.flatnonzero(first[run]).tolist())
        if not accused:
            what = "not found"
        elif (first[run, [i, j]] == SWAPPED).all():
            what = "named" if len(accused) == 2 else "named, and another"
        elif (first[run] == SWAPPED).any():
            what = "another pair named"
        else:
            what = "one by one" if accused <= {i, j} else "another sensor reported"
        differ = (
            bool(len(apart)) and len(apart) * float(np.median(np.diff(samples.time[rows]))) > THRESHOLDS.fault_duration
        )
        yield what, differ, float(when[run] - samples.time[apart[0]]) if differ else np.nan


def show_swaps(title: str, found: list[tuple[str, bool, float]]) -> None:
    for differ, words in ((True, "differ by more than both limits"), (False, "are more alike")):
        mine = [what for what, of, _ in found if of is differ]
        counts = ", ".join(f"{what} {mine.count(what)}" for what in dict.fromkeys(sorted(mine)))
        print(f"  swapped, {len(mine)} that {words}: {counts or 'none'}")
    delays = np.array([d for what, of, d in found if of and what.startswith("named")]) / 60
    if delays.size:
        print(f"  named after: median {np.median(delays):.0f} min, 90 % {np.quantile(delays, 0.9):.0f} min ({title})")


def main() -> int:
    reached = True
    for title, samples in cases():
        delays: dict[str, list[float]] = {kind: [] for kind in GOALS}
        late: dict[str, set[str]] = {kind: set() for kind in GOALS}
        wrong, alarms, exchanged = 0, list[str](), list[tuple[str, bool, float]]()
        for cycle in np.unique(samples.cycle[samples.cycle >= 0]).tolist():
            watch = find_watch(samples, samples.cycle != cycle)
            if watch is None:
                raise SystemExit(f"{title}: nothing to watch")
            exchanged += swaps(watch, samples, cycle)
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
        print(f"{title}: cycles with a false alarm: {alarms or 'none'}; runs with an intact sensor reported: {wrong}")
        for kind, goal in GOALS.items():
            of = np.array(delays[kind])
            share, median = float((of <= goal).mean()), float(np.nanmedian(of)) / 60
            print(
                f"  {kind:<11} {len(of)} failures, {100 * share:.0f} % in {goal / 60:.0f} min, median {median:.0f} min"
                f"{'; late: ' + ' '.join(sorted(late[kind])) if late[kind] else ''}"
            )
            reached &= share == 1.0
        show_swaps(title, exchanged)
        reached &= not alarms
    print(f"goal, all in time, no false alarm: {'reached' if reached else 'MISSED'}")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
