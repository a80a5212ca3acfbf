"""Dates that lie beside a time without date in forms that no timestamp has: where they contradict it, they are told."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import openpyxl
import pytest

from thermocomp.cli.app import run
from thermocomp.core.exceptions import TwoReadingsError
from thermocomp.recordings.readers.mapping import check_content
from thermocomp.recordings.readers.recordings import read

DAY = timedelta(days=1)
#: tests on three days, of which the time runs on as if they were one
INSTANTS = [
    datetime(2024, month, day, 8) + timedelta(minutes=k) for month, day in ((3, 13), (3, 15), (4, 2)) for k in range(40)
]
EPOCH, SHEET = datetime(1970, 1, 1), datetime(1899, 12, 30)

Form = Callable[[datetime], str]


def form(letters: str) -> Form:
    return lambda t: t.strftime(letters)


#: that are dates at sight, whatever the heading is
PLAIN: dict[str, Form] = {
    "compact": form("%Y%m%d"),
    "compact with hours": form("%Y%m%d%H"),
    "compact with minutes": form("%Y%m%d%H%M"),
    "compact with seconds": form("%Y%m%d%H%M%S"),
    "epoch": lambda t: f"{(t - EPOCH).total_seconds():.0f}",
    "epoch with parts": lambda t: f"{(t - EPOCH).total_seconds():.3f}",
    "epoch in ms": lambda t: f"{(t - EPOCH).total_seconds() * 1000:.0f}",
    "ordinal": form("%Y-%j"),
    "week": form("%G-W%V-%u"),
    "week without year": form("W%V-%u"),
    "month": form("%d %b '%y"),
    "no year": form("%d.%m."),
    "month, no year": form("%d-%b"),
    "under": form("%Y_%m_%d"),
    "japanese": form("%Y年%m月%d日"),
    "weekday": form("%a"),
    "long weekday": form("%A"),
}
#: that are dates at sight beside times of day
BESIDE_CLOCKS: dict[str, Form] = {
    "with a word": form("%Y-%m-%d (%a)"),
    "with a shift": form("%d.%m.%Y early"),
    "name of a file": form("log_%Y-%m-%d.csv"),
    "number of a lot": form("%Y%m%d_1"),
    "number of a part": form("P%d%m%y"),
    "week and day": lambda t: f"KW{t.isocalendar()[1]}/{t.isoweekday()}",
}
#: that are only below a heading of a day
NAMED: dict[str, Form] = {
    "backwards": form("%d%m%Y"),
    "month first": form("%m%d%Y"),
    "short": form("%y%m%d"),
    "short backwards": form("%d%m%y"),
    "serial": lambda t: str((t - SHEET).days),
    "serial with time": lambda t: f"{(t - SHEET) / DAY:.6f}",
    "day of the year": lambda t: str(int(t.strftime("%j"))),
    "slashes": form("%m/%d"),
    "modified Julian day": lambda t: str((t - datetime(1858, 11, 17)).days),
    "Julian day": lambda t: f"{(t - datetime(1858, 11, 17)) / DAY + 2400000.5:.5f}",
}
FORMS = [(what, "lot", way) for what, way in PLAIN.items()] + [
    (what, heading, way) for what, way in {**PLAIN, **NAMED}.items() for heading in ("Tag", "Date", "Messdatum")
]


def write(
    path: Path, heading: str, way: Form, instants: list[datetime], times: list[str], name: str = "time_s"
) -> Path:
    rows = zip(instants, times, strict=True)
    lines = [f"{way(t)},{s},{20 + k / 9:.3f},{k / 5:.2f}" for k, (t, s) in enumerate(rows)]
    path.write_text("\n".join([f"{heading},{name},t1_C,z_um", *lines, ""]), encoding="utf-8")
    return path


RISING = [t + 2 * k * timedelta(hours=1) for k, t in enumerate(INSTANTS[::40])]


@pytest.mark.parametrize("what", BESIDE_CLOCKS)
def test_dates_among_words_are_refused_where_the_clock_passes_over_them(what: str, tmp_path: Path) -> None:
    """Every day a later hour: as one day the clock rises, and the days between are lost."""
    clocks = [f"{t:%H:%M:%S}" for t in RISING]
    path = write(tmp_path / "days.csv", "lot", BESIDE_CLOCKS[what], RISING, clocks, "time")
    with pytest.raises(TwoReadingsError, match="which is not the day"):
        read(path)
    assert run(["map", str(path), "--yes"]) == 2


@pytest.mark.parametrize("what", BESIDE_CLOCKS)
def test_dates_among_words_that_go_with_the_clock_say_nothing(what: str, tmp_path: Path) -> None:
    day = [datetime(2024, 3, 13, 8) + timedelta(minutes=k) for k in range(40)]
    path = write(tmp_path / "day.csv", "lot", BESIDE_CLOCKS[what], day, [f"{t:%H:%M:%S}" for t in day], "time")
    assert read(path).time[-1] == 39 * 60.0


RUNNING = [str(60 * k) for k in range(len(INSTANTS))]


@pytest.mark.parametrize(("what", "heading", "way"), FORMS, ids=[f"{w}-{h}" for w, h, _ in FORMS])
def test_dates_that_the_time_does_not_know_are_refused(what: str, heading: str, way: Form, tmp_path: Path) -> None:
    path = write(tmp_path / "days.csv", heading, way, INSTANTS, RUNNING)
    if heading == "Date" and what in ("epoch", "compact"):
        assert run(["map", str(path), "--yes", "-o", str(tmp_path / "days.toml")]) == 2
    with pytest.raises(TwoReadingsError, match=r"in line (42|82), which is not the day"):
        read(path)
    left = read(path, check_content({"columns": {heading: {"role": "ignore"}}}, "mapping"))
    assert left.time[-1] == pytest.approx(60 * (len(INSTANTS) - 1))
    assert any("left out, as the mapping specifies" in note for note in left.notes)


@pytest.mark.parametrize(("what", "heading", "way"), FORMS, ids=[f"{w}-{h}" for w, h, _ in FORMS])
def test_dates_that_go_with_the_time_are_not(what: str, heading: str, way: Form, tmp_path: Path) -> None:
    instants = [datetime(2024, 3, 13, 20) + timedelta(minutes=10 * k) for k in range(300)]
    times = [str(600 * k) for k in range(300)]
    assert read(write(tmp_path / "on.csv", heading, way, instants, times)).time[-1] == 600 * 299


@pytest.mark.parametrize("way", [PLAIN["compact"], PLAIN["epoch"], PLAIN["weekday"]])
def test_times_of_day_that_run_on_are_refused_too(way: Form, tmp_path: Path) -> None:
    clocks = [(datetime(2024, 3, 1, 8) + timedelta(minutes=k)).strftime("%H:%M:%S") for k in range(len(INSTANTS))]
    with pytest.raises(TwoReadingsError, match="which is not the day"):
        read(write(tmp_path / "days.csv", "lot", way, INSTANTS, clocks, "clock"))


@pytest.mark.parametrize("cell", [int, float])
def test_numbers_of_a_sheet_are_dates_too(cell: type, tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    book.active.append(["Tag", "time_s", "t1_C", "z_um"])
    for k, t in enumerate(INSTANTS):
        book.active.append([cell(t.strftime("%Y%m%d")), 60 * k, 20 + k / 9, k / 5])
    book.save(tmp_path / "days.xlsx")
    with pytest.raises(TwoReadingsError, match=r"contains 20240315 in row 42"):
        read(tmp_path / "days.xlsx")


@pytest.mark.parametrize(
    "cells",
    [
        [str(k) for k in range(120)],
        [str(45000 + 7 * (k % 11)) for k in range(120)],
        [f"{100000 + 913 * k}" for k in range(120)],
        [str(20241301 + 100 * k) for k in range(120)],
        ["part A"] * 60 + ["part B"] * 60,
        [f"P-{k // 10}" for k in range(120)],
        ["20240313"] * 120,
        [f"{1.5 + k / 7:.3f}" for k in range(120)],
    ],
)
def test_other_columns_are_none(cells: list[str], tmp_path: Path) -> None:
    there = iter(cells)
    path = write(tmp_path / "one.csv", "lot", lambda _: next(there), INSTANTS, RUNNING)
    assert read(path).time[-1] == 60 * (len(INSTANTS) - 1)


@pytest.mark.parametrize("heading", ["Tag", "lot"])
def test_the_best_guess_leaves_none_of_them_out(heading: str, tmp_path: Path) -> None:
    path = write(tmp_path / "days.csv", heading, PLAIN["compact"], INSTANTS, RUNNING)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "days.toml")]) == 2
    assert not (tmp_path / "days.toml").exists()
