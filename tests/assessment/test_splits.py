"""Splits: nothing judged was learned from, and never at random."""

import pytest

from smallmachine import small_machine
from thermocomp.assessment import splits
from thermocomp.core.exceptions import InputError
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples, stack


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
