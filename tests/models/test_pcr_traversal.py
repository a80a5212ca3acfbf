"""Principal components of every small set of temperatures: the set that predicts unseen cycles best."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from thermocomp.core.exceptions import InputError
from thermocomp.models import pcr_traversal
from thermocomp.models.pcr_traversal import TraversedComponents
from thermocomp.papers import cross

FloatArray = NDArray[np.float64]


def cycles(seed: int, n: int = 80, n_features: int = 7) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Collinear temperatures of two sources with noise, a drift of the readings of No. 1 and 4, and four cycles."""
    rng = np.random.default_rng(seed)
    cycle = np.repeat(np.arange(4), n)
    sources = np.repeat(rng.uniform(5, 15, (4, 2)), n, axis=0)
    sources *= 1 - np.exp(-np.tile(np.linspace(0, 3, n), 4)[:, None] / np.array([0.4, 1.5]))
    X = sources @ rng.uniform(0.2, 1, (2, n_features)) + 0.3 * rng.normal(size=(4 * n, n_features))
    return X, 3 * X[:, 1] - 2 * X[:, 4] + 0.1 * rng.normal(size=len(X)), cycle


def test_it_finds_planted_temperatures() -> None:
    """T-10: two of seven collinear temperatures, whichever they are."""
    X, y, cycle = cycles(0)
    model = TraversedComponents().fit(X, y, cycle=cycle)
    assert model.selected_ == ("x1", "x4")
    assert model.coef_[[1, 4]] == pytest.approx([3, -2], abs=0.05)
    assert model.freeze(target="x_um").sensors == ("x1", "x4")
    moved = TraversedComponents().fit(X[:, ::-1], y, cycle=cycle)
    assert moved.selected_ == ("x2", "x5")


@pytest.mark.parametrize("rule", ["minimum", "one-standard-error"])
@pytest.mark.parametrize(
    ("of", "size", "components"),
    [((3.0, 0.0, 0.0, -2.0, 0.5), 2, 2), ((0, 3.0, 0, 0, 0), 1, 1), ((1.3, 1, 1, 0.7, 1), 3, 1)],
)
def test_as_by_plain_refits_of_every_set(rule: str, of: Sequence[float], size: int, components: int) -> None:
    """T-10: the same set, number of components and prediction as with scikit-learn, refitted without each cycle."""
    X, _, cycle = cycles(1, n=30, n_features=5)
    y = X @ np.array(of) + np.random.default_rng(2).normal(size=len(X))
    best: list[tuple[tuple[int, ...], list[FloatArray]]] = []
    for n in (1, 2, 3):
        of_this_size = []
        for points in combinations(range(5), n):
            errors = []
            for k in range(1, n + 1):
                plain = make_pipeline(StandardScaler(), PCA(k), LinearRegression())
                left = [
                    y[cycle == c] - plain.fit(X[cycle != c][:, points], y[cycle != c]).predict(X[cycle == c][:, points])
                    for c in range(4)
                ]
                errors.append(np.array([np.sqrt(np.mean(e**2)) for e in left]))
            of_this_size.append((points, errors))
        best.append(min(of_this_size, key=lambda found: min(e.mean() for e in found[1])))

    def chosen(errors: list[FloatArray]) -> int:
        least = min(errors, key=np.mean)
        limit = least.mean() + (least.std(ddof=1) / 2 if rule == "one-standard-error" else 0.0)
        return next(k for k, e in enumerate(errors) if e.mean() <= limit)

    points, errors = best[chosen([min(errors, key=np.mean) for _, errors in best])]
    k = chosen(errors)
    if rule == "one-standard-error":
        assert (len(points), k + 1) == (size, components)
    model = TraversedComponents(rule=rule, max_points=3).fit(X, y, cycle=cycle)  # type: ignore[arg-type]
    assert (model.selected_, model.n_components_) == (tuple(f"x{p}" for p in points), k + 1)
    assert model.cv_rms_ == pytest.approx(errors[k].mean(), rel=1e-9)
    plain = make_pipeline(StandardScaler(), PCA(k + 1), LinearRegression()).fit(X[:, points], y)
    np.testing.assert_allclose(model.predict(X), plain.predict(X[:, points]), rtol=0, atol=1e-8)


def test_sets_are_not_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    X, y, cycle = cycles(0)
    y = X[:, 0] + X[:, 2] + X[:, 3] + X[:, 5]
    assert len(TraversedComponents(rule="minimum").fit(X, y, cycle=cycle).selected_) == 4
    monkeypatch.setattr(pcr_traversal, "MOST_SETS", 7 + 21)
    assert len(TraversedComponents(rule="minimum").fit(X, y, cycle=cycle).selected_) == 2
    with pytest.raises(InputError, match="max_points 0"):
        TraversedComponents(max_points=0).fit(X, y)


def test_cross_knows_the_methods_of_the_cited_papers() -> None:
    """T-10: an experiment of the virtual machine, judged on another day."""
    task = cross.simulate_task(cross.CrossExperiment("stepwise2017", "x1_um", then="stepwise2017-online"), seed=0)
    none, traversed, sliced = cross.judge(task, ["pcr-traversal", "sir"])
    assert not traversed.failure
    assert not sliced.failure
    assert traversed.rms < none.rms / 8
    assert sliced.rms < none.rms / 8
    assert traversed.sensors == 4
    assert sliced.sensors == 24
