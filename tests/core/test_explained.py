"""What a model says of itself: every number is the model's or its watch's, and what is not known is not made up."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import lags
from watchedmachine import LOST, watched_model

from thermocomp.cli.app import run
from thermocomp.core.band import Band
from thermocomp.core.bounds import GAP
from thermocomp.core.contributions import gains
from thermocomp.core.explained import FAR, explain, explain_all
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.validity import Validity
from thermocomp.core.watch import Watch
from thermocomp.files import modelfile


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return watched_model()


def watched(model: ErrorModel) -> Watch:
    assert model.watch is not None
    return model.watch


def test_every_number_is_that_of_the_model(model: ErrorModel) -> None:
    told = explain(model)
    known = {g.name: g for g in gains(model, 60.0)}
    assert [s.name for s in told.sensors] == list(known)
    for s in told.sensors:
        assert (s.settled, s.bound) == (known[s.name].settled, known[s.name].bound)
        if s.quantity == "temperature":
            own = watched(model).sensors[watched(model).names.index(s.name)]
            assert (s.jump, s.off, s.moved, s.unseen) == (own.jump, own.off, own.moved, own.unseen)
            assert s.undetected == abs(known[s.name].settled) * own.off > 0
            assert s.lost == LOST[s.name]
    assert {s.name: s.runs_on for s in told.sensors} == {
        "t1_C": True, "t2_C": True, "t3_C": False, "spindle_rpm": False
    }  # fmt: skip
    assert told.pairs == (2, 1)
    assert json.loads(json.dumps(told.to_dict()))["sensors"][0]["name"] == told.sensors[0].name


def test_a_drift_shifts_the_answer_whichever_way_it_counts(model: ErrorModel) -> None:
    assert isinstance(model, PacedDynamic)
    turned = tuple(replace(t, direct=-t.direct, lagged=tuple(-w for w in t.lagged)) for t in model.temperatures)
    shifts = [{s.name: s.undetected for s in explain(m).sensors} for m in (model, replace(model, temperatures=turned))]
    assert shifts[0] == pytest.approx(shifts[1])


def test_sensors_of_the_models_of_other_cycles_are_no_pairs(model: ErrorModel) -> None:
    """A model fitted without a cycle may use other sensors: they are among those lost, and are not two."""
    assert model.honest_error is not None
    others = replace(model.honest_error, lost={**model.honest_error.lost, "t7_C": 2.0, "t8_C": 2.0})
    assert explain(replace(model, honest_error=others)).pairs == (2, 1)
    alone = {k: v for k, v in others.lost.items() if ", " not in k}
    heat = [i for i in model.inputs if i.quantity == "temperature"]
    none_judged = explain(replace(model, honest_error=replace(others, lost=alone)))
    assert none_judged.pairs[0] == len(heat) * (len(heat) - 1) // 2


def test_a_dozen_lines_say_it(model: ErrorModel) -> None:
    band = Band(0.9, "assumption", 4, 0.5, 2.0, 1.0)
    covered = Validity(4, 3, 0.2, (0.0, 3000.0), (19.0, 24.0), "t3_C", (20.0, 21.0), 2, 13.3)
    lines = str(explain(replace(model, band=band, validity=covered))).splitlines()
    assert len(lines) == 14
    text = "\n".join(lines)
    assert "z_um [um]: predicted by averaged from 3 temperatures and spindle_rpm; present and past values." in lines
    assert (
        "temperatures are relative to their mean over the first 5 min after a start while the spindle is stopped"
        in text
    )
    assert "Honest error (on unseen cycles): 1.25 um RMS, largest 2.00; without compensation 5.00 RMS." in lines
    assert "Verdict: accepted, worse than none on cycle 3." in lines
    assert f"Uncertainty band: {band.tell('um')}." in lines
    assert (
        "13.3 h, 4 cycles or tests, 3 of them distinct; 2 spindle speeds from 0 to 3000 1/min; axes not recorded"
        in text
    )
    assert "axes stood still: their heat was not judged" in str(
        explain(replace(model, validity=replace(covered, axes="stood still")))
    )
    assert "axes moved;" in str(explain(replace(model, validity=replace(covered, axes="moved"))))
    assert "1.50 um without it" in next(line for line in lines if line.startswith("  t1_C"))
    third = next(line for line in lines if line.startswith("  t3_C"))
    left, _, spare = third.partition("; spare recommended: ")
    assert left.endswith("error 9.00 um without it; the correction is held, then fades")
    assert spare == "without it the correction is held, then fades"
    assert "Two sensors lost at once: judged for 2 pairs; the model continues without 1 of them." in lines


def test_a_drift_that_is_found_late_wants_a_spare(model: ErrorModel) -> None:
    sensors = tuple(
        replace(s, off=off, still=GAP) for s, off in zip(watched(model).sensors, (FAR, 3.1, 1.0), strict=True)
    )
    late = explain(replace(model, watch=replace(watched(model), sensors=sensors)))
    spare = {s.name: s.spare for s in late.sensors}
    assert spare["t1_C"] == ""
    assert spare["t2_C"] == "its slow drift is detected only from 3.1 degC on"
    assert spare["spindle_rpm"] == ""
    assert all(s.still is None for s in late.sensors)
    assert "min" not in str(late).split("stuck while")[1].split("\n")[0]


def test_what_is_not_known_is_not_made_up(model: ErrorModel) -> None:
    bare = replace(model, watch=None, honest_error=None, band=None, validity=None)
    told = explain(bare)
    assert told.word == "unjudged"
    assert told.rms is None
    assert not any(s.watched or s.runs_on for s in told.sensors)
    assert {s.spare for s in told.sensors if s.quantity == "temperature"} == {"no other sensor predicts it"}
    text = str(told)
    assert "never judged on unseen cycles; the model will not run" in text
    assert "Uncertainty band: none." in text
    assert "Judged conditions: not known." in text
    assert "a wrong value is not detected" in text
    assert "None" not in text
    assert "nan" not in text
    # judged without a sensor, but with no watch to say what stands in: nothing runs on
    assert not any(s.runs_on for s in explain(replace(model, watch=None)).sensors)


def test_other_families_say_no_contributions() -> None:
    told = explain(replace(lags(room=True), support=Support("fade", 0.1)))
    assert [s.bound for s in told.sensors] == [None, None]
    assert "Largest contribution" not in str(told)
    assert "widened by 10 %, and the output fades to zero." in str(told)
    assert "the first reading after a start" in told.zero
    absolute = lags()
    assert explain(absolute).zero == "none, all inputs are absolute"


def test_inputs_without_an_influence_are_not_its_sensors(model: ErrorModel) -> None:
    told = explain(model)
    assert {s.name for s in told.sensors} == set(model.sensors)
    constant = replace(lags(), direct=(0.0, 0.0), lagged=(0.0, 0.0, 0.0))
    assert "from nothing" in str(explain(constant))


def test_the_command_shows_all_targets(model: ErrorModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "m.json"
    odd = replace(model, target="[bold]x")
    modelfile.write([model, odd], path)
    assert run(["explain", str(path), "--details"]) == 0
    told = capsys.readouterr().out
    assert told.strip().endswith(str(explain_all([model, odd])).strip())
    assert run(["explain", str(path), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [m["target"] for m in content["models"]] == ["z_um", "[bold]x"]
    assert content["models"] == json.loads(json.dumps(explain_all([model, odd]).to_dict()["models"]))
    assert run(["explain", str(path) + "x"]) == 2
