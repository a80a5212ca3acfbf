"""Hostile readings through the C code of a model of every method, in double and in single precision."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from compiledblock import COMPILERS, CompiledBlock
from everymethod import Fitted, documented
from numpy.typing import NDArray

from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input
from thermocomp.export.vectors import Readings, replay
from thermocomp.files.machines import read_models
from thermocomp.runtime.compensator import Compensator

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")
FloatArray = NDArray[np.float64]
COUNT = 2000
LIMITS = Limits(magnitude=8.0, rate=0.2, hold=300.0, fade=600.0)
WILD = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e38, -0.0, 85.0, -127.0, 65535.0)
#: what happens to a sensor for a while
EVENTS = ("wild", "stuck", "jump", "missing", "swapped", "drift")


def hostile(channels: tuple[Input, ...], seed: int) -> Readings:
    """Return warm-ups in which sensors, the source and its clock fail; sound readings come in between."""
    rng, k = np.random.default_rng(seed), np.arange(COUNT)
    rows = np.empty((COUNT, len(channels)))
    speed = np.where((k // 250) % 2, 1500.0, 0.0)
    warm = 20.0 + 6.0 * (1.0 - np.cos(k / 180.0))
    for c, channel in enumerate(channels):
        own = warm * (1.0 - 0.1 * (c % 3)) + rng.normal(0.0, 0.03, COUNT)
        rows[:, c] = speed if channel.quantity == "spindle_speed" else own
    for _ in range(24):
        begin, size = int(rng.integers(60, COUNT - 100)), int(rng.choice([1, 1, 3, 20, 80]))
        part, c = slice(begin, begin + size), int(rng.integers(len(channels)))
        _damage(rows, part, c, str(rng.choice(EVENTS)), rng)
    rows[begin := int(rng.integers(100, COUNT - 100))] = rng.choice(WILD, len(channels))
    rows[begin + 1 :: 97] = np.nan
    dt, age = np.full(COUNT, 10.0), np.zeros(COUNT)
    dt[rng.integers(60, COUNT, 40)] = rng.choice([0.0, -5.0, np.nan, np.inf, 70.0, 1e5, 0.001, -1e30], 40)
    age[rng.integers(60, COUNT, 40)] = rng.choice([5.0, 1e4, -20.0, np.nan, np.inf], 40)
    single = rows.astype(np.float32).astype(np.float64)  # the same numbers in both precisions
    return Readings(single, age, dt, np.where(k % 400 > 370, np.floor(k / 40.0) * 40.0, k) + 1.0)


def _damage(rows: FloatArray, part: slice, c: int, event: str, rng: np.random.Generator) -> None:
    if event == "wild":
        rows[part, c] = rng.choice(WILD)
    elif event == "stuck":
        rows[part, c] = rows[part.start, c]
    elif event == "jump":
        rows[part, c] += float(rng.choice([-15.0, 4.0, 30.0]))
    elif event == "missing":
        rows[part] = np.nan
    elif event == "swapped":
        rows[part, [c, (c + 1) % rows.shape[1]]] = rows[part, [(c + 1) % rows.shape[1], c]]
    else:
        rows[part, c] += 0.05 * np.arange(rows[part].shape[0])


def cases() -> Iterator[object]:
    for method, (alone, whole, _) in documented().items():
        if whole != "no":
            for speed in (True, False)[: 1 + (alone != "no")]:
                quick = method in ("ols", "averaged", "arx") and speed
                marks = () if quick else pytest.mark.long
                yield pytest.param(method, speed, id=f"{method}-{'speed' if speed else 'none'}", marks=marks)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Fitted:
    return Fitted(tmp_path_factory.mktemp("fitted"))


@pytest.mark.parametrize(("method", "speed"), [*cases()])
def test_decisions_are_those_of_python_and_nothing_exceeds_a_limit(
    fitted: Fitted, tmp_path: Path, method: str, speed: bool
) -> None:
    compensator = Compensator.of(read_models(fitted.model(method, speed=speed, watched=True)), LIMITS)
    (tmp_path / "double").mkdir()
    (tmp_path / "single").mkdir()
    double = CompiledBlock(compensator, tmp_path / "double")
    readings = hostile(double.tables.channels, seed=len(method))
    wanted = replay(compensator, double.tables, readings)
    assert 0.05 < 1.0 - wanted.passed.mean() < 0.7
    assert {1, 2} <= set(wanted.status.ravel().tolist())
    for block in (double, CompiledBlock(compensator, tmp_path / "single", flags=("-DTC_FLOAT",))):
        said = block.run(readings)
        assert (said.passed == wanted.passed).all()
        assert (said.status == wanted.status).all()
        assert (said.fault == wanted.fault).all()
        assert np.isfinite(said.correction).all()
        assert np.isfinite(said.deviation).all()
        assert np.abs(said.correction).max() <= LIMITS.magnitude
        moved = np.abs(np.diff(said.correction[:, 0], prepend=0.0))
        dt = np.clip(np.nan_to_num(readings.dt, nan=0.0, posinf=LIMITS.reading_age), 0.0, LIMITS.reading_age)
        late = dt + np.where(np.isin(dt, 10.0), 0.0, 10.0)  # a step that a bad clock hides belongs to the next one
        assert (moved <= LIMITS.rate * np.maximum(late, np.roll(late, 1)) * (1.0 + 1e-6) + 1e-5).all()
        assert np.abs(said.correction - wanted.correction).max() < (1e-9 if block is double else 0.05)
