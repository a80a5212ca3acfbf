"""From a programme to a recording, on a machine whose answers can be told in advance."""

import tracemalloc
from typing import Any

import numpy as np
import pytest
from fakemachine import FakeMachine
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual import experiments
from thermocomp.virtual.climate import STILL
from thermocomp.virtual.experiments import SimulatedTest, run, simulate
from thermocomp.virtual.instruments import Touch, mounting
from thermocomp.virtual.kits import CENTRE
from thermocomp.virtual.machine import FeedDrive
from thermocomp.virtual.protocol import Experiment, PlannedTest, Programme
from thermocomp.virtual.segments import SteadySegment
from thermocomp.virtual.sensors import SensorFault

FloatArray = NDArray[np.float64]
GOLDEN = [[22.22, 22.1, 22.28, 0.15], [48.76, 49.92, 22.74, 59.94], [75.82, 78.14, 23.1, 119.75]]
RUN = (SteadySegment(40.0), SteadySegment(60.0, FeedDrive(3000.0, (300.0, 400.0, 0.0))), SteadySegment(40.0))


def programme(**more: Any) -> Programme:
    given: dict[str, Any] = {
        "name": "t",
        "sampling": 20.0,
        "segments": RUN,
        "climate": STILL,
        "soak": (SteadySegment(3600.0),),
    }
    return Programme(**(given | {"places": ("housing",), "probes": ("x1", "z"), "perfect": True} | more))


def done(made: Programme, machine: FakeMachine | None = None, seed: int = 0, **more: Any) -> SimulatedTest:
    weather, noise = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    return run(machine or FakeMachine(), CENTRE, made, weather, noise, **more)


def column(test: SimulatedTest, name: str) -> FloatArray:
    return test.values[:, [c.name for c in test.channels].index(name)]


def test_a_row_tells_what_led_to_it() -> None:
    test = done(programme())
    assert [c.name for c in test.channels] == ["t_housing_C", "x1_um", "z_um", "spindle_rpm", "feed_mm_min"]
    assert test.time.tolist() == [20.0 * k for k in range(8)]
    assert column(test, "spindle_rpm").tolist() == [0, 0, 0, 3000, 3000, 3000, 0, 0]
    assert column(test, "feed_mm_min").tolist() == [0, 0, 0, 500, 500, 500, 0, 0]
    # 0.001 K per turn, 1000 turns in 20 s
    np.testing.assert_allclose(column(test, "t_housing_C"), 22.0 + np.array([0, 0, 0, 1, 2, 3, 3, 3]))
    np.testing.assert_allclose(column(test, "x1_um"), [0, 0, 0, 1, 2, 3, 3, 3])
    np.testing.assert_allclose(column(test, "z_um"), 3.0 * np.array([0, 0, 0, 1, 2, 3, 3, 3]))
    np.testing.assert_array_equal(test.truth, test.values[:, 1:3])
    assert [c.name for c in test.displacements] == ["x1_um", "z_um"]


def test_displacements_count_from_the_first_row() -> None:
    test = done(programme(soak=(SteadySegment(3600.0, FeedDrive(1000.0)),), probes=("z", "y_laser_50")))
    assert test.values[0, 0] == pytest.approx(22.0 + 60.0)
    assert test.truth[0, 0] == 0.0
    assert test.truth[0, 1] == pytest.approx(8.48, abs=0.01)  # the cold profile stays


def test_slow_sampling_asks_the_machine_often_enough() -> None:
    machine = FakeMachine()
    test = done(programme(sampling=100.0, segments=(SteadySegment(200.0, FeedDrive(600.0)),)), machine)
    assert machine.steps == [180, 10]
    np.testing.assert_allclose(test.truth[:, 0], [0.0, 1.0, 2.0])
    told = done(programme(sampling=100.0, segments=(SteadySegment(200.0, FeedDrive(600.0)),)), whole=True).observables
    assert told is not None
    warm = told / (1.0 + np.arange(len(FakeMachine.observables)))
    np.testing.assert_allclose(warm, np.repeat([[0.0], [1.0], [2.0]], told.shape[1], axis=1), atol=1e-12)


def test_blocks_leave_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    segments = (SteadySegment(6000.0, FeedDrive(2000.0)), SteadySegment(6000.0))
    made = programme(sampling=60.0, segments=segments, perfect=False, places=("all",), probes=("nest",))
    machine = FakeMachine()
    whole = done(made, machine)
    assert machine.steps == [180, 600]
    monkeypatch.setattr(experiments, "BLOCK", 50)
    machine = FakeMachine()
    parts = done(made, machine)
    assert max(machine.steps) == 50
    np.testing.assert_allclose(parts.values, whole.values, atol=1e-9)
    np.testing.assert_allclose(parts.truth, whole.truth, atol=1e-9)


def test_sensors_lag_scatter_and_are_rounded() -> None:
    segments = (SteadySegment(20.0), SteadySegment(3600.0, FeedDrive(600.0)))
    real = done(programme(segments=segments, perfect=False, probes=("z",)))
    ideal = done(programme(segments=segments, probes=("z",)))
    mounted = mounting("housing")
    late = ideal.values[-50:, 0] - real.values[-50:, 0]
    # a ramp of 0.01 K/s: a lag of tau comes late by tau, and the air cools by the share that is not in contact
    warm = ideal.values[-50:, 0] - 22.0
    expected = mounted.contact * 0.01 * mounted.lag + (1.0 - mounted.contact) * warm - mounted.bias
    assert np.mean(late - expected) == pytest.approx(0.0, abs=0.03)
    np.testing.assert_allclose(real.values[:, 0] / 0.02, np.round(real.values[:, 0] / 0.02), atol=1e-6)
    assert 0.1 < (real.values[:, 1] - real.truth[:, 0]).std() < 0.2


def test_noise_changes_readings_not_the_truth() -> None:
    made = programme(perfect=False, segments=(SteadySegment(36000.0),))
    usual, noisy = done(made), done(made, sensor_noise=0.4)
    np.testing.assert_array_equal(usual.truth, noisy.truth)
    np.testing.assert_array_equal(usual.values[:, 1:], noisy.values[:, 1:])
    assert (noisy.values[:, 0] - usual.values[:, 0]).std() == pytest.approx(0.35, rel=0.1)  # 0.4 instead of 0.05


def test_the_artefact_is_touched_while_the_spindle_stands() -> None:
    touch = Touch(60.0, {"p": (300.0, 250.0, 250.0), "q": (600.0, 250.0, 250.0)})
    test = done(programme(touch=touch, segments=(*RUN, SteadySegment(60.0))))
    touched = [c.name for c in test.channels].index("x_p_um")
    rows = np.flatnonzero(np.isfinite(test.values[:, touched : touched + 6]).all(axis=1))
    assert rows.tolist() == [0, 6, 9]  # due at 60 s, but the spindle turns until 100 s
    np.testing.assert_allclose(column(test, "x_p_um")[rows], [0.0, 3.0, 3.0])
    assert np.isfinite(test.truth).all()
    shares = dict(zip(FakeMachine.observables, 1 + np.arange(len(FakeMachine.observables)), strict=True))
    assert column(test, "x_q_um")[6] == pytest.approx(3.0 * (1 + shares["xx@600"] - shares["xx@300"]))


def test_faults_befall_a_test() -> None:
    made = programme(faults=(SensorFault("z_um", "stuck", 60.0),))
    test = done(made, faults=[SensorFault("t_housing_C", "lost", 100.0)])
    assert np.isnan(column(test, "t_housing_C")).tolist() == [False] * 5 + [True] * 3
    assert column(test, "z_um").tolist() == [0.0] * 8
    np.testing.assert_array_equal(test.truth, done(programme()).truth)
    with pytest.raises(InputError, match=r"'t_hosing_C'; the nearest are t_housing_C"):
        done(programme(), faults=[SensorFault("t_hosing_C", "lost", 0.0)])


def test_a_seed_fixes_everything_on_every_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(experiments.MACHINES, ("centre", "linear"), FakeMachine)
    plan = PlannedTest(sampling=60.0, duration=3600.0, speed=1000.0, places=("usual",))
    experiment = Experiment(name="e", tests=(plan,))
    first, again, other = (next(iter(simulate(experiment, seed=s))) for s in (4, 4, 5))
    np.testing.assert_array_equal(first.values, again.values)
    assert not np.array_equal(first.values, other.values)
    # wherever it is run these figures come out, to the instruments' resolution
    some = first.values[[0, 30, 60]][:, [0, 8, 15, 18]]
    np.testing.assert_allclose(some, GOLDEN, atol=0.021)


def test_unusable_requests_are_refused() -> None:
    experiment = Experiment(name="e", tests=(PlannedTest(sampling=60.0, duration=3600.0),))
    with pytest.raises(InputError, match="seed -1"):
        simulate(experiment, seed=-1)
    for noise in (-0.1, float("nan"), float("inf")):
        with pytest.raises(InputError, match="sensor noise"):
            simulate(experiment, sensor_noise=noise)
    with pytest.raises(InputError, match="not a multiple"):
        programme(segments=(SteadySegment(50.0),))


def test_a_month_takes_little_more_memory_than_its_recording() -> None:
    made = programme(
        sampling=10.0, segments=(SteadySegment(30 * 86400.0, FeedDrive(1000.0)),), places=("all",), perfect=False
    )
    tracemalloc.start()
    test = done(made)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(test.time) == 259_201
    assert peak < 1.5 * (test.values.nbytes + test.truth.nbytes)
