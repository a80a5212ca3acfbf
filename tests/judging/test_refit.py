"""What is accepted is tried as it would be written: fitted to all rows."""

from dataclasses import replace
from typing import Any, Self

import numpy as np
import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.core.exceptions import FitError
from thermocomp.judging import study
from thermocomp.judging.compare import compare
from thermocomp.judging.splits import Judging, leave_one_cycle_out
from thermocomp.models.training import Trained, train
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack


@pytest.fixture(scope="module")
def samples() -> Samples:
    return stack([small_machine()], ["z_um"])


@pytest.fixture(scope="module")
def judging(samples: Samples) -> Judging:
    return leave_one_cycle_out(samples)


class NotOfAll(tc.LeastSquares):
    """Can be fitted to all cycles but one."""

    def __init__(self, most: int = 0) -> None:
        super().__init__()
        self.most = most

    def fit(self, X: Any, y: Any, **more: Any) -> Self:
        if len(X) > self.most:
            raise FitError("too many rows")
        super().fit(X, y, **more)
        return self


def test_compare_and_fit_say_the_same(samples: Samples, judging: Judging) -> None:
    (compared,) = compare(samples, ["ols"], judging).overall()
    (fitted,) = study.fit(samples, "ols", judging).comparison.overall()
    assert compared.accepted
    assert compared.robustness is not None
    assert fitted.robustness is not None
    assert compared.robustness.lost_rms == fitted.robustness.lost_rms
    assert compared.robustness.noise_rms == fitted.robustness.noise_rms


def test_what_is_written_is_tried_as_well(samples: Samples, judging: Judging) -> None:
    """Without a watch, which would stand in for what it leans on more."""
    (before,) = compare(samples, ["ols"], judging, refit=False, limits=None).overall()
    (after,) = compare(samples, ["ols"], judging, limits=None).overall()
    assert before.robustness is not None
    assert after.robustness is not None
    assert before.robustness.lost_rms != after.robustness.lost_rms


def test_what_leans_on_a_sensor_when_it_is_written_is_unproven(
    samples: Samples, judging: Judging, monkeypatch: pytest.MonkeyPatch
) -> None:
    (before,) = compare(samples, ["ols"], judging).overall()
    assert before.accepted

    def leaning(name: Any, samples: Samples, target: int, learn: Any, **more: Any) -> Trained:
        trained = train(name, samples, target, learn, **more)
        if learn.all():
            assert isinstance(trained.model, tc.Polynomial)
            factors = tuple(50.0 * c for c in trained.model.coefficients)
            return replace(trained, model=replace(trained.model, coefficients=factors))
        return trained

    monkeypatch.setattr("thermocomp.judging.refit.train", leaning)
    (after,) = compare(samples, ["ols"], judging).overall()
    assert after.word == "unproven"
    assert "worse than no compensation" in after.reason


def test_what_cannot_be_fitted_to_all_rows_is_unproven(samples: Samples, judging: Judging) -> None:
    most = max(int(np.count_nonzero(split.learn)) for split in judging.splits)
    (found,) = compare(samples, [NotOfAll(most)], judging).overall()
    assert found.word == "unproven"
    assert "cannot be fitted to all rows: too many rows" in found.reason


@pytest.mark.long
def test_the_demo_is_unproven_for_the_model_that_would_be_written() -> None:
    (recording,) = tc.simulate("demo")
    mine = stack([recording], ["z_um"])
    judging = leave_one_cycle_out(mine)
    assert [a.word for a in compare(mine, ["dynamic"], judging, refit=False).overall()] == ["accepted"]
    (found,) = compare(mine, ["dynamic"], judging).overall()
    assert found.word == "unproven"
    assert "worse than no compensation" in found.reason
    assert "t_z_bearing_C off by 1 degC" in found.reason
