"""A real LinuxCNC follows offset and slope while it runs a program: in every period, through both patterns."""

import asyncio
import math
import random
import time

import numpy as np
import pytest
from linuxcnclive import AXES, LIMIT, PERIOD, Live, Trace, live

from thermocomp.core.correction import Correction
from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings, Pattern
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink

RATE = 20.0
#: of LinuxCNC and of what is written, with three decimals of a micron [um]
FINE = 0.002


def program(seconds: float) -> str:
    """Return a program of about so long: feeds, rapids and arcs all over the travel."""
    rng = random.Random(5)
    lines, spent = ["G21 G90 G18 G64 P0.01", "G0 X0 Z0"], 0.0
    while spent < seconds:
        x, z = rng.uniform(-80.0, 80.0), rng.uniform(-60.0, 60.0)
        lines += [f"G1 X{x:.3f} Z{z:.3f} F3000", f"G2 X{x + 10:.3f} Z{z + 10:.3f} I10 K0 F1500"]
        lines += [f"G0 X{-x:.3f}", f"G91 G1 Z{rng.choice((-5, 5))} F600", "G90"]
        spent += 4.6
    return "\n".join([*lines, "G0 X0 Z0", "M2", ""])


async def correct(machine: Live) -> dict[str, Correction]:
    """Correct a machine that runs its program, as a machine that gets warm and cold would be, and trace it."""
    sink = LinuxCncSink(path=machine.socket, axes={"x_um": "X", "z_um": "Z"})
    await sink.connect(5.0)
    machine.do("trace", "trace")
    machine.do("start", "part.ngc")
    begin, said = time.monotonic(), {}
    while machine.do("running"):
        t = time.monotonic() - begin
        wave = math.sin(t / 4.0)
        said = {
            "x_um": Correction(12.0 * wave, -90.0 * wave, 50.0),
            "z_um": Correction(-25.0 + 8.0 * wave, 120.0, -100.0),
            "y_um": Correction(1000.0),  # nobody asked for it
        }
        await sink.apply(said)
        await asyncio.sleep(0.05)
    async with asyncio.timeout(10.0):
        while not (found := await sink.confirmed()) or far(found, said) > 0.1:
            await asyncio.sleep(0.05)
    await sink.close()
    machine.do("stop")
    return said


def far(found: dict[str, Correction], said: dict[str, Correction]) -> float:
    """Return how far what is in force is from what was said, anywhere on the travel [um]."""
    return max(abs(c.at(p) - said[t].at(p)) for t, c in found.items() for p in (-LIMIT, LIMIT))


def check(trace: Trace) -> None:
    """See whether the drives were told what was demanded, from a second after engagement on."""
    engaged = int(np.argmax(np.abs(trace.offset["Z"]) > 0.0)) + round(1.0 / PERIOD)
    for axis in AXES:
        aside = trace.added(axis) - trace.demanded(axis)
        assert np.abs(aside[engaged:]).max() <= 0.5
        assert trace.steps(axis).max() <= RATE * PERIOD + FINE
    assert np.ptp(trace.commanded["X"]) > 50.0
    assert np.ptp(trace.added("Z")) > 5.0


@pytest.mark.parametrize(
    ("pattern", "seconds"),
    [
        ("offset", 8.0),
        ("drive", 5.0),
        pytest.param("offset", 600.0, marks=pytest.mark.long),
        pytest.param("drive", 600.0, marks=pytest.mark.long),
    ],
)
def test_in_every_period(pattern: Pattern, seconds: float) -> None:
    settings = HalSettings(pattern=pattern, axes=AXES, rate=RATE)
    with live(settings, {"part": program(seconds)}) as machine:
        machine.ready()
        asyncio.run(correct(machine))
        assert machine.do("told") == []  # it came to its end
        trace = machine.trace()
    assert len(trace.period) * PERIOD > 0.9 * seconds
    check(trace)


@pytest.mark.parametrize("pattern", ["offset", pytest.param("drive", marks=pytest.mark.long)])
def test_never_beyond_the_magnitude(pattern: Pattern) -> None:
    async def work() -> None:
        sink = LinuxCncSink(path=machine.socket, axes={"x_um": "X", "z_um": "Z"}, magnitude=20.0)
        await sink.connect(5.0)
        machine.do("trace", "trace")
        await sink.apply({"x_um": Correction(1e9), "z_um": Correction(0.0, -1e6, 0.0)})
        for z in (30.0, -30.0):
            await asyncio.to_thread(machine.do, "mdi", f"G0 Z{z}")
        await asyncio.sleep(0.5)
        found = await sink.confirmed()
        assert found is not None
        assert found["x_um"].offset == pytest.approx(20.0, abs=0.05)
        await sink.close()
        machine.do("stop")

    with live(HalSettings(pattern=pattern, axes=AXES, magnitude=30.0, rate=100.0)) as machine:
        machine.ready()
        asyncio.run(work())
        trace = machine.trace()
    for axis in AXES:
        assert np.abs(trace.added(axis)).max() <= 20.0 + 0.05
    assert trace.added("X").max() > 19.9
