"""Chen's study from the recordings to what it prints: which day, which model, which error."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.numerics.stepwise import AlphaThresholds, f_of_alpha
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import (
    anywhere,
    drift,
    equation5,
    law,
    part,
    redo,
    screening,
    setup,
    slope,
    unseen,
    volume,
)
from thermocomp.papers.chen1996.anywhere import WITHOUT
from thermocomp.papers.chen1996.drift import LearnedDrift
from thermocomp.papers.chen1996.slope import LearnedPositioning
from thermocomp.papers.study import Figure, Study, tell_nobody
from thermocomp.volumetric.models.position import PositionOptions, slope_samples

FloatArray = NDArray[np.float64]


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (drift, slope):
            patch.setattr(module, "SigmoidNet", partial(SigmoidNet, n_epochs=60, jobs=1))
            patch.setattr(module, "STARTS", 3)
        patch.setattr(drift, "SWEEP", (25,))
        patch.setattr(drift, "SWEEP_STARTS", 1)
        patch.setattr(law, "seek", lambda _: None)
        patch.setattr(law, "tables", lambda _: [])
        yield


@pytest.fixture(scope="module")
def learned(quick: None) -> LearnedDrift:
    return drift.learn(0, lambda _: None)


@pytest.fixture(scope="module")
def slopes(quick: None) -> LearnedPositioning:
    return slope.learn(1, 2)


# -- scaling -----------------------------------------------------------------------------------------------------------


def test_each_target_is_scaled_by_its_own_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-28: between 0.1 and 0.9 in the training, and back in the prediction."""
    given: list[tuple[FloatArray, FloatArray]] = []
    train_net = SigmoidNet._trained.__globals__["train_net"]

    def trained(inputs: FloatArray, targets: FloatArray, *more: Any, **named: Any) -> Any:
        given.append((inputs, targets))
        return train_net(inputs, targets, *more, **named)

    monkeypatch.setitem(SigmoidNet._trained.__globals__, "train_net", trained)
    rng = np.random.default_rng(0)
    X = rng.uniform(0, 1, (40, 3)) * [1.0, 10.0, 300.0] + [20.0, 0.0, -5.0]
    y = np.column_stack([X[:, 0] * 100 - 7, X[:, 1] / 50, -X[:, 2]])
    net = SigmoidNet(hidden=2, n_epochs=1).fit(X, y)
    for scaled in given[0]:
        np.testing.assert_allclose(scaled.min(axis=0), 0.1, atol=1e-12)
        np.testing.assert_allclose(scaled.max(axis=0), 0.9, atol=1e-12)
    back = net.output_scaling_(given[0][1])
    np.testing.assert_allclose(back, y, atol=1e-9)


def test_each_variant_is_claimed_by_its_own_error(learned: LearnedDrift) -> None:
    """C-28, C-30: scaling and update are other variants; the rejected ones are trained as such."""
    (scaling,), (update,) = (drift.claims.judged(key, learned) for key in ("scaling", "update"))
    for claim, kind in ((scaling, "common scaling"), (update, "batch update")):
        other = [replace(n, mae=dict.fromkeys("xyz", 1e-3)) for n in learned.others[kind]]
        (now,) = drift.claims.judged(
            "scaling" if claim is scaling else "update", replace(learned, others=dict(learned.others) | {kind: other})
        )
        assert now.holds is False
        assert now.ours != claim.ours
    assert learned.others["common scaling"][0].net.scaling == "common"
    assert all(n.net.scaling == "channel" for n in (*learned.nets, *learned.others["batch update"]))


# -- errors after training ---------------------------------------------------------------------------------------------


def test_mean_absolute_errors_of_each_drift(learned: LearnedDrift) -> None:
    """C-31: the mean of magnitudes, of the median net; in the table ours stands beside the paper's."""
    (table,) = [t for t in drift.tables(learned) if t.caption.startswith("Table 2")]
    for k, (t, row) in enumerate(zip("xyz", table.rows, strict=True)):
        y = learned.samples.deviations[:, k]
        mra = np.abs(y - common.predict_deviation(learned.models[t], learned.samples)).mean()
        nets = [np.abs(y - common.predict_deviation(n.models[t], learned.samples)).mean() for n in learned.nets]
        assert learned.mra[t] == pytest.approx(mra, rel=1e-9)
        assert learned.net[t] == pytest.approx(sorted(nets)[1], rel=1e-9)
        assert row[6:8] == [f"{mra:.2f} ({drift.MAE_MRA[t]})", f"{sorted(nets)[1]:.2f} ({drift.MAE_NET[t]})"]


@pytest.mark.parametrize("target", ["x", "y", "z"])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_one_drift_that_is_apart_is_enough(target: str, factor: float) -> None:
    """C-31."""
    mra = {"x": 1.0, "y": 2.0, "z": 3.0}
    found: Any = SimpleNamespace(net=mra | {target: factor * mra[target]}, mra=mra, wide={}, samples=None)
    facts = drift._close(found)
    assert (facts["directions"], facts["holds"]) == ([target], False)


# -- levels ------------------------------------------------------------------------------------------------------------


def test_the_regression_enters_and_removes_by_its_levels() -> None:
    """C-15: F to enter 10.9, to remove 5.9; a term between them stays, but does not enter."""
    rule = SecondOrderRegression()._rule()
    assert rule == AlphaThresholds(0.001, 0.015)
    for df in (7, 50, 808):
        assert (rule.enter_f(df), rule.delete_f(df)) == (f_of_alpha(0.001, df), f_of_alpha(0.015, df))
        assert rule.enter_f(df) > rule.delete_f(df)
    assert SecondOrderRegression(alpha_enter=0.01, alpha_remove=0.2)._rule() == AlphaThresholds(0.01, 0.2)


def test_the_slope_is_regressed_by_the_same_levels(slopes: LearnedPositioning) -> None:
    """C-15."""
    for fit in (slopes.fits[slope.MRA], slopes.linear):
        estimator: Any = fit.trained[0].estimator
        assert (estimator.alpha_enter, estimator.alpha_remove) == (0.001, 0.015)


# -- slopes ------------------------------------------------------------------------------------------------------------


def test_residuals_are_those_of_the_thermal_part(slopes: LearnedPositioning) -> None:
    """C-07: measured minus cold profile, then minus the line of each method, on the day that is given."""
    first = slopes.learned.values[0]
    cold = np.polyval(np.polyfit(slopes.learned.position, first, 5), slopes.learned.position)
    for day in (slopes.learned, slopes.other):
        left = slope.residuals(slopes, day)
        thermal = day.values - cold
        np.testing.assert_allclose(left[slope.NONE], thermal, atol=1e-6)
        for method, fit in slopes.fits.items():
            model = fit.model.slopes[0]
            samples, _ = slope_samples([day], PositionOptions(inputs=[i.name for i in model.inputs]))
            k1 = common.predict_deviation(model, samples)
            np.testing.assert_allclose(left[method], thermal - 1e-3 * np.outer(k1, day.position), atol=1e-6)


def test_the_length_is_that_of_the_other_day(slopes: LearnedPositioning) -> None:
    """C-35: over the whole travel, the largest of all profiles; by the better of the paper's two methods."""
    errors = slope.largest_length_error(slopes)
    for method, left in slope.residuals(slopes, slopes.other).items():
        assert errors[method] == max(abs(e[-1] - e[0]) for e in left)
    (claim,) = slope.length.judged("lateral", slopes)
    best = errors[slope.NONE] / min(errors[slope.MRA], errors[slope.NET])
    assert f"{best:.1f} times" in claim.ours
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            slope,
            "largest_length_error",
            lambda _: dict.fromkeys(errors, 7.2) | {slope.NONE: 20.0} | {slope.DYNAMIC: 0.01},
        )
        (ours_only,) = slope.length.judged("lateral", slopes)
    assert ours_only.holds is False


def test_the_cold_profile_is_of_the_fifth_order(slopes: LearnedPositioning) -> None:
    """C-22: ours beside Eq. 6, in mm; told is the largest difference along the travel."""
    position = slopes.learned.position
    expected = np.polyval(np.polyfit(position, slopes.learned.values[0], 5), position)
    assert slopes.fits[slope.MRA].profile.profile is not None
    np.testing.assert_allclose(slopes.geometric(slopes.learned), expected, atol=1e-6)
    facts = slope._cold(slopes)
    assert facts["apart"] == pytest.approx(np.abs(expected - setup.EQ6(position)).max(), abs=1e-6)
    (table,) = [t for t in slope.tables(slopes) if t.caption.startswith("Cold profile")]
    assert [float(row[2]) for row in table.rows] == pytest.approx(
        [2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14], rel=1e-3
    )


# -- figures -----------------------------------------------------------------------------------------------------------


def curves(figure: Figure) -> dict[str, FloatArray]:
    (panel,) = figure.panels
    return {c.label: c.y for c in panel.curves}


def test_fits_in_the_figures(learned: LearnedDrift) -> None:
    """C-36: Figs. 3 to 5 by the regressions of Table 2, 10 to 12 by the net, of x, y and z."""
    figures = {f.key: f for f in drift.figures(learned)}
    for first, kind, models in ((3, "MRA", learned.models), (10, "net", learned.typical.models)):
        for k, t in enumerate("xyz"):
            drawn = curves(figures[f"chen1996-fig{first + k}"])
            y = learned.samples.deviations[:, k]
            for label, values in (("measured", y), (kind, common.predict_deviation(models[t], learned.samples))):
                shown = drawn[label][np.isfinite(drawn[label])]
                np.testing.assert_array_equal(shown, values)


def test_slopes_in_the_figures(slopes: LearnedPositioning) -> None:
    """C-36: Fig. 6 shows the errors of Y as measured, Fig. 7 the slope by regression, Fig. 13 by the net."""
    figures = {f.key: f for f in slope.figures(slopes)}
    k1 = slopes.slope(slopes.learned)
    for number, method in ((7, slope.MRA), (13, slope.NET)):
        drawn = curves(figures[f"chen1996-fig{number}"])
        np.testing.assert_array_equal(drawn["measured"], k1)
        np.testing.assert_array_equal(drawn[method], slopes.predicted(slopes.fits[method], slopes.learned))
    errors = curves(figures["chen1996-fig6"])
    rows = {
        f"after {h:.1f} h": v for h, v in zip(slopes.learned.states.time / 3600, slopes.learned.values, strict=True)
    }
    for label, y in errors.items():
        np.testing.assert_array_equal(y, rows[label])
    assert any(np.abs(slopes.k1).max() == abs(k1[list(rows).index(label)]) for label in errors)


# -- the whole study ---------------------------------------------------------------------------------------------------


def test_the_parts_of_the_study_have_days_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-35, C-37: the volume and the part are judged in a week that was not learned, in all of its tests."""
    asked: dict[str, list[Any]] = {}

    def told(name: str, value: Any = None) -> Any:
        def function(*given: Any) -> Any:
            asked[name] = list(given)
            return value

        return function

    monkeypatch.setattr(drift, "learn", told("drift", "drift"))
    monkeypatch.setattr(slope, "learn", told("slope", "slope"))
    monkeypatch.setattr(unseen, "observe", told("unseen", "unseen"))
    monkeypatch.setattr(screening, "learn", told("screening"))
    monkeypatch.setattr(equation5, "seek", told("equation5"))
    monkeypatch.setattr(volume, "learn", told("volume", "whole"))
    monkeypatch.setattr(anywhere, "predict", told("predict", ["one", "two"]))
    monkeypatch.setattr(anywhere, "judge", told("judge"))
    monkeypatch.setattr(part, "inspect", told("part"))
    monkeypatch.setattr(Study, "of", told("of", SimpleNamespace(figures=())))
    for module in (screening, drift, equation5, slope, unseen, anywhere, part):
        for name in ("claims", "judge", "tables", "figures", "numbers"):
            if hasattr(module, name) and (module, name) != (anywhere, "judge"):
                monkeypatch.setattr(module, name, lambda *_: ())
    monkeypatch.setattr(redo, "exhibits", SimpleNamespace(numbers=lambda *_: {}))
    monkeypatch.setattr(redo, "Part", lambda *_: None)
    monkeypatch.setattr(redo, "replace", lambda study, **_: study)
    redo.run(0, tell_nobody)
    seeds = [asked["drift"][0], *asked["slope"], asked["unseen"][1], asked["volume"][0], asked["predict"][1]]
    assert len({*seeds}) == len(seeds)
    assert asked["predict"][0] == asked["judge"][0] == "whole"
    assert asked["judge"][1] == asked["part"][0] == ["one", "two"]


def test_the_tests_are_those_of_constant_and_of_random_speed(learned: LearnedDrift) -> None:
    """C-32, C-34: the sensor is cut off at 1250 1/min."""
    found = unseen.observe(learned, 3)
    constant, random = ({*s.values[:, -1].tolist()} for s in found.tests)
    assert constant == {0.0, 1250.0}
    assert len(random) > 4
    assert {*found.cut.values[:, -1].tolist()} == constant


def test_numbers_of_the_part_are_those_of_length_and_depth() -> None:
    """C-37."""
    one = np.ones((1, 1))
    found = part.Part({WITHOUT: 10 * one}, {WITHOUT: -30 * one}, {})
    assert part.numbers(found) == {"part_length_none_um": 10.0, "part_depth_none_um": 30.0}


def test_numbers_without_the_sensor_are_those_of_the_cut_test(learned: LearnedDrift) -> None:
    """C-34: what the gallery shows is the error with T2 cut off, of both methods."""
    found = unseen.observe(learned, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unseen, "DRAWS", 1)
        numbers = unseen.numbers(found)
    for t in "xyz":
        cut, intact = (found.left(t, samples) for samples in (found.cut, found.tests[0]))
        for m, short in ((unseen.MRA, "mra"), (unseen.NET, "net")):
            assert numbers[f"rms_{t}_1250_cut_{short}_um"] == cut[m]
            assert numbers[f"rms_{t}_1250_{short}_um"] == intact[m]
