"""The judge of random programs finds what it is there for: revised programs that are wrong, each in one way."""

from pathlib import Path

import pytest
from machine_programs import program
from state_judge import InvalidError, WrongError, judge
from state_run import Stated, states

pytestmark = pytest.mark.usefixtures("interpreter")

HEAD = "G21 G90 G17 G40 G80 G94 G54\nT1 M6\nG43 H1\nS3000 M3\n"
NOTHING = (0.0, 0.0, 0.0)
SOME = (100.0, 100.0, 100.0)


def judged(original: str, revised: str, folder: Path, most: tuple[float, float, float] = SOME) -> list[str]:
    """Return what is wrong."""
    try:
        judge(f"{HEAD}{original}", f"{HEAD}{revised}", most, states(1, Stated(True, False)), folder)
    except WrongError as error:
        return error.faults
    return []


@pytest.mark.parametrize("seed", range(6))
def test_a_program_is_right_as_it_is(seed: int, tmp_path: Path) -> None:
    text = program(seed)
    found = judge(text, text, NOTHING, states(seed, Stated(True, False)), tmp_path)
    assert found.states >= 6
    assert found.moves >= 3 * found.states


def test_a_shift_of_all_words_is_right(tmp_path: Path) -> None:
    original = "G0 X0 Y0 Z10\nG1 X10 F100\nG2 X20 I5 J0\nG99 G81 X30 Z-3 R2\nX40\nG80\nG0 Z10\nM1\nG0 X5 Y5 Z10\nM2\n"
    revised = (
        "G0 X0.03 Y0.02 Z10.05\nG1 X10.03 F100\nG2 X20.03 I5 J0\nG99 G81 X30.03 Z-2.95 R2.05\nX40.03\nG80\nG0 Z10.05\n"
        "M1\nG0 X5.03 Y5.02 Z10.05\nM2\n"
    )
    assert judged(original, revised, tmp_path) == []


@pytest.mark.parametrize(
    ("original", "revised", "expected"),
    [
        pytest.param(
            "G0 X0 Y0 Z10 A0\nG1 Z-1 F300\nG1 X0 Y0 Z-1 A360 F720\nM2\n",
            "G0 X0 Y0 Z10 A0\nG1 Z-1 F300\nG1 X0 Y0 Z-0.999 A360 F720\nM2\n",
            "line 7, feed: moves X, Y or Z by 1.00 um, the original only turns",
            id="a turn becomes a crawl",
        ),
        pytest.param(
            "G53 G0 Z0\nG0 X10 Y0\nG98 G81 X10 Y0 Z-5 R2 F100\nG80\nG0 X80\nG0 Z50\nM2\n",
            "G53 G0 Z0\nG0 X10 Y0\nG98 G81 X10 Y0 Z-4.95 R2.05 F100\nG80\nG0 X80 Z2.05\nG0 Z50.05\nM2\n",
            "line 9, rapid: Z is shifted by",
            id="a word where the level is not known",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG81 X10 Z-5 R2 F100\nG81 X20 Z-5 R3\nG80\nG0 X80\nG0 Z50\nM2\n",
            "G0 X0 Y0 Z10\nG81 X10 Z-5 R2 F100\nG81 X20 Z-5 R3\nG80\nG0 X80 Z3.05\nG0 Z50\nM2\n",
            "line 9, rapid: Z is shifted by",
            id="a word where G98 or G99 is not known",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nM1\nG0 X20\nG0 Y0 Z10\nM2\n",
            "G0 X0 Y0 Z10\nM1\nG0 X20 Z10.05\nG0 Y0 Z10\nM2\n",
            "line 7, rapid: Z is shifted by",
            id="a word behind a stop",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\n/G0 X20\nG0 X30 Z20\nM2\n",
            "G0 X0 Y0 Z10\n/G0 X20 Z12\nG0 X30 Z20\nM2\n",
            "line 6, rapid: Z is shifted by 2000.0 um",
            id="more than was asked for",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\n/G0 X20\nG91 G0 X10\nG90 G0 Z20\nM2\n",
            "G0 X0 Y0 Z10\n/G0 X20.05\nG91 G0 X10\nG90 G0 Z20.05\nM2\n",
            "",
            id="right whether it is skipped or not",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG53 G0 Z-5\nM2\n",
            "G0 X0 Y0 Z10.05\nG53 G0 Z-4.95\nM2\n",
            "line 6: Z goes to machine coordinates shifted by 50.00 um",
            id="machine coordinates",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG1 X10 F100\nM2\n",
            "G0 X0 Y0 Z10\nG1 X10 F110\nM2\n",
            "line 6: 'feedrate' gives",
            id="another feed",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG93 G1 X10 F10\nM2\n",
            "G0 X0 Y0 Z10\nG93 G1 X10 F11\nM2\n",
            "line 6, feed: takes 5.4545 s instead of 6.0000 s",
            id="another inverse time",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG2 X20 I10 J0 F100\nM2\n",
            "G0 X0 Y0 Z10\nG2 X20.015 I10 J0 F100\nM2\n",
            "line 6, arc: X is shifted by 0.00 um at its start, 0.00 um at its centre, 15.00 um at its end",
            id="an arc of another radius",
        ),
        pytest.param(
            "G0 X0 Y0 Z10\nG10 L20 P1 Z0\nG0 Z5\nM2\n",
            "G0 X0 Y0 Z10.05\nG10 L20 P1 Z0\nG0 Z5\nM2\n",
            "#5223 is left at",
            id="another origin stays behind",
        ),
        pytest.param("G0 X0 Y0 Z10\nM8\nM2\n", "G0 X0 Y0 Z10\nM2\n", "instead of 'flood'", id="no coolant"),
    ],
)
def test_what_is_wrong_is_told(original: str, revised: str, expected: str, tmp_path: Path) -> None:
    faults = judged(original, revised, tmp_path)
    if not expected:
        assert faults == []
    else:
        assert any(expected in fault for fault in faults), faults


def test_a_program_that_does_not_run_is_not_judged(tmp_path: Path) -> None:
    with pytest.raises(InvalidError):
        judge("G1 X1\nM2\n", "G1 X1\nM2\n", NOTHING, states(1, Stated(True, True)), tmp_path)


def test_pieces_of_a_cut_are_one_move(tmp_path: Path) -> None:
    original = "G0 X0 Y0 Z0\nG1 X100 F100\nY50\nG3 X50 Y100 I-50 J0\nG2 X50 Y100 I5 J0\nM2\n"
    revised = (
        "G0 X0 Y0 Z0\nG1 X40 Z0.03 F100\nX100 Z0.02\nY50\nG3 X85.355339 Y85.355339 I-50 J0 Z0.03\nX50 Y100 I-35.355339"
        " J-35.355339 Z0.05\nG2 X60 I5 J0\nX50 I-5 J0\nM2\n"
    )
    assert judged(original, revised, tmp_path) == []
    assert judged(original, revised.replace("X40 Z0.03", "X40 Y1"), tmp_path)
    assert judged(original, revised.replace("X40 Z0.03", "X40 F90"), tmp_path)
