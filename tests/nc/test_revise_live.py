"""Revised programs on the running controller, with simulated drives and a rotary axis: every move takes its time."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import linuxcncrun
import pytest
from nc_law import STATED, Growing, revise

#: X, Y and Z follow a drift as large as none is
DRIFT = Growing(rate=(1.0, -0.6, 2.0))
SETUP = replace(STATED, rotations=dict.fromkeys(range(1, 10), 0.0), rotary={"A": "table"})
#: of a move, or these many seconds: two periods of the servo thread at its begin and at its end
SHARE, SECONDS = 0.02, 0.005

#: a groove around a shaft, as FreeCAD's post writes it: every word on every line
TURNS = """T1 M6
G43 H1
S12000 M3
G0 X10 Y0 Z20 A0
G0 Z2
G1 X10 Y0 Z-1 A0 F300
G1 X10 Y0 Z-1 A360 F{feed}
G1 X10 Y0 Z-1 A720 F{feed}
G0 Z20"""
MIXED = """S3000 M3
G0 X0 Y0 Z10 A0
Z1
G1 Z-1 F600
X20 A90 F900
X22 A180
A90 F2400
X40
G0 X0 A0
A45
G1 X30 Y10 A-45 F1200
G0 Z10"""
DRILLING = """S3000 M3
G0 X0 Y0 Z20
G99 G81 X10 Y0 Z-5 R2 F600
X20
Y15
G80
G0 Z20
G98 G83 X40 Y0 Z-6 R2 Q2 F900
X50
G80
G0 X0 Y10"""
CONTOUR = """S3000 M3
G0 X0 Y0 Z10
Z2
G1 Z-1 F600
X40 F1500
G3 X50 Y10 I0 J10
G1 Y30
G3 X40 Y40 R10
G1 X0
G2 X-10 Y30 J-10
G1 Y0
G2 X-10 Y0 Z-2 I-5 J0
G0 Z10"""
INVERSE = """S3000 M3
G0 X0 Y0 Z10 A0
G93
G1 Z-1 F30
A90 F30
X20 A90 F40
X20 A180 F20
A0 F24
G94 F1200 X40
G0 Z10"""
PROGRAMS = {
    "turns": TURNS.format(feed=3600),
    "mixed": MIXED,
    "drilling": DRILLING,
    "contour": CONTOUR,
    "inverse": INVERSE,
}


def text(body: str) -> str:
    return f"G21 G90 G17 G40 G80 G94 G54 G61\n{body}\nM2\n"


def compared(programs: dict[str, str], folder: Path) -> None:
    """Run programs and what they are revised to, and compare how long each move lasts."""
    numbers: dict[str, dict[int, int]] = {}
    both: dict[str, str] = {}
    for name, body in programs.items():
        path = folder / f"{name}.ngc"
        path.write_text(text(body), encoding="ascii")
        trial = revise(path, folder, replace(DRIFT), "coordinates", setup=SETUP)
        numbers[name], written = {}, 0
        for row in trial.rows:
            written += sum(part.count("\n") for part in row.texts)
            numbers[name][row.number] = written
        both |= {name: text(body), f"{name}-revised": trial.revised.read_text(encoding="latin-1")}
    ran = linuxcncrun.run(both, 400.0, rotary=True)
    wrong = []
    for name in programs:
        was, now = ran[name], ran[f"{name}-revised"]
        moved = [line for line, _ in sorted(was.began.items(), key=lambda item: item[1]) if line]
        assert len(moved) > 4
        ends = {line: (was.began[line], now.began[numbers[name][line]]) for line in moved}
        stretches = [(a, ends[b][0] - ends[a][0], ends[b][1] - ends[a][1]) for a, b in pairwise(moved)]
        stretches.append((moved[-1], was.seconds - ends[moved[-1]][0], now.seconds - ends[moved[-1]][1]))
        for line, lasted, lasts in stretches:
            print(f"{name:10} line {line:3}: {lasted:8.3f} s, revised {lasts:8.3f} s")
            if abs(lasts - lasted) > max(SHARE * lasted, SECONDS):
                wrong.append(f"{name} line {line}: {lasts:.3f} s instead of {lasted:.3f} s")
    assert not wrong


@pytest.mark.long
def test_every_move_of_a_revised_program_takes_its_time(tmp_path: Path) -> None:
    compared(PROGRAMS, tmp_path)


@pytest.mark.long
def test_a_slow_turn_of_the_rotary_axis_alone_takes_its_time(tmp_path: Path) -> None:
    """It took 3.6 s instead of 30 s when Z went with it by 1 um."""
    compared({"turns": TURNS.format(feed=720)}, tmp_path)
