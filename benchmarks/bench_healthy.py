"""False alarms of the watch on machines whose sensors are all intact.

Run with ``python benchmarks/bench_healthy.py [tests]`` (9 tests of 12 h on the linear and on the nonlinear virtual
machine). The watch is fitted to the demo; the tests have other speeds, drawn every 45 min, and other weather (18 to 26
degC, no more variable than in the demo), with the axes stopped as in the demo. If the measured data are available, also
recordings of printers without a spindle: a watch fitted to the first half of 2021-06-13 is run over the whole of it,
and over 06-12 of another printer, whose chamber sensor is absent and reads -180 degC.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from measured import find_measured
from thermocomp.core.watch import Watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, WORDS, begin
from thermocomp.virtual.datasets import record

TESTS = 9
HERE = Path(__file__).resolve().parents[1]
FEW = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")
PROTOCOL = """
description = "speeds drawn at random, axes stopped"
sampling = "1 min"
places = "usual"
climate = {{ mean = {mean}, daily = {daily}, wander = {wander} }}

[[segments]]
duration = "15 min"

[[segments]]
repeat = 16
segments = [
    {{ duration = "30 min", speed = {{ between = [400, 3200], step = 50 }} }},
    {{ duration = "15 min" }},
]
"""

CHAMBER = """
[columns.chamber_t]
role = "temperature"
place = "chamber"
"""


def accused(watch: Watch, samples: Samples) -> dict[str, str]:
    """Return the first status other than good that the watch gives to each sensor of a test."""
    columns = [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]
    state, found = begin(watch), dict[str, str]()
    for k, time in enumerate(samples.time.tolist()):
        state, _ = look(watch, state, time, samples.values[k, columns], resting=bool(samples.stands[k]))
        for sensor in np.flatnonzero(state.fault != GOOD).tolist():
            found.setdefault(watch.names[sensor], WORDS[int(state.fault[sensor])])
    return found


def virtual(count: int) -> bool:
    sound = True
    for physics in ("linear", "nonlinear"):
        whole = stack(record("demo", physics=physics), ["z_um"])
        learned = whole.take(np.arange(len(whole)) % 3 == 0)
        watches = [find_watch(s, s.cycle >= 0) for s in (learned, learned.only([*FEW, "spindle_rpm"]))]
        alarms, hours = dict[int, list[str]](), 0.0
        for seed in range(count):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "drawn.toml"
                path.write_text(
                    PROTOCOL.format(mean=18.0 + seed % 5 * 2.0, daily=0.6 * (1 + seed % 3), wander=0.2 * (1 + seed % 3))
                )
                test = stack(record(path, physics=physics, seed=seed), ["z_um"])
            hours += float(test.time[-1] - test.time[0]) / 3600
            for watch in watches:
                if watch is None:
                    raise SystemExit("nothing to watch")
                said = alarms.setdefault(len(watch.sensors), [])
                said += [f"{name} {word} in test {seed}" for name, word in accused(watch, test).items()]
        for sensors, said in alarms.items():
            print(f"{physics}, {sensors} sensors, {hours:.0f} h: false alarms {', '.join(said) or 'none'}")
            sound &= not said
    return sound


def printers() -> bool:
    if (folder := find_measured("voron_frame")) is None:
        return True
    with tempfile.TemporaryDirectory() as place:
        own = Path(place) / "voron.toml"
        own.write_text((HERE / "docs" / "files" / "voron.toml").read_text() + CHAMBER)
        mapping = read_mapping(own)
    first, second = (stack([recordings.read(p, mapping)], ["z"]) for p in sorted(folder.glob("*.csv")))
    watch = find_watch(second, np.arange(len(second)) < len(second) // 2)
    if watch is None:
        print("voron: nothing to watch")
        return True
    said = accused(watch, second)
    print(f"voron 06-13, fitted to its first half: false alarms {said or 'none'}")
    other = accused(watch, first)
    print(f"voron 06-12, another printer whose chamber sensor is absent, by that watch: {other or 'nothing'}")
    return not said and other.get("chamber_t") == "missing"


def main() -> int:
    reached = virtual(int(sys.argv[1]) if len(sys.argv) > 1 else TESTS)
    reached &= printers()
    print(f"goal, no false alarm: {'reached' if reached else 'MISSED'}")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
