"""What probings teach: as a Kalman filter of textbooks does, bounded, never by something absurd."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driftmodels import ACCEPTED
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.band import Band
from thermocomp.core.correction import Deviation, Limits
from thermocomp.core.inputs import Input
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.core.position import PositionModel
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.runtime import adaptation, batch
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.advance import Advanced
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.lines import DeviationLine, constant, evaluate

HOUR = 3600.0
MODEL = PacedDynamic(
    target="z",
    unit="um",
    inputs=(
        Input("t", "temperature", "degC", 20.0, True, -5.0, 15.0),
        Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0),
    ),
    time_constants=(600.0,),
    temperatures=(LaggedInput(0, 2.0, (0.5,)),),
    top_speed=6000.0,
    states=(SpeedState(1, 1.0, 1800.0, 600.0, 5.0),),
    spread=((0.3, 0.1, 1.0), (0.0, 0.2, 3.0)),
    band=Band(0.9, "assumption", 3, 1.0, 2.0, 3.0, (1,)),
    honest_error=replace(ACCEPTED, rms=2.0, cycles={"1": 2.0, "2": 2.0}, none_rms=30.0),
)


def test_it_is_a_kalman_filter() -> None:
    free = replace(THRESHOLDS, suspect=1e5, suspect_first=1e5, implausible=1e6, most_moved=1e6)
    rng = np.random.default_rng(0)
    kinds, prior = np.array([7 * 86400.0, 7 * 86400.0, 4 * HOUR]), np.diag([1.0, 1.0, 4.0])
    mean, covariance, last = np.zeros(3), prior.copy(), 0.0
    found = adaptation.begin(2.0, 2)
    for time in np.cumsum(rng.uniform(0.0, 4 * HOUR, 30)).tolist():
        fading = np.diag(np.exp(-(time - last) / kinds))
        mean, covariance = fading @ mean, fading @ covariance @ fading + prior - fading @ prior @ fading
        directions, error = rng.normal(0.0, 1.0, 2), float(rng.normal(0.0, 2.0))
        h = np.append(directions, 1.0)
        assert found.shift(time, directions, free) == pytest.approx(h @ mean)
        assert found.narrowing(time, directions, 2.0) == pytest.approx(
            math.sqrt(h @ covariance @ h / (h @ prior @ h)), rel=1e-9
        )
        found, why = adaptation.take(found, directions, time, error, 0.5, free)
        assert not why
        gain = covariance @ h / (h @ covariance @ h + (THRESHOLDS.unexplained * 2.0) ** 2 + 0.5**2)
        mean, covariance, last = mean + gain * (error - h @ mean), covariance - np.outer(gain, h @ covariance), time


def test_what_it_learned_is_forgotten() -> None:
    found, _ = adaptation.take(adaptation.begin(2.0, 0), np.zeros(0), 0.0, 3.0, 0.0)
    assert found.shift(1.0, np.zeros(0)) == pytest.approx(3.0, rel=0.05)
    assert found.shift(THRESHOLDS.offset_decay, np.zeros(0)) == pytest.approx(found.shift(0.0, np.zeros(0)) / math.e)
    assert found.narrowing(0.0, np.zeros(0), 1.0) < 0.3
    assert found.narrowing(20 * THRESHOLDS.offset_decay, np.zeros(0), 1.0) == pytest.approx(1.0)


NOTHING = np.zeros(0)


@pytest.mark.parametrize("error", [math.nan, math.inf, 1e300, 40.0, -40.0])
def test_what_is_implausible_moves_nothing(error: float) -> None:
    before = adaptation.begin(2.0, 1)
    after, why = adaptation.take(before, np.ones(1), 60.0, error, 0.5)
    assert why
    assert (after.mean == before.mean).all()
    assert after.shift(61.0, np.ones(1)) == 0.0


def test_what_is_implausible_is_refused_however_often() -> None:
    found = adaptation.begin(2.0, 1)
    for k in range(1, 50):
        found, why = adaptation.take(found, np.ones(1), 0.5 * HOUR * k, 9.0 + 0.01 * k, 0.1)
        assert "um from the expected value, where at most 6.8 um are plausible: check the probe, the tool" in why
        assert why.endswith("re-zero the target")
        assert found.shift(0.5 * HOUR * k, np.ones(1)) == 0.0
    found, why = adaptation.take(found, np.ones(1), 30 * HOUR, 2.0, 0.1)  # a sound one counts
    assert not why
    assert found.shift(30 * HOUR, np.ones(1)) > 1.0


@given(error=st.floats(0.0, 1e5), size=st.floats(0.01, 20.0), typical=st.floats(0.0, 40.0), spread=st.floats(0.0, 5.0))
def test_one_alone_moves_no_further_than_what_is_suspect(
    error: float, size: float, typical: float, spread: float
) -> None:
    found, _ = adaptation.take(adaptation.begin(size, 0, typical), NOTHING, 60.0, error, spread)
    assert 0.0 <= found.shift(60.0, NOTHING) <= min(error, THRESHOLDS.suspect * size) + 1e-9


def test_of_those_that_are_suspect_the_further_counts_less() -> None:
    shifts = [
        adaptation.take(adaptation.begin(2.0, 0), NOTHING, 60.0, e, 0.0)[0].shift(60.0, NOTHING) for e in (3, 5, 6)
    ]
    assert shifts[0] == pytest.approx(3.0, rel=0.05)
    assert shifts[0] > shifts[1] > shifts[2] > 0.0
    assert shifts[2] < 0.5  # the first one for hours: nothing is known of the day


def test_in_the_same_chip_ten_are_one() -> None:
    """Each with an id of its own: suspect, not refused."""
    found, why = adaptation.take(adaptation.begin(2.0, 0), NOTHING, 60.0, 5.5, 0.0)
    assert not why
    once = found
    for k in range(1, 10):
        found, why = adaptation.take(found, NOTHING, 60.0 + 5.0 * k, 5.5 + 0.01 * k, 0.0)
        assert "um from the expected value, as the previous probing: it counts only once" in why
    assert (found.mean == once.mean).all()
    assert once.shift(60.0, NOTHING) < 3.0
    for k in range(1, 10):  # the chip stays: as far as the band
        found, why = adaptation.take(found, NOTHING, 0.5 * HOUR * k, 5.5, 0.0)
        assert found.shift(0.5 * HOUR * k, NOTHING) <= 1.645 * 2.0


def test_what_is_suspect_again_half_an_hour_later_counts_only_once() -> None:
    once, why = adaptation.take(adaptation.begin(2.0, 0, 0.8), NOTHING, 60.0, 2.8, 0.0)
    assert not why
    found, why = adaptation.take(once, NOTHING, 0.5 * HOUR, 4.4, 0.0)
    assert "as the previous probing: it counts only once" in why
    assert (found.mean == once.mean).all()


def test_what_was_refused_is_not_taken_a_minute_later_for_being_a_little_less() -> None:
    before, why = adaptation.take(adaptation.begin(2.0, 0), NOTHING, 60.0, 6.3, 0.0)
    assert "are plausible" in why
    _, why = adaptation.take(before, NOTHING, 120.0, 5.0, 0.0)
    assert "as the previous probing: it counts only once" in why


def test_on_a_day_of_small_errors_less_is_plausible() -> None:
    def limit(errors: list[float]) -> float:
        found, time = adaptation.begin(2.0, 0), 0.0
        for error in errors:
            time += 2 * HOUR
            found, _ = adaptation.take(found, NOTHING, time, error, 0.1)
        moved = [
            e for e in np.arange(0.0, 20.0, 0.1) if not adaptation.take(found, NOTHING, time + 2 * HOUR, e, 0.1)[1]
        ]
        return max(moved)

    assert limit([0.1] * 8) < 0.75 * limit([]) < 0.75 * limit([2.0, -3.0, 3.0, -3.0, 3.0])


@pytest.mark.parametrize("step", [0.5, 1.0, -1.0])
def test_a_creeping_error_is_followed_to_the_band_and_then_reported(step: float) -> None:
    most = adaptation.find_most(1.5, 30.0, 200.0)
    assert most == 7.5
    found, told = adaptation.begin(1.5, 2, most=most), list[str]()
    directions = np.array([1.0, 0.3])
    for k in range(1, 60):
        found, why = adaptation.take(found, directions, k * HOUR, k * step, 0.0)
        told += [why] if why else []
        assert abs(found.shift(k * HOUR, directions)) <= 1.645 * 1.5 + 1e-9
        assert abs(found.shift(k * HOUR, 20.0 * directions)) <= 1.645 * 1.5 + 1e-9  # nor later, on a hotter machine
    assert "whose error can be at most 7.5 um: it grew from probing to probing: ageing of the machine, or" in told[0]
    assert "re-zero the target" in told[0]


def test_after_a_creeping_error_a_sound_probing_counts_at_once() -> None:
    """What is expected is what is corrected, not what the probings would have moved it to without a limit."""
    found, time = adaptation.begin(1.5, 0, most=7.5), 0.0
    for k in range(1, 8):
        time = k * HOUR
        found, _ = adaptation.take(found, NOTHING, time, 0.9 * k, 0.0)
        assert found.mean[-1] == pytest.approx(found.shift(time, NOTHING))
    assert found.shift(time, NOTHING) == pytest.approx(1.645 * 1.5)
    found, why = adaptation.take(found, NOTHING, time + 0.5 * HOUR, 0.2, 0.0)
    assert not why
    assert abs(found.shift(time + 0.5 * HOUR, NOTHING) - 0.2) < 0.3


def test_a_step_is_not_called_ageing() -> None:
    _, why = adaptation.take(adaptation.begin(1.5, 0, most=7.5), NOTHING, HOUR, 20.0, 0.0)
    assert "whose error can be at most 7.5 um: check the probe, the tool and the unit" in why


@pytest.mark.parametrize(
    ("size", "drift", "magnitude", "most"),
    [
        (1.0, 30.0, 200.0, 5.0),
        (4.0, 30.0, 200.0, 10.0),
        (8.0, 20.0, 200.0, 16.0),
        (8.0, 4.0, 200.0, 12.0),
        (1.0, 30.0, 4.0, 4.0),
        (0.0, 0.0, 200.0, 0.003),
    ],
)
def test_what_a_model_can_be_wrong_by(size: float, drift: float, magnitude: float, most: float) -> None:
    assert adaptation.find_most(size, drift, magnitude) == pytest.approx(most)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 1e6), st.floats(-1e3, 1e3), st.floats(-50.0, 50.0), st.floats(0.0, 5.0)), max_size=60
    )
)
def test_whatever_comes_it_stays_a_covariance(probings: list[tuple[float, float, float, float]]) -> None:
    found, time = adaptation.begin(2.0, 1), 0.0
    for dt, direction, error, repeatability in probings:
        time += dt
        found, _ = adaptation.take(found, np.array([direction]), time, error, repeatability)
        assert np.linalg.eigvalsh(found.covariance).min() > -1e-6 * np.trace(found.covariance)
        assert abs(found.shift(time, np.array([direction]))) <= 1e4


def readings(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(5.0, 60.0, n))
    values = np.column_stack([20.0 + 6.0 * np.sin(time / 4000.0), np.where(np.sin(time / 1500.0) > 0, 4000.0, 0.0)])
    values[rng.random(n) < 0.05] = np.nan
    return time, values


def test_a_test_at_once_is_the_online_step() -> None:
    time, values = readings(600)
    plain = batch.run(MODEL, Limits(), time, values)
    probed = np.full(len(time), np.nan)
    probed[::40] = plain.compensated[::40] + 1.5 + np.cos(time[::40])
    probed[80] = 900.0  # beyond what the model can be wrong by
    probed[240], probed[320] = probed[240] + 4.5, probed[320] + 7.0  # suspect, implausible
    found = batch.run(MODEL, Limits(), time, values, probed=probed, repeatability=0.3)
    running, state, refused = Compensator.of([MODEL]), Compensator.of([MODEL]).start(), list[str]()
    for k, row in enumerate(values.tolist()):
        probings = {"z": Probing(float(probed[k]), 0.3)} if math.isfinite(probed[k]) else None
        reading = Reading(float(time[k]), dict(zip("tn", row, strict=True)))
        state, said = running.step(state, reading, reading.time, probings)
        assert found.compensated[k] == pytest.approx(-said.corrections["z"].offset, rel=1e-9, abs=1e-9)
        refused += [why for why in said.refused.values() if "rejected" not in why]
        if "z" in said.half_widths and math.isfinite(found.half_width[k]):
            assert found.half_width[k] == pytest.approx(said.half_widths["z"], rel=1e-9)
    assert refused == list(found.refused)
    assert 1 <= len(refused) < 8
    assert np.abs(found.shift).max() > 1.0
    assert found.without == pytest.approx(plain.compensated)
    assert plain.shift.max() == 0.0


def test_a_probing_counts_from_the_next_reading_on_and_never_faster_than_the_limits() -> None:
    running = Compensator.of([MODEL], Limits(rate=0.02))
    state, last = running.start(), 0.0
    for k in range(300):
        reading = Reading(60.0 + k, {"t": 20.0, "n": 0.0})
        state, said = running.step(state, reading, reading.time, {"z": Probing(3.0)} if k == 100 else None)
        offset = said.corrections["z"].offset
        assert abs(offset - last) <= 0.02 + 1e-12
        assert (offset == 0.0) == (k <= 100)
        last = offset
    assert last == pytest.approx(-3.0, abs=0.4)


def test_a_probing_without_a_usable_reading_or_model_is_refused() -> None:
    running = Compensator.of([MODEL])
    state, said = running.step(running.start(), Reading(0.0, {"t": math.nan, "n": 0.0}), 0.0, {"z": Probing(4.0)})
    assert said.refused["z"].startswith("the reading to which the probing belongs is rejected: ")
    assert not state.learned
    state, said = running.step(state, Reading(1.0, {"t": 20.0, "n": 0.0}), 1.0, {"y": Probing(4.0)})
    assert said.refused == {"y": "no model computes the correction"}


def test_an_axis_of_several_models_learns_an_offset() -> None:
    model = PositionModel(
        target="EZZ",
        unit="um",
        axis="Z",
        travel=(-200.0, 600.0),
        reference_position=100.0,
        offset=replace(MODEL, target="EZZ"),
        slopes=(replace(MODEL, target="EZZ", unit="um/m", band=None),),
    )
    running = Compensator.of([model])
    state = running.start()
    for k in range(400):
        reading = Reading(60.0 + k, {"t": 20.0, "n": 0.0})
        state, said = running.step(state, reading, reading.time, {"EZZ": Probing(4.0, 0.5, 600.0)} if k == 0 else None)
    assert said.corrections["EZZ"].at(0.0) == pytest.approx(-4.0, abs=1.0)
    assert said.half_widths == {}


def test_a_lost_sensor_widens_the_band() -> None:
    model = replace(MODEL, honest_error=replace(ACCEPTED, rms=2.0, lost={"t": 5.0}))
    assert model.widening(["t"]) == 2.5
    assert model.widening([]) == model.widening(["other"]) == 1.0
    line, reading = DeviationLine(slice(0, 1), (0.0, 0.0), constant), np.array([25.0, 0.0])
    state, said = model.step(model.init((20.0, 0.0)), reading, 0.0)
    spoken = Advanced((state,), (), [float(said)], [float(model.half_width(state, reading))], [reading], ())
    widths = [
        evaluate(line, [model], spoken, 0.0, None, None, failed, Deviation(0.0), 200.0).half_width
        for failed in ([], ["t"])
    ]
    assert widths == [model.half_width(state, reading), 2.5 * model.half_width(state, reading)]
