"""Workbooks as people keep them: a cover sheet, title lines, a row of units, a remark in the last column."""

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from itertools import permutations
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from openpyxl import Workbook

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.mapping import Mapping, ReadOptions
from thermocomp.recordings.readers.mending import mend, take_best
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

Rows = Sequence[Sequence[Any]]
COVER: Rows = [
    ["Warmlaufversuch BAZ MX500"],
    ["Prüfer", "K. Hartmann"],
    ["Datum", "16.03.2026"],
    ["Drehzahl", 6000],
    ["Bemerkung", "Taster im Spindelnest, Kühlung Stufe 2"],
]
SETTINGS: Rows = [["Parameter", "Wert"], *([f"P{k}", 100 + k] for k in range(40))]
TITLES: tuple[Rows, ...] = ([], [["Messprotokoll"]], [["Messprotokoll MX500"], ["Seriennr.:", "MX500-0417"], []])
LINES: Rows = [["Protokoll"], ["Maschine", "MX 500"], ["Nr.", 17], [], ["a", "b", "c"]]
HEADINGS = ["Datum", "Uhrzeit", "Drehzahl", "Verlagerung Z", "Lager vorn", "Halle"]
UNITS = ["", "", "1/min", "µm", "°C", "°C"]


def table(rows: int, text: Callable[[float], Any], remarks: dict[int, str]) -> list[list[Any]]:
    begin, found = datetime(2026, 3, 16, 7, 4), list[list[Any]]()
    for k in range(rows):
        at = begin + timedelta(minutes=k)
        values = [text(k / 10), text(20 + k / 20), text(21.5)]
        found.append([at.strftime("%d.%m.%Y"), at.strftime("%H:%M:%S"), 3000, *values, *remarks.get(k, "").split("|")])
    return found


def german(value: float) -> str:
    return f"{value:.2f}".replace(".", ",")


def save(path: Path, sheets: dict[str, Rows]) -> Path:
    book = Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append([None if cell == "" else cell for cell in row])
    book.save(path)
    return path


def check(found: Recording, rows: int) -> None:
    assert len(found) == rows
    assert [c.name for c in found.channels] == ["Drehzahl_rpm", "Verlagerung_Z_um", "Lager_vorn_C", "Halle_C"]
    assert found.table["Verlagerung_Z_um"].iloc[-1] == pytest.approx((rows - 1) / 10, abs=0.006)
    assert (found.time[-1], float(found.table["Drehzahl_rpm"].max())) == (60.0 * (rows - 1), 3000.0)


@pytest.mark.parametrize("place", range(3), ids=["first", "second", "last"])
@pytest.mark.parametrize("titles", TITLES, ids=["no title", "a title", "title, serial number"])
@pytest.mark.parametrize("remark", ["", "Bemerkung"], ids=["plain", "remarks"])
def test_the_sheet_with_the_table_is_read(tmp_path: Path, place: int, titles: Rows, remark: str) -> None:
    remarks = {57: "Türe geöffnet"} if remark else {}
    table_rows = [*titles, [*HEADINGS, *filter(None, [remark])], UNITS, *table(120, german, remarks)]
    sheets: list[tuple[str, Rows]] = [("Deckblatt", COVER), ("Einstellungen", SETTINGS)]
    sheets.insert(place, ("Messdaten", table_rows))
    found = read(save(tmp_path / "warmlauf.xlsx", dict(sheets)))
    check(found, 120)
    assert f"sheet 'Messdaten' of {', '.join(repr(name) for name, _ in sheets)} is read" in found.notes


@given(
    rows=st.integers(8, 140),
    titles=st.lists(
        st.sampled_from([["Protokoll"], ["Maschine", "MX 500"], ["Nr.", 17], [], ["a", "b", "c"]]), max_size=8
    ),
    numbers=st.booleans(),
    remarks=st.dictionaries(st.integers(0, 139), st.sampled_from(["Pause", "Tür auf|siehe Blatt 2"]), max_size=4),
)
def test_what_stands_around_a_table_is_no_part_of_it(
    tmp_path_factory: pytest.TempPathFactory, rows: int, titles: Rows, numbers: bool, remarks: dict[int, str]
) -> None:
    body = table(rows, float if numbers else german, remarks)
    path = save(
        tmp_path_factory.mktemp("book") / "a.xlsx", {"Daten": [*titles, [*HEADINGS, "Bemerkung"], UNITS, *body]}
    )
    check(read(path), rows)


def test_two_tables_with_times_are_asked_about(tmp_path: Path) -> None:
    tables = {name: [HEADINGS, UNITS, *table(rows, float, {})] for name, rows in (("Mo", 15), ("Di", 80), ("Kurz", 9))}
    for order in permutations(tables):
        path = save(tmp_path / f"{'-'.join(order)}.xlsx", {name: tables[name] for name in order})
        with pytest.raises(RecordingError, match="all hold a table") as raised:
            read(path)
        offered = [remedy["read"]["sheet"] for remedy in raised.value.remedies]
        assert offered == [name for name in order if name != "Kurz"]
        check(read(path, Mapping(read=ReadOptions(sheet="Kurz"))), 9)


def test_rows_that_are_skipped_are_told(tmp_path: Path) -> None:
    body = table(40, german, {})
    path = save(tmp_path / "a.xlsx", {"Daten": [HEADINGS, UNITS, *body[:20], ["Umbau am Taster", 3], *body[20:]]})
    mended = mend(path, "", take_best)
    assert len(mended.recording) == 40
    assert "rows skipped by the mapping: 23" in mended.recording.notes


@pytest.mark.parametrize("word", ["n.v.", "k.A.", "N/A"])
def test_a_word_for_no_value_costs_no_row(tmp_path: Path, word: str) -> None:
    body = table(60, german, {})
    body[30][4] = word
    found = read(save(tmp_path / "a.xlsx", {"Daten": [HEADINGS, UNITS, *body]}))
    check(found, 60)
    assert found.table["Lager_vorn_C"].isna().sum() == 1
