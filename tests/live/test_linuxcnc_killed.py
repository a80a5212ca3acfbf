"""What happens when the service, the component or LinuxCNC itself is killed: no step, and nothing before homing."""

import asyncio
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import linuxcncsinking
import numpy as np
import pytest
from linuxcnclive import AXES, PERIOD, Live, live

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings, Pattern
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

RATE, MAGNITUDE, FINE = 20.0, 50.0, 0.002


def sink_of(machine: Live) -> LinuxCncSink:
    return LinuxCncSink(path=machine.socket, axes={"z_um": "Z"})


async def until(right: Callable[[], object], seconds: float = 15.0) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not right():
        assert time.monotonic() < end
        await asyncio.sleep(0.01)


async def connected(sink: LinuxCncSink, seconds: float = 15.0) -> None:
    """Connect as soon as that can be."""
    end = time.monotonic() + seconds
    while True:
        try:
            await sink.connect(2.0)
        except ThermocompError:
            assert time.monotonic() < end
            await asyncio.sleep(0.02)
        else:
            return


async def lost(sink: LinuxCncSink) -> None:
    """Apply until the sink says that nobody is there."""
    try:
        for _ in range(100):
            await sink.apply({"z_um": Correction(5.0)})
            await asyncio.sleep(0.02)
    except ThermocompError:
        return
    pytest.fail("nobody is there, and it was not said")


@pytest.mark.parametrize(
    ("pattern", "kills"),
    [
        ("offset", 10),
        pytest.param("offset", 100, marks=pytest.mark.long),
        pytest.param("drive", 100, marks=pytest.mark.long),
    ],
)
def test_service_and_component_at_random(pattern: Pattern, kills: int) -> None:
    rng = random.Random(kills)
    settings = HalSettings(pattern=pattern, axes=AXES, rate=RATE, magnitude=MAGNITUDE)
    program = "G21 G90 G64\n" + "G1 X40 Z-30 F2000\nG1 X-40 Z30\n" * 1000 + "M2\n"

    def serve() -> "subprocess.Popen[bytes]":
        words = [sys.executable, str(Path(linuxcncsinking.__file__)), str(machine.socket), str(rng.randrange(1000))]
        return subprocess.Popen(words, stdout=subprocess.DEVNULL)

    with live(settings, {"part": program}) as machine:
        machine.ready()
        machine.do("trace", "trace")
        service = serve()
        try:
            machine.do("start", "part.ngc")
            time.sleep(2.0)
            for k in range(kills):
                time.sleep(rng.uniform(0.1, 0.5))
                if k % 2:
                    os.kill(machine.component(), signal.SIGKILL)
                else:
                    service.kill()
                    service.wait(10.0)
                    service = serve()
            time.sleep(2.0)
        finally:
            service.kill()
            service.wait(10.0)
        machine.do("stop")
        trace = machine.trace()
    for axis in AXES:
        assert trace.steps(axis).max() <= RATE * PERIOD + FINE
        # a line that an end of the travel bounds is within it everywhere
        assert np.abs(trace.added(axis)).max() <= MAGNITUDE + 0.5
        aside = (trace.added(axis) - trace.demanded(axis))[round(1.0 / PERIOD) :]
        assert np.abs(aside).max() <= 0.5
        last = trace.offset[axis][-round(3.0 / PERIOD) :]
        assert np.ptp(last) > 1.0  # it is corrected still


@pytest.mark.parametrize("pattern", ["offset", pytest.param("drive", marks=pytest.mark.long)])
def test_without_a_service_it_is_held_and_then_fades(pattern: Pattern) -> None:
    settings = HalSettings(pattern=pattern, axes=AXES, rate=RATE, timeout=0.5, hold=1.0, fade=10.0)

    async def work() -> None:
        sink = sink_of(machine)
        await sink.connect(5.0)
        await sink.apply({"z_um": Correction(-12.0)})
        await until(lambda: sink.reports()["Z"].in_force < -11.9)
        await sink.close()

    with live(settings) as machine:
        machine.ready()
        asyncio.run(work())
        machine.do("trace", "trace")
        time.sleep(3.3)
        machine.do("stop")
        trace = machine.trace()
        assert machine.get("tc.alive.out") == 0.0
    added = trace.added("Z")
    held = int(np.argmax(np.abs(added[10:] + 12.0) > 0.1)) * PERIOD
    assert 0.9 < held < 2.5
    assert added[-1] == pytest.approx(0.0, abs=0.1)
    assert trace.steps("Z").max() <= 10.0 * PERIOD + FINE
    fading = (added > -11.0) & (added < -1.0) & (np.arange(len(added)) > 10)
    assert fading.sum() * PERIOD == pytest.approx(10.0 / 10.0, rel=0.1)


def test_without_a_component_it_stays_and_a_new_one_begins_there() -> None:
    async def work() -> None:
        sink = sink_of(machine)
        await sink.connect(5.0)
        await sink.apply({"z_um": Correction(-12.0)})
        await until(lambda: sink.reports()["Z"].in_force < -11.9)
        machine.do("trace", "trace")
        keeper = [p for p in machine.pids("thermocomp_hal.py") if p != machine.component()]
        for pid in (*keeper, machine.component()):  # so that nobody starts it again
            os.kill(pid, signal.SIGKILL)
        await lost(sink)
        assert await sink.confirmed() is None
        await asyncio.sleep(0.5)
        assert machine.get("axis.z.eoffset") == pytest.approx(-0.012, abs=1e-4)  # HAL continues
        machine.do("off")
        machine.do("on")  # nobody looks after it: it begins at zero, and comes back within the rate
        await asyncio.sleep(1.5)
        assert machine.get("axis.z.eoffset") == pytest.approx(-0.012, abs=1e-4)
        started = [line for line in (machine.folder / "thermocomp.hal").read_text().splitlines() if "loadusr" in line]
        machine.do("halcmd", *started[0].split())
        again = sink_of(machine)
        await connected(again)
        found = await again.confirmed()
        assert found is not None
        assert found["z_um"].offset == pytest.approx(-12.0, abs=0.1)
        await asyncio.sleep(0.3)
        machine.do("stop")
        await again.close()
        await sink.close()

    with live(HalSettings(axes=AXES, rate=RATE)) as machine:
        machine.ready()
        asyncio.run(work())
        trace = machine.trace()
    on = trace.on[1:] & trace.on[:-1]
    assert trace.steps("Z")[on].max() <= RATE * PERIOD + FINE


def test_after_linuxcnc_was_killed_nothing_is_in_force_before_homing() -> None:
    async def work() -> None:
        sink = sink_of(machine)
        await sink.connect(5.0)
        await sink.apply({"z_um": Correction(-12.0)})
        await until(lambda: sink.reports()["Z"].in_force < -11.9)
        machine.kill()
        await lost(sink)
        machine.start()
        await connected(sink)
        machine.do("trace", "trace")
        await sink.apply({"z_um": Correction(-12.0)})
        machine.do("on")
        await asyncio.sleep(0.5)
        await sink.apply({"z_um": Correction(-12.0)})
        assert sink.suspended() == {"z_um": "the controller is not homed"}
        found = await sink.confirmed()
        assert found is not None
        assert found["z_um"].offset == 0.0
        await asyncio.to_thread(machine.do, "home")
        await until(lambda: sink.reports()["Z"].in_force < -11.9)
        machine.do("stop")
        await sink.close()

    with live(HalSettings(axes=AXES, rate=RATE)) as machine:
        machine.ready()
        asyncio.run(work())
        trace = machine.trace()
    added = trace.added("Z")
    assert np.all(np.abs(added[~trace.on]) < 1e-6)
    assert added[-1] == pytest.approx(-12.0, abs=0.1)
    assert trace.steps("Z").max() <= RATE * PERIOD + FINE
