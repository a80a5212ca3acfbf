"""An estimator with a memory under scikit-learn: told the time it is right, not told it refuses."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from sklearn import config_context
from sklearn.compose import ColumnTransformer
from sklearn.exceptions import FitFailedWarning
from sklearn.model_selection import GridSearchCV, KFold, LeaveOneGroupOut, TimeSeriesSplit, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler, StandardScaler
from smallmachine import small_machine

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.averaged import AveragedDynamic
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.methods import METHODS
from thermocomp.models.timed import TimedRegressor, derive_steps
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

FloatArray = NDArray[np.float64]
MINUTE = 60.0
LAGS: dict[str, Any] = {"temperature_lags": ((), (20 * MINUTE,)), "speed_lags": ((20 * MINUTE, 90 * MINUTE),)}
MAKERS: dict[str, Callable[..., TimedRegressor]] = {
    "averaged": lambda **more: AveragedDynamic(speed=["spindle_rpm"], structures=20, **more),
    "dynamic": lambda **more: DynamicRidge(speed=["spindle_rpm"], **LAGS, **more),
    "arx": lambda **more: ARX(inputs=["spindle_rpm"], **more),
    "arx-free-run": lambda **more: ARX(inputs=["spindle_rpm"], criterion="free-run", k_max=1, m_max=1, **more),
    "arx-net": lambda **more: NetARX(inputs=["spindle_rpm"], hidden=2, epochs=50, **more),
}
each = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


@pytest.fixture(scope="module")
def tests() -> Samples:
    """Three tests, each from its own cold start."""
    speeds = ((1000.0, 2500.0), (3000.0, 1500.0), (2000.0, 2800.0))
    return stack([small_machine(s, seed=k) for k, s in enumerate(speeds)], ["z_um"])


def table(samples: Samples) -> pd.DataFrame:
    X = samples.frame()
    X.insert(0, "time_s", samples.time)
    return X


def test_these_are_all_that_have_a_memory() -> None:
    assert {n for n, m in METHODS.items() if issubclass(m.kind, TimedRegressor)} == set(MAKERS)
    assert all(("dt" in m.takes) == issubclass(m.kind, TimedRegressor) for m in METHODS.values())


# -- the two ways to tell it -------------------------------------------------------------------------------------------


@each
def test_both_ways_are_the_same_model(make: Callable[..., TimedRegressor], tests: Samples) -> None:
    X, y = table(tests), tests.deviations[:, 0]
    column: Any = make(time="column").fit(X, y)
    routed: Any = make(time="routed").fit(tests.frame(), y, dt=tests.dt(), cycle=tests.test)
    assert np.array_equal(column.predict(X), routed.predict(tests.frame(), dt=tests.dt()))
    assert column.score(X, y) == routed.score(tests.frame(), y, dt=tests.dt()) > 0.3
    assert column.freeze(target="z") == routed.freeze(target="z")
    assert "time_s" not in [i.name for i in column.freeze(target="z").inputs]
    weight = np.linspace(0, 1, len(y))
    assert column.score(X, y, sample_weight=weight) != column.score(X, y)


def test_a_new_test_is_a_new_cycle_or_what_is_routed(tests: Samples) -> None:
    X, y = table(tests), tests.deviations[:, 0]
    make = MAKERS["dynamic"]
    told: Any = make(time="column").fit(X, y)
    assert told.chosen_by_ == "3 thermal cycles, left out in turn"
    finer: Any = make(time="column").fit(X, y, cycle=tests.cycle)
    assert finer.chosen_by_ == f"{len(tests.cycle_names)} thermal cycles, left out in turn" != told.chosen_by_
    first = tests.test == 0
    alone: Any = make(time="column").fit(X[first], y[first])
    assert "five stretches" in alone.chosen_by_


def test_columns_are_counted_in_X(tests: Samples) -> None:
    X, y = table(tests), tests.deviations[:, 0]
    named: Any = MAKERS["dynamic"](time="column").fit(X, y)
    counted = DynamicRidge(speed=[4], time="column", **LAGS).fit(X.to_numpy(), y)
    assert np.array_equal(named.predict(X), counted.predict(X.to_numpy()))
    assert counted.feature_labels_[0] == "x1"
    with pytest.raises(InputError, match="speed column 0 is the time"):
        DynamicRidge(speed=[0], time="column").fit(X, y)
    with pytest.raises(InputError, match="speed column 5 is beyond the 4 columns"):
        DynamicRidge(speed=[5], time="column").fit(X.to_numpy(), y)
    assert counted.routed().get_params() == {**counted.get_params(), "speed": (3,), "time": "routed"}


# -- refusals ----------------------------------------------------------------------------------------------------------

REMEDY = r"was not given the time: give it time='column' if the first column .* or time='routed'"


@each
def test_without_a_declaration_everything_refuses(make: Callable[..., TimedRegressor], tests: Samples) -> None:
    X, y = table(tests), tests.deviations[:, 0]
    untold: Any = make()
    with pytest.raises(InputError, match=REMEDY):
        untold.fit(X, y)
    with pytest.raises(InputError, match=REMEDY):
        untold.fit(X, y, dt=tests.dt())
    fitted: Any = make(time="column").fit(X, y).set_params(time=None)
    with pytest.raises(InputError, match=REMEDY):
        fitted.predict(X)
    with pytest.raises(InputError, match=REMEDY):
        fitted.predict(X, dt=tests.dt())
    with pytest.raises(InputError, match=REMEDY):
        fitted.score(X, y)
    with pytest.raises(InputError, match="fitted with time='column' but now has time='none': fit it again"):
        fitted.set_params(time="none").predict(X)
    with pytest.raises(InputError, match=r"unknown time='hours'; give it time='column'"):
        untold.set_params(time="hours").fit(X, y)


@each
def test_without_a_declaration_nothing_of_scikit_learn_gives_a_number(
    make: Callable[..., TimedRegressor], tests: Samples
) -> None:
    X, y, groups = table(tests), tests.deviations[:, 0], tests.test
    leave = LeaveOneGroupOut()
    # scikit-learn puts the errors of all fits into a ValueError of its own
    with pytest.raises(ValueError, match="was not given the time"):
        cross_val_score(make(), X, y, groups=groups, cv=leave)
    with pytest.raises(ValueError, match="was not given the time"):
        cross_val_score(make(), X, y, groups=groups, cv=leave, params={"dt": tests.dt()})
    with pytest.raises(ValueError, match="was not given the time"):
        GridSearchCV(make(), {"time": [None]}, cv=leave).fit(X, y, groups=groups)
    with pytest.raises(InputError, match=REMEDY):
        make_pipeline(StandardScaler(), make()).fit(X, y)


def scores(*args: Any, **more: Any) -> tuple[FloatArray, str]:
    """Return what `cross_val_score` gives, nan if it raises because no fit was possible, and what it said."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = cross_val_score(*args, **more)
        except ValueError as e:
            return np.array([np.nan]), str(e)
    return found, " ".join(str(w.message) for w in caught)


@pytest.mark.parametrize(
    ("cv", "rows"),
    [
        (KFold(4), "all"),
        (KFold(4), "first"),
        (KFold(4, shuffle=True, random_state=0), "all"),
        (KFold(4, shuffle=True, random_state=0), "first"),
        (TimeSeriesSplit(3), "first"),
        (LeaveOneGroupOut(), "first"),
    ],
    ids=str,
)
@pytest.mark.parametrize("plain", [False, True])
def test_parts_of_a_test_are_never_scored(cv: Any, rows: str, plain: bool, tests: Samples) -> None:
    """A fold that begins in the middle of a test, or has a hole, gives no number, and an error where one is wanted."""
    mine = slice(None) if rows == "all" else tests.test == 0
    X, y, cycle = table(tests)[mine], tests.deviations[mine, 0], tests.cycle[mine]
    data: Any = X.to_numpy() if plain else X
    how = {"cv": cv, "groups": cycle if isinstance(cv, LeaveOneGroupOut) else None}
    estimator = DynamicRidge(speed=[4], time="column", **LAGS)
    for scoring in (None, "neg_root_mean_squared_error"):
        with pytest.raises(InputError, match="leave whole tests out"):
            cross_val_score(estimator, data, y, **how, scoring=scoring, error_score="raise")
        found, said = scores(estimator, data, y, **how, scoring=scoring)
        assert np.isnan(found).all()
        assert "leave whole tests out" in said


def test_a_hole_that_looks_like_the_next_row_is_seen_by_the_index(tests: Samples) -> None:
    """The first half of the second test left out: its second half begins where the first test ends."""
    X, y = table(tests), tests.deviations[:, 0]
    X = X[tests.test < 2]
    length = int((tests.test == 0).sum()) // 2
    whole = np.r_[np.arange(length), np.arange(3 * length, 4 * length)]  # half a test, then the other half of the next
    time = X["time_s"].to_numpy()[whole]
    assert (np.diff(time) > 0).all()
    assert np.ptp(np.diff(time)) == 0  # nothing in the times
    estimator: Any = DynamicRidge(speed=["spindle_rpm"], time="column", **LAGS)
    with pytest.raises(InputError, match=rf"rows are missing between index {length - 1} and {3 * length}"):
        estimator.fit(X.iloc[whole], y[whole])
    dt: Any = pd.Series(tests.dt())
    routed: Any = MAKERS["dynamic"](time="routed")
    with pytest.raises(InputError, match="rows are missing between index"):
        routed.fit(tests.frame().iloc[whole], y[whole], dt=dt.iloc[whole])
    estimator.fit(X.iloc[: 2 * length : 2], y[: 2 * length : 2])  # but a slower clock is no hole


def test_a_scaled_time_or_none_at_all_is_refused(tests: Samples) -> None:
    X, y = table(tests), tests.deviations[:, 0]
    make = MAKERS["dynamic"]
    for scaler in (StandardScaler(), MinMaxScaler()):
        pipeline = make_pipeline(scaler.set_output(transform="pandas"), make(time="column"))
        with pytest.raises(InputError, match=r"time='column': .*first\s?.*column of X"):
            pipeline.fit(X, y)
    keep = ColumnTransformer(
        [("t", "passthrough", ["time_s"])], remainder=StandardScaler(), verbose_feature_names_out=False
    )
    right = make_pipeline(keep.set_output(transform="pandas"), make(time="column")).fit(X, y)
    assert right.score(X, y) > 0.9
    estimator: Any = make(time="column")
    with pytest.raises(
        InputError, match=r"ends at 3\.\d+ s, which is too short for a thermal test. It must be in seconds"
    ):
        estimator.fit(X.assign(time_s=X["time_s"] / 3600 / 2), y)
    with pytest.raises(InputError, match="never increases, so it is not the time"):
        estimator.fit(X.assign(time_s=0.0), y)
    with pytest.raises(InputError, match=r"at row \d+ a test begins at .* and not at 0"):
        estimator.fit(X.drop(columns="time_s"), y)
    with pytest.raises(InputError, match="X has one column, the time, and no input"):
        estimator.fit(X[["time_s"]], y)
    with pytest.raises(InputError, match=r"dt was given to DynamicRidge\(time='column'\)"):
        estimator.fit(X, y, dt=tests.dt())


def test_a_pause_is_refused_in_a_column_and_told_by_dt() -> None:
    time = np.r_[np.arange(0, 600, 10.0), np.arange(4200, 4800, 10.0)]
    with pytest.raises(
        InputError, match=r"row 60 comes 3610 s after the previous row, where 10 s are usual.*use time='routed'"
    ):
        derive_steps(time)
    assert derive_steps(np.r_[0.0, 10, 20, 0, 30, 60]).tolist() == [np.inf, 10, 10, np.inf, 30, 30]
    assert derive_steps(np.r_[0.0, 95, 100]).tolist() == [np.inf, 95, 5]


def test_the_end_of_a_test_alone_is_refused_when_routed(tests: Samples) -> None:
    dt: Any = pd.Series(tests.dt())
    fitted: Any = MAKERS["dynamic"](time="routed").fit(tests.frame(), tests.deviations[:, 0], dt=dt)
    with pytest.raises(InputError, match="first row is 60 s after another row, but a test must start with inf"):
        fitted.predict(tests.frame().iloc[100:], dt=dt.iloc[100:])


def test_at_rest_is_for_the_checks_alone(tests: Samples) -> None:
    still: Any = MAKERS["dynamic"](time="none")
    with pytest.raises(InputError, match="dt was given to DynamicRidge"):
        still.fit(tests.frame(), tests.deviations[:, 0], dt=tests.dt())
    still.fit(tests.frame(), tests.deviations[:, 0])
    with pytest.raises(FitError, match="treats every row as a steady state; fit it with time='column'"):
        still.freeze(target="z")
    with pytest.raises(InputError, match="treats every row as a steady state"):
        still.routed()


# -- metadata routing --------------------------------------------------------------------------------------------------


def test_routed_by_scikit_learn(tests: Samples) -> None:
    X, y, groups = tests.frame(), tests.deviations[:, 0], tests.test
    params = {"dt": pd.Series(tests.dt()), "cycle": tests.test, "groups": groups}
    leave = LeaveOneGroupOut()
    column, _ = scores(MAKERS["dynamic"](time="column"), table(tests), y, groups=groups, cv=leave)
    with config_context(enable_metadata_routing=True):
        requested: Any = MAKERS["dynamic"](time="routed")
        requested.set_fit_request(dt=True, cycle=True).set_predict_request(dt=True).set_score_request(dt=True)
        routed, said = scores(requested, X, y, cv=leave, params=params)
        assert routed == pytest.approx(column, abs=1e-12)
        assert not said
        search = GridSearchCV(requested, {"rule": ["minimum", "one-standard-error"]}, cv=leave).fit(X, y, **params)
        assert search.best_score_ > 0.9
        with pytest.raises(InputError, match="was given no dt"):
            search.predict(X)
        piped = make_pipeline(StandardScaler().set_output(transform="pandas"), requested)
        found, said = scores(piped, X, y, cv=leave, params=params)
        assert (found > 0.9).all()
        assert not said
        nothing, said = scores(requested, X, y, cv=leave, params={**params, "dt": tests.dt()})
        assert np.isnan(nothing).all()
        assert "dt has no index, so missing rows cannot be detected; give pd.Series(dt)" in said
        # a scorer by name passes nothing on to predict
        nothing, said = scores(requested, X, y, cv=leave, params=params, scoring="neg_root_mean_squared_error")
        assert np.isnan(nothing).all()
        assert "use scoring=None, or use time='column'" in said
        for cv in (KFold(4), KFold(4, shuffle=True, random_state=0)):
            parts, said = scores(requested, X, y, cv=cv, params={"dt": params["dt"], "cycle": groups})
            assert np.isnan(parts).all()
            assert "leave whole tests out" in said
    with pytest.warns((UserWarning, FitFailedWarning), match="was given no dt"):  # fit is told, predict is not
        old = cross_val_score(
            MAKERS["dynamic"](time="routed"), X, y, groups=groups, cv=leave, params={"dt": tests.dt()}
        )
    assert np.isnan(old).all()


def test_grid_search_and_pipeline_with_a_column(tests: Samples) -> None:
    X, y, groups = table(tests), tests.deviations[:, 0], tests.test
    search = GridSearchCV(
        MAKERS["dynamic"](time="column"), {"copies": ["high-passed", "lagged"]}, cv=LeaveOneGroupOut()
    ).fit(X, y, groups=groups)
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    assert search.score(X, y) > 0.9


def test_a_left_out_file_has_no_part_in_the_training() -> None:
    """Not by its time steps either: the usual one is that of the files that are learned from."""
    slow = small_machine()
    slow = replace(slow, name="slow", time=10 * slow.time)
    both = stack([small_machine((1000.0, 2500.0), seed=1), slow], ["z_um"])
    trained: Any = train(ARX(inputs=["spindle_rpm"], interval=None), both, 0, both.test == 0).estimator
    assert trained.interval_ == 60.0
