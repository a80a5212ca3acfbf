"""Ridge, principal components, partial least squares, lasso, elastic net and Gaussian process: the comparisons."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from sklearn import linear_model
from sklearn.cross_decomposition import PLSRegression
from sklearn.decomposition import PCA
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.model_selection import GridSearchCV, LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import FitError, InputError, ModelFileError
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.files import modelfile
from thermocomp.judging import splits, study
from thermocomp.judging.compare import compare
from thermocomp.judging.replay import replay
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.gp import GaussianProcess
from thermocomp.models.lasso import ElasticNet, Lasso
from thermocomp.models.method import Method
from thermocomp.models.methods import METHODS
from thermocomp.models.numerics import moments
from thermocomp.models.ols import LeastSquares
from thermocomp.models.pcr import PrincipalComponents
from thermocomp.models.pcr_traversal import TraversedComponents
from thermocomp.models.pls import PartialLeastSquares
from thermocomp.models.ridge import Ridge
from thermocomp.models.shrinkage import ShrunkRegressor, choose, scaling
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples

FloatArray = NDArray[np.float64]

LINEAR: list[ShrunkRegressor] = [
    Ridge(),
    PrincipalComponents(),
    TraversedComponents(),
    PartialLeastSquares(),
    Lasso(),
    ElasticNet(),
]
THROUGH_ZERO: list[ShrunkRegressor] = [type(e)(fit_intercept=False) for e in LINEAR]


@parametrize_with_checks([*LINEAR, Ridge(fit_intercept=False), GaussianProcess()])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def cycles(seed: int = 0, n: int = 60, n_cycles: int = 4) -> tuple[pd.DataFrame, FloatArray, NDArray[np.intp]]:
    """Six temperature rises that follow three heat sources, a drift of two of them [um], and the thermal cycles."""
    rng = np.random.default_rng(seed)
    time = np.tile(np.linspace(0, 3, n), n_cycles)[:, None]
    load = np.repeat(rng.uniform(0.3, 1.0, (n_cycles, 3)), n, axis=0)
    sources = 10 * load * (1 - np.exp(-time / np.array([0.3, 1.0, 3.0])))
    T = sources @ rng.uniform(0, 1, (3, 6)) + 0.05 * rng.normal(size=(n * n_cycles, 6))
    y = 3.0 * sources[:, 0] - 2.0 * sources[:, 2] + 0.3 * rng.normal(size=len(T))
    return pd.DataFrame(T, columns=[f"T{k}" for k in range(1, 7)]), y, np.repeat(np.arange(n_cycles), n)


def replayed(model: ErrorModel, T: pd.DataFrame) -> FloatArray:
    state, found = model.init(), np.empty(len(T))
    for k, row in enumerate(T[[i.name for i in model.inputs]].to_numpy()):
        state, deviation = model.step(state, row, 10.0)
        found[k] = deviation
    return found


@pytest.mark.parametrize("estimator", [*LINEAR, *THROUGH_ZERO], ids=str)
def test_frozen_replay_is_the_prediction(estimator: ShrunkRegressor) -> None:
    T, y, cycle = cycles()
    T["dead"] = 0.0
    model = estimator.fit(T, y, cycle=cycle).freeze(target="dx")
    assert isinstance(model, Polynomial)
    assert "dead" not in [i.name for i in model.inputs]
    predicted = estimator.predict(T)
    np.testing.assert_allclose(replayed(model, T), predicted, rtol=0, atol=1e-10)
    (again,) = modelfile.loads(modelfile.dumps([model]))
    assert again == model
    assert np.array_equal(replayed(again, T), replayed(model, T))
    if not estimator.fit_intercept:
        assert model.intercept == 0.0


# -- what is chosen, and by what ---------------------------------------------------------------------------------------


def peer(estimator: ShrunkRegressor, setting: float, n: int, ratio: float = 1.0) -> Any:
    """Return scikit-learn's own estimator with a fixed setting."""
    inner: Any
    if isinstance(estimator, Ridge):
        inner = linear_model.Ridge(alpha=setting * n)
    elif isinstance(estimator, PrincipalComponents):
        inner = make_pipeline(PCA(int(setting)), linear_model.LinearRegression())
    elif isinstance(estimator, PartialLeastSquares):
        inner = PLSRegression(int(setting), scale=False)
    else:
        inner = linear_model.ElasticNet(alpha=setting, l1_ratio=ratio, tol=1e-8, max_iter=100_000)
    return make_pipeline(StandardScaler(), inner)


@pytest.mark.parametrize("rule", ["minimum", "one-standard-error"])
@pytest.mark.parametrize(
    ("estimator", "settings"),
    [
        (Ridge(strengths=(1e-3, 1e-1, 1e-2, 1.0)), (1.0, 1e-1, 1e-2, 1e-3)),
        (PrincipalComponents(), (1, 2, 3, 4, 5, 6)),
        (PartialLeastSquares(max_components=4), (1, 2, 3, 4)),
        (Lasso(strengths=(0.3, 0.1, 0.01)), (0.3, 0.1, 0.01)),
        (ElasticNet(strengths=(0.3, 0.1, 0.01), l1_ratios=(0.5,)), (0.3, 0.1, 0.01)),
    ],
    ids=str,
)
def test_chosen_by_plain_refits_without_each_cycle(
    estimator: ShrunkRegressor, settings: tuple[float, ...], rule: str
) -> None:
    """The same choice, error and prediction as with scikit-learn's estimators, refitted for every cycle left out."""
    T, y, cycle = cycles(1)
    X = T.to_numpy()
    ratio = 0.5 if isinstance(estimator, ElasticNet) else 1.0

    def fitted(rows: NDArray[np.bool_], setting: float) -> Any:
        if isinstance(estimator, (Lasso, ElasticNet)):
            Z = (X[rows] - X[rows].mean(axis=0)) / X[rows].std(axis=0)
            setting *= np.abs((y[rows] - y[rows].mean()) @ Z).max() / rows.sum() / ratio
        return peer(estimator, setting, int(rows.sum()), ratio).fit(X[rows], y[rows])

    rms = np.array(
        [
            [np.sqrt(np.mean((y - fitted(cycle != k, s).predict(X).ravel())[cycle == k] ** 2)) for k in range(4)]
            for s in settings
        ]
    )
    best = int(rms.mean(axis=1).argmin())
    if rule == "one-standard-error":
        limit = rms[best].mean() + rms[best].std(ddof=1) / 2
        best = int(np.flatnonzero(rms.mean(axis=1) <= limit).min())
    estimator.set_params(rule=rule).fit(X, y, cycle=cycle)
    found = estimator.n_components_ if hasattr(estimator, "n_components_") else estimator.strength_
    assert found == settings[best]
    assert estimator.chosen_by_ == "4 thermal cycles, left out in turn"
    assert estimator.cv_rms_ == pytest.approx(rms[best].mean(), rel=2e-3)
    everything = np.ones(len(y), np.bool_)
    difference = estimator.predict(X) - fitted(everything, settings[best]).predict(X).ravel()
    assert np.abs(difference).max() < 2e-3 * y.std()


def test_ridge_is_the_ridge_of_dynamic() -> None:
    T, y, cycle = cycles(2)
    estimator = Ridge(strengths=(0.03,)).fit(T, y, cycle=cycle)
    table = np.column_stack([T, np.ones(len(T)), y])
    weights, intercepts = moments.solve(table.T @ table, (0.03,), fit_intercept=True)
    assert estimator.coef_ == pytest.approx(weights[:, 0], rel=1e-9)
    assert estimator.intercept_ == pytest.approx(intercepts[0], rel=1e-9)


@pytest.mark.parametrize("intercept", [False, True])
@pytest.mark.parametrize("singular", [False, True])
@pytest.mark.parametrize("columns", [1, 2, 3, 20])
def test_many_strengths_at_once_are_each_of_them_alone(columns: int, singular: bool, intercept: bool) -> None:
    rng = np.random.default_rng(columns)
    table = rng.normal(size=(60, columns + 2))
    if singular:
        table[:, 0] = table[:, columns - 1]
    table[:, -2] = 1.0
    strengths = (0.0, 1e-6, 0.03, 2.0)[singular:]
    weights, intercepts = moments.solve(table.T @ table, strengths, intercept)
    for k, strength in enumerate(strengths):
        alone, constant = moments.solve(table.T @ table, (strength,), intercept)
        assert weights[:, k] == pytest.approx(alone[:, 0], rel=1e-8, abs=1e-9)
        assert intercepts[k] == pytest.approx(constant[0], rel=1e-8, abs=1e-9)


def test_a_matrix_that_rounding_makes_indefinite_has_a_ridge_all_the_same() -> None:
    gram = np.diag([1.0, 1.0, 1.0, -1e-9])
    found = moments._solve_shifted(gram, np.ones(4), np.array([1e-12, 1e-10]))
    assert found == pytest.approx(np.stack([np.append(np.ones(3), 1 / s) for s in (1e-12, 1e-10)], axis=1))


@pytest.mark.parametrize("estimator", [PrincipalComponents, PartialLeastSquares])
def test_all_components_are_least_squares(estimator: type[PrincipalComponents] | type[PartialLeastSquares]) -> None:
    T, y, _ = cycles(3)
    rich = estimator()._fitted(T.to_numpy(), y)[0][0, -1]
    assert rich == pytest.approx(LeastSquares().fit(T, y).coef_, rel=1e-6)


@pytest.mark.parametrize("estimator", LINEAR, ids=str)
def test_cycles_decide_not_the_order_of_rows(estimator: ShrunkRegressor) -> None:
    """No random split, no split by position: with their cycles, rows may stand in any order."""
    T, y, cycle = cycles(4)
    order = np.random.default_rng(0).permutation(len(y))
    one = estimator.fit(T, y, cycle=cycle).coef_
    other = estimator.fit(T.iloc[order], y[order], cycle=cycle[order]).coef_
    assert other == pytest.approx(one, rel=1e-3, abs=1e-3)
    assert np.array_equal(estimator.fit(T, y, cycle=cycle).coef_, one)
    assert estimator.fit(T, y).chosen_by_ == "five stretches of equal length, left out in turn"


@pytest.mark.parametrize("estimator", LINEAR, ids=str)
def test_rows_without_a_cycle_are_not_learned_from(estimator: ShrunkRegressor) -> None:
    T, y, cycle = cycles(5)
    y[cycle == 2] = 1e9
    unseen = estimator.fit(T, y, cycle=np.where(cycle == 2, -1, cycle)).freeze(target="dx")
    without = estimator.fit(T[cycle != 2], y[cycle != 2], cycle=cycle[cycle != 2]).freeze(target="dx")
    assert unseen == without


def test_one_standard_error_rule() -> None:
    rms = np.array([[[3.0, 3.2], [1.3, 1.1], [0.9, 1.3]], [[9.0, 9.0], [2.0, 2.0], [2.0, 2.0]]])
    assert choose(rms, "minimum") == (0, 2)
    assert choose(rms, "one-standard-error") == (0, 1)
    assert choose(rms[::-1], "one-standard-error") == (1, 1)
    with pytest.raises(InputError, match="rule 'best'"):
        choose(rms, "best")  # type: ignore[arg-type]


def test_sparse_regressions_tell_what_they_kept() -> None:
    rng = np.random.default_rng(6)
    X = rng.normal(size=(200, 8))
    y = 5 * X[:, 2] - 3 * X[:, 6] + 0.1 * rng.normal(size=200)
    lasso = Lasso().fit(X, y)
    assert lasso.selected_ == ("x2", "x6")
    assert lasso.freeze(target="dx").sensors == ("x2", "x6")
    twins = np.column_stack([X, X[:, 2]])
    both = ElasticNet(l1_ratios=(0.1, 0.5)).fit(twins, y)
    assert {"x2", "x8"} <= set(both.selected_)
    assert both.l1_ratio_ in (0.1, 0.5)
    assert both.coef_[2] == pytest.approx(both.coef_[8], rel=1e-2)  # together, not one of them


def test_statistics_count_the_coefficients() -> None:
    T, y, cycle = cycles(7)
    m = Lasso().fit(T, y, cycle=cycle)
    residual = y - m.predict(T)
    left = len(y) - len(m.selected_) - 1
    assert m.r_squared_ == pytest.approx(1 - residual @ residual / np.sum((y - y.mean()) ** 2))
    assert m.standard_error_ == pytest.approx(np.sqrt(residual @ residual / left))
    scaled = (T - T.mean()) / T.std(ddof=0)
    assert m.condition_ == pytest.approx(np.linalg.cond(scaled), rel=1e-6)
    assert m.n_rows_ == len(y)


@pytest.mark.long
def test_collinear_channels_of_a_real_machine(shared_data: Path) -> None:
    """fl_thermal, the last two cycles unseen: all shrink the error of plain least squares to a third, and below 3 um.

    Not among them is the traversal, which uses at most four of the 16 temperatures: 3.01 um.
    """
    table = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")
    X = table.filter(regex=r"^t\d+_C$")
    X = X - X.iloc[0]
    cycle = np.searchsorted([1951, 3871, 5791, 7711], np.arange(len(X)), side="right")
    cycle[6669:] = -1
    channels = [table[f"ch{k}_um"].to_numpy() for k in range(1, 6)]
    plain = [np.abs(y - LeastSquares().fit(X[:6669], y[:6669]).predict(X))[6669:].mean() for y in channels]
    for estimator in (e for e in LINEAR if not isinstance(e, TraversedComponents)):
        errors = [np.abs(y - estimator.fit(X, y, cycle=cycle).predict(X))[6669:].mean() for y in channels]
        assert np.mean(errors) < min(np.mean(plain) / 3, 3.0)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", [*LINEAR, *THROUGH_ZERO], ids=str)
def test_bad_but_possible_input(estimator: ShrunkRegressor) -> None:
    rng = np.random.default_rng(8)
    a = np.round(rng.normal(size=(60, 1)) * 3, 1) + 3  # steps of 0.1 degC, with ties
    X = np.hstack([a, a, np.full((60, 1), 20.0), np.zeros((60, 1)), rng.normal(size=(60, 1))])
    y = 4 * a[:, 0] + 0.01 * rng.normal(size=60)
    assert np.abs(estimator.set_params(rule="minimum").fit(X, y).predict(X) - y).max() < 1.0
    if estimator.fit_intercept:
        assert estimator.dependent_ == ("x2", "x3")
        assert estimator.coef_[2] == 0
    assert estimator.coef_[3] == 0
    wide = rng.normal(size=(12, 30))
    assert np.isfinite(estimator.fit(wide, wide[:, 3] * 5).predict(wide)).all()
    flat = estimator.fit(X[:, :2], np.full(60, 5.0)).predict(X[:, :2])
    assert flat == pytest.approx(5.0) if estimator.fit_intercept else np.isfinite(flat).all()
    dead = estimator.fit(np.ones((10, 2)), np.arange(10.0))
    assert np.isfinite(dead.predict(np.ones((2, 2)))).all()
    assert np.isfinite(estimator.fit(X[:2], y[:2]).predict(X)).all()  # fewer rows than parameters
    estimator.set_params(rule="one-standard-error")


@pytest.mark.parametrize("estimator", [*LINEAR, GaussianProcess()], ids=str)
def test_bad_input_is_refused(estimator: ThermalRegressor) -> None:
    X, y = np.random.default_rng(9).normal(size=(20, 3)), np.arange(20.0)
    spoiled = X.copy()
    spoiled[4, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        estimator.fit(spoiled, y)
    with pytest.raises(ValueError, match="1 sample"):
        estimator.fit(X[:1], y[:1])
    if isinstance(estimator, ShrunkRegressor):
        with pytest.raises(FitError, match="no training rows"):
            estimator.fit(X, y, cycle=np.full(20, -1))
        with pytest.raises(FitError, match="only one training row"):
            estimator.fit(X, y, cycle=np.r_[0, np.full(19, -1)])
        with pytest.raises(InputError, match="cycle: expected 20 numbers"):
            estimator.fit(X, y, cycle=[0, 1])


@pytest.mark.parametrize(
    ("estimator", "text"),
    [
        (Ridge(strengths=()), "strengths .*: expected positive numbers"),
        (Lasso(strengths=(0.1, -1.0)), "strengths .*: expected positive numbers"),
        (Ridge(strengths=(0.1, float("nan"))), "strengths .*: expected positive numbers"),
        (ElasticNet(l1_ratios=(0.0, 0.5)), "l1_ratios .*: expected numbers above 0"),
        (PrincipalComponents(max_components=0), "max_components 0: expected at least 1"),
        (PartialLeastSquares(max_components=-2), "max_components -2: expected at least 1"),
        (Ridge(rule="oracle"), "rule 'oracle'"),  # type: ignore[arg-type]
        (GaussianProcess(max_rows=1), "max_rows 1: expected at least 2"),
    ],
    ids=str,
)
def test_bad_settings_are_refused(estimator: ThermalRegressor, text: str) -> None:
    X = np.random.default_rng(10).normal(size=(20, 3))
    with pytest.raises(InputError, match=text):
        estimator.fit(X, X[:, 0])


def test_scaling_tells_constant_columns() -> None:
    X = np.column_stack([np.full(5, 1e6), np.zeros(5), 1e-9 * np.arange(5), 20 + 0.1 * np.arange(5)])
    centre, scale = scaling(X)
    assert np.isinf(scale).tolist() == [True, True, False, False]
    assert ((X - centre) / scale)[:, 2:].std(axis=0) == pytest.approx([1.0, 1.0])


# -- Gaussian process: compared, never deployed ------------------------------------------------------------------------


def test_process_predicts_as_its_library_does() -> None:
    T, y, _ = cycles(11)
    X = T.to_numpy()
    ours = GaussianProcess().fit(X, y)
    centre, scale = X.mean(axis=0), X.std(axis=0)
    theirs = GaussianProcessRegressor(ours.kernel_, optimizer=None, normalize_y=True).fit((X - centre) / scale, y)
    fresh = X[::7] + 0.3
    assert ours.predict(fresh) == pytest.approx(theirs.predict((fresh - centre) / scale), abs=1e-7 * y.std())
    assert np.array_equal(GaussianProcess().fit(X, y).predict(fresh), ours.predict(fresh))


def test_process_is_thinned_evenly() -> None:
    T, y, _ = cycles(12)
    thinned = GaussianProcess(max_rows=50).fit(T, y)
    rows = np.linspace(0, len(T) - 1, 50).round().astype(int)
    alone = GaussianProcess().fit(T.iloc[rows], y[rows])
    assert thinned.n_rows_ == 50
    assert np.array_equal(thinned.predict(T), alone.predict(T))
    assert (thinned.data_max_ == T.max()).all()


def test_process_bad_but_possible_input() -> None:
    rng = np.random.default_rng(13)
    a = np.round(rng.normal(size=(60, 1)), 1)
    X = np.hstack([a, a, np.full((60, 1), 20.0), np.zeros((60, 1))])
    y = np.sin(a[:, 0])
    assert np.abs(GaussianProcess().fit(X, y).predict(X) - y).max() < 0.05
    assert GaussianProcess().fit(X, np.full(60, 5.0)).predict(X) == pytest.approx(5.0)
    wide = rng.normal(size=(10, 30))
    assert np.isfinite(GaussianProcess().fit(wide, wide[:, 0]).predict(wide)).all()


def test_process_cannot_be_frozen_nor_written(samples: Samples) -> None:
    T, y, _ = cycles(14)
    fitted = GaussianProcess(max_rows=40).fit(T, y)
    assert not GaussianProcess.freezable
    assert Ridge.freezable
    with pytest.raises(FitError, match=r"gp cannot be stored as coefficients: .* 40 training rows .* deploy another"):
        fitted.freeze(target="dx")
    model = fitted.unfrozen(target="dx")
    with pytest.raises(ModelFileError, match="model of dx: the family 'estimator' cannot be stored as coefficients"):
        modelfile.dumps([model])
    assert model == GaussianProcess(max_rows=40).fit(T, y).unfrozen(target="dx")
    assert pickle.loads(pickle.dumps(model)) == model  # compare may share its work among processes
    assert model != GaussianProcess(max_rows=40).fit(T, y + T["T1"]).unfrozen(target="dx")
    assert model.sensors == tuple(T.columns)
    assert model.coefficients_by_name() == {}
    assert model.formula() == "gp of T1, T2, T3, T4, T5, T6: no formula"
    batch = np.stack([T.to_numpy()[:7], T.to_numpy()[7:14]])
    _, deviation = model.step(model.init(np.zeros(6)), batch, 1.0)
    assert deviation.ravel() == pytest.approx(fitted.predict(T[:14]), rel=1e-10)


def test_process_is_judged_beside_the_others(samples: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "gp", Method("gp", "Gaussian process", "thermocomp.models.gp:GaussianProcess"))
    judging = splits.parse("0.75/0.25", samples)
    result = compare(samples, ["ols", "gp"], judging)
    for a in result.overall():
        assert a.failure == ""
        assert a.metric("rms") < 0.5 * a.none_metric("rms")
        assert a.robustness is not None
        assert set(a.robustness.lost_rms) == {"t1_C", "t2_C", "t3_C"}
    everything = np.ones(len(samples), np.bool_)
    trained = train("gp", samples, 0, everything)
    expected = trained.estimator.predict(samples.frame()[["t1_C", "t2_C", "t3_C"]])
    assert np.abs(replay(trained.model, samples, everything)[0] - expected).max() < 1e-10 * np.abs(expected).max()

    def never(*_: object, **__: object) -> None:
        raise AssertionError("the work must not start")

    monkeypatch.setattr(study, "compare", never)
    with pytest.raises(InputError, match="gp cannot be stored as coefficients: judge it with 'compare'"):
        study.fit(samples, "gp", judging)


@pytest.mark.parametrize("make", [PartialLeastSquares, PrincipalComponents])
def test_number_of_components_can_be_given(make: type[PartialLeastSquares | PrincipalComponents]) -> None:
    rng = np.random.default_rng(8)
    X = rng.normal(size=(120, 4)) * [3, 2, 1, 0.5]
    y = X @ [1.0, -2.0, 0.5, 3.0] + rng.normal(size=120)
    groups = np.arange(120) // 20
    for k in (1, 2, 4):
        given = make(components=k).fit(X, y)
        chosen = make(max_components=k, rule="minimum").fit(X, y)
        assert given.n_components_ == k
        if chosen.n_components_ == k:
            np.testing.assert_allclose(given.coef_, chosen.coef_)
    assert make(components=9).fit(X, y).n_components_ == 4
    search = GridSearchCV(make(), {"components": [1, 2, 3, 4]}, cv=LeaveOneGroupOut()).fit(X, y, groups=groups)
    assert search.best_params_["components"] > 1
    with pytest.raises(InputError):
        make(components=-1).fit(X, y)
