"""Thresholds: stated with unit, reason and source, stored with a model, and used from there, not from the code."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from drawnmodels import draw_compensator, draw_thresholds
from test_adaptation import MODEL

from thermocomp.core.exceptions import InputError, ModelFileError, SettingError
from thermocomp.core.explained import explain
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
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
