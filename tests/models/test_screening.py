"""First screening by correlation, on variables whose correlations are known (C-11)."""

import numpy as np
import pytest

from thermocomp.models.selection.collinearity import screen


def orthogonal(n: int = 5, rows: int = 64) -> np.ndarray:
    """Return columns without mean, of length 1, at right angles to each other."""
    rng = np.random.default_rng(0)
    Q, _ = np.linalg.qr(np.column_stack([np.ones(rows), rng.normal(size=(rows, n))]))
    return np.asarray(Q[:, 1:])


def mixed(*weights: tuple[float, ...]) -> np.ndarray:
    """Return columns of length 1 with given weights of the orthogonal ones."""
    W = np.array(weights, dtype=float)
    return np.asarray(orthogonal(W.shape[1]) @ (W / np.linalg.norm(W, axis=1)[:, None]).T)


def test_the_strongest_first_then_what_is_strong_and_new() -> None:
    """r^2 (1 - s^2) by hand: y = a; 0: r .9; 1: like 0, r .8; 2: unlike 0, r .5; 3: unrelated."""
    X = mixed((0.9, np.sqrt(0.19), 0, 0), (0.8, 0.6, 0, 0), (0.5, 0, np.sqrt(0.75), 0), (0, 0, 0, 1))
    found = screen(X, orthogonal(4)[:, [0]], 3)
    np.testing.assert_allclose(found.relevance[:, 0], [0.9, 0.8, 0.5, 0.0], atol=1e-12)
    alike = 0.9 * 0.8 + np.sqrt(0.19) * 0.6
    np.testing.assert_allclose(found.likeness[0], [1, alike, 0.45, 0], atol=1e-12)
    assert 0.64 * (1 - alike**2) < 0.25 * (1 - 0.45**2)
    assert found.kept == (0, 2, 1)  # not the unrelated one
    assert found.strongest == (0, 1, 2, 3)
    assert screen(X, orthogonal(4)[:, [0]], 2).order == (0, 2, 1, 3)
    assert (found.nearest(0), found.nearest(2), found.nearest(1)) == (None, 0, 0)


def test_any_of_several_errors_is_enough() -> None:
    """A negative correlation is as good as a positive one."""
    basis = orthogonal(4)
    X = mixed((1, 0, 0, 0.5), (0, -1, 0, 0.2), (0.5, 0, 1, 0))
    assert screen(X, basis[:, [0, 1]], 2).kept == (1, 0)
    assert screen(X, basis[:, [0]], 2).kept == (0, 2)


def test_copies_and_still_ones_are_not_kept() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(size=(2, 50)).cumsum(axis=1)
    X = np.column_stack([np.full(50, 20.0), first, 30.0 - 2.0 * first, second])
    found = screen(X, np.column_stack([3 * first + second, np.zeros(50)]), 4)
    assert found.kept[0] == 1
    assert sorted(found.kept) == [1, 3]
    assert np.isnan(found.relevance[0]).all()
    assert np.isnan(found.relevance[:, 1]).all()
    assert found.nearest(2) == 1
    assert screen(X, np.zeros((50, 1)), 4).kept == ()


@pytest.mark.parametrize(("like_first", "second"), [(0.55, 1), (0.565, 2)])
def test_squares_decide(like_first: float, second: int) -> None:
    """C-11: r .9, .6 and .5; the last is correlated by .1 with the first: .36 (1 - s^2) against .25 (1 - .01)."""
    rest = np.sqrt(0.19)

    def row(r: float, s: float, own: int) -> tuple[float, ...]:
        along = (s - 0.9 * r) / rest
        weights = [r, along, 0.0, 0.0]
        weights[own] = np.sqrt(1 - r**2 - along**2)
        return tuple(weights)

    X = mixed((0.9, rest, 0, 0), row(0.6, like_first, 2), row(0.5, 0.1, 3))
    found = screen(X, orthogonal(4)[:, [0]], 2)
    np.testing.assert_allclose(found.likeness[0], [1, like_first, 0.1], atol=1e-12)
    assert found.kept == (0, second)
