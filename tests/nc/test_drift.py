"""Drift along a program: the core's own models, stepped on a coarse clock."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from driftmodels import ROOM, judged, lags, net, static, strict, ticking
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.models.arx import ARX
from thermocomp.nc.thermal import start
from thermocomp.nc.thermal.drift import SOON, Drift
from thermocomp.nc.thermal.inputs import Inputs, InputSignal, constants
from thermocomp.nc.thermal.stations import Station
from thermocomp.papers.common import fit_and_freeze, predict_deviation
from thermocomp.papers.precompensation.setup import POSITIONS, samples_of
from thermocomp.virtual.datasets import record

ORIGIN = (0.0, 0.0, 0.0)
REMEMBERING: list[Callable[[], ErrorModel]] = [lags, ticking, net]


def alone(model: ErrorModel, others: Inputs | None = None, **options: float) -> Drift:
    station = [Station("Z", model, shadow=True)]
    return Drift(station, start.begin_cold(station, others or {}), others, zero="cold", **options)


def ladder(models: Sequence[ErrorModel], places: Sequence[float], axis: str = "Z") -> list[Station]:
    return [
        Station(axis, replace(m, target=f"{axis}{p}"), "Z", p, shadow=True) for m, p in zip(models, places, strict=True)
    ]


def by_hand(model: ErrorModel, schedule: Sequence[tuple[float, float]]) -> float:
    """Step a model through (seconds, speed) after a cold start."""
    state, deviation = model.step(model.init(), np.zeros(len(model.inputs)), 0.0)
    for seconds, speed in schedule:
        state, deviation = model.step(state, np.array([speed]), seconds)
    return float(deviation)


@pytest.mark.parametrize("make", REMEMBERING)
def test_free_run_is_the_core_stepped_by_hand(make: Callable[[], ErrorModel]) -> None:
    schedule = [(40.0, 0.0), (1800.0, 4000.0), (300.0, 0.0), (2400.0, 1500.0), (7.0, 6000.0)]
    drift = alone(make())
    for seconds, speed in schedule:
        for _ in range(round(seconds / 0.25)):
            drift.advance(0.25, speed)
    drift.state()
    assert drift.time == pytest.approx(sum(s for s, _ in schedule), rel=1e-12)
    wanted = by_hand(make(), schedule)
    assert abs(wanted) > 1
    assert drift.deviation(ORIGIN) == pytest.approx((0.0, 0.0, wanted), abs=1e-9)


def test_free_run_is_the_replay_that_judges_models() -> None:
    learn, judge = (samples_of(r) for r in record("precompensation", seed=1))
    target = learn.targets[1].name
    arx = ARX(inputs=("spindle_rpm",), time="routed", interval=600.0, k=1, m=0)
    model = fit_and_freeze(arx, learn, [target], dt=learn.dt(), cycle=learn.cycle)[target]
    replayed = predict_deviation(model, judge)
    assert judge.values[0, 0] == 0  # a cold start
    drift, found = alone(model), [0.0]
    for k, dt in enumerate(np.diff(judge.time).tolist(), start=1):
        for _ in range(10):
            drift.advance(dt / 10, float(judge.values[k, 0]))
        drift.state()  # the models are stepped up to now
        found.append(drift.deviation(ORIGIN)[2])
    assert np.ptp(replayed) > 5
    np.testing.assert_allclose(found, replayed, atol=1e-9)
    assert POSITIONS[1] == 200


@pytest.mark.parametrize("make", REMEMBERING)
@settings(max_examples=25, deadline=None)
@given(
    schedule=st.lists(
        st.tuples(st.floats(1.0, 900.0), st.floats(0.0, 6000.0), st.integers(1, 40)), min_size=1, max_size=5
    )
)
def test_it_does_not_matter_how_a_time_is_divided(
    make: Callable[[], ErrorModel], schedule: list[tuple[float, float, int]]
) -> None:
    whole, pieces = alone(make()), alone(make())
    for seconds, speed, parts in schedule:
        whole.advance(seconds, speed)
        for _ in range(parts):
            pieces.advance(seconds / parts, speed)
    whole.state()
    pieces.state()
    # the last pieces before a change may be shorter than SOON: they count with their mean, not with that of the square
    assert pieces.deviation(ORIGIN)[2] == pytest.approx(whole.deviation(ORIGIN)[2], abs=2e-3 * len(schedule))


def test_a_long_dwell_is_as_many_seconds() -> None:
    whole, pieces = alone(lags()), alone(lags())
    whole.advance(600.0, 3000.0)
    for _ in range(600):
        pieces.advance(1.0, 3000.0)
    assert whole.time == 600
    assert 595 < pieces.time <= 600  # the models' clock
    assert pieces.deviation(ORIGIN)[2] == pytest.approx(whole.deviation(ORIGIN)[2], abs=0.03)
    pieces.state()
    assert pieces.deviation(ORIGIN)[2] == pytest.approx(whole.deviation(ORIGIN)[2], abs=1e-9)


def test_what_follows_the_speed_at_once_does() -> None:
    drift = alone(static())
    drift.advance(100.0, 0.0)
    drift.advance(SOON, 5000.0)
    assert drift.deviation(ORIGIN)[2] == pytest.approx(5.0)


def test_speeds_shorter_than_soon_count_with_their_mean() -> None:
    drift = alone(static())
    for _ in range(8):
        drift.advance(0.1, 6000.0)
        drift.advance(0.025, 2000.0)
    assert drift.deviation(ORIGIN)[2] == pytest.approx((0.1 * 6 + 0.025 * 2) / 0.125)
    assert drift.time == pytest.approx(1.0)


def test_sense_of_rotation_does_not_matter() -> None:
    right, left = alone(lags()), alone(lags())
    right.advance(500.0, 3000.0)
    left.advance(500.0, -3000.0)  # M4
    assert left.deviation(ORIGIN) == right.deviation(ORIGIN)
    assert right.deviation(ORIGIN)[2] > 1


def test_growth_is_a_positive_deviation_that_is_taken_back() -> None:
    """E-P4: the tool point 10 um too high wants 10 um less in the program."""
    drift = alone(ticking())
    while drift.deviation(ORIGIN)[2] < 10:
        drift.advance(60.0, 3000.0)
    assert Correction.opposing(Deviation(drift.deviation(ORIGIN)[2])).offset <= -10


@pytest.mark.parametrize("number", [math.nan, math.inf, -1.0])
def test_time_only_moves_forward(number: float) -> None:
    with pytest.raises(InputError, match="finite"):
        alone(lags()).advance(number, 1000.0)
    with pytest.raises(InputError, match="positive"):
        alone(lags(), step=-abs(number) if math.isfinite(number) else number)


def test_a_speed_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        alone(lags()).advance(1.0, math.nan)


# -- positions ---------------------------------------------------------------------------------------------------------


def four() -> Drift:
    stations = ladder([lags(size=s) for s in (1.0, 1.3, 0.4, -0.5)], (0.0, 200.0, 400.0, 600.0))
    both = [Station("X", ticking("x_um"), shadow=True), *stations]
    drift = Drift(both, start.begin_cold(both, {}), {})
    drift.advance(1800.0, 4000.0)
    return drift


def test_models_at_positions_hold_there_and_linearly_between() -> None:
    """P-04."""
    drift = four()
    x, *z = drift.values
    assert drift.axes == ("X", "Z")
    assert drift.by_position
    for place, value in zip((0.0, 200.0, 400.0, 600.0), z, strict=True):
        assert drift.deviation((5.0, 7.0, place)) == (x, 0.0, value)
    for (below, low), (above, high) in pairwise(zip((0.0, 200.0, 400.0, 600.0), z, strict=True)):
        for share in (0.001, 0.25, 0.5, 0.9, 0.999):
            found = drift.deviation((0.0, 0.0, below + share * (above - below)))[2]
            assert found == pytest.approx(low + share * (high - low), abs=1e-12)
    assert drift.beyond == {}


def test_beyond_the_outermost_model_its_value_is_held_and_told() -> None:
    drift = four()
    assert drift.deviation((0.0, 0.0, -30.0))[2] == drift.deviation(ORIGIN)[2]
    assert drift.deviation((0.0, 0.0, 612.5))[2] == drift.deviation((0.0, 0.0, 600.0))[2]
    assert drift.beyond == {"Z": 30.0}


def test_the_drift_of_x_can_vary_along_z() -> None:
    stations = ladder([ticking(size=1.0), ticking(size=3.0)], (-400.0, -100.0), axis="X")
    drift = Drift(stations, start.begin_cold(stations, {}), {})
    drift.advance(3600.0, 3000.0)
    upper, lower = drift.deviation((0.0, 0.0, -100.0)), drift.deviation((-100.0, 0.0, -400.0))
    assert upper[0] == pytest.approx(3 * lower[0])
    assert drift.deviation((77.0, 0.0, -250.0))[0] == pytest.approx(2 * lower[0])
    assert upper[1:] == (0.0, 0.0)


# -- inputs other than the speed ---------------------------------------------------------------------------------------


def test_an_input_that_nobody_gives_is_refused() -> None:
    with pytest.raises(InputError, match=r"needs t3_C, a temperature.*--constant t3_C=21.5degC or --forecast"):
        alone(lags(room=True))


def test_an_input_without_influence_is_not_asked_for() -> None:
    unmoved = replace(lags(), inputs=(*lags().inputs, ROOM))
    drift, plain = alone(unmoved), alone(lags())
    for d in (drift, plain):
        d.advance(100.0, 1000.0)
    assert drift.deviation(ORIGIN) == plain.deviation(ORIGIN)


def test_a_forecast_is_followed() -> None:
    forecast = InputSignal((0.0, 1000.0, 2000.0), (20.0, 23.0, 21.0))
    drift = alone(lags(room=True), {"t3_C": forecast})
    drift.advance(3000.0, 2000.0)
    model = lags(room=True)
    state, deviation = model.step(model.init(), np.array([0.0, 20.0]), 0.0)
    for t in np.arange(5.0, 3000.1, 5.0).tolist():
        room = np.interp(t, forecast.time, forecast.values)
        state, deviation = model.step(state, np.array([2000.0, room]), 5.0)
    assert drift.deviation(ORIGIN)[2] == pytest.approx(float(deviation), abs=1e-9)
    assert drift.held == {"t3_C": 1000.0}


def test_a_room_that_stays_as_it_was_moves_nothing() -> None:
    drift, plain = alone(lags(room=True), constants(["t3=71.6 degF"], [lags(room=True)])), alone(lags())
    for d in (drift, plain):
        d.advance(1000.0, 2000.0)
    assert drift.deviation(ORIGIN)[2] == pytest.approx(plain.deviation(ORIGIN)[2], abs=1e-12)
    assert drift.held == {}


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["t9=20degC"], "no input 't9'"),
        (["t3=20"], "unit, such as t3=21.5degC"),
        (["t3"], "unit"),
        (["t3=20um"], "measures displacement"),
        (["spindle=20rpm"], "is taken from the program"),
        (["t3=20degC", "t3_C=21degC"], "given before"),
    ],
)
def test_constants_that_are_refused(texts: list[str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        constants(texts, [lags(room=True)])


def test_constants_are_read() -> None:
    assert constants(["t3_C = 294.65 K"], [lags(room=True), lags()])["t3_C"].at(1e9) == pytest.approx(21.5)


@given(st.lists(st.tuples(st.integers(-50, 50), st.floats(-1e3, 1e3)), min_size=1, unique_by=lambda p: p[0]))
def test_a_signal_is_linear_and_held(points: list[tuple[int, float]]) -> None:
    time, values = zip(*sorted((float(t), v) for t, v in points), strict=True)
    signal = InputSignal(time, values)
    asked = np.linspace(-60.0, 60.0, 121)
    np.testing.assert_allclose([signal.at(t) for t in asked.tolist()], np.interp(asked, time, values), atol=1e-9)
    assert signal.held(10.0) == 0 if len(time) == 1 else signal.held(0.0) == max(0.0, -time[-1])


@pytest.mark.parametrize(
    ("time", "values"), [((), ()), ((0.0,), (1.0, 2.0)), ((0.0, 0.0), (1.0, 2.0)), ((0.0,), (math.nan,))]
)
def test_signals_that_are_refused(time: tuple[float, ...], values: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="forecast"):
        InputSignal(time, values)


# -- zero, range, bound ------------------------------------------------------------------------------------------------


def test_the_drift_counts_from_the_stated_zero() -> None:
    station = [Station("Z", lags(), shadow=True)]
    warm = start.begin_measured(station, {"Z": 7.0}, {})
    from_start, from_cold = Drift(station, warm), Drift(station, warm, zero="cold")
    assert from_start.deviation(ORIGIN)[2] == 0
    assert from_cold.deviation(ORIGIN)[2] == pytest.approx(7.0, abs=1e-6)
    for drift in (from_start, from_cold):
        drift.advance(900.0, 5000.0)
    now = from_cold.deviation(ORIGIN)[2]
    assert abs(now - 7) > 1
    assert from_start.deviation(ORIGIN)[2] == pytest.approx(now - 7, abs=1e-6)
    with pytest.raises(InputError, match="last job"):
        Drift(station, warm, zero="last")


def test_leaving_the_trained_range_is_told_and_doubted() -> None:
    drift = alone(judged(strict(lags()), 2.0))
    drift.advance(600.0, 6000.0)
    assert not drift.outside
    assert drift.uncertainty() == (0.0, 0.0, 2.0)
    drift.advance(90.0, 8000.0)
    drift.advance(30.0, 7000.0)
    said = drift.deviation(ORIGIN)[2]
    (left,) = drift.outside
    assert left[:5] == ("spindle_rpm", "1/min", 0.0, 6000.0, 8000.0)
    assert left.seconds == pytest.approx(120.0)
    assert drift.uncertainty()[2] == pytest.approx(2 + said)
    drift.advance(3600.0, 0.0)  # the memory has been driven by a speed that was cut: it stays in doubt
    assert drift.deviation(ORIGIN)[2] < said / 2
    assert drift.uncertainty()[2] >= 2 + said
    assert drift.outside == (left,)


def test_a_model_without_memory_is_in_doubt_only_while_outside() -> None:
    drift = alone(judged(strict(static()), 2.0))
    drift.advance(10.0, 9000.0)
    assert drift.uncertainty()[2] == pytest.approx(2 + 6)
    drift.advance(10.0, 900.0)
    assert drift.uncertainty()[2] == 2


def test_the_bound_of_an_axis_is_that_of_its_worst_model() -> None:
    def bound(*errors: float | None) -> float:
        models = [lags() if e is None else judged(lags(), e) for e in errors]
        stations = ladder(models, [100.0 * k for k in range(len(models))])
        return Drift(stations, start.begin_cold(stations, {})).uncertainty()[2]

    assert bound(2.0, 5.0, 3.0) == 5
    assert math.isnan(bound(2.0, None, 3.0))
    assert math.isnan(bound(None, 3.0))


def test_a_zero_that_is_predicted_doubles_the_bound() -> None:
    station = [Station("Z", judged(lags(), 2.0))]
    first = Drift(station, start.begin_cold(station, {}))
    first.advance(1000.0, 4000.0)
    left = start.carry_over(station, first.state(), 60.0)
    assert Drift(station, left, zero="start").uncertainty()[2] == 4
    assert Drift(station, left, zero="last").uncertainty()[2] == 2
    assert Drift(station, left, zero="cold").uncertainty()[2] == 2


def test_refused_models_do_not_run() -> None:
    with pytest.raises(InputError, match="refused and will not run: worse than none"):
        Station("Z", judged(lags(), 9.0, "refused"))


def test_stations_come_in_their_order() -> None:
    stations = ladder([lags(), lags()], (0.0, 200.0))[::-1]
    with pytest.raises(InputError, match="ordered"):
        Drift(stations, start.begin_cold(stations, {}))


def test_an_axis_without_a_model_stays() -> None:
    """P-04."""
    for axis in ("X", "Y", "Z"):
        stations = [Station(axis, ticking(f"{axis.lower()}_um"), shadow=True)]
        drift = Drift(stations, start.begin_cold(stations, {}), {})
        drift.advance(1800.0, 3000.0)
        (value,) = drift.values
        assert value != 0.0
        assert drift.deviation((1.0, 2.0, 3.0)) == tuple(value if a == axis else 0.0 for a in "XYZ")
