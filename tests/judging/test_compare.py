"""Compare, fit, assess: trained on what may be seen, replayed through the compensator, judged on the rest."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from driftmodels import judged
from smallmachine import small_machine

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import FitError, InputError, ModelFileError, RecordingError
from thermocomp.core.inputs import Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.machine import Channel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.reading import Reading
from thermocomp.files import modelfile
from thermocomp.judging import assessing, splits, study
from thermocomp.judging.compare import ALL, compare, n_pieces
from thermocomp.judging.judge import judge
from thermocomp.judging.replay import replay, replay_compensated
from thermocomp.judging.robustness import Robustness, pool_robustness, stress
from thermocomp.models.methods import METHODS
from thermocomp.models.training import train
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.report.summary import cautions
from thermocomp.runtime.compensator import Compensator

METHOD_NAMES = sorted(METHODS)


@pytest.mark.parametrize("name", METHOD_NAMES)
def test_replay_of_the_frozen_model_equals_the_estimator(name: str, samples: Samples) -> None:
    everything = np.ones(len(samples), np.bool_)
    trained = train(name, samples, 0, everything)
    predicted, outside = replay(trained.model, samples, everything)
    names = list(trained.estimator.feature_names_in_)
    clock = {"dt": samples.dt()} if "dt" in METHODS[name].takes else {}
    expected = trained.estimator.predict(samples.frame()[names], **clock)
    assert np.abs(predicted - expected).max() <= 1e-10 * np.abs(expected).max()
    assert not outside.any()
    if not METHODS[name].kind.freezable:
        with pytest.raises(ModelFileError, match="cannot be stored as coefficients"):
            modelfile.dumps([trained.model])
        return
    (again,) = modelfile.loads(modelfile.dumps([trained.model]))
    assert np.array_equal(replay(again, samples, everything)[0], predicted)


@pytest.mark.parametrize("name", METHOD_NAMES)
def test_what_is_judged_is_never_learned_from(name: str, recording: Recording, samples: Samples) -> None:
    """Other displacements in the unseen block must not change the model: no leak, whatever the method."""
    split = splits.leave_one_cycle_out(samples).splits[1]
    spoiled = recording.table.copy()
    spoiled.loc[split.judge, ["z_um", "x_um"]] = 1e6
    other = stack([replace(recording, table=spoiled)], ["z_um", "x_um"])
    models = [replace(train(name, s, 0, split.learn).model, provenance=None) for s in (samples, other)]
    assert models[0] == models[1]


def test_comparison_covers_every_piece(samples: Samples) -> None:
    judging = splits.leave_one_cycle_out(samples)
    heard: list[str] = []
    result = compare(samples, ["ols", "dynamic", "ols"], judging, progress=heard.append)
    # each of four cycles, and to choose among the methods each pair of cycles
    assert len(heard) == n_pieces(samples, ["ols", "dynamic", "ols"], judging) == 2 * 2 * (4 + 6)
    overall = result.overall()
    assert [(a.target, a.model) for a in overall] == [(t, m) for t in ("z_um", "x_um") for m in ("ols", "dynamic")]
    for a in overall:
        assert a.block == ALL
        assert len(a.measured) == len(samples)
        assert len(a.verdict.units) == 4
        assert a.robustness is not None
        assert a.none_metric("rms") == pytest.approx(np.sqrt(np.mean(a.measured**2)))
    best = result.best("z_um")
    assert best is not None
    assert best.model == "dynamic"
    assert best.metric("rms") < 0.1 * best.none_metric("rms")


def test_two_processes_find_the_same(samples: Samples) -> None:
    judging = splits.parse("0.75/0.25", samples)
    one = compare(samples, ["ols", "partial-f"], judging, robustness=False)
    two = compare(samples, ["ols", "partial-f"], judging, robustness=False, jobs=2)
    for a, b in zip(one.assessments, two.assessments, strict=True):
        assert (a.model, a.target, a.block) == (b.model, b.target, b.block)
        assert np.array_equal(a.predicted, b.predicted)


def test_unknown_method_is_told_before_the_work(samples: Samples) -> None:
    with pytest.raises(InputError, match="unknown model 'dynamik'; did you mean dynamic"):
        compare(samples, ["dynamik"], splits.parse("0.75/0.25", samples))


def test_a_method_that_cannot_be_fitted_is_refused_not_hidden(recording: Recording) -> None:
    table = recording.table.copy()
    table.loc[2:, "z_um"] = np.nan
    table.loc[700:, "z_um"] = 1.0
    broken = stack([replace(recording, table=table)], ["z_um"])
    result = compare(broken, ["ols"], splits.parse("0.75/0.25", broken))
    (a,) = result.assessments
    assert not a.accepted
    assert "could not be judged: ols: only 2 complete training rows of z_um; at least 3" in a.reason
    assert np.isnan(a.metric("rms"))


def test_static_methods_need_a_temperature(recording: Recording) -> None:
    speed_only = stack([recording], ["z_um"], ["spindle_rpm"])
    with pytest.raises(FitError, match="no temperature"):
        train("ols", speed_only, 0, np.ones(len(speed_only), np.bool_))
    assert train("dynamic", speed_only, 0, np.ones(len(speed_only), np.bool_)).model.sensors == ("spindle_rpm",)


def test_missing_readings_hold_the_prediction(recording: Recording, samples: Samples) -> None:
    everything = np.ones(len(samples), np.bool_)
    model = train("dynamic", samples, 0, everything).model
    table = recording.table.copy()
    table.loc[300:309, "t1_C"] = np.nan
    gappy = stack([replace(recording, table=table)], ["z_um"])
    predicted, _ = replay(model, gappy, everything)
    assert np.isfinite(predicted).all()
    assert (predicted[300:310] == predicted[299]).all()
    full, _ = replay(model, samples, everything)
    assert np.abs(predicted[310:] - full[310:]).max() < 3.0


@pytest.mark.parametrize("policy", ["clip", "hold", "fade"])
def test_skipped_rows_make_no_difference(policy: str, recording: Recording, samples: Samples) -> None:
    """A model without memory is stepped through the block only, and says there what it says in a whole replay."""
    table = recording.table.copy()
    table.loc[[0, 399, 400, 401, 500], "t1_C"] = np.nan
    gappy = stack([replace(recording, table=table)], ["z_um"])
    learn = np.arange(len(samples)) < 200  # a slow cycle: later ones leave its range
    model = train("ols", gappy, 0, learn, support=Support(policy)).model  # type: ignore[arg-type]
    everything = np.ones(len(samples), np.bool_)
    block = (np.arange(len(samples)) >= 400) & (np.arange(len(samples)) < 600)
    whole, beyond = replay(model, gappy, everything)
    part, part_beyond = replay(model, gappy, block)
    assert np.array_equal(part, whole[block])
    assert np.array_equal(part_beyond, beyond[block])
    assert beyond[block].any()


def test_replay_is_what_the_compensator_commands(samples: Samples) -> None:
    model = train("dynamic", samples, 0, np.ones(len(samples), np.bool_)).model
    rows = np.arange(len(samples)) < 120
    predicted, _ = replay(model, samples, rows)
    limits = Limits(magnitude=1e9, rate=1e9, reading_age=1e9)
    compensator = Compensator.of([judged(model, 2.0)], limits)
    state = compensator.start()
    names = [c.name for c in samples.inputs]
    for k in range(120):
        reading = Reading(samples.time[k], dict(zip(names, samples.values[k], strict=True)))
        state, result = compensator.step(state, reading, reading.time)
        if k:
            assert result.corrections["z_um"].offset == pytest.approx(-predicted[k], rel=1e-12, abs=1e-12)


def test_judged_is_what_would_run(recording: Recording, samples: Samples) -> None:
    """Gate and limits are in the figures; the model alone is beside them."""
    everything = np.ones(len(samples), np.bool_)
    model = train("dynamic", samples, 0, everything).model
    limits = Limits(magnitude=8.0, rate=0.002, dead_band=0.5)
    compensator = Compensator.of([judged(model, 2.0)], limits)
    state, names, commanded = compensator.start(), [c.name for c in samples.inputs], []
    for k in range(len(samples)):
        reading = Reading(samples.time[k], dict(zip(names, samples.values[k].tolist(), strict=True)))
        state, result = compensator.step(state, reading, reading.time)
        commanded.append(-result.corrections["z_um"].offset)
    everywhere = splits.Split("all", ~everything, everything)
    a = judge("dynamic", model, samples, everywhere, robustness=False, limits=limits)
    assert a.predicted.tolist() == commanded
    assert a.limits == limits
    assert a.alone is not None
    assert np.array_equal(a.alone, replay(model, samples, everything)[0])
    assert a.metric("rms") > 3 * a.alone_metric("rms")
    alone = judge("dynamic", model, samples, everywhere, robustness=False, limits=None)
    assert np.array_equal(alone.predicted, a.alone)
    spiked = recording.table.copy()
    spiked.loc[500, "t1_C"] = 120.0
    other = stack([replace(recording, table=spiked)], ["z_um", "x_um"])
    b = judge("dynamic", model, other, everywhere, robustness=False)
    assert b.rejected == 1
    assert b.turned_away == "small: t1_C = 120.0 degC is not plausible"
    assert b.predicted[500] == b.predicted[499]
    assert b.alone is not None
    assert abs(b.alone[500] - b.alone[499]) > 3.0


def test_clipping_does_not_make_a_model_pass(samples: Samples) -> None:
    """A model that says the contrary, held to 0.01 um: what runs does nothing, and the model is not let pass."""
    everything = np.ones(len(samples), np.bool_)
    good = train("dynamic", samples, 0, everything).model
    assert isinstance(good, LinearDynamic)
    wild = replace(good, direct=tuple(5 * v for v in good.direct), lagged=tuple(5 * v for v in good.lagged))
    measured = samples.deviations[:, 0]
    four_times = splits.Split("all", ~everything, everything)
    a = judge("wild", wild, samples, four_times, robustness=False, limits=Limits(magnitude=3.0))
    assert a.metric("rms") < a.none_metric("rms") < a.alone_metric("rms")
    for cycle in range(len(samples.cycle_names)):  # clipped, it does good in every cycle
        mine = samples.cycle == cycle
        assert np.mean((measured - a.predicted)[mine] ** 2) < np.mean(measured[mine] ** 2)
    assert a.word == "refused"
    assert a.reason.startswith("does harm in")
    # and the other way round: the limits that keep a good one from working are in its verdict
    slow = judge("slow", good, samples, four_times, robustness=False, limits=Limits(magnitude=0.01))
    for cycle, verdict in enumerate(slow.verdict.units):
        mine = samples.cycle == cycle
        assert verdict.rms == pytest.approx(np.sqrt(np.mean((measured - slow.predicted)[mine] ** 2)))
        assert verdict.rms > 0.9 * verdict.none_rms


def test_a_slowly_recorded_test_does_not_hold_the_compensator_back(recording: Recording) -> None:
    """A row every 20 min: live, readings come in between, so the correction has all that time to move."""
    every = np.arange(0, len(recording), 20)
    sparse = replace(
        recording,
        time=recording.time[every],
        table=recording.table.iloc[every].reset_index(drop=True),
        cycles=(Cycle("1", 0, len(every)),),
    )
    samples = stack([sparse], ["z_um"])
    model = train("ols", samples, 0, np.ones(len(samples), np.bool_)).model
    everything = np.ones(len(samples), np.bool_)
    ran = replay_compensated(model, samples, everything, Limits(rate=0.1))
    assert np.abs(np.diff(ran.deviation)).max() > 0.1 * 60.0  # the travel of one reading that comes on time
    assert np.array_equal(ran.compensated[1:], ran.deviation[1:])


def test_an_angle_has_no_limits_of_micrometres(recording: Recording) -> None:
    tilt = replace(recording, channels=tuple(
        Channel("z_urad", "angle", "urad") if c.name == "z_um" else c for c in recording.channels
    ), table=recording.table.rename(columns={"z_um": "z_urad"}))  # fmt: skip
    samples = stack([tilt], ["z_urad"])
    everything = np.ones(len(samples), np.bool_)
    model = train("dynamic", samples, 0, everything).model
    ran = replay_compensated(model, samples, everything, Limits(magnitude=0.01))
    assert ran.limits is None
    assert np.array_equal(ran.compensated, ran.deviation)


def test_stress_finds_the_sensor_that_matters(samples: Samples) -> None:
    everything = np.ones(len(samples), np.bool_)
    model = train("ols", samples, 0, everything).model
    assert isinstance(model, Polynomial)
    found = stress(model, samples, samples.deviations[:, 0], everything, draws=20)
    clean, _ = replay(model, samples, everything)
    assert found.predicted == pytest.approx(clean, rel=1e-12)
    r = found.robustness
    assert set(r.lost_rms) == {"t1_C", "t2_C", "t3_C"}
    weights = dict(
        zip(r.lost_rms, np.abs(samples.change()[:, :3] * np.array(model.coefficients)).max(axis=0), strict=True)
    )
    assert r.worst_lost[0] == max(weights, key=lambda name: weights[name])
    clean_rms = np.sqrt(np.mean((samples.deviations[:, 0] - clean) ** 2))
    assert clean_rms < r.noise_rms["uniform"][0] < r.noise_rms["normal"][0] <= r.noise_rms["normal"][1]
    # white noise through a linear model: variance adds up, sigma of the uniform law is 0.4 / sqrt(3)
    gain = np.sqrt((np.array(model.coefficients) ** 2).sum())
    reference = 1 + 1  # the first reading is the zero, so its noise stays in every later change
    assert r.noise_rms["uniform"][0] ** 2 - clean_rms**2 == pytest.approx(reference * (0.4**2 / 3) * gain**2, rel=0.5)


def test_what_makes_a_model_worse_than_none_is_named() -> None:
    def found(noise: float, lost: float, none: float = 3.0) -> Robustness:
        return Robustness(
            0.4, {"uniform": (1.0, 9.0), "normal": (noise, 9.0)}, {"a": 1.0, "b": lost}, 0.0, np.nan, none
        )

    assert found(2.9, 2.9).worse_than_none == ()
    assert found(2.9, 2.9).harm == ""
    assert found(3.1, 2.9).worse_than_none == ("noise of 0.4 degC",)
    assert found(2.9, 3.1).worse_than_none == ("loss of b",)
    both = found(3.1, 4.5)
    assert both.worse_than_none == ("noise of 0.4 degC", "loss of b")
    assert both.harm == "worse than no compensation (3.00 um RMS) with noise of 0.4 degC (3.10 um), loss of b (4.50 um)"
    sensors = replace(both, lost_rms={"a": 3.5, "b": 4.5, "c": 9.0})
    assert sensors.harm.endswith("loss of c (9.00 um), loss of b (4.50 um), loss of a (3.50 um)")
    assert sensors.worse_than_none[1:] == ("loss of c", "loss of b", "loss of a")
    # several blocks: of all their rows together
    together = pool_robustness([(found(3.1, 2.0), 100), (found(1.0, 1.0, 9.0), 100)])
    assert together is not None
    assert together.none_rms == pytest.approx(np.sqrt((9 + 81) / 2))
    assert together.worse_than_none == ()


def test_a_model_of_large_opposed_gains_is_called_harmful(samples: Samples) -> None:
    """Two thermometers whose difference makes the drift: good when clean, worse than none with noise or without one."""
    everything = np.ones(len(samples), np.bool_)
    model = train("ols", samples, 0, everything).model
    assert isinstance(model, Polynomial)
    measured = samples.deviations[:, 0]
    calm = stress(model, samples, measured, everything, draws=10).robustness
    assert calm.none_rms == pytest.approx(np.sqrt(np.mean(measured**2)))
    wild = replace(model, coefficients=(300.0, -300.0, 0.0))
    found = stress(wild, samples, measured, everything, draws=10).robustness
    assert {"noise of 0.4 degC", "loss of t1_C", "loss of t2_C"} <= set(found.worse_than_none)
    assert "noise of 0.4 degC" not in calm.worse_than_none


def test_accepted_by_units_but_worse_over_all_rows_is_unproven_in_the_file(
    samples: Samples, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that calls it accepted, with an RMS above none, would be taken for an altered one."""
    judging = splits.leave_one_cycle_out(samples)
    (overall,) = (a for a in compare(samples, ["dynamic"], judging).overall() if a.target == "z_um")
    assert study.honest_error(overall, judging).verdict == "accepted"
    monkeypatch.setattr(type(overall), "none_metric", lambda self, name: 0.5 * self.metric(name))
    found = study.honest_error(overall, judging)
    assert found.verdict == "unproven"
    assert "; over all rows RMS " in found.reason


def test_fit_writes_its_honest_error_into_the_models(samples: Samples) -> None:
    judging = splits.leave_one_cycle_out(samples)
    fitted = study.fit(samples, "dynamic", judging, support=Support("fade"))
    assert [m.target for m in fitted.models] == ["z_um", "x_um"]
    for m, a, r2 in zip(fitted.models, fitted.comparison.overall(), fitted.r_squared, strict=True):
        assert m.honest_error is not None
        assert m.honest_error.rms == a.metric("rms")
        assert set(m.honest_error.cycles) == set(samples.cycle_names)
        assert m.accepted == a.accepted
        assert m.support.policy == "fade"
        assert m.provenance is not None
        assert m.provenance.data_sha256 == samples.hashes
        assert m.provenance.cycles == samples.cycle_names
        assert r2 > 0.98


def test_assess_says_when_the_test_is_not_honest(recording: Recording, samples: Samples) -> None:
    models = study.fit(samples, "dynamic", splits.leave_one_cycle_out(samples)).models
    again = assessing.assess(models, [recording])
    assert again.seen == ("small",)
    assert not any(a.accepted for a in again.assessments)
    fresh = assessing.assess(models, [small_machine((2200.0, 1200.0), seed=5)])
    assert fresh.seen == ()
    assert [a.block for a in fresh.assessments if a.target == "z_um"] == [
        "cycle 1 (2200 1/min)",
        "cycle 2 (1200 1/min)",
        "all cycles",
    ]
    assert {a.word for a in fresh.overall()} == {"unproven"}  # two cycles are too few
    more = assessing.assess(models, [small_machine((2200.0, 1200.0, 1700.0, 2500.0), seed=5)])
    assert {a.word for a in more.overall()} == {"accepted"}


def test_assess_names_the_missing_channel(recording: Recording, samples: Samples) -> None:
    models = study.fit(samples, "ols", splits.leave_one_cycle_out(samples)).models
    channels = tuple(c for c in recording.channels if c.name != "t2_C")
    poorer = replace(recording, table=pd.DataFrame(recording.table.drop(columns="t2_C")), channels=channels)
    with pytest.raises(InputError, match="no channel is named 't2_C'"):
        assessing.assess(models, [poorer])


def test_the_same_test_twice_is_refused(recording: Recording) -> None:
    """However its file was written: it would be learned from and judged on at once."""
    copy = replace(recording, name="copy", source="elsewhere.csv", table=recording.table.copy())
    with pytest.raises(InputError, match=r"elsewhere\.csv contains the same test as small"):
        stack([recording, copy], ["z_um"])


def test_tests_with_other_sensors_are_told_in_either_order(recording: Recording) -> None:
    other = small_machine((500.0, 1500.0), seed=9)
    channels = tuple(c for c in other.channels if c.name != "t2_C")
    poorer = replace(other, table=other.table.drop(columns="t2_C"), channels=channels)
    for pair in ([recording, poorer], [poorer, recording]):
        with pytest.raises(InputError, match="only one of them has t2_C"):
            stack(pair, ["z_um"])
    assert len(stack([recording, poorer], ["z_um"], ["t1_C", "t3_C"]).inputs) == 2


def test_a_watch_that_cannot_be_trained_is_a_caution(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise RecordingError("no row has a number")

    monkeypatch.setattr("thermocomp.judging.compare.find_guard", fails)
    samples = stack([small_machine(dt=300.0)], ["z_um"])
    found = compare(samples, ["ols"], splits.leave_one_cycle_out(samples), refit=False)
    assert set(found.unwatched.values()) == {"no row has a number"}
    assert len(found.unwatched) == len(found.judging.splits)
    (told,) = [text for text in cautions(found) if "no watch could be trained without" in text]
    assert all(block in told for block in found.unwatched)
    sound = compare(samples, ["ols"], splits.leave_one_cycle_out(samples), robustness=False)
    assert not sound.unwatched
