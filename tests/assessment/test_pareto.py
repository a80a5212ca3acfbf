"""The sensor budget: nothing of an unseen block in the choice, and figures that add up."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from smallmachine import crowded_machine, small_machine
from thermocomp.assessment import pareto, splits
from thermocomp.assessment.compare import compare
from thermocomp.assessment.metrics import rms
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.recording.samples import Samples, stack


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
