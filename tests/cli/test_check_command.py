"""`thermocomp check`: tables, one line per file, JSON and the page."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.report.records import stretches


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """Five recordings; the second has a probe that was touched and outliers, the third starts off its zero."""
    paths = []
    for k in range(5):
        recording = small_machine(seed=k)
        table = recording.table.copy()
        if k == 1:
            table.loc[500:, "x_um"] += 30.0
            table.loc[300:303, "z_um"] += 4300.0
        if k == 2:
            table["z_um"] += 12.0
        table.insert(0, "time_s", recording.time)
        path = tmp_path / f"day{k}.csv"
        table.to_csv(path, index=False)
        paths.append(str(path))
    return paths


def test_one_file_is_told_in_full(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", files[1], "--details"]) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "trouble x_um steps by" in text
    assert "trouble z_um 1 spike of 4 rows" in text
    assert "4 thermal cycle(s)" in text
    assert run(["check", files[0], "--details"]) == 0
    assert "nothing wrong found" in capsys.readouterr().out


def test_many_cycles_are_summarised(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = small_machine([1000.0 + 40 * k for k in range(30)], dt=1000.0).table
    more = table.iloc[:40].assign(spindle_rpm=1500.0)
    table = pd.concat([table, more], ignore_index=True)
    table.insert(0, "time_s", 1000.0 * np.arange(len(table)))
    table.to_csv(tmp_path / "month.csv", index=False)
    run(["check", str(tmp_path / "month.csv"), "--details"])
    text = " ".join(capsys.readouterr().out.split())
    assert "31 thermal cycles (30 of them short): " in text
    assert (
        "31 thermal cycles of 12 to 40 rows (median 12 rows, 3.3 h); 30 have fewer than 20 rows and are judged" in text
    )
    assert "20 (" not in text


def test_files_get_a_line_each_the_worst_first(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", *files]) == 1
    answer = capsys.readouterr().out
    rows = [" ".join(line.split()) for line in answer.splitlines() if line.startswith("day")]
    assert [row.split()[0] for row in rows] == ["day1.csv", "day2.csv", "day0.csv", "day3.csv", "day4.csv"]
    assert "trouble" in rows[0]
    assert "warning not zeroed" in rows[1]
    assert all("nothing" in row for row in rows[2:])
    assert "Warning: day1" in answer
    assert run(["check", files[0], *files[2:]]) == 0


def test_many_findings_of_a_kind_are_gathered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = small_machine()
    table = recording.table[["t1_C", "spindle_rpm"]].copy()
    for k in range(9):
        table[f"p{k}_um"] = recording.table["z_um"] * (1 + k) + 50
    table.insert(0, "time_s", recording.time)
    table.to_csv(tmp_path / "nine.csv", index=False)
    assert run(["check", str(tmp_path / "nine.csv"), "--details"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert text.count("models assume a probe zeroed") == 1 + 4  # in the answer, and in the list
    assert "warning not zeroed, 5 more: p4_um, p5_um, p6_um, p7_um, p8_um" in text


def test_json_holds_the_rows(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", *files, "--json"]) == 1
    recordings = json.loads(capsys.readouterr().out)["recordings"]
    assert [r["worst"] for r in recordings] == [None, "trouble", "warning", None, None]
    assert recordings[0]["hours"] == pytest.approx(799 / 60)
    found = {f["kind"]: f for f in recordings[1]["findings"]}
    assert found["spike"]["rows"] == [[300, 304]]
    assert found["step"]["rows"] is None
    assert abs(found["step"]["row"] - 500) <= 1


def test_a_page_is_written_and_never_over_something(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert run(["check", *files[:2], "-o", str(page)]) == 1
    assert "Written:" in capsys.readouterr().out
    first = page.read_text(encoding="utf-8")
    assert first.count("<h2") == 2
    assert run(["check", files[0], "-o", str(page)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert page.read_text(encoding="utf-8") == first
    assert run(["check", files[0], "-o", str(page), "--overwrite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["page"] == str(page)
    assert run(["check", files[0], "-o", files[0], "--overwrite"]) == 2
    assert run(["check", files[0], "-o", str(tmp_path / "page.txt")]) == 2


def test_stretches() -> None:
    assert stretches(np.array([], dtype=int)) == []
    assert stretches([5]) == [[5, 6]]
    assert stretches([3, 1, 2, 7, 9, 8]) == [[1, 4], [7, 10]]


def test_files_of_two_loggers_are_joined_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recording = small_machine(dt=200.0)
    table = recording.table.assign(time_s=recording.time)
    probes = [str(c) for c in table if str(c).endswith("_um")]
    table[["time_s", *probes]].to_csv("probes.csv", index=False)
    table.drop(columns=probes).to_csv("heat.csv", index=False)
    Path("joined.parquet").touch()  # a name that is taken is not proposed
    run(["check", "probes.csv", "heat.csv"])
    said = capsys.readouterr().out
    assert "2 recordings, " in said
    assert said.rstrip().endswith("Next: thermocomp join heat.csv probes.csv -o joined-2.parquet")
    assert run(["join", "heat.csv", "probes.csv", "-o", "joined-2.parquet"]) == 0
    lines = capsys.readouterr().out.rstrip().splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[-1] == "Next: thermocomp check joined-2.parquet"
    assert any(line.startswith("Joined: ") for line in lines)
    for one in ("probes.csv", "heat.csv"):
        run(["check", one])
        assert "Next:" not in capsys.readouterr().out
