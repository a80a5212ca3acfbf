"""The command line: exit codes, JSON, messages, nothing overwritten."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import app, run
from thermocomp.cli.extras import needs
from thermocomp.core.exceptions import MissingExtraError
from thermocomp.core.machine import Channel
from thermocomp.files import modelfile
from thermocomp.models.methods import METHODS
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording

RESULT_KEYS = {
    "model",
    "target",
    "block",
    "mae_um",
    "rms_um",
    "max_um",
    "none_mae_um",
    "none_rms_um",
    "reduction_pct",
    "verdict",
    "reason",
    "sensors",
    "n_sensors",
    "fit_s",
}


@pytest.fixture(scope="module")
def drift(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A CSV file with four thermal cycles."""
    path = tmp_path_factory.mktemp("cli") / "drift.csv"
    recordings.write(small_machine(dt=200.0), path)
    return path


FIT = ["fit", "--target", "z_um", "--model", "averaged", "--jobs", "1"]


def printed(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


def test_fit_predicts_a_tilt_of_two_probes(drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "m.json"
    tilt = ["--target", "z_um", "--tilt", "A0C=z_um:x_um:100mm", "--model", "ols", "--split", "0.75/0.25"]
    assert run(["fit", str(drift), *tilt, "--jobs", "1", "-o", str(model), "--json"]) in (0, 1)
    capsys.readouterr()
    displacement, angle = modelfile.read(model)
    assert (displacement.target, displacement.unit) == ("z_um", "um")
    assert (angle.target, angle.unit) == ("A0C", "urad")
    assert run(["fit", str(drift), "--target", "z_um", "--tilt", "A0C=z_um:100mm", "-o", str(tmp_path / "n.json")]) == 2
    assert "write name, probe at the tip" in " ".join(capsys.readouterr().err.split())


def test_compare_as_json(drift: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "compare",
        str(drift),
        "--target",
        "z_um",
        "x_um",
        "--models",
        "ols",
        "dynamic",
        "--split",
        "0.75/0.25",
    ]
    assert run([*arguments, "--jobs", "1", "--json"]) == 1  # one stretch proves nothing
    results = printed(capsys)["results"]
    assert [(r["target"], r["model"]) for r in results] == [
        (t, m) for t in ("z_um", "x_um") for m in ("ols", "dynamic")
    ]
    for r in results:
        assert set(r) >= RESULT_KEYS
        assert r["block"] == "rows 180-239"
        assert r["verdict"] == "unproven"
        assert r["reason"].startswith("judged on one section that continues the training data; ")
        assert r["n_sensors"] == len(r["sensors"])
        assert not {"z_um", "x_um"} & set(r["sensors"])
        assert r["mae_um"] <= r["rms_um"] <= r["max_um"]
        assert r["reduction_pct"] == pytest.approx(100 * (1 - r["rms_um"] / r["none_rms_um"]))


def test_compare_prints_a_table_and_writes_a_report(
    drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "report.html"
    arguments = ["compare", str(drift), "--target", "z_um", "--models", "dynamic", "--jobs", "1", "-o", str(report)]
    assert run([*arguments, "--details"]) == 0
    text = capsys.readouterr().out
    assert "leave one thermal cycle out (4 cycles)" in text
    assert text.startswith("Use dynamic for z_um: on unseen data, the RMS falls from ")
    assert "z_um: dynamic" in text
    assert report.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert run(arguments) == 2
    assert "exists already" in capsys.readouterr().err
    assert run([*arguments, "--overwrite"]) == 0


def test_fit_assess_and_their_exit_codes(drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.json"
    assert run([*FIT, str(drift), "-o", str(model), "--json"]) == 0
    (fitted,) = printed(capsys)["models"]
    assert fitted["verdict"] == "accepted"
    assert fitted["r_squared"] > 0.98
    (frozen,) = modelfile.read(model)
    assert fitted["formula"] == frozen.formula()
    assert run(["fit", str(drift), "--target", "z_um", "-o", str(model)]) == 2
    assert "exists already" in capsys.readouterr().err

    other = tmp_path / "other.csv"
    recordings.write(small_machine((2200.0, 1200.0), seed=3, dt=200.0), other)
    assert run(["assess", str(model), str(other), "--json"]) == 0
    results = printed(capsys)["results"]
    assert run(["assess", str(model), str(other), "--details"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "% of the judged rows, with a mean half-width" in said
    assert "not unseen" not in said
    assert [r["block"] for r in results] == ["cycle 1 (2200 1/min)", "cycle 2 (1200 1/min)", "all cycles"]
    assert set(results[-1]["robustness"]["noise_rms_um"]) == {"uniform", "normal"}
    assert run(["assess", str(model), str(drift), "--details"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "not a test on unseen data: fitted to drift" in said
    assert re.search(r"│ averaged │.* │ not unseen │", said)
    assert "% of the judged rows, which were used for training, with a mean half-width" in said
    copy = drift.with_name("copy.csv")
    copy.write_text(drift.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert run(["assess", str(model), str(copy)]) == 1  # the same test in another file
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith("On these recordings: not unseen for z_um.")
    assert "fitted to copy" in said
    assert "refused" not in said


def test_assess_leaves_out_what_was_learned_from(
    drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, copy = tmp_path / "model.json", tmp_path / "copy.csv"
    assert run([*FIT, str(drift), "-o", str(model), "--json"]) == 0
    capsys.readouterr()
    lines = drift.read_text(encoding="utf-8").splitlines(keepends=True)
    copy.write_text("".join(lines[:120] + lines[121:]), encoding="utf-8")
    assert run(["assess", str(model), str(copy), "--json"]) == 1
    found = printed(capsys)
    assert found["seen_in_training"] == []
    assert found["results"][-1]["verdict"] == "not unseen"
    reason = "not a test on unseen data: 239 of 239 rows were used for training; judge the model on another recording"
    assert found["results"][-1]["reason"] == reason
    first, day = small_machine(dt=200.0), small_machine((2200.0, 1200.0), seed=3, dt=200.0)
    table = pd.concat([first.table.drop(index=119), day.table], ignore_index=True)
    time = 200.0 * np.arange(len(table), dtype=np.float64)
    cycles = find_cycles(time, table["spindle_rpm"].to_numpy())
    recordings.write(replace(first, time=time, table=table, cycles=cycles), copy, overwrite=True)
    assert run(["assess", str(model), str(copy), "--json"]) == 0
    found = printed(capsys)["results"][-1]
    assert (found["n_rows"], found["n_rows_learned_from"]) == (120, 239)
    run(["assess", str(model), str(copy), "--details"])
    assert "239 of 359 rows were used for training and are left out" in " ".join(capsys.readouterr().out.split())


def test_what_fit_has_refused_assess_does_not_pass(
    drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, other = tmp_path / "model.json", tmp_path / "other.csv"
    recordings.write(small_machine((2200.0, 1200.0), seed=3, dt=200.0), other)
    run([*FIT, str(drift), "-o", str(model), "--json"])
    (fitted,) = modelfile.read(model)
    assert fitted.honest_error is not None
    refused = replace(fitted.honest_error, verdict="refused", reason="worse than none in cycle 2")
    modelfile.write([fitted, replace(fitted, honest_error=refused)], model, overwrite=True)
    capsys.readouterr()
    assert run(["assess", str(model), str(other), "--details"]) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "unproven z_um: judged on only 2 of 3 required cycles or files" in out
    assert "refused when it was fitted z_um: worse than none in cycle 2" in out
    modelfile.write([fitted], model, overwrite=True)
    assert run(["assess", str(model), str(other)]) == 0


def test_a_refused_model_gives_exit_code_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = small_machine(dt=200.0)
    table = recording.table.copy()
    table["z_um"] = 5.0 * (-1.0) ** (recording.table.index // 200)  # nothing the temperatures could explain
    path = tmp_path / "noise.csv"
    recordings.write(type(recording)(recording.name, recording.time, table, recording.channels, recording.cycles), path)
    model, cold = tmp_path / "model.json", ["--start", "cold"]
    assert run(["fit", str(path), "--target", "z_um", "--model", "ols", "--jobs", "1", *cold, "-o", str(model)]) == 1
    assert "refused" in capsys.readouterr().out
    (frozen,) = modelfile.read(model)
    assert not frozen.accepted
    assert run(["compare", str(path), "--target", "z_um", "--models", "ols", "--jobs", "1", *cold]) == 1
    assert "no model may run yet for z_um" in capsys.readouterr().out.lower()


def test_check(drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(drift), "--json"]) == 0
    (found,) = printed(capsys)["recordings"]
    assert found["rows"] == 240
    assert [c["start"] for c in found["cycles"]] == [0, 60, 120, 180]
    recording = small_machine(dt=200.0)
    table = recording.table.copy()
    table["t2_C"] = -180.0
    path = tmp_path / "absent.csv"
    recordings.write(type(recording)(recording.name, recording.time, table, recording.channels, recording.cycles), path)
    assert run(["check", str(path)]) == 1
    text = capsys.readouterr().out
    assert "trouble" in text
    assert "-180" in text


def altered(path: Path, **columns: Any) -> Path:
    """Write the small machine's recording with other columns."""
    recording = small_machine(dt=200.0)
    table = recording.table.assign(**columns)
    channels = tuple(
        Channel(str(c), *("displacement", "um"))
        if c not in recording.table
        else next(k for k in recording.channels if k.name == c)
        for c in table.columns
    )
    recordings.write(Recording(recording.name, recording.time, table, channels, recording.cycles), path)
    return path


def test_a_target_without_numbers_is_refused_not_a_crash(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = altered(tmp_path / "empty.csv", z_um=np.nan)
    assert run(["compare", str(path), "--target", "z_um", "x_um", "--models", "ols", "--jobs", "1", "--json"]) == 1
    results = printed(capsys)["results"]
    assert {r["verdict"] for r in results if r["target"] == "z_um"} == {"refused"}
    assert any(r["verdict"] == "accepted" for r in results if r["target"] == "x_um")
    assert (
        run(
            ["compare", str(path), "--target", "z_um", "--models", "ols", "--jobs", "1", "-o", str(tmp_path / "r.html")]
        )
        == 1
    )


def test_a_constant_target_is_refused_not_a_crash(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = altered(tmp_path / "constant.csv", z_um=3.0)
    arguments = [
        "compare",
        str(path),
        "--target",
        "z_um",
        "--models",
        "ols",
        "partial-f",
        "mra",
        "dynamic",
        "--jobs",
        "1",
    ]
    assert run([*arguments, "-o", str(tmp_path / "r.html")]) in (0, 1)
    assert run([*FIT, str(path), "-o", str(tmp_path / "m.json")]) in (0, 1)
    assert "trouble" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["[/]_um", "z'[red]_um", "<b>z</b>_um", "z µ°_um"])
def test_odd_names_are_printed_as_they_are(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = altered(tmp_path / "odd.csv", **{name: small_machine(dt=200.0).table["z_um"]})
    arguments = ["compare", str(path), "--target", name, "--models", "ols", "--jobs", "1"]
    assert run([*arguments, "-o", str(tmp_path / "r.html")]) == 0
    assert f"Use ols for {name}: on unseen data" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["compare", "{drift}", "--target", "zz_um"], "no channel is named 'zz_um'; the nearest are z_um"),
        (["compare", "{drift}", "--target", "t1_C"], "target t1_C measures temperature"),
        (["compare", "{drift}", "--target", "z_um", "--inputs", "x_um"], "no displacement probe"),
        (["compare", "{drift}", "--target", "z_um", "--models", "dynamik"], "did you mean dynamic"),
        (["compare", "{drift}", "--target", "z_um", "--split", "7"], "split '7'"),
        (
            ["compare", "{drift}", "--target", "z_um", "--split", "0.7/0.3", "--leave-one-cycle-out"],
            "exclude each other",
        ),
        (["compare", "nowhere.csv", "--target", "z_um"], "nowhere.csv"),
        (["assess", "{drift}", "{drift}"], "not a model file"),
        (["fit", "{drift}", "--target", "z_um", "--leave-one-file-out", "-o", "m.json"], "at least two recordings"),
        (["fit", "{drift}", "--target", "z_um", "-o", "nowhere/m.json"], "there is no folder nowhere"),
        (["compare", "{drift}", "--target", "z_um", "-o", "{drift}", "--overwrite"], "is also an input"),
        (["compare", "{drift}", "--target", "z_um", "-o", ".", "--overwrite"], "is a folder"),
        (["compare", "{drift}", "--target", "z_um", "--jobs", "0"], "jobs 0"),
        (["demo", "-o", "{drift}"], "is a file; name a folder"),
        (["compare", "{drift}", "{drift}", "--target", "z_um"], "contains the same test"),
    ],
)
def test_unusable_input_is_exit_code_two_and_a_message(
    arguments: list[str], message: str, drift: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(drift.parent)
    assert run([a.format(drift=drift) for a in arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not Path("m.json").exists()


def test_simulate_and_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = tmp_path / "rec.csv"
    assert run(["simulate", "hwang", "-o", str(recording)]) == 0
    assert "displacements" in capsys.readouterr().out
    assert run(["simulate", "hwang", "-o", str(recording)]) == 2
    assert run(["simulate", "hwanng", "-o", str(tmp_path / "other.csv")]) == 2
    assert "hwang" in capsys.readouterr().err
    assert run(["check", str(recording)]) in (0, 1)


def test_every_command_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    overview = capsys.readouterr().out
    for name in ("demo", "simulate", "check", "fit", "assess", "compare"):
        assert name in overview
        assert run([name, "--help"]) == 0
        text = capsys.readouterr().out
        assert "--json" in text
        assert "Usage: thermocomp" in text
    assert list(app)  # commands are registered


def test_missing_extra_says_what_to_install() -> None:
    with pytest.raises(MissingExtraError, match=r"pip install 'thermocomp\[study\]'"), needs("study"):
        raise ModuleNotFoundError("No module named 'sklearn'", name="sklearn.base")
    with pytest.raises(ModuleNotFoundError), needs("study"):
        raise ModuleNotFoundError("No module named 'elsewhere'", name="elsewhere")


def test_the_base_install_says_what_to_install(drift: Path) -> None:
    """In a Python that cannot see the extras, help works and a study command names the one to install."""
    blocked = "import sys\nfor m in ('pandas', 'sklearn', 'scipy', 'joblib', 'matplotlib'): sys.modules[m] = None\n"
    code = blocked + "from thermocomp.cli.app import run\nsys.exit(run(sys.argv[1:]))"
    shown = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=False)
    assert shown.returncode == 0, shown.stderr
    refused = subprocess.run(
        [sys.executable, "-c", code, "check", str(drift)], capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2
    assert "pip install 'thermocomp[study]'" in refused.stderr
    code = blocked + "import thermocomp\nthermocomp.read"
    python = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "pip install 'thermocomp[study]'" in python.stderr.splitlines()[-1]


def test_the_running_wing_loads_nothing_of_the_training_wing() -> None:
    code = (
        "import sys, thermocomp\n"
        "import thermocomp.runtime.compensator, thermocomp.files.modelfile\n"
        "thermocomp.Polynomial, thermocomp.Limits\n"
        "print([m for m in ('pandas', 'sklearn', 'scipy', 'matplotlib', 'numba', 'joblib') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_public_names_are_all_there() -> None:
    import thermocomp

    for name in thermocomp.__all__:
        assert getattr(thermocomp, name) is not None
    assert set(dir(thermocomp)) == set(thermocomp.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        thermocomp.nothing  # noqa: B018


def test_the_help_names_every_method(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "--help"]) == 0
    said = re.sub(r"[│\s]+", " ", capsys.readouterr().out)
    assert f"or all: {', '.join(METHODS)}." in said


@pytest.mark.long
def test_a_method_that_cannot_be_frozen_is_not_fitted(
    drift: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model.json"
    assert run(["fit", str(drift), "--target", "z_um", "--model", "gp", "-o", str(out), "--jobs", "1"]) == 2
    assert "gp cannot be stored as coefficients" in capsys.readouterr().err
    assert not out.exists()
    assert run(["compare", str(drift), "--target", "z_um", "--models", "gp", "--jobs", "1"]) in (0, 1)
    assert "gp" in capsys.readouterr().out
