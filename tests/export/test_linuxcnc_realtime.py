"""An export inside a real HAL and a real LinuxCNC: what the compensator says, and what the drive is told."""

import math
import subprocess
import time
from collections.abc import Callable
from dataclasses import replace

import linuxcncrun
import numpy as np
import pytest
from driftmodels import ACCEPTED, growing, lags
from linuxcncexported import MODULES, fill_in, installed, live_export
from linuxcnclive import Live

from thermocomp.core.correction import Limits
from thermocomp.export.facts import Facts
from thermocomp.export.linuxcnc.package import write_package
from thermocomp.export.vectors import Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "1", "2026-01-31")
#: of the thread [ns], and how many of its periods are looked at
PERIOD, PERIODS = 5_000_000, 2300
SECOND = 1_000_000_000
HAL = "tc-test-hal"

_RUN = """loadrt threads name1=servo-thread period1={period}
loadrt streamer depth=3000 cfg=uffb
loadrt sampler depth=3000 cfg=ffss
loadrt scale count=2
addf streamer.0 servo-thread
source filled.hal
addf scale.0 servo-thread
addf scale.1 servo-thread
addf sampler.0 servo-thread
net {hal}-reading streamer.0.pin.0
net {hal}-value-0 streamer.0.pin.1
net {hal}-value-1 streamer.0.pin.2
net good streamer.0.pin.3 => {hal}.good-0
net z {hal}.correction-0 => scale.0.in
net x {hal}.correction-1 => scale.1.in
setp scale.0.gain 1e9
setp scale.1.gain 1e9
net fine-z scale.0.out => sampler.0.pin.0
net fine-x scale.1.out => sampler.0.pin.1
net status-z {hal}.status-0 => sampler.0.pin.2
net why {hal}.rejected => sampler.0.pin.3
loadusr -w halstreamer rows.txt
start
loadusr -w halsampler -n {periods} samples.txt
"""


def test_in_a_real_thread_it_is_the_compensator() -> None:
    models = [growing("z_um", 2.0), replace(lags("x_um"), honest_error=ACCEPTED)]
    limits = Limits(rate=5.0, hold=1.5, fade=2.0, reading_age=60.0)
    compensator = Compensator.of(models, limits)
    tables = gather(compensator)
    rng = np.random.default_rng(1)
    rows: list[tuple[float, ...]] = []
    count, values, good = 0, [20.0, 0.0], True
    for k in range(PERIODS):
        t = k * PERIOD / SECOND
        if k % 150 == 60 and not 5.0 < t < 9.5:  # a driver that is dead for a while
            count += 1
            values = [round(20.0 + 3.0 * math.sin(t) + 0.1 * rng.standard_normal(), 3), float(rng.integers(0, 6000))]
            values[0] = math.nan if k % 450 == 60 else values[0]
            good = k % 600 != 210
        rows.append((count, *values, int(good)))
    with linuxcncrun.only_one() as folder:
        for file, text in write_package(compensator, "test", FACTS).items():
            (folder / file).write_bytes(text)
        hal = fill_in((folder / "tc_test.hal").read_text(encoding="ascii"))
        alone = [line for line in hal.splitlines() if "motion." not in line and "axis." not in line]
        (folder / "filled.hal").write_text("\n".join(alone) + "\n", encoding="ascii")
        (folder / "rows.txt").write_text("".join(f"{' '.join(map(str, row))}\n" for row in rows), encoding="ascii")
        script = _RUN.format(period=PERIOD, periods=PERIODS, hal=HAL)
        (folder / "run.hal").write_text(script, encoding="ascii")
        with installed(folder):
            linuxcncrun.hand_over(folder)
            line = linuxcncrun.command(folder)
            line[line.index("linuxcnc") :] = ["halrun", "run.hal"]
            done = subprocess.run(line, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        found = np.loadtxt(folder / "samples.txt")
    # when it was called, with what
    calls, at, since, waited, heard, fresh = [], [], 0, 0, 0.0, False
    for k, (number, *given, fine) in enumerate(rows):
        since, waited = since + PERIOD, waited + PERIOD
        if number != heard:
            heard, since, fresh = number, 0, True
        if waited >= SECOND:
            calls.append(([given[0] if fine else math.nan, given[1]], 1e-9 * since if fresh else 1e9, 1e-9 * waited))
            at.append(k)
            waited, fresh = 0, False
    values_, ages, steps = (np.array(c, dtype=np.float64) for c in zip(*calls, strict=True))
    wanted = replay(compensator, tables, Readings(values_, ages, steps))
    assert len(calls) == PERIODS * PERIOD // SECOND
    assert np.abs(1e-6 * found[at, :2] - wanted.correction).max() < 1e-9
    assert (found[at, 2] == wanted.status[:, 0]).all()
    assert set(wanted.status[:, 0]) == {1, 2, 3}
    assert 0.2 < wanted.passed.mean() < 0.8
    assert np.abs(wanted.correction).max() > 3.0
    between = np.setdiff1d(np.arange(PERIODS), at)
    assert (found[between[1:], :2] == found[between[1:] - 1, :2]).all()  # nothing moves but at a call


def give(machine: Live, value: float, count: int) -> None:
    machine.do("halcmd", "sets", f"{HAL}-value-0", repr(value))
    machine.do("halcmd", "sets", f"{HAL}-reading", str(count))


def until(machine: Live, pin: str, holds: Callable[[float], bool], seconds: float = 15.0) -> float:
    end = time.monotonic() + seconds
    while not holds(value := machine.get(pin)):
        assert time.monotonic() < end, f"{pin} is {value}"
        time.sleep(0.05)
    return value


def near(wanted: float) -> Callable[[float], bool]:
    return lambda found: abs(found - wanted) < 1e-5


def test_the_axis_of_a_real_linuxcnc_follows() -> None:
    limits = Limits(rate=20.0, hold=3.0, fade=2.0)
    texts = write_package(Compensator.of([growing("z_um", 2.0)], limits), "test", FACTS)
    with live_export(texts) as machine:
        give(machine, 20.0, 1)
        until(machine, f"{HAL}.status-0", lambda v: v == 1)
        give(machine, 15.0, 2)
        until(machine, f"{HAL}.correction-0", near(0.010))
        assert machine.get("axis.z.eoffset-request") == 0.0  # not homed
        machine.ready()
        machine.do("mdi", "G0 X10 Z50")
        until(machine, "axis.z.eoffset", near(0.010))
        assert machine.get("joint.2.motor-pos-cmd") == pytest.approx(50.010, abs=1e-5)
        assert machine.get("joint.0.motor-pos-cmd") == pytest.approx(10.0, abs=1e-5)
        give(machine, math.nan, 3)
        time.sleep(1.5)
        assert machine.get("axis.z.eoffset") == pytest.approx(0.010, abs=1e-5)
        give(machine, 12.0, 4)  # and nothing any more
        until(machine, "axis.z.eoffset", near(0.016))
        machine.do("off")
        until(machine, f"{HAL}.engaged", lambda v: not v)
        machine.do("on")
        until(machine, f"{HAL}.engaged", bool)
        machine.do("mdi", "G0 Z0")
        until(machine, f"{HAL}.status-0", lambda v: v == 3)
        until(machine, "axis.z.eoffset", lambda v: abs(v) < 1e-3)  # it was held, and goes to zero
        assert not machine.get(f"{HAL}.z-lost")
        assert machine.get("joint.2.motor-pos-cmd") == pytest.approx(0.0, abs=2e-3)
        assert machine.do("told") == []
    assert not (MODULES / "tc_test_hal.so").exists()
