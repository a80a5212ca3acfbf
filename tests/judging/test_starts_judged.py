"""How a test begins decides what is judged: a continuation is the whole test, to rounding."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smallmachine import small_machine

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.zero import FIRST_READING, Zeroing, mean_over_time
from thermocomp.iso230 import part3
from thermocomp.judging import assessing
from thermocomp.judging.judge import judge
from thermocomp.judging.replay import replay, replay_compensated
from thermocomp.judging.robustness import stress
from thermocomp.judging.splits import Split, by_rows, by_time, leave_one_cycle_out
from thermocomp.models.training import train
from thermocomp.recordings.cycles import Cycle, find_cycles
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start

TARGET = "z_um"
FAMILIES = ("ols", "mra", "dynamic", "arx", "arx-net", "ace-monotone", "mlp", "gp")


@cache
def resting() -> Recording:
    """The small machine with twelve rows at rest before its spindle starts, one every 30 s: a zero of eleven rows."""
    test = small_machine((1000.0, 2600.0, 1800.0), seed=4)
    rng = np.random.default_rng(1)
    head = test.table.iloc[[0] * 11].reset_index(drop=True)
    head[["t1_C", "t2_C", "t3_C"]] += 0.1 * rng.normal(size=(11, 3))
    head[["z_um", "x_um"]] += 0.1 * rng.normal(size=(11, 2))
    table = type(head)(np.vstack([head.to_numpy(), test.table.to_numpy()]), columns=test.table.columns)
    time = np.r_[30.0 * np.arange(11), 330.0 + test.time]
    return replace(
        test, name="whole", time=time, table=table, cycles=find_cycles(time, table["spindle_rpm"].to_numpy())
    )


def cut(test: Recording, row: int) -> tuple[Recording, Recording, float]:
    """Return the two parts of a test, each with times of its own, and the time between them."""

    def part(name: str, rows: slice) -> Recording:
        table = test.table.iloc[rows].reset_index(drop=True)
        time = test.time[rows] - test.time[rows][0]
        return replace(test, name=name, time=time, table=table, cycles=(Cycle(name, 0, len(time)),))

    return part("a", slice(0, row)), part("b", slice(row, None)), float(test.time[row] - test.time[row - 1])


@cache
def fitted(method: str) -> ErrorModel:
    samples = stack([small_machine((1500.0, 2900.0), seed=8)], [TARGET])
    return replace(train(method, samples, 0, np.ones(len(samples), np.bool_)).model, zeroing=zeroing())


def zeroing() -> Zeroing:
    return stack([resting()], [TARGET]).zeroing


@pytest.mark.parametrize("method", FAMILIES)
@settings(max_examples=8, deadline=None)
@given(row=st.integers(2, 600), limits=st.sampled_from([Limits(), Limits(magnitude=6.0, rate=0.003, dead_band=0.2)]))
def test_a_continuation_is_the_whole(method: str, row: int, limits: Limits) -> None:
    model, whole = fitted(method), stack([resting()], [TARGET])
    first, second, gap = cut(resting(), row)
    late = stack([second], [TARGET], starts=Start("continued", "stated", (first,), gap))
    own = late.cycle >= 0
    everything = np.ones(len(whole), np.bool_)
    assert own.sum() == len(second)
    assert late.row[own].tolist() == list(range(len(second)))
    full, ran = replay(model, whole, everything)[0], replay_compensated(model, whole, everything, limits)
    part, part_ran = replay(model, late, own)[0], replay_compensated(model, late, own, limits)
    assert np.abs(part - full[row:]).max() <= 1e-9
    assert np.abs(part_ran.deviation - ran.deviation[row:]).max() <= 1e-9
    assert np.abs(part_ran.compensated - ran.compensated[row:]).max() <= 1e-9


@pytest.mark.parametrize("method", ["ols", "dynamic", "arx"])
def test_begun_anew_it_would_be_wrong(method: str) -> None:
    """What made it worth building: the same rows, taken for a cold start, are wrong by what went before."""
    model, (first, second, gap) = fitted(method), cut(resting(), 300)
    measured = second.table[TARGET].to_numpy()
    rms = {}
    for name, start in {
        "continued": Start("continued", "stated", (first,), gap),
        "rezeroed": Start("rezeroed", "stated", (first,), gap),
        "cold": Start(),
    }.items():
        samples = stack([second], [TARGET], starts=start)
        own = samples.cycle >= 0
        ran = replay_compensated(model, samples, own)
        rms[name] = float(np.sqrt(np.mean((samples.deviations[own, 0] - ran.deviation) ** 2)))
    assert abs(measured[0]) > 10.0
    assert rms["cold"] > 3 * rms["continued"]
    assert rms["rezeroed"] < 2.5 * rms["continued"]


@pytest.mark.parametrize("method", ["ols", "dynamic", "gp"])
@pytest.mark.parametrize("known", [True, False])
def test_rezeroed_is_counted_from_there(method: str, known: bool) -> None:
    """The model minus what it says over the rows that the displacement is counted from; live and disturbed alike."""
    model, (first, second, gap) = fitted(method), cut(resting(), 150)
    start = Start("rezeroed", "stated", (first,), gap) if known else Start("rezeroed")
    samples = stack([second], [TARGET], starts=start)
    own = samples.cycle >= 0
    window = [0]  # a row every minute: the zero is one row, the spindle is stopped or not
    if samples.resting is not None and samples.resting[own][0]:
        window = list(range(6))
    raw, time = second.table[TARGET].to_numpy(), second.time[window]
    assert samples.deviations[own, 0] == pytest.approx(raw - mean_over_time(time, raw[window]), abs=1e-9)
    ran = replay_compensated(model, samples, own)
    assert mean_over_time(time, ran.deviation[window]) == pytest.approx(0.0, abs=1e-9)
    assert replay(model, samples, own)[0] == pytest.approx(ran.deviation, abs=1e-9)
    assert (ran.compensated[: len(window) - 1] == 0.0).all()
    if known:
        going_on = stack([second], [TARGET], starts=Start("continued", "stated", (first,), gap))
        full = replay(model, going_on, own)[0]
        assert ran.deviation == pytest.approx(full - mean_over_time(time, full[window]), abs=1e-9)
    stressed = stress(model, samples, samples.deviations[own, 0], own, draws=3)
    assert stressed.predicted == pytest.approx(ran.deviation, abs=1e-9)


def test_a_known_zero_is_counted_from() -> None:
    model, (_, second, _) = fitted("ols"), cut(resting(), 200)
    whole = stack([resting()], [TARGET])
    zero = {c.name: float(v) for c, v in zip(whole.inputs, whole.reference()[0], strict=True)}
    samples = stack([second], [TARGET], starts=Start("known", zero=zero))
    everything = np.ones(len(samples), np.bool_)
    full, _ = replay(model, whole, np.ones(len(whole), np.bool_))  # without memory: nothing but the zero is needed
    assert replay(model, samples, everything)[0] == pytest.approx(full[200:], abs=1e-9)
    assert replay_compensated(model, samples, everything).deviation == pytest.approx(full[200:], abs=1e-9)
    assert samples.reference()[0].tolist() == whole.reference()[0].tolist()
    del zero["t2_C"]
    with pytest.raises(InputError, match="the known zero has no value for t2_C"):
        stack([second], [TARGET], starts=Start("known", zero=zero))


def test_assess_of_the_second_half_is_the_replay_of_the_whole() -> None:
    models = [fitted("dynamic")]
    first, second, gap = cut(resting(), 310)
    judged = assessing.assess(models, [second], starts=Start("continued", "stated", (first,), gap))
    ((name, start),) = judged.starts
    assert name == "b"
    assert "b begins 60 s after the end of a (stated)" in start.why
    (found,) = judged.overall()
    whole = stack([resting()], [TARGET])
    assert found.predicted == pytest.approx(
        replay_compensated(models[0], whole, np.ones(len(whole), np.bool_)).compensated[310:], abs=1e-9
    )
    assert found.measured.tolist() == second.table[TARGET].tolist()
    with pytest.raises(InputError, match=r"b: z_um begins at \d+\.\d um, so it was not zeroed"):
        assessing.assess(models, [second])
    assert not assessing.assess(models, [second], starts=Start()).overall()[0].accepted


def test_a_thermal_test_that_goes_on() -> None:
    first, second, gap = cut(resting(), 260)
    models = [fitted("dynamic")]
    with pytest.raises(InputError, match="so it was not zeroed"):
        part3.assess(second, models=models)
    assert part3.assess(second)  # without a model its figures count from its start
    (test,) = part3.assess(second, "etve", models=models, start=Start("continued", "stated", (first,), gap))
    (z,) = (c for c in test.curves if c.name == TARGET)
    assert z.after is not None
    whole = stack([resting()], [TARGET])
    left = (
        resting().table[TARGET].to_numpy()
        - replay_compensated(models[0], whole, np.ones(len(whole), np.bool_)).compensated
    )
    assert z.after - z.after[0] == pytest.approx(left[260:] - left[260], abs=1e-9)
    assert any(n.startswith("b: continued from a (") and "at most 500 um" in n for n in test.notes)


def test_a_rezeroed_test_of_known_past_teaches_nothing() -> None:
    first, second, gap = cut(resting(), 150)
    samples = stack([second], [TARGET], starts=Start("rezeroed", "stated", (first,), gap))
    with pytest.raises(FitError, match="b was re-zeroed on a machine that continued from a"):
        train("ols", samples, 0, np.ones(len(samples), np.bool_))


def test_what_went_before_is_neither_learned_from_nor_judged() -> None:
    first, second, gap = cut(resting(), 211)
    second = second.with_cycles(find_cycles(second.time, second.table["spindle_rpm"].to_numpy()))
    samples = stack([second], [TARGET], starts=Start("continued", "stated", (first,), gap))
    own = samples.cycle >= 0
    for judging in (
        by_rows(samples, 0.5, 0.5),
        by_time(samples, 3 * 3600.0, 3 * 3600.0),
        leave_one_cycle_out(samples),
    ):
        for split in judging.splits:
            assert not (split.judge & ~own).any()
    half = by_rows(samples, 0.5, 0.5).splits[0]
    assert (half.judge & own).sum() == len(second) // 2
    hours = by_time(samples, 3 * 3600.0, 3 * 3600.0).splits[0]
    assert (hours.learn & own).sum() == 180
    spoiled = replace(first, table=first.table.assign(z_um=1e6))
    again = stack([second], [TARGET], starts=Start("continued", "stated", (spoiled,), gap))
    one, other = (train("dynamic", s, 0, half.learn).model for s in (samples, again))
    assert one == other
    a = judge("dynamic", one, samples, Split("all", ~own, np.ones(len(samples), np.bool_)))
    assert len(a.measured) == len(second)


def test_the_model_says_what_it_was_trained_with() -> None:
    samples = stack([resting()], [TARGET])
    model = train("ols", samples, 0, np.ones(len(samples), np.bool_)).model
    assert model.zeroing == samples.zeroing
    assert model.zeroing.speed == "spindle_rpm"
    assert model.provenance is not None
    assert model.provenance.starts == ("cold",)


def test_noise_at_the_start_costs_little(shared_data: Path) -> None:
    """fl_thermal, 0.4 degC on the rows at rest before the spindle starts: 3.6 um instead of 10.8 by the first row."""
    test = recordings.read(shared_data / "fl_thermal" / "recording.csv")
    names = [c.name for c in test.temperatures]
    mean = {}
    for zeroing in (FIRST_READING, None):
        clean = stack([test], ["ch3_um"], zeroing=zeroing)
        (split,) = by_rows(clean, 0.75, 0.25).splits
        model = train("dynamic", clean, 0, split.learn).model
        rows = split.judge & (np.arange(len(clean)) % 10 == 0)
        measured, rng, rms = clean.deviations[rows, 0], np.random.default_rng(0), []
        assert np.sqrt(np.mean((measured - replay(model, clean, rows)[0]) ** 2)) < 2.5
        for _ in range(4):
            table = test.table.copy()
            table.loc[:30, names] += 0.4 * rng.normal(size=(31, len(names)))
            noisy = stack([replace(test, table=table)], ["ch3_um"], zeroing=zeroing)
            rms.append(np.sqrt(np.mean((measured - replay(model, noisy, rows)[0]) ** 2)))
        mean[zeroing] = np.mean(rms)
    assert mean[None] < 4.5
    assert mean[None] < 0.5 * mean[FIRST_READING]


def test_the_last_learned_value_of_a_continuation_is_that_of_the_file_before() -> None:
    a, b, gap = cut(resting(), 300)
    samples = stack([a, b], [TARGET], starts=[Start(), Start("continued", "stated", (a,), gap)])
    learn, judged = samples.test == 0, (samples.test == 1) & (samples.cycle >= 0)
    learned = samples.learned(0, learn, before=int(np.argmax(judged)))
    assert learned.last == a.table[TARGET].iloc[-1]


def test_predict_counts_from_the_zero_that_was_learned() -> None:
    test = resting()
    model, table = fitted("ols"), test.to_frame()
    assert model.zeroing.at_rest > 0
    samples = stack([test], [TARGET], [i.name for i in model.inputs], zeroing=model.zeroing, starts=Start())
    wanted = replay(model, samples, np.ones(len(samples), np.bool_))[0]
    assert np.allclose(model.predict(table), wanted, atol=1e-9)
    twice = np.r_[model.predict(table), model.predict(table)]
    assert np.array_equal(model.predict(type(table)(np.vstack([table, table]), columns=table.columns)), twice)
