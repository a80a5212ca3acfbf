"""Profiles: Chen's polynomial, two coordinates, splines, borders."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from thermocomp.core.exceptions import InputError
from thermocomp.core.profile import PolynomialProfile, Profile, SplineProfile

FloatArray = NDArray[np.float64]


def chen() -> PolynomialProfile:
    """C-22, Eq. (6): mm for y in mm; 1000 times as much in um."""
    return PolynomialProfile(
        exponents=tuple((0, k, 0) for k in range(6)),
        coefficients=tuple(1e3 * c for c in (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)),
        low=(0.0, 0.0, 0.0),
        high=(0.0, 550.0, 0.0),
    )


def spline() -> tuple[SplineProfile, CubicSpline]:
    """Return a cubic spline of scipy, and its pieces."""
    knots = np.array([0.0, 50.0, 130.0, 300.0, 420.0])
    truth = CubicSpline(knots, [0.0, 3.0, -2.0, 5.0, 4.0])
    widths = np.diff(knots)
    pieces = truth.c[::-1].T * widths[:, None] ** np.arange(4)
    return SplineProfile(axis="Z", knots=tuple(knots.tolist()), pieces=tuple(map(tuple, pieces.tolist()))), truth


def plane() -> PolynomialProfile:
    """C-06: the error along Y sags with X: 2 + 3 u - 4 v^2 + 1.5 u v^2, u = (x - 100) / 50, v = (y - 10) / 200."""
    return PolynomialProfile(
        exponents=((0, 0, 0), (1, 0, 0), (0, 2, 0), (1, 2, 0)),
        coefficients=(2.0, 3.0, -4.0, 1.5),
        centre=(100.0, 10.0, 0.0),
        scale=(50.0, 200.0, 1.0),
        low=(0.0, -300.0, 0.0),
        high=(400.0, 300.0, 0.0),
    )


@pytest.mark.parametrize(("y", "um"), [(0, 0.24), (50, 8.48), (100, 7.74), (250, -2.24), (500, -15.83), (550, -18.53)])
def test_chen_eq_6(y: float, um: float) -> None:
    """C-22."""
    assert float(chen().at(np.array([17.0, y, -3.0]))) == pytest.approx(um, abs=0.005)


def test_two_coordinates() -> None:
    x, y = 220.0, -150.0
    u, v = 2.4, -0.8
    expected = 2 + 3 * u - 4 * v**2 + 1.5 * u * v**2
    assert float(plane().at(np.array([x, y, 999.0]))) == pytest.approx(expected)


def test_three_coordinates() -> None:
    """C-06: alone, and as a product."""
    exponents = ((1, 0, 0), (0, 2, 0), (0, 0, 1), (1, 1, 1))
    profile = replace(
        plane(), exponents=exponents, coefficients=(3.0, -4.0, 5.0, 7.0), centre=(100.0, 10.0, 20.0),
        scale=(50.0, 200.0, 40.0), high=(400.0, 300.0, 500.0),
    )  # fmt: skip
    u, v, w = 2.4, -0.8, 1.5
    said = profile.at(np.array([[220.0, -150.0, 80.0], [220.0, -150.0, 20.0]]))
    assert said == pytest.approx([3 * u - 4 * v**2 + 5 * w + 7 * u * v * w, 3 * u - 4 * v**2])


def test_a_spline_is_that_of_scipy() -> None:
    profile, truth = spline()
    z = np.linspace(0.0, 420.0, 57)
    points = np.column_stack([np.zeros(57), np.ones(57), z])
    assert profile.at(points) == pytest.approx(truth(z), abs=1e-12)


@pytest.mark.parametrize(
    ("profile", "axis", "low", "high"),
    [(chen(), 1, 0.0, 550.0), (plane(), 0, 0.0, 400.0), (plane(), 1, -300.0, 300.0), (spline()[0], 2, 0.0, 420.0)],
)
def test_beyond_the_measured_range_the_border_holds(profile: Profile, axis: int, low: float, high: float) -> None:
    points = np.full((5, 3), 60.0)
    points[:, axis] = [low - 1000.0, low - 1.0, low, high, high + 1000.0]
    values = profile.at(points)
    assert values[0] == values[1] == values[2]
    assert values[3] == values[4]
    assert values[2] != values[3]
    assert [float(profile.at(p)) for p in points] == pytest.approx(values.tolist(), rel=1e-14)


@given(st.sampled_from([chen(), plane(), spline()[0]]), st.integers(0, 2**32))
def test_a_point_alone_says_what_it_says_among_others(profile: Profile, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-500, 700, (2, 3, 3))
    together = profile.at(points)
    assert together.shape == (2, 3)
    alone = [[float(profile.at(p)) for p in row] for row in points]
    assert together == pytest.approx(np.array(alone), rel=1e-12, abs=1e-12)


def test_a_spline_is_right_at_its_knots() -> None:
    profile, truth = spline()
    for z in profile.knots:
        point = np.array([0.0, 0.0, z])
        assert float(profile.at(point)) == pytest.approx(float(truth(z)), abs=1e-12)
        assert float(profile.at(point[None])[0]) == pytest.approx(float(truth(z)), abs=1e-12)


@pytest.mark.parametrize("exponents", [(), ((0, 0, 0),)])
def test_a_constant_has_the_shape_of_the_points(exponents: tuple[tuple[int, int, int], ...]) -> None:
    flat = PolynomialProfile(
        exponents=exponents, coefficients=(3.5,) * len(exponents), low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)
    )
    assert flat.at(np.zeros((4, 2, 3))).tolist() == [[3.5 * len(exponents)] * 2] * 4
    assert flat.at(np.zeros(3)).shape == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": (1.0,)}, "2 terms but 1 coefficients"),
        ({"coefficients": (1.0, np.inf)}, "coefficients must be finite"),
        ({"exponents": ((0, 0, 0), (0, -1, 0))}, "expected three from 0 to 30"),
        ({"exponents": ((0, 0, 0), (0, 1))}, "expected three from 0"),
        ({"scale": (1.0, 0.0, 1.0)}, "scale must be from 1e-06"),
        ({"low": (0.0, 2.0, 0.0)}, "the lower end must not exceed the upper end"),
        ({"high": (0.0, np.nan, 0.0)}, "high must be finite"),
    ],
)
def test_polynomials_that_are_none(change: dict[str, object], message: str) -> None:
    good = {
        "exponents": ((0, 0, 0), (0, 1, 0)),
        "coefficients": (1.0, 2.0),
        "low": (0.0, 0.0, 0.0),
        "high": (1.0, 1.0, 1.0),
    }
    with pytest.raises(InputError, match=message):
        PolynomialProfile(**{**good, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axis": "U"}, "expected X, Y or Z"),
        ({"knots": (0.0, 1.0, 2.0)}, "3 knots for 1 pieces"),
        ({"knots": (0.0,), "pieces": ()}, "1 knots for 0 pieces"),
        ({"knots": (1.0, 1.0)}, "knots must increase, but 1 mm follows 1 mm"),
        ({"knots": (0.0, np.inf)}, "knots must be finite"),
        ({"pieces": ((0.0, np.nan, 0.0, 0.0),)}, "pieces must be finite"),
    ],
)
def test_splines_that_are_none(change: dict[str, object], message: str) -> None:
    good = {"axis": "X", "knots": (0.0, 1.0), "pieces": ((0.0, 1.0, 0.0, 0.0),)}
    with pytest.raises(InputError, match=message):
        SplineProfile(**{**good, **change})  # type: ignore[arg-type]
