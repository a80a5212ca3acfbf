"""Recordings as loggers, Excel, LibreOffice and Python write them: each is its plain CSV, to the last digit."""

from pathlib import Path

import numpy as np
import pytest

from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.readers.mending import read_or_offer
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

FOLDER = Path(__file__).parent / "recordings"
BEGIN = "2024-05-27T08:00:00"
CP1252, COMMA = "written in cp1252, not in UTF-8", "the decimal sign is a comma"

#: file: its plain CSV, when it begins, what was done
AT_ONCE: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "almemo.csv": ("short", BEGIN, (CP1252, "lines 1 to 3 above the headings are skipped", COMMA)),
    "benchlink.csv": (
        "full",
        BEGIN,
        (
            "written in UTF-16-LE",
            "lines 1 to 16 above the headings are skipped",
            "the header names: '201 <Spindle> (rpm)' is 'Spindle [rpm]', '101 <T1> (C)' is 'T1 [C]', "
            "'102 <T2> (C)' is 'T2 [C]', '103 <T3> (C)' is 'T3 [C]', '202 <Z> (um)' is 'Z [um]', "
            "'203 <Y> (um)' is 'Y [um]'",
            "the dates are month/day/year: '05/27/2024 08:00:00.000' is not a date otherwise",
        ),
    ),
    "catman.txt": (
        "full",
        "",
        (
            CP1252,
            "lines 1 to 4 above the headings are skipped",
            "between the headings and the table line 7 is skipped",
            "line 8 holds the units",
            "'Zeit  1 - Standardmessrate [s]' is taken as the time",
            COMMA,
        ),
    ),
    "graphtec.csv": (
        "gaps",
        BEGIN,
        (
            "lines 1 to 17 above the headings are skipped",
            "line 19 holds the units",
            "the header names: 'CH1 [rpm]' is 'Spindle [rpm]', 'CH2 [degC]' is 'Front [degC]', 'CH3 [degC]' is "
            "'Rear [degC]', 'CH4 [degC]' is 'Air [degC]', 'CH5 [um]' is 'Z [um]', 'CH6 [um]' is 'Y [um]'",
            "Front [degC]: 'BURNOUT', taken as missing, in 2 of 48 cells: line 27, line 28",
            "Air [degC]: 'BURNOUT', taken as missing, in 1 of 48 cells: line 40",
            "Z [um]: '+++++++', taken as missing, in 1 of 48 cells: line 51",
        ),
    ),
    "picolog.csv": ("full", BEGIN + "+02:00", ("column 1 has no heading and holds dates: taken as the time",)),
    "handheld.csv": (
        "gaps",
        BEGIN,
        (
            CP1252,
            "lines 1 to 2 above the headings are skipped",
            "lines 53 to 57 at the end are not part of the table, and left out",
            COMMA,
            "T1 [°C]: '---', taken as missing, in 2 of 48 cells: line 12, line 13",
            "T3 [°C]: '---', taken as missing, in 1 of 48 cells: line 25",
            "Z [µm]: '---', taken as missing, in 1 of 48 cells: line 36",
        ),
    ),
    "datataker.csv": ("full", BEGIN, ("not read, holding no numbers: TZ",)),
    "trace_pairs.csv": (
        "full",
        "",
        (
            "lines 1 to 3 above the headings are skipped",
            "columns 3, 5, 7, 9, 11 hold the same times as column 1",
        ),
    ),
    "labview.txt": ("short", "", ("lines 1 to 12 above the headings are skipped", COMMA)),
    "hioki.csv": (
        "gaps",
        "",
        (
            "written in shift_jis, not in UTF-8",
            "lines 1 to 3 above the headings are skipped",
            "CH2-1[℃]: 'OVER', taken as missing, in 2 of 48 cells: line 12, line 13",
        ),
    ),
    "fluke.csv": (
        "gaps",
        "2024-05-27T11:56:00",
        (
            "T1 (Deg C): 'OL', taken as missing, in 2 of 48 cells: line 9, line 10",
            "the dates are month/day/year: '5/27/2024 11:56:00 AM' is not a date otherwise",
        ),
    ),
    "swiss.csv": ("short", "", (CP1252, """thousands are separated by "'\"""")),
    "mac.txt": (
        "full",
        "",
        ("lines end as in files of old Macintoshes", "written in mac-roman, not in UTF-8", COMMA),
    ),
    "analyser.csv": (
        "mm",
        "",
        (
            "lines 1 to 3 above the headings are skipped",
            "line 6 holds the units",
            "line 56 at the end is not part of the table, and left out",
        ),
    ),
    "database.csv": ("full", BEGIN + "+00:00", ("'time' is taken as milliseconds since 1970-01-01 UTC",)),
    "excel_de.csv": ("short", BEGIN, (CP1252, COMMA, "thousands are separated by '.'")),
    "excel_en.csv": (
        "short",
        BEGIN,
        (
            "thousands are separated by ','",
            "the dates are month/day/year: '5/27/2024 8:00:00' is not a date otherwise",
        ),
    ),
    "excel_unicode.txt": ("short", BEGIN, ("written in UTF-16-LE", COMMA)),
    "excel_de.xlsx": (
        "gaps",
        BEGIN,
        (
            "sheet 'Messwerte' of 'Deckblatt', 'Messwerte' is read",
            "row 1 above the headings is skipped",
            "row 4 holds the units",
        ),
    ),
    "durations.xlsx": ("long", "", ()),
    "libreoffice.ods": (
        "nine",
        BEGIN,
        ("sheet 'Messung' of 'Messung', 'Notizen' is read", "row 1 above the headings is skipped"),
    ),
    "libreoffice_de.csv": ("short", BEGIN, (COMMA,)),
    "pandas.csv": (
        "full",
        "2024-10-27T02:56:00+02:00",
        ("column 1 has no heading and holds dates: taken as the time",),
    ),
    "pandas.parquet": (
        "full",
        "2024-10-27T02:56:00+02:00",
        ("the index has no name and holds times: taken as the time", "not read, holding no numbers: state"),
    ),
    "numpy.txt": ("full", "", ("line 1 holds the headings, behind '#'",)),
    "matlab.csv": ("full", BEGIN, ()),
}

#: file: its plain CSV, when it begins, what is asked, and the mapping that answers
ASKED: dict[str, tuple[str, str, str, str]] = {
    "slash_dates.csv": (
        "full",
        "2024-04-03T08:00:00",
        "line 2, column 'Date': '03/04/2024 08:00:00' can be read as day/month/year or month/day/year, and no row "
        "shows which (day/month/year: from 2024-04-03 08:00:00 to 2024-04-03 08:07:50, 0.13 h; month/day/year: from "
        "2024-03-04 08:00:00 to 2024-03-04 08:07:50, 0.13 h); "
        'state how it is written in a mapping: [time] column = "Time", date = "Date" and format = '
        '"%d/%m/%Y %H:%M:%S" or format = "%m/%d/%Y %H:%M:%S"',
        '[time]\ncolumn = "Time"\ndate = "Date"\nformat = "%d/%m/%Y %H:%M:%S"\n',
    ),
    "no_units.csv": (
        "full",
        "",
        "columns 'Speed', 'T1' have no unit: 'Speed' may be a spindle speed in rpm or Hz; append the unit to the "
        "name, "
        'such as "Speed [rpm]", or write a mapping [columns.NAME] with column = "Speed" and unit, or role = "ignore" '
        "if it "
        "is not needed",
        '[columns.speed_rpm]\ncolumn = "Speed"\nunit = "rpm"\n[columns.t1_C]\ncolumn = "T1"\nunit = "degC"\n',
    ),
    "twins.csv": (
        "full",
        "",
        "columns 3 and 4 are both named 'Bearing [°C]', columns 6 and 7 are both named 'Probe [µm]'; rename them, or "
        "name "
        "each by number in a mapping, such as [columns.NAME] column = 4",
        "[columns.front_C]\ncolumn = 3\n[columns.rear_C]\ncolumn = 4\n"
        "[columns.z_um]\ncolumn = 6\n[columns.y_um]\ncolumn = 7\n",
    ),
    "three_digits.csv": (
        "three",
        "",
        "'21,500' can be read as 21500 or as 21.500, and no other number shows which; state the decimal sign "
        "in a "
        'mapping: [read] decimal = "," or decimal = "."',
        '[read]\ndecimal = ","\n',
    ),
    "two_sheets.xlsx": (
        "nine",
        "",
        "the sheets 'before service', 'after service' all hold a table; state which in a mapping, such as [read] "
        'sheet = "before service"',
        '[read]\nsheet = "before service"\n',
    ),
}


def same(recording: Recording, plain: str, start: str) -> None:
    """Compare channel by channel, in the order of the columns; names are each file's own."""
    wanted = read(FOLDER / f"plain_{plain}.csv")
    assert [(c.quantity, c.unit) for c in recording.channels] == [(c.quantity, c.unit) for c in wanted.channels]
    assert np.array_equal(recording.time, wanted.time)
    assert np.array_equal(recording.table.to_numpy(), wanted.table.to_numpy(), equal_nan=True)
    assert recording.table.to_numpy().dtype == np.float64
    assert recording.start == start


def test_there_are_twenty_that_are_read_at_once_and_five_that_ask() -> None:
    assert (len(AT_ONCE) >= 20, len(ASKED)) == (True, 5)
    kept = {path.name for path in FOLDER.iterdir() if not path.name.startswith(("plain_", "README"))}
    assert kept == {*AT_ONCE, *ASKED}


@pytest.mark.parametrize("name", AT_ONCE)
def test_it_is_read_at_once_and_says_what_was_done(name: str) -> None:
    plain, start, notes = AT_ONCE[name]
    recording = read(FOLDER / name)
    same(recording, plain, start)
    assert [note for note in recording.notes if note in notes] == list(notes), recording.notes
    # what is not listed is a column that is left out, or one more word in place of a number
    others = [note for note in recording.notes if note not in notes]
    assert all(note.startswith(("left out: ", "not read, ")) or "taken as missing" in note for note in others), others


@pytest.mark.parametrize("name", ASKED)
def test_what_can_be_read_in_two_ways_is_asked_for(name: str, tmp_path: Path) -> None:
    plain, start, question, answer = ASKED[name]
    with pytest.raises(RecordingError) as caught:
        read_or_offer(FOLDER / name)
    assert str(caught.value) == f"{FOLDER / name}: {question}"
    (offer,) = caught.value.__notes__
    words, _, offered = offer.partition("\n\n")
    asks = isinstance(caught.value, TwoReadingsError)  # nothing is offered as the likely answer
    assert words.startswith("choose one" if asks else "this mapping reads it")
    for text in (answer,) if asks else (offered, answer):
        mapping = tmp_path / "mapping.toml"
        mapping.write_text(text, encoding="utf-8")
        same(read_or_offer(FOLDER / name, read_mapping(mapping)), plain, start)
