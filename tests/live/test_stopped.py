"""The service is stopped: its corrections stay, or go to zero first, as configured."""

import json
import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest
from broker import Mosquitto
from driftmodels import growing
from test_kills import CONFIG, RATE, in_force

from thermocomp.files import modelfile


@pytest.mark.parametrize("at_stop", ["hold", "fade"])
def test_as_configured(at_stop: str, tmp_path: Path) -> None:
    modelfile.write([growing("z_um", 2.0)], tmp_path / "model.json")
    broker = Mosquitto(tmp_path)
    broker.start()
    text = CONFIG.format(rate=4 * RATE, port=broker.port).replace("[limits]", f'at_stop = "{at_stop}"\n\n[limits]')
    (tmp_path / "serve.toml").write_text(text, encoding="ascii")
    path = tmp_path / "corrections.json"
    command = [sys.executable, "-m", "thermocomp", "serve", str(tmp_path / "serve.toml")]
    publish = f"""
import asyncio, aiomqtt, json, time
async def main():
    async with aiomqtt.Client("127.0.0.1", {broker.port}) as client:
        begin = time.monotonic()
        while True:
            now = time.monotonic() - begin
            t = 20.0 + 2.0 * (now > 12.0) + 0.001 * (int(20.0 * now) % 2)  # a source that works
            await client.publish("m", json.dumps({{"t": t}}))
            await asyncio.sleep(0.05)
asyncio.run(main())
"""
    talking = subprocess.Popen([sys.executable, "-c", publish])
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ))
    seen = list[float]()
    try:
        end = time.monotonic() + 60.0
        while not ((found := in_force(path)) and abs(found[1] + 4.0) < 0.01) and time.monotonic() < end:
            time.sleep(0.05)
        second = subprocess.run(command, check=False, capture_output=True, text=True, timeout=30)
        looked = subprocess.run([*command, "--check"], check=False, capture_output=True, text=True, timeout=30)
        process.send_signal(signal.SIGTERM)
        while process.poll() is None and time.monotonic() < end:
            found = in_force(path)
            seen += [found[1]] if found else []
            time.sleep(0.02)
        out, _ = process.communicate(timeout=10)
    finally:
        process.kill()
        process.wait(10)
        talking.kill()
        talking.wait(10)
        broker.kill()
    assert process.returncode == 0
    assert second.returncode == 2
    assert "state.json: another thermocomp process is using it" in second.stderr
    assert looked.returncode == 0
    assert "the state is saved" in out
    last = json.loads(path.read_text())["corrections"]["z_um"]["offset_um"]
    assert last == (0.0 if at_stop == "fade" else pytest.approx(-4.0, abs=0.01))
    assert max((abs(b - a) for a, b in pairwise(seen)), default=0.0) < 1.0  # on its way, not at once
    assert '"shadow"' not in (tmp_path / "state.json").read_text()
