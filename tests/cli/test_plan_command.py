"""`thermocomp plan`, and the same in Python."""

import json
from pathlib import Path

import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.recordings.readers import recordings


@pytest.fixture
def drift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    recordings.write(small_machine(), tmp_path / "drift.csv")
    return "drift.csv"


def test_it_prints_the_tests_and_writes_the_best(drift: str, capsys: pytest.CaptureFixture[str]) -> None:
    given = ("plan", drift, "--target", "z_um", "--top-speed", "6000", "--jobs", "1", "-o", "next.ngc")
    assert run([*given]) == 0
    told = capsys.readouterr().out
    assert "Record next: 6,000 1/min" in told
    assert "no run faster than 3,000 1/min" in " ".join(told.split())
    assert "Unseen cycles so far:" in told
    assert "Written: next.ngc, next.csv, next.png" in told
    assert "S6000 M3" in Path("next.ngc").read_text(encoding="ascii")
    assert Path("next.png").read_bytes().startswith(b"\x89PNG")
    assert run([*given]) == 2
    assert "next.ngc: the file exists already" in " ".join(capsys.readouterr().err.split())
    assert run([*given, "--no-curve", "--overwrite", "--dialect", "fanuc", "--probe-every", "0"]) == 0
    assert Path("next.ngc").read_text(encoding="ascii").startswith("%\nO1001")


def test_more_than_one_target_and_a_length(drift: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", drift, "--target", "z_um", "x_um", "--no-curve", "--hours", "4", "--swing", "0", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert len(content["candidates"]) == 16
    assert {sum(s["duration_s"] for s in c["steps"]) for c in content["candidates"]} == {4.25 * 3600}
    assert content["curve"] is None
    assert content["files"] == []


def test_speeds_in_a_random_order_are_a_proof(drift: str, capsys: pytest.CaptureFixture[str]) -> None:
    given = [
        "plan",
        drift,
        "--target",
        "z_um",
        "--no-curve",
        "--hours",
        "5",
        "--proof",
        "--seed",
        "7",
        "-o",
        "proof.ngc",
    ]
    assert run([*given, "--probe-every", "0"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "Record next: 5 runs of 0.5 h at 600 to 3,000 1/min in a random order (seed 7), each with a stop" in told
    program = Path("proof.ngc").read_text(encoding="ascii")
    assert "in a random order seed 7 each" in program
    speeds = [int(line[1:].split()[0]) for line in program.splitlines() if line.startswith("S")]
    assert sorted(speeds) == [600, 1200, 1800, 2400, 3000]
    assert speeds != sorted(speeds)
    assert Path("proof.csv").read_text(encoding="utf-8").startswith("# speeds in a random order, seed 7\ntime_min,")


def test_a_running_test_may_end_or_not(drift: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", drift, "--target", "x_um", "--running", "--json"]) in (0, 1)
    content = json.loads(capsys.readouterr().out)["running"]
    assert content["phase"] == "cool-down"
    assert content["may_stop"] == all(s["known"] for s in content["states"])
    assert run(["plan", drift, "--target", "x_um", "--running"]) == (0 if content["may_stop"] else 1)
    assert "steady state" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("-o", "test.csv"), "name the NC program, such as test.ngc"),
        (("-o", "test.png"), "name the NC program, such as test.ngc"),
        (("-o", "nowhere/test.ngc"), "there is no folder"),
        (("-o", "drift.ngc", "--overwrite"), "drift.csv: this file is also an input"),
        (("--running", "-o", "test.ngc"), "--running writes no file"),
        (("--top-speed", "-5"), "top speed -5 1/min"),
        (("--probe-every", "45", "-o", "test.ngc"), "a measurement every 45 min: expected 1 to 30"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_written(
    drift: str, more: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(Path().iterdir())
    assert run(["plan", drift, "--target", "z_um", "--no-curve", *more]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert sorted(Path().iterdir()) == before


def test_in_python_it_is_a_table_a_figure_and_a_sentence(tmp_path: Path) -> None:
    found = tc.plan(small_machine(), "z_um", top_speed=6000.0, hours=6)
    table = found.to_frame()
    assert len(table) == 17
    assert table["gain"].is_monotonic_decreasing
    assert found.next.trial.speed == 6000.0
    assert found.curve is not None
    assert len(found.plot().axes) == 5
    assert str(found).startswith("Record next: 6,000 1/min for ")
    assert found.write(tmp_path / "a.ngc", dialect="fanuc", every=0) == tmp_path / "a.csv"
    alone = tc.plan(small_machine((2000.0,)), "z_um")
    assert alone.curve is None
    assert len(alone.plot().axes) == 4


def test_one_running_test_is_judged(tmp_path: Path) -> None:
    with pytest.raises(tc.ThermocompError, match="2 recordings given: expected one, that of the running test"):
        tc.may_stop([small_machine(), small_machine()])
    assert [name for name, _ in tc.may_stop(small_machine()).states] == ["z_um", "x_um"]
