"""The sensor budget: nothing of an unseen block in the choice, and figures that add up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import crowded_machine, small_machine, two_that_matter

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.machine import Channel
from thermocomp.judging import budget, pareto, sensorsets, splits
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.judging.metrics import rms
from thermocomp.models.selection.standins import StandInAnswer
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD


def silent(_: str, /, steps: int = 1) -> None:
    """Tell nothing of the progress."""


@pytest.fixture(scope="module")
def crowd() -> Samples:
    return stack([crowded_machine()], ["x_um", "z_um"])


@pytest.fixture(scope="module")
def found(crowd: Samples) -> budget.Budget:
    return budget.budget(crowd, splits.leave_one_cycle_out(crowd), ["ols", "dynamic"], max_sensors=4)


def test_shapes_and_sizes(found: budget.Budget) -> None:
    assert found.models == ("ols", "dynamic")
    assert found.sizes == (1, 2, 3, 4, 6)  # the last is all there are
    assert found.targets == ("x_um", "z_um")
    assert found.rms.shape == (2, 5, 2, 4)
    assert found.frequency.sum(axis=1) == pytest.approx([1, 2, 3, 4, 6])
    assert found.condition[0] == 1
    assert np.isfinite(found.rms).all()


def test_errors_are_those_of_training_on_the_chosen_sensors(found: budget.Budget, crowd: Samples) -> None:
    """With all temperatures there is nothing to choose, so the error is that of `compare`."""
    judging = splits.leave_one_cycle_out(crowd)
    every = budget.budget(crowd, judging, ["ols"], max_sensors=6)
    compared = compare(crowd, ["ols"], judging, robustness=False)
    whole, single = compared.overall(), [a for a in compared.assessments if not a.overall]
    assert every.of_targets()[0, -1] == pytest.approx([a.metric("rms") for a in whole])
    assert every.none_of_targets() == pytest.approx([a.none_metric("rms") for a in whole])
    assert every.stated("ols", -1) == pytest.approx((every.of_targets()[0, -1].mean(), every.none_of_targets().mean()))
    assert every.mean()[0, -1] == pytest.approx(np.mean([a.metric("rms") for a in single]))
    assert every.none_mean() == pytest.approx(np.mean([a.none_metric("rms") for a in single]))
    assert found.none == pytest.approx(every.none)


def test_the_unseen_block_has_no_part_in_the_choice(crowd: Samples, found: budget.Budget) -> None:
    """A cycle spoiled beyond recognition changes no error but its own and none of the choices made without it."""
    judging = splits.leave_one_cycle_out(crowd)
    spoiled = crowd.deviations.copy()
    spoiled[judging.splits[2].judge] = 1e5 * np.sin(np.arange(judging.splits[2].judge.sum()))[:, None]
    only = splits.Judging("one", (judging.splits[2],))
    before = budget.budget(crowd, only, ["ols"], max_sensors=3)
    after = budget.budget(replace(crowd, deviations=spoiled), only, ["ols"], max_sensors=3)
    assert np.array_equal(before.frequency, after.frequency)
    assert (after.rms > 1e4).all()
    assert before.rms[0, :3, :, 0] == pytest.approx(found.rms[0, :3, :, 2])


def by_hand(errors: list[list[float]], none: list[float]) -> budget.Budget:
    """Return a budget of one model and target, from the errors of 1 to 4 sensors on each block."""
    return budget.Budget(
        targets=("x_um",),
        unit="um",
        scales=np.ones(1),
        candidates=("a", "b", "c", "d"),
        sensors=(("a",), ("a", "b"), ("a", "b", "c"), ("a", "b", "c", "d")),
        models=("ols",),
        blocks=tuple("12"[: len(none)]),
        rms=np.array(errors)[None, :, None, :],
        none=np.array([none]),
        rows=np.full((1, len(none)), 100.0),
        frequency=np.ones((4, 4)),
        condition=np.ones(4),
        answer=StandInAnswer(np.zeros((1, 4, 1)), np.eye(4), 0.4),
    )


def test_enough_is_the_smallest_within_one_standard_error() -> None:
    one = by_hand([[9.0, 11.0], [4.0, 6.0], [3.5, 5.5], [4.2, 5.4]], [20.0, 30.0])
    errors = one.rms
    assert one.enough("ols") == 2  # best is 3 with mean 4.5 and standard error 1
    assert one.mean()[0].tolist() == pytest.approx([10, 5, 4.5, 4.8])
    assert one.recommended() == ("ols", 1)
    assert replace(one, rms=np.full((1, 4, 1, 2), np.nan)).enough("ols") is None
    two = replace(one, models=("ols", "dynamic"), rms=np.concatenate([errors, errors - 5]))
    assert two.recommended() == ("dynamic", 1)
    alike = np.concatenate([errors, errors])
    alike[1, 0] = errors[0, 2]  # dynamic is as good with one sensor
    assert replace(two, rms=alike).recommended() == ("dynamic", 0)


def test_one_block_alone_does_not_mean_all_sensors() -> None:
    """No standard error: then what a sensor has to gain is 0.5 um, or 5 % of a small drift."""
    one = by_hand([[2.3], [1.95], [1.8], [1.5]], [20.0])
    assert one.margin() == (0.5, 0.0, 0.5)
    assert one.enough("ols") == 2
    small = replace(one, none=np.array([[4.0]]))
    assert small.margin() == (0.2, 0.0, 0.2)
    assert small.enough("ols") == 4  # nothing less is near: then it is all of them, and said so
    assert pareto.trade_off(small, "ols", 3) == "with fewer sensors the error exceeds the margin of the rule"
    assert (
        pareto.trade_off(one, "ols", 1)
        == "2 sensors cost 0.45 um more than 4, the best of the table (means over the blocks)"
    )
    assert (
        pareto.trade_off(one, "ols", 0)
        == "1 sensor costs 0.8 um more than 4, the best of the table (means over the blocks)"
    )
    other = by_hand([[2.3], [1.95], [1.4], [1.5]], [20.0])
    assert pareto.trade_off(other, "ols", 1) == (
        "2 sensors cost 0.55 um more than 3, the best of the table and 0.45 um more than 4 (means over the blocks)"
    )


def test_targets_count_alike_in_their_mean() -> None:
    one = by_hand([[9.0, 11.0], [4.0, 6.0], [3.5, 5.5], [4.2, 5.4]], [20.0, 30.0])
    second = np.concatenate([one.rms, one.rms + 2], axis=2)
    both = replace(one, targets=("x_um", "z_um"), scales=np.array([1.0, 2.0]), rms=second)
    both = replace(both, none=np.concatenate([one.none, 2 * one.none]), rows=np.tile(one.rows, (2, 1)))
    assert both.of_blocks()[0] == pytest.approx((one.rms[0, :, 0] + (one.rms[0, :, 0] + 2) / 2) / 2)
    assert both.mean()[0] == pytest.approx((second[0].mean(axis=2) / [1, 2]).mean(axis=1))
    assert both.stated("ols", 1)[0] == pytest.approx((np.sqrt(26) + np.sqrt(50) / 2) / 2)
    assert both.none_mean() == pytest.approx(one.none_mean())


def test_what_the_next_sensor_gains_and_whether_it_is_worth_it() -> None:
    """A gain below 0.5 um is not worth it, one below the differences between the blocks is not sure."""
    one = by_hand([[9.0, 11.0], [4.0, 6.0], [3.3, 5.3], [4.2, 5.4]], [20.0, 30.0])
    gain, of_blocks = one.gains("ols")
    assert of_blocks == pytest.approx(np.array([[5.0, 5.0], [0.7, 0.7], [-0.9, -0.1]]))
    assert gain == pytest.approx(-np.diff(one.mean()[0]))
    assert (
        pareto.next_to_buy(one, "ols", 0) == "Next to buy: b would gain 5.00 um (5.00 to 5.00 um from block to block)."
    )
    assert pareto.next_to_buy(one, "ols", 1) == (
        "Next to buy: c would gain 0.70 um (0.70 to 0.70 um from block to block), less than the differences between "
        "the blocks: more thermal cycles would decide."
    )
    assert pareto.next_to_buy(one, "ols", 2) == (
        "Next to buy: none is worth it. d would gain -0.50 um (-0.90 to -0.10 um from block to block); a further "
        "sensor must gain at least 0.50 um."
    )
    assert pareto.next_to_buy(one, "ols", 3).startswith("Next to buy: all temperatures are in use")
    few = replace(one, sensors=(("a",), ("a", "b", "c", "d")), rms=one.rms[:, [0, 3]])
    assert "all 3 others would gain" in pareto.next_to_buy(few, "ols", 0)
    assert "from block to block" not in pareto.next_to_buy(by_hand([[2.0], [1.0], [1], [1]], [20.0]), "ols", 0)


def test_two_sensors_that_are_worth_it_together_are_named() -> None:
    """One alone brings nothing, so the look ahead continues; what they bring has to be worth both of them."""
    one = by_hand([[4.0, 9.0], [3.9, 8.9], [2.5, 7.5], [2.5, 7.4]], [20.0, 30.0])
    margins = one.margin()
    assert margins is not None
    assert margins[0] > 1.5 > 2 * margins[2]
    assert one.recommended() == ("ols", 0)
    assert pareto.next_to_buy(one, "ols", 0) == (
        "Next to buy: no single one is worth it. b would gain 0.10 um (0.10 to 0.10 um from block to block); a further "
        "sensor must gain at least 0.50 um. b and c together would gain 1.50 um, less than the differences between the "
        "blocks: more thermal cycles would decide."
    )
    little = replace(one, rms=one.rms + np.array([0.0, 0.0, 0.6, 0.6])[:, None, None])
    assert pareto.next_to_buy(little, "ols", 0).startswith("Next to buy: none is worth it. b would gain 0.10 um")
    three = by_hand([[4.0, 9.0], [3.9, 8.9], [3.8, 8.8], [2.0, 7.0]], [20.0, 30.0])
    assert "3 (b, c, d) together would gain 2.00 um" in pareto.next_to_buy(three, "ols", 0)


def test_a_reader_can_follow_the_rule_in_the_table(crowd: Samples) -> None:
    """Blocks of unlike length: the figures of the table, and the sentences about it, are those the rule chooses by."""
    few = crowd.take(
        ~((crowd.cycle == 3) & (np.arange(len(crowd)) % 4 > 0))
    )  # the last cycle has a quarter of the rows
    choice = pareto.choose(few, splits.leave_one_cycle_out(few), Settings(models=["ols"]), jobs=1, progress=silent)
    found = choice.details
    assert isinstance(found, budget.Budget)
    rows = choice.tables[0].rows
    errors = {int(str(row[0])): float(str(row[1])) for row in rows}
    margins = found.margin()
    assert margins is not None
    near = [size for size, error in errors.items() if error <= min(errors.values()) + margins[0]]
    assert len(choice.sensors) == min(near)
    assert f"within {margins[0]:.2f} um" in choice.notes[0]
    stated = np.mean([row[1:] for row in choice.tables[1].rows if row[0] == len(choice.sensors)])
    assert stated != pytest.approx(errors[len(choice.sensors)])  # RMS over all rows, not the mean of the cycles
    assert f"leaves {stated:.2f} um RMS" in choice.reason
    assert [row[2] for row in rows[:-1]] == pytest.approx(-np.diff(list(errors.values())))


def test_where_nothing_helps_no_sensor_is_recommended(crowd: Samples) -> None:
    noise = np.random.default_rng(3).normal(size=(len(crowd), 1))
    still = replace(crowd, targets=crowd.targets[:1], deviations=noise)
    settings = Settings(models=["ols", "averaged"], max_sensors=3)
    choice = pareto.choose(still, splits.leave_one_cycle_out(still), settings, jobs=1, progress=silent)
    assert choice.sensors == ()
    assert choice.failure == choice.reason
    assert choice.reason.startswith("no set of temperatures is clearly better than no compensation; the smallest error")
    assert choice.tables[0].marked is None
    assert "none for ols, none for averaged" in choice.tables[0].caption
    # beside a displacement that they help, it is said
    both = replace(crowd, deviations=np.column_stack([noise, crowd.deviations[:, 1]]))
    choice = pareto.choose(both, splits.leave_one_cycle_out(both), settings, jobs=1, progress=silent)
    assert choice.sensors
    assert "no better than no compensation for x_um" in " ".join(choice.notes)


def test_better_than_none_is_asked_block_by_block() -> None:
    """Blocks of unlike drift do not hide a gain in all of them; a gain in one that is lost in the other is none."""
    unlike = by_hand([[1.2, 12.0]] * 4, [2.0, 20.0])
    assert unlike.recommended() == ("ols", 0)
    mixed = by_hand([[8.0, 11.0]] * 4, [10.0, 10.0])
    assert mixed.recommended() is None
    assert by_hand([[9.6, 9.6]] * 4, [10.0, 10.0]).recommended() is None  # 0.4 um: less than a sensor is worth


def test_another_model_with_as_many_sensors_is_named() -> None:
    one = by_hand([[4.0], [2.0], [2.0], [2.0]], [20.0])
    two = replace(one, models=("ols", "averaged"), rms=np.concatenate([one.rms, one.rms + 0.13]))
    assert pareto.trade_off(two, "averaged", 1) == (
        "2 sensors cost 0.13 um more than as many by ols, the best of the table and 0 um more than 4 "
        "(means over the blocks)"
    )
    alone = replace(one, sensors=one.sensors[:1], rms=one.rms[:, :1])
    assert pareto.trade_off(alone, "ols", 0) == "there is no other set to choose from"


@pytest.mark.parametrize("seed", range(4))
def test_where_two_matter_two_are_recommended(seed: int) -> None:
    samples = stack([two_that_matter(seed)], ["x_um"], starts=COLD)
    for judging in (splits.leave_one_cycle_out(samples), splits.by_rows(samples, 0.75, 0.25)):
        settings = Settings(models=["ols"], max_sensors=4)
        choice = pareto.choose(samples, judging, settings, jobs=1, progress=silent)
        assert set(choice.sensors) == {"t1_C", "t2_C"}
        assert "2 sensors cost " in choice.reason
        assert choice.notes[0].startswith("Rule: the fewest sensors that are better than no compensation and whose")
        assert "(see the table) is within 0." in choice.notes[0]


def test_fl_thermal_does_not_need_sixteen_sensors(shared_data: Path) -> None:
    """Of its 16 sensors the rule takes a few, also where one block is judged; the sentence tells what they cost."""
    recording = read(shared_data / "fl_thermal" / "recording.csv")
    samples = stack([recording], ["ch1_um"]).take(np.arange(0, 6669, 24))  # the published block is not judged here
    for judging in (splits.leave_one_cycle_out(samples), splits.by_rows(samples, 0.75, 0.25)):
        settings = Settings(models=["averaged"], max_sensors=4)
        choice = pareto.choose(samples, judging, settings, jobs=1, progress=silent)
        assert len(choice.sensors) < 4, choice.reason
        assert " than 16" in choice.reason


def test_a_block_without_the_target_is_left_out(crowd: Samples) -> None:
    judging = splits.leave_one_cycle_out(crowd)
    gone = crowd.deviations.copy()
    gone[judging.splits[1].judge, 0] = np.nan
    found = budget.budget(replace(crowd, deviations=gone), judging, ["ols"], max_sensors=2)
    assert len(found.blocks) == len(judging.splits) - 1
    assert np.isfinite(found.rms).all()
    gone[:, 0] = np.nan
    with pytest.raises(FitError, match="x_um has no value in any validation block"):
        budget.budget(replace(crowd, deviations=gone), judging, ["ols"], max_sensors=2)


def test_sensors_that_repeat_are_told_by_the_condition(found: budget.Budget) -> None:
    both = [k for k, s in enumerate(found.sensors) if {"t1_C", "t4_C"} <= set(s)]
    assert all(found.condition[k] > 100 for k in both)


def test_bad_budgets_are_refused(crowd: Samples) -> None:
    judging = splits.leave_one_cycle_out(crowd)
    with pytest.raises(InputError, match="budget of 0 among 6 temperatures"):
        budget.budget(crowd, judging, ["ols"], max_sensors=0)
    with pytest.raises(InputError, match="unknown model 'olss'"):
        budget.budget(crowd, judging, ["olss"])
    plain = small_machine()
    speed_only = stack([plain], ["x_um"], ["spindle_rpm"])
    with pytest.raises(InputError, match="among 0 temperatures"):
        budget.budget(speed_only, splits.leave_one_cycle_out(speed_only), ["dynamic"])


def test_rows_without_a_number_are_not_judged(crowd: Samples) -> None:
    gaps = crowd.deviations.copy()
    gaps[5:50, 0] = np.nan
    found = budget.budget(replace(crowd, deviations=gaps), splits.leave_one_cycle_out(crowd), ["ols"], max_sensors=2)
    assert np.isfinite(found.rms).all()
    assert found.none[0, 0] == pytest.approx(
        rms(pd.Series(gaps[crowd.cycle == 0, 0]).dropna().to_numpy(), np.zeros(155))
    )


def test_targets_that_are_never_measured_together(crowd: Samples) -> None:
    """Numbers in turn: there is no row to choose by; in other blocks: there is none to judge by; each alone goes."""
    judging = splits.leave_one_cycle_out(crowd)
    turns = crowd.deviations.copy()
    turns[::2, 0] = turns[1::2, 1] = np.nan
    with pytest.raises(FitError, match=r"^0 rows have values of all of x_um, z_um and of all 7 inputs.*fewer targets"):
        budget.budget(replace(crowd, deviations=turns), judging, ["ols"])
    blocks = crowd.deviations.copy()
    blocks[crowd.cycle < 2, 0] = blocks[crowd.cycle >= 2, 1] = np.nan
    with pytest.raises(
        FitError, match=r"no validation block .left-out cycle, day or file. has values of all of x_um, z_um"
    ):
        budget.budget(replace(crowd, deviations=blocks), judging, ["ols"])
    alone = replace(crowd, targets=crowd.targets[:1], deviations=turns[:, :1])
    assert np.isfinite(budget.budget(alone, judging, ["ols"], max_sensors=1).rms).all()
    few = turns.copy()
    few[:30] = crowd.deviations[:30]  # 30 rows of the first cycle are complete
    with pytest.raises(FitError, match=r"^0 rows have values"):  # but none without that cycle
        budget.budget(replace(crowd, deviations=few), judging, ["ols"])


def test_um_and_urad_count_by_their_share(crowd: Samples) -> None:
    """A tilt of 10,000 urad is not a hundred times as important as a drift of 100 um."""
    judging = splits.leave_one_cycle_out(crowd)
    tilt = Channel("a_urad", "angle", "urad")
    found = []
    for factor in (1.0, 1000.0):
        mixed = replace(crowd, targets=(tilt, crowd.targets[1]), deviations=crowd.deviations * [factor, 1.0])
        found.append(budget.budget(mixed, judging, ["ols"], max_sensors=3))
    one, other = found
    assert one.unit == sensorsets.PERCENT
    assert one.sensors == other.sensors
    assert one.none_mean() == pytest.approx(100)
    assert one.mean() == pytest.approx(other.mean(), rel=1e-6)
    margins = one.margin()
    assert margins is not None
    assert margins[2] == pytest.approx(5, rel=0.2)  # per cent
    choice = pareto.choose(mixed, judging, Settings(models=["ols"], max_sensors=3), jobs=1, progress=silent)
    assert "% of the RMS without compensation on unseen cycles" in choice.reason
    assert " um" not in " ".join((choice.reason, *choice.notes))


def test_odd_recordings_are_chosen_from_all_the_same(crowd: Samples) -> None:
    """No speed, one temperature, dead ones beside it, one thermal cycle."""
    loco, halves = splits.leave_one_cycle_out(crowd), splits.by_rows(crowd, 0.5, 0.5)
    still = crowd.values.copy()
    still[:, 1:6] = 20.0
    one_cycle = crowd.take(crowd.cycle == 0)
    for samples, judging, allowed in (
        (crowd.only([f"t{k}_C" for k in range(1, 7)]), loco, {f"t{k}_C" for k in range(1, 7)}),
        (crowd.only(["t1_C"]), loco, {"t1_C"}),
        (crowd.only(["t1_C", "spindle_rpm"]), halves, {"t1_C"}),
        (replace(crowd, values=still), loco, {"t1_C"}),
        (one_cycle, splits.by_rows(one_cycle, 0.5, 0.5), {f"t{k}_C" for k in range(1, 7)}),
    ):
        settings = Settings(models=["ols", "averaged"])
        choice = pareto.choose(samples, judging, settings, jobs=1, progress=silent)
        assert choice.sensors
        assert set(choice.sensors) <= allowed
        assert all(t.rows for t in choice.tables)


def test_a_copy_is_never_recommended_beside_what_it_copies() -> None:
    plain = stack([two_that_matter(0)], ["x_um"], starts=COLD)
    values = plain.values.copy()
    values[:, 6:8] = values[:, :2]  # t7_C is t1_C, and t8_C is t2_C
    samples, settings = replace(plain, values=values), Settings()
    choice = pareto.choose(samples, splits.leave_one_cycle_out(samples), settings, jobs=1, progress=silent)
    assert len({"t1_C", "t7_C"} & set(choice.sensors)) < 2
    assert len({"t2_C", "t8_C"} & set(choice.sensors)) < 2
    stands = next(t for t in choice.tables if t.title == "Virtual sensors")
    nearest = {row[0]: row[1:3] for row in stands.rows}
    assert nearest["t7_C"][0] == "t1_C"
    assert nearest["t2_C"][0] == "t8_C"
    assert max(float(nearest[n][1] or 0) for n in ("t1_C", "t2_C", "t7_C", "t8_C")) < 0.2
