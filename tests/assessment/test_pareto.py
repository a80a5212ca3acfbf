"""The sensor budget: nothing of an unseen block in the choice, and figures that add up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import crowded_machine, small_machine

from thermocomp.assessment import pareto
from thermocomp.assessment.choice import Settings
from thermocomp.assessment.compare import compare
from thermocomp.assessment.metrics import rms
from thermocomp.core import lagbank
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.machine import Channel
from thermocomp.files.recordings import read
from thermocomp.recording import splits
from thermocomp.recording.cycles import find_cycles
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples
from thermocomp.recording.stacking import stack
from thermocomp.recording.starts import COLD


@pytest.fixture(scope="module")
def crowd() -> Samples:
    return stack([crowded_machine()], ["x_um", "z_um"])


@pytest.fixture(scope="module")
def found(crowd: Samples) -> pareto.Budget:
    return pareto.budget(crowd, 0, splits.leave_one_cycle_out(crowd), ["ols", "dynamic"], max_sensors=4)


def test_shapes_and_sizes(found: pareto.Budget) -> None:
    assert found.models == ("ols", "dynamic")
    assert found.sizes == (1, 2, 3, 4, 6)  # the last is all there are
    assert found.rms.shape == (2, 5, 4)
    assert found.frequency.sum(axis=1) == pytest.approx([1, 2, 3, 4, 6])
    assert found.condition[0] == 1
    assert np.isfinite(found.rms).all()


def test_errors_are_those_of_training_on_the_chosen_sensors(found: pareto.Budget, crowd: Samples) -> None:
    """With all temperatures there is nothing to choose, so the error is that of `compare`."""
    judging = splits.leave_one_cycle_out(crowd)
    every = pareto.budget(crowd, 0, judging, ["ols"], max_sensors=6)
    whole = next(a for a in compare(crowd, ["ols"], judging, robustness=False).overall() if a.target == "x_um")
    assert every.pooled()[0, -1] == pytest.approx(whole.metric("rms"))
    assert every.none_pooled() == pytest.approx(whole.none_metric("rms"))
    assert found.none == pytest.approx(every.none)


def test_the_unseen_block_has_no_part_in_the_choice(crowd: Samples, found: pareto.Budget) -> None:
    """A cycle spoiled beyond recognition changes no error but its own and none of the choices made without it."""
    judging = splits.leave_one_cycle_out(crowd)
    spoiled = crowd.deviations.copy()
    spoiled[judging.splits[2].judge] = 1e5 * np.sin(np.arange(judging.splits[2].judge.sum()))[:, None]
    only = splits.Judging("one", (judging.splits[2],))
    before = pareto.budget(crowd, 0, only, ["ols"], max_sensors=3)
    after = pareto.budget(replace(crowd, deviations=spoiled), 0, only, ["ols"], max_sensors=3)
    assert np.array_equal(before.frequency, after.frequency)
    assert (after.rms > 1e4).all()
    assert before.rms[0, :3, 0] == pytest.approx(found.rms[0, :3, 2])


def test_enough_is_the_smallest_within_one_standard_error() -> None:
    errors = np.array([[[9.0, 11.0], [4.0, 6.0], [3.5, 5.5], [4.2, 5.4]]])
    budget = pareto.Budget(
        target="x_um",
        candidates=("a", "b", "c", "d"),
        sensors=(("a",), ("a", "b"), ("a", "b", "c"), ("a", "b", "c", "d")),
        models=("ols",),
        blocks=("1", "2"),
        rms=errors,
        rows=np.array([10, 30]),
        none=np.array([20.0, 30.0]),
        frequency=np.ones((4, 4)),
        condition=np.ones(4),
    )
    assert budget.enough("ols") == 2  # best is 3 with mean 4.5 and standard error 1
    assert budget.pooled()[0, 0] == pytest.approx(np.sqrt((10 * 81 + 30 * 121) / 40))
    assert budget.recommended() == ("ols", 1)
    assert replace(budget, rms=np.full((1, 4, 2), np.nan)).enough("ols") is None
    two = replace(budget, models=("ols", "dynamic"), rms=np.concatenate([errors, errors - 5]))
    assert two.recommended() == ("dynamic", 1)
    one = np.concatenate([errors, errors])
    one[1, 0] = errors[0, 2]  # dynamic is as good with one sensor
    assert replace(two, rms=one).recommended() == ("dynamic", 0)


def test_one_block_alone_does_not_mean_all_sensors() -> None:
    """No standard error: then what a sensor has to gain is 0.5 um, or 5 % of a small drift."""
    errors = np.array([[[2.3], [1.95], [1.8], [1.5]]])
    budget = pareto.Budget(
        target="x_um",
        candidates=("a", "b", "c", "d"),
        sensors=(("a",), ("a", "b"), ("a", "b", "c"), ("a", "b", "c", "d")),
        models=("ols",),
        blocks=("1",),
        rms=errors,
        rows=np.array([10]),
        none=np.array([20.0]),
        frequency=np.ones((4, 4)),
        condition=np.ones(4),
    )
    assert budget.margin() == (0.5, 0.0, 0.5)
    assert budget.enough("ols") == 2
    small = replace(budget, none=np.array([4.0]))
    assert small.margin() == (0.2, 0.0, 0.2)
    assert small.enough("ols") == 4  # nothing less is near: then it is all of them, and said so
    assert pareto._trade_off(small, "ols", 3) == "fewer cost more than the rule allows"
    assert pareto._trade_off(budget, "ols", 1) == "2 sensors cost 0.45 um more than 4, the best of the table"
    assert pareto._trade_off(budget, "ols", 0) == "1 sensor costs 0.8 um more than 4, the best of the table"
    other = replace(budget, rms=np.array([[[2.3], [1.95], [1.4], [1.5]]]))
    assert pareto._trade_off(other, "ols", 1) == (
        "2 sensors cost 0.55 um more than 3, the best of the table and 0.45 um more than 4"
    )


@pytest.mark.parametrize("seed", range(4))
def test_where_two_matter_two_are_recommended(seed: int) -> None:
    samples = stack([two_that_matter(seed)], ["x_um"], starts=COLD)
    for judging in (splits.leave_one_cycle_out(samples), splits.by_rows(samples, 0.75, 0.25)):
        settings = Settings(models=["ols"], max_sensors=4)
        choice = pareto.choose(samples, 0, judging, settings, jobs=1, progress=lambda _, steps=1: None)  # noqa: ARG005
        assert set(choice.sensors) == {"t1_C", "t2_C"}
        assert "2 sensors cost " in choice.reason
        assert choice.notes[0].startswith("Rule: the fewest sensors whose mean RMS over the unseen blocks is within 0.")


def test_fl_thermal_does_not_need_sixteen_sensors(shared_data: Path) -> None:
    """Of its 16 sensors the rule takes a few, also where one block is judged; the sentence tells what they cost."""
    recording = read(shared_data / "fl_thermal" / "recording.csv")
    samples = stack([recording], ["ch1_um"]).take(np.arange(0, len(recording), 24))
    for judging in (splits.leave_one_cycle_out(samples), splits.by_rows(samples, 0.75, 0.25)):
        settings = Settings(models=["dynamic"], max_sensors=3)
        choice = pareto.choose(samples, 0, judging, settings, jobs=1, progress=lambda _, steps=1: None)  # noqa: ARG005
        assert len(choice.sensors) < 4, choice.reason
        assert " than 16" in choice.reason


def test_a_block_without_the_target_is_left_out(crowd: Samples) -> None:
    judging = splits.leave_one_cycle_out(crowd)
    gone = crowd.deviations.copy()
    gone[judging.splits[1].judge, 0] = np.nan
    found = pareto.budget(replace(crowd, deviations=gone), 0, judging, ["ols"], max_sensors=2)
    assert len(found.blocks) == len(judging.splits) - 1
    assert np.isfinite(found.rms).all()
    gone[:, 0] = np.nan
    with pytest.raises(FitError, match="x_um has no number in any of the blocks"):
        pareto.budget(replace(crowd, deviations=gone), 0, judging, ["ols"], max_sensors=2)


def test_sensors_that_repeat_are_told_by_the_condition(found: pareto.Budget) -> None:
    both = [k for k, s in enumerate(found.sensors) if {"t1_C", "t4_C"} <= set(s)]
    assert all(found.condition[k] > 100 for k in both)


def test_bad_budgets_are_refused(crowd: Samples) -> None:
    judging = splits.leave_one_cycle_out(crowd)
    with pytest.raises(InputError, match="budget of 0 among 6 temperatures"):
        pareto.budget(crowd, 0, judging, ["ols"], max_sensors=0)
    with pytest.raises(InputError, match="unknown model 'olss'"):
        pareto.budget(crowd, 0, judging, ["olss"])
    plain = small_machine()
    speed_only = stack([plain], ["x_um"], ["spindle_rpm"])
    with pytest.raises(InputError, match="among 0 temperatures"):
        pareto.budget(speed_only, 0, splits.leave_one_cycle_out(speed_only), ["dynamic"])


def test_rows_without_a_number_are_not_judged(crowd: Samples) -> None:
    gaps = crowd.deviations.copy()
    gaps[5:50, 0] = np.nan
    found = pareto.budget(replace(crowd, deviations=gaps), 0, splits.leave_one_cycle_out(crowd), ["ols"], max_sensors=2)
    assert np.isfinite(found.rms).all()
    assert found.rows.sum() == len(crowd) - 45
    assert found.none[0] == pytest.approx(rms(pd.Series(gaps[crowd.cycle == 0, 0]).dropna().to_numpy(), np.zeros(155)))
