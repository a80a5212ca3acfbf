"""Hwang's study from the recordings to what it prints: rows, columns, models and order of the results."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.judging.sensitivity import sensitivity
from thermocomp.models.selection.collinearity import Spectrum
from thermocomp.models.selection.grouping import Interval, group, intervals
from thermocomp.papers import common
from thermocomp.papers.common import Errors, predict_deviation
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.hwang import setup as hwang_setup
from thermocomp.papers.hwang.setup import JUDGED, LAWS, LINEAR, NOISES, OPTIMAL, QUADRATIC, SINGLE, TABLE_1, Computed
from thermocomp.papers.study import tell_nobody
from thermocomp.virtual.datasets import record
from thermocomp.virtual.kits import HWANG_PLACES

#: T1 to T14 (H-08)
PLACES = (
    *("x_bearing", "x_nut", "y_bearing", "y_nut", "z_bearing", "z_nut", "front_seat", "rear_seat"),
    *("column_front_right", "column_front_left", "column_rear_right", "column_rear_left", "bed_front", "bed_rear"),
)


@pytest.fixture(scope="module")
def computed() -> Computed:
    return hwang_setup.compute(0, tell_nobody)


def test_temperatures_are_grouped_as_read(computed: Computed) -> None:
    """H-02, H-08, H-10: T14 is subtracted after the grouping, and is in no group."""
    tests = [record("hwang", seed=k)[0].table for k in range(3)]
    read = np.vstack([t[[f"t_{p}_C" for p in PLACES]].to_numpy()[::3] for t in tests])
    np.testing.assert_array_equal(computed.fit.values, read)
    C = np.corrcoef(read[:, :13].T)
    np.testing.assert_allclose(computed.grouped.correlation_, C, atol=1e-11)
    taken = computed.interval
    assert group(computed.grouped.correlation_, taken.low) == computed.grouped.groups_ == taken.groups
    assert sorted(k for g in computed.grouped.groups_ for k in g) == [*range(13)]
    # by sign, at all thresholds (E-H1, E-H2); the one that is taken has the number of groups of Table 1, if any has
    signed = intervals(computed.grouped.correlation_)
    assert tuple(i for i, _ in computed.swept) == signed
    apart = [abs(len(i.groups) - 8) for i in signed]
    assert abs(len(taken.groups) - 8) == min(apart)
    assert [g.groups_ for _, g in computed.swept] == [i.groups for i in signed]


@pytest.mark.parametrize("fraction", [0.0, 0.5])
def test_the_groups_may_be_those_of_another_threshold(fraction: float) -> None:
    """H-10: Table 1 is found at any threshold, not only at that which the study takes; sensors count from 1."""
    exact = Interval(0.95, 0.96, tuple(tuple(k - 1 for k in g) for g in TABLE_1))
    pairs = Interval(fraction, 0.95, ((0, 1), *((k,) for k in range(2, 13))))
    c: Any = SimpleNamespace(interval=pairs, swept=[(pairs, None), (exact, None)])
    (claim,) = hwang.claims.judged("groups", c)
    assert (claim.verdict, claim.ours) == ("yes", "thresholds from 0.9500 to 0.9600")
    (other,) = hwang.claims.judged("groups", SimpleNamespace(interval=pairs, swept=[(pairs, None)]))  # type: ignore[arg-type]
    assert other.verdict == "no"
    assert other.ours.replace(",", "").startswith("{1 2} {3} {4} {5}")
    assert other.ours.endswith("{13}")


def test_what_is_found_is_printed(computed: Computed) -> None:
    """H-11: variables and model of the grouping, not of the search without it."""
    best, single = computed.fits[OPTIMAL].model, computed.fits[SINGLE].model
    for found, model in ((computed.grouped, best), (computed.single, single)):
        assert {*model.sensors} == {*(f"T{k + 1}" for k in found.selected_), "T14"}
        used = {k for k, g in enumerate(found.groups_) if {*g} & {*min(found.curve_, key=lambda s: s.mse).columns}}
        assert {*found.participating_} == used
        assert len(found.selected_) == len(used)
    assert computed.single.selected_ != computed.grouped.selected_
    (claim,) = hwang.claims.judged("best", computed)
    assert claim.ours == " ".join(f"T{k + 1}" for k in computed.grouped.selected_)
    assert claim.finding == f"z = {best.formula()}"
    (figure,) = [f for f in hwang._figures(computed) if f.key == "hwang-fig4"]
    (curve,) = figure.panels[0].curves
    assert curve.x.tolist() == [len(s.columns) for s in computed.grouped.curve_]
    assert curve.y.tolist() == [s.mse for s in computed.grouped.curve_]


def test_contributions_and_eigenvalues_are_those_of_differences(computed: Computed) -> None:
    """H-14, H-16, H-17: of T_i - T14, as in the model."""
    change = computed.fit.values[:, :13] - computed.fit.values[:, 13:]
    r = [np.corrcoef(x, computed.fit.deviations[:, 0])[0, 1] for x in change.T]
    (claim,) = hwang.claims.judged("contributions", computed)
    assert claim.ours == ", ".join(f"T{k} {r[k - 1]:.4f}" for k in (7, 8, 2, 6))
    for found in (computed.grouped, computed.single):
        X = change[:, found.selected_]
        np.testing.assert_allclose(found.contributions_, [r[k] for k in found.selected_], atol=1e-9)
        np.testing.assert_allclose(found.spectrum_.eigenvalues, np.linalg.eigvalsh(X.T @ X)[::-1], rtol=1e-6)
    (table,) = [t for t in hwang._tables(computed) if t.caption.startswith("Eigenvalues")]
    sums = {row[0]: row[2] for row in table.rows}
    for name, found in (("with grouping, ours", computed.grouped), ("without, ours", computed.single)):
        assert sums[name] == f"{found.spectrum_.sum_inverse:.3g}"


@pytest.mark.parametrize("relative", [0.9, 1.1])
@pytest.mark.parametrize("exchanged", [False, True])
def test_temperatures_of_the_screw_count_both(relative: float, exchanged: bool) -> None:
    """H-17: T7 and T8 must be above T2 and above T6."""
    rng = np.random.default_rng(17)
    change = rng.normal(size=(4000, 13))
    weak, strong = (1, 5)[:: -1 if exchanged else 1]
    drift = change[:, 6] + change[:, 7] + relative * change[:, strong] + 0.1 * change[:, weak]
    grouped = SimpleNamespace(selected_=(6, 7), contributions_=np.array([0.7, 0.7]))
    (claim,) = hwang.claims.judged("contributions", SimpleNamespace(change=change, drift=drift, grouped=grouped))  # type: ignore[arg-type]
    assert claim.verdict == ("yes" if relative < 1 else "no")


@pytest.mark.parametrize(
    ("eigenvalues", "verdict"), [((10.0, 5.0), "yes"), ((10.0, 1.1, 1.1, 1.1, 1.1), "no"), ((10.0, 0.9), "no")]
)
def test_the_variance_of_the_coefficients_must_fall(eigenvalues: tuple[float, ...], verdict: str) -> None:
    """H-14: the sum of 1/lambda, not only the smallest one; with grouping beside without."""
    grouped = SimpleNamespace(spectrum_=Spectrum(eigenvalues), selected_=(0, 1))
    single = SimpleNamespace(spectrum_=Spectrum((20.0, 1.0, 1.0)), selected_=(0, 1, 2))
    c: Any = SimpleNamespace(grouped=grouped, single=single, swept=[(0.9, grouped)], fit=range(39))
    (claim,) = hwang.claims.judged("collinearity", c)
    assert claim.verdict.replace("in part", "yes") == verdict
    assert claim.ours.startswith(
        f"smallest {eigenvalues[-1]:.3g} instead of 1, sum {sum(1 / e for e in eigenvalues):.3g}"
    )


def test_the_models_of_the_study_are_disturbed(computed: Computed) -> None:
    """H-18: the linear and the quadratic model, 100 draws for each size and distribution, and Fig. 6 shows them."""
    fit, optimal, judged = computed.fit, computed.fits[OPTIMAL].model, computed.fits[JUDGED].model
    assert computed.fits[OPTIMAL].model.formula().count("^2") == 0
    assert [*computed.shaken] == [(law, size) for law in LAWS for size in NOISES]
    for (law, size), found in computed.shaken.items():
        models = {LINEAR: optimal, QUADRATIC: judged}
        again = sensitivity(models, fit, common.every(fit), size=size, law=law, draws=100, seed=0)  # type: ignore[arg-type]
        for name in models:
            np.testing.assert_array_equal(found[name].draws, again[name].draws)
            assert found[name].r_squared == pytest.approx(again[name].r_squared)
    assert computed.shaken["uniform", 0.4][LINEAR].r_squared == pytest.approx(computed.fits[OPTIMAL].r_squared)
    (figure,) = [f for f in hwang._figures(computed) if f.key == "hwang-fig6"]
    for curve, name in zip(figure.panels[0].curves, (LINEAR, QUADRATIC), strict=True):
        assert curve.label == name
        np.testing.assert_array_equal(curve.y, computed.shaken["uniform", 0.4][name].draws)
    (table,) = [t for t in hwang._tables(computed) if t.caption.startswith("R2 under")]
    for row, s in zip(table.rows, computed.shaken.values(), strict=True):
        assert row[1:5] == [f"{v:.4f}" for m in (LINEAR, QUADRATIC) for v in (s[m].mean, s[m].std)]


def test_the_shortest_of_the_searches_counts(computed: Computed, monkeypatch: pytest.MonkeyPatch) -> None:
    """H-19: without the preparation of the data, which both searches have in common."""
    now = [0.0]
    lasts = iter([5.0, 2.0, 3.0, 4.0, 6.0])

    def choose(*_: Any) -> None:
        now[0] += next(lasts)

    def prepared(_: Any) -> Any:
        now[0] += 100.0
        return np.eye(13)

    monkeypatch.setattr(hwang_setup, "choose", choose)
    monkeypatch.setattr(hwang_setup, "correlation", prepared)
    monkeypatch.setattr(hwang_setup, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    assert hwang_setup._seconds(computed.fit, 0.9) == 2.0


def test_readings_are_absolute_and_of_their_places() -> None:
    """H-08: T1 to T14 at the places of the paper, as they are read, not relative to the start."""
    tests = record("hwang", seed=1) + record("hwang", seed=2)
    samples = hwang_setup.samples_of(tests)
    np.testing.assert_array_equal(samples.change(), samples.values)
    assert [c.name for c in samples.inputs] == [f"T{k}" for k in range(1, 15)]
    for k, place in enumerate(HWANG_PLACES):
        read = np.concatenate([test.table[f"t_{place}_C"].to_numpy()[::3] for test in tests])
        np.testing.assert_array_equal(samples.values[:, k], read)


@pytest.mark.parametrize("name", [OPTIMAL, SINGLE])
def test_both_models_are_least_squares_on_what_each_search_chose(computed: Computed, name: str) -> None:
    """H-12, H-15: a constant and differences from T14; R2 about the mean and standard error of estimate."""
    chosen = (computed.grouped if name == OPTIMAL else computed.single).selected_
    z, fit = computed.fit.deviations[:, 0], computed.fits[name]
    X = np.column_stack([np.ones(len(z)), computed.fit.values[:, chosen] - computed.fit.values[:, [13]]])
    weights = np.linalg.lstsq(X, z, rcond=None)[0]
    residual = z - X @ weights
    assert {*fit.model.sensors} == {"T14", *(f"T{k + 1}" for k in chosen)}
    np.testing.assert_allclose(predict_deviation(fit.model, computed.fit), X @ weights, atol=1e-6)
    assert fit.r_squared == pytest.approx(1 - residual @ residual / np.sum((z - z.mean()) ** 2), abs=1e-9)
    assert fit.error == pytest.approx(np.sqrt(residual @ residual / (len(z) - len(chosen) - 1)))


def test_figure_4_is_the_mean_square_by_the_number_of_variables(computed: Computed) -> None:
    """H-05: SSE / (n - p - 1) of the best representatives."""
    (figure,) = [f for f in hwang._figures(computed) if f.key == "hwang-fig4"]
    (curve,) = figure.panels[0].curves
    z, change = computed.drift, computed.change
    assert curve.x.tolist() == [*range(1, len(computed.grouped.groups_) + 1)]
    for p, best in enumerate(computed.grouped.curve_, start=1):
        X = np.column_stack([np.ones(len(z)), change[:, best.columns]])
        residual = z - X @ np.linalg.lstsq(X, z, rcond=None)[0]
        assert curve.y[p - 1] == pytest.approx(residual @ residual / (len(z) - p - 1), rel=1e-6)


def test_table_of_eigenvalues(computed: Computed) -> None:
    """H-16: ours with grouping and without, each beside the paper's."""
    (table,) = [t for t in hwang._tables(computed) if t.caption.startswith("Eigenvalues")]
    for row, model in ((1, computed.grouped), (3, computed.single)):
        X = computed.change[:, model.selected_]
        values = np.linalg.eigvalsh(X.T @ X)[::-1]
        assert [float(v) for v in table.rows[row][1].split()] == pytest.approx(values.tolist(), rel=0.006)
        assert float(table.rows[row][2]) == pytest.approx(np.sum(1 / values), rel=0.006)


@pytest.mark.parametrize(("fit", "new"), [(0.9, 1.3), (1.3, 0.9)])
def test_predictions_are_judged_in_the_new_tests_and_fits_in_the_training(fit: float, new: float) -> None:
    """H-12, H-13: two claims, each by its own ratio of errors."""
    model = SimpleNamespace(sensors=("T7", "T14"))
    fits = {m: SimpleNamespace(error=e, r_squared=0.97, model=model) for m, e in ((OPTIMAL, fit), (JUDGED, 1.0))}
    wave = np.sin(np.arange(60.0))
    left = {"no compensation": 9 * wave, OPTIMAL: new * wave, JUDGED: wave}
    errors = {m: Errors.of(e) for m, e in left.items()}
    c: Any = SimpleNamespace(fits=fits, residuals=left, errors=errors, fit=range(39))
    for key, ratio in (("fits", fit), ("predicts", new)):
        (claim,) = hwang.claims.judged(key, c)
        assert claim.verdict == ("yes" if ratio < 1 else "no")
