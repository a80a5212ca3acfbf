"""Thresholds: stated with unit, reason and source, stored with a model, and used from there, not from the code."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawnmodels import SPEED, draw_compensator, draw_thresholds
from test_adaptation import MODEL

from thermocomp.core.exceptions import InputError, ModelFileError, SettingError
from thermocomp.core.explained import explain
from thermocomp.core.reading import Reading
from thermocomp.core.stack import Stack
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.zero import Zeroing
from thermocomp.files import jsonfile, modelfile
from thermocomp.live import statefile
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

WATCHED = next(m for m in draw_compensator(5).compensator.models if m.watch is not None)
OTHER = draw_thresholds(1)


def test_each_has_a_reason_and_a_source() -> None:
    for row in THRESHOLDS.rows:
        assert len(row.reason) > 10, row.name
        source = row.source.removeprefix("decision ")
        assert source == "choice of this project" or list(Path("docs/decisions").glob(f"{source}-*.md")), row.name


@pytest.mark.parametrize("name", [row.name for row in THRESHOLDS.rows])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0e12, 0.0])
def test_impossible_ones_are_refused(name: str, value: float) -> None:
    if name == "least_temperature" and value == 0.0:
        return
    with pytest.raises(SettingError, match=name):
        replace(THRESHOLDS, **{name: value})


def test_ones_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(SettingError, match="most_temperature must be from"):
        replace(THRESHOLDS, most_temperature=-50.0)
    with pytest.raises(SettingError, match="must be below most_temperature = 20 degC"):
        replace(THRESHOLDS, least_temperature=30.0, most_temperature=20.0)
    with pytest.raises(SettingError, match="must be below implausible = 2"):
        replace(THRESHOLDS, implausible=2.0)


def test_they_are_stored_once_in_a_model_file() -> None:
    thresholds = WATCHED.thresholds
    assert thresholds != THRESHOLDS
    text = modelfile.dumps([WATCHED, replace(WATCHED, target="other_um")])
    assert text.count('"swap_evidence"') == 1
    found = modelfile.loads(text)
    assert {m.thresholds for m in found} == {thresholds} == {m.watch.thresholds for m in found if m.watch}
    assert gather(Compensator.of(found[:1], watching=True)).values["zero_change"] == thresholds.zero_change


def test_a_file_without_them_has_those_of_its_time() -> None:
    plain = replace(WATCHED, watch=None, thresholds=THRESHOLDS)
    content = json.loads(modelfile.dumps([plain]))
    del content["thresholds"]
    content["sha256"] = jsonfile.digest(content["models"])
    assert modelfile.loads(json.dumps(content)) == (plain,)


def test_altered_ones_are_refused() -> None:
    content = json.loads(modelfile.dumps([WATCHED]))
    content["thresholds"]["suspect"] = 3.9
    with pytest.raises(ModelFileError, match="altered or damaged"):
        modelfile.loads(json.dumps(content))


def test_models_with_different_ones_do_not_run_together() -> None:
    other = replace(MODEL, target="x_um", thresholds=OTHER)
    with pytest.raises(InputError, match="different thresholds"):
        Compensator.of([MODEL, other])
    with pytest.raises(ModelFileError, match="thresholds; write them to separate files"):
        modelfile.dumps([MODEL, other])
    with pytest.raises(SettingError, match="its watch"):
        replace(WATCHED, thresholds=THRESHOLDS)


def test_a_state_belongs_to_them() -> None:
    one, other = (Compensator.of([replace(MODEL, thresholds=t)]) for t in (THRESHOLDS, OTHER))
    assert statefile.fingerprint(one) != statefile.fingerprint(other)


def test_an_explanation_shows_them() -> None:
    rows = explain(WATCHED).to_dict()["thresholds"]
    assert Thresholds(**{row["name"]: row["value"] for row in rows}) == WATCHED.thresholds
    assert {"name", "value", "unit", "reason", "source"} == set(rows[0])


@pytest.mark.parametrize(("stopped", "waits"), [(20.0, True), (10.0, False)])
def test_a_spindle_is_stopped_as_the_model_has_it(stopped: float, waits: bool) -> None:
    """15 1/min: the zero is the mean over 300 s, or the first readings within 10 s."""
    thresholds, zeroing = replace(THRESHOLDS, stopped_speed=stopped), Zeroing(300.0, 10.0, SPEED)
    watch = replace(WATCHED.watch, zeroing=zeroing, thresholds=thresholds) if WATCHED.watch else None
    model = replace(WATCHED, zeroing=zeroing, watch=watch, thresholds=thresholds)
    machine = Compensator.of([model], watching=True)
    rest = {i.name: i.reference for i in (*model.inputs, *(watch.inputs if watch else ()))} | {SPEED: 15.0}
    state = machine.start()
    for time in (0.0, 5.0, 60.0):
        state, _ = machine.step(state, Reading(time, rest), time)
    assert np.isnan(state.models[0].reference).any() == waits
    assert np.isnan(state.watches[0].reference).any() == waits
    own = replace(MODEL, zeroing=replace(zeroing, speed="n"), thresholds=thresholds)
    found = own.predict({"t": [20.0, 20.0, 24.0], "n": [15.0] * 3, "time": [0.0, 5.0, 60.0]}, time="time")
    assert (np.ptp(found) < 1e-9) == waits  # the readings of the zero are their mean


@pytest.mark.parametrize(("stopped", "factor"), [(20.0, 3.0), (10.0, 2.0)])
def test_a_band_is_that_of_a_stopped_spindle_as_the_model_has_it(stopped: float, factor: float) -> None:
    model = replace(MODEL, spread=(), thresholds=replace(THRESHOLDS, stopped_speed=stopped))
    both = [model, replace(model, target="x")]
    values = np.array([20.0, 15.0])
    state, _ = model.step(model.init([20.0, 0.0]), values, 0.0)
    assert model.half_width(state, values) == pytest.approx(factor)
    machine = Compensator.of(both)
    reading = Reading(0.0, {"t": 20.0, "n": 15.0})
    _, result = machine.step(machine.start(), reading, 0.0)
    assert list(result.half_widths.values()) == pytest.approx([factor, factor])
    stack = Stack(both)
    stacked, _ = stack.step(stack.init(), values, 0.0)
    assert stack.half_widths(stacked, values) == pytest.approx([factor, factor])
