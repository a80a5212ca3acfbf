"""`averaged`: many ridges on random structures of lags and speed states, merged into one model."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.exceptions import InputError
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.models.averaged import DIRECTIONS, AveragedDynamic
from thermocomp.models.numerics.folds import halve, number_folds
from thermocomp.models.numerics.structures import fit_each
from thermocomp.models.pacedfeatures import PacedFeatures
from thermocomp.models.training import fit_method, train
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

FloatArray = NDArray[np.float64]


def fitted(samples: Samples, y: FloatArray | None = None, cycle: Any = None, **settings: Any) -> AveragedDynamic:
    settings = {"speed": ["spindle_rpm"], "time": "routed", "structures": 40, **settings}
    return AveragedDynamic(**settings).fit(
        samples.frame(),
        samples.deviations[:, 0] if y is None else y,
        dt=samples.dt(),
        cycle=samples.cycle if cycle is None else cycle,
    )


def features(rng: np.random.Generator, n_rows: int = 400) -> tuple[PacedFeatures, FloatArray, FloatArray]:
    """Return features, rows of two temperatures and a speed, and time steps."""
    step = np.r_[np.inf, np.full(n_rows - 1, 60.0)]
    rows = np.column_stack([rng.normal(size=(n_rows, 2)), 3000.0 * (np.arange(n_rows) % 100 < 50)])
    of = PacedFeatures.of(
        rows,
        step,
        np.ones(n_rows, dtype=bool),
        [2],
        lags=(600.0, 3600.0),
        powers=(2.0,),
        stopped=(3600.0,),
        running=(900.0,),
    )
    return of, rows, step


def test_it_errs_little_on_cycles_it_has_not_seen(samples: Samples) -> None:
    for k in range(4):
        cycle = np.where(samples.cycle == k, -1, samples.cycle)
        found = fitted(samples, cycle=cycle, structures=200).predict(samples.frame(), dt=samples.dt())
        out = samples.cycle == k
        error = np.sqrt(np.mean((found - samples.deviations[:, 0])[out] ** 2))
        assert error < 0.1 * np.sqrt(np.mean(samples.deviations[out, 0] ** 2))


def test_the_frozen_model_is_the_estimator(samples: Samples) -> None:
    estimator = fitted(samples)
    inputs = samples.model_inputs(range(len(samples.inputs)), np.ones(len(samples), dtype=bool))
    model = estimator.freeze(target="z_um", inputs=inputs)
    expected = estimator.predict(samples.frame(), dt=samples.dt())
    table = estimator._features.table(samples.change(), samples.dt())
    spread = np.sqrt(((table @ estimator._spread.T) ** 2).sum(axis=1))
    assert isinstance(model, PacedDynamic)
    state, values = model.init(samples.reference()[0]), samples.values
    for k in range(300):
        state, deviation = model.step(state, values[k], 0.0 if k == 0 else samples.dt()[k])
        assert state.memory is not None
        assert deviation == pytest.approx(expected[k], rel=1e-9, abs=1e-9)
        assert np.linalg.norm(model.directions(state, values[k])) == pytest.approx(spread[k], rel=1e-3, abs=1e-6)
    assert len(model.spread) <= DIRECTIONS


def test_in_the_reference_state_it_says_zero(samples: Samples) -> None:
    assert fitted(samples).predict(0.0 * samples.frame()[:1], dt=[np.inf]) == pytest.approx(0.0)


def test_rows_that_are_not_learned_from_only_drive_the_states(samples: Samples) -> None:
    cycle = np.where(samples.cycle == 1, -1, samples.cycle)
    y = np.where(samples.cycle == 1, 1e9, samples.deviations[:, 0])
    assert np.array_equal(fitted(samples, y, cycle).coef_, fitted(samples, cycle=cycle).coef_)


def test_a_prediction_left_out_knows_nothing_of_its_cycle(samples: Samples) -> None:
    y = samples.deviations[:, 0].copy()
    before = fitted(samples, y, structures=1).left_out_
    y[samples.cycle == 2] += 100.0
    after = fitted(samples, y, structures=1).left_out_
    same = samples.cycle == 2
    assert np.array_equal(before[same], after[same])
    assert not np.allclose(before[~same, 0], after[~same, 0])
    assert np.array_equal(before[:, 1], np.zeros(len(y)))  # one structure has no spread


def test_structures_that_err_less_count_more(samples: Samples) -> None:
    """The average errs less on what was left out than equal shares do, and no share is negative."""
    estimator = fitted(samples, structures=60)
    of, parts = estimator._features, halve(number_folds(samples.cycle, len(samples))[0], samples.values[:, -1] > 0)[0]
    moments = of.moments(samples.change(), samples.deviations[:, :1], samples.dt(), parts, 0.4)
    errors = []
    for k in range(8):
        each = fit_each(moments, of.draw(60, 0), set(range(8)) - {k})
        errors.append(moments.error(k, each.mean(axis=0)))
    assert estimator.cv_rms_ < float(np.sqrt(errors).mean())


def test_the_noise_that_is_added_is_that_of_the_features() -> None:
    rng = np.random.default_rng(2)
    of, rows, step = features(rng)
    rows[:5, :2] = rows[0, :2]  # five readings make the zero
    drawn = []
    for _ in range(300):
        noise = 0.4 * rng.normal(size=(400, 2))
        noise -= noise[:5].mean(axis=0)
        drawn.append(of.table(np.column_stack([noise, rows[:, 2]]), step)[-1, :6])
    expected = of.moments(rows, rows[:, :1], step, np.zeros(400, dtype=np.intp), 0.4).noise
    assert np.cov(np.array(drawn).T) == pytest.approx(expected[:6, :6], abs=0.04)
    assert np.array_equal(expected[6:], np.zeros((1, 7)))


def test_a_ridge_with_noise_is_one_that_was_trained_with_noise() -> None:
    rng = np.random.default_rng(3)
    of, rows, step = features(rng, 800)
    y = (rows[:, 0] + 0.5 * rows[:, 1])[:, None]
    structure = of.draw(1, 0)[0]
    parts = np.zeros(800, dtype=np.intp)
    exact = fit_each(of.moments(rows, y, step, parts, 0.8), [structure], [0])[0, structure.columns]
    noisy = []
    for _ in range(60):
        noise = np.column_stack([0.8 * rng.normal(size=(800, 2)), np.zeros(800)])
        noisy.append(of.moments(rows + noise - noise[0], y, step, parts, 0.0))
    gram, cross = (np.mean([getattr(m, what)[0] for m in noisy], axis=0) for what in ("gram", "cross"))
    among = np.ix_(structure.columns, structure.columns)
    clean = of.moments(rows, y, step, parts, 0.0)
    strengths = np.diag(structure.strengths * np.diag(clean.gram[0][among]))
    weights = np.linalg.solve(gram[among] + strengths, cross[structure.columns])
    assert weights == pytest.approx(exact, abs=0.2)  # 60 zeros were drawn
    assert np.abs(fit_each(clean, [structure], [0])[0, structure.columns] - exact).max() > 0.3


def test_it_leans_on_sensors_the_less_the_noisier_they_are(samples: Samples) -> None:
    quiet, noisy = (fitted(samples, noise=n).gain_ for n in (0.0, 2.0))
    assert quiet[-1] == noisy[-1] == 0.0  # a speed has none
    assert noisy.max() < 0.5 * quiet.max()


def test_cycles_are_halved_where_the_spindle_stops() -> None:
    folds = np.repeat([0, 1, -1, 2], [10, 10, 4, 10])
    turning = np.concatenate([np.arange(10) < 6, np.arange(10) < 10, np.ones(4), [1, 0, 0, 1, 0, 0, 0, 0, 0, 0]]) > 0
    parts, words = halve(folds, turning)
    assert parts.tolist() == [*[0] * 6, *[1] * 4, *[2] * 5, *[3] * 5, *[-1] * 4, *[4] * 4, *[5] * 6]
    assert words == "halves of 3 thermal cycles (run, stop), left out in turn"
    many, words = halve(np.repeat(np.arange(40), 3), np.ones(120, dtype=bool))
    assert sorted(set(many.tolist())) == list(range(16))
    assert words == "40 thermal cycles, left out in 16 groups in turn"


def test_lags_that_the_rows_say_nothing_of_are_left_out(samples: Samples) -> None:
    estimator = fitted(samples, lags=(10.0, 600.0, 3600.0))
    assert estimator.lags_ == (600.0, 3600.0)
    assert len(estimator.feature_labels_) == len(estimator.coef_)
    assert estimator.feature_labels_[0] == "t1_C"
    assert estimator.feature_labels_[-1] == "spindle_rpm^3 lagged 270 to 135 min"


def test_temperatures_alone_or_the_speed_alone_will_do(samples: Samples) -> None:
    frame, dt, y = samples.frame(), samples.dt(), samples.deviations[:, 0]
    warm = AveragedDynamic(time="routed").fit(frame.drop(columns="spindle_rpm"), y, dt=dt, cycle=samples.cycle)
    fast = AveragedDynamic(speed=["spindle_rpm"], time="routed").fit(
        frame[["spindle_rpm"]], y, dt=dt, cycle=samples.cycle
    )
    for estimator, columns in ((warm, frame.drop(columns="spindle_rpm")), (fast, frame[["spindle_rpm"]])):
        residual = estimator.predict(columns, dt=dt) - y
        assert np.sqrt(np.mean(residual**2)) < 0.2 * np.sqrt(np.mean(y**2))
        model = estimator.freeze(target="z_um")
        assert {i.name for i in model.inputs} <= set(columns)
        kept, expected = columns[[i.name for i in model.inputs]].to_numpy(), estimator.predict(columns, dt=dt)
        state = model.init(np.zeros(len(model.inputs)))
        for row, step, wanted in zip(kept[:300], dt[:300], expected[:300], strict=True):
            state, found = model.step(state, row, step if np.isfinite(step) else 0.0)
            assert found == pytest.approx(wanted, abs=1e-6)


def test_a_dead_sensor_has_no_weight(samples: Samples) -> None:
    frame = samples.frame().assign(dead=0.0)
    estimator = AveragedDynamic(speed=["spindle_rpm"], time="routed", noise=0.0, structures=10)
    estimator.fit(frame, samples.deviations[:, 0], dt=samples.dt(), cycle=samples.cycle)
    model = estimator.freeze(target="z_um")
    assert "dead" not in model.sensors
    assert np.isfinite(estimator.coef_).all()


def test_a_spindle_that_turned_before_and_stands_now(samples: Samples) -> None:
    standing = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")] == 0
    cycle = np.where(standing & (samples.cycle > 0), samples.cycle, -1)
    estimator = fitted(samples, cycle=cycle)
    assert estimator.top_speed_ > 1000.0
    residual = (estimator.predict(samples.frame(), dt=samples.dt()) - samples.deviations[:, 0])[cycle >= 0]
    assert np.sqrt(np.mean(residual**2)) < 0.1 * np.abs(samples.deviations[:, 0]).max()


@pytest.mark.parametrize("bad", [0, 2.5, float("nan")])
def test_structures_of_nonsense_are_refused(bad: float, samples: Samples) -> None:
    with pytest.raises(InputError, match=f"^structures {bad}: expected a whole number, at least 1"):
        fitted(samples, structures=bad)


@pytest.mark.parametrize("bad", [-1.0, float("inf"), float("nan")])
def test_a_noise_of_nonsense_is_refused(bad: float, samples: Samples) -> None:
    with pytest.raises(InputError, match=f"^noise {bad}: expected at least 0 degC"):
        fitted(samples, noise=bad)


@pytest.mark.parametrize("name", ["lags", "powers", "stopped", "running"])
@pytest.mark.parametrize("bad", [-5.0, 0.0, float("nan"), float("inf")])
def test_constants_of_nonsense_are_refused(name: str, bad: float, samples: Samples) -> None:
    with pytest.raises(InputError, match=rf"^{name} \(600.0, {bad}\): expected finite numbers, each more than 0"):
        fitted(samples, **dict[str, Any]({name: (600.0, bad)}))
    values: dict[str, Any] = {name: np.array([1.0, 2.0])}
    assert fitted(samples, structures=np.int64(5), **values).coef_.size  # arrays and their numbers will do


def test_its_band_comes_from_cycles_left_out(samples: Samples) -> None:
    model = train("averaged", samples, 0, samples.cycle < 3).model
    assert model.band is not None
    assert model.band.words == "90 % band by assumption, 3 cycles"
    assert train("averaged", samples, 0, samples.cycle < 1).model.band is None
    assert train("dynamic", samples, 0, samples.cycle < 3).model.band is None


def test_paces_may_change_from_row_to_row() -> None:
    rng = np.random.default_rng(4)
    signals, dt = rng.normal(size=(50, 3)), np.r_[np.inf, rng.uniform(1, 90, 49)]
    taus = rng.uniform(50, 500, (50, 3))
    found, memory = lagbank.run(signals, dt, taus), signals[0]
    for k in range(1, 50):
        memory = lagbank.follow(memory, signals[k], dt[k] / taus[k])
        assert found[k] == pytest.approx(memory, rel=1e-12)
    assert lagbank.run(signals, dt, np.tile(taus[0], (50, 1))) == pytest.approx(lagbank.run(signals, dt, taus[0]))


def test_six_sensors_of_a_real_machine(shared_data: Path) -> None:
    """fl_thermal, rows that may be learned from: each cycle left out, the mean of five channels."""
    targets = [f"ch{k}_um" for k in range(1, 6)]
    names = [f"t{k}_C" for k in (4, 5, 7, 9, 11, 16)]
    samples = stack([recordings.read(shared_data / "fl_thermal" / "recording.csv")], targets).only(
        [*names, "spindle_rpm"]
    )
    known = np.arange(len(samples)) < 6669
    errors = []
    for cycle in range(4):
        out = known & (samples.cycle == cycle)
        for k in range(5):
            fit = fit_method("averaged", samples, k, known & ~out)
            errors.append(np.abs(fit.predicted[out] - samples.deviations[out, k]).mean())
            assert isinstance(fit.estimator, AveragedDynamic)
            assert fit.estimator.gain_.max() < 5.0
    assert np.mean(errors) < 1.5
