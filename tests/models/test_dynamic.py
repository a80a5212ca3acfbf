"""`dynamic`: ridge on temperatures, their lagged copies and the lagged spindle speed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.dynamic import MINUTE, DynamicRidge
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.pacedfeatures import SHORTEST_LAG
from thermocomp.recordings.samples import Samples

LAGS = {"temperature_lags": ((), (20 * MINUTE,)), "speed_lags": ((20 * MINUTE,), (20 * MINUTE, 90 * MINUTE))}


def fitted(samples: Samples, target: int = 0, **settings: object) -> DynamicRidge:
    estimator = DynamicRidge(speed=["spindle_rpm"], **{**LAGS, "time": "routed", **settings})  # type: ignore[arg-type]
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
    tables = estimator._features(X.to_numpy(), samples.dt())
    features = np.vstack([table for _, table in tables])[:, estimator._columns]
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
        e = DynamicRidge(speed=["spindle_rpm"], time="routed", **LAGS)  # type: ignore[arg-type]
        e.fit(samples.frame(), y, dt=samples.dt(), cycle=cycle)
        models.append(e.freeze(target="z"))
    assert models[0] == models[1]


def test_without_time_every_row_is_at_rest(samples: Samples) -> None:
    X = samples.frame()
    estimator = DynamicRidge(time="none").fit(X, samples.deviations[:, 0])
    alone = np.array([estimator.predict(X.iloc[[k]])[0] for k in (0, 50, 600)])
    assert estimator.predict(X)[[0, 50, 600]] == pytest.approx(alone, rel=1e-12)


def network(seed: int, *, minutes: int = 96 * 60) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return four noisy temperatures and the deviation, every minute, of first-order bodies heated by two drives.

    The deviation comes from a body that no sensor sees, with a time constant of 15 min.
    """
    rng = np.random.default_rng(seed)
    power = np.zeros((minutes, 2))
    for drive in range(2):
        start = 0
        while start < minutes:
            end = start + int(rng.integers(60, 300))
            power[start:end, drive] = rng.uniform()
            start = end
    share = -np.expm1(-1.0 / np.array([20.0, 30.0, 90.0, 240.0, 15.0]))
    bodies = np.zeros((minutes + 1, 5))
    for k, (first, second) in enumerate(power):
        a, b, c, *_ = bodies[k]
        goals = np.array([10 * first, 8 * second, 0.5 * a + 0.4 * b, 0.6 * c, 0.8 * a + 0.6 * b])
        bodies[k + 1] = bodies[k] + share * (goals - bodies[k])
    noise = rng.normal(size=(minutes, 5))
    temperatures = bodies[1:, :4] + 0.2 * noise[:, :4]
    return temperatures, 5 * bodies[1:, 4] + 2 * bodies[1:, 2] + 0.3 * noise[:, 4]


def left(estimator: DynamicRidge, every: int) -> float:
    """Return the RMS that is left of another recording of the network with a row every so many minutes."""
    temperatures, deviation = network(4)
    y = deviation[::every]
    steps = np.r_[np.inf, np.full(len(y) - 1, every * MINUTE)]
    return float(np.sqrt(np.mean((y - estimator.predict(temperatures[::every], dt=steps)) ** 2)))


def learned_slowly(**settings: object) -> DynamicRidge:
    temperatures, deviation = (values[::20] for values in network(3))
    estimator = DynamicRidge(time="routed", **settings)  # type: ignore[arg-type]
    return estimator.fit(temperatures, deviation, dt=np.r_[np.inf, np.full(len(deviation) - 1, 20 * MINUTE)])


def test_learned_from_slow_rows_it_runs_at_fast_ones() -> None:
    estimator = learned_slowly()
    assert min(estimator.temperature_lags_) >= SHORTEST_LAG * 20 * MINUTE
    assert left(estimator, 1) < 1.5 * left(estimator, 20) < 2.0
    # a set is left out whole, and if none is left, temperatures are not lagged
    assert learned_slowly(temperature_lags=((5 * MINUTE,), (10 * MINUTE, 160 * MINUTE))).temperature_lags_ == ()


def test_without_the_limit_of_lags_fast_rows_go_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermocomp.models.dynamic.SHORTEST_LAG", 0.0)
    estimator = learned_slowly()
    assert min(estimator.temperature_lags_) < SHORTEST_LAG * 20 * MINUTE
    assert left(estimator, 1) > 3 * left(estimator, 20)


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
    estimator = DynamicRidge(speed=["spindle_rpm"], time="routed", **LAGS)  # type: ignore[arg-type]
    estimator.fit(X, samples.deviations[:, 0], dt=samples.dt(), cycle=samples.cycle)
    assert np.isfinite(estimator.coef_).all()
    model = estimator.freeze(target="z")
    assert "dead_C" not in [i.name for i in model.inputs]
    assert "copy_C" in model.sensors


def test_bad_input(samples: Samples) -> None:
    X, y = samples.frame(), samples.deviations[:, 0]
    with pytest.raises(InputError, match="speed column 'rpm'"):
        DynamicRidge(speed=["rpm"], time="none").fit(X, y)
    with pytest.raises(InputError, match="time steps"):
        DynamicRidge(time="routed").fit(X, y, dt=[1.0, 2.0])
    with pytest.raises(InputError, match="cycle: expected 800 numbers"):
        DynamicRidge(time="none").fit(X, y, cycle=[0, 1])
    with pytest.raises(FitError, match="no training rows"):
        DynamicRidge(time="none").fit(X, y, cycle=np.full(len(X), -1))


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
        estimator = DynamicRidge(speed=["spindle_rpm"], time="routed").fit(X, y, dt=dt, cycle=cycle)
        errors.append(np.abs(y - estimator.predict(X, dt=dt))[6669:].mean())
        assert errors[-1] < published
    assert np.mean(errors) <= 1.9
