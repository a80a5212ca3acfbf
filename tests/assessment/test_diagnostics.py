"""Collinearity."""

import numpy as np
import pytest

from thermocomp.assessment.diagnostics import collinearity

RNG = np.random.default_rng(4)


def test_independent_inputs() -> None:
    found = collinearity(RNG.normal(size=(4000, 3)), ("a", "b", "c"))
    assert found.condition_number == pytest.approx(1.0, abs=0.2)
    assert found.vif == pytest.approx((1, 1, 1), abs=0.05)


def test_vif_equals_its_definition() -> None:
    values = RNG.normal(size=(500, 3))
    values[:, 2] = values[:, 0] - 0.5 * values[:, 1] + 0.3 * RNG.normal(size=500)
    found = collinearity(values, ("a", "b", "c"))
    for k in range(3):
        others = np.column_stack([np.ones(500), np.delete(values, k, axis=1)])
        fitted = others @ np.linalg.lstsq(others, values[:, k], rcond=None)[0]
        r2 = 1 - ((values[:, k] - fitted) ** 2).sum() / ((values[:, k] - values[:, k].mean()) ** 2).sum()
        assert found.vif[k] == pytest.approx(1 / (1 - r2))


def test_a_copied_sensor_and_a_constant_one() -> None:
    a = RNG.normal(size=300)
    found = collinearity(np.column_stack([a, 2 * a + 5, np.full(300, 3.0)]), ("a", "copy", "constant"))
    assert found.names == ("a", "copy")
    assert found.condition_number > 1e12


def test_no_varying_input() -> None:
    assert collinearity(np.ones((10, 2)), ("a", "b")).names == ()
