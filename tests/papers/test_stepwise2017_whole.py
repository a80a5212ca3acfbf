"""The study of stepwise2017: what is chosen from, by which thresholds, and which method stands under which name."""

import numpy as np
import pytest

from thermocomp.papers.common import predict_deviation, trained
from thermocomp.papers.stepwise2017 import setup
from thermocomp.papers.stepwise2017.setup import LEAST, PURSUIT, STEPWISE, Computed
from thermocomp.papers.study import tell_nobody


@pytest.fixture(scope="module")
def computed() -> Computed:
    with pytest.MonkeyPatch.context() as patch:
        methods = {name: setup.METHODS[name] for name in (STEPWISE, LEAST, PURSUIT)} | {setup.AVERAGED: "ols"}
        patch.setattr(setup, "METHODS", methods)
        patch.setattr(setup, "THINNED", (1,))
        return setup.compute(0, tell_nobody)


def test_all_24_are_candidates_by_100_and_50(computed: Computed) -> None:
    """T-01, T-03: F_E is 100 and F_D is 50, and the choice is from all temperatures of the test."""
    selection = computed.selection
    assert (selection.f_enter, selection.f_delete) == (100.0, 50.0)
    assert [*selection.feature_names_in_] == [c.name for c in computed.fit.inputs if c.quantity == "temperature"]
    assert selection.n_features_in_ == 24
    assert selection.log_text().startswith("STEPWISE REGRESSION WITH F-TO-ENTER= 100 AND F-TO-DELETE= 50\n")


def test_least_squares_has_all_and_pursuit_is_projection_pursuit(computed: Computed) -> None:
    """T-08: compared are least squares of all 24 temperatures and projection pursuit, each under its name."""
    heat = [c.name for c in computed.fit.inputs if c.quantity == "temperature"]
    fit, online = (s.only(heat) for s in (computed.fit, computed.online))
    X = np.column_stack([np.ones(len(fit)), fit.change()])
    weights = np.linalg.lstsq(X, fit.deviations[:, 0], rcond=None)[0]
    assert {*computed.models[LEAST].sensors} == {*heat}
    by_hand = np.column_stack([np.ones(len(online)), online.change()]) @ weights
    np.testing.assert_allclose(predict_deviation(computed.models[LEAST], online), by_hand, atol=1e-4)
    pursuit = trained("ppr", computed.fit)
    expected = computed.online.deviations[:, 0] - predict_deviation(pursuit, computed.online)
    np.testing.assert_allclose(computed.left[PURSUIT], expected, atol=1e-9)
