"""What no file may hold: refused in words, all of it at once, with its place."""

import json
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driftmodels import ACCEPTED, lags

from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.inputs import Input
from thermocomp.core.provenance import RULES
from thermocomp.files import jsonfile, modelfile
from thermocomp.files.machines import read_machine
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.runtime.compensator import Compensator
from thermocomp.virtual.protocolfile import read_protocol

MODEL = replace(lags(room=True), honest_error=ACCEPTED)
Change = Callable[[dict[str, Any]], object]


def signed(*changes: Change, models: int = 1) -> str:
    """Return a model file, the first of its models changed, with a checksum that fits."""
    body = json.loads(modelfile.dumps([MODEL] * models))["models"]
    for change in changes:
        change(body[0])
    return jsonfile.pack(jsonfile.MODELS, body)


def put(value: Any, *keys: str | int) -> Change:
    def change(entry: Any) -> None:
        for key in keys[:-1]:
            entry = entry[key]
        entry[keys[-1]] = value

    return change


def test_the_whole_file_is_used() -> None:
    assert modelfile.loads(signed()) == (MODEL,)
    MODEL.check_may_run()


# -- the eleven that a review got through, each below a checksum that fits --------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("1.0", "intercept"), "model 1: intercept: Input should be a valid number, found '1.0'"),
        (put(True, "intercept"), "model 1: intercept: Input should be a valid number, found True"),
        (put("yes", "inputs", 1, "rezero"), "model 1: inputs.1.rezero: Input should be a valid boolean, found 'yes'"),
        (put(1, "inputs", 1, "rezero"), "model 1: inputs.1.rezero: Input should be a valid boolean, found 1"),
        (put(0.0, "signals", 0, 0), "model 1: signals.0.0: Input should be a valid integer, found 0.0"),
        (put("K", "unit"), "model 1: unit: model of z_um: unit 'K': expected um, urad or, along an axis, um/m"),
        (
            put("K", "inputs", 1, "unit"),
            "model 1: inputs.1.unit: input t3_C: expected a temperature in degC, found 'K'",
        ),
        (put("banana", "unit"), "model 1: unit: model of z_um: unit 'banana': expected um"),
        (
            put("banana", "inputs", 0, "unit"),
            "inputs.0.unit: input spindle_rpm: expected a spindle_speed in 1/min",
        ),
        (
            put("temperatur", "inputs", 1, "quantity"),
            "model 1: inputs.1.quantity: there is no quantity 'temperatur'; the nearest are temperature",
        ),
        (
            put(5.01, "honest_error", "rms"),
            "model 1: honest_error: accepted with an RMS of 5.01 um, above the 5 um without compensation",
        ),
        (
            put([1e308] * 3, "direct"),
            "model 1: model of z_um: direct must be finite numbers within 1e+15 of zero, found 1e+308",
        ),
        (
            put(1e308, "inputs", 0, "high"),
            "model 1: inputs.0: input spindle_rpm: high must be finite numbers within 1e+09",
        ),
    ],
)
def test_what_a_review_got_through_is_refused(change: Change, message: str) -> None:
    with pytest.raises(ModelFileError, match=re.escape(message)):
        modelfile.loads(signed(change))


def test_a_verdict_that_rests_on_nothing_is_refused() -> None:
    assert MODEL.honest_error is not None
    for change, reason in (
        ({"units": 0}, "accepted, but never judged"),
        ({"cycles": {}}, "accepted, but never judged"),
        ({"verdict": "unproven", "taken": "Bob"}, "taken by 'Bob': expected a name and a reason"),
        ({"verdict": "unproven", "taken": "Bob, "}, "expected a name and a reason"),
    ):
        honest = replace(MODEL.honest_error, **{"verdict": "accepted", "rules": RULES, "units": 2, **change})  # type: ignore[arg-type]
        with pytest.raises(ModelFileError, match=reason):
            modelfile.loads(modelfile.dumps([replace(MODEL, honest_error=honest)]))


def test_a_model_without_an_honest_error_is_read_and_does_not_run() -> None:
    (model,) = modelfile.loads(signed(put(None, "honest_error")))
    assert model.predict({"time_s": [0.0, 60.0], "spindle_rpm": [0.0, 6000.0], "t3_C": [20.0, 20.0]})[1] != 0
    with pytest.raises(InputError, match="model of z_um was never judged on unseen cycles and will not run"):
        Compensator.of([model])


@pytest.mark.parametrize(("rules", "word"), [(RULES - 1, "older"), (RULES + 1, "newer")])
@pytest.mark.parametrize("verdict", ["accepted", "unproven"])
def test_a_verdict_by_other_rules_does_not_run_even_if_taken(rules: int, word: str, verdict: str) -> None:
    (read,) = modelfile.loads(signed(put(rules, "honest_error", "rules"), put(verdict, "honest_error", "verdict")))
    for model in (read, read.taken("M. Weber, trial on machine 7")):
        with pytest.raises(InputError, match=f"runs in shadow only: judged by {word} rules: .*; fit it again"):
            model.check_may_run()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"unit": "um",', '"unit": "um", "unit": "um",', "not a model file: the key 'unit' appears twice in one table"),
        ('"intercept": 0.0', '"intercept": NaN', "not a model file: NaN is not a number"),
        ('"intercept": 0.0', '"intercept": -Infinity', "not a model file: -Infinity is not a number"),
        ('"intercept": 0.0', '"intercept": 1e999', "invalid content: 'Out of range float"),
        ('"target": "z_um"', '"target": "\\ud800"', "invalid content: \"'utf-8' codec"),
        ('"intercept": 0.0', f'"intercept": {"9" * 4301}', "an integer with 4,301 digits"),
        ('"intercept": 0.0', f'"intercept": {"9" * 19}', "999999999999999999...: an integer with 19 digits"),
        ('"intercept": 0.0', f'"intercept": {"[" * 50_000}', "not a model file: nested too deeply"),
    ],
)
def test_what_is_no_json_of_ours_is_refused(old: str, new: str, message: str) -> None:
    text = signed()
    assert old in text
    with pytest.raises(ModelFileError, match=re.escape(message)):
        modelfile.loads(text.replace(old, new, 1))


# -- all errors at once -----------------------------------------------------------------------------------------------


def test_all_errors_are_listed() -> None:
    with pytest.raises(ModelFileError) as raised:
        modelfile.loads(
            signed(
                put("1", "intercept"), put("K", "inputs", 1, "unit"), put(1, "more"), put(-2.0, "honest_error", "rms"),
                put("oracle", "family"), models=1,
            )
        )  # fmt: skip
    assert "unknown family 'oracle'" in str(raised.value)
    with pytest.raises(ModelFileError) as raised:
        modelfile.loads(
            signed(
                put("1", "intercept"), put("K", "inputs", 1, "unit"), put(1, "more"), put(-2.0, "honest_error", "rms")
            )
        )
    assert str(raised.value).split("\n") == [
        "model: 4 errors",
        "  model 1: inputs.1.unit: input t3_C: expected a temperature in degC, found 'K'",
        "  model 1: intercept: Input should be a valid number, found '1'",
        "  model 1: honest_error: honest error: rms must be from 0 to 1e+15, found -2",
        "  model 1: more: unknown key",
    ]


def test_twenty_errors_are_listed_and_the_others_counted() -> None:
    with pytest.raises(ModelFileError) as raised:
        modelfile.loads(signed(*(put(1, f"more{k}") for k in range(33))))
    told = str(raised.value).split("\n")
    assert told[0] == "model: 33 errors"
    assert told[1:21] == [f"  model 1: more{k}: unknown key" for k in range(20)]
    assert told[21:] == ["  and 13 more"]


def test_an_error_repeats_no_megabyte_and_no_control_character() -> None:
    for change in (put("x" * 10**6, "unit"), put("\x1b[2J" * 10**5, "intercept"), put(1, "\x1b" * 10**5)):
        with pytest.raises(ModelFileError) as raised:
            modelfile.loads(signed(change))
        assert len(str(raised.value)) < 1000
        assert "\x1b" not in str(raised.value)


def test_of_a_long_list_the_first_error_is_enough() -> None:
    with pytest.raises(ModelFileError, match=r"^model: model 1: direct\.0: Input should be a valid number, found 'a'$"):
        modelfile.loads(signed(put(["a"] * 100_000, "direct")))


# -- names, versions, files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["", " ", "z\num", "z\x1b[2J", "z\u202e", "z\u2028", "x" * 201, "z\x00"])
def test_names_are_names(name: str) -> None:
    for change in (put(name, "target"), put(name, "inputs", 1, "name")):
        with pytest.raises(ModelFileError, match=r"is not a valid name|expected a name of 1 to 200 characters"):
            modelfile.loads(signed(change))
    with pytest.raises(InputError, match=r"is not a valid name|expected a name of 1 to 200 characters"):
        Input(name, "temperature", "degC", 20.0, True, -1.0, 1.0)


@pytest.mark.parametrize("name", ["température", "主轴 °C", "z um", "T6-T7", "a" * 200, "Küche\u00a01"])
def test_names_of_any_language_are_names(name: str) -> None:
    (model,) = modelfile.loads(signed(put(name, "target")))
    assert model.target == name


@pytest.mark.parametrize(
    ("version", "message"),
    [
        ("2", "written by a newer thermocomp, version 2 of a model file; this thermocomp reads version 1: update it"),
        ("0", "without a version"),
        ("true", "without a version"),
        ('"1"', "without a version"),
        ("1.0", "without a version"),
    ],
)
def test_a_file_of_another_version(version: str, message: str) -> None:
    with pytest.raises(ModelFileError, match=message):
        modelfile.loads(signed().replace('"version": 1', f'"version": {version}'))


def test_the_file_has_no_other_keys() -> None:
    with pytest.raises(ModelFileError, match=r"^model: more: unknown key$"):
        modelfile.loads(signed().replace('"version": 1', '"more": 1,\n "version": 1'))


def test_what_is_no_plain_file_is_refused_and_nothing_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "/dev/zero", "."):
        for read in (modelfile.read, read_machine, read_mapping):
            with pytest.raises(InputError, match=r"it is a folder, a pipe or a device"):
                read(tmp_path / name)
    with pytest.raises(ModelFileError, match=r"cannot be the name of a model file: embedded null"):
        modelfile.read(f"{tmp_path}/a\0b")


def test_files_have_a_size(tmp_path: Path) -> None:
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(jsonfile.MOST + 1)  # takes no room on the disk
    with pytest.raises(ModelFileError, match="cannot be read as a model file: it has more than 64,000,000 bytes"):
        modelfile.read(path)
    with pytest.raises(InputError, match="cannot be read as a mapping file: it has more than 1,500,000 bytes"):
        read_mapping(path)


@pytest.mark.parametrize("sign", ["[],", "{},", '"",', "1,"])
def test_so_has_what_stands_in_them(sign: str) -> None:
    with pytest.raises(ModelFileError, match="more than"):
        modelfile.loads(signed().replace('"models": [', f'"models": [{sign * 6_000_000}'))


# -- TOML -------------------------------------------------------------------------------------------------------------


def test_a_machine_file_tells_all_errors(tmp_path: Path) -> None:
    path = tmp_path / "mill.toml"
    path.write_text(
        'structure = "XFZ"\ncolour = "red"\n[axes.X]\ntravel = [0, 600]\n[axes.Y]\ntravel = ["0 mm", "1 mm"]\n'
        '[axes.Z]\nrapid = 3\n[components]\nEXX = {profile = [["0 mm", "0 um"], ["600 mm", "1 um"]]}\nEZZ = 3\n'
        'EYY = "1 um"\nABC = "1 um"\n',
        encoding="utf-8",
    )
    with pytest.raises(InputError) as raised:
        read_machine(path)
    first, *told = str(raised.value).split("\n")
    assert first == f"{path}: 7 errors"
    assert [line.split(": ")[0].strip() for line in told] == [
        "colour",
        "axes.X.travel",
        "axes.Z.rapid",
        "axes.Y",
        "components.EZZ",
        "components.EYY",
        "components.ABC",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a." * 40 + "b = 1", "line 1: a key with more than 32 parts"),
        ("a = " + "[" * 2000 + "]" * 2000, "nested too deeply"),
        ("a = " + "[" * 40 + "]" * 40, "nested too deeply"),
        ("a = " + "9" * 5000, "not valid TOML: Exceeds the limit"),
        ("a = 1\na = 2", "not valid TOML: Cannot overwrite a value"),
        ('a = "\\ud800"', "not valid TOML: "),
        ('[columns.z]\nscale = "1.0"', "key 'scale' = '1.0': Input should be a valid number"),
        ("[columns.z]\nscale = true", "key 'scale' = True: Input should be a valid number"),
        ('[read]\nonly_mapped = "yes"', "key 'only_mapped' = 'yes': Input should be a valid boolean"),
        ("[read]\nheading = 1.0", "key 'heading' = 1.0: Input should be a valid integer"),
        ("[columns.z]\nscale = inf", "key 'scale' = inf: Input should be a finite number"),
        ("[columns.z]\nvalid = [nan, 1]", "Input should be a finite number"),
    ],
)
def test_toml_is_taken_strictly(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(message)):
        read_mapping(path)


def test_so_is_a_protocol(tmp_path: Path) -> None:
    path = tmp_path / "test.toml"
    path.write_text(
        'sampling = "10 s"\nprobes = ["z"]\nrepeat = 4.0\nsegments = [{duration = "1 h"}]\n', encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"'repeat' = 4\.0: Input should be a valid integer"):
        read_protocol(path)


def test_lines_of_dots_are_comments(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(f"# {'.' * 60}\n[columns.z]\nmissing = [{'1.5, ' * 60}]\n", encoding="utf-8")
    assert read_mapping(path).columns["z"].missing == (1.5,) * 60


# -- no model says what is not a number --------------------------------------------------------------------------------


def test_readings_of_any_size_give_numbers() -> None:
    wide = replace(MODEL, direct=(1e15,) * 3, lagged=(-1e15,) * 4, time_constants=(1e-6, 1e10, 1.0, 1e10))
    state = wide.init()
    for row in ([1.7e308, -1.7e308], [-1.7e308, 1.7e308], [0.0, 0.0]):
        state, deviation = wide.step(state, np.array(row), 1.7e308)
        assert np.isfinite(deviation)
