"""Regressors of others beside the methods: scikit-learn's, a Pipeline, a small class of one's own."""

import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.feature_selection import SelectKBest, f_regression
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.polynomial import Polynomial
from thermocomp.judging import splits
from thermocomp.judging.compare import compare, n_pieces
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.foreign import ForeignRegressor, adopt_estimator
from thermocomp.models.methods import METHODS, NamedEstimator, deployable, expand
from thermocomp.models.ols import LeastSquares
from thermocomp.models.partial_f import PartialF
from thermocomp.models.pipelines import PipelineRegressor, freeze
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.sensors import SensorSelector
from thermocomp.models.training import train
from thermocomp.models.unfrozen import EstimatorModel
from thermocomp.recordings.samples import Samples

FloatArray = NDArray[np.float64]
DYNAMIC = DynamicRidge(speed=["spindle_rpm"], temperature_lags=((1200.0,),), speed_lags=((1200.0, 5400.0),))


class Plane(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """A small class of a user's: the least squares plane through zero."""

    def fit(self, X: ArrayLike, y: ArrayLike) -> "Plane":
        self.slopes_ = np.linalg.lstsq(np.asarray(X), np.asarray(y), rcond=None)[0]
        return self

    def predict(self, X: ArrayLike) -> FloatArray:
        return np.asarray(np.asarray(X) @ self.slopes_)


class Deployable(Plane):
    """The same with a `freeze` of its own."""

    def freeze(self, *, target: str, unit: str, inputs: tuple[Input, ...], support: Any, provenance: Any) -> Polynomial:
        like = LeastSquares(fit_intercept=False).fit(np.eye(len(inputs)), self.slopes_)
        return like.freeze(  # type: ignore[return-value]
            target=target, unit=unit, inputs=inputs, support=support, provenance=provenance
        )


def rms(samples: Samples, models: list[Any]) -> dict[str, float]:
    found = compare(samples, models, splits.leave_one_cycle_out(samples), robustness=False).overall()
    assert not any(a.failure for a in found)
    return {str(a.model): a.metric("rms") for a in found if a.target == "z_um"}


def test_anything_stands_beside_the_methods(samples: Samples) -> None:
    models = [
        "ols",
        HistGradientBoostingRegressor(max_iter=5),
        Plane(),
        Plane(),
        Deployable(),
        make_pipeline(StandardScaler(), Ridge()),
    ]
    found = rms(samples, models)
    assert list(found) == [
        "ols", "HistGradientBoostingRegressor", "Plane", "Plane #2", "Deployable", "StandardScaler + Ridge"
    ]  # fmt: skip
    assert found["Plane"] == found["Plane #2"] == pytest.approx(found["Deployable"], rel=1e-9)
    assert found["Plane"] < 3  # of about 16 um
    assert n_pieces(samples, models, splits.leave_one_cycle_out(samples)) == 2 * (
        6 * 4 + 2 * 6
        # two may be chosen, by pairs of cycles
    )


def test_what_cannot_be_deployed_is_never_the_best(samples: Samples) -> None:
    comparison = compare(samples, [Plane(), DYNAMIC], splits.leave_one_cycle_out(samples), robustness=False)
    best = comparison.best("z_um")
    assert best is not None
    assert best.model == "DynamicRidge"
    alone = compare(samples, [Plane()], splits.leave_one_cycle_out(samples), robustness=False)
    assert alone.overall()[0].accepted
    assert alone.best("z_um") is None
    assert [deployable(n) for n in expand(["ols", "gp", Plane(), Deployable(), DYNAMIC])] == [
        True,
        False,
        False,
        True,
        True,
    ]


def test_the_recording_tells_which_inputs_are_speeds(samples: Samples) -> None:
    found = rms(samples, ["dynamic", DynamicRidge(), DynamicRidge(time="column")])
    assert found["dynamic"] == found["DynamicRidge"] == found["DynamicRidge #2"]


def test_the_replay_is_its_prediction(samples: Samples) -> None:
    """Predictions made at once and one by one are the same, and are those of the estimator that was given."""
    rows = samples.cycle < 2
    trained = train(Plane(), samples, 0, rows, support=Support(margin=1e6))
    assert isinstance(trained.model, EstimatorModel)
    expected = Plane().fit(samples.change()[rows], samples.deviations[rows, 0]).predict(samples.change())
    state, got = trained.model.init(), []
    for row in samples.values:
        state, deviation = trained.model.step(state, row, 60.0)
        got.append(float(deviation))
    np.testing.assert_allclose(got, expected, atol=1e-9)
    run = trained.model.run(trained.model.init(), samples.values, np.full(len(samples), 60.0))
    np.testing.assert_allclose(run.deviation, expected, atol=1e-9)
    assert trained.method == "Plane"
    with pytest.raises(FitError, match="Plane cannot be stored as coefficients: it is not a method of thermocomp"):
        trained.estimator.freeze(target="z_um")


def test_a_named_estimator_survives_the_way_to_another_process() -> None:
    (name,) = expand([DYNAMIC])
    back = pickle.loads(pickle.dumps(name))
    assert isinstance(back, NamedEstimator)
    assert back == "DynamicRidge"
    assert back.estimator.get_params() == DYNAMIC.get_params() | {"time": "routed", "speed": ("spindle_rpm",)}
    assert expand([name, "all"]) == ["DynamicRidge", *METHODS]


class Bare:
    """A regressor by protocol alone, without a base class of scikit-learn."""

    def __init__(self, share: float = 1.0) -> None:
        self.share = share

    def get_params(self, deep: bool = True) -> dict[str, float]:
        return {"share": self.share}

    def set_params(self, **params: float) -> "Bare":
        self.share = params.get("share", self.share)
        return self

    def fit(self, X: ArrayLike, y: ArrayLike) -> "Bare":
        self.slopes_ = self.share * np.linalg.lstsq(np.asarray(X), np.asarray(y))[0]
        return self

    def predict(self, X: ArrayLike) -> FloatArray:
        return np.asarray(np.asarray(X) @ self.slopes_)


class Sorter(Bare):
    _estimator_type = "classifier"


def test_a_regressor_needs_no_base_class(samples: Samples) -> None:
    assert rms(samples, [Bare()])["Bare"] == pytest.approx(rms(samples, [Plane()])["Plane"])
    assert rms(samples, [Bare(0.5)])["Bare"] > 1.5 * rms(samples, [Plane()])["Plane"]


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (Plane, r"Plane is a class: pass an instance, Plane\(\)"),
        (3.0, "float is not a regressor: name a method, or pass an instance"),
        (StandardScaler(), "StandardScaler is not a regressor"),
        pytest.param(Sorter(), "Sorter is not a regressor", id="Sorter"),
        (DynamicRidge(time="none"), r"DynamicRidge\(time='none'\) treats every row as a steady state"),
        (make_pipeline(PartialF(), DynamicRidge(time="none")), "has a memory, and .* cannot pass it the time here"),
        (GridSearchCV(DynamicRidge(time="none"), {"rule": ["minimum"]}), "DynamicRidge .estimator. has a memory"),
        ("oss", "unknown model 'oss'; did you mean ols"),
    ],
    ids=str,
)
def test_what_is_refused(thing: Any, message: str, samples: Samples) -> None:
    with pytest.raises(InputError, match=message):
        rms(samples, ["ols", thing])


def test_a_pipeline_with_a_model_at_rest_is_refused(samples: Samples) -> None:
    resting = make_pipeline(SensorSelector("partial-f"), DynamicRidge(time="none"))
    found = compare(samples, [resting, "ols"], splits.leave_one_cycle_out(samples), robustness=False).overall()
    assert [bool(a.failure) for a in found] == [True, False, True, False]
    assert "treats every row as a steady state" in found[0].reason


def test_one_number_per_row_or_none() -> None:
    class Wrong(Plane):
        def predict(self, X: ArrayLike) -> FloatArray:
            return np.zeros(3)

    with pytest.raises(FitError, match=r"Wrong: predict returned an array of shape \(3,\) for 20 rows"):
        ForeignRegressor(Wrong()).fit(np.eye(20), np.ones(20)).predict(np.eye(20))


class Unfit(Plane):
    def fit(self, X: ArrayLike, y: ArrayLike) -> Plane:
        raise TypeError("no table")


class Unasked(Plane):
    def predict(self, X: ArrayLike) -> FloatArray:
        raise KeyError("t9_C")


class Nothing(Plane):
    def predict(self, X: ArrayLike) -> FloatArray:
        return np.asarray(np.where(np.arange(len(np.asarray(X))) == 3, np.nan, super().predict(X)))


class Short(Plane):
    def predict(self, X: ArrayLike) -> FloatArray:
        return super().predict(X)[:-1]


class Text(Plane):
    def predict(self, X: ArrayLike) -> Any:
        return ["warm"] * len(np.asarray(X))


class Transposed(Plane):
    def predict(self, X: ArrayLike) -> FloatArray:
        return super().predict(X)[None]


class Stubborn(Plane):
    def __init__(self, slopes: Any = ()) -> None:
        self.slopes = list(slopes)  # scikit-learn cannot copy it


class Delicate(Plane):
    """Fails where it is warmer than ever: on what noise makes of the inputs."""

    def __init__(self, highest: float = 0.0) -> None:
        self.highest = highest

    def predict(self, X: ArrayLike) -> FloatArray:
        if np.asarray(X)[:, :3].max() > self.highest:
            raise ArithmeticError("too warm")
        return super().predict(X)


class FrozenNan(Deployable, Nothing):
    """One with a `freeze` of its own."""


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (Unfit(), "Unfit cannot be fitted to z_um: TypeError: no table"),
        (Unasked(), "Unasked cannot predict: KeyError: 't9_C'"),
        (Nothing(), "Nothing predicts nan in 1 of"),
        (Short(), "Short: predict returned an array of shape"),
        (Text(), "Text predicts values that are not numbers: could not convert string"),
        (Transposed(), r"Transposed: predict returned an array of shape (1, "),
        (Stubborn(), "Stubborn cannot be fitted to z_um: RuntimeError: Cannot clone"),
        (FrozenNan(), "FrozenNan predicts nan in 1 of"),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, BaseEstimator) else "",
)
def test_what_fails_costs_no_one_else_the_result(thing: Any, message: str, samples: Samples) -> None:
    found = compare(samples, ["ols", thing], splits.leave_one_cycle_out(samples), robustness=False).overall()
    ours, theirs = (a for a in found if a.target == "z_um")
    assert not ours.failure
    assert message in theirs.failure
    assert theirs.word == "refused"


def test_what_fails_with_noise_costs_no_one_else_the_result(samples: Samples) -> None:
    highest = samples.change()[:, :3].max()
    judging, wide = splits.leave_one_cycle_out(samples), Support(margin=1e6)
    found = compare(samples, ["ols", Delicate(highest)], judging, support=wide).overall()
    ours, theirs = (a for a in found if a.target == "z_um")
    assert not ours.failure
    assert theirs.failure == "Delicate cannot predict: ArithmeticError: too warm"


def test_the_keyboard_stops_it(samples: Samples) -> None:
    class Stopped(Plane):
        def fit(self, X: ArrayLike, y: ArrayLike) -> Plane:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(Stopped(), samples, 0, samples.valid)


# -- pipelines that freeze ---------------------------------------------------------------------------------------------


def selector() -> SensorSelector:
    return SensorSelector("partial-f", keep=["spindle_rpm"])


@pytest.mark.parametrize(
    "pipeline",
    [
        make_pipeline(SensorSelector("partial-f"), SecondOrderRegression()),
        make_pipeline(SelectKBest(f_regression, k=2), LeastSquares()),
        make_pipeline(StandardScaler(), SensorSelector("lasso"), LeastSquares()),
        make_pipeline(SelectKBest(f_regression, k=3), StandardScaler(), StandardScaler(with_mean=False), PartialF()),
        make_pipeline("passthrough", LeastSquares(fit_intercept=False)),
    ],
    ids=range(5),
)
def test_a_frozen_pipeline_is_the_pipeline(pipeline: Any, samples: Samples) -> None:
    X, y = samples.frame(), samples.deviations[:, 0]
    fitted = clone(pipeline).fit(X, y)
    model = freeze(fitted, target="z_um")
    assert set(model.sensors) <= set(X.columns)
    table = X[[i.name for i in model.inputs]]
    assert [(i.low, i.high) for i in model.inputs] == [
        pytest.approx((low, high), rel=1e-9) for low, high in zip(table.min(), table.max(), strict=True)
    ]
    state, got = model.init(), []
    for row in table.to_numpy():
        state, deviation = model.step(state, row, 60.0)
        got.append(float(deviation))
    np.testing.assert_allclose(got, fitted.predict(X), rtol=1e-9, atol=1e-9)


def test_a_pipeline_with_a_memory_freezes(samples: Samples) -> None:
    X, y = samples.frame(), samples.deviations[:, 0]
    timed = X.copy()
    timed.insert(0, "time_s", samples.time)
    select = SensorSelector("partial-f", keep=["spindle_rpm"], time="column").set_output(transform="pandas")
    last = clone(DYNAMIC).set_params(time="column")
    fitted = make_pipeline(select, last).fit(timed, y)
    model = freeze(fitted, target="z_um", inputs=samples.model_inputs(range(4), samples.valid))
    assert model.remembers
    trained = train(make_pipeline(selector(), DYNAMIC), samples, 0, samples.valid)
    assert isinstance(trained.estimator, PipelineRegressor)
    state, got = model.init(), []
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]]
    for row in values:
        state, deviation = model.step(state, row, 60.0)
        got.append(float(deviation))
    np.testing.assert_allclose(got, fitted.predict(timed), rtol=1e-9, atol=1e-9)
    lost = make_pipeline(SelectKBest(f_regression, k=2), DynamicRidge(time="column"))
    with pytest.raises(InputError, match="time='column'"):  # it has thrown the time away
        lost.fit(timed, y)


def test_a_selector_of_a_pipeline_sees_only_what_is_learned_from(samples: Samples) -> None:
    learn = samples.cycle != 1
    trained: Any = train(make_pipeline(selector(), DYNAMIC), samples, 0, learn)
    alone = selector().fit(samples.frame()[learn], samples.deviations[learn, 0])
    assert trained.estimator.pipeline_[0].estimator_.coef_.tolist() == alone.estimator_.coef_.tolist()


def test_pipelines_that_cannot_be_frozen(samples: Samples) -> None:
    X, y = samples.frame(), samples.deviations[:, 0]
    with pytest.raises(FitError, match="this one consists of PolynomialFeatures, LeastSquares"):
        freeze(make_pipeline(PolynomialFeatures(), LeastSquares()).fit(X, y), target="z")
    with pytest.raises(FitError, match="Ridge has no 'freeze'"):
        freeze(Ridge().fit(X, y), target="z")
    with pytest.raises(FitError, match="StandardScaler before a model of the family polynomial cannot be frozen"):
        freeze(make_pipeline(StandardScaler(), SecondOrderRegression(fit_intercept=True)).fit(X, y), target="z")
    assert isinstance(adopt_estimator(make_pipeline(PolynomialFeatures(), LeastSquares())), ForeignRegressor)
