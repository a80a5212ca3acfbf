"""Revised programs of a Fanuc, proved in eight states of a LinuxCNC; what is wrong with one is found in its line."""

from dataclasses import replace
from pathlib import Path

import pytest
from fanuc_generator import program
from test_fanuc_programs import PROGRAMS, REFUSED, SETUP, Trial, revise

from thermocomp.core.exceptions import InputError, ProgramError, Unprovable
from thermocomp.nc.linuxcnc.verification.verify import prove

#: why a random program is refused
FOR_A_REASON = (
    "uses the offset that holds the correction",
    "has not been positioned",
    "is not plausible as thermal drift",
)

pytestmark = pytest.mark.usefixtures("interpreter")


def proved(trial: Trial, seen: list[int] | None = None) -> tuple[int, int]:
    lines: list[int] = []
    proof = prove(trial.original, trial.revised, trial.ledger, SETUP, lines.append)
    if seen is not None:
        seen += lines
    assert proof.largest < 0.1
    return proof.states, proof.moves


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_each_revised_program_is_proved_in_eight_states(path: Path, tmp_path: Path) -> None:
    if path.name in REFUSED:
        return
    trial, seen = revise(path, tmp_path, "coordinates"), list[int]()
    states, moves = proved(trial, seen)
    assert states == 8
    assert moves > 8
    assert 0 < max(seen) <= len(trial.original.read_text("ascii").splitlines())


@pytest.mark.parametrize("seed", [*range(10), *(pytest.param(n, marks=pytest.mark.long) for n in range(10, 300))])
def test_random_programs_are_proved(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "program.nc"
    path.write_text(program(seed), "ascii")
    for way in ("coordinates", "offset"):
        try:
            trial = revise(path, tmp_path, way)
        except ProgramError as error:
            assert any(reason in str(error) for reason in FOR_A_REASON)  # noqa: PT017
        else:
            assert proved(trial)[0] == 8


PROGRAM = (
    "%\nO7 (ALL AT ONCE)\nG21 G90 G17 G40 G49 G80\nG0 G91 G28 Z0.\nT1 M6\nG90 G54 G0 X0. Y0. S3000 M3\nG43 H1 Z50. M8\n"
    "G99 G81 X10. Y0. Z-5. R2. F100.\nX20.\nG98 X30.\nG80\nG68 X0. Y0. R30.\nG0 X40. Y0.\nZ2.\nG1 Z-1. F200.\n"
    "X60. A0.\nG2 X60. Y10. J5. I0.\nG0 Z20.\nG69\nG0 X5. Y5.\nG98 G84 X5. Y5. Z-4. R2. F500.\nX9.\nG80\nZ60.\n"
    "G4 P500\nM5 M9\nG0 G91 G28 Z0.\nM30\n%\n"
)


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    path = tmp_path / "program.nc"
    path.write_text(PROGRAM, "ascii")
    return revise(path, tmp_path, "coordinates")


def test_the_program_is_proved(trial: Trial) -> None:
    assert proved(trial)[0] == 8


def test_a_cycle_that_goes_up_in_a_line_of_its_own_is_not_divided(trial: Trial) -> None:
    """In G61 LinuxCNC tells of nothing between a cycle and the line behind it."""
    setup = replace(SETUP, startup="G61")
    assert prove(trial.original, trial.revised, trial.ledger, setup).states == 8


@pytest.mark.parametrize(
    ("line", "letter", "change", "said"),
    [
        (6, "X", 0.0002, "moves X by"),
        (9, "X", 0.01, "moves X by"),
        (10, "X", -0.3, "moves X by"),
        (8, "Z", -0.001, "moves Z by"),
        (8, "R", 0.001, "moves Z by"),
        (8, "P", 0.0, "does not run|gives|makes"),
        (12, "R", 1.0, "moves X by"),
        (12, "X", 1.0, "moves X by"),
        (13, "Y", 0.005, "moves"),
        (15, "F", 5.0, "gives 'feedrate'|takes"),
        (16, "A", 1.0, "moves an axis other than|rotary"),
        (17, "J", 0.002, "centre|moves"),
        (18, "Z", 1.0, "moves Z by"),
        (21, "Z", 0.5, "moves|taps|goes"),
        (25, "P", 100.0, "gives 'dwell'"),
        (5, "T", 1.0, "gives"),
    ],
)
def test_what_is_wrong_is_found_in_its_line(trial: Trial, line: int, letter: str, change: float, said: str) -> None:
    numbers = [row.number for row in trial.rows for _ in row.texts]
    lines = trial.revised.read_text("ascii").splitlines(keepends=True)
    index = numbers.index(line)
    words = lines[index].split()
    place = next((k for k, w in enumerate(words) if w[0] == letter), None)
    if place is None:
        words.append(f"{letter}500")
    else:
        value = float(words[place][1:]) + change
        words[place] = f"{letter}{value:g}" if letter in "TPF" else f"{letter}{value:.4f}"
    lines[index] = " ".join(words) + "\n"
    trial.revised.write_text("".join(lines), "ascii")
    if letter == "P" and line == 8:  # G81 has no dwell, so nothing changes
        assert proved(trial)[0] == 8
        return
    with pytest.raises(ProgramError, match=said) as caught:
        proved(trial)
    assert line <= caught.value.line <= line + (letter in "RX" and line == 12) * 2 + (line == 8) * 1


def test_a_line_too_many_is_found(trial: Trial) -> None:
    text = trial.revised.read_text("ascii")
    trial.revised.write_text(text.replace("G80\n", "G80\nG0 X1.\n", 1), "ascii")
    with pytest.raises(ProgramError, match=r"in the revised program|instead of|moves|belongs"):
        proved(trial)
    trial.revised.write_text(text.replace("G54 G0", "G55 G0", 1), "ascii")
    with pytest.raises(ProgramError, match="moves"):
        proved(trial)


def test_what_cannot_be_said_cannot_be_proved(tmp_path: Path) -> None:
    path = tmp_path / "program.nc"
    path.write_text("G21 G90 S1 M3\nG92 X0. Y0. Z5.\nG0 X1. Y1. Z5.\nG92.1 X0. Y0. Z0.\nG52 X1.\nM30\n", "ascii")
    trial = revise(path, tmp_path, "coordinates")
    with pytest.raises(Unprovable, match=r"line 5 cannot be translated for LinuxCNC: G92 with G52 or G68"):
        proved(trial)
    assert issubclass(Unprovable, InputError)
