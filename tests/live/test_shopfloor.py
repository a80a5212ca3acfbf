"""From the sensors of the virtual machine to the drive of a real LinuxCNC, and what happens when a part is killed."""

import os
import random
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from broker import Mosquitto
from linuxcnclive import AXES, PERIOD, live
from numpy.typing import NDArray
from shopfloor import running, undisturbed

from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings
from thermocomp.live.journal.journalreader import JournalReader

#: fastest change of a correction, in seconds of the world: of the service and of the controller [um/s]
ASKED, RATE = 20.0, 30.0
#: of LinuxCNC and of what is written, with three decimals of a micron [um]
FINE = 0.002

pytestmark = pytest.mark.skipif(not Path("/usr/bin/linuxcnc").exists(), reason="LinuxCNC is not installed")


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def program(seconds: float) -> str:
    """Return a program of about so long."""
    rng = random.Random(5)
    lines, spent = ["G21 G90 G18 G64 P0.01", "G0 X0 Z0"], 0.0
    while spent < seconds:
        lines += [f"G1 X{rng.uniform(-80, 80):.3f} Z{rng.uniform(-60, 60):.3f} F3000", "G4 P0.2"]
        spent += 1.4
    return "\n".join([*lines, "G0 X0 Z0", "M2", ""])


@pytest.mark.parametrize(("seconds", "factor"), [(60.0, 600.0), pytest.param(600.0, 60.0, marks=pytest.mark.long)])
def test_ten_hours_of_heat(seconds: float, factor: float, tmp_path: Path) -> None:
    broker = Mosquitto(tmp_path)
    broker.start()
    settings = HalSettings(axes=AXES, magnitude=100.0, rate=RATE)
    with live(settings, {"part": program(seconds)}) as controller:
        with running(tmp_path, controller, broker, factor, ASKED) as (_, _, watched):
            controller.do("trace", "trace")
            controller.do("start", "part.ngc")
            watched.start()
            time.sleep(seconds - 5.0)
            rows = watched.end()
            controller.do("stop")
        trace = controller.trace()
    deviation, left = rows[:, 1], rows[:, 1] + rows[:, 2]
    print(
        f"{len(rows)} looks: RMS {rms(deviation):.1f} um, {rms(left):.2f} um corrected; "
        f"largest {np.abs(deviation).max():.1f} um, {np.abs(left).max():.2f} um"
    )
    assert np.abs(deviation).max() > 40.0
    assert rms(deviation) >= 10.0 * rms(left)
    assert np.abs(deviation).max() >= 10.0 * np.abs(left).max()
    engaged = int(np.argmax(np.abs(trace.offset["Z"]) > 0.0)) + round(1.0 / PERIOD)
    assert np.abs(trace.added("Z") - trace.demanded("Z"))[engaged:].max() <= 0.5
    assert np.ptp(trace.commanded["Z"]) > 50.0
    assert trace.steps("Z").max() <= RATE * PERIOD + FINE


@pytest.mark.parametrize(("kills", "factor"), [(6, 200.0), pytest.param(200, 60.0, marks=pytest.mark.long)])
def test_killed_at_random_moments(kills: int, factor: float, tmp_path: Path) -> None:
    rng, broker = random.Random(kills), Mosquitto(tmp_path)
    broker.start()
    settings = HalSettings(axes=AXES, magnitude=100.0, rate=RATE)
    with live(settings) as controller:
        with running(tmp_path, controller, broker, factor, ASKED) as (service, machine, watched):
            time.sleep(6.0)
            controller.do("trace", "trace")
            watched.start()
            time.sleep(4.0)
            for k in range(kills):
                victim = ("service", "bridge", "broker")[k % 3]
                if victim == "service":
                    service.kill()
                    service.start()
                elif victim == "bridge":
                    os.kill(controller.component(), signal.SIGKILL)
                else:
                    broker.kill()
                    time.sleep(rng.uniform(0.0, 0.5))
                    broker.start()
                time.sleep(rng.uniform(2.0, 4.0))
            time.sleep(5.0)
            rows = watched.end()
            controller.do("stop")
        trace = controller.trace()
    assert trace.steps("Z").max() <= RATE * PERIOD + FINE
    assert np.abs(np.diff(trace.added("Z")[10:])).max() <= RATE * PERIOD + 0.01
    assert np.abs(trace.added("Z")).max() <= 100.0
    deviation, left = rows[:, 1], rows[:, 1] + rows[:, 2]
    without = deviation + undisturbed(machine, rows[:, 0], ASKED)
    print(
        f"{kills} kills: RMS {rms(left):.2f} um of {rms(deviation):.1f}, {rms(without):.2f} without kills; "
        f"largest {np.abs(left).max():.2f} of {np.abs(deviation).max():.1f} um, {np.abs(without).max():.2f} without"
    )
    # while nothing drives the correction the drift since then is left, however long this computer takes for a restart
    held = np.diff(rows[:, 2], prepend=np.nan) == 0.0
    since = np.maximum.accumulate(np.where(held, 0, np.arange(len(rows))))
    allowed = np.abs(without) + np.abs(deviation - deviation[since])
    assert rms(left) <= 1.1 * rms(allowed)
    assert rms(left) <= 0.3 * rms(deviation)
    rows_kept = sum(1 for _ in JournalReader(tmp_path / "live.db").rows())
    assert rows_kept > 50
