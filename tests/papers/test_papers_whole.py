"""Estimators and studies of the other papers: what they are given, what they keep, what they print."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.components import BY_CODE
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.partial_f import PartialF
from thermocomp.papers import common, cross
from thermocomp.papers.precompensation import cutting, redo, setup
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017 import setup as stepwise2017_setup
from thermocomp.papers.study import tell_nobody
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.datasets import find_experiment, record

FloatArray = NDArray[np.float64]


# -- precompensation ---------------------------------------------------------------------------------------------------


def test_the_models_know_the_speed_alone() -> None:
    """P-01: the machine has temperatures, the models have none."""
    (test, *_) = record("precompensation", seed=0)
    assert len(test.temperatures) > 0
    samples = setup.samples_of(test)
    assert [c.name for c in samples.inputs] == ["spindle_rpm"]
    for estimator in setup._by_fpe_and_papers(600.0):
        assert estimator.inputs == ("spindle_rpm",)


def test_a_frozen_model_has_the_lags_of_its_estimator() -> None:
    """P-01: a_1 .. a_k and b_0 .. b_m, in this order."""
    rng = np.random.default_rng(0)
    n, z = rng.normal(size=400), np.zeros(400)
    for t in range(2, 400):
        z[t] = 0.5 * z[t - 1] + 0.2 * z[t - 2] + 2.0 * n[t] - 1.0 * n[t - 1] + 0.5 * n[t - 2]
    model: Any = ARX(k=2, m=2, time="routed", interval=60.0).fit(n[:, None], z, dt=np.r_[np.inf, np.full(399, 60.0)])
    frozen: Any = model.freeze(target="z")
    assert frozen.a == pytest.approx((0.5, 0.2), abs=1e-6)
    assert frozen.b[0] == pytest.approx((2.0, -1.0, 0.5), abs=1e-6)
    assert frozen.coefficients_by_name() == pytest.approx(
        {"dz(t-1)": 0.5, "dz(t-2)": 0.2, "x0(t)": 2.0, "x0(t-1)": -1.0, "x0(t-2)": 0.5}, abs=1e-6
    )


def test_orders_are_those_of_the_final_prediction_error() -> None:
    """P-02, E-P2: of the linear model, and of the net, which has the same search; FPE, AIC and BIC differ here."""
    rng = np.random.default_rng(91)
    n, z = rng.normal(size=(22, 1)), np.zeros(22)
    for t in range(1, 22):
        z[t] = 0.7 * z[t - 1] + n[t, 0] + 0.8 * rng.normal()
    dt = np.r_[np.inf, np.full(21, 600.0)]
    model, aic, bic = (
        ARX(time="routed", criterion=c, k_max=4, m_max=4).fit(n, z, dt=dt) for c in ("fpe", "aic", "bic")
    )

    def fpe(o: Any) -> float:
        return float(o.sse / o.n_rows * (o.n_rows + o.n_parameters) / (o.n_rows - o.n_parameters))

    best = min((o for o in model.orders_ if o.admissible), key=fpe)
    assert (model.k_, model.m_) == (best.k, best.m) == (2, 0)
    assert [(m.k_, m.m_) for m in (aic, bic)] == [(4, 4), (1, 0)]
    net = NetARX(k=None, m=None, hidden=1, epochs=1, time="routed").fit(n, z, dt=dt)
    assert (net.k_, net.m_) == (2, 0)


def test_the_net_of_the_study_has_the_orders_of_the_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-02: k = 1, m = 0, at intervals of 10 min, from the speed."""
    asked: list[dict[str, Any]] = []

    def make(**given: Any) -> NetARX:
        asked.append(given)
        return NetARX(**given | {"hidden": 1, "epochs": 1})

    monkeypatch.setattr(setup, "NetARX", make)
    monkeypatch.setattr(setup, "INTERVALS", (600.0,))
    monkeypatch.setattr(setup, "CUTS", 1)
    setup.compute(0, tell_nobody)
    assert len(asked) == 4
    for given in asked:
        assert (given["k"], given["m"], given["interval"], given["inputs"]) == (1, 0, 600.0, ("spindle_rpm",))


def test_the_study_searches_by_the_final_prediction_error() -> None:
    """P-02: k and m up to 5; the net has the orders of the paper; an order whose free run grows is none."""
    chosen, paper = setup._by_fpe_and_papers(600.0)
    assert (chosen.criterion, chosen.k, chosen.m, chosen.k_max, chosen.m_max) == ("fpe", None, None, 5, 5)
    assert (paper.k, paper.m) == (1, 0)
    orders = tuple(SimpleNamespace(k=k, m=0, fpe=f, admissible=k < 3) for k, f in ((1, 2.0), (2, 3.0), (3, 1.0)))
    best: Any = setup.Computed.by_fpe.fget(SimpleNamespace(orders=[orders]))  # type: ignore[attr-defined]
    assert [o.k for o in best] == [1]


def test_the_table_of_orders_has_a_row_for_each_k(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-02."""
    rows: dict[str, Any] = {}
    monkeypatch.setattr(redo.exhibits, "table", lambda name, given, **_: rows.setdefault(name, list(given)))
    monkeypatch.setattr(redo, "errors_table", lambda *_: None)
    orders = [SimpleNamespace(k=k, m=m, fpe=10.0 * k + m, admissible=True) for k in range(6) for m in range(6)]
    cut = SimpleNamespace(without=np.ones(3), scheduled=np.ones(3))
    redo._tables(SimpleNamespace(orders=[orders], left={}, between={setup.LINEAR: [cut]}, clocks={}, cuts=[]))  # type: ignore[arg-type]
    assert [(k, [float(f) for f in cells]) for k, cells in rows["orders"]] == [
        (k, [10.0 * k + m for m in range(6)]) for k in range(6)
    ]


def test_each_position_has_its_model() -> None:
    """P-04: also of the methods of the house; the drift of the last position is smaller."""
    samples = setup.samples_of(record("precompensation", seed=0)[0])
    for name, models in cutting.house_models(samples).items():
        assert [m.target for m in models] == [c.name for c in samples.targets], name
    (plan, other) = find_experiment("precompensation").tests
    assert [*plan.probes] == [*other.probes] == [f"z_at_{p}" for p in setup.POSITIONS]


@pytest.mark.parametrize("bad", [1, 2])
def test_both_inner_positions_are_judged(bad: int) -> None:
    """P-04: beside the local model, by its own residual."""
    rng = np.random.default_rng(bad)
    z = np.outer(np.cumsum(rng.normal(size=60)), [1.0, 0.9, 0.8, 0.7])
    left = 0.1 * rng.normal(size=z.shape)

    def interpolated(k: int, _: str) -> FloatArray:
        return z[:, k] - (3.0 if k == bad else 1.0) * left[:, k]

    c: Any = SimpleNamespace(judge=SimpleNamespace(deviations=z), left={setup.NET: left}, interpolated=interpolated)
    facts = redo._interpolated(c)
    assert facts["holds"] is False
    assert [p for p, *_ in facts["errors"]] == [200, 400]
    for k, (_, between, own) in enumerate(facts["errors"], start=1):
        assert own == pytest.approx(np.sqrt(np.mean(left[:, k] ** 2)))
        assert between == pytest.approx((3.0 if k == bad else 1.0) * own)


def test_new_conditions_in_a_stable_environment() -> None:
    """P-05: speeds between those that were learned, too, and a room that is held."""
    learn, judge = (np.unique(r.table["spindle_rpm"]) for r in record("precompensation", seed=0))
    assert {*judge.tolist()} - {*learn.tolist()}
    assert all(np.ptp(r.table["t_air_C"]) < 1.5 for r in record("precompensation", seed=0))


def test_what_is_described_is_the_verification_by_the_net() -> None:
    """P-05."""
    rng = np.random.default_rng(0)
    z = np.cumsum(rng.normal(size=(50, 4)), axis=0)
    shares = {setup.NET: [0.95, 0.92, 0.5, 0.99], setup.LEAST: [0.99] * 4, setup.CHOSEN: [0.98] * 4}
    c: Any = SimpleNamespace(
        judge=SimpleNamespace(deviations=z),
        learn=SimpleNamespace(deviations=z),
        left={setup.NET: z},
        shares=shares.__getitem__,
    )
    facts = redo._described(c)
    assert (facts["holds"], facts["shares"]) == (False, shares[setup.NET])


def test_residuals_are_those_of_the_verification() -> None:
    """P-05: measured in the second test minus its free run."""
    z, free = np.ones((4, 2)), {"net": np.full((4, 2), 0.25)}
    left: Any = setup.Computed.left.func(SimpleNamespace(judge=SimpleNamespace(deviations=z), free_run=free))  # type: ignore[attr-defined]
    np.testing.assert_array_equal(left["net"], np.full((4, 2), 0.75))


# -- stepwise2017 ------------------------------------------------------------------------------------------------------


def test_the_estimator_has_both_thresholds() -> None:
    """T-03 to T-06: the first enters, and leaves when its parts are in; what leaves is not in the model."""
    rng = np.random.default_rng(16)
    parts = rng.normal(size=(3000, 2))
    X = np.column_stack([parts.sum(axis=1) + 0.5 * rng.normal(size=3000), parts])
    y = parts.sum(axis=1) + 0.05 * rng.normal(size=3000) + 40.0
    model = PartialF().fit(X, y)
    assert [(s.action, s.index) for s in model.log_][-1] == ("remove", 0)
    assert model.selected_ == (1, 2)
    assert model.terms_ == ("x1", "x2")
    assert all(s.f >= 100.0 for s in model.log_ if s.action == "enter")
    assert all(s.f < 50.0 for s in model.log_ if s.action == "remove")
    few, weak = X[:300, 1:2], X[:300, 1] + 2.0 * rng.normal(size=300)
    found = PartialF(f_enter=50.0).fit(few, weak)
    assert 50.0 < found.log_[0].f < 100.0
    assert PartialF().fit(few, weak).selected_ == ()
    through_zero = PartialF(fit_intercept=False).fit(X[:, 1:], y - 40.0)
    assert through_zero.log_[-1].df == 2998


@pytest.fixture
def of_the_last(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, list[str], Any]]:
    """A drift of the last two of 24 temperatures; the methods that are trained, and what they are given."""
    trained: list[tuple[str, list[str], Any]] = []
    keep = common.trained

    def seen(method: str, samples: Any, *given: Any, **more: Any) -> Any:
        trained.append((method, [c.name for c in samples.inputs], samples))
        return keep("ols", samples, *given, **more)

    def made(experiment: str, *, seed: int) -> list[Recording]:
        (test,) = record("stepwise2017", seed=seed + (experiment != "stepwise2017"))
        heat = test.values(test.temperatures)
        x = (heat - heat[0]) @ np.r_[np.zeros(22), 3.0, -8.0] + (20.0 if experiment != "stepwise2017" else 0.0)
        x = x + 0.2 * np.random.default_rng(len(experiment)).normal(size=len(x))
        return [replace(test, name=experiment, table=test.table.assign(x1_um=x))]

    monkeypatch.setattr(common, "trained", seen)
    monkeypatch.setattr(stepwise2017_setup, "record", made)
    monkeypatch.setattr(stepwise2017_setup, "THINNED", (1,))
    return trained


def test_all_24_temperatures_are_candidates(of_the_last: list[tuple[str, list[str], Any]]) -> None:
    """T-04, T-05, T-07: in the first test, with F of 100 and 50 and a constant."""
    c = stepwise2017_setup.compute(0, tell_nobody)
    names = [i.name for i in c.fit.inputs if i.quantity == "temperature"]
    assert len(names) == 24
    assert {*names[22:]} <= {*c.chosen}
    assert c.selection.n_features_in_ == 24
    assert (c.selection.f_enter, c.selection.f_delete, c.selection.fit_intercept) == (100.0, 50.0, True)
    again = PartialF().fit(c.fit.only(names).frame(), c.fit.deviations[:, 0])
    assert c.chosen == again.terms_
    assert [s.f for s in c.selection.log_] == pytest.approx([s.f for s in again.log_])
    (model,) = stepwise2017.claims.judged("model", c)
    assert model.ours == f"x = {c.models[stepwise2017_setup.STEPWISE].formula()}"
    (figure,) = [f for f in stepwise2017._figures(c) if f.key == "stepwise2017-fig2"]
    for curve, k in zip(figure.panels[0].curves, (3, 11, 14), strict=True):
        np.testing.assert_array_equal(curve.y, c.fit.values[:, k - 1])
    # T-10: each related method by its name, with everything that was measured
    methods = dict(zip(list(stepwise2017_setup.METHODS)[1:], (m for m, *_ in of_the_last), strict=True))
    assert methods["principal components"] == "pcr"
    assert methods["principal components, points traversed"] == "pcr-traversal"
    assert methods["sliced inverse regression"] == "sir"
    assert all(len(inputs) == 25 for _, inputs, _ in of_the_last)


def test_deleted_temperatures_are_told() -> None:
    """T-05."""
    log = [SimpleNamespace(action=a, term=f"t_{p}_C") for a, p in (("enter", "a"), ("enter", "b"), ("remove", "a"))]
    assert stepwise2017._deleted(SimpleNamespace(selection=SimpleNamespace(log_=log)))["places"] == ["a"]


# -- components and the cross table ------------------------------------------------------------------------------------


def test_each_component_depends_on_the_axis_that_moves() -> None:
    """C-02: all 18 on the axis of their last letter, whatever the direction; the others on none."""
    for code, component in BY_CODE.items():
        if component.group == "axis":
            assert component.depends_on == code[2]
        else:
            assert component.depends_on is None


def test_experiments_of_the_cross_table() -> None:
    """X-03: each paper's experiments; both new tests of Chen are unseen, and one test of each other."""
    unseen = {e.name: (e.unseen, e.then) for e in cross.EXPERIMENTS}
    assert unseen == {
        "chen1996": (2, "chen1996-new"),
        "wessel-fem": (1, ""),
        "wessel-tool": (1, ""),
        "wessel-milling": (1, ""),
        "hwang": (1, "hwang"),
        "precompensation": (1, ""),
        "stepwise2017": (1, "stepwise2017-online"),
    }
    task = cross.simulate_task(cross.EXPERIMENTS[0], 0)
    speeds = [{*task.samples.values[rows, -1].tolist()} for rows in (~task.judging.splits[0].judge,)]
    assert 1250.0 not in speeds[0]


def test_the_noise_of_the_table_is_that_of_the_paper() -> None:
    """X-03, C-33: 0.4 degC, uniform; of a sum of three temperatures with weights of 100 um/degC."""
    from thermocomp.judging import robustness

    assert robustness.NOISE == 0.4
    two = robustness.Robustness(0.4, {"uniform": (1.0, 2.0)}, {"a": 1.0, "b": 3.0}, 0.0, 0.0, 1.0)
    assert two.worst_lost == ("b", 3.0)
