"""Tests of the virtual machines for `bench_speed`: other speeds and weather, heat of cutting, moving axes."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import thermocomp as tc
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.heat import BearingFriction, HeatSources
from thermocomp.virtual.machine import FeedDrive
from thermocomp.virtual.preload import AngularContact
from thermocomp.virtual.protocol import Physics

#: jobs of half an hour and stops, for 25 h
PROTOCOL = """
description = "speeds drawn at random"
sampling = "20 s"
places = "usual"
probes = ["z"]
climate = {{ mean = {mean}, daily = {daily}, wander = {wander} }}
segments = [
    {{ duration = "15 min" }},
    {{ repeat = {jobs}, segments = [
        {{ duration = {{ between = ["10 min", "50 min"], step = "5 min" }}, speed = {speed}{feed} }},
        {{ duration = {{ between = ["5 min", "25 min"], step = "5 min" }} }},
    ] }},
]
"""
JOBS = 33  # in 25 h
DRAWN = "{ between = [400, 3200], step = 50 }"
FEED = ", feed = { x = 600, y = 1000, z = 600 }"


def draw(physics: Physics, seed: int, *, jobs: int = JOBS, feed: bool = False) -> Recording:
    """Return a test of other speeds and weather, no more variable than in the demo."""
    weather = {"mean": 18 + seed % 5 * 2, "daily": 0.6 * (1 + seed % 3), "wander": 0.2 * (1 + seed % 3)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawn.toml"
        path.write_text(PROTOCOL.format(**weather, jobs=jobs, speed=DRAWN, feed=FEED if feed else ""))
        (found,) = tc.simulate(path, physics=physics, seed=seed)
    return found


@contextmanager
def cutting(seed: int) -> Iterator[None]:
    """Let the spindle of the virtual machines give off up to 30 % more heat, another share at each speed."""

    def share(speed: float) -> float:
        return 1.0 + 0.3 * ((abs(round(speed)) * 0.6180339887 + 0.3819 * seed) % 1.0)

    friction, contact, given = BearingFriction.heat, AngularContact.heat, HeatSources.given

    def more_friction(self: BearingFriction, ratio: float, temperature: float, tightening: float) -> float:
        return share(ratio * HeatSources.top_speed) * friction(self, ratio, temperature, tightening)

    def more_contact(self: AngularContact, speed: float, temperature: float, approach: float) -> float:
        return share(speed) * contact(self, speed, temperature, approach)

    def more_given(self: HeatSources, drive: FeedDrive) -> dict[str, float]:
        heat = given(self, drive)
        return {k: v * (share(drive.speed) if k in ("rotor", "stator") else 1.0) for k, v in heat.items()}

    with (
        patch.object(BearingFriction, "heat", more_friction),
        patch.object(AngularContact, "heat", more_contact),
        patch.object(HeatSources, "given", more_given),
    ):
        yield
