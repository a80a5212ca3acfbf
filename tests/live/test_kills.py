"""The service is killed at random moments of a warm run: no step above the rate, and it comes back to where it was."""

import asyncio
import json
import os
import random
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import aiomqtt
import pytest
from broker import Mosquitto
from driftmodels import growing

from thermocomp.files import modelfile

RATE = 0.5

CONFIG = """
models = ["model.json"]
state = "state.json"
first_start = "zero"

[limits]
rate = {rate}

[[sources]]
kind = "mqtt"
topic = "m"
port = {port}

[[sinks]]
kind = "file"
file = "corrections.json"
"""


def in_force(path: Path) -> tuple[float, float] | None:
    """Return when the correction was written, and what it is."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        return None
    return float(content["time"]), float(content["corrections"]["z_um"]["offset_um"])


@pytest.mark.parametrize("kills", [3, pytest.param(200, marks=pytest.mark.long)])
def test_no_step_above_the_rate(kills: int, tmp_path: Path) -> None:
    modelfile.write([growing("z_um", 2.0)], tmp_path / "model.json")
    broker = Mosquitto(tmp_path)
    broker.start()
    (tmp_path / "serve.toml").write_text(CONFIG.format(rate=RATE, port=broker.port), encoding="ascii")
    path, rng = tmp_path / "corrections.json", random.Random(kills)
    seen: list[tuple[float, float]] = []
    process: subprocess.Popen[bytes] | None = None

    def start() -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "thermocomp", "serve", str(tmp_path / "serve.toml")]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=dict(os.environ))

    async def work() -> None:
        nonlocal process
        process = start()
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            while in_force(path) is None:
                await client.publish("m", json.dumps({"t": rng.uniform(20.0, 20.01), "time": time.time()}))
                await asyncio.sleep(0.03)
            begin, due, done = time.monotonic(), 6.0, 0
            while done < kills or time.monotonic() - begin < due:
                now = time.monotonic() - begin
                # it never settles: the correction is on its way all the time
                t = 20.0 + 4.0 * min(now, 2.0) + 0.5 * ((now // 7) % 2)
                await client.publish("m", json.dumps({"t": t, "time": time.time()}))
                if (found := in_force(path)) is not None and found not in seen[-1:]:
                    seen.append(found)
                if now >= due and done < kills:
                    process.send_signal(signal.SIGKILL)
                    process.wait(10)
                    process, done, due = start(), done + 1, now + rng.uniform(0.3, 4.0)
                    due += 3.0 * (done == kills)
                await asyncio.sleep(0.03)

    try:
        asyncio.run(work())
    finally:
        if process is not None:
            process.kill()
            process.wait(10)
        broker.kill()
    assert len(seen) > 50
    steps = [(t1 - t0, abs(v1 - v0)) for (t0, v0), (t1, v1) in pairwise(seen)]
    # it is written a little after it was worked out
    worst = max(v - RATE * (dt + 0.2) for dt, v in steps)
    assert worst <= 1e-9
    assert max(abs(v) for _, v in seen) > 3.0
    moving = [v for _, v in seen]
    assert abs(moving[-1]) >= 0.5 * max(map(abs, moving))  # it did not begin again
