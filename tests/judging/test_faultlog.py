"""Which sensors fell out in a recording, when, what stood in and what it cost: as the compensator would have had it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from smallmachine import small_machine
from watchedmachine import LOST, failing, watched_model

from thermocomp.core.model import ErrorModel
from thermocomp.core.reading import Reading
from thermocomp.judging import assessing
from thermocomp.judging.faultlog import find_costs, find_faults
from thermocomp.judging.metrics import rms
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.report.bands import describe_bands
from thermocomp.report.faults import describe_faults, describe_held
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.watchstate import GOOD
from thermocomp.virtual import datasets as virtual


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return watched_model()


def live(model: ErrorModel, recording: Recording) -> tuple[list[dict[str, str]], np.ndarray, list[str]]:
    """Return what a compensator says failed, minus its correction, and why it held, row by row."""
    compensator = Compensator.of([model])
    state = compensator.start()
    failed, said, held = list[dict[str, str]](), list[float](), list[str]()
    for time, row in zip(recording.time.tolist(), recording.table.to_dict("records"), strict=True):
        state, told = compensator.step(state, Reading(time, {str(k): v for k, v in row.items()}), time)
        failed.append(told.failed)
        said.append(-told.corrections[model.target].offset)
        held.append(told.held.get(model.target, ""))
    return failed, np.array(said), held


@pytest.mark.parametrize("cuts", [{"t1_C": (4.0, 4.0)}, {"t2_C": (5.0, None), "t1_C": (8.0, 5.0)}, {}])
def test_it_is_what_the_compensator_says_live(model: ErrorModel, cuts: dict[str, tuple[float, float | None]]) -> None:
    recording = failing(**cuts)
    judged = assessing.assess([model], [recording], starts=Start())
    (log,) = find_faults(judged, [recording])
    failed, said, _ = live(model, recording)
    assert set(log.failed) == set(cuts)
    for row, told in enumerate(failed):
        assert {n for n, f in zip(log.watch.failing, log.fault[row], strict=True) if f != GOOD} == set(told)
    for f in log.faults:
        began = next(k for k, told in enumerate(failed) if told.get(f.sensor) == f.word)
        assert f.begin == recording.time[began]
        assert (f.end, f.returned) == (recording.time[-1], False)
        hour, step = cuts[f.sensor]
        assert hour * 3600 <= f.begin <= hour * 3600 + (420.0 if step else 0.0)
        assert f.beside == pytest.approx(step, abs=0.7) if step else math.isnan(f.beside)
    (whole,) = judged.overall()
    costs = find_costs(model, whole, [log])
    assert costs[0].failed == ()
    assert sum(c.hours for c in costs) == pytest.approx(recording.time[-1] / 3600)
    left = np.sqrt(sum(c.rms**2 * c.hours for c in costs) / sum(c.hours for c in costs))
    assert left == pytest.approx(rms(recording.table["z_um"].to_numpy(), said), rel=0.02)


def test_what_stands_in_is_given_where_the_sensor_is_not_believed(model: ErrorModel) -> None:
    recording = failing(t1_C=(4.0, 4.0))
    (log,) = find_faults(assessing.assess([model], [recording], starts=Start()), [recording])
    place = log.watch.failing.index("t1_C")
    bad = log.fault[:, place] != GOOD
    truth = failing().table["t1_C"].to_numpy()
    assert np.isfinite(log.stood_in[bad, place]).all()
    assert not np.isfinite(log.stood_in[~bad, place]).any()
    assert np.abs(log.stood_in[bad, place] - truth[bad]).max() < 1.5  # 4 degC off is what was recorded
    assert not np.isfinite(np.delete(log.stood_in, place, axis=1)).any()
    assert (log.read[:, place] == recording.table["t1_C"]).all()


def test_a_correction_that_does_harm_is_held_then_fades(model: ErrorModel) -> None:
    recording = failing(t3_C=(4.0, None))
    judged = assessing.assess([model], [recording], starts=Start())
    before, after = find_costs(model, judged.overall()[0], find_faults(judged, [recording]))
    _, said, held = live(model, recording)
    later = np.array([bool(why) for why in held])
    measured = recording.table["z_um"].to_numpy()
    assert (before.failed, before.runs_on, before.honest) == ((), True, 1.25)
    assert (after.failed, after.runs_on, after.honest) == (("t3_C",), False, 9.0)
    assert after.rms == pytest.approx(rms(measured[later], said[later]), rel=0.02)
    (whole,) = judged.overall()
    assert whole.predicted == pytest.approx(said, abs=0.1)
    assert whole.alone is not None
    assert after.rms > 2 * rms(measured[later], whole.alone[later])  # it would have gone on with what stands in
    assert after.none_rms == pytest.approx(rms(measured[later], np.zeros(later.sum())))


def test_several_lost_are_told_apart(model: ErrorModel) -> None:
    recording = failing(t2_C=(3.0, None), t1_C=(6.0, None))
    judged = assessing.assess([model], [recording], starts=Start())
    found = find_costs(model, judged.overall()[0], find_faults(judged, [recording]))
    assert [(c.failed, c.honest) for c in found] == [
        ((), 1.25), (("t2_C",), 2.5), (("t1_C", "t2_C"), LOST["t1_C, t2_C"])
    ]  # fmt: skip
    assert [c.hours for c in found] == pytest.approx([3 - 1 / 60, 3.0, 800 / 60 - 6], abs=0.02)


def test_one_that_comes_back_is_believed_again(model: ErrorModel) -> None:
    recording = failing()
    gone = (recording.time >= 4 * 3600) & (recording.time < 5 * 3600)
    table = recording.table.assign(t1_C=recording.table["t1_C"].where(~gone))
    recording = replace(recording, table=table)
    (log,) = find_faults(assessing.assess([model], [recording], starts=Start()), [recording])
    (fault,) = log.faults
    assert (fault.word, fault.begin, fault.returned) == ("missing", 4 * 3600, True)
    assert 5 * 3600 + 540 <= fault.end <= 5 * 3600 + 720


def test_a_sensor_that_the_recording_lacks_is_missing_from_the_start(model: ErrorModel) -> None:
    day = failing()
    lacking = replace(
        day, table=day.table.drop(columns="t2_C"), channels=tuple(c for c in day.channels if c.name != "t2_C")
    )
    other = replace(model, watch=None)  # judged as if t2_C were not one of its own: assess needs those
    judged = assessing.assess([other], [day], starts=Start())
    (log,) = find_faults(replace(judged, models=(model,)), [lacking])
    (fault,) = log.faults
    assert (fault.sensor, fault.word) == ("t2_C", "missing")
    assert fault.begin <= 600.0
    no_speed = replace(
        day,
        table=day.table.drop(columns="spindle_rpm"),
        channels=tuple(c for c in day.channels if c.name != "spindle_rpm"),
    )
    assert find_faults(replace(judged, models=(model,)), [no_speed]) == ()


def test_without_a_watch_there_is_no_log(model: ErrorModel) -> None:
    recording = failing(t1_C=(4.0, 4.0))
    bare = replace(model, watch=None)
    judged = assessing.assess([bare], [recording], starts=Start())
    assert find_faults(judged, [recording]) == ()
    assert find_costs(bare, judged.overall()[0], ()) == ()


def test_models_of_two_files_have_a_watch_each(model: ErrorModel) -> None:
    assert model.watch is not None
    deaf = replace(model.watch, sensors=tuple(replace(s, off=80.0, jump=80.0) for s in model.watch.sensors))
    other = replace(model, watch=deaf)
    recording = failing(t1_C=(4.0, 4.0))
    judged = assessing.assess([model, other], [recording], starts=Start())
    logs = find_faults(judged, [recording])
    assert [log.failed for log in logs] == [("t1_C",), ()]
    first, second = judged.overall()
    assert [c.failed for c in find_costs(model, first, logs)] == [(), ("t1_C",)]
    assert [c.failed for c in find_costs(other, second, logs)] == [()]


def test_rows_of_an_earlier_file_are_gone_through_and_not_counted(model: ErrorModel) -> None:
    whole = failing(t1_C=(6.0, 4.0), t2_C=(9.0, None))
    parts = []
    for rows in (slice(0, 420), slice(420, None)):
        time = whole.time[rows] - whole.time[rows][0]
        table = whole.table.iloc[rows].reset_index(drop=True)
        cycles = find_cycles(time, table["spindle_rpm"].to_numpy())
        parts.append(replace(whole, name=f"from {rows.start}", time=time, table=table, cycles=cycles))
    first, second = parts
    judged = assessing.assess([model], [second], starts=Start("continued", earlier=(first,)))
    (log,) = find_faults(judged, [second])
    assert [(f.sensor, f.word, f.begin) for f in log.faults] == [
        ("t1_C", "stepped", 0.0),  # found before, in the first file
        ("t2_C", "missing", 2 * 3600.0),
    ]
    assert len(log.time) == len(second)
    costs = find_costs(model, judged.overall()[0], [log])
    assert [c.failed for c in costs] == [("t1_C",), ("t1_C", "t2_C")]


def test_a_sensor_that_is_missing_from_the_first_row_on_is_stood_in_for(model: ErrorModel) -> None:
    recording = failing(t1_C=(0.0, None))
    judged = assessing.assess([model], [recording], starts=Start())
    (log,) = find_faults(judged, [recording])
    (whole,) = judged.overall()
    _, said, _ = live(model, recording)
    assert log.failed == ("t1_C",)
    assert log.faults[0].begin <= 360.0  # once its zero, the mean of five minutes, is known
    assert whole.predicted == pytest.approx(said, abs=0.1)
    assert rms(whole.measured, said) < 0.5 * rms(whole.measured, 0.0 * said)


def test_the_band_is_that_without_the_sensors_that_failed(model: ErrorModel) -> None:
    assert model.band is not None
    good, lost, harm = (
        assessing.assess([model], [failing(**cuts)], starts=Start()).overall()[0].half_widths
        for cuts in ({}, {"t2_C": (4.0, None)}, {"t3_C": (4.0, None)})
    )
    assert good is not None
    assert lost is not None
    assert harm is not None
    assert np.isfinite(good).all()
    ratio = lost / good
    assert ratio[0] == 1.0
    assert ratio[-1] == pytest.approx(2.5 / 1.25, rel=0.3)
    assert np.isfinite(harm[0])
    assert np.isnan(harm[-1])


def test_the_failures_are_told(model: ErrorModel) -> None:
    recording = failing(t1_C=(4.0, 4.0), t2_C=(6.0, None))
    logs = find_faults(assessing.assess([model], [recording], starts=Start()), [recording])
    first, second = describe_faults(logs, [recording])
    assert first.startswith("failing: t1_C stepped from 4.")
    assert " to the end; its reading minus its substitute value was +" in first
    assert second == "failing: t2_C missing from 6.00 h to the end"


def test_losses_are_tried_with_the_watch_there(model: ErrorModel) -> None:
    recording = failing()
    with_watch, without = (
        assessing.assess([m], [recording], starts=Start()).overall()[0].robustness
        for m in (model, replace(model, watch=None))
    )
    assert with_watch is not None
    assert without is not None
    assert with_watch.lost_rms["t1_C"] < 0.5 * without.lost_rms["t1_C"]
    assert with_watch.lost_rms.keys() == without.lost_rms.keys()


def test_what_is_held_is_told_and_has_no_band(model: ErrorModel) -> None:
    recording = failing(t3_C=(4.0, None))
    judged = assessing.assess([model], [recording], starts=Start())
    (line,) = describe_held(judged, find_faults(judged, [recording]))
    assert line.startswith("z_um: while t3_C had failed, the machine would hold the correction, then fade it: ")
    (told,) = describe_bands(judged.models, judged.overall())
    assert "of the judged rows with a band (" in told
    (whole,) = judged.overall()
    assert whole.undisturbed < whole.metric("rms")


def test_a_second_failure_does_not_let_run_what_the_first_one_stopped(model: ErrorModel) -> None:
    assert model.honest_error is not None
    odd = replace(model, honest_error=replace(model.honest_error, lost={"t1_C": 1.5, "t3_C": 9.0, "t1_C, t3_C": 2.0}))
    assert odd.may_lose(["t1_C"])
    assert not odd.may_lose(["t3_C"])
    assert not odd.may_lose(["t1_C", "t3_C"])


def test_trouble_of_a_temperature_caps_the_verdict_where_no_watch_could_look() -> None:
    samples = stack([small_machine()], ["z_um"])
    every = np.ones(len(samples), np.bool_)
    bare = train("ols", samples.only(["t1_C", "t2_C"]), 0, every).model
    model = replace(bare, watch=find_watch(samples, every), honest_error=watched_model().honest_error)
    recording = failing(t1_C=(4.0, None))
    blind = replace(
        recording,
        table=recording.table.drop(columns="spindle_rpm"),
        channels=tuple(c for c in recording.channels if c.quantity != "spindle_speed"),
    )
    (seen,), (unseen,) = (assessing.assess([model], [r], starts=Start()).overall() for r in (recording, blind))
    assert not any("t1_C" in cap for cap in seen.verdict.caps)
    assert any("data-quality problem in t1_C" in cap for cap in unseen.verdict.caps)


def test_a_wrong_speed_holds_the_correction_and_is_given_in_its_unit() -> None:
    (whole,) = virtual.record("demo", seed=31)
    table = whole.to_frame().iloc[:2400]
    table.loc[table.time_s > 6.0 * 3600.0, "spindle_rpm"] = 0.0
    recording = Recording.from_dataframe(table, time="time_s", name="wrong")
    samples = stack(virtual.record("demo"), ["z_um"])
    watch = find_watch(samples, samples.cycle >= 0)
    bare = train("averaged", samples, 0, samples.cycle >= 0).model
    assert bare is not None
    honest = replace(watched_model().honest_error, lost={"spindle_rpm": 1.0})  # type: ignore[type-var]
    own = replace(bare, watch=watch, honest_error=honest)
    judged = assessing.assess([own], [recording], starts=Start())
    (log,) = find_faults(judged, [recording])
    (line,) = describe_faults([log], [recording])
    assert line.startswith("wrong: spindle_rpm off from 6.")
    assert line.endswith("1/min on average")
    assert own.may_lose(["spindle_rpm"])
    wrong = find_costs(own, judged.overall()[0], [log])[-1]
    assert wrong.failed == ("spindle_rpm",)
    assert not wrong.runs_on
