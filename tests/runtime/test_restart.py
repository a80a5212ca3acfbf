"""A compensator that stops and continues: no jump, nothing forgotten that counts, one target beside the other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driftmodels import ACCEPTED
from hypothesis import given
from hypothesis import strategies as st
from watchedmachine import failing, watched_model

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.orders import order, rezero
from thermocomp.runtime.state import CompensatorState, Status, resume, silence

HOUR = 3600.0
LIMITS = Limits(rate=0.05)
MODEL = LinearDynamic(
    target="z",
    unit="um",
    inputs=(
        Input("t", "temperature", "degC", 20.0, True, -50.0, 50.0),
        Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0),
    ),
    signals=((0,), (1,)),
    direct=(1.0, 0.0),
    lag_signals=(1,),
    time_constants=(3600.0,),
    lagged=(0.01,),
    honest_error=ACCEPTED,
)
MACHINE = Compensator.of([MODEL], LIMITS)


def heat(time: float) -> float:
    return 20.0 + 5.0 * -math.expm1(-time / HOUR)


def reading(time: float, skew: float = 0.0) -> Reading:
    return Reading(time + skew, {"t": heat(time), "n": 4000.0 if time > 0 else 0.0})


def run(
    state: CompensatorState, begin: float, end: float, every: float = 10.0
) -> tuple[CompensatorState, list[float], list[str]]:
    offsets, words = list[float](), list[str]()
    for time in np.arange(begin, end, every).tolist():
        state, said = MACHINE.step(state, reading(time), time, tick=time)
        offsets.append(said.corrections["z"].offset)
        words.append(said.states["z"].word)
    return state, offsets, words


@pytest.mark.parametrize("age", [1.0, 60.0, 600.0, 3600.0])
def test_a_restart_on_a_warm_machine_is_no_jump(age: float) -> None:
    """It was one of 45 um, and ten hours of a wrong zero."""
    state, before, _ = run(MACHINE.start(), 0.0, 4 * HOUR)
    again = resume(state, MACHINE.start(), age)
    begin = 4 * HOUR - 10.0 + age
    _, after, words = run(again, begin, begin + HOUR)
    _, whole, _ = run(state, 4 * HOUR, begin + HOUR)
    assert abs(after[0] - before[-1]) == 0.0  # no time has passed for the process
    assert max(np.abs(np.diff([before[-1], *after]))) <= LIMITS.rate * 10.0 + 1e-12
    assert after[-1] == pytest.approx(whole[-1], abs=0.05)
    assert words[-1] == "active"


def test_the_monotone_clock_of_a_new_process_begins_anywhere() -> None:
    state, before, _ = run(MACHINE.start(), 0.0, 4 * HOUR)
    again = resume(state, MACHINE.start(), 30.0)
    for k in range(100):
        time = 4 * HOUR + 20.0 + 10.0 * k
        again, said = MACHINE.step(again, reading(time, skew=1e6), time + 1e6, tick=0.5 + 10.0 * k)
        assert not said.rejected
        assert said.corrections["z"].offset == pytest.approx(before[-1], abs=2.0)


@pytest.mark.parametrize("age", [THRESHOLDS.resumable + 1.0, -1.0, math.nan, math.inf])
def test_what_is_too_old_or_of_unknown_age_begins_anew_but_moves_from_where_it_is(age: float) -> None:
    state, before, _ = run(MACHINE.start(), 0.0, 4 * HOUR)
    again = resume(state, MACHINE.start(), age)
    assert not again.references
    assert again.corrections == state.corrections
    _, after, words = run(again, 5 * HOUR, 6 * HOUR)
    assert words[0] == "restarting"
    assert max(np.abs(np.diff([before[-1], *after]))) <= LIMITS.rate * 10.0 + 1e-12
    assert words[-1] == "active"


def test_the_controller_knows_what_is_in_force() -> None:
    state, _, _ = run(MACHINE.start(), 0.0, 4 * HOUR)
    again = resume(state, MACHINE.start(), 20.0, {"z": Correction(0.0)})
    _, after, words = run(again, 4 * HOUR, 5 * HOUR)
    assert after[0] == 0.0
    assert after[1] == pytest.approx(-0.5)
    assert words[1] == "restarting"
    assert after[-1] == pytest.approx(state.corrections["z"].offset, abs=1.0)


def test_the_ledger_says_from_when_it_counts() -> None:
    state, _, _ = run(MACHINE.start(), 100.0, 500.0)
    assert state.references["z"].time == 100.0
    assert state.references["z"].why == "mean over the first readings after the start"


def test_a_new_zero_moves_nothing_and_counts_from_there() -> None:
    state, before, _ = run(MACHINE.start(), 0.0, HOUR)
    homed = rezero(MACHINE, state, "z", HOUR, "homing")
    _, after, _ = run(homed, HOUR, 3 * HOUR)
    _, plain, _ = run(state, HOUR, 3 * HOUR)
    assert abs(after[0] - before[-1]) < 0.1
    assert after[-1] - before[-1] == pytest.approx(plain[-1] - before[-1], abs=1e-6)
    cleared = rezero(MACHINE, state, "z", HOUR, "homing", in_force=Correction(0.0))
    _, zero, _ = run(cleared, HOUR, 3 * HOUR)
    assert abs(zero[0]) < 0.1
    assert zero[-1] == pytest.approx(plain[-1] - before[-1], abs=0.1)
    assert cleared.references["z"].why == "homing"


def test_a_new_zero_wants_one_before() -> None:
    with pytest.raises(InputError, match="still being averaged"):
        rezero(MACHINE, MACHINE.start(), "z", 0.0, "homing")
    with pytest.raises(InputError, match="expected one of z"):
        rezero(MACHINE, MACHINE.start(), "y", 0.0, "homing")


def test_probings_are_forgotten_with_the_zero_they_counted_from() -> None:
    state, _, _ = run(MACHINE.start(), 0.0, HOUR)
    deviation = state.raw["z"].offset + 1.0
    state, said = MACHINE.step(state, reading(HOUR), HOUR, {"z": Probing(deviation)}, tick=HOUR)
    assert not said.refused
    assert rezero(MACHINE, state, "z", HOUR, "homing").learned == {}


def test_targets_run_or_stay_out_one_by_one() -> None:
    refused = replace(ACCEPTED, verdict="refused", reason="worse than none")
    machine = Compensator.of([MODEL, replace(MODEL, target="y", honest_error=refused)], LIMITS)
    state = machine.start()
    for k in range(1, 400):
        state, said = machine.step(state, reading(10.0 * k), 10.0 * k)
    assert said.corrections["z"].offset < -5.0
    assert said.corrections["y"].offset == 0.0
    assert said.deviations["y"].offset == pytest.approx(said.deviations["z"].offset)
    assert said.states["y"].word == "shadow"
    assert "worse than none" in said.states["y"].reason
    with pytest.raises(InputError, match="shadow only"):
        order(machine, state, "y", None)
    with pytest.raises(InputError, match="refused"):
        Compensator.of([replace(MODEL, honest_error=refused)])
    assert Compensator.of([replace(MODEL, honest_error=refused)], watching=True).shadow


def test_what_somebody_orders() -> None:
    state, before, _ = run(MACHINE.start(), 0.0, HOUR)
    held, after, words = run(order(MACHINE, state, "z", Status("holding", "by M. Weber")), HOUR, 3 * HOUR)
    assert set(after) == {before[-1]}  # longer than `Limits.hold`: it was ordered
    assert set(words) == {"holding"}
    _, after, _ = run(order(MACHINE, held, "z", None), 3 * HOUR, 4 * HOUR)
    assert max(np.abs(np.diff([before[-1], *after]))) <= LIMITS.rate * 10.0 + 1e-12
    _, after, words = run(order(MACHINE, state, "z", Status("shadow", "trial")), HOUR, 3 * HOUR)
    assert after[-1] == 0.0
    assert max(np.abs(np.diff([before[-1], *after]))) <= LIMITS.rate * 10.0 + 1e-12
    off, after, words = run(order(MACHINE, state, "z", Status("suspended", "not homed")), HOUR, 2 * HOUR)
    assert set(after) == {0.0}
    _, after, _ = run(order(MACHINE, off, "z", None), 2 * HOUR, 4 * HOUR)
    assert abs(after[0]) <= LIMITS.rate * 10.0 + 1e-12
    for wrong in (Status("active"), Status("fading")):
        with pytest.raises(InputError, match="is not a state that can be ordered"):
            order(MACHINE, state, "z", wrong)


def test_no_reading_at_all_holds_and_then_fades() -> None:
    state, before, _ = run(MACHINE.start(), 0.0, 2 * HOUR)
    offsets, words = [], []
    for k in range(6 * 3600):
        state, said = MACHINE.wait(state, 2 * HOUR + k, "no reading")
        offsets.append(said.corrections["z"].offset)
        words.append(said.states["z"].word)
    assert set(offsets[:1700]) == {before[-1]}
    assert (words[0], words[-1]) == ("holding", "fading")
    assert abs(offsets[-1]) < 0.01 * abs(before[-1])
    assert max(np.abs(np.diff(offsets))) <= LIMITS.rate + 1e-12


@pytest.mark.parametrize("leap", [-1e6, -50.0, 50.0, 1e6, 1e12])
def test_a_clock_that_is_set_stops_nothing(leap: float) -> None:
    """With both stamps far ahead everything stood still until that time came."""
    state, _, _ = run(MACHINE.start(), 0.0, HOUR)
    plain, found, skew = state, [], 0.0
    for k in range(360):
        time = HOUR + 10.0 * k
        skew = leap if 100 <= k < 101 else 0.0
        state, said = MACHINE.step(state, reading(time, skew), time + skew, tick=time)
        plain, other = MACHINE.step(plain, reading(time), time, tick=time)
        assert not said.rejected
        found.append(said.corrections["z"].offset - other.corrections["z"].offset)
    assert max(np.abs(found)) < 0.2


hostile = st.one_of(
    st.floats(), st.integers(-(10**400), 10**400), st.none(), st.text(max_size=3), st.booleans(), st.just([1])
)


@given(
    st.lists(
        st.tuples(hostile, hostile, st.sampled_from(["t", "n", "both"]), st.floats(0.0, 100.0), hostile), max_size=40
    )
)
def test_whatever_comes_it_neither_raises_nor_runs(rows: list[tuple[object, object, str, float, object]]) -> None:
    state, _, _ = run(MACHINE.start(), 0.0, 600.0)
    tick, last = 590.0, state.corrections["z"].offset
    for stamp, now, which, passed, value in rows:
        tick += passed
        values: dict[str, object] = {"t": 22.0, "n": 1000.0}
        values |= {k: value for k in values if which in (k, "both")}
        none = which == "both" and value is None  # no table of values at all
        timely = type(value) is bool
        reading = Reading(tick if timely else stamp, None if none else values)  # type: ignore[arg-type]
        state, said = MACHINE.step(state, reading, tick if timely else now, tick=tick)  # type: ignore[arg-type]
        offset = said.corrections["z"].offset
        assert math.isfinite(offset)
        assert abs(offset - last) <= LIMITS.rate * passed * (1 + 1e-9) + 1e-12
        if said.rejected:
            assert offset == last or said.states["z"].word == "fading"
        last = offset


def test_deviations_are_taken_off_each_other_on_one_axis() -> None:
    one, other = Deviation(10.0, 20.0, 100.0), Deviation(4.0, -10.0, 300.0)
    for position in (0.0, 100.0, 700.0):
        assert one.less(other).at(position) == pytest.approx(one.at(position) - other.at(position))


def test_the_wait_for_the_first_reading_is_part_of_the_outage() -> None:
    state, _, _ = run(MACHINE.start(), 0.0, HOUR)
    last = state.time
    assert last is not None
    again = resume(state, MACHINE.start(), 10.0, tick=5.0)
    assert silence(again, 5.0) == 10.0
    waited = silence(again, 25.0)  # and then it is restarted once more, without a reading
    again = resume(again, MACHINE.start(), waited, tick=1000.0)
    after, said = MACHINE.step(again, reading(HOUR + 60.0), HOUR + 60.0, tick=1030.0)
    assert not said.rejected
    assert after.time == pytest.approx(last + 60.0)
    assert silence(after, 1031.0) == 1.0


def test_many_restarts_do_not_slow_the_clock_of_the_models() -> None:
    state, _, _ = run(MACHINE.start(), 0.0, 600.0)
    _, offsets, _ = run(state, 600.0, 600.0 + HOUR)
    for begin in np.arange(600.0, 600.0 + HOUR, 60.0).tolist():
        state, found, _ = run(state, begin, begin + 40.0)
        clock = begin + 30.0
        state = resume(state, MACHINE.start(), silence(state, clock + 5.0), tick=clock + 5.0)
    assert state.time == pytest.approx(HOUR + 570.0)
    assert found[-1] == pytest.approx(offsets[-3], abs=0.1)


def test_a_temperature_that_is_the_same_by_chance_after_an_outage_is_not_stuck() -> None:
    day, compensator = failing(), Compensator.of([watched_model()], LIMITS)
    inputs = [c.name for c in day.channels if c.quantity in ("temperature", "spindle_speed")]
    rows = [{str(n): float(v) for n, v in row.items()} for row in day.table[inputs].to_dict("records")]
    time = (day.time - day.time[0]).tolist()
    before, after = (int(np.searchsorted(time, hours * HOUR)) for hours in (6.0, 9.0))
    state = compensator.start()
    for k in range(before):
        state, _ = compensator.step(state, Reading(time[k], rows[k]), time[k])
    for name in (n for n in inputs if n.startswith("t")):
        now, age = float(time[after]), float(time[after] - time[before - 1])
        again = resume(state, compensator.start(), age, None, now)
        reading = Reading(now, rows[after] | {name: rows[before - 1][name]})
        assert compensator.step(again, reading, now, tick=now)[1].failed == {}
