"""Rows that hold a date between the tests of several days: nobody passes over them unasked."""

from pathlib import Path

import openpyxl
import pytest

from thermocomp.cli.app import run

ROWS = [(f"{8 + k // 12:02}:{k % 12 * 5:02}:00", f"{20 + k / 10:.1f}", f"{k / 2:.1f}") for k in range(40)]


def lines(first: str, second: str) -> str:
    text = [",".join(row) for row in ROWS]
    return "\n".join(["time,t1_C,z_um", *([first] if first else []), *text[:20], second, *text[20:]]) + "\n"


def map_of(path: Path, content: str) -> int:
    path.write_text(content, encoding="utf-8")
    return run(["map", str(path), "--yes", "-o", str(path.with_suffix(".toml"))])


@pytest.mark.parametrize("ending", ["", ",", ",,"])
@pytest.mark.parametrize(
    "date",
    [
        *(
            "15.03.2024",
            "2024-03-15",
            "03/15/24",
            "15. März 2024",
            "15 Mar '24",
            "Mar 15 2024",
            "20240315",
            "15-Mar-24",
        ),
        *("Datum: 15.03.2024", "Friday", "Tag 2", "--- 15.03.2024 ---"),
    ],
)
def test_a_row_with_a_date_is_not_passed_over_unasked(
    date: str, ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert map_of(tmp_path / "days.csv", lines("", date + ending)) == 2
    assert "line 22" in capsys.readouterr().err
    assert not (tmp_path / "days.toml").exists()


def test_nor_the_first_of_them(tmp_path: Path) -> None:
    assert map_of(tmp_path / "days.csv", lines("13.03.2024", "15.03.2024")) == 2


def test_nor_a_row_of_a_sheet(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    for line in lines("", "15.03.2024,,").splitlines():
        book.active.append([None if cell == "" else cell for cell in line.split(",")])
    book.save(tmp_path / "days.xlsx")
    assert run(["map", str(tmp_path / "days.xlsx"), "--yes", "-o", str(tmp_path / "days.toml")]) == 2


@pytest.mark.parametrize("row", [",,", "x,20.0,1.0", "pause", "09:40:00,20.0"])
def test_a_row_without_one_still_is(row: str, tmp_path: Path) -> None:
    assert map_of(tmp_path / "days.csv", lines("", row)) == 0


def test_a_row_of_a_column_of_dates_still_is(tmp_path: Path) -> None:
    rows = [f"2024-03-13,{','.join(row)}" for row in ROWS]
    content = "\n".join(["date,time,t1_C,z_um", *rows[:20], "2024-03-13,,20.0,1.0", *rows[20:]]) + "\n"
    assert map_of(tmp_path / "days.csv", content) == 0
