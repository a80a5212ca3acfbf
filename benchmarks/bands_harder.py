"""Recordings drawn at random in which a model is used under other conditions than those of its training."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record
from thermocomp.virtual.kits import USUAL_PLACES
from thermocomp.virtual.protocol import Physics

#: speeds of training cycles and of judged ones [100/min]
TRAINED, JUDGED_SPEEDS = (8, 28), (6, 33)


def _cycle(rng: np.random.Generator, speeds: tuple[int, int]) -> str:
    """Return a run and a stop that does not let the machine cool down: a warm-up over several cycles goes on."""
    feed = int(rng.integers(0, 3)) * 500
    return "\n".join(
        [
            "[[tests.segments]]",
            f'duration = "{int(rng.integers(40, 160))} min"',
            f"speed = {100 * int(rng.integers(speeds[0], speeds[1] + 1))}",
            f"feed = {{ x = {feed}, y = {feed}, z = {feed} }}" if feed else "",
            "[[tests.segments]]",
            f'duration = "{int(rng.integers(20, 120))} min"',
        ]
    )


def _weather(rng: np.random.Generator) -> str:
    """Return the air of a day: its mean, daily cycle and fluctuations, and the hour at which the test begins."""
    return (
        f"climate = {{ mean = {rng.uniform(18, 27):.1f}, daily = {rng.uniform(0.5, 3.0):.1f}, "
        f'wander = {rng.uniform(0.2, 1.0):.1f}, begin = "{int(rng.integers(5, 20))} h" }}'
    )


def _soak(rng: np.random.Generator) -> str:
    """Return what went before a test: half a day at rest, or a run that ended a few hours ago."""
    if rng.random() < 0.5:
        return 'soak = "12 h"'
    return (
        f'soak = {{ segments = [{{ duration = "8 h" }}, {{ duration = "{int(rng.integers(1, 5))} h", '
        f'speed = {100 * int(rng.integers(8, 30))} }}, {{ duration = "{int(rng.integers(1, 9))} h" }}] }}'
    )


def _protocol(rng: np.random.Generator, cycles: int, judged: int) -> str:
    """Return a protocol: training cycles followed by judged ones in one recording, and judged ones of a later day."""
    rest = '[[tests.segments]]\nduration = "15 min"'
    lines = ['description = "drawn at random"', 'sampling = "1 min"']
    lines += ["[[tests]]", 'name = "first"', _weather(rng), _soak(rng), rest]
    lines += [_cycle(rng, TRAINED) for _ in range(cycles)] + [_cycle(rng, JUDGED_SPEEDS) for _ in range(judged)]
    lines += ["[[tests]]", 'name = "later"', _weather(rng), _soak(rng), rest]
    lines += [_cycle(rng, JUDGED_SPEEDS) for _ in range(judged)]
    return "\n".join(lines)


def draw_harder(cycles: int, judged: int, physics: Physics, seed: int, targets: Sequence[str]) -> Samples:
    """Return the samples of a recording with the usual sensors, of which the first cycles are for training."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "drawn.toml"
        path.write_text(_protocol(np.random.default_rng([seed, cycles, 1]), cycles, judged), encoding="utf-8")
        recordings = record(str(path), seed=seed, physics=physics)
    return stack(recordings, targets)


def choose_sensors(samples: Samples, count: int, seed: int) -> Samples:
    """Return the samples with some of the usual temperatures, drawn at random, and the speed; 0: with all sensors."""
    if not count:
        return samples
    drawn = np.random.default_rng([seed, count, 2]).permutation(len(USUAL_PLACES))[:count]
    return samples.only([*(f"t_{USUAL_PLACES[k]}_C" for k in drawn.tolist()), "spindle_rpm"])
