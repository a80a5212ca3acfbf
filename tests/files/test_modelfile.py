"""Model files: bit-exact round trip; damaged and unknown files are refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.bounds import COEFFICIENT
from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.fingerprints import Prints, Runs, pack_marks
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.provenance import RULES, HonestError, Provenance
from thermocomp.files import jsonfile, modelfile

PRINTS = Prints(
    interval=15.0,
    learned=((0, 700), (720, 810)),
    steps={"z_um": 0.3, "t1_C": 1 / 3},
    runs=(
        Runs(
            stride=1,
            rows=pack_marks(np.array([3, 40, 2**20], dtype=np.uint32) % 800),
            moving=pack_marks(np.array([1, 0, 1], dtype=np.uint32)),
            marks={n: pack_marks(np.array([7, 2**32 - 1, k], dtype=np.uint32)) for k, n in enumerate(("z_um", "t1_C"))},
        ),
    ),
)

finite = st.floats(-COEFFICIENT, COEFFICIENT)


def model(coefficient: float = 1 / 3) -> LinearDynamic:
    return LinearDynamic(
        target="z_um",
        unit="um",
        inputs=(Input("t1_C", "temperature", "degC", 20.1, True, -1 / 3, 12.7),),
        signals=((0,), (0, 0)),
        direct=(coefficient, 0.0),
        lag_signals=(1,),
        time_constants=(600.0,),
        lagged=(1e-7,),
        support=Support("fade", 0.05, 0.3),
        provenance=Provenance(
            "dynamic", {"copies": "'lagged'"}, ("ab12",), ("1 (600 1/min)",), 810, "0.1.0", prints=PRINTS
        ),
        honest_error=HonestError(
            "leave one out", 1.0, 2.0, 3.0, 4.0, 5.0, {"1": 0.1}, "accepted", "better than none", 2, rules=RULES
        ),
    )


@given(finite)
def test_round_trip_keeps_every_bit(value: float) -> None:
    assert modelfile.loads(modelfile.dumps([model(value)])) == (model(value),)


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    modelfile.write([model()], path)
    assert modelfile.read(path) == (model(),)
    with pytest.raises(InputError, match="exists already"):
        modelfile.write([model(2.0)], path)
    assert modelfile.read(path) == (model(),)
    modelfile.write([model(2.0)], path, overwrite=True)
    assert modelfile.read(path) == (model(2.0),)
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]


def test_a_neighbour_and_a_folder_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "model.json.part").write_text("mine", encoding="utf-8")
    modelfile.write([model()], tmp_path / "model.json")
    assert (tmp_path / "model.json.part").read_text(encoding="utf-8") == "mine"
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="is a folder; name a file"):
        modelfile.write([model()], tmp_path / "folder", overwrite=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder", "model.json", "model.json.part"]


def test_deep_nesting_is_no_model() -> None:
    with pytest.raises(ModelFileError, match="nested too deeply"):
        modelfile.loads("[" * 100_000)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"nothing\.json: no such model file"):
        modelfile.read(tmp_path / "nothing.json")


def test_binary_file(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ModelFileError, match="cannot be read as a model file"):
        modelfile.read(path)


def test_cut_anywhere_is_told_and_never_half_used() -> None:
    text = modelfile.dumps([model()])
    for length in range(len(text) - 2):
        with pytest.raises(ModelFileError):
            modelfile.loads(text[:length])


def test_cut_in_half_says_so() -> None:
    text = modelfile.dumps([model()])
    with pytest.raises(ModelFileError, match="is incomplete"):
        modelfile.loads(text[: text.index('"inputs"')])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.3333333333333333", "0.3333333333333334", "do not match its checksum"),
        (
            '"version": 1',
            '"version": 2',
            "written by a newer thermocomp, version 2 of a model file; this thermocomp reads version 1: update it",
        ),
        ("thermocomp-model", "something-else", "not a model file"),
    ],
)
def test_altered_text_is_refused(old: str, new: str, message: str) -> None:
    text = modelfile.dumps([model()])
    assert old in text
    with pytest.raises(ModelFileError, match=message):
        modelfile.loads(text.replace(old, new, 1))


def altered(change: dict[str, object]) -> str:
    """Return a model file whose one model was changed and whose checksum was made to fit."""
    content = json.loads(modelfile.dumps([model()]))
    entry = content["models"][0]
    for key, value in change.items():
        if value is None:
            del entry[key]
        else:
            entry[key] = value
    shared = {k: content[k] for k in jsonfile.MODELS.shared if k in content}
    content["sha256"] = jsonfile.digest(content["models"], shared)
    return json.dumps(content)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"family": "oracle"}, "unknown family 'oracle'; expected one of polynomial, linear-dynamic"),
        ({"direct": None}, "model 1: direct: is missing"),
        ({"surprise": 1}, "model 1: surprise: unknown key"),
        ({"direct": [1.0]}, "2 signals but 1 direct"),
        ({"time_constants": [-5.0]}, "model 1: model of z_um: time_constants must be from 1e-06 to 1e\\+10, found -5"),
        ({"inputs": [{"name": "t"}]}, r"inputs\.0\."),
        ({"support": {"policy": "guess"}}, r"support\.policy"),
    ],
)
def test_wrong_content_is_refused_with_its_place(change: dict[str, object], message: str) -> None:
    with pytest.raises(ModelFileError, match=message):
        modelfile.loads(altered(change))


def with_prints(change: dict[str, Any], run: dict[str, Any]) -> str:
    """Return a model file with other fingerprints and a checksum that fits."""
    entry = json.loads(modelfile.dumps([model()]))["models"][0]
    prints = {**entry["provenance"]["prints"], **change}
    prints["runs"] = [{**prints["runs"][0], **run}]
    return altered({"provenance": {**entry["provenance"], "prints": prints}})


@pytest.mark.parametrize(
    ("change", "run", "message"),
    [
        ({}, {"rows": "AA*="}, "not base64"),
        ({}, {"rows": "Äöü="}, "not base64"),
        ({}, {"rows": "AAAA"}, "3 bytes are not a whole number of 32-bit numbers"),
        ({}, {"rows": pack_marks(np.array([5, 4, 6], dtype=np.uint32))}, "their row numbers must increase"),
        (
            {},
            {"rows": pack_marks(np.array([5, 6, 810], dtype=np.uint32))},
            "a run begins at row 810, but the training rows end at row 810",
        ),
        ({}, {"moving": "AAAAAA=="}, "1 values of moving for 3 rows"),
        ({}, {"marks": {}}, "expected those of at least one target"),
        ({}, {"marks": {"z_um": "", "t1_C": ""}}, "0 values of z_um for 3 rows"),
        ({"steps": {"z_um": 0.3, "t2_C": 0.1}}, {}, "a run has those of z_um, t1_C; expected those of z_um, t2_C"),
        ({"steps": {"z_um": 0.0, "t1_C": 0.1}}, {}, "fingerprints of z_um: resolution 0.0"),
        ({}, {"stride": 0}, "stride of 0 rows"),
        ({"interval": -1.0}, {}, "interval of -1.0 s"),
        ({"learned": [[0, 700], [600, 810]]}, {}, "in increasing order"),
        ({"learned": []}, {}, "in increasing order"),
        ({"surprise": 1}, {}, r"prints\.surprise"),
        ({"steps": None}, {}, r"prints\.steps"),
    ],
)
def test_wrong_fingerprints_are_refused(change: dict[str, Any], run: dict[str, Any], message: str) -> None:
    assert modelfile.loads(with_prints({}, {})) == (model(),)
    with pytest.raises(ModelFileError, match=message):
        modelfile.loads(with_prints(change, run))


def test_a_file_from_before_there_were_fingerprints_is_read() -> None:
    entry = json.loads(modelfile.dumps([model()]))["models"][0]
    del entry["provenance"]["prints"]
    (found,) = modelfile.loads(altered({"provenance": entry["provenance"]}))
    assert found.provenance is not None
    assert found.provenance.prints is None


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -1.0])
def test_what_is_no_error_is_never_written(wrong: float) -> None:
    with pytest.raises(InputError, match=f"honest error: mae must be from 0 to 1e\\+15, found {wrong:g}"):
        HonestError("p", wrong, 2.0, 3.0, 4.0, 5.0, {}, "refused", "")


def test_a_verdict_by_older_rules_proves_nothing_today() -> None:
    """A file of a former release has no rules in it: it loads, is shown as unproven, and does not run."""
    honest = HonestError("leave one out", 1.0, 2.0, 3.0, 4.0, 5.0, {"1": 0.1}, "accepted", "better than none")
    mine = replace(model(), honest_error=honest)
    text = modelfile.dumps([mine])
    for line in (' "rules": 0,', ' "units": 0,', ' "tried": 1,', ' "taken": ""'):
        assert line.strip(" ,") in text
    body = json.loads(text)["models"]
    for name in ("rules", "units", "tried", "taken"):
        del body[0]["honest_error"][name]
    (read,) = modelfile.loads(jsonfile.pack(jsonfile.MODELS, body))
    assert read.honest_error == honest
    assert not read.accepted
    assert read.honest_error is not None
    assert read.honest_error.word == "unproven"
    assert read.honest_error.why == "judged by older rules: better than none"
    with pytest.raises(InputError, match="unproven and runs in shadow only: judged by older rules"):
        read.check_may_run()


@pytest.mark.parametrize("by", ["M. Weber", ",trial", "M. Weber, ", " , "])
def test_who_takes_an_unproven_model_gives_name_and_reason(by: str) -> None:
    with pytest.raises(InputError, match="expected a name and a reason"):
        model().taken(by)


def test_an_unproven_model_that_is_taken_says_so_for_ever() -> None:
    honest = HonestError("p", 1.0, 2.0, 3.0, 4.0, 5.0, {}, "unproven", "judged on 2 units", rules=RULES)
    mine = replace(model(), honest_error=honest)
    with pytest.raises(InputError, match="accept-unproven"):
        mine.check_may_run()
    (read,) = modelfile.loads(modelfile.dumps([mine.taken("M. Weber, trial on machine 7")]))
    read.check_may_run()
    assert not read.accepted
    assert read.honest_error is not None
    assert read.honest_error.why == "judged on 2 units. Approved by M. Weber, trial on machine 7"
    refused = replace(mine, honest_error=replace(honest, verdict="refused")).taken("M. Weber, trial")
    with pytest.raises(InputError, match="was refused and will not run"):
        refused.check_may_run()
    assert mine.taken(None) == mine
    with pytest.raises(InputError, match="a name and a reason"):
        mine.taken("")
