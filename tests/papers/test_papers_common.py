"""What the studies share."""

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.ols import LeastSquares
from thermocomp.papers import common, pictures
from thermocomp.papers.common import Errors
from thermocomp.papers.study import Figure, Part, Study, StudyTable
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack


@pytest.fixture(scope="module")
def tests() -> Samples:
    """Two tests one after the other."""
    return stack([small_machine(), small_machine(seed=1)], ["z_um", "x_um"])


def test_channels_get_the_names_of_the_paper(recording: Recording) -> None:
    first = recording.temperatures[0].name

    named = common.rename_channels(recording, {"z_um": "z", first: "T1"})

    assert [c.name for c in named.channels] == ["z", "T1"]
    assert named.channel("T1").quantity == "temperature"
    pd.testing.assert_series_equal(named.table["T1"], recording.table[first], check_names=False)
    with pytest.raises(InputError, match="T99"):
        common.rename_channels(recording, {"T99": "T1"})


def test_a_derived_channel_is_a_weighted_sum(recording: Recording) -> None:
    a, b = (c.name for c in recording.temperatures[:2])

    more = common.add_derived_channel(recording, Channel("d", "temperature", "degC"), {a: 1.0, b: -1.0})

    assert len(more.channels) == len(recording.channels) + 1
    np.testing.assert_allclose(more.table["d"], recording.table[a] - recording.table[b])


@pytest.mark.parametrize(("law", "largest", "std"), [("uniform", 0.4, 0.4 / 3**0.5), ("normal", 4.0, 0.4)])
def test_noise_is_on_the_temperatures_alone(law: str, largest: float, std: float, tests: Samples) -> None:
    noisy = common.with_noise(tests, 0.4, "uniform" if law == "uniform" else "normal", seed=1)

    error = noisy.values - tests.values
    warm = np.array([c.quantity == "temperature" for c in tests.inputs])
    assert not error[:, ~warm].any()
    assert np.abs(error[:, warm]).max() <= largest
    assert error[:, warm].std() == pytest.approx(std, rel=0.05)
    np.testing.assert_array_equal(noisy.deviations, tests.deviations)
    assert not np.array_equal(noisy.values, common.with_noise(tests, 0.4, "uniform", seed=2).values)


def test_the_noise_of_a_draw(tests: Samples) -> None:
    """C-33: numpy's own numbers, one for each reading of a temperature."""
    warm = np.array([c.quantity == "temperature" for c in tests.inputs])
    shape = tests.values.shape
    uniform, normal = (common.with_noise(tests, 0.4, law, 3).values - tests.values for law in ("uniform", "normal"))
    np.testing.assert_allclose(uniform, np.random.default_rng(3).uniform(-0.4, 0.4, shape) * warm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(normal, np.random.default_rng(3).normal(0.0, 0.4, shape) * warm, rtol=0, atol=1e-9)


def test_a_sensor_that_is_cut_off_stays_at_its_zero(tests: Samples) -> None:
    name = tests.inputs[1].name

    cut = common.cut_off(tests, name)

    assert not cut.change()[:, 1].any()
    rest = [j for j in range(len(tests.inputs)) if j != 1]
    np.testing.assert_array_equal(cut.values[:, rest], tests.values[:, rest])
    with pytest.raises(InputError, match="T99"):
        common.cut_off(tests, "T99")


def test_the_replay_gives_what_the_estimator_predicts(tests: Samples) -> None:
    estimator = LeastSquares()

    models = common.fit_and_freeze(estimator, tests, ["x_um"])

    np.testing.assert_allclose(
        common.predict_deviation(models["x_um"], tests), estimator.predict(tests.frame()), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        common.residual(models["x_um"], tests), tests.deviations[:, 1] - estimator.predict(tests.frame()), atol=1e-9
    )


def test_a_net_learns_several_targets_at_once(tests: Samples) -> None:
    net = SigmoidNet(hidden=3, n_epochs=20)

    models = common.fit_and_freeze(net, tests, ["x_um", "z_um"])

    both = np.column_stack([common.predict_deviation(m, tests) for m in models.values()])
    assert list(models) == ["x_um", "z_um"]
    assert [m.target for m in models.values()] == ["x_um", "z_um"]
    np.testing.assert_allclose(both, net.predict(tests.frame()), rtol=0, atol=1e-9)


def test_a_method_with_a_memory_gets_its_clock(tests: Samples) -> None:
    speeds = [c.name for c in tests.inputs if c.quantity == "spindle_speed"]
    estimator = DynamicRidge(speed=speeds, time="routed")

    model = common.fit_and_freeze(estimator, tests, ["z_um"], dt=tests.dt(), cycle=tests.cycle)["z_um"]

    np.testing.assert_allclose(
        common.predict_deviation(model, tests), estimator.predict(tests.frame(), dt=tests.dt()), rtol=0, atol=1e-9
    )


def test_a_paper_s_model_does_not_stop_at_its_trained_range(tests: Samples) -> None:
    only = tests.only([tests.inputs[0].name])
    estimator = LeastSquares()
    model = common.fit_and_freeze(estimator, only, ["z_um"])["z_um"]

    far = 50.0 * float(np.abs(only.change()).max())
    state, _ = model.step(model.init(), np.zeros(1), 0.0)
    state, deviation = model.step(state, np.array([far]), 60.0)

    assert float(deviation) == pytest.approx(
        float(estimator.predict(pd.DataFrame([[far]], columns=[only.inputs[0].name]))[0])
    )
    assert not state.outside.any()


def test_errors_by_hand() -> None:
    errors = Errors.of(np.array([[3.0, np.nan], [-4.0, 0.0]]))

    assert errors.rms == pytest.approx((25 / 3) ** 0.5)
    assert errors.mae == pytest.approx(7 / 3)
    assert (errors.max_abs, errors.peak_to_peak) == (4.0, 7.0)


def test_the_table_of_errors_has_a_row_per_residual() -> None:
    table = common.errors_table("errors", {("z", "none"): np.array([1.0, -1.0]), ("z", "net"): np.zeros(2)})

    assert table.header[2] == "RMS [um]"
    assert table.rows[0] == ["z", "none", "1.00", "1.00", "1.00", "2.00"]
    assert table.rows[1][2:] == ["0.00"] * 4


def test_tests_are_put_end_to_end(tests: Samples) -> None:
    hours, values = pictures.end_to_end(tests, tests.deviations[:, 0])

    n = int((tests.test == 0).sum())
    assert len(hours) == len(values) == len(tests) + 1
    assert np.isnan(values[n])
    assert np.isnan(values).sum() == 1
    assert (np.diff(hours) >= 0).all()
    assert hours[-1] == pytest.approx((tests.time[n - 1] + tests.time[-1]) / 3600)


def test_a_study_is_its_parts_one_after_the_other() -> None:
    table, figure = StudyTable("t", ("a",), []), Figure("k", "c", [])
    made = Study.of("n", "T", Part([], [table], [figure], {"a": 1.0}), Part([], [], [figure], {"b": 2.0}))
    assert (made.name, made.title, made.claims, made.tables) == ("n", "T", (), (table,))
    assert made.figures == (figure, figure)
    assert made.numbers == {"a": 1.0, "b": 2.0}


def test_curves_over_the_same_x() -> None:
    x = np.arange(3.0)
    drawn = pictures.curves(x, {"a": x, "b": 2 * x, "c": 3 * x}, dashed=["b"], points=["c"])
    assert [(c.label, c.style) for c in drawn] == [("a", "line"), ("b", "dashed"), ("c", "points")]
    assert all(c.x is x for c in drawn)
    assert [c.style for c in pictures.curves(x, {"a": x}, "points")] == ["points"]


def test_the_share_that_is_described() -> None:
    drift = np.array([0.0, 1.0, 2.0, 3.0])
    assert common.described(0 * drift, drift) == 1
    assert common.described(drift - drift.mean(), drift) == 0
    assert common.described(np.array([0.5, -0.5, 0.0, 0.0]), drift) == pytest.approx(0.9)
