"""A temperature that is computed from the displacement is named, and no other one."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thermocomp as tc
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording


@cache
def demo() -> Recording:
    (recording,) = tc.simulate("demo")
    return recording


def named(recording: Recording) -> list[str]:
    return [f.channel for f in check(recording) if f.kind == "leak"]


def leaking(how: str, recording: Recording, target: str) -> Recording:
    """Return a recording whose second temperature is computed from a displacement."""
    rng, y = np.random.default_rng(1), recording.table[target]
    first, second = (c.name for c in recording.temperatures[:2])
    made = 22.0 + 0.2 * y
    found = {
        "exact": made,
        "noisy": made + rng.normal(0.0, 0.05, len(y)),
        "rounded": made.round(1),
        "smoothed": made.rolling(3, center=True, min_periods=1).mean(),
        "mixed": 0.5 * made + 0.5 * recording.table[first],
        "negative": 30.0 - 0.05 * y,
        "curved": 22.0 + 0.05 * y + 0.0005 * y**2,
        "one row late": made.shift(1).bfill().round(2),
        "ten rows late": made.shift(10).bfill().round(2),
        "first-order lag of 60 s": made.ewm(alpha=-np.expm1(-recording.sampling_interval / 60.0)).mean(),
        "mean of five rows": made.rolling(5, min_periods=1).mean(),
        "mean of nine rows, late": made.shift(4).bfill().rolling(9, min_periods=1).mean(),
    }[how]
    return replace(recording, table=recording.table.assign(**{second: found}))


HOWS = ["exact", "noisy", "rounded", "smoothed", "mixed", "negative", "curved"]
HOWS += ["one row late", "ten rows late", "first-order lag of 60 s", "mean of five rows", "mean of nine rows, late"]


@pytest.mark.parametrize("how", HOWS)
def test_a_computed_temperature_is_named(how: str) -> None:
    assert named(leaking(how, demo(), "z_um")) == [demo().temperatures[1].name]


@pytest.mark.parametrize("how", HOWS)
def test_a_computed_temperature_is_named_on_a_real_machine(how: str, shared_data: Path) -> None:
    real = recordings.read(shared_data / "fl_thermal" / "recording.csv")
    assert not named(real)
    assert named(leaking(how, real, "ch3_um")) == [real.temperatures[1].name]


@pytest.mark.parametrize("experiment", ["demo", "hwang", "chen1996", "stepwise2017", "wessel-sets"])
def test_no_honest_temperature_is_named(experiment: str) -> None:
    for recording in tc.simulate(experiment, seed=21):
        assert not named(recording)


def test_a_displacement_that_is_computed_from_temperatures_is_no_leak() -> None:
    table = demo().table.copy()
    first, second = (c.name for c in demo().temperatures[:2])
    table["z_um"] = 2.0 * (table[first] - 20.0) + 3.0 * (table[second] - 20.0)
    assert not named(replace(demo(), table=table))


def test_two_temperatures_computed_from_one_displacement_are_named() -> None:
    table = demo().table.copy()
    first, second = (c.name for c in demo().temperatures[:2])
    table[first], table[second] = 22.0 + 0.2 * table["z_um"], 25.0 - 0.1 * table["z_um"]
    assert sorted(named(replace(demo(), table=table))) == sorted([first, second])


def test_interference_on_all_wires_is_a_warning() -> None:
    table, hum = demo().table.copy(), np.random.default_rng(3).normal(size=len(demo()))
    for channel in demo().temperatures:
        table[channel.name] += 0.2 * hum
    table["z_um"] += 2.0 * hum
    hummed = replace(demo(), table=table)
    assert not named(hummed)
    assert [f.severity for f in check(hummed) if f.kind == "interference"] == ["warning"]


@pytest.mark.parametrize("seed", range(3))
def test_a_chiller_that_reaches_two_places_with_different_lags_is_no_leak(seed: int) -> None:
    rng, state = np.random.default_rng(seed), 1.0
    on = list[float]()
    while len(on) < 20 * len(demo()):  # one value a second, switched every two to four minutes
        on += [state] * int(rng.integers(120, 240))
        state = -state
    seconds = pd.Series(on[: 20 * len(demo())])
    near, far = (seconds.ewm(halflife=lag).mean().to_numpy()[::20] for lag in (15.0, 45.0))
    table, name = demo().table.copy(), demo().temperatures[13].name
    table[name] += 0.5 * near
    table["z_um"] += 2.0 * far
    assert not named(replace(demo(), table=table))


def test_curves_without_noise_are_not_examined() -> None:
    time = np.arange(0.0, 36000.0, 60.0)
    rise = -np.expm1(-time / 3000.0)
    table = pd.DataFrame({"time_s": time, "t_a_C": 20.0 + 5.0 * rise, "z_um": 40.0 * rise})
    assert not named(Recording.from_dataframe(table))


def test_it_caps_the_verdict_of_models_that_use_it() -> None:
    bad = leaking("exact", demo(), "z_um")
    name = bad.temperatures[1].name
    others = [c.name for c in bad.temperatures if c.name != name]
    found = tc.compare(bad, "z_um", ["ols"], inputs=[name, *others[:3], "spindle_rpm"], robustness=False, jobs=1)
    (a,) = found.comparison.overall()
    assert a.word != "accepted"
    assert f"data-quality problem in {name} (leak)" in a.reason or a.word == "refused"
    assert any("has the noise of z_um" in text for text in found.trouble)
