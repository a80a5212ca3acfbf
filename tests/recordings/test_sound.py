"""What `check` finds reaches the verdict."""

from dataclasses import replace

import numpy as np
from smallmachine import small_machine

from thermocomp.judging import assessing, splits, study
from thermocomp.judging.compare import compare
from thermocomp.recordings.checks.sound import drop_unsound
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start


def spoiled(column: str, rows: slice, by: float, recording: Recording | None = None) -> Recording:
    recording = recording or small_machine()
    values = recording.table[column].to_numpy(dtype=np.float64).copy()
    values[rows] += by
    return replace(recording, table=recording.table.assign(**{column: values}))


def test_nothing_is_left_out_of_a_sound_recording() -> None:
    plain = stack([small_machine()], ["z_um"])
    found = drop_unsound(plain, [small_machine()])
    assert np.array_equal(found.values, plain.values)
    assert np.array_equal(found.deviations, plain.deviations)
    assert found.trouble == ()


def test_spikes_of_a_probe_do_not_reach_the_verdict() -> None:
    recording = spoiled("z_um", slice(40, 800, 190), 4300.0)
    samples = drop_unsound(stack([recording], ["z_um", "x_um"]), [recording])
    assert np.flatnonzero(np.isnan(samples.deviations[:, 0])).tolist() == [40, 230, 420, 610]
    assert np.isfinite(samples.deviations[:, 1]).all()
    assert np.isfinite(samples.values).all()
    result = compare(samples, ["dynamic"], splits.leave_one_cycle_out(samples), robustness=False)
    assert [a.word for a in result.overall()] == ["accepted", "accepted"]
    raw = stack([recording], ["z_um"])
    (a,) = compare(raw, ["dynamic"], splits.leave_one_cycle_out(raw), robustness=False).overall()
    assert a.word != "accepted"


def test_a_step_of_a_probe_caps_the_verdict_on_it_alone() -> None:
    recording = spoiled("z_um", slice(450, None), 30.0)
    samples = drop_unsound(stack([recording], ["z_um", "x_um"]), [recording])
    assert [channel for channel, _ in samples.trouble] == ["z_um"]
    result = compare(samples, ["dynamic"], splits.leave_one_cycle_out(samples), robustness=False)
    z, x = result.overall()
    assert z.word != "accepted"
    assert "small: data-quality problem in z_um (" in z.reason or z.word == "refused"
    assert x.word == "accepted"


def test_trouble_of_a_sensor_caps_the_verdict_on_all_that_use_it() -> None:
    recording = spoiled("t2_C", slice(None), 273.15)
    samples = drop_unsound(stack([recording], ["z_um", "x_um"]), [recording])
    assert {channel for channel, _ in samples.trouble} == {"t2_C"}
    result = compare(samples, ["dynamic"], splits.leave_one_cycle_out(samples), robustness=False)
    assert all(a.word != "accepted" for a in result.overall())


def test_a_temperature_is_left_out_from_its_step_on() -> None:
    recording = spoiled("t2_C", slice(430, None), 6.0)
    whole = stack([recording], ["z_um"])
    samples = drop_unsound(whole, [recording])
    assert not samples.trouble
    column = [c.name for c in samples.inputs].index("t2_C")
    assert np.flatnonzero(np.isnan(samples.values[:, column])).tolist() == list(range(430, len(samples)))
    left, right = np.delete(samples.values, column, axis=1), np.delete(whole.values, column, axis=1)
    np.testing.assert_array_equal(left, right)


def test_assess_leaves_trouble_out_too() -> None:
    models = study.fit(
        stack([small_machine()], ["z_um"]), "dynamic", splits.leave_one_cycle_out(stack([small_machine()], ["z_um"]))
    ).models
    day = small_machine((2200.0, 1200.0, 1700.0, 2600.0), seed=5)
    (a,) = assessing.assess(models, [spoiled("z_um", slice(50, 800, 150), 4300.0, day)]).overall()
    assert len(a.measured) == 800 - 5
    assert a.word == "accepted"


def test_trouble_of_a_file_that_a_test_goes_on_from_does_not_become_its_zero() -> None:
    whole = small_machine()
    rows = slice(0, 400), slice(400, 800)
    a, b = (
        replace(
            whole,
            name=name,
            time=whole.time[r] - whole.time[r][0],
            table=whole.table.iloc[r].reset_index(drop=True),
            cycles=(Cycle(name, 0, 400),),
        )
        for name, r in zip("ab", rows, strict=True)
    )
    values = a.table["t1_C"].to_numpy().copy()
    values[:12] = 85.0
    bad = replace(a, table=a.table.assign(t1_C=values))

    def zero(earlier: Recording) -> float:
        starts = Start("continued", "stated", (earlier,), 60.0)
        samples = drop_unsound(stack([b], ["z_um"], starts=starts), [b])
        return float(samples.reference()[0, 0])

    assert abs(zero(bad) - zero(a)) < 1.0
