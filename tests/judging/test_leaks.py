"""Training rows in other files: left out of `assess` and counted; refused where they would be learned and judged."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.judging import assessing, splits, study
from thermocomp.judging.baselines import CURVE
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.judging.leaks import find_learned_rows
from thermocomp.judging.selecting import select
from thermocomp.recordings.cycles import Cycle, find_cycles, make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD, Start


@pytest.fixture(scope="module")
def models() -> tuple[ErrorModel, ...]:
    samples = stack([small_machine()], ["z_um"])
    return study.fit(samples, "dynamic", splits.leave_one_cycle_out(samples)).models


def of(table: pd.DataFrame, like: Recording, name: str = "copy") -> Recording:
    """Return another recording with a table, one row a minute."""
    time = 60.0 * np.arange(len(table), dtype=np.float64)
    channels = tuple(like.channel(str(name)) for name in table.columns)
    cycles = find_cycles(time, table["spindle_rpm"].to_numpy())
    return replace(like, name=name, time=time, table=table.reset_index(drop=True), channels=channels, cycles=cycles)


def after(*recordings: Recording) -> Recording:
    """Return recordings one after the other as one."""
    return of(pd.concat([r.table for r in recordings], ignore_index=True), recordings[0])


DAY = (2200.0, 1200.0, 1700.0, 2600.0)


def test_minus_a_row_minus_a_column_is_no_test(recording: Recording, models: tuple[ErrorModel, ...]) -> None:
    copies = [
        of(recording.table.drop(index=333), recording),
        of(recording.table.drop(columns="x_um"), recording),
        of(recording.table.iloc[:, ::-1].drop(columns="x_um").drop(index=[5, 400, 799]), recording),
        of(recording.table.iloc[250:700], recording),
    ]
    for copy in copies:
        judged = assessing.assess(models, [copy], starts=COLD)
        assert judged.seen == ()
        (overall,) = judged.overall()
        assert not overall.accepted
        assert overall.reason == (
            f"not a test on unseen data: {len(copy)} of {len(copy)} rows were used for training; judge the model on "
            "another recording"
        )
        assert overall.learned == len(overall.measured) == len(copy)
        assert np.isfinite(overall.metric("rms"))


def test_plus_a_day_only_the_day_is_judged(recording: Recording, models: tuple[ErrorModel, ...]) -> None:
    day = small_machine(DAY, seed=5)
    long = after(recording, day)
    # at the joint the machine is cold at once: to its watch, the speed of the second day is wrong
    models = tuple(replace(m, watch=m.watch and replace(m.watch, checks=(), speed_faults=())) for m in models)
    (overall,) = assessing.assess(models, [long]).overall()
    assert overall.learned == 800
    assert overall.row.tolist() == list(range(800, 1600))
    assert overall.word == "unproven"  # its level is that of the rows that were learned
    assert overall.reason.startswith("judged on one section that continues the training data")
    assert overall.reason.endswith("; 800 of 1,600 rows were used for training and are left out")
    # a piece of it in the middle of two days, in a file of its own beside a whole one
    both = [after(day, of(recording.table.iloc[100:500], recording)), small_machine(DAY, seed=6)]
    (overall,) = assessing.assess(models, [replace(r, name=f"{k}") for k, r in enumerate(both)]).overall()
    assert 400 <= overall.learned <= 500
    assert set(range(700)) <= set(overall.row[overall.test == 0]) <= set(range(800))
    assert (overall.test == 1).sum() == 800


def test_the_file_itself_is_left_out_beside_another(recording: Recording, models: tuple[ErrorModel, ...]) -> None:
    day = replace(small_machine(DAY, seed=5), name="day")
    judged = assessing.assess(models, [recording, day])
    assert judged.seen == ("small",)
    (overall,) = judged.overall()
    assert overall.learned == 800
    assert set(overall.test) == {1}
    assert overall.accepted
    alone = assessing.assess(models, [recording]).overall()[0]
    assert alone.reason == "not a test on unseen data: fitted to small; judge the model on another recording"
    # a model from before there were fingerprints knows the file, and no copy
    (model,) = models
    assert model.provenance is not None
    old = replace(model, provenance=replace(model.provenance, prints=None))
    assert assessing.assess([old], [recording]).overall()[0].caveat
    assert not assessing.assess([old], [of(recording.table.drop(index=333), recording)]).overall()[0].caveat


def test_a_column_that_has_another_name_in_the_file_is_known(
    recording: Recording, models: tuple[ErrorModel, ...]
) -> None:
    """A heading ``z_um [um]`` is a channel of another name that answers to the model's."""
    names = {"z_um": "z_um_um", "t1_C": "front_C"}
    other = replace(
        recording,
        table=recording.table.rename(columns=names).drop(columns="x_um"),
        channels=tuple(replace(c, name=names.get(c.name, c.name)) for c in recording.channels if c.name != "x_um"),
        aliases=names,
    )
    (overall,) = assessing.assess(models, [other]).overall()
    assert overall.target == "z_um"
    assert overall.caveat.startswith("not a test on unseen data: 800 of 800 rows")


def test_what_little_is_left_of_a_copy_is_no_test(models: tuple[ErrorModel, ...]) -> None:
    recording = small_machine()
    day = small_machine(DAY, seed=5).table
    for rows, honest in ((30, False), (100, True)):
        long = of(pd.concat([recording.table, day.iloc[:rows]], ignore_index=True), recording)
        known = find_learned_rows(models[0], stack([long], ["z_um"]))
        assert known.all() != honest
        assert known[:800].all()


def test_other_days_are_judged_whole(models: tuple[ErrorModel, ...]) -> None:
    for seed in range(1, 40):
        samples = stack([small_machine(seed=seed)], ["z_um"])
        assert not find_learned_rows(models[0], samples).any()


def repeated(recording: Recording, first: int, stop: int) -> Recording:
    again = recording.table.iloc[first:stop].copy()
    again["z_um"] -= 3.0
    found = of(pd.concat([recording.table, again], ignore_index=True), recording, "small")
    return found.with_cycles([*recording.cycles, Cycle("again", len(recording), len(found))])


def samples_of(*recordings: Recording) -> Samples:
    return stack(recordings, ["z_um"])


def test_a_cycle_that_comes_twice_is_refused_with_its_rows(recording: Recording) -> None:
    samples = samples_of(repeated(recording, 200, 400))
    wanted = (
        r"small: rows 800-999 repeat rows 200-399 of the same recording .approximate rows.: with cycle 2 .* left out"
    )
    with pytest.raises(InputError, match=wanted):
        compare(samples, ["ols"], splits.leave_one_cycle_out(samples))
    with pytest.raises(InputError, match=wanted):
        select("pareto", samples, splits.leave_one_cycle_out(samples), Settings())
    with pytest.raises(InputError, match=r"rows 800-999 repeat rows 200-399"):
        study.fit(samples, "ols", splits.by_rows(samples, 0.6, 0.4))


def test_a_stretch_that_comes_twice_within_what_is_learned_or_judged_is_no_leak(recording: Recording) -> None:
    samples = samples_of(repeated(recording, 100, 200))
    judging = splits.by_rows(samples, 0.5, 0.3)
    judged = compare(samples, ["ols"], judging, robustness=False)
    assert judged.overall()[0].measured.size == round(0.8 * 900) - 450


def test_two_files_that_share_rows_are_refused_with_both_names(recording: Recording) -> None:
    other = replace(after(small_machine(DAY, seed=5), of(recording.table.iloc[300:500], recording)), name="other")
    tests = [replace(r, cycles=make_single_cycle(len(r))) for r in (recording, other)]
    samples = samples_of(*tests)
    with pytest.raises(InputError, match=r"other: rows 800-999 repeat rows 300-499 of small .approximate rows."):
        compare(samples, ["ols"], splits.leave_one_file_out(samples))
    apart = samples_of(recording, replace(small_machine(DAY, seed=5), name="other"))
    assert compare(apart, ["ols"], splits.leave_one_file_out(apart), robustness=False).overall()


def test_what_goes_on_from_a_file_that_was_learned_is_a_stretch(models: tuple[ErrorModel, ...]) -> None:
    day = replace(small_machine(DAY, seed=5), name="day")
    (alone,) = assessing.assess(models, [day]).overall()
    assert alone.accepted
    (goes_on,) = assessing.assess(
        models, [day], starts=Start("continued", "stated", (small_machine(),), 60.0)
    ).overall()
    assert not goes_on.accepted
    assert "one section" in " ".join(goes_on.verdict.caps)


def test_copies_of_one_cycle_are_one_unit(models: tuple[ErrorModel, ...]) -> None:
    one = small_machine((2000.0,), seed=5)
    copies = [replace(one, name="a"), of(one.table.drop(index=50), one, "b"), of(one.table.drop(index=77), one, "c")]
    (overall,) = assessing.assess(models, copies, starts=COLD).overall()
    assert overall.word == "unproven"
    assert overall.reason.startswith(f"not shown to be better than {CURVE}: RMS ")
    assert overall.reason.endswith("the drift is much the same each time: record other speeds and durations")
