"""What the component in LinuxCNC answers is text of others: odd ones end the connection with a reason."""

import asyncio
import contextlib
import json
from pathlib import Path
from typing import Any

import pytest

from thermocomp.core.exceptions import ThermocompError
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

AXIS = {"offset": 1.0, "slope": 0.0, "reference": 0.0, "position": 0.0, "demand": 1.0, "in_force": 1.0, "alarm": ""}
GOOD: dict[str, Any] = {"beat": 0, "ticks": 1, "timeout": 2.0, "suspended": "", "still": False, "axes": {"Z": AXIS}}


def answered(line: bytes, folder: Path) -> LinuxCncSink:
    """Connect to a component that says a line."""
    sink = LinuxCncSink(path=folder / "s", axes={"z_um": "Z"})

    done = asyncio.Event()

    async def say(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(line + b"\n")
        with contextlib.suppress(OSError):
            await reader.read()
        writer.close()
        done.set()

    async def work() -> None:
        async with await asyncio.start_unix_server(say, folder / "s"):
            try:
                await sink.connect(2.0)
            finally:
                status = sink.status()
                await sink.close()
                sink._connection.now = status
                await asyncio.wait_for(done.wait(), 10.0)

    asyncio.run(work())
    return sink


@pytest.mark.parametrize(
    "line",
    [
        b"[" * 100_000,
        b"\xff\xfe",
        b"[]",
        b'{"beat": 0}',
        b'{"error": "\\ud800\\u001b[31m"}',
        json.dumps(GOOD | {"axes": {"Z": AXIS | {"offset": float("nan")}}}).encode(),
        json.dumps(GOOD | {"ticks": float("inf")}).encode(),
        json.dumps(GOOD | {"axes": [AXIS]}).encode(),
        json.dumps(GOOD | {"axes": {"Z": [1]}}).encode(),
        json.dumps(GOOD | {"axes": {"\ud800": AXIS}}).encode(),
        json.dumps(GOOD | {"timeout": "\x00"}).encode(),
    ],
)
def test_an_odd_answer(line: bytes, tmp_path: Path) -> None:
    with pytest.raises(ThermocompError, match="LinuxCNC at ") as caught:
        answered(line, tmp_path)
    assert "\ud800" not in str(caught.value)
    assert "\x1b" not in str(caught.value)


def test_words_are_shown_escaped_and_axes_that_are_none_are_left_out(tmp_path: Path) -> None:
    axes = {"Z": AXIS | {"alarm": "\x1b[31m" + "a" * 1000}} | {f"x{k}\ud800": AXIS for k in range(100)}
    sink = answered(json.dumps(GOOD | {"suspended": "\ud800off\x07", "axes": axes}).encode(), tmp_path)
    assert set(sink.reports()) == {"Z"}
    assert sink.suspended() == {"z_um": r"the controller is \ud800off\x07"}
    assert sink.alarms()["z_um"].startswith(r"axis Z \x1b[31maaa")
    assert len(sink.alarms()["z_um"]) < 300
