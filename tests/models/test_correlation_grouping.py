"""Correlation grouping as an estimator: contract, freezing, the reference temperature, the text, bad input."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
import twin_grouping as twin
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.files import modelfile
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.numerics.leastsquares import join_columns, lstsq, triangle
from thermocomp.models.selection import exhaustive
from thermocomp.models.selection.collinearity import spectrum
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [CorrelationGrouping(), CorrelationGrouping(threshold=0.3, absolute=True, fit_intercept=False)]
)
def test_contract_of_scikit_learn(estimator: CorrelationGrouping, check: Callable[[CorrelationGrouping], None]) -> None:
    check(estimator)


def hwang(seed: int = 0, n: int = 120) -> tuple[pd.DataFrame, FloatArray]:
    """Fourteen sensors of four heat sources, quantised to 0.1 degC; an error like Eq. 6 [um]."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 6, n)[:, None]
    sources = np.abs(np.sin(time * [0.4, 1.1, 1.9, 2.7] + [0.1, 0.6, 1.1, 1.7])) * [12, 8, 5, 3]
    mixing = np.abs(rng.normal(size=(4, 14))) * (rng.random((4, 14)) < 0.5) + np.eye(4)[:, np.arange(14) % 4]
    rises = np.round(sources @ mixing + 0.2 * rng.normal(size=(n, 14)), 1)
    T = pd.DataFrame(rises - rises[0], columns=[f"T{i}" for i in range(1, 15)])
    d = T.sub(T["T14"], axis=0)
    y = -46.2 + 6.5 * d["T7"] + 1.3 * d["T8"] - 10.4 * d["T2"] + 6.7 * d["T6"]
    return T, y.to_numpy() + rng.normal(size=n)


MODELS = [
    CorrelationGrouping(),
    CorrelationGrouping(reference="T14"),
    CorrelationGrouping(threshold=0.6, reference=3, fit_intercept=False),
    CorrelationGrouping(threshold=0.5, absolute=True),
]


@pytest.mark.parametrize("estimator", MODELS, ids=str)
def test_frozen_replay_is_the_prediction(estimator: CorrelationGrouping) -> None:
    T, y = hwang()
    fitted = estimator.fit(T, y)
    model = fitted.freeze(target="dz")
    predicted = fitted.predict(T)
    state, replayed = model.init(), np.empty(len(T))
    for k, row in enumerate(T[[i.name for i in model.inputs]].to_numpy()):
        state, deviation = model.step(state, row, 60.0)
        replayed[k] = deviation
    np.testing.assert_allclose(replayed, predicted, rtol=0, atol=1e-10)
    (again,) = modelfile.loads(modelfile.dumps([model]))
    assert again == model
    wanted = {T.columns[i] for i in fitted.selected_}
    if fitted.reference is not None:
        wanted.add("T14" if fitted.reference == "T14" else "T4")
    assert set(model.sensors) == wanted


def test_differences_from_the_reference() -> None:
    # H-08: the temperatures are grouped without T14, the regressions are on differences from it
    T, y = hwang()
    found = CorrelationGrouping(reference="T14").fit(T, y)
    assert found.candidates_ == tuple(range(13))
    np.testing.assert_allclose(found.correlation_, np.corrcoef(T.to_numpy()[:, :13].T), atol=1e-12)
    by_hand = CorrelationGrouping().fit(T.iloc[:, :13], y)
    assert found.groups_ == by_hand.groups_
    d = T.iloc[:, :13].sub(T["T14"], axis=0).to_numpy()
    lists = [list(g) for g in found.groups_]
    expected = twin.represented(d, y, lists, True)
    assert list(found.representatives_) == expected
    curve = twin.curve(d, y, expected, True)
    assert [s.columns for s in found.curve_] == [s for _, s in curve]
    _, members = twin.optimum(d, y, lists, min(curve)[1], True)
    assert found.selected_ == tuple(sorted(members))
    assert found.terms_ == tuple(f"(T{i + 1}-T14)" for i in found.selected_)
    chosen = d[:, found.selected_]
    np.testing.assert_allclose(found.coef_, lstsq(chosen, y).coefficients, rtol=1e-9)
    np.testing.assert_allclose(found.contributions_, [np.corrcoef(c, y)[0, 1] for c in chosen.T], atol=1e-11)
    np.testing.assert_allclose(found.spectrum_.eigenvalues, np.linalg.eigvalsh(chosen.T @ chosen)[::-1], rtol=1e-9)
    assert found.mse_ == pytest.approx(found.standard_error_**2, rel=1e-9)


def test_log_text() -> None:
    T, y = hwang()
    found = CorrelationGrouping(reference="T14").fit(T.assign(T5=21.0), y)
    text = found.log_text("Z")
    assert text.startswith("CORRELATION GROUPING OF 12 TEMPERATURES ABOVE 0.9\n(THE SAME GROUPS FROM 0.")
    assert "LEFT OUT BECAUSE CONSTANT: T5\n" in text
    assert text.count("*") == len(found.groups_) + 1
    assert text.count(" YES ") == len(found.participating_) == len(found.selected_)
    assert f"EXAMINED: {2 ** len(found.groups_) - 1} SUBSETS" in text
    assert f"CONDITION NUMBER: {found.spectrum_.condition_number:.3g}" in text
    for name, value in zip(found.terms_, found.coef_, strict=True):
        assert f"{name}  {value:14.6g}".replace(" ", "") in text.replace(" ", "")


def test_bad_but_possible_input() -> None:
    rng = np.random.default_rng(7)
    a, b = rng.normal(size=(2, 40))
    X = np.column_stack([a, a, np.full(40, 20.0), np.zeros(40), b, 3 - a])
    y = 4 * a + b
    found = CorrelationGrouping().fit(X, y)
    assert found.left_out_ == (2, 3)
    assert set(found.groups_) == {(0, 1), (5,), (4,)}
    assert found.selected_ == (0, 4)  # an exact fit takes no more than it needs
    np.testing.assert_allclose(found.predict(X), y, atol=1e-12)
    # with itself as the reference a copy leaves nothing
    copied = CorrelationGrouping(reference=0).fit(X, y)
    assert copied.left_out_ == (1, 2, 3)
    # a constant error: any model of it is the constant
    flat = CorrelationGrouping().fit(X, np.full(40, 5.0))
    np.testing.assert_allclose(flat.predict(X), 5.0)
    assert np.isnan(flat.contributions_).all()
    # fewer rows than sensors
    wide = np.repeat(rng.normal(size=(8, 6)), 3, axis=1)
    np.testing.assert_allclose(CorrelationGrouping().fit(wide, wide[:, 4]).predict(wide), wide[:, 4], atol=1e-12)
    # quantised to 0.1 degC: ties, and the same choice whatever the scale
    T, z = hwang()
    assert CorrelationGrouping().fit(T, z).selected_ == CorrelationGrouping().fit(T * 1024, z).selected_


def test_bad_input_is_refused() -> None:
    X, y = np.random.default_rng(8).normal(size=(20, 3)), np.arange(20.0)
    with pytest.raises(FitError, match="none of the 2 temperatures varies"):
        CorrelationGrouping().fit(np.full((20, 2), 21.5), y)
    with pytest.raises(FitError, match="none of the 0 temperatures varies"):
        CorrelationGrouping(reference=0).fit(X[:, :1], y)
    with pytest.raises(InputError, match="no input is named 'T14'; the inputs are x0, x1, x2"):
        CorrelationGrouping(reference="T14").fit(X, y)
    with pytest.raises(InputError, match="reference 3: expected an index from 0 to 2"):
        CorrelationGrouping(reference=3).fit(X, y)
    with pytest.raises(InputError, match="from -1 to 1"):
        CorrelationGrouping(threshold=90).fit(X, y)
    X[3, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        CorrelationGrouping().fit(X, y)


@pytest.mark.parametrize("seed", range(3))
def test_grouping_lessens_collinearity(seed: int) -> None:
    # H-15, H-16, E-H10, on the virtual machine: without grouping the search takes more sensors, which repeat each other
    (test,) = record("hwang", seed=seed)
    T = test.values(test.temperatures)
    differences, z = T[:, :13] - T[:, [13]], test.values([test.channel("z_um")])[:, 0]
    free = exhaustive.search_subsets(triangle(join_columns(differences, z), intercept=True), range(13)).best
    found = CorrelationGrouping(reference=13).fit(T, z)
    ungrouped = spectrum(differences[:, free.columns])
    assert len(found.selected_) < len(free.columns)
    assert found.mse_ >= free.mse
    assert found.spectrum_.smallest > ungrouped.smallest
    assert found.spectrum_.sum_inverse < ungrouped.sum_inverse / 2
    assert found.spectrum_.condition_number < ungrouped.condition_number


def test_it_is_trained_as_a_method(samples: Samples) -> None:
    assert np.isfinite(train("grouping", samples, 0, samples.valid).predicted).all()
