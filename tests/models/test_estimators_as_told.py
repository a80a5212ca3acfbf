"""The estimators, not only the functions below them."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest

from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.numerics.backprop import learning_rates, train_net
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.selection.collinearity import correlation
from thermocomp.models.selection.grouping import group


def test_the_curve_names_features_also_where_one_is_left_out() -> None:
    """H-05: the best representatives are given as features of X, of which the first is constant here."""
    rng = np.random.default_rng(3)
    X = np.column_stack([np.full(60, 20.0), rng.normal(size=(60, 3))])
    found = CorrelationGrouping(threshold=0.99).fit(X, 5 * X[:, 3] + 0.5 * X[:, 1] + 0.1 * rng.normal(size=60))
    assert found.left_out_ == (0,)
    assert [s.columns[:2] for s in found.curve_[:2]] == [(3,), (3, 1)]
    assert found.curve_[1].mse < found.curve_[0].mse
    assert {*found.curve_[-1].columns} == {*found.representatives_}


@pytest.mark.parametrize("update", ["pattern", "batch", None])
def test_the_estimator_updates_as_it_is_told(update: Literal["pattern", "batch"] | None) -> None:
    """C-30: after every pattern, which is the default, or once per epoch."""
    rng = np.random.default_rng(0)
    X, y = rng.uniform(0, 10, (40, 3)), rng.uniform(-20, 20, (40, 1))
    net = SigmoidNet(hidden=4, n_epochs=6)
    fitted = (net if update is None else net.set_params(update=update)).fit(X, y)
    trained = train_net(
        0.1 + 0.8 * (X - X.min(axis=0)) / np.ptp(X, axis=0),
        0.1 + 0.8 * (y - y.min()) / np.ptp(y),
        4,
        rng=np.random.default_rng(0),
        rates=learning_rates(6, 0.5, 0.01, "geometric"),
        update=update or "pattern",
    )
    np.testing.assert_allclose(fitted.net_.hidden_weights, trained.net.hidden_weights, atol=1e-9)
    np.testing.assert_allclose(fitted.loss_history_, trained.losses, rtol=1e-9)
    assert (fitted.net_.hidden, fitted.net_.output) == ("sigmoid", "sigmoid")  # C-25


def test_the_estimators_delete_by_their_own_thresholds(shared_data: Path) -> None:
    """C-17, T-03: of Hald's cement x4 enters first, and its partial F falls to 1.86, a significance of .205."""
    data = pd.read_csv(shared_data / "reference" / "hald_cement.csv")
    X, y = data.filter(like="x"), data["y"]
    for delete, last in ((1.8, "enter"), (1.9, "remove")):
        found = PartialF(f_enter=4.0, f_delete=delete).fit(X, y)
        assert [s.term for s in found.log_[:3]] == ["x4", "x1", "x2"]
        assert (found.log_[-1].action, "x4" in found.terms_) == (last, last == "enter")
    for remove, last in ((0.22, "enter"), (0.19, "remove")):
        settings: dict[str, Any] = {
            "alpha_enter": 0.15,
            "alpha_remove": remove,
            "fit_intercept": True,
            "second_order": False,
        }
        chosen = SecondOrderRegression(**settings).fit(X, y)
        assert [s.term for s in chosen.log_[:3]] == ["x4", "x1", "x2"]
        assert (chosen.log_[-1].action, "x4" in chosen.terms_) == (last, last == "enter")


def test_a_square_is_a_square_also_of_a_falling_temperature() -> None:
    """C-09: the terms that are fitted are those that are named."""
    X = np.random.default_rng(5).uniform(-6, 6, (200, 2))
    fitted = SecondOrderRegression().fit(X, 2 * X[:, 0] ** 2 - X[:, 1] + 0.5 * X[:, 0] * X[:, 1])
    assert fitted.terms_ == ("x1", "x0*x0", "x0*x1")
    np.testing.assert_allclose(fitted.coef_, [-1.0, 2.0, 0.5], rtol=1e-9)
    assert float(fitted.predict(np.zeros((1, 2)))[0]) == 0.0


@pytest.mark.parametrize("threshold", [-1.0, 0.3, 0.6, 0.95])
@pytest.mark.parametrize("absolute", [False, True])
def test_the_estimator_groups_by_its_own_threshold(threshold: float, absolute: bool) -> None:
    """H-01, E-H1, E-H2: the groups, and a model with one member of each that participates."""
    rng = np.random.default_rng(2)
    own = rng.normal(size=(80, 8))
    X = own + np.repeat(rng.normal(size=(80, 2)), 4, axis=1) * [1, 1, 2, -2, 1, -1, 3, 3]
    found = CorrelationGrouping(threshold=threshold, absolute=absolute).fit(X, X[:, 2] - X[:, 7] + own[:, 0])
    assert found.groups_ == group(correlation(X), threshold, absolute=absolute)
    assert all(len({*found.selected_} & {*found.groups_[k]}) == 1 for k in found.participating_)
    assert len(found.selected_) == len(found.participating_)
