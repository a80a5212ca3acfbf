"""The nets: scaling, the estimators, and bad input."""

import warnings
from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.neural_network import MLPRegressor
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.network import Network
from thermocomp.files import modelfile
from thermocomp.models import mlp
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.mlp import PATIENCE, HiddenCount, SigmoidNet
from thermocomp.models.mlp_sklearn import SklearnNet
from thermocomp.models.nets import NetRegressor, thin_rows
from thermocomp.models.numerics.backprop import scaling_in, scaling_out, train_net
from thermocomp.models.ols import LeastSquares

FloatArray = NDArray[np.float64]

QUICK = SigmoidNet(hidden=6, n_epochs=300)


@parametrize_with_checks([SigmoidNet(n_epochs=1000), SklearnNet()])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def test_scaling_per_channel_and_common() -> None:
    # C-28
    rng = np.random.default_rng(0)
    X = np.column_stack([rng.uniform(0, 30, 50), rng.uniform(-1, 2, 50), np.full(50, 0.1 + 0.2)])
    y = X[:, 0] - 3
    own = SigmoidNet(n_epochs=1).fit(X, y).input_scaling_(X)
    assert own.min(axis=0) == pytest.approx([0.1, 0.1, 0.5], abs=1e-12)
    assert own.max(axis=0) == pytest.approx([0.9, 0.9, 0.5], abs=1e-12)
    fitted = SigmoidNet(n_epochs=1, scaling="common").fit(X, y)
    common = fitted.input_scaling_(X)
    assert fitted.input_scaling_.gain[0] == fitted.input_scaling_.gain[1]
    assert (common[:, :2].min(), common[:, :2].max()) == (pytest.approx(0.1), pytest.approx(0.9))
    assert (common[:, 2] == 0.5).all()
    low, high = y.min(keepdims=True), y.max(keepdims=True)
    np.testing.assert_allclose(scaling_out(low, high)(scaling_in(low, high)(y[:, None]))[:, 0], y, rtol=1e-13)
    assert (scaling_out(low, low)(np.array([[0.1], [0.5], [0.9]])) == low).all()  # a constant channel keeps its value


def test_thinning_is_even() -> None:
    assert thin_rows(9, 5).tolist() == [0, 2, 4, 6, 8]
    assert thin_rows(4, 10).tolist() == [0, 1, 2, 3]
    X, y = drift(400)
    few = SigmoidNet(n_epochs=50, max_patterns=100).fit(X, y[:, 0])
    assert few.n_patterns_ == 100
    assert few.n_effective_ <= 100
    assert few.data_max_.tolist() == X.max(axis=0).tolist()


# -- estimators --------------------------------------------------------------------------------------------------------


def drift(n: int = 300, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Nine temperature rises, and drifts in x, y, z with products of them [um], 0.2 um of noise."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 6, n)[:, None]
    rises = 12 * (1 - np.exp(-time / rng.uniform(0.5, 4, 9))) * rng.uniform(0.3, 1, 9) * np.sin(2 * time + 1) ** 2
    T = rises + 0.05 * rng.normal(size=rises.shape)
    x = 2 * T[:, 2] + 1.5 * T[:, 1] * (T[:, 5] - T[:, 6])
    y = 3 * T[:, 3] - 0.5 * T[:, 3] ** 2
    z = 5 * T[:, 0] - T[:, 8]
    return T, np.column_stack([x, y, z]) + 0.2 * rng.normal(size=(n, 3))


def rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def replay(model: Network, X: FloatArray) -> FloatArray:
    state, out = model.init(), np.empty(len(X))
    for k, row in enumerate(X):
        state, deviation = model.step(state, row, 10.0)
        out[k] = deviation
    return out


def test_xor() -> None:
    X = np.tile([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]], (25, 1))
    y = (X[:, 0] != X[:, 1]) * 10.0
    assert rms(y - LeastSquares().fit(X, y).predict(X)) == pytest.approx(5.0)
    assert rms(y - SigmoidNet(hidden=4, n_epochs=2000).fit(X, y).predict(X)) < 0.2
    assert rms(y - SklearnNet(hidden=4).fit(X, y).predict(X)) < 0.2


def test_products_of_temperatures_are_learned() -> None:
    # every second row is new
    X, y = drift(600)
    linear = rms(y[1::2, 0] - LeastSquares().fit(X[::2], y[::2, 0]).predict(X[1::2]))
    for net in (SigmoidNet(hidden=12, n_epochs=3000), SklearnNet(hidden=12)):
        assert rms(y[1::2, 0] - net.fit(X[::2], y[::2, 0]).predict(X[1::2])) < 0.5 * linear


def test_three_drifts_with_one_net() -> None:
    # C-26: 9-20-3 has 263 parameters
    X, y = drift()
    fitted = SigmoidNet(n_epochs=300).fit(X, y)
    assert fitted.net_.shape == (9, 20, 3)
    assert fitted.n_parameters_ == 263
    assert len(fitted.loss_history_) == 300
    assert fitted.loss_history_[-1] < 0.2 * fitted.loss_history_[0]
    predicted = fitted.predict(X)
    assert predicted.shape == (300, 3)
    for k in range(3):
        model = fitted.freeze(target="xyz"[k], output=k)
        np.testing.assert_allclose(replay(model, X), predicted[:, k], rtol=0, atol=1e-10)
    for wrong in (None, 3, -1):
        with pytest.raises(InputError, match=r"freeze each separately, with output=0 \.\. 2"):
            fitted.freeze(target="x", output=wrong)


def test_caution_about_more_parameters_than_rows() -> None:
    # C-27: 5-8-1 has 57 parameters for 51 samples
    X, y = drift(51)
    fitted = SigmoidNet(hidden=8, n_epochs=300).fit(X[:, :5], y[:, 0])
    assert fitted.n_parameters_ == 57
    assert fitted.caution_.startswith(
        "the net has 57 weights and thresholds, but its 51 training rows are equivalent to only"
    )
    # seven parameters, and rows of which a straight line leaves white noise
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 1, (500, 1))
    fitted = SigmoidNet(hidden=2, n_epochs=500).fit(x, x[:, 0] + 0.1 * rng.normal(size=500))
    assert fitted.caution_ == ""
    assert fitted.n_effective_ > 100
    # as many rows as parameters, all independent: not more parameters than rows
    x, alternating = np.linspace(0.0, 1.0, 7)[:, None], np.array([1.0, -1, 1, -1, 1, -1, 1])
    fitted = SigmoidNet(hidden=2, n_epochs=1).fit(x, alternating)
    assert (fitted.n_parameters_, fitted.n_patterns_, fitted.n_effective_, fitted.caution_) == (7, 7, 7.0, "")


@pytest.mark.parametrize(
    "estimator", [QUICK, SigmoidNet(hidden=3, n_epochs=50, scaling="common"), SklearnNet()], ids=str
)
def test_frozen_replay_is_the_prediction(estimator: NetRegressor) -> None:
    X, y = drift()
    X = np.insert(X, 3, 21.7, axis=1)  # a sensor that does not move
    fitted = estimator.fit(X, y[:, 0])
    model = fitted.freeze(target="x_um")
    assert isinstance(model, Network)
    used = [f"x{i}" for i in range(10) if i != 3]
    assert [i.name for i in model.inputs] == list(model.sensors) == used  # what is dead is not asked for
    np.testing.assert_allclose(replay(model, np.delete(X, 3, axis=1)), fitted.predict(X), rtol=0, atol=1e-10)
    assert modelfile.loads(modelfile.dumps([model])) == (model,)


def test_saturation() -> None:
    X, y = drift()
    fitted = QUICK.fit(X, y[:, 0])
    low, high = y[:, 0].min(), y[:, 0].max()
    eighth = (high - low) / 8
    far = fitted.predict(np.vstack([X * 100, -X * 100]))
    assert low - eighth - 1e-9 <= far.min()
    assert far.max() <= high + eighth + 1e-9


def test_same_seed_same_weights() -> None:
    X, y = drift()
    for make in (lambda s: SigmoidNet(n_epochs=20, seed=s), lambda s: SklearnNet(max_iter=20, seed=s)):
        assert make(3).fit(X, y).net_ == make(3).fit(X, y).net_
        assert make(3).fit(X, y).net_ != make(4).fit(X, y).net_


def test_rows_outside_the_cycles_are_not_learned() -> None:
    X, y = drift()
    cycle = np.repeat([0, -1, 1], 100)
    spoilt = y[:, 0].copy()
    spoilt[cycle < 0] = 1e6
    learned = cycle >= 0
    assert QUICK.fit(X, spoilt, cycle=cycle).net_ == QUICK.fit(X[learned], y[learned, 0]).net_


def test_sweep_over_the_hidden_nodes() -> None:
    # C-26
    X, y = drift(400)
    cycle = np.repeat(np.arange(4), 100)
    said: list[str] = []
    net = SigmoidNet(hidden=(6, 1, 2, 4), n_epochs=200, jobs=2)
    fitted = net.fit(X, y[:, 1], cycle=cycle, progress=said.append)
    tried = fitted.sweep_
    assert [t.n_hidden for t in tried] == [1, 2, 4, 6][: len(tried)]
    assert len(said) == len(tried) >= 2
    assert said[0] == f"1 hidden nodes: RMS {tried[0].mean:.4g} in 4 thermal cycles, left out in turn"
    assert all(len(t.rms) == 4 for t in tried)
    best = min(tried, key=lambda t: t.mean)
    assert best.standard_error == pytest.approx(np.std(best.rms) / np.sqrt(4 - 1))
    assert fitted.n_hidden_ == next(t.n_hidden for t in tried if t.mean <= best.mean + best.standard_error)
    assert fitted.net_.shape == (9, fitted.n_hidden_, 1)
    # the first fold of the second count, done by hand
    rest = cycle != 0
    again = SigmoidNet(hidden=2, n_epochs=200)._trained(X[rest], y[rest][:, [1]], 2, np.random.default_rng([0, 2, 0]))
    residual = y[~rest][:, [1]] - again[2](again[0].net.evaluate(again[1](X[~rest])))
    assert tried[1].rms[0] == pytest.approx(rms(residual), rel=1e-12)
    assert SigmoidNet(hidden=(6, 1, 2, 4), n_epochs=200, jobs=1).fit(X, y[:, 1], cycle=cycle).sweep_ == tried


def test_sweep_ends_when_there_is_no_gain() -> None:
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(200, 2)), rng.normal(size=200)  # nothing to learn: more nodes only learn noise
    tried = SigmoidNet(hidden=range(1, 30), n_epochs=150, jobs=2).fit(X, y).sweep_
    means = [t.mean for t in tried]
    assert len(tried) < 29
    assert len(tried) - 1 - int(np.argmin(means)) == PATIENCE


@pytest.mark.parametrize("best", [0, 3])
def test_patience_counts_from_the_best(monkeypatch: pytest.MonkeyPatch, best: int) -> None:
    """C-26: as many nodes more as it is patient, wherever the best one was."""
    monkeypatch.setattr(
        "thermocomp.models.mlp.HiddenCount", lambda n, _: HiddenCount(n, (9.0 - n if n <= best + 1 else 9.0 + n,))
    )
    X, y = drift(60)
    fitted = SigmoidNet(hidden=range(1, 20), n_epochs=1, jobs=1).fit(X, y[:, 0], cycle=np.repeat([0, 1], 30))
    assert len(fitted.sweep_) == best + 1 + PATIENCE
    assert fitted.n_hidden_ == best + 1
    assert HiddenCount(3, (2.5,)).standard_error == 0.0
    assert HiddenCount(3, (2.0, 3.0)).standard_error == pytest.approx(0.5)


def test_an_interrupted_sweep_goes_on_with_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    X, y = drift(100)

    def stop(text: str) -> None:
        if text.startswith("2 hidden"):
            raise KeyboardInterrupt

    fitted = SigmoidNet(hidden=(1, 2, 4), n_epochs=20, jobs=1).fit(X, y[:, 0], progress=stop)
    assert [t.n_hidden for t in fitted.sweep_] == [1, 2]
    assert fitted.chosen_by_.endswith("interrupted after 2 hidden nodes")

    def stop_at_once(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("thermocomp.models.mlp.train_net", stop_at_once)
    with pytest.raises(KeyboardInterrupt):
        SigmoidNet(hidden=(1, 2), jobs=1).fit(X, y[:, 0])


def test_scikit_learns_net_is_taken_over_as_it_is() -> None:
    X, y = drift()
    fitted = SklearnNet(hidden=5, activation="tanh", max_iter=30).fit(X, y)
    scaled = (X - X.mean(axis=0)) / X.std(axis=0)
    targets = (y - y.mean(axis=0)) / y.std(axis=0)
    peer = MLPRegressor(hidden_layer_sizes=(5,), activation="tanh", solver="lbfgs", max_iter=30, random_state=0)
    with pytest.warns(match="failed to converge"):
        peer.fit(scaled, targets)
    np.testing.assert_allclose(fitted.predict(X), peer.predict(scaled) * y.std(axis=0) + y.mean(axis=0), atol=1e-6)
    assert not fitted.converged_
    assert fitted.n_iter_ == 30
    assert fitted.caution_.startswith("scikit-learn's solver stopped early: lbfgs failed to converge")
    enough = SklearnNet(hidden=1, alpha=1.0).fit(X, y[:, 2])
    assert enough.converged_
    assert "stopped early" not in enough.caution_


def test_other_warnings_of_scikit_learn_are_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    X, y = drift(50)
    fit = MLPRegressor.fit

    def warning(peer: MLPRegressor, X: FloatArray, y: FloatArray) -> MLPRegressor:
        warnings.warn("Training interrupted by user.", stacklevel=1)
        return fit(peer, X, y)

    monkeypatch.setattr(MLPRegressor, "fit", warning)
    with pytest.warns(UserWarning, match="interrupted by user"):
        SklearnNet(max_iter=5).fit(X, y)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", [QUICK, SklearnNet(max_iter=50)], ids=str)
def test_bad_but_possible_input(estimator: NetRegressor) -> None:
    rng = np.random.default_rng(5)
    a = rng.normal(size=(60, 1)).round(1) + 3  # quantised, with ties; twice, constant, zero
    X = np.hstack([a, a, np.full((60, 1), 20.0), np.zeros((60, 1))])
    y = 4 * a[:, 0]
    assert rms(estimator.fit(X, y).predict(X) - y) < 0.5
    wide = rng.normal(size=(12, 30))
    assert np.isfinite(estimator.fit(wide, wide[:, 3] * 5).predict(wide)).all()
    assert np.isfinite(estimator.fit(wide[:2], wide[:2, 3]).predict(wide)).all()
    still = estimator.fit(X, np.full(60, 5.0))
    assert still.predict(X) == pytest.approx(np.full(60, 5.0), abs=1e-12)
    frozen = still.freeze(target="x")
    assert frozen.sensors == ()
    assert frozen.step(frozen.init(), np.empty(0), 0.0)[1] == pytest.approx(5.0, abs=1e-12)
    for scaling in ("channel", "common"):
        if isinstance(estimator, SigmoidNet):
            estimator = clone(estimator).set_params(scaling=scaling)
        nothing_moves = estimator.fit(X[:, 2:], y)
        assert np.ptp(nothing_moves.predict(X[:, 2:])) == 0


@pytest.mark.parametrize("estimator", [QUICK, SklearnNet()], ids=str)
def test_bad_input_is_refused(estimator: NetRegressor) -> None:
    X, y = drift(20)
    with pytest.raises(ValueError, match="1 sample"):
        estimator.fit(X[:1], y[:1])
    X[4, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        estimator.fit(X, y)


def test_no_row_to_learn_from() -> None:
    X, y = drift(20)
    with pytest.raises(FitError, match="every row has cycle -1"):
        QUICK.fit(X, y, cycle=np.full(20, -1))
    with pytest.raises(FitError, match="expected the same number of rows"):
        train_net(X, y[:5], 3, rng=np.random.default_rng(0), rates=np.ones(1))
    with pytest.raises(FitError, match="finite"):
        train_net(X * np.nan, y, 3, rng=np.random.default_rng(0), rates=np.ones(1))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"hidden": 0}, "0 hidden nodes"),
        ({"hidden": ()}, "expected at least one number of hidden nodes"),
        ({"n_epochs": 0}, "0 epochs"),
        ({"learning_rate": 0.1, "final_learning_rate": 0.2}, "expected at least one epoch and start >= end > 0"),
        ({"schedule": "stepwise"}, "schedule 'stepwise'"),
        ({"update": "online"}, "update 'online'"),
        ({"order": "random"}, "order 'random'"),
        ({"momentum": 1.0}, "momentum 1.0"),
        ({"scaling": "none"}, "scaling 'none'"),
        ({"max_patterns": 1}, "maximum number of patterns 1"),
    ],
)
def test_bad_settings_are_refused(setting: dict[str, Any], message: str) -> None:
    X, y = drift(20)
    with pytest.raises(InputError, match=message):
        SigmoidNet(**setting).fit(X, y)


def test_the_net_is_trained_at_falling_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    trained = Mock(wraps=train_net)
    monkeypatch.setattr(mlp, "train_net", trained)
    x = np.random.default_rng(0).normal(size=(20, 3))
    SigmoidNet(hidden=2, n_epochs=6).fit(x, x[:, 0])
    rates = trained.call_args.kwargs["rates"]
    assert (rates[0], rates[-1]) == (0.5, pytest.approx(0.01))
    assert (np.diff(rates) < 0).all()
