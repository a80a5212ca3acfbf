"""`dynamic`: ridge on temperatures, their lagged copies and the lagged spindle speed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.dynamic import MINUTE, DynamicRidge
from thermocomp.models.numerics.folds import number_folds
from thermocomp.recording.samples import Samples

LAGS = {"temperature_lags": ((), (20 * MINUTE,)), "speed_lags": ((20 * MINUTE,), (20 * MINUTE, 90 * MINUTE))}


def fitted(samples: Samples, target: int = 0, **settings: object) -> DynamicRidge:
    estimator = DynamicRidge(speed=["spindle_rpm"], **{**LAGS, **settings})  # type: ignore[arg-type]
    return estimator.fit(samples.frame(), samples.deviations[:, target], dt=samples.dt(), cycle=samples.cycle)


def test_finds_the_lags_of_the_machine(samples: Samples) -> None:
    estimator = fitted(samples)
    assert estimator.speed_lags_ == (20 * MINUTE, 90 * MINUTE)
    assert estimator.cv_rms_ < 0.4
    assert estimator.chosen_by_ == "4 thermal cycles, left out in turn"
    residual = samples.deviations[:, 0] - estimator.predict(samples.frame(), dt=samples.dt())
    assert np.sqrt(np.mean(residual**2)) < 0.2  # the probe's own noise is 0.1 um


def test_labels_name_every_feature(samples: Samples) -> None:
    estimator = fitted(samples, copies="lagged")
    assert len(estimator.feature_labels_) == len(estimator.coef_)
    assert estimator.feature_labels_[0] == "t1_C"
    assert estimator.feature_labels_[-1] == "spindle_rpm^2 lagged 90 min"


@pytest.mark.parametrize("copies", ["high-passed", "lagged"])
@pytest.mark.parametrize("intercept", [True, False])
def test_choice_by_moments_equals_plain_refits(copies: str, intercept: bool, samples: Samples) -> None:
    """The errors computed from sums of products are those of refitting and predicting each cycle left out."""
    strengths = (1e-4, 1e-2)
    estimator = fitted(samples, copies=copies, fit_intercept=intercept, strengths=strengths, rule="minimum")
    X, y, cycle = samples.frame(), samples.deviations[:, 0], samples.cycle
    features = np.vstack(list(estimator._features(X.to_numpy(), samples.dt())))[:, estimator._columns]
    errors = np.empty((2, 4))
    for k in range(4):
        learn = cycle != k
        Z, mean_y = features[learn], y[learn].mean() if intercept else 0.0
        mean = Z.mean(axis=0) if intercept else np.zeros(Z.shape[1])
        scale = np.sqrt(((Z - mean) ** 2).mean(axis=0))
        A = (Z - mean) / scale
        for i, strength in enumerate(strengths):
            damped = np.vstack([A, np.sqrt(strength * learn.sum()) * np.eye(A.shape[1])])
            w = np.linalg.lstsq(damped, np.r_[y[learn] - mean_y, np.zeros(A.shape[1])], rcond=None)[0]
            residual = y[~learn] - mean_y - ((features[~learn] - mean) / scale) @ w
            errors[i, k] = np.sqrt(np.mean(residual**2))
    assert estimator.cv_rms_ == pytest.approx(errors.mean(axis=1).min(), rel=1e-6)


def test_one_standard_error_rule_shrinks_more(samples: Samples) -> None:
    least, careful = fitted(samples, rule="minimum"), fitted(samples)
    assert careful.strength_ >= least.strength_
    assert careful.cv_rms_ >= least.cv_rms_


def test_rows_that_are_not_learned_from_only_drive_the_lags(samples: Samples) -> None:
    cycle = np.where(samples.cycle == 1, -1, samples.cycle)
    y = samples.deviations[:, 0].copy()
    models = []
    for value in (0.0, 1e9):
        y[samples.cycle == 1] = value
        e = DynamicRidge(speed=["spindle_rpm"], **LAGS).fit(samples.frame(), y, dt=samples.dt(), cycle=cycle)  # type: ignore[arg-type]
        models.append(e.freeze(target="z"))
    assert models[0] == models[1]


def test_without_time_every_row_is_at_rest(samples: Samples) -> None:
    estimator = fitted(samples)
    X = samples.frame()
    alone = np.array([estimator.predict(X.iloc[[k]])[0] for k in (0, 50, 600)])
    assert estimator.predict(X)[[0, 50, 600]] == pytest.approx(alone, rel=1e-12)


def test_chunks_do_not_matter(samples: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = fitted(samples)
    monkeypatch.setattr("thermocomp.models.dynamic._CHUNK", 97)
    parts = fitted(samples)
    assert parts.coef_ == pytest.approx(whole.coef_, rel=1e-6)
    X = samples.frame()
    assert parts.predict(X, dt=samples.dt()) == pytest.approx(whole.predict(X, dt=samples.dt()), abs=1e-9)


def test_constant_and_copied_channels_are_harmless(samples: Samples) -> None:
    X = samples.frame()
    X["dead_C"] = 0.0
    X["copy_C"] = X["t1_C"]
    estimator = DynamicRidge(speed=["spindle_rpm"], **LAGS)  # type: ignore[arg-type]
    estimator.fit(X, samples.deviations[:, 0], dt=samples.dt(), cycle=samples.cycle)
    assert np.isfinite(estimator.coef_).all()
    model = estimator.freeze(target="z")
    assert "dead_C" not in [i.name for i in model.inputs]
    assert "copy_C" in model.sensors


def test_bad_input(samples: Samples) -> None:
    X, y = samples.frame(), samples.deviations[:, 0]
    with pytest.raises(InputError, match="speed column 'rpm'"):
        DynamicRidge(speed=["rpm"]).fit(X, y)
    with pytest.raises(InputError, match="time steps"):
        DynamicRidge().fit(X, y, dt=[1.0, 2.0])
    with pytest.raises(InputError, match="cycle: want 800 numbers"):
        DynamicRidge().fit(X, y, cycle=[0, 1])
    with pytest.raises(FitError, match="no row to learn from"):
        DynamicRidge().fit(X, y, cycle=np.full(len(X), -1))


@settings(max_examples=30)
@given(st.lists(st.integers(-1, 3), min_size=1, max_size=200).filter(lambda c: max(c) >= 0))
def test_folds_cover_what_is_learned_from(labels: list[int]) -> None:
    cycle = np.sort(np.array(labels))
    folds, _ = number_folds(cycle, len(cycle))
    assert ((folds >= 0) == (cycle >= 0)).all()
    assert set(folds[folds >= 0]) == set(range(folds.max() + 1))


def test_published_block(shared_data: Path) -> None:
    """fl_thermal: below the published best in every channel, 1.9 um in the mean; ridge beats plain least squares."""
    import pandas as pd

    table = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")
    X = table[["spindle_rpm", *(f"t{k}_C" for k in range(1, 17))]]
    X = X - X.iloc[0]
    dt = np.r_[np.inf, np.full(len(X) - 1, 15.0)]
    cycle = np.searchsorted([1951, 3871, 5791, 7711], np.arange(len(X)), side="right")
    cycle[6669:] = -1
    errors = []
    for channel, published in zip(range(1, 6), (3.56, 3.76, 3.70, 3.46, 4.28), strict=True):
        y = table[f"ch{channel}_um"].to_numpy()
        estimator = DynamicRidge(speed=["spindle_rpm"]).fit(X, y, dt=dt, cycle=cycle)
        errors.append(np.abs(y - estimator.predict(X, dt=dt))[6669:].mean())
        assert errors[-1] < published
    assert np.mean(errors) <= 1.9
