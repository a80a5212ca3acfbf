"""Whatever sensors and clocks say: no exception, no nan, no move on a rejected reading, never faster than the rate."""

import math
import random
from decimal import Decimal

import pytest
from test_fleet import model
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.reading import Reading
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import resume

LIMITS = Limits(magnitude=40.0, rate=0.2, hold=600.0, fade=900.0)
ODD: tuple[object, ...] = (
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, -0.0, 1e9, -273.15, 85.0, 4095, 65535, 10**400, 2**63),
    *(None, True, False, "21.5", "", b"21", [21.0], {}, (), 1j, Decimal("21.3"), object()),
)
CLOCKS: tuple[object, ...] = (
    math.nan,
    math.inf,
    -math.inf,
    -1e300,
    1e300,
    0.0,
    -1.0,
    10**400,
    None,
    "now",
    1.7e9,
    4.1e9,
)


def good(rng: random.Random, names: list[str], level: float) -> dict[object, object]:
    """Return a sound reading."""
    return {name: 1500.0 if name.endswith("rpm") else level + rng.gauss(0.0, 0.05) for name in names}


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("linear", 120_000),
        ("watched", 20_000),
        pytest.param("linear", 10_000_000, marks=pytest.mark.long),
        pytest.param("watched", 1_000_000, marks=pytest.mark.long),
    ],
)
def test_nothing_gets_through(kind: str, values: int) -> None:
    rng, own = random.Random(values), Compensator.of([model() if kind == "linear" else watched_model()], LIMITS)
    names = [i.name for i in own.models[0].inputs]
    state, tick, now = own.start(), 1000.0, 1.7e9
    before, taken, rejected = 0.0, 0, 0
    for k in range(values // len(names)):
        step = rng.choice((0.0, 0.01, 1.0, 10.0, 10.0, 10.0, 70.0))
        earlier, tick, now = tick, tick + step, now + step
        passed = min(tick - earlier, LIMITS.reading_age)  # what is left of a step in the digits of the clock
        level = 20.0 + 8.0 * math.sin(tick / 5000.0)
        table: dict[object, object] = good(rng, names, level)
        if odd := rng.random() < 0.4:
            for _ in range(rng.choice((1, 1, 2, len(names)))):
                table[rng.choice(names)] = rng.choice(ODD)
            if rng.random() < 0.1:
                table[rng.choice((7, None, "", "t999_C"))] = rng.choice(ODD)
            if rng.random() < 0.1:
                table.pop(rng.choice(names), None)
        stamp: object = rng.choice(CLOCKS) if rng.random() < 0.05 else now - rng.choice((0.0, 0.0, 0.5, 100.0))
        clock: object = rng.choice(CLOCKS) if rng.random() < 0.02 else now + rng.choice((0.0,) * 8 + (3600.0, -3600.0))
        probings = {"z_um": Probing(rng.choice((math.nan, math.inf, 1e9, 3.0)))} if rng.random() < 0.01 else None
        given: object = table if rng.random() < 0.98 else rng.choice((None, [], "t", 7))
        reading = Reading(stamp, given)  # type: ignore[arg-type]
        state, said = own.step(state, reading, clock, probings, tick)  # type: ignore[arg-type]
        after = said.corrections["z_um"].offset
        assert math.isfinite(after)
        assert abs(after) <= LIMITS.magnitude
        assert abs(after - before) <= LIMITS.rate * passed * (1 + 1e-12) + 1e-12, (k, step)
        if said.rejected:
            rejected += 1
            assert abs(after) <= abs(before)
            assert said.states["z_um"].word in ("holding", "fading")
            if said.states["z_um"].word == "holding":
                assert after == before
        else:
            taken += 1
        before = after
        if odd and rng.random() < 0.002:
            age = rng.choice((0.0, 5.0, 4000.0, 1e6, -5.0, math.nan))
            state = resume(state, own.start(), age)
            tick = rng.uniform(0.0, 1e5)  # the monotone clock of another process
            assert state.corrections["z_um"].offset == before
            state, _ = own.wait(state, tick, "started")
    assert min(taken, rejected) > 0.1 * (values // len(names))
    for _ in range(720):  # two hours of sound readings: nothing of it stays
        tick, now = tick + 10.0, now + 10.0
        state, said = own.step(state, Reading(now, good(rng, names, 24.0)), now, None, tick)  # type: ignore[arg-type]
    assert not said.rejected
    assert math.isfinite(said.deviations["z_um"].offset)
