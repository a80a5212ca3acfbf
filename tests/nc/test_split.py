"""Long cuts in pieces: what is left inside them, and the way they take."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from nc_law import STATED, Growing, Trial, revise

from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.rewrite.demand import Field
from thermocomp.nc.rewrite.text import Vector

BEGIN = "G21 G90 G17 G94 G54\nS3000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F3000\n"
PLACED = replace(STATED, offsets={1: (0.0, 0.0, 0.0)})


@dataclass
class Wavy(Growing):
    """It depends on X, less than the step of 1 um per 10 mm, and comes to an end in time."""

    by_position = True

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 8.0 * math.sin(point[0] / 100.0) + 20.0 * (1.0 - math.exp(-self.time / 300.0))

    def field(self) -> Field:
        return Wavy(self.time).deviation


def tried(folder: Path, text: str, *, split: bool = True, way: str = "coordinates") -> Trial:
    path = folder / "program.ngc"
    path.write_text(f"{BEGIN}{text}G0 Z10\nM2\n")
    return revise(path, folder, Wavy(), way, setup=PLACED, split=split)


def pieces(trial: Trial) -> dict[str, list[str]]:
    return {r.text.strip(): [t.strip() for t in r.texts] for r in trial.rows if len(r.texts) > 1 and r.number}


CUTS = [
    "N10 G1 X500 M8 (long)\nX0 Y0\n",
    "X300 Y100 Z-20 F20\n",
    "G2 X400 Y0 I200 J0\nG3 X0 R200\n",
    "G3 X300 Y0 R-250\nG2 X0 R-250 Z-3\n",
    "G2 I200\nG3 I200 Z-2\n",
    "G20\nG1 X10 F20\nG90.1 G3 X0 Y0 I5 J0 F40\nG91.1\n",
    "G10 L2 P1 R20\nG0 X0 Y0 Z5\nG1 Z-1\nX400 Y10\nG10 L2 P1 R0\n",
    "G64 P0.01\nX400 F100\n",
]


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("text", CUTS)
def test_less_is_left_and_the_way_is_the_same(text: str, tmp_path: Path) -> None:
    whole = tried(tmp_path, text, split=False).run.left.most[2]
    trial = tried(tmp_path, text)
    assert pieces(trial)
    trial.proved()
    assert trial.run.left.most[2] < whole
    assert tried(tmp_path, "X500\n").run.left.most[2] <= 2.0 < tried(tmp_path, "X500\n", split=False).run.left.most[2]


def test_what_stands_beside_a_cut_stays_beside_its_first_piece(tmp_path: Path) -> None:
    made = pieces(tried(tmp_path, CUTS[0]))["N10 G1 X500 M8 (long)"]
    assert made[0].startswith("N10 G1 X")
    assert made[0].endswith("(long)")
    assert "M8" in made[0]
    assert all(set(t) <= set("XYZ0123456789.- ") for t in made[1:])
    assert "X500" in made[-1]


@pytest.mark.parametrize(
    "text",
    [
        "G91 G1 X500\nG90\n",
        "G61\nX500\n",
        "G61.1\nX500\n",
        "G93\nG1 X500 F1\nG94 F100\n",
        "/X500\nX500\n",
        "X[500]\n",
        "G2 X0 Y0 I200 P2\n",
        "G0 X500\n",
        "X500 A360\n",
        "M0\nX500 Z-1\n",
    ],
)
def test_what_is_not_a_plain_cut_stays_whole(text: str, tmp_path: Path) -> None:
    assert not pieces(tried(tmp_path, text))


def test_the_ends_of_lines_stay(tmp_path: Path) -> None:
    path = tmp_path / "program.ngc"
    path.write_bytes(f"{BEGIN}X500\nX0".replace("\n", "\r\n").encode())
    trial = revise(path, tmp_path, Wavy(), "coordinates", setup=PLACED)
    assert len(trial.rows[-2].texts) > 1
    assert len(trial.rows[-1].texts) == 1
    written = trial.revised.read_bytes()
    assert written.count(b"\r\n") == written.count(b"\n")
    assert not any(
        len(row.texts) > 1 and "G52" not in row.texts[0] for row in tried(tmp_path, "X500\n", way="offset").rows[1:]
    )


class Slanting(Wavy):
    """X drifts as Z does."""

    def deviation(self, point: Point) -> Vector:
        z = Wavy(self.time).deviation(point)[2]
        return z, 0.0, z

    def field(self) -> Field:
        return Slanting(self.time).deviation


def test_a_piece_names_no_axis_that_stands_nobody_knows_where(tmp_path: Path) -> None:
    path = tmp_path / "program.ngc"
    path.write_text("G21 G90 G17 G94 G54\nS3000 M3\nG0 X0 Y0\nG1 X500 F3000\nM2\n")
    trial = revise(path, tmp_path, Slanting(), "coordinates", setup=PLACED)
    made = pieces(trial)["G1 X500 F3000"]
    assert len(made) > 2
    assert not any("Z" in text for text in made)
    trial.proved()


@dataclass
class Humped(Growing):
    """A hump over X, far steeper than a cut may follow."""

    by_position = True
    size: float = 90.0

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 18.0 + self.size * max(0.0, 1.0 - abs(point[0] / 150.0 - 1.0))

    def field(self) -> Field:
        return self.deviation


@pytest.mark.parametrize("size", [20.0, 90.0])
def test_no_cut_ends_worse_for_being_split(size: float, tmp_path: Path) -> None:
    path = tmp_path / "program.ngc"
    path.write_text("G21 G90 G17 G94 G54\nS3000 M3\nG0 X0 Y0 Z2\nG1 X300 Z-30 F900\nX310\nX300\nG0 Z50\nM2\n")
    ends = []
    for split in (True, False):
        run = revise(path, tmp_path, Humped(size=size), "coordinates", setup=PLACED, split=split)
        rows = {row.text.strip(): row for row in run.rows}
        row = rows["G1 X300 Z-30 F900"]
        ends.append(abs(row.deviation[2] + row.carried[2]))
        assert run.run.left.most[2] <= 18.0 + size
    assert ends[0] <= ends[1] + 1.0


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("text", ["G1 X200 Z-80 F600\nX0 Z150\n", "X60 Y-30 Z-30 F900\nX-100 Y-50 Z3\n"])
def test_sloped_cuts_are_proved(text: str, tmp_path: Path) -> None:
    path = tmp_path / "program.ngc"
    path.write_text(f"G21 G90 G17 G94 G54\nS3000 M3\nG0 X0 Y0 Z190\nG4 P3000\nG1 Z180 F600\n{text}G0 Z190\nM2\n")
    trial = revise(path, tmp_path, Wavy(), "coordinates", setup=PLACED)
    assert pieces(trial)
    trial.proved()
