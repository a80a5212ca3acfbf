"""The table across the papers on a measured machine: every recording counts, every row is judged unseen."""

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.judging.replay import replay
from thermocomp.models.training import train
from thermocomp.papers import cross
from thermocomp.recordings.recording import Recording


def test_a_measured_machine_is_judged_on_all_unseen_rows(recording: Recording) -> None:
    """X-02: every row by the model that has not seen its cycle; errors of all cycles together."""
    task = cross.take_task([recording], "x_um")
    none, ols = cross.judge(task, ["ols"])
    y = task.samples.deviations[:, 0]
    left = np.full(len(y), np.nan)
    for s in task.judging.splits:
        assert not (s.learn & s.judge).any()
        model = train("ols", task.samples, 0, s.learn).model
        left[s.judge] = y[s.judge] - replay(model, task.samples, s.judge)[0]
    assert ols.rms == pytest.approx(np.sqrt(np.mean(left**2)))
    assert ols.max_abs == pytest.approx(np.abs(left).max())
    assert none.max_abs == pytest.approx(np.abs(y).max())


def test_every_recording_of_a_measured_machine_counts() -> None:
    """X-02: two recordings, of which each cycle is unseen once."""
    both = [small_machine(s, seed=k) for k, s in enumerate([(1000.0, 2500.0), (3000.0, 1800.0)])]
    task = cross.take_task(both, "z_um")
    assert len(task.samples) == sum(map(len, both))
    assert np.sum([s.judge for s in task.judging.splits], axis=0).tolist() == [1] * len(task.samples)
    assert {*task.samples.test[task.judging.splits[0].learn].tolist()} == {0, 1}
