"""Metrics know their unit and which way is good."""

import numpy as np
import pytest

from thermocomp.judging.metrics import METRICS, bias, mae, max_abs, peak_to_peak, reduction, rms

MEASURED, PREDICTED = np.array([3.0, -4.0, 0.0, 5.0]), np.array([2.0, -4.0, 2.0, 5.0])


def test_values_by_hand() -> None:
    assert mae(MEASURED, PREDICTED) == pytest.approx(0.75)
    assert rms(MEASURED, PREDICTED) == pytest.approx(np.sqrt(5 / 4))
    assert max_abs(MEASURED, PREDICTED) == 2.0
    assert peak_to_peak(MEASURED, PREDICTED) == 3.0
    assert bias(MEASURED, PREDICTED) == pytest.approx(-0.25)
    assert reduction(MEASURED, PREDICTED) == pytest.approx(100 * (1 - np.sqrt(5 / 50)))


def test_harm_is_a_negative_reduction() -> None:
    assert reduction(MEASURED, -MEASURED) == pytest.approx(-100.0)


def test_direction_and_unit() -> None:
    assert rms.better(1.0, 2.0)
    assert reduction.better(90.0, 20.0)
    assert bias.better(0.1, -3.0)
    assert {m.unit for m in METRICS.values()} == {"um", "%"}
    assert all(m.description for m in METRICS.values())
