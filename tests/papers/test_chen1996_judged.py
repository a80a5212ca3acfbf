"""Chen 1996: the studies, not only the functions below: which test, draw, drift and variant is judged."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.models.ols import LeastSquares
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import drift, law, screening, setup, slope, unseen
from thermocomp.volumetric.models.positionoptions import PositionOptions


@pytest.mark.parametrize("shape", ["uniform", "normal"])
def test_noise_is_drawn_anew_on_the_test_at_1250(monkeypatch: pytest.MonkeyPatch, shape: str) -> None:
    """C-33: twenty draws of 0.4 degC, on z at 1250 1/min; the mean of their errors."""
    asked: list[tuple[str, Any]] = []

    def left(target: str, drawn: Any) -> dict[str, float]:
        asked.append((target, drawn))
        return {"MRA": float(drawn[-1]), "net": float(drawn[-1] ** 2)}

    monkeypatch.setattr(common, "with_noise", lambda *given: given)
    found: Any = SimpleNamespace(tests=["constant", "random"], models={"MRA": {}, "net": {}}, left=left)
    assert unseen.noise(found, "uniform" if shape == "uniform" else "normal") == {"MRA": 9.5, "net": 123.5}
    assert asked == [("z", ("constant", 0.4, shape, k)) for k in range(20)]


def noisy(mra: float, net: float) -> Any:
    """Return results with a drift of 20 um at 1250 1/min and of 500 um at random speeds; without noise 1 um is left."""

    def left(*_: Any) -> Mapping[str, float]:
        return {unseen.MRA: 1.0, unseen.NET: 1.0, unseen.DYNAMIC: 1.0}

    return SimpleNamespace(
        errors=lambda test, *_: SimpleNamespace(rms=(20.0, 500.0)[test]),
        noisy={unseen.MRA: mra, unseen.NET: net, unseen.DYNAMIC: 1.0},
        tests=["constant", "random"],
        left=left,
        learned=SimpleNamespace(regressions={"z": SimpleNamespace(coef_=np.array([2.0, -30.0]))}),
    )


@pytest.mark.parametrize(
    ("mra", "net", "reasons"),
    [(3.9, 3.9, []), (4.1, 3.9, ["mra"]), (3.9, 4.1, ["net"]), (4.1, 4.1, ["mra", "net"])],
)
def test_well_with_noise_is_a_fifth_of_the_drift_of_that_test(mra: float, net: float, reasons: list[str]) -> None:
    """C-33: what is left with noise decides, compared with the drift at 1250 1/min."""
    facts = unseen._uniform(noisy(mra, net))
    assert (facts["holds"], facts["reasons"], facts["none"]) == (not reasons, [*reasons, "through"], 20.0)
    assert (facts["mra"], facts["net"]) == ((mra / 20, 0.05), (net / 20, 0.05))


def test_the_normal_noise_is_normal(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-33, E-C9: both laws are reported, each under its name."""
    monkeypatch.setattr(unseen, "noise", lambda _, law: {"uniform": {"MRA": 1.0}, "normal": {"MRA": 2.0}}[law])
    facts = unseen._normal(noisy(1.0, 1.0))
    assert (facts["left"], facts["none"]) == ({"MRA": 2.0}, 20.0)


def test_each_rejected_method_is_compared_under_its_name() -> None:
    """C-28, C-30: the nets of one common scaling, and those of the batch update."""
    others = {"common scaling": 2.0, "batch update": 3.0}
    found: Any = SimpleNamespace(mean=1.0, mean_of=others.__getitem__)
    assert drift._scaling(found) == {"chosen": 1.0, "other": 2.0}
    assert drift._update(found) == {"chosen": 1.0, "other": 3.0}


def test_tables_of_the_drifts_tell_each_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-16, C-18, C-19: printed statistics stand beside x, its coefficients beside Eq. 5, and each log is its own."""
    told: dict[str, Any] = {}
    monkeypatch.setattr(setup, "exhibits", SimpleNamespace(table=told.setdefault))
    regressions = {
        t: SimpleNamespace(terms_=(f"T{k}",), coef_=np.array([float(k)]), log_=[SimpleNamespace(action="enter", of=t)])
        for k, t in enumerate("xyz", start=2)
    }
    numbers = {t: k for k, t in enumerate("xyz")}
    found: Any = SimpleNamespace(
        regressions=regressions,
        candidates=numbers,
        terms=numbers,
        mra=numbers,
        net=numbers,
        nets=[SimpleNamespace(mae=numbers)],
        others={},
    )
    drift.tables(found)
    fits = {row[0]: row[6:8] for row in told["fits"]}
    assert fits == {"x": (" (0.988)", " (10.6)"), "y": ("", ""), "z": ("", "")}
    assert [(row[4], row[9], row[11]) for row in told["fits"]] == [(7, 8.9, 6.5), (15, 3.8, 4.2), (7, 6.9, 6.0)]
    assert [(step.of, action) for key in ("log_x", "log_y") for step, action in told[key]] == [
        ("x", "ENTER"),
        ("y", "ENTER"),
    ]
    assert ("T2", "2.000", "-0.586") in told["eq5"]


def test_a_slope_is_enough_on_the_day_of_the_51_profiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-05, C-23: judged on the profiles from which the slope was learned."""
    bent = {"first": 0.5, "second": 2.0}
    monkeypatch.setattr(
        slope, "residuals", lambda _, day: {slope.MEASURED: np.full(3, bent[day]), slope.NONE: np.full(3, 10.0)}
    )
    found: Any = SimpleNamespace(learned="first", other="second")
    assert slope._straight(found)["bent"] == pytest.approx(0.05)


def test_errors_in_the_new_tests_stand_under_their_test() -> None:
    """C-32: the table of the residuals at 1250 1/min, then at random speeds."""
    wave = np.sin(np.arange(60.0))
    residuals = [{t: {unseen.NONE: size * wave} for t in "xyz"} for size in (1.0, 7.0)]
    found: Any = SimpleNamespace(residuals=residuals)
    (table,) = unseen.tables(found)
    rms = float(np.sqrt(np.mean(wave**2)))
    assert [tuple(row[:3]) for row in table.rows] == [
        (f"{t}, {test}", unseen.NONE, f"{size * rms:.2f}")
        for test, size in (("1250 1/min", 1.0), ("random speed", 7.0))
        for t in "xyz"
    ]


def test_regressions_on_those_left_by_the_screening_know_no_others() -> None:
    """C-11: the nine of 24, fitted to the five tests and judged on the new ones; each set under its name."""
    tests = setup.recordings("chen1996", 3)
    samples = setup.drift_samples(tests)
    table_2, table_1 = (
        {t: common.fit_and_freeze(LeastSquares(), samples.only(names), [t])[t] for t in setup.DRIFTS}
        for names in (["T2"], ["T2", "T3"])
    )
    learned: Any = SimpleNamespace(samples=samples, models=table_2, wide=table_1)
    found = screening.learn(3, 4, learned)
    few = common.stacked(tests, ["z"], found.kept)
    ours = common.fit_and_freeze(SecondOrderRegression(), few, ["z"])["z"]
    new = common.stacked(setup.recordings("chen1996-new", 4), ["z"], [*dict.fromkeys(("T2", "T3", *found.kept))])
    assert len(found.kept) == 9
    left = {"Table 2": table_2["z"], "Table 1": table_1["z"], "screening": ours}
    for name, model in left.items():
        assert found.errors["z"][name] == pytest.approx(common.rms(common.residual(model, new)), rel=1e-6)


def test_each_design_measures_in_its_own_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-23: the paper's measurement in its one warm-up, ours in three tests; each day in its turn."""
    monkeypatch.setattr(law, "temperatures", lambda experiment, seed: [(experiment, seed)])
    asked: list[tuple[Any, ...]] = []

    def stop(design: law.Design, days: Any, *given: int) -> None:
        asked.append((design, [day for (day,) in days], *given))

    monkeypatch.setattr(law, "recover", stop)
    monkeypatch.setattr(law, "plant", lambda *_: 1 / 0)  # here the draws are over
    with pytest.raises(ZeroDivisionError):
        law.seek(7)
    for design, days, draws, seed in asked:
        assert days == [(design.experiment, 7 + k) for k in range(5)]
        assert (draws, seed) == (200 if design is law.OURS else 50, 7)
    assert [design for design, *_ in asked] == [*law.DESIGNS]


def test_the_days_take_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-23: the draws are spread over all days."""
    days = [[np.random.default_rng(k).normal(size=(85, 9)).cumsum(axis=0) for _ in range(3)] for k in range(2)]
    used: list[int] = []
    plant = law.plant

    def planted(day: Any, design: law.Design, rng: np.random.Generator) -> list[law.Measured]:
        used.append(next(k for k, d in enumerate(days) if d is day))
        return plant(day, design, rng)

    monkeypatch.setattr(law, "plant", planted)
    law.recover(law.OURS, days, 5, 0)
    assert used == [0, 1, 0, 1, 0]


def test_first_order_is_the_default() -> None:
    """C-05: m = 1, without an offset."""
    assert (PositionOptions().slopes, PositionOptions().offset, PositionOptions().powers) == (1, False, (1,))


def test_slopes_are_sought_among_terms_without_conditions(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-09, C-21: no constant, and a product may enter without its factors; then among linear terms alone."""
    asked: list[Any] = []

    def stop(_: Any, options: PositionOptions) -> None:
        asked.append(options.method)
        if len(asked) == 2:
            raise InterruptedError

    monkeypatch.setattr(slope, "fit_position", stop)
    with pytest.raises(InterruptedError):
        slope.learn(1, 2)
    for method, second in zip(asked, (True, False), strict=True):
        assert method.get_params() == {
            "alpha_enter": 0.001,
            "alpha_remove": 0.015,
            "fit_intercept": False,
            "differences": setup.DIFFERENCES,
            "subset": setup.SLOPE_VARIABLES,
            "second_order": second,
            "hierarchy": False,
        }
