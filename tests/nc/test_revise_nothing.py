"""``thermocomp revise`` writes nothing where it takes nothing off, and says why and what to do."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import lags
from reviseruns import HONEST, revise, write_models

#: one long cut with no way up in it
CUT = "G21 G90 G17 G54 G94\nS4000 M3\n{}G1 X100 Y0 Z-1 F50\n" + "X0\nX100\n" * 10 + "M5\nM2\n"


def out(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("method", [[], ["--method", "offset", "--no-g92", "--safe-z", "20 mm"]])
def test_without_a_drift_there_is_no_file(
    job_folder: Path, method: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    write_models([replace(lags("z_um", 0.0), honest_error=HONEST)], "zero.json")
    before = set(job_folder.iterdir())
    assert revise("--model", "zero.json", *method) == 1
    assert set(job_folder.iterdir()) == before
    text = out(capsys)
    assert "nothing written: nothing was corrected: the drift in the cuts is 0.0 um at most" in text
    assert "run the original, or give a smaller --tolerance" in text
    assert "Written" not in text


def test_what_was_there_stays(job_folder: Path) -> None:
    Path("out.ngc").write_text("mine", encoding="ascii")
    assert revise("--tolerance", "300 um", "--overwrite") == 1
    assert Path("out.ngc").read_text(encoding="ascii") == "mine"


@pytest.mark.parametrize(
    ("program", "options", "reason"),
    [
        (CUT.format(""), [], "there is no safe point: give --safe-z, or use --method coordinates"),
        (
            CUT.format("G0 Z5\n"),
            ["--safe-z", "20 mm"],
            "less than 1 um wherever the offset could be updated; give a lower --safe-z, so that",
        ),
        (
            CUT.format("").replace("X100\nM5", "X100\nG0 Z30\nM5"),
            ["--safe-z", "20 mm"],
            "no rapid in G90 begins at or above Z 20 mm of the work coordinates after one: give a lower --safe-z",
        ),
        (CUT.format("G0 Z5\n"), [], "less than 1 um wherever the offset could be updated; give a --safe-z, so that"),
    ],
)
def test_the_advice_is_what_was_not_done_yet(
    job_folder: Path, program: str, options: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.ngc").write_text(program, encoding="ascii")
    before = set(job_folder.iterdir())
    assert revise("--method", "offset", "--no-g92", *options, "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["written"]
    assert set(told["files"].values()) == {None}
    assert reason in told["nothing"]
    assert told["axes"][0]["without_um"] > 5
    assert set(job_folder.iterdir()) == before


def test_what_held_all_of_it_is_named(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.ngc").write_text("G21 G90 G17 G54 G94\nS4000 M3\nG1 X10 F50\nG2 X0 I-5\n" * 99 + "M2\n", "ascii")
    assert revise("--every", "5 h") == 1
    text = out(capsys)
    assert "held because of the time between updates; change that in the program, or try --method offset" in text


def test_a_hole_that_is_corrected_counts(job_folder: Path) -> None:
    """The levels of a cycle have the correction, where it ends does not."""
    program = "G21 G90 G17 G54 G94 G98\nS4000 M3\nG0 Z5\nG4 P900\nG81 X1 Y1 Z-1 R2 F50\nG80\nM2\n"
    Path("part.ngc").write_text(program, encoding="ascii")
    assert revise() == 0
    assert Path("out.ngc").exists()
