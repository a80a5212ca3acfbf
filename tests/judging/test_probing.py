"""Models judged with probings: the only displacements used, each after it was made."""

from dataclasses import replace

import numpy as np
import pytest

import thermocomp as tc
from thermocomp.core.exceptions import InputError
from thermocomp.core.reading import Reading
from thermocomp.judging.assessing import assess
from thermocomp.judging.probing import Probed, Probings, find_gain
from thermocomp.judging.replay import replay_compensated
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.report.probings import describe_gains, describe_probings
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator

FEW = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "spindle_rpm")


@pytest.mark.parametrize(
    ("text", "every", "um"),
    [
        ("every 2 h", 7200.0, 0.5),
        ("every 30 min, 0.3 um", 1800.0, 0.3),
        ("every 1.5h", 5400.0, 0.5),
        ("every 2 hours", 7200.0, 0.5),
    ],
)
def test_written(text: str, every: float, um: float) -> None:
    assert Probings.parse(text) == Probings(every, um)


@pytest.mark.parametrize("text", ["", "2 h", "every h", "every 2 days", "every 2 h, 0.3", "every 0 h", "every -1 h"])
def test_written_wrongly(text: str) -> None:
    with pytest.raises(InputError, match="every"):
        Probings.parse(text)


def test_when_they_are_made() -> None:
    time, usable = np.arange(0.0, 10.0), np.ones(10, dtype=np.bool_)
    assert Probings(3.0).find_rows(time, usable).tolist() == [3, 6, 9]
    usable[[0, 3, 6, 7, 8]] = False  # the start is the second; between rows, the next that can be probed
    assert Probings(3.0).find_rows(time, usable).tolist() == [4, 9]
    assert Probings(20.0).find_rows(time, usable).size == 0
    assert Probings(3.0).find_rows(time, np.zeros(10, dtype=np.bool_)).size == 0


def thin(name: str, seed: int = 0) -> Recording:
    """Return every third row of a recording: an interval of 60 s."""
    (full,) = tc.simulate(name, seed=seed)
    return Recording.from_dataframe(full.table.assign(time_s=full.time).iloc[::3], name=full.name)


@pytest.fixture(scope="module")
def day() -> Recording:
    return thin("demo", seed=5)


@pytest.fixture(scope="module")
def fitted() -> tc.ErrorModel:
    return tc.fit(thin("demo"), "z_um", "averaged", inputs=FEW).model


def test_no_displacement_between_is_looked_at(day: Recording, fitted: tc.ErrorModel) -> None:
    samples = stack([day], ["z_um"], [i.name for i in fitted.inputs])
    rows, plan = np.ones(len(samples), dtype=np.bool_), Probings(7200.0)
    ran = replay_compensated(fitted, samples, rows, probings=plan)
    assert ran.probed is not None
    at = np.flatnonzero(ran.probed.at)
    rng = np.random.default_rng(0)
    other = samples.deviations + rng.normal(0.0, 100.0, samples.deviations.shape)
    other[at] = samples.deviations[at]
    again = replay_compensated(fitted, replace(samples, deviations=other), rows, probings=plan)
    assert (again.compensated == ran.compensated).all()
    cut = at[2]  # a probing changes nothing before it, and nothing at its own instant
    other = samples.deviations.copy()
    other[cut] += 3.0
    later = replay_compensated(fitted, replace(samples, deviations=other), rows, probings=plan)
    assert (later.compensated[: cut + 1] == ran.compensated[: cut + 1]).all()
    assert (later.compensated[cut + 1 :] != ran.compensated[cut + 1 :]).any()
    assert ran.probed.without == pytest.approx(replay_compensated(fitted, samples, rows).compensated)


def test_they_lower_the_error_of_another_day(day: Recording, fitted: tc.ErrorModel) -> None:
    plain, probed = tc.assess(fitted, day), tc.assess(fitted, day, probing="every 2 h")
    (one,), (two,) = plain.judged.overall(), probed.judged.overall()
    assert two.metric("rms") < 0.95 * one.metric("rms")
    assert two.unprobed_metric("rms") == pytest.approx(one.metric("rms"))
    assert two.held_metric("rms") > two.metric("rms")
    *larger, line = describe_probings(probed.judged.overall())
    grows = two.metric("max_abs") > one.metric("max_abs")
    assert ["increase the largest error" in told for told in larger] == [True] * grows
    assert line.startswith("z_um, a probing every 2 h (")
    assert f"{two.metric('rms'):.2f} and {two.metric('mae'):.2f}; {one.metric('rms'):.2f} and " in line
    cycles = [a for a in probed.judged.assessments if not a.overall]
    assert sum(int(a.probed.at.sum()) for a in cycles if a.probed) == int(two.probed.at.sum()) if two.probed else False


def test_without_probings_their_benefit_is_reported(day: Recording, fitted: tc.ErrorModel) -> None:
    plain, probed = tc.assess(fitted, day), tc.assess(fitted, day, probing="every 2 h")
    gain, (a,) = plain.judged.probing["z_um"], probed.judged.overall()
    assert gain.rms == pytest.approx(a.metric("rms"), rel=1e-12)
    by_cycle = [c.unprobed_metric("rms") - c.metric("rms") for c in probed.judged.assessments if not c.overall]
    assert gain.gain == pytest.approx(np.mean(by_cycle or [a.unprobed_metric("rms") - a.metric("rms")]), rel=1e-9)
    assert probed.judged.probing == {}
    assert list(describe_gains(plain.judged)) == [f"z_um: {gain.words}"]
    assert plain.to_dict()["probing_every_2_h"]["z_um"]["rms_um"] == gain.rms


def test_the_standard_error_of_a_gain() -> None:
    without, left = np.array([3.0, -3.0, 5.0, 5.0]), np.array([2.0, 2.0, 2.0, -2.0])
    gain = find_gain(Probings(7200.0), without, left, np.array([0, 0, 1, 1]))
    assert gain[1:] == pytest.approx((2.0, 2.0, 1.0))
    assert gain.words == "a probing every 2 h would leave 2.00 um RMS (gain per cycle 2.00 +- 1.00 um)"
    single = find_gain(Probings(7200.0), without, left, np.zeros(4, dtype=np.intp))
    assert np.isnan(single.error)
    assert single.words.endswith("um)")
    assert "+-" not in single.words


def test_too_short_for_a_probing_it_is_as_without(day: Recording, fitted: tc.ErrorModel) -> None:
    (found,) = tc.assess(fitted, day, probing="every 100 h").judged.overall()
    assert found.probed is not None
    assert not found.probed.at.any()
    assert (found.predicted == found.probed.without).all()


def test_probings_alone_are_held_until_the_next() -> None:
    at = np.array([False, True, False, True, False, False])
    probed = Probed(Probings(1.0), at, np.zeros(6), np.zeros(6))
    measured, test = np.arange(1.0, 7.0), np.array([0, 0, 0, 0, 0, 1])
    assert probed.held(measured, test).tolist() == [0.0, 0.0, 2.0, 2.0, 4.0, 0.0]


def test_a_model_that_was_never_judged_cannot_be_probed(day: Recording, fitted: tc.ErrorModel) -> None:
    with pytest.raises(InputError, match="never judged"):
        assess([replace(fitted, honest_error=None)], [day], probings=Probings(7200.0))


@pytest.mark.parametrize("odd", [2, 7200.0, True, ["every 2 h"]])
def test_what_is_no_plan_of_probings_is_refused(odd: object) -> None:
    with pytest.raises(InputError, match="expected text such as"):
        Probings.of(odd)
    assert Probings.of(None) is None
    assert Probings.of("every 2 h") == Probings.of(Probings(7200.0))


@pytest.mark.parametrize("sound", [False, True])
@pytest.mark.parametrize(
    "error",
    [10.0, pytest.param(-10.0, marks=pytest.mark.long), 60.0, pytest.param(-400.0, marks=pytest.mark.long), 15_000.0],
)
def test_a_wrong_one_does_little_harm_however_often_it_comes(
    error: float, sound: bool, day: Recording, fitted: tc.ErrorModel
) -> None:
    """A chip on the sphere, the wrong tool, a unit; beside sound probings every 2 h, and alone."""
    samples = stack([day], ["z_um"], [i.name for i in fitted.inputs])
    samples = samples.take(np.arange(len(samples)) % 2 == 0)
    time, true = samples.time, samples.deviations[:, 0]
    names, running = [i.name for i in fitted.inputs], Compensator.of([fitted])
    every = Probings(7200.0).find_rows(time, np.isfinite(true))

    def replay(wrong: dict[int, Probing]) -> np.ndarray:
        state, left = running.start(), np.zeros(len(time))
        for k, values in enumerate(samples.values.tolist()):
            reading = Reading(float(time[k]), dict(zip(names, values, strict=True)))
            made = Probing(float(true[k]), keys=(f"time {time[k]}",)) if sound and k in every else None
            one = wrong.get(k, made)
            state, said = running.step(state, reading, reading.time, {} if one is None else {"z_um": one})
            left[k] = true[k] + said.corrections["z_um"].offset
        return left

    without = replay({})
    for row in (every[2] + 30, every[6] + 50):
        sent, after = (
            Probing(float(true[row]) + error),
            slice(row + 1, int(np.searchsorted(time, time[row] + 4 * 3600))),
        )
        once, often = replay({row: sent}), replay({row + k: sent for k in range(10)})
        assert (once == often).all()
        rms = [float(np.sqrt(np.mean(left[after] ** 2))) for left in (once, without)]
        assert rms[0] <= 1.5 * rms[1]
