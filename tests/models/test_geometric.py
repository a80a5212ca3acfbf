"""The order of a cold profile with few stations (ISO 230-2 asks for five), and what repeated values tell of it."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from profilemachine import along_y

from thermocomp.core.profile import SplineProfile
from thermocomp.virtual.geometry import PROFILES, cold_profile
from thermocomp.volumetric.models.geometric import _choose, fit_profile

FloatArray = NDArray[np.float64]

DENSE = np.linspace(0.0, 550.0, 221)
SHAPES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "Chen": cold_profile,
    "EXX": lambda p: PROFILES["EXX"](p, 275.0),
    "EYX": lambda p: PROFILES["EYX"](p, 275.0),
    "EZZ": lambda p: PROFILES["EZZ"](p, 275.0),
}


def between(shape: Callable[[FloatArray], FloatArray], n: int, noise: float, draws: int = 40) -> tuple[float, float]:
    """Return the RMS error between stations of the automatic profile, and of straight lines from station to station."""
    position = np.linspace(0.0, 550.0, n)
    truth = shape(DENSE)
    found = []
    for draw in range(draws):
        values = shape(position) + noise * np.random.default_rng(draw).normal(size=n)
        profile = fit_profile(along_y(position), values, "Y").profile
        lines = np.interp(DENSE, position, values)
        found.append([np.sqrt(np.mean((v - truth) ** 2)) for v in (profile.at(along_y(DENSE)), lines)])
    ours, straight = np.mean(found, axis=0)
    return float(ours), float(straight)


@pytest.mark.parametrize("noise", [0.05, 0.3, 0.5])
@pytest.mark.parametrize("n", [5, 6, 7, 8, 10, 12])
@pytest.mark.parametrize("shape", SHAPES)
def test_no_worse_than_straight_lines_from_station_to_station(shape: str, n: int, noise: float) -> None:
    """Chen's profile at 6 to 8 stations: the best of orders 0 to 4 leaves twice as much as straight lines do.

    With 5 stations, three of them between the ends, a draw in twenty looks like a constant.
    """
    ours, straight = between(SHAPES[shape], n, noise)
    assert ours < (1.25 if n > 5 else 1.6) * straight
    if shape == "Chen" and n >= 7:
        assert ours < 0.85 * straight


def test_few_stations_and_only_noise_are_mostly_a_constant() -> None:
    for n in (5, 6, 7, 8):
        position = np.linspace(0.0, 550.0, n)
        orders = [
            fit_profile(along_y(position), np.random.default_rng(draw).normal(size=n), "Y").order for draw in range(100)
        ]
        assert orders.count((0, 0)) >= 50


@pytest.mark.parametrize("n", [5, 6, 7])
def test_repeated_values_tell_the_shape_from_noise(n: int) -> None:
    """Three values per station, noise 0.3: no polynomial leaves so little, so the spline through the means is taken."""
    position = np.repeat(np.linspace(0.0, 550.0, n), 3)
    for draw in range(20):
        rng = np.random.default_rng(draw)
        found = fit_profile(along_y(position), cold_profile(position) + 0.3 * rng.normal(size=len(position)), "Y")
        assert found.through
        assert isinstance(found.profile, SplineProfile)
        assert not found.leaves_more
        assert 0.05 < found.noise < 0.8
        assert all(t.misfit < 0.01 for t in found.tried if not t.through)
    orders = [
        fit_profile(along_y(position), np.random.default_rng(draw).normal(size=len(position)), "Y").order
        for draw in range(50)
    ]
    assert orders.count((0, 0)) >= 35


def test_a_fit_says_that_it_leaves_more_than_the_noise() -> None:
    position = np.repeat(np.linspace(0.0, 550.0, 12), 2)
    values = cold_profile(position) + 0.1 * np.random.default_rng(0).normal(size=24)
    line, fifth = (fit_profile(along_y(position), values, "Y", order=k) for k in (1, 5))
    assert line.leaves_more
    assert line.noise == fifth.noise == pytest.approx(0.1, rel=0.4)
    assert line.words == (
        f"leaves a residual of {line.rms:.3g}, but repeated values differ only by {line.noise:.3g}: it misses part of "
        "the shape"
    )
    assert fifth.words == ""
    assert 0.01 < fifth.misfit <= 1.0


def test_the_test_for_lack_of_fit_errs_as_often_as_it_says() -> None:
    position = np.repeat(np.linspace(0.0, 550.0, 8), 3)
    found = []
    for draw in range(400):
        values = 0.01 * position + np.random.default_rng(draw).normal(size=24)
        found.append(fit_profile(along_y(position), values, "Y", order=1).misfit)
    assert np.mean(np.array(found) < 0.1) == pytest.approx(0.1, abs=0.04)
    assert np.mean(np.array(found) < 0.5) == pytest.approx(0.5, abs=0.08)


def test_copies_are_no_repeated_values() -> None:
    """The same cold rounds before each of several tests say nothing of the noise."""
    position = np.linspace(0.0, 550.0, 12)
    values = cold_profile(position) + 0.05 * np.random.default_rng(0).normal(size=12)
    found = fit_profile(along_y(np.tile(position, 3)), np.tile(values, 3), "Y")
    assert np.isnan(found.noise)
    assert np.isnan(found.misfit)
    assert found.words == ""
    assert found.order == (5, 0)


def test_the_spline_goes_through_the_means_and_its_left_out_errors_are_those_of_fitting_anew() -> None:
    position = np.linspace(0.0, 550.0, 7)
    values = cold_profile(position)
    found = fit_profile(along_y(position), values, "Y")
    assert found.through
    assert found.order == (5, 0)
    np.testing.assert_allclose(found.profile.at(along_y(position)), values, atol=1e-9)
    # no curvature at the ends
    step = np.array([0.0, 1.0, 2.0])
    for ends in (step, 550.0 - step):
        assert abs(np.diff(found.profile.at(along_y(ends)), 2)[0]) < 0.05 * np.abs(np.diff(values, 2)).max() / 92**2 * 9
    (tried,) = (t for t in found.tried if t.through)
    squares = []
    for k in range(1, 6):
        kept = np.delete(np.arange(7), k)
        told = _natural(position[kept], values[kept], position[k])
        squares.append((told - values[k]) ** 2)
    assert tried.left_out == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-6)


def _natural(x: FloatArray, y: FloatArray, at: float) -> float:
    """Return a natural cubic spline at a place, by its minimal bending: cubic radial terms and a line."""
    n = len(x)
    system = np.zeros((n + 2, n + 2))
    system[:n, :n] = np.abs(x[:, None] - x) ** 3
    system[:n, n:] = np.stack([np.ones(n), x], axis=1)
    system[n:, :n] = system[:n, n:].T
    weights = np.linalg.solve(system, [*y, 0.0, 0.0])
    return float(np.abs(at - x) ** 3 @ weights[:n] + weights[n] + weights[n + 1] * at)


def test_four_stations_by_a_spline_of_its_own_kind() -> None:
    """Knots want six positions; the spline through the means is told from four on."""
    position = np.linspace(0.0, 550.0, 5)
    found = fit_profile(along_y(position), cold_profile(position), "Y", kind="spline")
    assert found.through
    assert [t.through for t in found.tried] == [True]


def test_no_spline_where_the_profile_varies_with_other_axes() -> None:
    x, y = np.meshgrid([0.0, 600.0], np.linspace(0.0, 550.0, 6))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    found = fit_profile(points, cold_profile(points[:, 1]) + 0.01 * points[:, 0], "Y")
    assert not any(t.through for t in found.tried)
    alone = fit_profile(points, cold_profile(points[:, 1]) + 0.01 * points[:, 0], "Y", coordinates="Y")
    assert any(t.through for t in alone.tried)


def tried(left_out: float, n_terms: int = 1, **more: Any) -> Any:
    """Return what was found with a candidate."""
    return SimpleNamespace(
        **{"left_out": left_out, "n_terms": n_terms, "margin": 0.0, "misfit": np.nan, "through": False} | more
    )


def test_the_lowest_order_within_the_margin_of_the_best() -> None:
    """C-06: squares are compared; what is exactly within, is within."""
    best = tried(0.5, 3, margin=0.75)
    for first, chosen in ((1.0, 0), (1.001, 1), (np.nan, 1)):
        candidates = [tried(first), best, tried(0.6, 4)]
        assert _choose(candidates, 12) is candidates[chosen]
    # an order that leaves more than the noise is not chosen if there is another one, whatever its error
    for misfit, chosen in ((0.0099, 1), (0.01, 0)):
        candidates = [tried(0.1, misfit=misfit), tried(5.0, 2, misfit=0.5)]
        assert _choose(candidates, 12) is candidates[chosen]
    for left_out, chosen in ((9.0, 1), (np.inf, 0)):
        candidates = [tried(0.1, misfit=0.001), tried(left_out, 12, through=True)]
        assert _choose(candidates, 12) is candidates[chosen]


@pytest.mark.parametrize(
    ("n_own", "n_terms", "misfit", "share"),
    [(12, 1, np.nan, 0.5), (9, 2, np.nan, 0.5), (8, 2, np.nan, 1.25), (8, 1, np.nan, 1.0), (8, 2, 0.5, 0.5)],
)
def test_a_spline_must_be_better_by_a_share(n_own: int, n_terms: int, misfit: float, share: float) -> None:
    """C-06: by half of the mean square; with up to eight positions, where nothing tells the noise, it may be worse."""
    order = tried(2.0, n_terms, misfit=misfit)
    for square, chosen in ((0.999 * share, "spline"), (1.001 * share, "order")):
        spline = tried(2.0 * float(np.sqrt(square)), 12, through=True)
        assert _choose([order, spline], n_own) is {"spline": spline, "order": order}[chosen]
