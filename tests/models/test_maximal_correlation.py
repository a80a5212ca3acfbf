"""Maximal correlation of many subsets: counts, agreement with single fits, stopping, bad input."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import twin_ace
from numpy.typing import NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.selection.maximal_correlation import DataSet, maximal_correlations, subsets_up_to

FloatArray = NDArray[np.float64]


def trial(seed: int, n: int = 90, p: int = 4, m: int = 2, step: float = 0.0) -> DataSet:
    rng = np.random.default_rng(seed)
    T = np.cumsum(rng.normal(size=(n, p)), axis=0)
    S = np.column_stack([np.exp(T[:, k] / 9) + 0.3 * T[:, -1] + 0.2 * rng.normal(size=n) for k in range(m)])
    if step:
        T, S = np.round(T / step) * step, np.round(S / step) * step
    return DataSet(f"test {seed}", T, S)


def test_counts_of_the_paper() -> None:
    # W-10
    assert len(subsets_up_to(9)) == 511
    assert len(subsets_up_to(9)) * 23 * 3 == 35_259
    assert len(subsets_up_to(9, 3)) == 129
    assert len(subsets_up_to(9, 3)) * 23 * 3 == 8_901
    assert subsets_up_to(3, 2) == ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2))


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_each_is_the_single_model(step: float) -> None:
    tests = [trial(1, 90, step=step), trial(2, 60, step=step)]
    subsets = [*subsets_up_to(4), (3, 0)]
    found = maximal_correlations(tests, subsets, converged=False, tolerance=1e-3, max_sweeps=12)
    assert found.complete
    assert found.tests == ("test 1", "test 2")
    assert found.psi.shape == (2, 16, 2)
    for k, t in enumerate(tests):
        T, S = np.asarray(t.temperatures), np.asarray(t.displacements)
        for d in range(2):
            for i, subset in enumerate(subsets):
                expected = twin_ace.fit(T[:, sorted(subset)], S[:, d], 10, 1e-3, 12).psi
                assert found.psi[d, i, k] == pytest.approx(expected, abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("step", [0.0, 0.5])
def test_converged_is_the_limit_of_the_sweeps(step: float) -> None:
    from thermocomp.models.kernels import ace as kernel
    from thermocomp.models.kernels import ranks

    t = trial(3, 70, p=3, step=step)
    T, S = np.asarray(t.temperatures), np.asarray(t.displacements)[:, :1]
    tight = maximal_correlations([DataSet("t", T, S)], tolerance=1e-8, max_sweeps=50_000)
    usual = maximal_correlations([DataSet("t", T, S)])
    for i, subset in enumerate(tight.subsets):
        limit = twin_ace.fit(T[:, list(subset)], S[:, 0], 10, -1.0, 300, twice=True).psi
        ranked = ranks.rank(np.ascontiguousarray(np.vstack([T[:, list(subset)].T, S[:, 0]])))
        single = kernel.solve(*ranked, 10, 1e-3, 2000, True)
        assert tight.psi[0, i, 0] == pytest.approx(limit, abs=1e-6)
        assert usual.psi[0, i, 0] == pytest.approx(limit, abs=5e-4)
        assert usual.psi[0, i, 0] == pytest.approx(single[2], abs=1e-12)
        assert len(single[3]) < 200


def test_many_temperatures_that_rise_together_have_a_limit() -> None:
    # where the sweeps of the paper's boxcar run away: psi falls to nothing the longer they last
    from thermocomp.models.kernels import ace as kernel
    from thermocomp.models.kernels import ranks

    rng = np.random.default_rng(4)
    heat = np.cumsum(rng.uniform(0.1, 1, size=300))[:, None]
    T = heat + 0.05 * rng.normal(size=(300, 8))
    S = np.sqrt(heat) + 0.01 * rng.normal(size=heat.shape)
    ranked = ranks.rank(np.ascontiguousarray(np.vstack([T.T, S[:, 0]])))
    assert kernel.solve(*ranked, 10, -1.0, 2000, False)[2] < 0.9
    found = maximal_correlations([DataSet("t", T, S)], subsets_up_to(8))
    assert found.psi.min() > 0.999
    best = [max(p for p, s in zip(found.psi[0, :, 0], found.subsets, strict=True) if len(s) == k) for k in range(1, 9)]
    assert (np.diff(best) > -1e-6).all()


def test_threads_give_the_same() -> None:
    tests = [trial(k, 50) for k in range(4)]
    lines: list[str] = []
    two = maximal_correlations(tests, jobs=2, progress=lines.append)
    assert np.array_equal(two.psi, maximal_correlations(tests).psi)
    assert two.subsets == subsets_up_to(4, 3)
    assert len(lines) == 8
    assert lines[0] == "test 0 displacement 1 of 2: 14 subsets"


@pytest.mark.parametrize("jobs", [1, 2])
def test_stopped_it_returns_what_is_done(jobs: int) -> None:
    done = 0

    def stop(_: str) -> None:
        nonlocal done
        done += 1
        if done == 3:
            raise KeyboardInterrupt

    tests = [trial(k, 50) for k in range(4)]
    found = maximal_correlations(tests, jobs=jobs, progress=stop)
    whole = maximal_correlations(tests)
    assert not found.complete
    reached = np.isfinite(found.psi).all(axis=1)
    assert reached.sum() == 3
    for k, d in ((0, 0), (0, 1), (1, 0)):
        assert np.array_equal(found.psi[d, :, k], whole.psi[d, :, k])


def test_the_right_set_wins() -> None:
    # W-11, W-12: the displacement needs temperatures 1 and 3, in bent form
    tests = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        T = rng.uniform(0, 3, size=(300, 5))
        S = np.log(1 + 2 * T[:, 1] ** 2 + np.exp(T[:, 3])) + 0.01 * rng.normal(size=300)
        tests.append(DataSet(f"{seed}", T, S[:, None]))
    found = maximal_correlations(tests, subsets_up_to(5, 2))
    summed = found.psi[0].sum(axis=1)
    assert found.subsets[int(summed.argmax())] == (1, 3)
    assert summed.max() > 3 * 0.99
    assert found.least_size(0.98) == 2
    assert found.least_size(0.9999) is None


def test_measured_series(shared_data: Path) -> None:
    data = pd.read_csv(shared_data / "fl_thermal" / "recording.csv").iloc[::30]
    T = data.filter(regex=r"^t\d+_C$").to_numpy()[:, :6]  # steps of 0.1 degC, near-duplicates
    found = maximal_correlations([DataSet("fl", T, data[["ch1_um", "ch3_um"]])], subsets_up_to(6))
    assert ((found.psi > 0) & (found.psi < 1)).all()
    assert found.psi[1].max() > 0.99
    for d in range(2):  # more temperatures explain more, up to what is left of the last sweeps and of the boxcar
        by_size = [
            max(p for p, s in zip(found.psi[d, :, 0], found.subsets, strict=True) if len(s) == k) for k in (1, 2, 3)
        ]
        assert by_size == sorted(by_size)


def test_dead_channels_do_no_harm() -> None:
    t = trial(5)
    T, S = np.asarray(t.temperatures).copy(), np.asarray(t.displacements).copy()
    T[:, 0] = 21.5
    S[:, 1] = 3.0
    found = maximal_correlations([DataSet("t", T, S)], [(0,), (1,), (0, 1)])
    assert found.psi[0, 0, 0] == 0.0
    assert found.psi[0, 1, 0] == found.psi[0, 2, 0] > 0
    assert (found.psi[1] == 0).all()


def test_bad_input_is_refused() -> None:
    t = trial(0)
    T, S = np.asarray(t.temperatures).copy(), np.asarray(t.displacements)
    with pytest.raises(InputError, match="no test given"):
        maximal_correlations([])
    with pytest.raises(FitError, match="short: 20 rows, but the boxcar spans 21"):
        maximal_correlations([DataSet("short", T[:20], S[:20])])
    with pytest.raises(InputError, match=r"found the shapes \(90, 4\) and \(90,\)"):
        maximal_correlations([DataSet("t", T, S[:, 0])])
    with pytest.raises(InputError, match=r"have different numbers.*\(3, 2\), \(4, 2\)"):
        maximal_correlations([t, DataSet("t", T[:, :3], S)])
    with pytest.raises(InputError, match=r"subset \(0, 9\): expected indices of the 4"):
        maximal_correlations([t], [(0, 9)])
    with pytest.raises(InputError, match="half_window >= 1"):
        maximal_correlations([t], half_window=0)
    T[7, 2] = np.nan
    with pytest.raises(FitError, match="hole: row 7 contains NaN or infinity"):
        maximal_correlations([DataSet("hole", T, S)])
