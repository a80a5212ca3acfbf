"""The traps of external offsets, each on a real LinuxCNC; and who may connect, and what is not understood."""

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import Awaitable, Callable

import numpy as np
import pytest
from linuxcnclive import AXES, PERIOD, Live, live

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.ports import Confirming, Sink
from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings, Pattern
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

QUICK = HalSettings(axes=AXES, rate=100.0)


async def until(right: Callable[[], object], seconds: float = 15.0) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not right():
        assert time.monotonic() < end
        await asyncio.sleep(0.01)


def with_sink(machine: Live, work: Callable[[LinuxCncSink], Awaitable[None]]) -> None:
    """Do something with a sink that is connected."""

    async def all_of_it() -> None:
        sink = LinuxCncSink(path=machine.socket, axes={"z_um": "Z"})
        await sink.connect(5.0)
        try:
            await work(sink)
        finally:
            await sink.close()

    asyncio.run(all_of_it())


def test_1_without_a_ratio_nothing_moves_and_it_is_said() -> None:
    async def work(sink: LinuxCncSink) -> None:
        await sink.apply({"z_um": Correction(-25.0)})
        await until(lambda: "OFFSET_AV_RATIO" in sink.alarms().get("z_um", ""))
        found = await sink.confirmed()
        assert found is not None
        assert found["z_um"].at(0.0) == pytest.approx(0.0, abs=1e-6)
        assert machine.get("axis.z.eoffset-request") == pytest.approx(-0.025, abs=1e-4)

    with live(QUICK, ratio="") as machine:
        machine.ready()
        with_sink(machine, work)


def test_2_and_3_what_is_said_before_homing_and_what_off_and_on_does() -> None:
    async def work(sink: LinuxCncSink) -> None:
        assert isinstance(sink, Sink)
        assert isinstance(sink, Confirming)
        machine.do("on")
        for offset in (-25.0, -10.0, -25.0):
            await sink.apply({"z_um": Correction(offset)})
            await asyncio.sleep(0.1)
        assert sink.suspended() == {"z_um": "the controller is not homed"}
        machine.do("home")
        await until(lambda: sink.reports()["Z"].in_force < -24.9)
        assert sink.suspended() == {}
        await sink.apply({"z_um": Correction(0.0)})
        await until(lambda: abs(sink.reports()["Z"].in_force) < 0.02)
        await asyncio.sleep(0.2)
        assert machine.get("axis.z.eoffset") == pytest.approx(0.0, abs=2e-5)  # and not +10 or +25

        await sink.apply({"z_um": Correction(-25.0)})
        await until(lambda: sink.reports()["Z"].in_force < -24.9)
        machine.do("mdi", "G0 Z10")
        machine.do("trace", "trace")
        machine.do("off")
        found = await sink.confirmed()
        assert found is not None
        assert found["z_um"].offset == 0.0
        assert sink.suspended() == {"z_um": "the controller is off"}
        machine.do("on")
        await until(lambda: sink.reports()["Z"].in_force < -24.9)
        machine.do("mdi", "G0 Z10")
        await asyncio.sleep(0.3)
        machine.do("stop")
        # in place after the first absolute move, and until then never twice at once
        assert machine.get("joint.2.motor-pos-cmd") == pytest.approx(10.0 - 0.025, abs=1e-4)

    with live(QUICK) as machine:
        with_sink(machine, work)
        trace = machine.trace()
    on = trace.on[1:] & trace.on[:-1]
    assert not trace.on.all()
    assert trace.steps("Z")[on].max() <= 100.0 * PERIOD + 0.002
    begun = int(np.argmax(np.diff(trace.on.astype(int)) > 0)) + 1
    assert trace.offset["Z"][begun] == pytest.approx(0.0, abs=0.2)


def test_joint_mode_suspends_and_coming_back_is_no_step() -> None:
    async def work(sink: LinuxCncSink) -> None:
        await sink.apply({"z_um": Correction(-25.0)})
        await until(lambda: sink.reports()["Z"].in_force < -24.9)
        machine.do("trace", "trace")
        machine.do("teleop", 0)
        await asyncio.sleep(0.3)
        assert await sink.confirmed() is not None
        machine.do("teleop", 1)
        await asyncio.sleep(0.5)
        machine.do("stop")

    with live(QUICK) as machine:
        machine.ready()
        with_sink(machine, work)
        trace = machine.trace()
    drive = 1e3 * trace.drive["Z"]
    assert np.abs(np.diff(drive)).max() <= 100.0 * PERIOD + 0.02


def test_4_a_soft_limit_clips_and_it_is_said() -> None:
    async def work(sink: LinuxCncSink) -> None:
        await sink.apply({"z_um": Correction(25.0)})
        await asyncio.to_thread(machine.do, "mdi", "G0 Z119.99")
        await until(lambda: "soft limit" in sink.reports()["Z"].alarm)
        found = await sink.confirmed()
        assert found is not None
        assert found["z_um"].at(119.99) == pytest.approx(10.0, abs=0.1)
        await asyncio.to_thread(machine.do, "mdi", "G0 Z110")
        await until(lambda: not sink.reports()["Z"].alarm and sink.reports()["Z"].in_force > 24.9)

    with live(QUICK) as machine:
        machine.ready()
        with_sink(machine, work)


@pytest.mark.parametrize(
    ("pattern", "included"), [("offset", -25.0), pytest.param("drive", 0.0, marks=pytest.mark.long)]
)
def test_5_what_a_probe_says_of_a_correction_in_force(pattern: Pattern, included: float) -> None:
    async def work(sink: LinuxCncSink) -> None:
        await sink.apply({"z_um": Correction(-25.0)})
        await until(lambda: sink.reports()["Z"].in_force < -24.9)
        await asyncio.to_thread(machine.do, "mdi", "G0 Z-100")
        probed = await asyncio.to_thread(machine.do, "probe", "G38.2 Z-101 F60")
        # the drive touched at -100.5; the tool was commanded to 25 um above
        commanded = -100.5 + 0.025
        assert 1e3 * (probed - commanded) == pytest.approx(included, abs=1.0)

    with live(HalSettings(pattern=pattern, axes=AXES, rate=100.0)) as machine:
        machine.ready()
        with_sink(machine, work)


def test_who_may_connect_and_what_is_not_understood() -> None:
    bad: tuple[bytes, ...] = (
        b"nonsense",
        b"[1]",
        b'{"beat": 1, "axes": {"Z": [NaN, 0, 0]}}',
        b'{"beat": 1, "axes": {"Z": [1e999, 0, 0]}}',
        b'{"beat": 1, "axes": {"Z": [1, 0]}}',
        b'{"beat": 1, "axes": {"Q": [1, 0, 0]}}',
        b'{"beat": 1, "axes": {"X": [9, 0, 0], "Z": [1, 0, "x"]}}',
        b'{"beat": 1, "rate": -1}',
        b'{"beat": 1, "magnitude": 0}',
        b'{"beat": "x"}',
        b'{"axes": {"Z": [1, 0, 0]}}',
        b'{"beat": 1, "axes": ' + b"[" * 2000 + b"]" * 1500 + b"}",
        b"\xff\xfe",
    )

    async def second() -> None:
        with pytest.raises(ThermocompError, match="another service"):
            await LinuxCncSink(path=machine.socket, axes={"z_um": "Z"}).connect(5.0)

    async def refused() -> None:
        with pytest.raises(ThermocompError, match="LinuxCNC does not correct axis Y"):
            await LinuxCncSink(path=machine.socket, axes={"y_um": "Y"}).connect(5.0)
        with pytest.raises(ThermocompError, match="there is no socket"):
            await LinuxCncSink(path=machine.folder / "none", axes={"z_um": "Z"}).connect(5.0)
        sink = LinuxCncSink(path=machine.socket, axes={"z_um": "z"})
        await sink.connect(5.0)
        assert await sink.confirmed() == {"z_um": Correction(0.0)}
        await sink.close()

    with live(QUICK) as machine:
        machine.ready()
        assert machine.socket.stat().st_mode & 0o777 == 0o600
        with socket.socket(socket.AF_UNIX) as one:
            one.connect(str(machine.socket))
            with one.makefile("rwb") as file:
                assert json.loads(file.readline())["suspended"] == ""
                for line in bad:
                    file.write(line + b"\n")
                    file.flush()
                    assert "not understood" in json.loads(file.readline())["error"], line
                asyncio.run(second())
            end = time.monotonic() + 5.0
            with contextlib.suppress(ConnectionError):  # a line without end: it hangs up
                while time.monotonic() < end:
                    one.sendall(b" " * 1000)
                    time.sleep(0.001)
            assert time.monotonic() < end
        time.sleep(0.1)
        assert machine.get("tc.z.offset.out") == machine.get("tc.x.offset.out") == 0.0
        asyncio.run(refused())
