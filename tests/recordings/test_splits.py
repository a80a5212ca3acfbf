"""Splits: nothing judged was learned from, and never at random."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.judging import assessing, splits, study
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD


def test_rows(samples: Samples) -> None:
    (split,) = splits.parse("0.75/0.25", samples).splits
    assert split.block == "rows 600-799"
    assert split.learn.sum() == 600
    assert split.judge.sum() == 200
    assert not (split.learn & split.judge).any()
    (gap,) = splits.parse("0.5/0.2", samples).splits
    assert gap.block == "rows 400-559"


def test_published_block_of_8892_rows() -> None:
    assert round(8892 * 0.75) == 6669


def test_hours(samples: Samples) -> None:
    (split,) = splits.parse("5h/2h", samples).splits
    assert split.learn.sum() == 300
    assert split.judge.sum() == 120


def test_cycles(samples: Samples) -> None:
    judging = splits.leave_one_cycle_out(samples)
    assert [s.block for s in judging.splits] == [f"cycle {n}" for n in samples.cycle_names]
    for s in judging.splits:
        assert (s.learn ^ s.judge).all()


def test_files(recording: Recording) -> None:
    two = stack([recording, small_machine((1500.0, 500.0), seed=1)], ["z_um"])
    judging = splits.leave_one_file_out(two)
    assert [s.judge.sum() for s in judging.splits] == [800, 400]
    assert two.test_names == ("small#1", "small#2")


def test_cycles_too_short_to_judge_by_go_with_the_one_before() -> None:
    lengths = [(5, 30, 10, 10, 25, 3), (12, 9, 40), (7,)]
    cycle, test, k = [], [], 0
    for n, mine in enumerate(lengths):
        for rows in mine:
            cycle += [k] * rows
            test += [n] * rows
            k += 1
    found = splits.join_short_cycles(np.array(cycle), np.array(test), least=20)
    assert [block.tolist() for block in found] == [[0, 1, 2, 3], [4, 5], [6, 7], [8], [9]]
    assert [b.tolist() for b in splits.join_short_cycles(np.array(cycle), np.array(test), least=1)] == [
        [j] for j in range(k)
    ]


def test_short_cycles_are_left_out_together(recording: Recording) -> None:
    ends = [0, 200, 210, 215, 500, 790, 800]
    cut = recording.with_cycles([Cycle(str(k), a, b) for k, (a, b) in enumerate(itertools.pairwise(ends))])
    samples = stack([cut], ["z_um"])
    judging = splits.leave_one_cycle_out(samples)
    assert [s.block for s in judging.splits] == ["cycle 0 to 2", "cycle 3", "cycle 4 to 5"]
    assert [int(s.judge.sum()) for s in judging.splits] == [215, 285, 300]
    assert judging.name == "leave one thermal cycle out (6 cycles, 3 of them too short: left out with the previous one)"
    fitted = study.fit(samples, "ols", judging)
    (model,) = fitted.models
    assert model.honest_error is not None
    assert set(model.honest_error.cycles) == {"0 to 2", "3", "4 to 5"}
    assert np.isfinite(list(model.honest_error.cycles.values())).all()
    judged = assessing.assess([model], [cut])
    assert [a.block for a in judged.assessments] == [
        "cycle 0 to 2",
        "cycle 3",
        "cycle 4 to 5",
        "all cycles",
    ]


def test_a_file_is_judged_as_one(recording: Recording) -> None:
    two = stack([recording, small_machine((1500.0, 500.0), seed=1)], ["z_um"])
    fitted = study.fit(two, "ols", splits.leave_one_file_out(two))
    (whole,) = fitted.comparison.overall()
    assert [u.name for u in whole.verdict.units] == ["small#1", "small#2"]


@pytest.mark.parametrize("text", ["0.75", "a/b", "0.9/0.2", "0/1", "3h/x", "500h/3h", "0.75/0.25/0.1", "nan/0.1"])
def test_nonsense_is_refused(text: str, samples: Samples) -> None:
    with pytest.raises(InputError, match="split"):
        splits.parse(text, samples)


def test_one_cycle_cannot_be_left_out() -> None:
    one = stack([small_machine((1000.0,))], ["z_um"])
    with pytest.raises(InputError, match=r"only one thermal cycle was found.*--split"):
        splits.leave_one_cycle_out(one)
    with pytest.raises(InputError, match="at least two recordings"):
        splits.leave_one_file_out(one)
    with pytest.raises(InputError, match="has no time stamps"):
        splits.leave_one_day_out(one)


def test_days() -> None:
    stamped = replace(small_machine(), start="2026-03-01T16:30:00+01:00")
    samples = stack([stamped], ["z_um"])
    judging = splits.leave_one_day_out(samples)
    assert [s.block for s in judging.splits] == ["day 2026-03-01", "day 2026-03-02"]
    assert [int(s.judge.sum()) for s in judging.splits] == [600, 200]  # a cycle belongs to the day it begins on
    for s in judging.splits:
        assert (s.learn ^ s.judge).all()
    with pytest.raises(InputError, match="at least two days"):
        splits.leave_one_day_out(stack([replace(stamped, start="2026-03-01T00:00:00")], ["z_um"]))


def test_midnight_makes_no_units() -> None:
    tests = [replace(small_machine((n,), seed=k), start=f"2024-03-0{k}T22:20") for k, n in ((1, 2500.0), (5, 1500.0))]
    assert len(splits.leave_one_day_out(stack(tests, ["z_um"], starts=COLD)).splits) == 2
    # one cycle of several days can be cut by nothing else
    long = small_machine((1000.0, 2500.0, 1800.0, 3000.0) * 3)
    one = replace(long, cycles=(Cycle("whole test", 0, len(long)),), start="2024-03-01T22:20")
    assert len(splits.leave_one_day_out(stack([one], ["z_um"])).splits) == 3
