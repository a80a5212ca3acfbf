"""LinuxCNC runs on while the service is killed and its state spoiled: no step, and never running with a wrong value."""

import json
import random
import socket
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from broker import Mosquitto
from linuxcnclive import live
from shopfloor import FACTOR, RESTARTS, SEED, running, undisturbed
from spoiledstates import SPOILED

from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings

#: rate in seconds of the world [um/s]
RATE = 3.0
#: rate of the component at the controller, which spreads the steps of the service [um/s]
SPREAD = 1.5 * RATE
#: half an hour of the machine, in seconds of the world
SOON = 1800.0 / FACTOR
#: two values are read at most so much closer together than apart [s]
JITTER = 0.2

#: what happens to the state while the service does not run, and whether it runs on afterwards; after a state of another
#: model it may: it takes over the zero, and rebuilds its state from the journal if that is complete
CASES: dict[str, tuple[Callable[[Path], None], bool | None]] = {"nothing": (lambda _: None, True)} | {
    case: (spoil, None if case == "of another model" else False) for case, spoil in SPOILED.items()
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_a_restart_is_no_step_and_is_sound_or_held(case: str, tmp_path: Path) -> None:
    (spoil, runs), rng, broker = CASES[case], random.Random(f"{case} {SEED}"), Mosquitto(tmp_path)
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
        for _ in range(RESTARTS):
            service.kill()
            spoil(tmp_path / "state.json")
            service.start()
            for _ in range(60):  # the start on a busy computer is no heat
                with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/api/state", timeout=5.0):
                    break
                time.sleep(1.0)
            time.sleep(SOON + rng.uniform(2.0, 7.0))
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/state", timeout=5.0) as answer:
                (found,) = json.load(answer)["targets"]
            active = found["state"] == "active"
            assert runs in (None, active), found
            if active:
                judged.append((time.monotonic(), error.rows[-1][1] + error.rows[-1][2]))
        rows = error.end()
        at, left = np.array(judged or [(time.monotonic(), 0.0)]).T
        sound = undisturbed(machine, at, RATE)
    assert np.all(np.abs(np.diff(rows[:, 2])) <= SPREAD * (np.diff(rows[:, 0]) + JITTER))
    assert np.abs(rows[:, 2]).max() > 10.0
    expected = np.interp(at, rows[:, 0], rows[:, 1]) + sound
    most = 1.5 * np.sqrt(np.mean(expected**2))
    print(f"{case}: {len(judged)} active, RMS {np.sqrt(np.mean(left**2)):.2f} um, at most {most:.2f} um")
    assert np.sqrt(np.mean(left**2)) <= most
