"""One layout of a table: on a terminal and on a page the same cells, each in its own way."""

import math

import pytest
from rich.console import Console

from thermocomp.cli.terminal import print_table
from thermocomp.judging.choice import Table
from thermocomp.report.html import environment
from thermocomp.report.layout import Column, Layout, Toned, laid_out

COLUMNS = (
    Column("model", "model"),
    Column("RMS", "rms", "um", "um"),
    Column("rows", lambda r: r["rows"], ">"),
    Column("", lambda r: Toned(r["word"], "bad")),
)
ROWS = [
    {"model": "a [b]", "rms": 123.456, "rows": 10, "word": "refused"},
    {"model": "<c>", "rms": -0.001, "rows": 2, "word": ""},
    {"model": "d", "rms": math.nan, "rows": 3, "word": ""},
]
TABLE = Layout(COLUMNS, ROWS, note="A note.", tones={0: "best"}, sections=frozenset({1}))


def printed(t: Layout, capsys: pytest.CaptureFixture[str], width: int = 80) -> str:
    print_table(t, Console(width=width, highlight=False))
    return capsys.readouterr().out


def drawn(t: Layout) -> str:
    module = environment().get_template("table.html").module
    return str(module.table(t))  # type: ignore[attr-defined]


def test_a_terminal_writes_the_unit_and_hundredths(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(TABLE, capsys).splitlines()
    cells = [[cell.strip() for cell in line.strip("│┃").replace("┃", "│").split("│")] for line in lines]
    assert cells[1] == ["model", "RMS, um", "rows", ""]
    assert cells[3] == ["a [b]", "123.46", "10", "refused"]
    assert lines[4].startswith("├")
    assert cells[5] == ["<c>", "0.00", "2", ""]
    assert cells[6] == ["d", "", "3", ""]
    assert lines[-1] == "A note."


def test_a_page_escapes_and_writes_no_more_than_makes_sense() -> None:
    page = drawn(TABLE)
    assert '<th class="l">model</th><th>RMS [µm]</th><th>rows</th>' in page
    assert '<tr class="best"><td class="l">a [b]</td><td>123</td><td>10</td>' in page
    assert '<td class="l">&lt;c&gt;</td><td>0.00</td>' in page
    assert "<td>–</td>" in page
    assert '<p class="soft">A note.</p>' in page


def test_a_narrow_terminal_cuts_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"t{k}_C" for k in range(12)]
    t = laid_out(Table("Sets", ("number", "MSE", "sensors"), ((1, 0.25, "t1_C"), (12, 0.01234567, " ".join(names))), 1))
    for width in (140, 40):
        shown = printed(t, capsys, width)
        assert "0.01235" in shown
        assert all(name in shown for name in names)
