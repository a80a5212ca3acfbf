"""The state of the machine when a program starts."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from driftmodels import judged, lags, net, static, strict, ticking
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.nc.thermal import start
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.inputs import InputSignal
from thermocomp.nc.thermal.jobstate import JobState
from thermocomp.nc.thermal.stations import Station

ORIGIN = (0.0, 0.0, 0.0)
WARM = [(600.0, 3000.0), (333.0, 0.0), (1800.0, 5500.0)]
REMEMBERING: list[Callable[[], ErrorModel]] = [lags, ticking, net]


def one(model: ErrorModel) -> list[Station]:
    return [Station("Z", model, shadow=True)]


@pytest.mark.parametrize("make", [*REMEMBERING, static])
@settings(max_examples=20, deadline=None)
@given(cut=st.integers(0, 2700), pause=st.integers(0, 3600))
def test_two_jobs_and_a_pause_are_one_long_run(make: Callable[[], ErrorModel], cut: int, pause: int) -> None:
    stations = one(make())
    first = Drift(stations, start.begin_cold(stations, {}))
    whole = Drift(stations, start.begin_cold(stations, {}))
    rest = float(cut)
    second = None
    for seconds, speed in WARM:
        mine = min(rest, seconds)
        first.advance(mine, speed)
        whole.advance(mine, speed)
        rest -= mine
        if mine < seconds:
            if second is None:
                whole.advance(pause, 0.0)
                second = Drift(stations, start.carry_over(stations, first.state(), pause), zero="last")
                assert second.time == 0
            second.advance(seconds - mine, speed)
            whole.advance(seconds - mine, speed)
    assert second is not None
    second.state()
    whole.state()
    assert second.deviation(ORIGIN)[2] == pytest.approx(whole.deviation(ORIGIN)[2], abs=1e-8)


def test_work_offsets_set_anew_count_from_the_end_of_the_pause() -> None:
    stations = one(lags())
    first = Drift(stations, start.begin_cold(stations, {}))
    first.advance(1800.0, 5000.0)
    left = first.state()
    anew = Drift(stations, start.carry_over(stations, left, 600.0))
    cold = Drift(stations, start.carry_over(stations, left, 600.0), zero="cold")
    assert anew.deviation(ORIGIN)[2] == 0
    assert 0 < cold.deviation(ORIGIN)[2] < first.deviation(ORIGIN)[2]
    anew.advance(3600.0, 0.0)
    assert anew.deviation(ORIGIN)[2] < -1  # it cools: the other way


def test_a_pause_follows_a_forecast_of_its_time() -> None:
    stations = one(lags(room=True))
    steady = {"t3_C": InputSignal.constant(20.0)}
    first = Drift(stations, start.begin_cold(stations, steady), steady)
    first.advance(60.0, 0.0)
    falling = {"t3_C": InputSignal((-3600.0, 0.0), (20.0, 18.0))}
    second = Drift(stations, start.carry_over(stations, first.state(), 3600.0), falling, zero="last")
    model = lags(room=True)
    state, deviation = model.step(model.init(), np.array([0.0, 20.0]), 0.0)
    for k in range(1, 721):
        state, deviation = model.step(state, np.array([0.0, 20 - 2 * k / 720]), 5.0)
    assert second.deviation(ORIGIN)[2] == pytest.approx(float(deviation), abs=1e-9)
    assert float(deviation) < -1


def test_a_state_of_other_models_is_refused() -> None:
    stations = one(lags())
    left = Drift(stations, start.begin_cold(stations, {})).state()
    with pytest.raises(InputError, match="the model of z_um is not the one of the last job"):
        start.carry_over(one(lags(size=1.1)), left)
    with pytest.raises(InputError, match="saved the state of Z, but this job has models of X"):
        start.carry_over([Station("X", lags(), shadow=True)], left)
    with pytest.raises(InputError, match="pause"):
        start.carry_over(stations, left, -1.0)
    short = JobState((replace(left.stations[0], memory=(1.0,)),), left.zero_known)
    with pytest.raises(InputError, match="is incomplete"):
        start.carry_over(stations, short)


def test_how_a_model_was_judged_does_not_make_it_another_one() -> None:
    assert start.identity(judged(lags(), 2.0)) == start.identity(lags())
    assert start.identity(strict(lags())) != start.identity(lags())
    assert start.identity(ticking()) != start.identity(lags())


def test_what_was_doubted_stays_so_in_the_next_job() -> None:
    stations = one(judged(strict(lags()), 2.0))
    first = Drift(stations, start.begin_cold(stations, {}))
    first.advance(600.0, 9000.0)
    said = first.deviation(ORIGIN)[2]
    second = Drift(stations, start.carry_over(stations, first.state(), 60.0), zero="last")
    assert second.uncertainty()[2] >= 2 + said > 3
    assert second.outside == ()


# -- measured ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", REMEMBERING)
@pytest.mark.parametrize("deviation", [0.0, 0.7, 12.3])
def test_a_measured_start_says_what_was_measured(make: Callable[[], ErrorModel], deviation: float) -> None:
    stations = one(make())
    drift = Drift(stations, start.begin_measured(stations, {"Z": deviation}, {}), zero="cold")
    assert drift.deviation(ORIGIN)[2] == pytest.approx(deviation, abs=1e-6)
    drift.advance(5.0, 0.0)
    fastest = 5.0 if make is net else 0.04 * deviation + 1e-6
    assert drift.deviation(ORIGIN)[2] == pytest.approx(deviation, abs=fastest)  # it continues from there


def test_a_measured_lag_bank_has_settled_at_one_speed() -> None:
    model = lags()
    state, _ = model.step(model.init(), np.array([2500.0]), 0.0)
    _, deviation = model.step(state, np.zeros(1), 0.0)
    (found,) = start.begin_measured(one(model), {"Z": float(deviation)}, {}).states
    assert found.memory is not None
    assert state.memory is not None
    np.testing.assert_allclose(found.memory, state.memory, rtol=1e-6)


def test_a_measured_autoregressive_model_stood_still_before() -> None:
    drift = Drift(one(net()), start.begin_measured(one(net()), {"Z": 12.3}, {}), zero="cold")
    state, deviation = net().begin_at(12.3, np.zeros(1)), np.array(0.0)
    for _ in range(12):
        drift.advance(5.0, 4000.0)
        state, deviation = net().step(state, np.array([4000.0]), 5.0)
    assert drift.deviation(ORIGIN)[2] == pytest.approx(float(deviation), abs=1e-9)
    assert abs(float(deviation) - 12.3) > 1


def test_every_axis_and_station_is_measured_by_its_name() -> None:
    stations = [
        Station("X", ticking("x_um"), shadow=True),
        Station("Z", lags("z_at_0_um"), "Z", 0.0, shadow=True),
        Station("Z", lags("z_at_200_um"), "Z", 200.0, shadow=True),
    ]
    texts = ["x=3um", "z_at_0 = 0.004 mm", "z_at_200_um=5 um"]
    found = start.begin_measured(stations, start.deviations(texts), {})
    drift = Drift(stations, found, zero="cold")
    assert drift.deviation((0.0, 0.0, 100.0)) == pytest.approx((3.0, 0.0, 4.5), abs=1e-6)
    assert found.assumed == ()
    for wrong, says in [
        ({"X": 3.0}, "the deviation of Z is missing; also give Z=VALUEum"),
        ({"X": 3.0, "Y": 4.0}, "no measured axis or target 'Y'"),
        ({"X": 3.0, "Z": 4.0, "z_at_200": 5.0}, "Z and z_at_200 are both given; remove one"),
        ({"X": 3.0, "Z": 50.0}, r"Z \(the mean of 2 models\): 50 um; no speed from 0 to 6000 1/min causes it"),
    ]:
        with pytest.raises(InputError, match=says):
            start.begin_measured(stations, wrong, {})
    three = [*stations, Station("Z", lags("z_at_400_um"), "Z", 400.0, shadow=True)]
    with pytest.raises(InputError, match="the deviation of Z at Z 400 mm is missing; also give z_at_400=VALUEum"):
        start.begin_measured(three, {"X": 3.0, "z_at_0": 4.0, "z_at_200": 5.0}, {})


@pytest.mark.parametrize("other", [lags, ticking])
def test_one_measurement_fixes_all_stations_of_an_axis(other: Callable[..., ErrorModel]) -> None:
    stations = [
        Station("Z", lags("z_at_0_um"), "Z", 0.0, shadow=True),
        Station("Z", other("z_at_600_um", 0.4), "Z", 600.0, shadow=True),
    ]
    whole = start.begin_measured(stations, {"Z": 7.0}, {})
    low, high = (float(s.deviation) for s in whole.states)
    assert 0.5 * (low + high) == pytest.approx(7.0, abs=1e-6)
    assert 0 < high < low
    (said,) = whole.assumed
    assert "Z was measured once" in said
    assert "the mean of its 2 models is 7 um" in said
    # one station tells the same speed, and so the same of the other
    for name, value, told in [("z_at_0", low, 1), ("z_at_600_um", high, 0)]:
        found = start.begin_measured(stations, {name: value}, {})
        assert float(found.states[told].deviation) == pytest.approx((low, high)[told], abs=1e-5)
        assert f"where {name} is {value:g} um" in found.assumed[0]
    both = Drift(stations, start.begin_measured(stations, {"z_at_0": low, "z_at_600": high}, {}), zero="cold")
    mine = Drift(stations, whole, zero="cold")
    assert mine.assumed == whole.assumed
    both.advance(300.0, 3000.0)
    mine.advance(300.0, 3000.0)
    mine.state()
    both.state()
    assert mine.values == pytest.approx(both.values, abs=1e-5)


def test_stations_that_are_proportional_stay_so() -> None:
    stations = [
        Station("Z", lags("a_um", -1.0), "Z", 0.0, shadow=True),
        Station("Z", lags("b_um", -3.0), "Z", 600.0, shadow=True),
    ]
    one_of_them, other = start.begin_measured(stations, {"Z": -12.0}, {}).states
    assert float(one_of_them.deviation) == pytest.approx(-6.0, abs=1e-6)
    assert float(other.deviation) == pytest.approx(-18.0, abs=1e-6)


def test_a_station_without_memory_or_speed_cannot_be_fixed_by_another() -> None:
    stations = [
        Station("Z", lags("a_um"), "Z", 0.0, shadow=True),
        Station("Z", static("b_um"), "Z", 600.0, shadow=True),
    ]
    with pytest.raises(InputError, match="model of b_um has no memory"):
        start.begin_measured(stations, {"Z": 2.0}, {})
    with pytest.raises(InputError, match="model of b_um has no memory"):
        start.begin_measured(stations, {"a": 2.0}, {})


@pytest.mark.parametrize(
    ("texts", "says"),
    [(["Z"], "such as Z=12um"), (["Z=3"], "unit"), (["Z=3um", "z=4um"], "before"), (["=3um"], "axis")],
)
def test_measured_texts_that_are_refused(texts: list[str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        start.deviations(texts)


def test_measured_deviations_that_no_speed_explains_are_refused() -> None:
    with pytest.raises(InputError, match=r"no speed from 0 to 6000 1/min causes it: the model predicts from 0 to 37"):
        start.begin_measured(one(lags()), {"Z": 50.0}, {})
    with pytest.raises(InputError, match="check sign"):
        start.begin_measured(one(lags()), {"Z": -5.0}, {})
    with pytest.raises(InputError, match="finite"):
        start.begin_measured(one(lags()), {"Z": math.nan}, {})


def test_a_model_without_memory_cannot_start_warm() -> None:
    with pytest.raises(InputError, match="no memory"):
        start.begin_measured(one(static()), {"Z": 2.0}, {})


def test_a_model_of_the_room_alone_cannot_start_measured() -> None:
    model = lags(room=True)
    only = replace(
        model,
        inputs=model.inputs[1:],
        signals=((0,),),
        direct=(0.1,),
        lag_signals=(0,),
        time_constants=(600.0,),
        lagged=(0.5,),
    )
    with pytest.raises(InputError, match="not driven by the spindle speed"):
        start.begin_measured(one(only), {"Z": 2.0}, {"t3_C": InputSignal.constant(20.0)})
