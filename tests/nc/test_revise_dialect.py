"""``thermocomp revise`` without ``--controller``: nothing is taken for LinuxCNC's in silence."""

from pathlib import Path

import pytest
from reviseruns import revise, said

BODY = "G21 G90\nS3000 M3\nG0 X0 Y0 Z5.\nG1 Z-1. F100\nX100. F50\n{}X0\nX100.\nX0\nG0 Z5.\nM30\n"


@pytest.mark.parametrize(
    "head",
    [
        "; note\nO1000\n",
        "N1 O1000\n",
        "O1000;\n",
        "G21\nO1000\n",
        "%\n(part)\n\n  o 1000 (part)\n",
        ":1000\n",
        "N5 :1000\n",
        "/O1000\n",
        "\ufeffO1000\n",
        "G21 ; O1000\n",
        "G0 X1.\nM30\nO1000\n",
        "O1000 G90\n",
        "o<part>\n",
        "G21 G90 O1000\n",
        "%O1000\n",
        "%  O1000\n",
    ],
)
def test_a_program_number_counts_wherever_it_is(
    job_folder: Path, head: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.nc").write_text(head + BODY.format("G4 P500\n"), encoding="utf-8")
    before = set(job_folder.iterdir())
    assert revise(program="part.nc", dialect=False) == 2
    line = next(n for n, text in enumerate(head.splitlines(), 1) if "1000" in text or "<" in text)
    message = said(capsys)
    assert f"part.nc: line {line}: " in message
    assert "the beginning of a Fanuc's or Haas's program: give --controller fanuc" in message
    assert set(job_folder.iterdir()) == before


@pytest.mark.parametrize("word", ["G4 P500", "X50", "G92 X0", "G81 X1. Z-2. R1.", "G10 L20 P1 X0", "G53 Z0", "M62 P1"])
def test_a_word_with_two_readings_is_not_taken_for_linuxcnc(
    job_folder: Path, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.nc").write_text(BODY.format(word + "\n"), encoding="ascii")
    assert revise(program="part.nc", dialect=False) == 2
    assert "part.nc: line 6: " + word.split(maxsplit=1)[0] in said(capsys)


def test_what_makers_and_fanuc_have_made_of_a_code_is_asked_and_may_be_stated(
    job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for word, shown in [
        ("G07 X0.", "G7 makes"),
        ("M50", "M50 belongs"),
        ("M65 P1", "M65 belongs"),
        ("M19 R90.", "M19 R90. has"),
    ]:
        Path("part.nc").write_text(BODY.format(word + "\n"), encoding="ascii")
        assert revise(program="part.nc", dialect=False) == 2
        message = said(capsys)
        assert f"part.nc: line 6: {shown}" in message
        assert "or give --controller linuxcnc or --controller fanuc" in message
        assert revise(program="part.nc", out=f"{word.replace(' ', '')}.nc") == 0, capsys.readouterr().err


def test_a_slip_of_the_pen_is_named(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.nc").write_text(BODY.format("X1O.\n"), encoding="ascii")
    for dialect in (True, False):
        assert revise(program="part.nc", dialect=dialect) == 2
        assert "line 6: column 3: an O-word" in (message := said(capsys))
        assert "write the digit 0, not the letter O" in message


def test_what_is_certain_or_stated_is_revised(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, (text, options) in enumerate(
        [
            (BODY.format(""), []),
            (BODY.format("G4 P0.5\n"), []),
            ("G64 P0.01\n" + BODY.format("G4 P500\n"), []),
            (BODY.format("G4 P500\n"), ["--controller", "linuxcnc"]),
            (BODY.format("X50\n"), ["--integers", "whole"]),
            (BODY.format("G0 Z5.\nG81 X1. Z-2. R1.\nG0\n"), ["--startup", "G98"]),
            ("O1000\n" + BODY.format("G4 P500\n"), ["--controller", "fanuc"]),
        ]
    ):
        Path("part.nc").write_text(text, encoding="ascii")
        assert revise(*options, program="part.nc", out=f"{number}.nc", dialect=False) == 0, capsys.readouterr().err


def test_a_sign_far_from_the_head_counts(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    moves = "X1.5\nX2.5\n" * 500
    Path("part.nc").write_text(BODY.format(moves + "N900 O1000\n"), encoding="ascii")
    assert revise(program="part.nc", dialect=False) == 2
    assert "part.nc: line 1006: 'N900 O1000'" in said(capsys)
    Path("part.nc").write_text(BODY.format("G4 P500\n" + moves + "G64 P0.01\n"), encoding="ascii")
    assert revise(program="part.nc", dialect=False) == 0
