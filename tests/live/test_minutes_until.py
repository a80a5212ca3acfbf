"""How long a machine still drifts."""

import math

import pytest

from thermocomp.live.settling import minutes_until

MINUTE = 60.0


@pytest.mark.parametrize("tau", [10.0, 45.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_exponential_is_told_to_the_minute(tau: float, sign: float) -> None:
    times = [30.0 * k for k in range(100)]
    curve = [sign * 40.0 * (1 - math.exp(-t / MINUTE / tau)) for t in times]
    left = minutes_until(times, curve, 0.5)
    at = times[-1] / MINUTE + left  # then the ten minutes before have moved it by half a micrometre
    moved = 40.0 * (math.exp(-(at - 10.0) / tau) - math.exp(-at / tau))
    assert left == 0.0 if moved < 0.5 * (1 - 1e-9) else moved == pytest.approx(0.5)


def test_what_is_not_known_is_not_told() -> None:
    assert math.isnan(minutes_until([], [], 1.0))
    assert math.isnan(minutes_until([0.0, 600.0], [0.0, 1.0], 1.0))
    assert math.isinf(minutes_until([0.0, 600.0, 1200.0], [0.0, 3.0, 8.0], 1.0))
    assert minutes_until([0.0, 600.0, 1200.0], [0.0, 3.0, 3.5], 1.0) == 0.0
    with pytest.raises(ValueError, match="below"):
        minutes_until([0.0], [0.0], 0.0)
