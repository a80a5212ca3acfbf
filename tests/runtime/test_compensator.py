"""The compensator: a dead, stale or absurd reading never moves an axis."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driftmodels import ACCEPTED
from hypothesis import example, given
from hypothesis import strategies as st

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.reading import Reading
from thermocomp.core.starting import describe_start, find_offsets
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.zero import Zeroing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.limits import limit_offset
from thermocomp.runtime.state import Compensated, CompensatorState

OPEN = Limits(magnitude=1e9, rate=1e9, reading_age=1e9, hold=1e12)


def model(target: str = "z", unit: str = "um") -> LinearDynamic:
    return LinearDynamic(
        target=target,
        unit=unit,
        inputs=(
            Input("t", "temperature", "degC", 20.0, True, -50.0, 50.0),
            Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0),
        ),
        signals=((0,), (1,)),
        direct=(2.0, 0.0),
        lag_signals=(1,),
        time_constants=(600.0,),
        lagged=(0.01,),
        honest_error=ACCEPTED,
    )


def start(models: list[LinearDynamic]) -> CompensatorState:
    return Compensator.of(models).start()


def step(
    models: list[LinearDynamic], limits: Limits, state: CompensatorState, now_read: Reading, now: float
) -> tuple[CompensatorState, Compensated]:
    return Compensator.of(models, limits).step(state, now_read, now)


def reading(time: float, t: float, n: float = 0.0) -> Reading:
    return Reading(time, {"t": t, "n": n})


def warmed() -> CompensatorState:
    state = start([model()])
    for k in range(10):
        state, result = step([model()], OPEN, state, reading(10.0 * k, 20.0 + k, 3000.0), 10.0 * k)
        assert not result.rejected
    return state


def test_open_limits_give_minus_the_replayed_deviation() -> None:
    """What is judged in a replay is what runs live, to the last bit."""
    frozen, rng = model(), np.random.default_rng(3)
    state, replayed = start([frozen]), frozen.init()
    last = 0.0
    for k in range(50):
        time, t, n = 10.0 * k + rng.uniform(0, 5), 20 + rng.normal(), rng.uniform(0, 5000)
        state, result = step([frozen], OPEN, state, reading(time, t, n), time)
        replayed, deviation = frozen.step(replayed, np.array([t, n]), time - last if k else 0.0)
        last = time
        if k:
            assert result.corrections["z"].offset == -float(deviation)


bad_number = st.sampled_from([math.nan, math.inf, -math.inf, 1e30, -273.15, 850.0])


@given(
    value=bad_number,
    channel=st.sampled_from(["t", "n", "time", "missing", "stale", "past", "same", "future", "text", "truth"]),
)
def test_what_the_gate_turns_away_changes_nothing(value: float, channel: str) -> None:
    state = warmed()
    good = {"t": 25.0, "n": 1000.0}
    time, now = 100.0, 100.0
    if channel == "missing":
        del good["t"]
    elif channel == "stale":
        now = time + 2e9
    elif channel == "future":
        time = now + 60.0
    elif channel in ("text", "truth"):
        good["t"] = "25.0" if channel == "text" else True  # type: ignore[assignment]
    elif channel == "past":
        time = 5.0
    elif channel == "same":
        time = state.time or 0.0
    elif channel == "time":
        time = value if not math.isfinite(value) else math.nan
    else:
        good[channel] = value if channel == "t" or not math.isfinite(value) else 1e9
    after, result = step([model()], OPEN, state, Reading(time, good), now)
    assert result.rejected
    assert after._replace(clock=state.clock, idle=state.idle, feed=state.feed) == state
    assert result.corrections["z"] == state.corrections["z"]


def test_the_reason_names_the_channel() -> None:
    _, result = step([model()], OPEN, start([model()]), reading(0.0, math.nan), 0.0)
    assert result.rejected == "t = nan degC is not plausible"


@example(target=67.0, current=1.3340758758793854, dt=7.0, magnitude=66.20264931370188, rate=10.0, dead_band=0.0)
@given(
    target=st.floats(),
    current=st.floats(-50, 50),
    dt=st.floats(),
    magnitude=st.floats(1, 100),
    rate=st.floats(0.01, 10),
    dead_band=st.floats(0, 5),
)
def test_limits_hold_for_any_number(
    target: float, current: float, dt: float, magnitude: float, rate: float, dead_band: float
) -> None:
    limits = Limits(magnitude, rate, dead_band)
    current = max(-magnitude, min(magnitude, current))
    new = limit_offset(target, current, dt, limits)
    assert math.isfinite(new)
    assert abs(new) <= magnitude
    if not (math.isfinite(target) and math.isfinite(dt) and dt > 0):
        assert new == current
    else:
        assert abs(new - current) <= rate * dt * (1 + 1e-9) + 1e-9
        assert new == current or abs(max(-magnitude, min(magnitude, target)) - current) > dead_band


def test_limits_at_their_edges() -> None:
    """C-38: a change of exactly the dead band is none; what the rate just allows is taken whole, either way."""
    limits = Limits(magnitude=10.0, rate=0.5, dead_band=2.0)
    for sign in (1.0, -1.0):
        for target, current, dt, new in (
            (2.0, 0.0, 60.0, 0.0),
            (2.5, 0.0, 60.0, 2.5),
            (5.0, 0.0, 10.0, 5.0),
            (5.0, 0.0, 8.0, 4.0),
            (5.0, 1.0, 4.0, 3.0),
            (99.0, 0.0, 60.0, 10.0),
            (8.0, 5.0, 0.0, 5.0),
            (8.0, 5.0, 1.0, 5.5),
        ):
            assert limit_offset(sign * target, sign * current, dt, limits) == sign * new


def test_rate_limit_is_reached_over_time() -> None:
    limits = Limits(magnitude=100.0, rate=0.1, reading_age=60.0)
    state = start([model()])
    state, _ = step([model()], limits, state, reading(0.0, 20.0), 0.0)
    for k in range(1, 8):
        state, result = step([model()], limits, state, reading(10.0 * k, 22.0), 10.0 * k)
        assert result.corrections["z"].offset == pytest.approx(-min(4.0, 1.0 * k))


@pytest.mark.parametrize("value", [0.0, 85.0, 119.9])
def test_a_sensor_that_fails_within_what_sensors_can_say(value: float) -> None:
    """Trained from -5 to 15 degC about a zero of 31 degC: what is a span further away is a broken sensor."""
    frozen = model()
    narrow = replace(frozen, inputs=(replace(frozen.inputs[0], reference=31.0, low=-5.0, high=15.0), frozen.inputs[1]))
    cold = start([narrow])
    _, result = step([narrow], OPEN, cold, reading(0.0, value), 0.0)
    assert "t = " in result.rejected  # it would have become the zero
    state, _ = step([narrow], OPEN, cold, reading(0.0, 26.0), 0.0)
    state, before = step([narrow], OPEN, state, reading(10.0, 30.0), 10.0)
    after, result = step([narrow], OPEN, state, reading(20.0, value), 20.0)
    assert result.rejected.endswith("is not plausible")
    assert result.corrections == before.corrections
    assert after.models is state.models


def test_a_refused_model_does_not_start() -> None:
    refused = HonestError("p", 1.0, 1.0, 1.0, 1.0, 1.0, {}, "refused", "worse than none", rules=RULES)
    with pytest.raises(InputError, match="was refused and will not run: worse than none"):
        start([replace(model(), honest_error=refused)])
    assert start([replace(model(), honest_error=replace(refused, verdict="accepted"))])


@pytest.mark.parametrize("silent", [True, False])
def test_an_outage_does_not_end_in_a_jump(silent: bool) -> None:
    """Half an hour without a usable reading: the rate limit saves no travel up."""
    limits = Limits(magnitude=1000.0, rate=0.05, reading_age=60.0)
    state = start([model()])
    for k in range(3):
        state, _ = step([model()], limits, state, reading(10.0 * k, 20.0), 10.0 * k)
    if not silent:
        for k in range(3, 180):
            state, result = step([model()], limits, state, reading(10.0 * k, math.nan), 10.0 * k)
            assert result.rejected
    _, result = step([model()], limits, state, reading(1800.0, 60.0), 1800.0)
    assert not result.rejected
    travelled = abs(result.corrections["z"].offset)
    assert 0 < travelled <= limits.rate * (limits.reading_age if silent else 10.0) * (1 + 1e-12)


@pytest.mark.parametrize("rejected", [True, False])
def test_a_clock_that_goes_back_saves_no_travel_up(rejected: bool) -> None:
    """0.1 um/s for 0.2 s is 0.02 um, whatever the clock did in between; it used to be 6.0 um."""
    limits = Limits(magnitude=1000.0, rate=0.1, reading_age=60.0)
    state = start([model()])
    for k in range(3):
        t = 40.0 if k else 20.0
        state, before = step([model()], limits, state, reading(100.0 + 0.1 * k, t), 100.0 + 0.1 * k)
    state, _ = step([model()], limits, state, reading(100.25, math.nan if rejected else 40.0), 40.0)
    after, result = step([model()], limits, state, reading(100.4, 60.0), 100.4)
    assert not result.rejected
    moved = abs(result.corrections["z"].offset - before.corrections["z"].offset)
    assert moved == pytest.approx(0.1 * 0.2)
    assert after.clock == 100.4


@given(st.lists(st.tuples(st.floats(-100.0, 100.0), st.booleans()), min_size=2, max_size=30))
def test_all_travel_fits_into_the_time_that_went_by(steps: list[tuple[float, bool]]) -> None:
    """Whatever the clock does: the way is at most the rate times how far the clock ever got."""
    limits = Limits(magnitude=1000.0, rate=0.1, reading_age=60.0)
    state, _ = step([model()], limits, start([model()]), reading(1000.0, 20.0), 1000.0)
    way, now, offset = 0.0, 1000.0, 0.0
    for k, (jump, dead) in enumerate(steps):
        now += jump
        state, result = step([model()], limits, state, reading(now, math.nan if dead else 20.0 + k), now)
        way += abs(result.corrections["z"].offset - offset)
        offset = result.corrections["z"].offset
    assert state.clock is not None
    assert way <= limits.rate * (state.clock - 1000.0) * (1 + 1e-9) + 1e-9


def three_sensors(quantity: str = "temperature", unit: str = "degC") -> LinearDynamic:
    inputs = [Input(f"t{k}", "temperature", "degC", 20.0 + k, True, -1.0, 4.0) for k in range(3)]
    return replace(
        model(), inputs=(*inputs, Input("q", quantity, unit, 0.0, False, 0.0, 5.0)), signals=((0,), (1,), (2,), (3,)),
        direct=(1.0, 1.0, 1.0, 1.0), lag_signals=(), time_constants=(), lagged=()
    )  # fmt: skip


@pytest.mark.parametrize("off", [-39.9, -12.0, 12.0, 39.9])
def test_one_sensor_that_is_off_at_the_start_counts_by_its_rises(off: float) -> None:
    """Every later start was refused, though a constant offset does a rise no harm."""
    models = [three_sensors("dimensionless", "1")]
    begin = {"t0": 14.0, "t1": 15.0, "t2": 16.0 + off, "q": 1.0}  # 6 degC colder than in the training
    state, result = step(models, OPEN, start(models), Reading(0.0, begin), 0.0)
    assert not result.rejected
    assert state.models[0].reference.tolist() == [14.0, 15.0, 16.0 + off, 0.0]
    warm = {"t0": 15.0, "t1": 15.0, "t2": 18.0 + off, "q": 1.0}
    _, result = step(models, OPEN, state, Reading(60.0, warm), 60.0)
    assert result.deviations["z"].offset == pytest.approx(1.0 + 2.0 + 1.0)
    said = describe_start(models, state.models)
    if off == 12.0:  # a day 6 degC warmer, with the two others 12 degC too cold, would read the same
        assert "sensors disagree at the start: t2 +12.0 degC, t0 +0.0 degC, t1 +0.0 degC: which" in said
    else:
        told = f"compared with the training, these start off the other temperatures: t2 {off:+.1f} degC: "
        assert said.startswith(told)


@pytest.mark.parametrize("off", [-40.0, -20.0, -5.0, 1.0, 5.0, 20.0, 40.0])
@pytest.mark.parametrize(("count", "shifted"), [(3, 1), (3, 2), (4, 1), (4, 2), (4, 3), (5, 3), (6, 3), (16, 3)])
def test_a_start_is_not_refused_for_one_to_three_sensors(off: float, count: int, shifted: int) -> None:
    """They were, when the median itself was off by 20 degC; a constant offset does a rise no harm."""
    inputs = tuple(Input(f"t{k}", "temperature", "degC", 20.0, True, -1.0, 4.0) for k in range(count))
    one = replace(three_sensors("dimensionless", "1"), lag_signals=(), time_constants=(), lagged=())
    models = [replace(one, inputs=inputs, signals=tuple((k,) for k in range(count)), direct=(1.0,) * count)]
    begin = {f"t{k}": 18.0 + off * (k < shifted) for k in range(count)}  # 2 degC colder than in the training
    state, result = step(models, OPEN, start(models), Reading(0.0, begin), 0.0)
    assert not result.rejected
    warm = {name: value + 1.0 for name, value in begin.items()}
    state, result = step(models, OPEN, state, Reading(60.0, warm), 60.0)
    assert not result.rejected
    assert result.deviations["z"].offset == pytest.approx(count)
    said = describe_start(models, state.models)
    assert all(f"t{k} " in said for k in range(shifted))
    may = 2 * (min(shifted, count - shifted) + 1) >= count and abs(off - 2.0) <= 15.0
    assert ("cannot be told" in said) == may


@pytest.mark.parametrize("off", [43.0, 49.6])
def test_a_sensor_in_another_unit_is_no_zero(off: float) -> None:
    models = [three_sensors("dimensionless", "1")]
    begin = {"t0": 20.0, "t1": 21.0, "t2": 22.0 + off, "q": 1.0}
    state, result = step(models, OPEN, start(models), Reading(0.0, begin), 0.0)
    assert result.rejected.startswith(f"t2 = {22.0 + off:g} degC is not plausible as a start")
    assert math.isnan(state.models[0].reference[2])
    _, result = step(models, OPEN, state, Reading(1.0, begin | {"t2": 22.0}), 1.0)
    assert not result.rejected


@pytest.mark.parametrize("off", [-40.0, 40.0])
def test_half_of_the_sensors_may_be_off_together(off: float) -> None:
    inputs = [Input(f"t{k}", "temperature", "degC", 20.0 + k, True, -1.0, 4.0) for k in range(4)]
    zero = [20.0, 21.0 + off, 22.0 + off, 23.0]
    assert find_offsets(inputs, zero, THRESHOLDS) == {"t1": off, "t2": off}


def test_a_machine_far_from_all_that_was_trained_does_not_start() -> None:
    models = [three_sensors("dimensionless", "1")]
    hot = Reading(0.0, {"t0": 40.0, "t1": 41.0, "t2": 42.0, "q": 1.0})
    _, result = step(models, OPEN, start(models), hot, 0.0)
    assert result.rejected.endswith("the machine differs by +20.0 degC from the zero of the training data")


@pytest.mark.parametrize(("quantity", "unit"), [("displacement", "um"), ("dimensionless", "1"), ("feed", "mm/min")])
def test_what_nature_sets_no_bounds_to_has_those_of_the_training(quantity: str, unit: str) -> None:
    models = [three_sensors(quantity, unit)]
    begin = {"t0": 20.0, "t1": 21.0, "t2": 22.0}
    state = start(models)
    for time, value in enumerate([1e300, 1.0, -1e300, 1e300, math.inf]):
        now = float(time)
        state, result = step(models, OPEN, state, Reading(now, begin | {"q": value}), now)
        assert bool(result.rejected) == (value != 1.0)
        assert result.rejected in ("", f"q = {value} {unit} is not plausible")
    _, result = step(models, OPEN, state, Reading(9.0, begin | {"q": 20.0}), 9.0)
    assert not result.rejected  # outside the trained range, but of its size: the model's support says what to do


AVERAGING = Zeroing(300.0, 10.0, "n")


def live(models: list[LinearDynamic], rows: list[tuple[float, float, float]]) -> list[tuple[CompensatorState, float]]:
    """Return the state and the correction after each reading (time, t, n)."""
    state, found = start(models), []
    for time, t, n in rows:
        state, result = step(models, OPEN, state, reading(time, t, n), time)
        found.append((state, result.corrections["z"].offset))
    return found


def test_the_zero_is_the_mean_of_the_first_minutes_at_rest() -> None:
    """The correction is zero until it is known; then it is as if it had been known from the first reading on."""
    averaging, rng = replace(model(), zeroing=AVERAGING), np.random.default_rng(5)
    temperatures = 20 + 0.4 * rng.normal(size=40)
    rows = [(15.0 * k, float(t), 0.0) for k, t in enumerate(temperatures)]
    found = live([averaging], rows)
    assert [offset for _, offset in found[:20]] == [0.0] * 20
    zero = float(found[20][0].models[0].reference[0])
    assert zero == pytest.approx(temperatures[:21].mean(), abs=0.1)
    assert abs(zero - 20) < 0.25 < abs(temperatures - 20).max()
    state, last = averaging.init([zero, 0.0]), 0.0
    for k, (time, t, n) in enumerate(rows):
        # the readings of the zero say their mean: the machine rests in it
        state, deviation = averaging.step(state, np.array([zero if k <= 20 else t, n]), time - last)
        last = time
        if k >= 20:
            assert found[k][1] == -float(deviation)
    assert all(len(s.averaged[0].recent) == 2 for s, _ in found[1:20])
    assert all(not s.averaged[0].recent for s, _ in found[20:])


def test_the_zero_ends_where_the_spindle_starts() -> None:
    rows = [(15.0 * k, 20.0 + 0.1 * (k % 2), 0.0) for k in range(4)] + [(15.0 * k, 30.0, 3000.0) for k in range(4, 9)]
    found = live([replace(model(), zeroing=AVERAGING)], rows)
    assert [offset for _, offset in found[:4]] == [0.0] * 4
    assert found[4][0].models[0].reference[0] == pytest.approx(20.05)
    assert found[4][1] == pytest.approx(-2 * 9.95 - 0.01 * 3000 * -math.expm1(-15 / 600))


def test_a_spindle_that_turns_from_the_first_reading_keeps_the_zero_short() -> None:
    """Ten seconds, not five minutes: the machine warms up meanwhile."""
    for n, speed in ((3000.0, "n"), (0.0, "")):  # it turns; or nothing says that it stands
        zeroing = Zeroing(300.0, 10.0, speed)
        found = live([replace(model(), zeroing=zeroing)], [(2.0 * k, 20.0 + 0.02 * k, n) for k in range(20)])
        assert found[5][0].models[0].reference[0] == pytest.approx(20.05)
        assert found[4][1] == 0.0
    once_a_minute = live([replace(model(), zeroing=AVERAGING)], [(60.0 * k, 20.0 + k, 3000.0) for k in range(3)])
    assert once_a_minute[1][0].models[0].reference[0] == 20.0
    assert once_a_minute[0][1] == 0.0 > once_a_minute[1][1]


def test_an_outlier_and_a_dead_reading_are_not_in_the_zero() -> None:
    rows = [(15.0 * k, 20.0 + 0.01 * (k % 3), 0.0) for k in range(21)]
    rows[3], rows[7] = (45.0, 27.0, 0.0), (105.0, math.nan, 0.0)  # 7 degC off is no machine that does not start
    found = live([replace(model(), zeroing=AVERAGING)], rows)
    assert found[-1][0].models[0].reference[0] == pytest.approx(20.01, abs=0.002)


@pytest.mark.parametrize("where", [0, 1, 2, 10, 19, 20])
@pytest.mark.parametrize("wrong", [85.0, 27.0])
def test_a_wrong_reading_is_not_in_the_zero_wherever_it_is(where: int, wrong: float) -> None:
    """85 degC, as a DS18B20 reads after power-on, does not pass the gate; 27 degC does."""
    rows = [(15.0 * k, 20.0 + 0.01 * (k % 3), 0.0) for k in range(22)]
    rows[where] = (rows[where][0], wrong, 0.0)
    found = live([replace(model(), zeroing=AVERAGING)], rows)
    assert found[-1][0].models[0].reference[0] == pytest.approx(20.01, abs=0.0025)


@pytest.mark.parametrize("cycle", [0.125, 1.0, 15.0, 60.0])
def test_the_interval_counts_whatever_the_cycle(cycle: float) -> None:
    rows = [(cycle * k, 20.0 + cycle * k / 300.0, 0.0) for k in range(round(330.0 / cycle) + 1)]
    found = live([replace(model(), zeroing=AVERAGING)], rows)
    known = [math.isfinite(state.models[0].reference[0]) for state, _ in found]
    assert rows[known.index(True)][0] == 300.0
    assert found[-1][0].models[0].reference[0] == pytest.approx(20.5, abs=1e-9)


def test_a_gap_in_the_interval_counts_as_the_readings_about_it() -> None:
    times = [0.0, 15.0, 30.0, 45.0, 60.0, 240.0, 255.0, 270.0, 285.0, 300.0, 315.0]
    found = live([replace(model(), zeroing=AVERAGING)], [(t, 20.0 if t < 100.0 else 21.0, 0.0) for t in times])
    assert found[-1][0].models[0].reference[0] == pytest.approx(20.5)  # half of the gap each
    late = live([replace(model(), zeroing=AVERAGING)], [(t, 20.0 + t / 1000.0, 0.0) for t in (0.0, 30.0, 60.0, 900.0)])
    assert late[-2][1] == 0.0 != late[-1][1]  # a reading after the interval ends it
    assert late[-1][0].models[0].reference[0] == pytest.approx(20.03)


def test_outside_inputs_are_told() -> None:
    state = start([model()])
    state, _ = step([model()], OPEN, state, reading(0.0, 20.0), 0.0)
    _, result = step([model()], OPEN, state, reading(1.0, 140.0), 1.0)
    assert result.outside == ("t",)


def test_start_refuses_what_it_cannot_correct() -> None:
    with pytest.raises(InputError, match="two models for the same target"):
        start([model(), model()])
    with pytest.raises(InputError, match="predicts urad"):
        start([model(unit="urad")])
