"""Sensors lag, scatter, drift and fail as they are told to."""

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.virtual.sensors import Sensor, SensorFault, apply_lags, read, with_faults

TEMPERATURE = Channel("t_C", "temperature", "degC")


def test_a_sensor_lags_as_a_first_order_system_does() -> None:
    time = np.arange(0.0, 601.0, 10.0)
    true = np.repeat((20.0 + 0.01 * time)[:, None], 3, axis=1)
    lags = np.array([45.0, 0.0, 5.0])
    felt = apply_lags(lags, true[0], true[0], true[1:], 10.0)
    for k, lag in ((0, 45.0), (2, 5.0)):
        exact = 20.0 + 0.01 * (time - lag * (1 - np.exp(-time / lag)))
        np.testing.assert_allclose(felt[:, k], exact[1:], atol=1e-12)
    np.testing.assert_array_equal(felt[:, 1], true[1:, 1])


def test_a_sensor_goes_on_where_it_was() -> None:
    true = np.random.default_rng(0).normal(size=(100, 2))
    lags, start = np.array([30.0, 200.0]), np.zeros(2)
    whole = apply_lags(lags, start, start, true, 10.0)
    first = apply_lags(lags, start, start, true[:37], 10.0)
    second = apply_lags(lags, first[-1], true[36], true[37:], 10.0)
    np.testing.assert_allclose(np.vstack([first, second]), whole, atol=1e-12)


def test_noise_bias_and_steps_of_a_sensor() -> None:
    felt, time = np.full((4000, 2), 21.234), np.zeros(4000)
    sensors = [Sensor(TEMPERATURE, noise=0.1, bias=0.5), Sensor(TEMPERATURE, resolution=0.02)]
    said = read(sensors, felt, time, np.random.default_rng(1))
    assert said[:, 0].mean() == pytest.approx(21.734, abs=0.01)
    assert said[:, 0].std() == pytest.approx(0.1, rel=0.05)
    np.testing.assert_array_equal(said[:, 1], 21.24)


def test_the_zero_of_a_sensor_drifts_by_the_day() -> None:
    time = np.array([0.0, 43200.0, 86400.0])
    said = read([Sensor(TEMPERATURE, drift=0.03)], np.full((3, 1), 20.0), time, np.random.default_rng(1))
    np.testing.assert_allclose(said[:, 0], [20.0, 20.015, 20.03])


def test_rows_read_in_parts_have_the_noise_of_the_whole() -> None:
    sensors, felt, time = [Sensor(TEMPERATURE, noise=0.1)] * 3, np.zeros((50, 3)), np.zeros(50)
    whole = read(sensors, felt, time, np.random.default_rng(3))
    rng = np.random.default_rng(3)
    parts = [read(sensors, felt[rows], time[rows], rng) for rows in (slice(0, 1), slice(1, 20), slice(20, 50))]
    np.testing.assert_array_equal(np.vstack(parts), whole)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (SensorFault("t_C", "stuck", 20.0), [0, 1, 1, 1, 1]),
        (SensorFault("t_C", "stuck", 20.0, 30.0), [0, 1, 1, 3, 4]),
        (SensorFault("t_C", "stuck", 0.0), [0, 0, 0, 0, 0]),
        (SensorFault("t_C", "lost", 25.0), [0, 1, 2, np.nan, np.nan]),
        (SensorFault("t_C", "drift", 20.0, size=360.0), [0, 1, 2, 4, 6]),
        (SensorFault("t_C", "spike", 15.0, size=5.0), [0, 1, 7, 3, 4]),
        (SensorFault("t_C", "spike", 15.0, 35.0, size=5.0), [0, 1, 7, 8, 4]),
        (SensorFault("t_C", "lost", 41.0), [0, 1, 2, 3, 4]),
    ],
)
def test_faults(fault: SensorFault, expected: list[float]) -> None:
    time, values = np.arange(0.0, 50.0, 10.0), np.column_stack([np.arange(5.0), np.arange(5.0)])
    channels = (TEMPERATURE, Channel("other_C", "temperature", "degC"))
    found = with_faults(time, channels, values, [fault])
    np.testing.assert_array_equal(found[:, 0], expected)
    np.testing.assert_array_equal(found[:, 1], np.arange(5.0))
    np.testing.assert_array_equal(values[:, 0], np.arange(5.0))


def test_unusable_faults_are_refused() -> None:
    with pytest.raises(InputError, match="unknown kind 'melted'"):
        SensorFault("t_C", "melted", 0.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="before end"):
        SensorFault("t_C", "lost", 10.0, 10.0)
    with pytest.raises(InputError, match="must be finite"):
        SensorFault("t_C", "lost", float("nan"))
    with pytest.raises(InputError, match=r"'tt_C'; the nearest are t_C"):
        with_faults(np.zeros(1), (TEMPERATURE,), np.zeros((1, 1)), [SensorFault("tt_C", "lost", 0.0)])
