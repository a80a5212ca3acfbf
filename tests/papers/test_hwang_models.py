"""Hwang's study: its rows, its models and its figure of the mean square, not only the functions below."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.papers.common import Errors, predict_deviation
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.hwang import setup as hwang_setup
from thermocomp.papers.hwang.setup import JUDGED, OPTIMAL, SINGLE, Computed
from thermocomp.papers.study import tell_nobody
from thermocomp.virtual.datasets import record
from thermocomp.virtual.kits import HWANG_PLACES


@pytest.fixture(scope="module")
def computed() -> Computed:
    return hwang_setup.compute(0, tell_nobody)


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
