"""`thermocomp select`: tables for people, JSON for programs, a page, and clear refusals."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import crowded_machine

from thermocomp.cli.app import run
from thermocomp.core.machine import Channel
from thermocomp.judging.choice import LOOKED_AT_BY, Settings
from thermocomp.recordings.readers import recordings


@pytest.fixture(scope="module")
def drift(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("select") / "drift.csv"
    recordings.write(crowded_machine(), path)
    return path


@pytest.mark.parametrize("method", ["correlation", "grouping", "partial-f", "stepwise", "subsets", "ace", "pareto"])
def test_every_method_for_people_and_programs(
    drift: Path, method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "sensors.html"
    line = ["select", str(drift), "--target", "x_um", "--method", method, "--jobs", "1"]
    line += ["--max-sensors", "2"] if method in ("correlation", "subsets", "ace", "pareto") else []
    assert run([*line, "-o", str(page), "--details"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("Use t")
    assert "x_um: t" in said
    assert str(page.name) in said
    text = page.read_text(encoding="utf-8")
    assert "Which sensors does the model need?" in text
    assert "http" not in text.replace("http://www.w3.org", "").replace("https://matplotlib.org", "").replace(
        "http://purl.org", ""
    ).replace("http://creativecommons.org", "")
    assert run([*line, "-o", str(page)]) == 2  # not overwritten without being asked
    assert "exists already" in capsys.readouterr().err
    assert run([*line, "--json"]) == 0
    (choice,) = json.loads(capsys.readouterr().out)["choices"]
    assert choice["method"] == method
    assert set(choice["sensors"]) <= {f"t{k}_C" for k in range(1, 7)}
    assert all(rows for rows in choice["tables"].values())
    assert ", ".join(choice["sensors"]) in said


def test_refusals(drift: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["select", str(drift), "--target", "x_um", "--jobs", "1"]
    for extra, told in (
        (["--method", "grouping", "--threshold", "2"], "threshold 2.0"),
        (["--method", "grouping", "--reference", "t9_C"], "no input is named 't9_C'"),
        (["--max-sensors", "0"], "expected at least 1"),
        (["--models", "gpp"], "unknown model 'gpp'"),
        (["--method", "ace", "--level", "3"], "level 3.0"),
        (["--method", "ace", "--threshold", "0.5"], "--threshold is for --method grouping, not for ace"),
        (
            ["--method", "grouping", "--max-sensors", "4"],
            "--max-sensors is for --method subsets or ace or pareto or correlation, not for",
        ),
        (["--holm"], "--holm is for --method ace, not for pareto"),
        (["--seconds", "5"], "--seconds is for --method subsets, not for pareto"),
        (["--method", "ace", "--max-sensors", "0"], "at least"),
        (["--method", "subsets", "--max-sensors", "0"], "at least 1"),
    ):
        assert run([*line, *extra]) == 2, extra
        assert told in " ".join(capsys.readouterr().err.split()), extra


def test_every_setting_says_who_looks_at_it() -> None:
    assert set(LOOKED_AT_BY) == {f.name for f in fields(Settings)}
    described = {n: (Settings.__doc__ or "").split(f"    {n} : ")[1].split("\n")[1].split(":")[0] for n in LOOKED_AT_BY}
    assert {n: tuple(text.strip().split(", ")) for n, text in described.items()} == LOOKED_AT_BY


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks Linux how long a process has computed")
@pytest.mark.long
def test_ctrl_c_ends_a_search_and_shows_what_it_has(tmp_path: Path) -> None:
    """One interrupt is enough, and what was found is not thrown away."""
    rng = np.random.default_rng(0)
    plain = crowded_machine()
    more = {f"t{k}_C": 20 + np.cumsum(0.05 * rng.normal(size=len(plain))) for k in range(10, 130)}
    table = pd.concat([plain.table, pd.DataFrame(more, index=plain.table.index)], axis=1)
    channels = (*plain.channels, *(Channel(n, "temperature", "degC") for n in more))
    path = tmp_path / "wide.csv"
    recordings.write(replace(plain, table=table, channels=channels), path)
    # a shell starts what runs in the background with interrupts ignored, and that is inherited
    begin = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    line = [
        sys.executable,
        "-c",
        begin + "from thermocomp.cli.app import main; main()",
        "select",
        str(path),
        "--target",
        "x_um",
        "--max-sensors",
        "16",
    ]
    for method, extra, searching, code, told in (
        ("subsets", ["--seconds", "300"], "sets examined", 0, "interrupted"),
        ("pareto", ["--verbose"], "trouble", 130, "stopped"),
    ):
        with subprocess.Popen(
            [*line, "--method", method, *extra],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "COLUMNS": "120"},
        ) as running:
            try:
                assert running.stderr is not None
                first = next(line for line in running.stderr if searching in line)
                assert running.poll() is None, first
                os.killpg(running.pid, signal.SIGINT)
                said, errors = running.communicate(timeout=60)
            finally:
                running.kill()
        assert running.returncode == code, errors
        assert told in said + errors
        assert "Traceback" not in errors


def test_one_thermal_cycle_is_enough_for_most(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = crowded_machine()
    part = replace(plain, table=plain.table.iloc[:200], time=plain.time[:200], cycles=plain.cycles[:1])
    path = tmp_path / "one.csv"
    recordings.write(part, path)
    for method in ("correlation", "grouping", "partial-f", "stepwise", "subsets", "ace"):
        assert run(["select", str(path), "--target", "x_um", "--method", method, "--jobs", "1"]) == 0, method
    capsys.readouterr()
    assert run(["select", str(path), "--target", "x_um", "--jobs", "1"]) == 2
    assert "only one thermal cycle" in capsys.readouterr().err


def test_no_number_is_cut_off_on_a_narrow_terminal(
    drift: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for method in ("subsets", "grouping", "pareto"):
        assert run(["select", str(drift), "--target", "x_um", "--method", method, "--jobs", "1", "--details"]) == 0
        assert "…" not in capsys.readouterr().out


def test_sensors_that_do_not_help_are_not_recommended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Noise is not compensated by any temperature: judged bad, for people and programs, and on the page."""
    plain = crowded_machine()
    noise = np.random.default_rng(1).normal(size=len(plain))
    path, page = tmp_path / "noise.csv", tmp_path / "noise.html"
    recordings.write(replace(plain, table=plain.table.assign(x_um=noise)), path)
    line = ["select", str(path), "--target", "x_um", "--max-sensors", "2", "--jobs", "1", "--quiet"]
    assert run([*line, "-o", str(page), "--details"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "x_um: no sensor: no set of temperatures is clearly better than no compensation" in said
    assert "no set of temperatures is clearly better" in page.read_text(encoding="utf-8")
    assert run([*line, "--json"]) == 1
    (choice,) = json.loads(capsys.readouterr().out)["choices"]
    assert choice["sensors"] == []
    assert choice["reason"].startswith("no set of temperatures is clearly better than no compensation")


def test_a_target_that_does_not_move(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = crowded_machine()
    path = tmp_path / "still.csv"
    recordings.write(replace(plain, table=plain.table.assign(x_um=0.0)), path)
    for method in ("pareto", "subsets", "grouping"):
        assert run(["select", str(path), "--target", "x_um", "--method", method, "--jobs", "1"]) == 2
        assert "x_um is constant" in capsys.readouterr().err
