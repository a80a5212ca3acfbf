"""Chen, Yuan, Ni 1996 redone: the procedure is the paper's, and what is judged can fail."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.core.polynomial import Polynomial
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import drift as chen1996_drift
from thermocomp.papers.chen1996 import law as chen1996_law
from thermocomp.papers.chen1996 import setup as chen1996_setup
from thermocomp.papers.chen1996 import slope as chen1996_slope
from thermocomp.papers.chen1996 import unseen as chen1996_unseen
from thermocomp.papers.chen1996 import volume as chen1996_volume
from thermocomp.papers.chen1996.drift import LearnedDrift
from thermocomp.papers.chen1996.slope import LearnedPositioning
from thermocomp.papers.chen1996.unseen import DYNAMIC, MRA, NET, NONE, Unseen
from thermocomp.papers.studies import run
from thermocomp.papers.study import Claim, Study
from thermocomp.recordings.samples import Samples

#: studies of the paper; its other ids are those of methods and data structures
IDS = {f"C-{n:02d}" for n in (4, 5, 7, *range(9, 21), *range(22, 38)) if n != 21} | {"E-C9", "E-C12"}


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    """Few epochs and starts: the tests look at the procedure, the gallery page at the results."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (chen1996_drift, chen1996_slope):
            patch.setattr(module, "SigmoidNet", partial(SigmoidNet, n_epochs=150))
            patch.setattr(module, "STARTS", 3)
        patch.setattr(chen1996_drift, "SWEEP", (5, 25))
        patch.setattr(chen1996_drift, "SWEEP_STARTS", 2)
        patch.setattr(chen1996_unseen, "DRAWS", 2)
        for module in (chen1996_law, chen1996_volume):
            patch.setattr(module, "SigmoidNet", partial(SigmoidNet, n_epochs=150))
        for name, value in {"DAYS": 1, "DRAWS": 4, "FEWER": 2}.items():
            patch.setattr(chen1996_law, name, value)
        yield


@pytest.fixture(scope="module")
def told() -> list[float]:
    return []


@pytest.fixture(scope="module")
def study(quick: None, told: list[float]) -> Study:
    return run("chen1996", progress=lambda share, _: told.append(share))


@pytest.fixture(scope="module")
def learned(quick: None) -> LearnedDrift:
    return chen1996_drift.learn(0, lambda _: None)


@pytest.fixture(scope="module")
def slopes(quick: None) -> LearnedPositioning:
    return chen1996_slope.learn(1, 2)


@pytest.fixture(scope="module")
def unseen(learned: LearnedDrift) -> Unseen:
    return chen1996_unseen.observe(learned, 1)


def find(claims: Sequence[Claim], identifier: str, text: str) -> Claim:
    (found,) = [c for c in claims if identifier in c.ids and text in c.text]
    return found


# -- the whole study -----------------------------------------------------------------------------------------------


def test_every_study_of_the_paper_has_its_claim(study: Study) -> None:
    assert sorted(IDS - {i for c in study.claims for i in c.ids}) == []
    assert all(c.ours for c in study.claims)
    assert all((c.holds is False or c.softer) == bool(c.finding) for c in study.claims)


def test_figures_like_the_papers(study: Study) -> None:
    """C-36; Figs. 8 and 9 are sketches, Fig. 2 is a table."""
    numbers = [int(f.key.removeprefix("chen1996-fig")) for f in study.figures if "-fig" in f.key]
    assert sorted(numbers) == [1, 3, 4, 5, 6, 7, 10, 11, 12, 13, 14, 15, 16, 17]
    for figure in study.figures:
        for panel in figure.panels:
            assert panel.xlabel
            assert panel.ylabel
            assert all(len(c.x) == len(c.y) > 1 and c.label for c in panel.curves)
    panels = {int(f.key.removeprefix("chen1996-fig")): f.panels[0] for f in study.figures if "-fig" in f.key}
    assert [panels[k].ylabel for k in (3, 4, 5, 10, 11, 12)] == [f"{t} [um]" for t in "xyzxyz"]
    assert [panels[k].ylabel for k in (14, 15, 16, 17)] == [f"{t} [um]" for t in "zzzx"]
    for number, (hours, models) in {
        **dict.fromkeys((3, 4, 5), (5 * 16.1, [MRA])),
        **dict.fromkeys((10, 11, 12), (5 * 16.1, [NET])),
        **{7: (50 / 3, [MRA]), 13: (50 / 3, [NET]), 15: (9.05, [MRA, NET, DYNAMIC])},
        **dict.fromkeys((14, 16, 17), (12.1, [MRA, NET, DYNAMIC])),
    }.items():
        assert [c.label for c in panels[number].curves] == ["measured", *models]
        for curve in panels[number].curves:
            assert (curve.x[0], curve.x[-1]) == (0.0, pytest.approx(hours))
    for number in (1, 6):  # profiles in several states, from the cold machine to the end of the test
        labels = [c.label for c in panels[number].curves]
        assert (len(labels), labels[0], labels[-1]) == (6, "after 0.0 h", "after 16.7 h")
    captions = [t.caption for t in study.tables]
    assert any(c.startswith("Fig. 2") for c in captions)
    assert any(c.startswith("Table 1") for c in captions)
    assert any(c.startswith("Table 2") for c in captions)


def test_the_paper_s_counts(study: Study) -> None:
    """C-10, C-14, C-23, C-26."""
    numbers = study.numbers
    assert numbers["rows"] == 810
    assert [numbers[f"candidates_{t}"] for t in "xyz"] == [20, 35, 20]
    assert numbers["parameters_net"] == 263
    assert (numbers["slope_sets"], numbers["slope_candidates"]) == (51, 20)
    assert all(np.isfinite(v) for v in numbers.values())


def test_progress_rises_to_the_end(study: Study, told: list[float]) -> None:
    assert told == sorted(told)
    assert told[0] == 0
    assert told[-1] == 1
    assert len(told) > 5


def test_compensation_helps_where_the_machine_drifts(study: Study) -> None:
    numbers = study.numbers
    for method in ("mra", "net", "dynamic"):
        assert numbers[f"rms_z_1250_{method}_um"] < numbers["rms_z_1250_none_um"]
        assert numbers[f"lateral_{method}_um"] < numbers["lateral_none_um"]
    assert numbers["lateral_measured_um"] < 0.1 * numbers["lateral_none_um"]


# -- drifts --------------------------------------------------------------------------------------------------------


def test_sensors_are_those_of_table_1(learned: LearnedDrift) -> None:
    """C-11: T5 is the average of the four at the column."""
    values = {c.name: learned.samples.values[:, j] for j, c in enumerate(learned.samples.inputs)}
    assert list(values) == [*chen1996_setup.TEMPERATURES, "speed"]
    np.testing.assert_allclose(values["T5"], np.mean([values[t] for t in ("T6", "T7", "T8", "T9")], axis=0))
    assert sorted({float(s) for s in values["speed"]}) == [0, 600, 1000, 1500, 2100, 2600]


def test_regressions_take_their_subgroups_and_nets_all_nine(learned: LearnedDrift) -> None:
    """C-13, C-26."""
    for target, regression in learned.regressions.items():
        assert regression.variables_ == chen1996_setup.SUBGROUPS[target]
        assert not regression.fit_intercept
        assert (regression.alpha_enter, regression.alpha_remove) == (0.001, 0.015)
    assert len({id(n.net) for n in learned.nets}) == 3
    for trained in learned.nets:
        assert trained.net.net_.shape == (9, 20, 3)
        assert list(trained.models) == ["x", "y", "z"]
    assert learned.others["common scaling"][0].net.scaling == "common"
    assert learned.others["batch update"][0].net.update == "batch"
    assert learned.others["9-5-3"][1].net.net_.shape == (9, 5, 3)


def test_errors_after_training_are_those_of_the_replayed_models(learned: LearnedDrift) -> None:
    """C-31."""
    change = learned.samples.only(chen1996_setup.TEMPERATURES).frame()
    for target, regression in learned.regressions.items():
        error = common.take_measured(learned.samples, target) - regression.predict(change)
        np.testing.assert_allclose(learned.mra_residual[target], error, atol=1e-9)
    for trained in learned.nets:
        for target, model in trained.models.items():
            mae = np.abs(common.residual(model, learned.samples)).mean()
            assert trained.mae[target] == pytest.approx(mae, rel=1e-9)
    assert sorted(n.mean for n in learned.nets)[1] == learned.typical.mean


def test_claims_on_the_fits_can_fail(learned: LearnedDrift) -> None:
    better = [replace(n, mae={t: 0.5 * e for t, e in n.mae.items()}) for n in learned.nets]
    worse = [replace(n, mae={t: 2.0 * e for t, e in n.mae.items()}) for n in learned.nets]
    for others, holds in ((better, False), (worse, True)):
        every = replace(learned, others=dict.fromkeys(learned.others, others))
        claims = chen1996_drift.claims(every)
        assert find(claims, "C-28", "Scaling").holds is holds
        assert find(claims, "C-30", "Pattern").holds is holds
        assert find(claims, "C-26", "More than 20").holds is holds
    for regression in learned.regressions.values():
        assert 0 < regression.r_squared_ < 1
    mae = {t: float(np.abs(e).mean()) for t, e in learned.mra_residual.items()}
    for factor, holds in ((1.4, True), (1.6, False)):
        nets = [replace(n, mae={t: factor * e for t, e in mae.items()}) for n in learned.nets]
        assert find(chen1996_drift.claims(replace(learned, nets=nets)), "C-31", "very close").holds is holds


def test_the_log_of_the_regression_is_a_table(learned: LearnedDrift) -> None:
    """C-16: Fig. 2."""
    (log,) = [t for t in chen1996_drift.tables(learned) if t.caption == "Fig. 2: steps in x"]
    assert len(log.rows) == len(learned.regressions["x"].log_)
    assert log.rows[0][:3] == ["1", "ENTER", learned.regressions["x"].log_[0].term]


# -- new tests -----------------------------------------------------------------------------------------------------


def test_new_tests_have_other_speeds_and_another_weather(unseen: Unseen) -> None:
    """C-32."""
    constant, random = unseen.tests
    assert set(constant.values[:, -1]) == {0.0, 1250.0}
    assert len(set(random.values[:, -1])) > 4
    first = unseen.learned.samples
    assert not set(first.hashes) & {*constant.hashes, *random.hashes}
    air = first.values[(first.test == 0), 0]
    n = min(len(air), len(constant))
    assert not np.allclose(constant.values[:n, 0], air[:n], atol=0.1)


def test_residuals_are_measured_minus_replayed(unseen: Unseen) -> None:
    for test, residuals in zip(unseen.tests, unseen.residuals, strict=True):
        for k, target in enumerate("xyz"):
            assert list(residuals[target]) == [NONE, MRA, NET, DYNAMIC]
            np.testing.assert_array_equal(residuals[target][NONE], test.deviations[:, k])
            predicted = common.predict_deviation(unseen.dynamic[target], test)
            np.testing.assert_allclose(residuals[target][DYNAMIC], test.deviations[:, k] - predicted)
    assert chen1996_unseen.largest_error(unseen)[NONE] == pytest.approx(
        max(float(np.linalg.norm(t.deviations, axis=1).max()) for t in unseen.tests)
    )
    assert chen1996_unseen.largest_depth(unseen)[NONE] == pytest.approx(
        max(float(np.ptp(t.deviations[:, 2])) for t in unseen.tests)
    )


def zero(target: str) -> Polynomial:
    return Polynomial(target=target, unit="um", inputs=(), variables=(), terms=(), coefficients=())


def test_models_that_predict_nothing_fail_every_claim(unseen: Unseen) -> None:
    nothing = {t: zero(t) for t in "xyz"}
    nets = [replace(n, models=nothing) for n in unseen.learned.nets]
    claims = chen1996_unseen.claims(replace(unseen, learned=replace(unseen.learned, models=nothing, nets=nets)))

    judged = [c for c in claims if c.holds is not None]
    assert len(judged) == 8
    assert not any(c.holds for c in judged)
    assert "left T2 out" in find(claims, "C-34", "x, 1250").finding
    assert "100% of the drift" in find(claims, "C-32", "1250").finding


def test_a_net_that_knows_the_truth_fulfils_them(unseen: Unseen) -> None:
    """The machine's own displacement, smuggled in as a temperature."""
    column = {t: k for k, t in enumerate("xyz")}

    def cheat(samples: Samples) -> Samples:
        values = np.hstack([samples.values, samples.deviations])
        spies = tuple(replace(c, name=f"spy {c.name}", quantity="dimensionless", unit="1") for c in samples.targets)
        return replace(samples, inputs=samples.inputs + spies, values=values)

    knowing = cheat(unseen.learned.samples)
    spies = [f"spy {t}" for t in column]
    models = {
        t: common.fit_and_freeze(
            SecondOrderRegression(subset=[f"spy {t}"], second_order=False), knowing.only(spies), [t]
        )[t]
        for t in column
    }
    learned = replace(
        unseen.learned, samples=knowing, models=models, nets=[replace(n, models=models) for n in unseen.learned.nets]
    )
    claims = chen1996_unseen.claims(replace(unseen, tests=[cheat(t) for t in unseen.tests], learned=learned))

    for identifier in ("C-32", "C-33", "C-35"):
        assert all(c.holds for c in claims if identifier in c.ids and c.holds is not None)
    assert not any(c.holds for c in claims if "C-34" in c.ids)  # both lose nothing: the net does not degrade less


# -- slopes --------------------------------------------------------------------------------------------------------


def test_the_slope_is_that_of_the_thermal_part(slopes: LearnedPositioning) -> None:
    """C-04, C-07, E-C6: um/m; the same as the house's own, for a polynomial takes nothing from a straight line."""
    k1 = np.array([0.0, 20.0, -35.0])
    day = slopes.learned
    made = replace(day, values=slopes.geometric(day) + 1e-3 * k1[np.arange(51) % 3, None] * day.position)

    np.testing.assert_allclose(slopes.slope(made), k1[np.arange(51) % 3], atol=1e-9)
    np.testing.assert_allclose(slopes.slope(day), slopes.fits[MRA].slopes[0].factors[:, 0], atol=1e-9)
    for method, left in chen1996_slope.residuals(slopes, made).items():
        if method == chen1996_slope.MEASURED:
            np.testing.assert_allclose(left, 0.0, atol=1e-9)


def test_profiles_are_those_of_the_test(slopes: LearnedPositioning) -> None:
    """C-36: Fig. 1 shows the yaw of Y."""
    np.testing.assert_array_equal(slopes.learned.position, np.arange(0, 551, 50))
    assert slopes.learned.values.shape == slopes.other.values.shape == slopes.yaw.values.shape == (51, 12)
    (recording,) = chen1996_setup.recordings("chen1996-slope", 1)
    np.testing.assert_array_equal(slopes.learned.values[:, 3], recording.table["y_laser_150_um"])
    np.testing.assert_array_equal(slopes.yaw.values[:, 3], recording.table["ECY_150_urad"])
    (figure,) = [f for f in chen1996_slope.figures(slopes) if f.key == "chen1996-fig1"]
    (panel,) = figure.panels
    np.testing.assert_array_equal(panel.curves[0].y, slopes.yaw.values[0])
    assert panel.ylabel == "yaw of Y [urad]"
    metres, change = slopes.yaw.position / 1000.0, slopes.yaw.values - slopes.yaw.values[0]
    assert f"varies by {np.ptp(np.polyfit(metres, change.T, 1)[0]):.1f} urad/m" in figure.caption


def test_the_cold_profile_is_a_polynomial_of_fifth_order(slopes: LearnedPositioning) -> None:
    """C-22: with y in mm, result in um."""
    learned = slopes.learned
    expected = np.polyval(np.polyfit(learned.position, learned.values[0], 5), learned.position)
    np.testing.assert_allclose(slopes.geometric(learned), expected, atol=1e-6)
    np.testing.assert_array_equal(slopes.geometric(slopes.other), slopes.geometric(learned))
    (table,) = [t for t in chen1996_slope.tables(slopes) if t.caption.startswith("Cold profile")]
    by_hand = sum(1e3 * float(row[1]) * learned.position**k for k, row in enumerate(table.rows))
    np.testing.assert_allclose(by_hand, expected, atol=0.1)  # four digits are printed


def test_slopes_are_learned_from_five_variables(slopes: LearnedPositioning) -> None:
    """C-23, C-27."""
    assert slopes.regression.variables_ == chen1996_setup.SLOPE_VARIABLES
    (linear,) = slopes.linear.model.slopes
    assert isinstance(linear, Polynomial)
    assert {i.name for i in linear.inputs} <= {*chen1996_setup.TEMPERATURES}
    assert not any(len(t) > 1 for t in linear.terms)
    for fit in slopes.nets:
        net = fit.trained[0].estimator
        assert isinstance(net, SigmoidNet)
        assert net.net_.shape == (5, 8, 1)
        assert (net.n_parameters_, net.n_patterns_) == (57, 51)
        assert "57 weights" in net.caution_
    samples = slopes.nets[0].samples
    values = {c.name: samples.values[:, j] for j, c in enumerate(samples.inputs)}
    table = slopes.learned.states.table
    np.testing.assert_allclose(values["T7-T9"], table["T7"] - table["T9"])


def test_claims_on_slopes_can_fail(slopes: LearnedPositioning) -> None:
    claims = chen1996_slope.claims(slopes)
    assert find(claims, "C-23", "51 sets").ours == "51, 20"
    assert find(claims, "C-23", "higher-order").ours == ", ".join(slopes.regression.terms_)

    position = slopes.learned.position
    bent = 5e-3 * position * (position - 550.0) * 0.1 * (np.arange(51) > 0)[:, None]
    worse = replace(slopes, learned=replace(slopes.learned, values=slopes.learned.values + bent))
    assert find(claims, "C-05", "Only the slope").holds
    assert not find(chen1996_slope.claims(worse), "C-05", "Only the slope").holds

    model = slopes.fits[MRA].model
    (k1,) = model.slopes
    assert isinstance(k1, Polynomial)
    idle = replace(k1, coefficients=(0.0,) * len(k1.coefficients))
    nothing = {m: replace(fit, model=replace(model, slopes=(idle,))) for m, fit in slopes.fits.items()}
    lateral = find(chen1996_slope.judge(replace(slopes, fits=nothing)), "C-35", "dimensions")
    assert not lateral.holds
    assert lateral.ours.endswith("1.0 times")


def test_each_drift_on_all_810_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = list[int]()
    monkeypatch.setattr(chen1996_drift, "_train", lambda _, heat: rows.append(len(heat)))
    found = chen1996_drift.learn(0, lambda _: None)
    assert {*rows} == {810}
    assert np.bincount(found.samples.test).tolist() == [162] * 5
    rises = found.samples.only(chen1996_setup.TEMPERATURES).frame()
    for j, (t, group) in enumerate(chen1996_setup.SUBGROUPS.items()):
        again = SecondOrderRegression(differences=chen1996_setup.DIFFERENCES, subset=group)
        again.fit(rises, found.samples.deviations[:, j])
        assert found.regressions[t].n_rows_ == 810
        assert dict(zip(found.regressions[t].terms_, found.regressions[t].coef_, strict=True)) == pytest.approx(
            dict(zip(again.terms_, again.coef_, strict=True))
        )
        actions = [s.action for s in again.log_]
        assert found.terms[t] == actions.count("enter") - actions.count("remove")
    assert found.candidates == {"x": 20, "y": 35, "z": 20}


def test_a_removed_term_is_not_counted() -> None:
    log = [SimpleNamespace(action=a) for a in ("enter", "enter", "remove")]
    regression: Any = SimpleNamespace(terms_=("T2",), candidates_=("T2", "T3"), log_=log)
    found = LearnedDrift(None, dict.fromkeys(chen1996_setup.DRIFTS, regression), {}, {}, [], {})  # type: ignore[arg-type]
    assert found.terms == dict.fromkeys(chen1996_setup.DRIFTS, 1)
    assert found.candidates == dict.fromkeys(chen1996_setup.DRIFTS, 2)


def test_another_day_is_another_day() -> None:
    k1 = {"first": np.array([0.0, 1.0]), "second": np.array([0.0, 9.0])}
    found: Any = SimpleNamespace(
        other="second", learned="first", slope=k1.get, predicted=lambda _, day: k1[day] - len(day)
    )
    assert LearnedPositioning.left(found, None) == pytest.approx(6.0)  # type: ignore[arg-type]


def test_the_paper_s_coefficients_stand_in_its_column(learned: LearnedDrift, slopes: LearnedPositioning) -> None:
    powers = {f"y^{k}": 1e-3 * c for k, c in enumerate(chen1996_setup.EQ6.coef.tolist())}
    for tables, heading, printed in (
        (chen1996_drift.tables(learned), "Eq. 5", chen1996_drift.EQ5),
        (chen1996_slope.tables(slopes), "Eq. 6", powers),
        (chen1996_slope.tables(slopes), "Eq. 8", chen1996_setup.EQ8),
    ):
        (table,) = [t for t in tables if heading in t.header]
        column = {row[0]: row[[*table.header].index(heading)] for row in table.rows}
        assert {t: float(c) for t, c in column.items() if c} == pytest.approx(dict(printed), rel=1e-3, abs=5e-4)
