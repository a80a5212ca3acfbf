"""The experiments have the papers' shapes, and look like measurements."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.correction import Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.simulation.centre import MachiningCentre
from thermocomp.simulation.climate import STILL, Climate, wandering
from thermocomp.simulation.experiments import EXPERIMENTS, SimulatedTest, run, simulate
from thermocomp.simulation.instruments import CHEN_PLACES, HWANG_PLACES, PROBES, cold_profile, felt
from thermocomp.simulation.machine import Air, Truth
from thermocomp.simulation.programmes import Programme, Segment
from thermocomp.simulation.sensors import Fault, Sensor, measure, with_faults

FloatArray = NDArray[np.float64]
TEMPERATURE = Channel("t_C", "temperature", "degC")


def columns(test: SimulatedTest, quantity: str) -> FloatArray:
    return test.values[:, [k for k, c in enumerate(test.channels) if c.quantity == quantity]]


def column(test: SimulatedTest, name: str) -> FloatArray:
    return test.values[:, [c.name for c in test.channels].index(name)]


def shapes(experiment: str) -> list[tuple[int, int, int]]:
    """Rows, temperatures and displacements of each test."""
    return [
        (len(t.time), columns(t, "temperature").shape[1], len(t.displacements)) for t in simulate(experiment, seed=1)
    ]


def test_the_promised_experiments_are_there() -> None:
    promised = {"chen1996", "wessel-fem", "hwang", "stepwise2017", "precompensation", "etve", "random", "demo"}
    assert promised <= set(EXPERIMENTS)
    assert all(e.description and "\n" not in e.description for e in EXPERIMENTS.values())


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_every_experiment_is_well_formed(experiment: str) -> None:
    for test in simulate(experiment):
        assert test.values.shape == (len(test.time), len(test.channels))
        assert test.truth.shape == (len(test.time), len(test.displacements))
        assert np.isfinite(test.values).all()
        assert test.time[0] == 0.0
        np.testing.assert_allclose(np.diff(test.time), test.time[1])
        assert len({c.name for c in test.channels}) == len(test.channels)
        assert columns(test, "spindle_speed").shape[1] == 1
        temperatures = columns(test, "temperature")
        assert temperatures.min() > 10.0
        assert temperatures.max() < 75.0
        # the probes say the truth but for their noise
        noise = columns(test, "displacement") - test.truth
        assert np.abs(noise).max() < 1.0
        if experiment != "chen1996-slope":
            np.testing.assert_array_equal(test.truth[0], 0.0)


def test_shapes_are_those_of_the_papers() -> None:
    assert shapes("chen1996") == [(162, 24, 5)] * 5  # 810 rows
    assert shapes("wessel-fem") == [(199, 3, 2)] * 2
    assert shapes("hwang") == [(37, 14, 1)]
    ((_, sensors, displacements),) = shapes("stepwise2017")
    assert (sensors, displacements) == (24, 1)
    assert shapes("chen1996-slope") == [(51, 24, 12)]
    assert all(s[2] == 4 for s in shapes("precompensation"))
    ((rows, sensors, displacements),) = shapes("demo")
    assert rows <= 8000
    assert (sensors, displacements) == (16, 5)


def test_chen_protocol() -> None:
    for test, speed in zip(simulate("chen1996"), (600, 1000, 1500, 2100, 2600), strict=True):
        rpm = column(test, "spindle_rpm")
        assert set(rpm) == {0.0, speed}
        assert np.count_nonzero(rpm) * 360.0 == 6 * 3600.0
        assert np.count_nonzero(rpm[-100:]) == 0  # 10 h of cooling
        names = [c.name for c in test.channels]
        assert all(f"t_{place}_C" in names for place in CHEN_PLACES)
    constant, drawn = simulate("chen1996-new")
    assert np.count_nonzero(column(constant, "spindle_rpm") == 1250.0) * 360.0 == 6.5 * 3600.0
    assert drawn.time[-1] > 8 * 3600.0
    rpm = column(drawn, "spindle_rpm")[2:]
    runs, stops = rpm.reshape(12, 15)[:, :10], rpm.reshape(12, 15)[:, 10:]
    assert (np.ptp(runs, axis=1) == 0.0).all()
    assert (runs > 0).all()
    assert (stops == 0).all()
    assert len(set(runs[:, 0])) > 4


def test_hwang_protocol() -> None:
    orders = []
    for seed in range(3):
        (test,) = simulate("hwang", seed=seed)
        assert [c.name for c in test.channels[:14]] == [f"t_{p}_C" for p in HWANG_PLACES]
        rpm, feed = column(test, "spindle_rpm"), column(test, "feed_mm_min")
        assert test.time[-1] == 6 * 3600.0
        conditions = set(zip(rpm.tolist(), feed.round().tolist(), strict=True))
        assert conditions == {(0.0, 0.0), (600.0, 508.0), (3000.0, 2006.0)}
        assert (rpm[1:].reshape(12, 3) == rpm[1::3, None]).all()  # 30 min each
        orders.append(tuple(rpm[1::3]))
    assert len(set(orders)) == 3


def test_a_row_tells_the_speed_that_led_to_it() -> None:
    segments = (Segment(40.0), Segment(60.0, 3000.0), Segment(40.0))
    programme = Programme("t", 20.0, segments, STILL, probes=("z",), perfect=True, soak=3600.0)
    test = run(MachiningCentre(), programme, np.random.default_rng(0), np.random.default_rng(0))
    assert column(test, "spindle_rpm").tolist() == [0, 0, 0, 3000, 3000, 3000, 0, 0]
    # centrifugal forces move the shaft at once: +4 um (3000/3500)^2
    jump = np.diff(test.truth[:, 0])
    assert jump[2] > 2.0
    assert jump[5] < -2.0


def test_environment_test_has_no_spindle() -> None:
    (test,) = simulate("etve")
    assert test.time[-1] == 24 * 3600.0
    assert not column(test, "spindle_rpm").any()
    assert np.ptp(column(test, "t_air_C")) > 2.0
    assert 2.0 < np.abs(test.truth).max() < 50.0
    layers = column(test, "t_air_top_C") - column(test, "t_air_floor_C")
    assert layers.mean() > 0.5


def test_slopes_of_the_laser_profiles() -> None:
    (test,) = simulate("chen1996-slope")
    positions = np.arange(0.0, 551.0, 50.0)
    cold = np.array([cold_profile(p) for p in positions])
    np.testing.assert_allclose(cold[[0, 1, 2, 5, 10, 11]], [0.24, 8.48, 7.74, -2.24, -15.83, -18.53], atol=0.01)
    thermal = test.truth - cold
    slopes = thermal[:, -1] / positions[-1]
    np.testing.assert_allclose(thermal, np.outer(slopes, positions), atol=1e-9)  # first order (C-05)
    warm = 1e3 * slopes[19]  # at the end of the run [um/m]
    assert warm > 20.0
    assert 1e3 * slopes[-1] < 0.5 * warm


def test_positions_of_precompensation_differ() -> None:
    identification, verification = simulate("precompensation")
    spread = np.ptp(identification.truth, axis=1).max()
    assert 1.0 < spread < 0.5 * np.abs(identification.truth).max()
    assert set(np.unique(column(verification, "spindle_rpm"))) != set(np.unique(column(identification, "spindle_rpm")))


def test_a_seed_fixes_everything() -> None:
    first, again, other = (simulate("random", seed=s)[0] for s in (4, 4, 5))
    np.testing.assert_array_equal(first.values, again.values)
    assert not np.array_equal(first.truth, other.truth)


def test_sensor_noise_changes_readings_not_the_truth() -> None:
    usual, noisy = (simulate("chen1996-new", sensor_noise=s)[0] for s in (None, 0.4))
    np.testing.assert_array_equal(usual.truth, noisy.truth)
    np.testing.assert_array_equal(columns(usual, "displacement"), columns(noisy, "displacement"))
    difference = columns(noisy, "temperature") - columns(usual, "temperature")
    assert difference.std() == pytest.approx(0.35, rel=0.1)  # the same noise, 0.4 instead of 0.05
    assert (simulate("wessel-fem")[0].values[:, 3:5] == simulate("wessel-fem")[0].truth).all()


def test_linear_regression_is_no_complete_answer() -> None:
    """Six cycles, each left out in turn: worse than in-sample, far better than nothing."""
    (test,) = simulate("demo")
    rpm = column(test, "spindle_rpm")
    starts = np.flatnonzero((rpm[:-1] == 0) & (rpm[1:] > 0)) + 1
    assert len(starts) == 6
    assert len(set(rpm)) == 7
    cycle = np.searchsorted(starts[1:], np.arange(len(rpm)), side="right")
    temperatures = columns(test, "temperature")
    design = np.column_stack([np.ones(len(rpm)), temperatures - temperatures[0]])
    for name in ("x1_um", "y1_um", "z_um"):
        y = column(test, name)
        seen = y - design @ np.linalg.lstsq(design, y)[0]
        unseen = np.empty(len(y))
        for k in range(6):
            out = cycle == k
            unseen[out] = y[out] - design[out] @ np.linalg.lstsq(design[~out], y[~out])[0]
        rms_seen, rms_unseen, rms_none = (float(np.sqrt(np.mean(e**2))) for e in (seen, unseen, y))
        assert rms_unseen > 1.25 * rms_seen
        assert rms_seen > 2 * 0.15  # not just the probes' noise
        assert rms_unseen < 0.3 * rms_none


def test_unusable_requests_are_refused() -> None:
    with pytest.raises(InputError, match=r"'chen1969'; the nearest are chen1996"):
        simulate("chen1969")
    with pytest.raises(InputError, match="demo"):
        simulate("qqqq")
    with pytest.raises(InputError, match="seed -1"):
        simulate("hwang", seed=-1)
    for noise in (-0.1, float("nan"), float("inf")):
        with pytest.raises(InputError, match="sensor noise"):
            simulate("hwang", sensor_noise=noise)
    for duration in (50.0, 0.0):
        odd = Programme("odd", 20.0, (Segment(duration),))
        with pytest.raises(InputError, match=f"odd: a segment of {duration} s"):
            run(MachiningCentre(), odd, np.random.default_rng(0), np.random.default_rng(0))


def test_the_nest_measures_tilts_and_positions() -> None:
    truth = Truth(np.zeros(0), Deviation(1.0), Deviation(2.0), Deviation(3.0, 10.0), tilt_a=40.0, tilt_b=-30.0)
    read = {name: probe.reads(truth) for name, probe in PROBES.items()}
    assert [read[n] for n in ("x1", "y1", "z", "z_at_0", "z_at_400")] == [1.0, 2.0, 3.0, 3.0, 7.0]
    # 100 mm behind the tip, a positive rotation about Y has moved the bar to +X, one about X to -Y
    assert read["x2"] == pytest.approx(1.0 - 3.0)
    assert read["y2"] == pytest.approx(2.0 - 4.0)


def test_a_sensor_on_a_surface_feels_the_air() -> None:
    air, parts = [Air(20.0)], np.array([[30.0, 50.0]])
    said = {p: felt(p, ("housing", "coolant"), parts, air, perfect=False)[0] for p in ("housing", "coolant")}
    assert 28.8 <= said["housing"] <= 29.7
    assert said["coolant"] == 50.0
    assert felt("housing", ("housing", "coolant"), parts, air, perfect=True)[0] == 30.0
    layered = [Air(20.0, stratification=1.0)]
    assert felt("air_top", (), parts, layered, perfect=False)[0] == pytest.approx(21.4)


def test_a_sensor_lags_as_a_first_order_system_does() -> None:
    time = np.arange(0.0, 601.0, 10.0)
    ramp = 20.0 + 0.01 * time
    lag = 45.0
    said = measure([Sensor(TEMPERATURE, lag=lag)], ramp[:, None], 10.0, 3, np.random.default_rng(0))[:, 0]
    exact = 20.0 + 0.01 * (time - lag * (1 - np.exp(-time / lag)))
    np.testing.assert_allclose(said, exact[::3], atol=1e-12)


def test_noise_bias_and_steps_of_a_sensor() -> None:
    true = np.full((4000, 2), 21.234)
    sensors = [Sensor(TEMPERATURE, noise=0.1, bias=0.5), Sensor(TEMPERATURE, resolution=0.02)]
    said = measure(sensors, true, 1.0, 1, np.random.default_rng(1))
    assert said[:, 0].mean() == pytest.approx(21.734, abs=0.01)
    assert said[:, 0].std() == pytest.approx(0.1, rel=0.05)
    np.testing.assert_allclose(said[:, 1], 21.24)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (Fault("t_C", "stuck", 20.0), [0, 1, 1, 1, 1]),
        (Fault("t_C", "stuck", 20.0, 30.0), [0, 1, 1, 3, 4]),
        (Fault("t_C", "stuck", 0.0), [0, 0, 0, 0, 0]),
        (Fault("t_C", "lost", 25.0), [0, 1, 2, np.nan, np.nan]),
        (Fault("t_C", "drift", 20.0, size=360.0), [0, 1, 2, 4, 6]),
        (Fault("t_C", "spike", 15.0, size=5.0), [0, 1, 7, 3, 4]),
        (Fault("t_C", "spike", 15.0, 35.0, size=5.0), [0, 1, 7, 8, 4]),
        (Fault("t_C", "lost", 41.0), [0, 1, 2, 3, 4]),
    ],
)
def test_faults(fault: Fault, expected: list[float]) -> None:
    time, values = np.arange(0.0, 50.0, 10.0), np.column_stack([np.arange(5.0), np.arange(5.0)])
    channels = (TEMPERATURE, Channel("other_C", "temperature", "degC"))
    found = with_faults(time, channels, values, [fault])
    np.testing.assert_array_equal(found[:, 0], expected)
    np.testing.assert_array_equal(found[:, 1], np.arange(5.0))
    np.testing.assert_array_equal(values[:, 0], np.arange(5.0))


def test_faults_befall_a_simulated_test() -> None:
    whole = simulate("hwang")[0]
    broken = simulate("hwang", faults=[Fault("t_front_seat_C", "lost", 3600.0)])[0]
    lost = np.isnan(column(broken, "t_front_seat_C"))
    np.testing.assert_array_equal(lost, whole.time >= 3600.0)
    np.testing.assert_array_equal(column(broken, "z_um"), column(whole, "z_um"))


def test_unusable_faults_are_refused() -> None:
    with pytest.raises(InputError, match="unknown kind 'melted'"):
        Fault("t_C", "melted", 0.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="before end"):
        Fault("t_C", "lost", 10.0, 10.0)
    with pytest.raises(InputError, match="must be finite"):
        Fault("t_C", "lost", float("nan"))
    with pytest.raises(InputError, match=r"'t_front_saet_C'; the nearest are t_front_seat_C"):
        simulate("hwang", faults=[Fault("t_front_saet_C", "lost", 0.0)])


def test_the_air_wanders_smoothly() -> None:
    path = wandering(200_000, 0.05, np.random.default_rng(2))
    assert path.mean() == pytest.approx(0.0, abs=0.1)
    assert path.std() == pytest.approx(1.0, abs=0.1)
    assert np.diff(path).std() < 0.06


def test_the_day_is_warmest_in_the_afternoon() -> None:
    time = np.arange(0.0, 86400.0, 600.0)
    calm = Climate(wander=0.0, draught=0.0, begin=0.0)
    air = calm.air(time, np.random.default_rng(0))
    warmest = int(np.argmax([a.temperature for a in air]))
    assert time[warmest] == 15 * 3600.0
    assert np.ptp([a.temperature for a in air]) == pytest.approx(2 * calm.daily, rel=1e-3)
    assert max(a.side for a in air[:36]) == 0.0  # no sun before six
    still = STILL.air(time, np.random.default_rng(0))
    assert {(a.temperature, a.stratification, a.side) for a in still} == {(22.0, 0.0, 0.0)}
