"""Chen's study: which nets, starts, days, drifts and states are judged, drawn and printed."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.ols import LeastSquares
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import drift, equation5, law, screening, setup, slope
from thermocomp.papers.chen1996.slope import LearnedPositioning
from thermocomp.volumetric.models.positionoptions import PositionOptions

# -- nets of the drifts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("with_25", "with_30", "better"),
    [(3.1, 3.1, []), (2.9, 3.1, [25]), (3.1, 2.9, [30]), (2.9, 2.9, [25, 30])],
)
def test_only_more_nodes_refute_the_number_of_nodes(with_25: float, with_30: float, better: list[int]) -> None:
    """C-26: any number above 20 that gains more than the scatter of the starts, 1 um here; fewer nodes are none."""
    errors = {f"9-{h}-3": 0.1 for h in (5, 10, 15)} | {"9-25-3": with_25, "9-30-3": with_30}
    found: Any = SimpleNamespace(nets=[SimpleNamespace(mean=m) for m in (3.0, 4.0, 5.0)], mean_of=errors.__getitem__)
    facts = drift._nodes(found)
    assert (facts["mean"], facts["spread"], facts["above"]) == (4.0, 1.0, {25: with_25, 30: with_30})
    assert (facts["better"], facts["holds"]) == (better, not better)


def test_each_net_has_its_nodes_and_starting_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-26, C-28, C-30: in each kind one net for each start, with the nodes of its name."""
    monkeypatch.setattr(drift, "_train", lambda net, _: SimpleNamespace(net=net))
    found = drift.learn(0, lambda _: None)
    assert [(n.net.hidden, n.net.seed) for n in found.nets] == [(20, start) for start in range(5)]
    nodes = {f"9-{h}-3": h for h in (5, 10, 15, 25, 30)} | {"common scaling": 20, "batch update": 20}
    assert {kind: [(n.net.hidden, n.net.seed) for n in nets] for kind, nets in found.others.items()} == {
        kind: [(h, start) for start in range(3)] for kind, h in nodes.items()
    }


# -- statistics of the drifts ------------------------------------------------------------------------------------------


def fitted(**given: Any) -> Any:
    """Return a regression as the claims and tables see it."""
    told = {"r_squared_": 0.98, "adjusted_r_squared_": 0.5, "standard_error_": 1.5, "n_effective_": 33.0}
    return SimpleNamespace(**told | {"terms_": ("T2",), "coef_": np.ones(1), "log_": ()} | given)


@pytest.mark.parametrize("loose", ["x", "y", "z"])
def test_one_drift_that_is_not_fitted_closely_refutes_it(loose: str) -> None:
    """C-19: R2 of each, and the standard errors of estimate."""
    regressions = {t: fitted(r_squared_=0.972 if t == loose else 0.974, standard_error_=k) for k, t in enumerate("xyz")}
    found: Any = SimpleNamespace(regressions=regressions, ranges=dict.fromkeys("xyz", 9.0))
    (claim,) = drift.claims.judged("closely", found)
    assert claim.holds is False
    assert claim.ours == " / ".join(f"{r.r_squared_:.3f}" for r in regressions.values())
    assert f"do not explain {loose} that well: standard error of estimate 0.00 / 1.00 / 2.00 um" in claim.finding


def test_statistics_and_errors_stand_in_their_columns() -> None:
    """C-19, C-31: R2 and standard error beside the printed ones; the errors of the nets in x, y, z, and their mean."""
    one = dict(zip("xyz", (1.0, 2.0, 6.0), strict=True))
    found: Any = SimpleNamespace(
        regressions={t: fitted() for t in "xyz"},
        candidates=one,
        terms=one,
        mra=one,
        net=one,
        nets=[SimpleNamespace(mae=one), SimpleNamespace(mae={t: 2 * e for t, e in one.items()})],
        others={},
    )
    fits, _, _, _, nets = drift.tables(found)
    column = {heading: k for k, heading in enumerate(fits.header)}
    cells = [fits.rows[0][column[h]] for h in ("R2", "SEE [um]", "effective rows")]
    assert cells == ["0.980 (0.988)", "1.50 (10.6)", "33"]
    assert [list(row) for row in nets.rows] == [["9-20-3", "2", "1.50", "3.00", "9.00", "4.50"]]


def test_extremes_of_the_starts_are_those_of_each_drift() -> None:
    """C-31."""
    errors = {"x": np.array([2.0, 1.0, 3.0]), "y": np.array([5.0, 4.0, 6.0]), "z": np.array([8.0, 9.0, 7.0])}
    found: Any = SimpleNamespace(mae_net=errors.__getitem__)
    assert drift._starts(found)["extremes"] == [("x", 1.0, 3.0), ("y", 4.0, 6.0), ("z", 7.0, 9.0)]


def test_what_is_told_beside_equation_5_is_of_x(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-19."""
    samples = setup.drift_samples(setup.recordings("chen1996", 0))
    monkeypatch.setattr(equation5, "impose", lambda *_: None)
    regressions = {t: SimpleNamespace(standard_error_=k) for k, t in enumerate("zxy")}
    found = equation5.seek(SimpleNamespace(samples=samples, regressions=regressions), 0)  # type: ignore[arg-type]
    assert found.standard_error == 1
    np.testing.assert_array_equal(found.moves, samples.deviations[:, 0])


# -- first screening ---------------------------------------------------------------------------------------------------


def test_every_drift_is_modelled_by_those_left() -> None:
    """C-11: x, y and z each by its own regression on the nine; T5 is told by its own correlation."""
    tests = setup.recordings("chen1996", 3)
    samples = setup.drift_samples(tests)
    some = {t: common.fit_and_freeze(LeastSquares(), samples.only(["T2"]), [t])[t] for t in setup.DRIFTS}
    learned: Any = SimpleNamespace(samples=samples, models=some, wide=some)
    found = screening.learn(3, 4, learned)
    few = common.stacked(tests, tuple(setup.DRIFTS), found.kept)
    new = common.stacked(
        setup.recordings("chen1996-new", 4), tuple(setup.DRIFTS), [*dict.fromkeys(("T2", *found.kept))]
    )
    for t in setup.DRIFTS:
        ours = common.fit_and_freeze(SecondOrderRegression(), few, [t])[t]
        assert found.errors[t]["screening"] == pytest.approx(common.rms(common.residual(ours, new)), rel=1e-6)
        assert found.errors[t]["Table 2"] == pytest.approx(common.rms(common.residual(some[t], new)), rel=1e-6)
    average = samples.change()[:, 4]
    expected = [np.corrcoef(average, y)[0, 1] for y in samples.deviations.T]
    assert list(found.average) == pytest.approx(expected, abs=1e-9)


# -- slopes ------------------------------------------------------------------------------------------------------------


def test_each_net_of_the_slope_has_its_own_start_and_the_median_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-27: 5-8-1, from five starting weights; of the errors after training 5, 1, 4, 2, 3 the fifth is the median."""
    given: list[PositionOptions] = []

    def fit(_: Any, options: PositionOptions) -> Any:
        given.append(options)
        seed = options.method.seed if isinstance(options.method, SigmoidNet) else 0
        method = SimpleNamespace(loss_history_=[9.0, (5.0, 1.0, 4.0, 2.0, 3.0)[seed]], seed=seed)
        return SimpleNamespace(trained=[SimpleNamespace(estimator=method)])

    monkeypatch.setattr(slope, "fit_position", fit)
    monkeypatch.setattr(law, "seek", lambda _: None)
    found: Any = slope.learn(1, 2)
    asked = [o for o in given if isinstance(o.method, SigmoidNet)]
    assert sorted((o.method.hidden, o.method.seed) for o in asked) == [(8, k) for k in range(5)]  # type: ignore[union-attr]
    assert {o.inputs for o in asked} == {setup.SLOPE_VARIABLES}
    assert [n.trained[0].estimator.seed for n in found.nets] == [0, 1, 2, 3, 4]
    assert found.fits[slope.NET] is found.nets[4]


def test_fits_of_all_nets_and_their_warning_are_told() -> None:
    """C-27: R2 of each net about zero; the warning is that of the net."""
    k1 = np.array([3.0, -4.0])

    def net(share: float) -> Any:
        estimator = SimpleNamespace(predict=lambda _: share * k1, caution_="57 weights", n_parameters_=57)
        samples = SimpleNamespace(frame=lambda: None)
        return SimpleNamespace(trained=[SimpleNamespace(estimator=estimator)], samples=samples)

    found: Any = SimpleNamespace(k1=k1, nets=[net(s) for s in (0.9, 0.5, 1.0)])
    r2 = LearnedPositioning.net_r2.func(found)  # type: ignore[attr-defined]
    assert r2.tolist() == pytest.approx([0.99, 0.75, 1.0])
    assert slope._weights(found)["caution"] == "57 weights"


POSITION = np.arange(0.0, 551.0, 50.0)


def test_the_cold_profile_is_that_of_the_first_day_on_every_day() -> None:
    """C-07: a test that begins warm has a slope from its first profile on."""
    cold, k1 = 0.01 * POSITION - 3.0, np.array([12.0, 30.0, -7.0])
    first, second = (
        SimpleNamespace(position=POSITION, values=cold + 1e-3 * np.outer(k, POSITION)) for k in (k1 - 12.0, k1)
    )
    found: Any = SimpleNamespace(learned=first, other=second, geometric=lambda _: cold)
    np.testing.assert_allclose(LearnedPositioning.slope(found, first), k1 - 12.0, atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(LearnedPositioning.slope(found, second), k1, atol=1e-9)  # type: ignore[arg-type]


def test_errors_of_each_day_and_ours_beside_equation_8(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-07, C-24: residuals of the day that is named; each coefficient beside that of its own term."""
    days = {"learned": 2.0, "another day": 5.0}
    first, second = (SimpleNamespace(position=POSITION, values=np.full((3, 12), v), name=v) for v in days.values())
    monkeypatch.setattr(slope, "residuals", lambda _, day: {slope.NONE: day.values / 2, slope.MRA: day.values / 10})
    monkeypatch.setattr(law, "tables", lambda _: [])
    regression = SimpleNamespace(terms_=("T3", "T4", "(T7-T9)"), coef_=np.array([1.0, 2.0, -3.0]))
    found: Any = SimpleNamespace(
        learned=first, other=second, geometric=lambda _: 0 * POSITION, regression=regression, law=None
    )
    _, coefficients, errors = slope.tables(found)
    assert [list(row) for row in coefficients.rows] == [
        ["T3", "1.000", "0.465"],
        ["T4", "2.000", "2.705"],
        ["(T7-T9)", "-3.000", "-5.589"],
        ["(T6-T8)", "", "3.675"],
    ]
    assert [tuple(row[:3]) for row in errors.rows] == [
        (day, method, f"{share * size:.2f}")
        for day, size in days.items()
        for method, share in ((slope.NONE, 1.0), ("cold profile alone", 0.5), (slope.MRA, 0.1))
    ]


def test_the_regression_elsewhere_is_that_of_the_planted_profiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-24: what the recovered law leaves where all temperatures rise together."""
    monkeypatch.setattr(law, "SigmoidNet", lambda **given: SigmoidNet(n_epochs=20, **given))
    for name, value in {"DAYS": 1, "DRAWS": 2, "FEWER": 2}.items():
        monkeypatch.setattr(law, name, value)
    found = law.seek(5)
    (true,) = law.temperatures("chen1996-slope", 5)
    rise = dict(zip(setup.TEMPERATURES, (true - true[0]).T, strict=True))
    regression: Any = found.fit.trained[0].estimator
    predicted = np.zeros(len(true))
    for term, coefficient in zip(regression.terms_, regression.coef_, strict=True):
        product = np.full(len(true), coefficient)
        for factor in term.split("*"):
            plus, _, minus = factor.strip("()").partition("-")
            product = product * (rise[plus] - (rise[minus] if minus else 0.0))
        predicted += product
    planted = 0.465 * rise["T3"] + 2.705 * rise["T4"] + 3.675 * (rise["T6"] - rise["T8"])
    planted -= 5.589 * (rise["T7"] - rise["T9"])
    assert found.elsewhere["MRA"] == pytest.approx(np.sqrt(np.mean((planted - predicted) ** 2)), rel=1e-6)


def test_profiles_of_figures_1_and_6_are_those_of_their_states() -> None:
    """C-36: yaw and errors of Y along the travel, cold, on the way to the steepest slope, and at the end."""
    rng = np.random.default_rng(36)
    hours, k1 = np.arange(9.0), np.array([0.0, 1.0, 3.0, 4.0, 9.0, 5.0, 4.0, 2.0, 1.0])
    yaw, errors = (
        SimpleNamespace(
            position=POSITION,
            values=rng.normal(size=(9, 12)),
            states=SimpleNamespace(time=3600 * hours),
            slopes=lambda **_: SimpleNamespace(factors=np.ones((9, 2))),
        )
        for _ in range(2)
    )
    fits = {slope.MRA: None, slope.NET: None}
    found: Any = SimpleNamespace(learned=errors, yaw=yaw, k1=k1, fits=fits, predicted=lambda *_: k1)
    figures = {f.key: f for f in slope.figures(found)}
    for key, measured in (("chen1996-fig1", yaw), ("chen1996-fig6", errors)):
        (panel,) = figures[key].panels
        assert [c.label for c in panel.curves] == [f"after {h:.1f} h" for h in (0, 1, 2, 3, 4, 8)]
        for curve, state in zip(panel.curves, (0, 1, 2, 3, 4, 8), strict=True):
            np.testing.assert_array_equal(curve.x, POSITION)
            np.testing.assert_array_equal(curve.y, measured.values[state])
