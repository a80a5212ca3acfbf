"""The regressions as estimators: scikit-learn's contract, freezing, logs, and bad input."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import effective_sample_size, lstsq
from thermocomp.models.ols import LeastSquares
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression

FloatArray = NDArray[np.float64]

ALL = [LeastSquares(), PartialF(), SecondOrderRegression(), SecondOrderRegression(fit_intercept=True, hierarchy=True)]


@parametrize_with_checks([*ALL, DynamicRidge(time="none"), DynamicRidge(time="none", fit_intercept=True)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def drift(seed: int = 0, n: int = 300) -> tuple[pd.DataFrame, FloatArray]:
    """Nine temperature rises like Chen's, and a drift like his Eq. 5 [um] with 0.5 um of noise."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 6, n)[:, None]
    rises = 12 * (1 - np.exp(-time / rng.uniform(0.5, 4, 9))) * rng.uniform(0.3, 1, 9) * np.sin(time / 2 + 1) ** 2
    T = pd.DataFrame(rises + 0.05 * rng.normal(size=rises.shape), columns=[f"T{i}" for i in range(1, 10)])
    gradient = T["T6"] - T["T7"]
    y = -0.6 * T["T2"] + 7.5 * T["T3"] - 37 * gradient + 10.8 * (T["T8"] - T["T9"]) + 2.5 * T["T2"] * gradient
    return T, y.to_numpy() + 0.5 * rng.normal(size=n)


CHEN = SecondOrderRegression(differences=(("T6", "T7"), ("T8", "T9")), subset=("T1", "T2", "T3", "T6-T7", "T8-T9"))


@pytest.mark.parametrize(
    "estimator",
    [LeastSquares(), LeastSquares(fit_intercept=False), PartialF(), CHEN, SecondOrderRegression(fit_intercept=True)],
    ids=str,
)
def test_frozen_replay_is_the_prediction(estimator: TermRegressor) -> None:
    T, y = drift()
    fitted = estimator.fit(T, y)
    model = fitted.freeze(target="dx")
    assert model.family == "polynomial"
    state, replayed = model.init(), np.empty(len(T))
    needed = T[[i.name for i in model.inputs]]
    for k, row in enumerate(needed.to_numpy()):
        state, deviation = model.step(state, row, 10.0)
        replayed[k] = deviation
    predicted = fitted.predict(T)
    np.testing.assert_allclose(replayed, predicted, rtol=1e-12, atol=1e-12 * np.abs(predicted).max())
    assert tuple(needed.columns) == model.sensors  # what was not selected is not asked for
    assert [i.low for i in model.inputs] == needed.min().tolist()
    assert [i.high for i in model.inputs] == needed.max().tolist()
    assert all((i.quantity, i.unit, i.reference, i.rezero) == ("dimensionless", "1", 0.0, False) for i in model.inputs)


def test_freeze_with_own_inputs() -> None:
    T, y = drift()
    fitted = SecondOrderRegression(differences=(("x5", "x6"),), subset=("x1", "x2", "x5-x6")).fit(T.to_numpy(), y)
    inputs = [Input(f"t{i}", "temperature", "degC", 20.0, rezero=True, low=-5, high=15) for i in range(9)]
    model = fitted.freeze(target="dx", unit="um", inputs=inputs, support=Support("hold"))
    assert model.support.policy == "hold"
    assert model.sensors == tuple(i.name for i in model.inputs) == ("t1", "t2", "t5", "t6")
    assert "(t5-t6)" in model.formula()
    _, deviation = model.step(model.init([20.0] * 4), T.to_numpy()[100, [1, 2, 5, 6]] + 20, 0.0)
    assert deviation == pytest.approx(fitted.predict(T.to_numpy()[[100]])[0], rel=1e-12)
    with pytest.raises(InputError, match="8 inputs given, but the model was fitted to 9: x0, x1"):
        fitted.freeze(target="dx", inputs=inputs[1:])


@pytest.mark.parametrize("estimator", [PartialF(f_enter=10, f_delete=5), CHEN, LeastSquares()], ids=str)
def test_statistics_are_those_of_the_residual(estimator: TermRegressor) -> None:
    T, y = drift(1)
    m = estimator.fit(T, y)
    residual = y - m.predict(T)
    k, constant = len(m.terms_), int(m.r_squared_kind_ == "centred")
    total = np.sum((y - y.mean() * constant) ** 2)
    rss = residual @ residual
    assert m.r_squared_ == pytest.approx(1 - rss / total)
    assert m.standard_error_ == pytest.approx(np.sqrt(rss / (len(y) - k - constant)))
    assert 1 - m.adjusted_r_squared_ == pytest.approx(
        (1 - m.r_squared_) * (len(y) - constant) / (len(y) - k - constant)
    )
    assert 1 <= m.n_effective_ <= len(y)
    assert len(m.coef_) == k
    # five rows and five coefficients leave nothing to judge the fit by; a residual of zero repeats nothing
    whole = LeastSquares().fit(np.random.default_rng(0).normal(size=(5, 4)), np.arange(5.0) ** 2)
    assert np.isnan([whole.standard_error_, whole.adjusted_r_squared_]).all()
    assert effective_sample_size(np.zeros(50)) == 50
    six = np.random.default_rng(0).normal(size=(6, 4))
    one_left = LeastSquares().fit(six, np.arange(6.0) ** 2)  # one degree of freedom
    residual = np.arange(6.0) ** 2 - one_left.predict(six)
    assert one_left.standard_error_ == pytest.approx(np.sqrt(residual @ residual))
    assert 1 - one_left.adjusted_r_squared_ == pytest.approx(5 * (1 - one_left.r_squared_))
    small = LeastSquares().fit(T, 1e-6 * y)
    assert small.r_squared_ == pytest.approx(LeastSquares().fit(T, y).r_squared_)


@pytest.mark.parametrize("n", [10, 37, 300])
def test_effective_sample_size_by_hand(n: int) -> None:
    """C-19, E-C12: the autocorrelations before the first that is not positive, added up one by one."""
    noise = np.random.default_rng(n).normal(size=n)
    for memory in (0.0, 0.8, 0.99):
        residual = noise.copy()
        for k in range(1, n):
            residual[k] += memory * residual[k - 1]
        r = residual - residual.mean()
        total = 0.0
        for lag in range(1, n):
            covariance = float(r[lag:] @ r[:-lag])
            if covariance <= 0:
                break
            total += covariance / float(r @ r)
        for scale in (1.0, 1e-3):
            assert effective_sample_size(scale * residual) == pytest.approx(n / (1 + 2 * total), rel=1e-9)


@pytest.mark.parametrize(
    ("subset", "terms"),
    [
        (("T1", "T2", "T3", "T6-T7", "T8-T9"), 20),
        (("T1", "T2", "T3", "T4", "T5", "T6-T8", "T7-T9"), 35),
        (("T1", "T2", "T3", "T6-T8", "T7-T9"), 20),
        (tuple(f"T{i}" for i in range(1, 10)), 54),
    ],
)
def test_number_of_terms(subset: tuple[str, ...], terms: int) -> None:
    # C-10, C-13
    T, y = drift()
    pairs = (("T6", "T7"), ("T8", "T9"), ("T6", "T8"), ("T7", "T9"))
    m = SecondOrderRegression(differences=pairs, subset=subset).fit(T, y)
    assert m.variables_ == subset
    assert len(m.candidates_) == terms
    assert m.intercept_ == 0.0


def test_chens_form_is_found_again() -> None:
    T, y = drift(2, 810)
    m = SecondOrderRegression(
        alpha_enter=1e-6, alpha_remove=1e-5, differences=CHEN.differences, subset=CHEN.subset
    ).fit(T, y)
    assert {"T2", "T3", "(T6-T7)", "(T8-T9)", "T2*(T6-T7)"} <= set(m.terms_)
    truth = np.asarray(T.eval("-0.6*T2 + 7.5*T3 - 37*(T6-T7) + 10.8*(T8-T9) + 2.5*T2*(T6-T7)"))
    assert np.sqrt(np.mean((m.predict(T) - truth) ** 2)) < 0.1
    assert m.standard_error_ == pytest.approx(0.5, rel=0.1)
    columns = np.column_stack([np.asarray(T.eval(t)) for t in m.terms_])
    np.testing.assert_allclose(m.coef_, lstsq(columns, y, intercept=False).coefficients, rtol=1e-9)


def test_linear_terms_only_and_hierarchy() -> None:
    # C-23 and C-21
    T, y = drift()
    linear = SecondOrderRegression(subset=("T1", "T3", "T4"), second_order=False).fit(T, y)
    assert linear.candidates_ == ("T1", "T3", "T4")
    strict = SecondOrderRegression(hierarchy=True).fit(T, y)
    factors = {f for t in strict.terms_ for f in t.split("*")}
    assert any("*" in t for t in strict.terms_)
    assert factors <= set(strict.terms_)


def test_partial_f_on_measured_data(shared_data: Path) -> None:
    # E-T3: with the paper's thresholds the number of sensors is a matter of the number of rows, down to none
    data = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")
    T = data.filter(regex=r"^t\d+_C$")
    T = T - T.iloc[0]

    def sensors(step: int, channel: str) -> int:
        return len(PartialF().fit(T[::step], data[channel][::step]).selected_)

    assert [sensors(23, c) for c in ("ch3_um", "ch1_um", "ch2_um")] == [5, 3, 0]
    assert all(sensors(1, c) >= 9 for c in ("ch3_um", "ch1_um", "ch2_um"))


def test_nothing_enters() -> None:
    rng = np.random.default_rng(3)
    X, y = rng.normal(size=(50, 4)), rng.normal(size=50) + 7
    m = PartialF().fit(X, y)
    assert (m.selected_, m.terms_, m.log_) == ((), (), ())
    np.testing.assert_allclose(m.predict(X), y.mean())
    assert m.r_squared_ == pytest.approx(0, abs=1e-12)
    frozen = m.freeze(target="dx")
    assert frozen.sensors == ()
    assert frozen.inputs == ()
    assert frozen.step(frozen.init(), X[:, :0], 0.0)[1] == pytest.approx(m.predict(X))
    assert "NONE" in m.log_text()
    assert (SecondOrderRegression(alpha_enter=1e-30).fit(X, y - y.mean()).predict(X) == 0).all()


def test_log_text_in_the_style_of_systat() -> None:
    # C-16
    T, y = drift()
    m = CHEN.fit(T, y)
    text = m.log_text("X")
    assert text.startswith("STEPWISE REGRESSION WITH ALPHA-TO-ENTER= .001 AND ALPHA-TO-REMOVE= .015\n")
    steps = re.findall(
        r"^STEP=\s*(\d+)  (ENTER|REMOVE)\s+(\S+)\s+R= (\S+)  RSQUARE= (\S+)  F= (\S+)", text, re.MULTILINE
    )
    assert [(int(n), a.lower(), t) for n, a, t, *_ in steps] == [(s.number, s.action, s.term) for s in m.log_]
    for (*_, r, r2, f), s in zip(steps, m.log_, strict=True):
        assert float(r) == pytest.approx(s.r, abs=6e-4)
        assert s.r == pytest.approx(np.sqrt(s.r_squared))
        assert float(r2) == pytest.approx(s.r_squared, abs=6e-4)
        assert float(f) == pytest.approx(s.f, rel=1e-3)
        assert not r.startswith("0")
    head = text.split("THE SUBSET MODEL INCLUDES THE FOLLOWING PREDICTORS:")[1]
    assert re.split(r",\s+", head.split("DEP VAR")[0].strip()) == list(m.terms_)
    assert re.search(r"DEP VAR: X   N: 300   MULTIPLE R: \S+   SQUARED MULTIPLE R: \S+$", text, re.MULTILINE)
    error = re.findall(r"STANDARD ERROR OF ESTIMATE: (\S+)", text)
    assert float(error[0]) == pytest.approx(m.standard_error_, abs=6e-4)
    assert "R-SQUARES ARE UNCENTRED" in text
    rows = dict(re.findall(r"^(\S+)\s+(-?[\d.e+-]+)$", text.split("COEFFICIENT\n")[1], re.MULTILINE))
    assert list(rows) == list(m.terms_)
    np.testing.assert_allclose([float(v) for v in rows.values()], m.coef_, rtol=1e-5)
    told = {w: float(v) for w, v in re.findall(r"(SQUARED MULTIPLE R|MULTIPLE R|SAMPLE SIZE): (\S+)", text)}
    # the adjusted one is the last of its name
    numbers = (np.sqrt(m.r_squared_), m.adjusted_r_squared_, m.n_effective_)
    for name, value in zip(("MULTIPLE R", "SQUARED MULTIPLE R", "SAMPLE SIZE"), numbers, strict=True):
        assert told[name] == pytest.approx(value, abs=0.051 if name == "SAMPLE SIZE" else 6e-4)


def test_predictors_are_wrapped_between_names() -> None:
    """C-16: as many as fit into 100 columns; a name is never divided."""
    m = PartialF().fit(*drift())
    for names, lines in (
        (("a" * 49, "b" * 48, "c"), (2, 1)),  # 49 + 48 + 3 are 100
        (("a" * 49, "b" * 49, "c"), (1, 2)),
        (("front-" * 20 + "x", "c"), (1, 1)),
        (("d" * 130,), (1,)),
    ):
        m.terms_, m.coef_ = names, np.arange(float(len(names)))
        wrapped = m.log_text().split("FOLLOWING PREDICTORS:\n\n")[1].split("\n\n")[0].splitlines()
        assert tuple(len(line.strip(",").split(", ")) for line in wrapped) == lines


def test_log_text_tells_what_f_means() -> None:
    # E-T3
    T, y = drift(0, 199)
    text = PartialF().fit(T, y).log_text()
    assert "F-TO-ENTER= 100 AND F-TO-DELETE= 50" in text
    assert "AT N= 199" in text
    assert "A FIRST VARIABLE NEEDS RSQUARE= 0.34" in text
    assert re.search(r"^CONSTANT\s+\S+$", text, re.MULTILINE)
    assert "R-SQUARES ARE CENTRED" in text


def test_effective_sample_size_of_a_slow_residual() -> None:
    # E-C12: what a regression leaves of a drift test is not white
    T, y = drift()
    slow = np.sin(np.linspace(0, 25, len(y)))
    assert PartialF().fit(T, y + 5 * slow).n_effective_ < 60
    assert LeastSquares().fit(T, np.random.default_rng(4).normal(size=len(y))).n_effective_ > 150


@pytest.mark.parametrize("estimator", ALL, ids=str)
def test_bad_but_possible_input(estimator: TermRegressor) -> None:
    rng = np.random.default_rng(5)
    a = rng.normal(size=(40, 1)) + 3
    X = np.hstack([a, a, np.full((40, 1), 20.0), np.zeros((40, 1)), rng.normal(size=(40, 1))])
    y = 4 * a[:, 0] + 0.01 * rng.normal(size=40)
    fitted = estimator.fit(X, y)
    assert np.isfinite(fitted.coef_).all()
    assert np.abs(fitted.predict(X) - y).max() < 0.1
    wide = rng.normal(size=(12, 30))
    assert np.isfinite(estimator.fit(wide, wide[:, 3] * 5).predict(wide)).all()
    constant = estimator.fit(X[:, :2], np.full(40, 5.0))
    assert np.isfinite(constant.predict(X[:, :2])).all()


@pytest.mark.parametrize("estimator", ALL, ids=str)
def test_bad_input_is_refused(estimator: TermRegressor) -> None:
    X, y = np.random.default_rng(6).normal(size=(20, 3)), np.arange(20.0)
    X[4, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        estimator.fit(X, y)
    with pytest.raises(ValueError, match="1 sample"):
        estimator.fit(X[:1], y[:1])


def test_bad_settings_are_refused() -> None:
    T, y = drift()
    with pytest.raises(InputError, match=r"F-to-enter 10.* F-to-delete 20"):
        PartialF(f_enter=10, f_delete=20).fit(T, y)
    with pytest.raises(InputError, match="alpha-to-enter"):
        SecondOrderRegression(alpha_enter=0.1, alpha_remove=0.05).fit(T, y)
    with pytest.raises(InputError, match="no input is named 'T99'; the inputs are T1, T2"):
        SecondOrderRegression(differences=(("T1", "T99"),)).fit(T, y)
    with pytest.raises(InputError, match="no variable is named 'T6-T7'; the variables are T1, T2"):
        SecondOrderRegression(subset=("T1", "T6-T7")).fit(T, y)
