"""A LinuxCNC that is not there, or no longer: its target is not active, and an alarm says why."""

import asyncio
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from linuxcnclive import Live, live
from test_loop import Given, machine, running, say, until

from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink
from thermocomp.live.loop import Service
from thermocomp.live.page.snapshot import snapshot

#: time until it is no longer active [s]
SOON = 5.0


def sink(path: Path) -> LinuxCncSink:
    return LinuxCncSink(path=path, axes={"z_um": "Z"})


def shown(own: Service) -> dict[str, Any]:
    return snapshot(own, 1.0)


def state(own: Service) -> str:
    return str(shown(own)["targets"][0]["state"])


async def feed(source: Given) -> None:
    for k in range(10_000):
        say(source, 20.0 + 0.01 * (k % 7))
        await asyncio.sleep(0.1)


def kill_component(controller: Live) -> None:
    """Kill the component, and the process that would start it again."""
    keeper = [p for p in controller.pids("thermocomp_hal.py") if p != controller.component()]
    for pid in (*keeper, controller.component()):
        os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize("lose", [kill_component, Live.kill], ids=["component", "LinuxCNC"])
def test_a_controller_that_is_gone_is_not_active_within_5_s(lose: Any) -> None:
    async def work() -> None:
        source = Given()
        own = Service(machine(), [source], [sink(controller.socket)], first_start="zero")

        async def look() -> None:
            feeding = asyncio.create_task(feed(source))
            await until(lambda: state(own) == "active", 30.0)
            await asyncio.to_thread(lose, controller)
            begin = time.monotonic()
            await until(lambda: state(own) != "active", SOON)
            print(f"{lose.__name__}: {state(own)} after {time.monotonic() - begin:.1f} s: {shown(own)['alarms']}")
            await until(lambda: any("LinuxCNC" in alarm for alarm in shown(own)["alarms"]), SOON)
            feeding.cancel()

        await running(own, look)

    with live(HalSettings(axes="XZ", rate=50.0)) as controller:
        controller.ready()
        asyncio.run(work())


def test_a_controller_that_was_never_started_is_never_active(tmp_path: Path) -> None:
    source = Given()
    own = Service(machine(), [source], [sink(tmp_path / "none.sock")], first_start="zero")

    async def look() -> None:
        feeding, found = asyncio.create_task(feed(source)), set[str]()
        end = time.monotonic() + SOON
        while time.monotonic() < end:
            await asyncio.sleep(0.05)
            found.add(state(own))
        assert "active" not in found
        assert any("LinuxCNC" in alarm for alarm in shown(own)["alarms"])
        print(f"never started: {found}: {shown(own)['alarms']}")
        feeding.cancel()

    asyncio.run(running(own, look))
