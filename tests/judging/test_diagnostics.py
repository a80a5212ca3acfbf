"""Collinearity."""

import numpy as np
import pytest

from thermocomp.judging.diagnostics import collinearity, diagnose
from thermocomp.models.selection.collinearity import Spectrum

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


def test_figures_of_the_paper() -> None:
    # H-16: what follows from the eigenvalues printed in Hwang's Table 3
    grouped = Spectrum((1.1e4, 155.8, 18.6, 3.3))
    free = Spectrum((8861.812, 76.397, 19.835, 2.359, 1.129, 0.114, 0.019))
    assert grouped.sum_inverse == pytest.approx(0.363, abs=5e-4)
    assert grouped.condition_number == pytest.approx(3.3e3, rel=0.02)
    assert free.sum_inverse == pytest.approx(62.8, abs=0.05)
    assert free.condition_number == pytest.approx(4.7e5, rel=0.01)
    assert free.sum_inverse / grouped.sum_inverse == pytest.approx(173, abs=0.5)
    assert (grouped.smallest, free.smallest) == (3.3, 0.019)


def test_diagnosis() -> None:
    # H-14 to H-17, E-H6: eigenvalues of X'X as it is, p of them
    a, b, noise = RNG.normal(size=(3, 200))
    values = np.column_stack([a + 5, 3 * a + b, b, np.full(200, 2.0)])
    deviation = 4 * a - b + noise
    found = diagnose(values, deviation, ("t1", "t2", "t3", "t4"))
    assert found.names == ("t1", "t2", "t3", "t4")
    np.testing.assert_allclose(found.spectrum.eigenvalues[:3], np.linalg.eigvalsh(values.T @ values)[:0:-1], rtol=1e-9)
    assert found.contributions[:3] == pytest.approx(np.corrcoef(values[:, :3].T, deviation)[-1, :3])
    assert np.isnan([found.vif[3], found.contributions[3]]).all()
    assert min(found.vif[:3]) > 1e6  # each of the three is determined by the others
    # the variances of the coefficients without a constant add up to sigma^2 times the sum of the inverses (Eq. 7)
    two = diagnose(values[:, [0, 2]], deviation, ("t1", "t3"))
    draws = RNG.normal(size=(200, 20_000))
    coefficients = np.linalg.lstsq(values[:, [0, 2]], draws)[0]
    assert coefficients.var(axis=1).sum() == pytest.approx(two.spectrum.sum_inverse, rel=0.05)
    assert two.vif == pytest.approx((1.0, 1.0), abs=0.1)
    assert (two.spectrum.smallest, two.spectrum.condition_number) == pytest.approx(
        (two.spectrum.eigenvalues[1], two.spectrum.eigenvalues[0] / two.spectrum.eigenvalues[1])
    )
