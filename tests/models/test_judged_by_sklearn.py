"""For every method one call of `cross_val_score` gives the error of thermocomp's own judging, gate and limits off."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.model_selection import LeaveOneGroupOut, cross_val_score
from smallmachine import small_machine

from thermocomp.core.inputs import Support
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.models.arx_net import NetARX
from thermocomp.models.gp import GaussianProcess
from thermocomp.models.methods import METHODS
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.mlp_sklearn import SklearnNet
from thermocomp.models.ppr import ProjectionPursuit
from thermocomp.models.timed import TimedRegressor
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

#: those that would take long as they are
QUICK: dict[str, Any] = {
    "mlp": SigmoidNet(hidden=4, n_epochs=100),
    "mlp-sklearn": SklearnNet(hidden=3),
    "gp": GaussianProcess(max_rows=50),
    "ppr": ProjectionPursuit(max_terms=2),
    "arx-net": NetARX(inputs=["spindle_rpm"], hidden=(2, 3), epochs=100, time="column"),
}


@pytest.fixture(scope="module")
def tests() -> Samples:
    """Three tests, two cycles each."""
    speeds = ((1000.0, 2500.0), (3000.0, 1500.0), (2000.0, 2800.0))
    return stack([small_machine(s, seed=k) for k, s in enumerate(speeds)], ["z_um"])


@pytest.mark.parametrize("name", METHODS)
def test_cross_val_score_is_our_own_judging(name: str, tests: Samples) -> None:
    how = METHODS[name]
    estimator: Any = QUICK.get(name) or how.build(["spindle_rpm"])
    timed = isinstance(estimator, TimedRegressor)
    judging = splits.leave_one_file_out(tests) if timed else splits.leave_one_cycle_out(tests)
    wide = Support(margin=1e6)  # scikit-learn does not clip the inputs to the trained range
    mine = estimator if name in QUICK else name
    mine_tests = tests if timed else tests.only(["t1_C", "t2_C", "t3_C"])
    ours = [
        a
        for a in compare(mine_tests, [mine], judging, support=wide, robustness=False, limits=None).assessments
        if not a.overall
    ]
    assert [a.failure for a in ours] == [""] * len(judging.splits)
    X = tests.frame()
    if timed:
        X.insert(0, "time_s", tests.time)
        estimator.set_params(time="column")
    else:
        X = X.drop(columns="spindle_rpm")
    groups, params = (tests.test if timed else tests.cycle), {}
    with config_context(enable_metadata_routing=True):
        if "cycle" in how.takes:
            estimator.set_fit_request(cycle=True)
            params = {"cycle": tests.cycle}
        found = -cross_val_score(
            estimator, X, tests.deviations[:, 0], cv=LeaveOneGroupOut(), scoring="neg_root_mean_squared_error",
            params={"groups": groups, **params}, error_score="raise",
        )  # fmt: skip
    expected = np.array([a.metric("rms") for a in ours])
    assert np.ptp(expected) > 0.01
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_routed_is_the_same(tests: Samples) -> None:
    """With dt by metadata routing, and the score that comes with the estimator: R2."""
    from thermocomp.models.dynamic import DynamicRidge

    judging = splits.leave_one_file_out(tests)
    overall = compare(
        tests, ["dynamic"], judging, support=Support(margin=1e6), robustness=False, limits=None
    ).assessments
    ours = [a for a in overall if not a.overall]
    with config_context(enable_metadata_routing=True):
        estimator: Any = DynamicRidge(speed=["spindle_rpm"], time="routed")
        estimator.set_fit_request(dt=True, cycle=True).set_predict_request(dt=True).set_score_request(dt=True)
        params = {"groups": tests.test, "dt": pd.Series(tests.dt()), "cycle": tests.cycle}
        found = cross_val_score(estimator, tests.frame(), tests.deviations[:, 0], cv=LeaveOneGroupOut(), params=params)
    expected = [
        1 - np.sum((a.measured - a.predicted) ** 2) / np.sum((a.measured - a.measured.mean()) ** 2) for a in ours
    ]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
