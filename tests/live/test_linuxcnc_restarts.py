"""LinuxCNC runs on while the service is killed and its state spoiled: no step, and never running with a wrong value."""

import json
import random
import socket
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from broker import Mosquitto
from linuxcnclive import live
from shopfloor import running, undisturbed
from spoiledstates import SPOILED

from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings

#: time-lapse factor, and rate in seconds of the world [um/s]
FACTOR, RATE = 60.0, 3.0
#: rate of the component at the controller, which spreads the steps of the service [um/s]
SPREAD = 1.5 * RATE
#: half an hour of the machine, in seconds of the world
SOON = 1800.0 / FACTOR
#: two values are read at most so much closer together than apart [s]
JITTER = 0.2

#: what happens to the state while the service does not run, and whether it may run on afterwards: after a state of
#: another model it takes over the zero, and rebuilds its state from the journal
CASES: dict[str, tuple[Callable[[Path], None], bool]] = {"nothing": (lambda _: None, True)} | {
    case: (spoil, case == "of another model") for case, spoil in SPOILED.items()
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_a_restart_is_no_step_and_is_sound_or_held(case: str, tmp_path: Path) -> None:
    (spoil, runs), rng, broker = CASES[case], random.Random(case), Mosquitto(tmp_path)
    broker.start()
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    judged, config = list[tuple[float, float]](), tmp_path / "serve.toml"
    settings = HalSettings(axes="Z", rate=SPREAD, magnitude=100.0)
    with live(settings) as controller, running(tmp_path, controller, broker, FACTOR, RATE) as (service, machine, error):
        error.start()
        time.sleep(45.0)
        text = config.read_text().replace('first_start = "zero"', 'first_start = "order"')
        config.write_text(f"{text}\n[page]\nport = {port}\n", encoding="ascii")
        for _ in range(20):
            service.kill()
            spoil(tmp_path / "state.json")
            service.start()
            time.sleep(SOON + rng.uniform(2.0, 7.0))
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/state", timeout=5.0) as answer:
                (found,) = json.load(answer)["targets"]
            assert (found["state"] == "active") == runs, found
            judged.append((time.monotonic(), error.rows[-1][1] + error.rows[-1][2]))
        rows = error.end()
        sound = machine.truth, undisturbed(machine, np.array(judged)[:, 0], RATE)
    at, left = np.array(judged).T
    assert np.all(np.abs(np.diff(rows[:, 2])) <= SPREAD * (np.diff(rows[:, 0]) + JITTER))
    assert np.abs(rows[:, 2]).max() > 10.0
    if runs:
        deviation = np.interp(at, rows[:, 0], rows[:, 1])
        expected = deviation + sound[1]
        print(f"{case}: RMS {np.sqrt(np.mean(left**2)):.2f} um, {np.sqrt(np.mean(expected**2)):.2f} um without kills")
        assert np.sqrt(np.mean(left**2)) <= 1.5 * np.sqrt(np.mean(expected**2))
