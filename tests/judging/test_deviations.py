"""Deviations of a sensor that its watch does not detect: their effect is judged, and a model that they make harmful."""

from dataclasses import replace

import numpy as np
import pytest
from watchedmachine import failing, watched_model

from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.judging import assessing
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.replay import replay
from thermocomp.judging.robustness import OFF, Robustness, pool_robustness, stress, worse
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return watched_model()


@pytest.mark.parametrize(("name", "sign"), [("t1_C", -1), ("t2_C", 1), ("t2_C", -1)])
def test_the_watch_is_silent_and_the_effect_is_as_judged(model: ErrorModel, name: str, sign: int) -> None:
    """A deviation that grows in the recording, a little smaller: no fault is found, and the output moves so far."""
    day = failing()
    clean = assessing.assess([model], [day], starts=Start()).overall()[0]
    assert clean.robustness is not None
    assert model.watch is not None
    by, judged = clean.robustness.deviating[name]
    assert by == OFF <= model.watch.limits("off").min()
    grown = sign * 0.6 * np.clip((day.time - 600.0) / 3600.0, 0.0, 1.0)
    recording = replace(day, table=day.table.assign(**{name: day.table[name] + grown}))
    found = assessing.assess([model], [recording], starts=Start())
    assert find_faults(found, [recording])[0].faults == ()
    moved = found.overall()[0].alone
    assert moved is not None
    assert clean.alone is not None
    effect = np.sqrt(np.mean((moved - clean.alone) ** 2)) / 0.6
    of = np.sqrt(judged**2 - clean.alone_metric("rms") ** 2)
    assert of == pytest.approx(effect, rel=0.2)
    assert of > 0.2


def test_a_deviation_is_at_most_half_the_trained_range(model: ErrorModel) -> None:
    """A machine in a cooled room: 1 degC would be more than its sensors ever read."""
    found = assessing.assess([model], [failing()], starts=Start()).overall()[0].robustness
    assert found is not None
    (air,) = (i for i in model.inputs if i.name == "t3_C")
    assert found.deviating["t3_C"][0] == pytest.approx((air.high - air.low) / 2)


def test_a_model_of_large_opposed_gains_is_unproven(model: ErrorModel) -> None:
    """Two temperatures that move alike: their difference costs nothing where they agree, and much where they do not."""
    assert isinstance(model, PacedDynamic)
    samples = stack([failing()], ["z_um"], ["t1_C", "t2_C", "t3_C", "spindle_rpm"])
    alike = samples.values.copy()
    alike[:, 0] = alike[:, 1] - alike[0, 1] + alike[0, 0]
    samples, every = replace(samples, values=alike), np.ones(len(samples), np.bool_)
    one, two, *others = model.temperatures
    assert [model.inputs[t.input].name for t in (one, two)] == ["t1_C", "t2_C"]
    opposed = (replace(one, direct=one.direct + 60.0), replace(two, direct=two.direct - 60.0), *others)
    measured, _ = replay(model, samples, every)
    for tried, bad in ((model, set[str]()), (replace(model, temperatures=opposed), {"t1_C", "t2_C"})):
        found = stress(tried, samples, measured, every, draws=1).robustness
        assert {what.split(" off by ")[0] for what in found.worse_than_none if " off by " in what} == bad
        clean = measured - stress(tried, samples, measured, every, draws=1).predicted
        assert np.abs(clean).max() < 0.05 * found.none_rms


def test_a_test_without_rows_is_no_obstacle(model: ErrorModel) -> None:
    other = failing(t1_C=(9.0, 0.01))
    found = []
    for days in ([failing(), other], [other]):
        samples = stack(days, ["z_um"], ["t1_C", "t2_C", "t3_C", "spindle_rpm"])
        last = samples.take(samples.test == len(days) - 1)
        found.append(stress(model, last, last.deviations[:, 0], np.ones(len(last), np.bool_), draws=1).robustness)
    assert found[0].deviating == found[1].deviating


def test_deviations_are_pooled_and_the_worse_counts() -> None:
    one = Robustness(0.4, {"uniform": (1.0, 1.0)}, {"a": 1.0}, 0.0, np.nan, 4.0, deviating={"a": (1.0, 3.0)})
    other = replace(one, none_rms=2.0, deviating={"a": (1.2, 5.0), "b": (1.0, 1.0)})
    pooled = pool_robustness([(one, 100), (other, 100)])
    assert pooled is not None
    assert pooled.deviating["a"] == pytest.approx((1.2, np.sqrt((9 + 25) / 2)))
    assert pooled.deviating["b"] == (1.0, 1.0)
    assert pooled.worse_than_none == ("a off by 1.2 degC",)
    assert worse(one, other).deviating == other.deviating
    assert worse(other, one).deviating == other.deviating
    assert one.worst_off == ("a", 3.0)
    assert one.harm == ""
    assert other.harm == "worse than no compensation (2.00 um RMS) with a off by 1.2 degC (5.00 um)"


@pytest.mark.parametrize("end", ["low", "high"])
def test_a_sensor_at_an_end_of_its_range_is_put_off_towards_the_middle(model: ErrorModel, end: str) -> None:
    """Beyond the range the input is limited: a deviation outwards would have no effect."""
    limited = replace(model, support=replace(model.support, margin=0.0))
    samples = stack([failing()], ["z_um"], ["t1_C", "t2_C", "t3_C", "spindle_rpm"])
    (warm,) = (i for i in model.inputs if i.name == "t2_C")
    values = samples.values.copy()
    values[20:, 1] = values[:6, 1].mean() + (warm.high + 0.5 if end == "high" else warm.low - 0.5)
    samples, every = replace(samples, values=values), np.ones(len(samples), np.bool_)
    found = stress(limited, samples, replay(limited, samples, every)[0], every, draws=1).robustness
    assert found.deviating["t2_C"][1] > 0.1
