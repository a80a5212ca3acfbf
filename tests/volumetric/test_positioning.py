"""Tables of positioning tests: read as they are meant, refused by line and column."""

from pathlib import Path

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.volumetric.files.positioning import read

HEADING = "position_mm,deviation_um,direction,run"


def rows(runs: int = 2, *, scale: float = 1.0, targets: tuple[int, ...] = (0, 100, 200)) -> list[str]:
    """Return the rows of a bidirectional test: deviation 1, 2, 3 up plus the run; 10 more down."""
    lines = []
    for run in range(1, runs + 1):
        lines += [f"{p * scale:g},{k + run},+,{run}" for k, p in enumerate(targets, start=1)]
        back = list(enumerate(targets, start=1))[::-1]
        lines += [f"{p * scale:g},{10 + k + run},-,{run}" for k, p in back]
    return lines


def written(tmp_path: Path, lines: list[str], heading: str = HEADING) -> Path:
    path = tmp_path / "y.csv"
    path.write_text("\n".join([heading, *lines]) + "\n", encoding="utf-8")
    return path


def test_both_directions(tmp_path: Path) -> None:
    (test,) = read(written(tmp_path, rows()))
    assert test.positions.tolist() == [0, 100, 200]
    assert test.up is not None
    assert test.down is not None
    assert test.up.tolist() == [[2, 3, 4], [3, 4, 5]]
    assert test.down.tolist() == [[12, 13, 14], [13, 14, 15]]
    assert (test.unit, test.axis, test.state) == ("um", "", "")


@pytest.mark.parametrize("order", ["given", "by target"])
def test_sorted_either_way(tmp_path: Path, order: str) -> None:
    lines = rows()
    if order == "by target":
        lines.sort(key=lambda line: float(line.split(",")[0]))
    (test,) = read(written(tmp_path, lines))
    assert test.down is not None
    assert test.down.tolist() == [[12, 13, 14], [13, 14, 15]]


def test_units_names_and_words(tmp_path: Path) -> None:
    lines = [line.replace("+", "up").replace("-", "down").replace(",", ";") for line in rows(scale=0.001)]
    (test,) = read(written(tmp_path, lines, "Y [m];Error (nm);Approach;Cycle"))
    assert test.axis == "Y"
    assert test.positions == pytest.approx([0, 100, 200])
    assert test.up is not None
    assert test.up[0] == pytest.approx([0.002, 0.003, 0.004])
    angle = written(tmp_path, rows(), "target_mm,deviation_arcsec,direction,run")
    (turned,) = read(angle)
    assert turned.unit == "urad"
    assert turned.up is not None
    assert turned.up[0, 0] == pytest.approx(2 * 4.848, rel=1e-3)


def test_states_and_axes(tmp_path: Path) -> None:
    lines = [f"{line},{state},{axis}" for state in ("cold", "after 4 h") for axis in "xy" for line in rows()]
    found = read(written(tmp_path, lines, f"{HEADING},state,axis"))
    assert [(t.axis, t.state) for t in found] == [("X", "cold"), ("Y", "cold"), ("X", "after 4 h"), ("Y", "after 4 h")]


def test_one_direction(tmp_path: Path) -> None:
    (test,) = read(written(tmp_path, [line for line in rows() if ",-," in line]))
    assert test.up is None
    assert test.down is not None
    assert np.shape(test.down) == (2, 3)


def test_a_single_run(tmp_path: Path) -> None:
    (test,) = read(written(tmp_path, rows(1)))
    assert test.down is not None
    assert test.down.tolist() == [[12, 13, 14]]


def changed(number: int, line: str) -> list[str]:
    lines = rows()
    lines[number] = line
    return lines


@pytest.mark.parametrize(
    ("lines", "heading", "told"),
    [
        (rows(), "position_mm,deviation_um,dir,run", "heading line: no column 'direction' among position_mm"),
        (rows(), "position_mm,deviation_um,direction,number", "no column 'run'"),
        (rows(), "position,deviation_um,direction,run", "heading line, column 'position': no unit"),
        (rows(), "position_mm,deviation_C,direction,run", "column 'deviation_C': unit 'C' measures temperature"),
        (
            [f"{line},1" for line in rows()],
            f"{HEADING},deviation_mm",
            "columns 'deviation_um' and 'deviation_mm' all contain a deviation: keep one, in one unit",
        ),
        (changed(1, "100,0.003 mm,+,1"), HEADING, "line 3, column 'deviation_um': '0.003 mm' is not a number"),
        (changed(1, "100,,+,1"), HEADING, "line 3, column 'deviation_um': is missing"),
        (changed(1, "100,3,,1"), HEADING, "line 3, column 'direction': is '': write"),
        (changed(1, "100,3,left,1"), HEADING, "line 3, column 'direction': is 'left'"),
        (changed(1, "100,3,+,"), HEADING, "line 3, column 'run': is missing"),
        (
            changed(1, "300,3,+,1"),
            HEADING,
            r"line 4, column 'position_mm': is unsorted: 200 mm reverses the direction after 300",
        ),
        (changed(1, "0,3,+,1"), HEADING, "line 3, column 'position_mm': is unsorted: 0 mm is repeated after 0 mm"),
        (rows()[1:], HEADING, "run 1 in this direction ends here without the target 0 mm"),
        (rows(targets=(50,)), HEADING, "1 target; positioning needs at least 2"),
        ([], HEADING, "no rows below it"),
    ],
)
def test_refusals(tmp_path: Path, lines: list[str], heading: str, told: str) -> None:
    path = written(tmp_path, lines, heading)
    with pytest.raises(InputError, match=told) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_no_such_file_and_other_kinds(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"read from one of \.csv"):
        read(tmp_path / "table.xlsx")
