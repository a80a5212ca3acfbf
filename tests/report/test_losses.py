"""What `fit` says about lost sensors: which a spare is recommended for."""

from dataclasses import replace

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.stacking import stack
from thermocomp.report.losses import describe_losses


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    samples = stack([small_machine()], ["z_um"])
    learn = np.asarray(samples.cycle == 0)
    watch = find_watch(samples, learn)
    assert watch is not None
    return replace(train("ols", samples, 0, learn).model, watch=watch)


def lines(model: ErrorModel, lost: dict[str, float]) -> str:
    honest = HonestError(
        "cycles", 1.0, 1.0, 3.0, 5.0, 6.0, {"a": 1.0, "b": 1.0, "c": 1.0}, "accepted", "", 3, rules=RULES, lost=lost
    )
    return "\n".join(describe_losses([replace(model, honest_error=honest)]))


def test_a_spare_is_recommended_where_what_stands_in_is_dear_or_nothing_does(model: ErrorModel) -> None:
    said = lines(model, {"t1_C": 2.1, "t2_C": 1.9, "t3_C": 6.5})
    assert (
        "A spare sensor is recommended for t1_C, t3_C: without it a correction is held, or the error is more than 2 "
        "times" in said
    )
    assert "without t3_C the correction is held" in said


def test_no_spare_is_recommended_where_all_are_replaced_well(model: ErrorModel) -> None:
    said = lines(model, {"t1_C": 2.0, "t2_C": 1.0, "t3_C": 1.2, "spindle_rpm": 9.0})
    assert "without spindle_rpm the correction is held" in said
    assert "at most 2.00 um with one sensor lost and replaced by its prediction" in said
    assert "is recommended" not in said
