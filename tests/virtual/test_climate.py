"""The air round the virtual machines."""

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.climate import CLIMATES, STABLE, STILL, Climate, filter_first_order, wandering

HOUR = 3600.0


def test_what_is_remembered_is_what_a_loop_would_remember() -> None:
    rng = np.random.default_rng(0)
    keep, added, before = np.array([0.0, 0.3, 0.99, 0.9999, 1.0]), rng.normal(size=(3000, 5)), rng.normal(size=5)
    looped, now = np.empty_like(added), before
    for k, value in enumerate(added):
        looped[k] = now = keep * now + value
    np.testing.assert_allclose(filter_first_order(keep, added, before), looped, atol=1e-11)


def test_the_air_wanders_smoothly() -> None:
    rng = np.random.default_rng(2)
    keep = np.exp(-np.array([0.01, 0.05, 0.5]))
    state, path = wandering(Climate().init(rng), keep, rng.standard_normal((400_000, 3)))
    np.testing.assert_allclose(path.mean(axis=0), 0.0, atol=0.1)
    np.testing.assert_allclose(path.std(axis=0), 1.0, atol=0.05)
    # the correlation of a doubled first-order process after t memories is (1 + t) exp(-t)
    for k, step in enumerate((0.01, 0.05, 0.5)):
        rows = round(1.0 / step)
        measured = np.mean(path[rows:, k] * path[:-rows, k]) / np.mean(path[:, k] ** 2)
        assert measured == pytest.approx(2.0 * np.exp(-1.0), abs=0.05)
    assert np.diff(path[:, 0]).std() < 0.012
    np.testing.assert_array_equal(state[1], path[-1])


def test_it_wanders_from_the_first_step() -> None:
    starts = np.array([STABLE.init(np.random.default_rng(s)) for s in range(4000)])
    np.testing.assert_allclose(np.cov(starts[:, 0, 0], starts[:, 1, 0]), [[2.0, 1.0], [1.0, 1.0]], atol=0.12)


def test_the_day_is_warmest_in_the_afternoon() -> None:
    calm = Climate(wander=0.0, draught=0.0, begin=0.0)
    rng = np.random.default_rng(0)
    _, air = calm.air(calm.init(rng), 0.0, 600.0, 144, rng)
    time = 600.0 * np.arange(1, 145)
    assert time[np.argmax(air[:, 0])] == 15 * HOUR
    assert np.ptp(air[:, 0]) == pytest.approx(2 * calm.daily, rel=1e-3)
    assert air[time <= 6 * HOUR, 2].max() == pytest.approx(0.0, abs=1e-12)  # no sun before six
    assert time[np.argmax(air[:, 2])] == 12 * HOUR
    _, late = Climate(wander=0.0, draught=0.0, begin=3 * HOUR).air(calm.init(rng), 0.0, 600.0, 144, rng)
    np.testing.assert_allclose(late[:100, 0], air[18:118, 0])


def test_a_still_room_is_still() -> None:
    rng = np.random.default_rng(0)
    _, air = STILL.air(STILL.init(rng), 0.0, 600.0, 50, rng)
    np.testing.assert_array_equal(air, np.tile([22.0, 0.0, 0.0], (50, 1)))
    spread = []
    for name in ("still", "stable", "workshop"):
        climate = CLIMATES[name]
        spread.append(np.ptp(climate.air(climate.init(rng), 0.0, 600.0, 144, rng)[1][:, 0]))
    assert spread == sorted(spread)


def test_the_weather_goes_on_from_block_to_block() -> None:
    climate = Climate()
    rng = np.random.default_rng(5)
    _, whole = climate.air(climate.init(rng), 0.0, 20.0, 300, rng)
    rng = np.random.default_rng(5)
    state, parts = climate.init(rng), []
    for first in range(0, 300, 70):
        state, air = climate.air(state, 20.0 * first, 20.0, min(70, 300 - first), rng)
        parts.append(air)
    np.testing.assert_allclose(np.vstack(parts), whole, atol=1e-12)


@pytest.mark.parametrize("wrong", [{"memory": 0.0}, {"wander": -1.0}, {"draught": -0.1}])
def test_an_impossible_climate_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="expected"):
        Climate(**wrong)
