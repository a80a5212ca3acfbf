"""``thermocomp simulate``: from a name or a protocol of one's own to files."""

import json
import re
from pathlib import Path

import pytest

from thermocomp.cli.app import run
from thermocomp.recordings.readers.recordings import read
from thermocomp.virtual.datasets import EXPERIMENTS

PROTOCOL = """
sampling = "1 min"
places = {here = "housing"}
probes = ["z"]
segments = [{duration = "10 min"}, {duration = "30 min", speed = 2000}]
"""


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(PROTOCOL, encoding="utf-8")
    return path


def test_a_protocol_of_ones_own(protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "rec.parquet"
    assert run(["simulate", str(protocol), "-o", str(output), "--seed", "3", "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["recordings"]
    assert (told["name"], told["rows"]) == ("mine", 41)
    recording = read(output)
    assert [c.name for c in recording.channels] == ["t_here_C", "z_um", "spindle_rpm"]
    assert recording.table["z_um"].abs().max() > 2.0


def test_the_physics_of_the_machine_is_chosen(protocol: Path, tmp_path: Path) -> None:
    for name, options in (("a", []), ("b", ["--physics", "linear"]), ("c", ["--physics", "nonlinear"])):
        assert run(["simulate", str(protocol), "-o", str(tmp_path / f"{name}.csv"), *options]) == 0
    plain, linear, nonlinear = ((tmp_path / f"{name}.csv").read_text() for name in "abc")
    assert plain == linear != nonlinear
    with pytest.raises(SystemExit):
        run(["simulate", str(protocol), "-o", str(tmp_path / "d.csv"), "--physics", "quadratic"])


def test_every_test_gets_a_file(protocol: Path, tmp_path: Path) -> None:
    protocol.write_text(PROTOCOL + "copies = 2\n", encoding="utf-8")
    assert run(["simulate", str(protocol), "-o", str(tmp_path / "rec.csv")]) == 0
    first, second = (read(tmp_path / f"rec-{k}.csv") for k in (1, 2))
    assert first.table["t_here_C"].tolist() != second.table["t_here_C"].tolist()
    assert not (tmp_path / "rec.csv").exists()


def test_what_is_there_is_not_written_over(
    protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "rec.csv"
    output.write_text("precious", encoding="utf-8")
    # what is never run needs no answer
    monkeypatch.setattr("thermocomp.virtual.datasets.record", None)
    assert run(["simulate", str(protocol), "-o", str(output)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert output.read_text(encoding="utf-8") == "precious"
    # the file of the second test is there, the first one's is not
    protocol.write_text(PROTOCOL + "copies = 2\n", encoding="utf-8")
    (tmp_path / "rec-2.csv").touch()
    assert run(["simulate", str(protocol), "-o", str(output)]) == 2
    assert "rec-2.csv: the file exists already" in " ".join(capsys.readouterr().err.split())


def test_a_wrong_protocol_is_told_to_the_key(
    protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    protocol.write_text(PROTOCOL.replace("2000", "20000"), encoding="utf-8")
    assert run(["simulate", str(protocol), "-o", str(tmp_path / "rec.csv")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"{protocol}: [[segments]] 2, key 'speed' = 20000: 20000 1/min: the top speed of the spindle is 3500" in said


def test_the_help_names_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "--help"]) == 0
    said = re.sub(r"[│\s]+", " ", capsys.readouterr().out)
    assert f"or one of: {', '.join(EXPERIMENTS)}." in said
