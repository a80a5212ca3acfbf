"""AM and PM in a column of their own, and dates that step by one day beside a time of day."""

from itertools import product
from pathlib import Path

import openpyxl
import pytest

from thermocomp.cli.app import run
from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.recordings.readers.mapping import check_content
from thermocomp.recordings.readers.mending import read_or_offer
from thermocomp.recordings.readers.recordings import read

MORNING, LATER = [f"08:0{k}:00" for k in range(1, 7)], [f"09:3{k}:00" for k in range(1, 7)]
HALF_DAY, WHOLE_DAY, SAME_DAY = (13 + 35 / 60) * 3600, (25 + 35 / 60) * 3600, 95 * 60


def write(path: Path, heading: str, cells: list[str], sign: str = ",") -> Path:
    rows = [sign.join([*cell.split(","), f"{20 + k / 9:.3f}", f"{k / 5:.2f}"]) for k, cell in enumerate(cells)]
    path.write_text("\n".join([sign.join([*heading.split(","), "T1_C", "z_um"]), *rows, ""]), encoding="utf-8")
    return path


def two(first: str, second: str, clocks: tuple[list[str], list[str]] = (MORNING, LATER)) -> list[str]:
    """Return rows of two stretches; ``#`` stands for the time of day."""
    return [way.replace("#", t) for way, some in zip((first, second), clocks, strict=True) for t in some]


HALVES = [
    ("Date,Time,AMPM", "2026-03-04,#,AM", "2026-03-04,#,PM"),
    ("Date,Time,AM/PM", "03/04/2026,#,a.m.", "03/04/2026,#,p.m."),
    ("Time,AM/PM", "#,am", "#,pm"),
    ("Time,AM PM", "#,A", "#,P"),
    ("Datum,Uhrzeit,Tageszeit", "04.03.2026,#,vorm.", "04.03.2026,#,nachm."),
    ("AM/PM,Time", "AM,#", "PM,#"),
    ("Fecha,Hora,m", "2026-03-04,#,a. m.", "2026-03-04,#,p. m."),
    ("timestamp,x", "2026-03-04 #,AM", "2026-03-04 #,PM"),
    ("Time,halb", "#,上午", "#,下午"),
]


@pytest.mark.parametrize(("heading", "first", "second"), HALVES)
@pytest.mark.parametrize("sign", [",", ";", "\t"])
def test_am_and_pm_of_a_column_of_their_own_count(
    heading: str, first: str, second: str, sign: str, tmp_path: Path
) -> None:
    path = write(tmp_path / "half.csv", heading, two(first, second), sign)
    if heading == "Date,Time,AM/PM":
        with pytest.raises(RecordingError, match="can be read as"):
            read(path)
        return
    assert read(path).time[-1] == pytest.approx(HALF_DAY)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "half.toml")]) == 0


def test_am_and_pm_go_over_noon_and_over_midnight(tmp_path: Path) -> None:
    noon = [f"{t},PM" for t in ("12:58:00", "12:59:00", "01:00:00", "01:01:00")]
    assert read(write(tmp_path / "noon.csv", "Time,AMPM", noon)).time.tolist() == [0, 60, 120, 180]
    night = ["11:59:00,PM", "12:00:00,AM", "00:01:00,AM", "12:02:00,AM"]
    assert read(write(tmp_path / "night.csv", "Time,AMPM", night)).time.tolist() == [0, 60, 120, 180]


def test_hours_and_minutes_beside_am_and_pm_are_not_asked_for(tmp_path: Path) -> None:
    short = ([t[:5] for t in MORNING], [t[:5] for t in LATER])
    assert read(write(tmp_path / "s.csv", "Time,AM/PM", two("#,am", "#,pm", short))).time[-1] == HALF_DAY


def test_am_and_pm_of_a_sheet_count(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    book.active.append(["Date", "Time", "AM/PM", "T1_C", "z_um"])
    for k, cell in enumerate(two("#,AM", "#,PM")):
        book.active.append(["2026-03-04", *cell.split(","), 20 + k / 9, k / 5])
    book.save(tmp_path / "half.xlsx")
    assert read(tmp_path / "half.xlsx").time[-1] == HALF_DAY


def test_cells_that_say_neither_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "half.csv", "Time,AM/PM", two("#,rano", "#,wieczór"))
    with pytest.raises(RecordingError, match="neither AM nor PM"):
        read(path)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "half.toml")]) == 2
    ignored = check_content({"columns": {"AM/PM": {"role": "ignore"}}}, "mapping")
    assert read(path, ignored).time[-1] == SAME_DAY


@pytest.mark.parametrize(
    ("heading", "words"),
    [("ampm", ("0", "1")), ("Half", ("1st", "2nd")), ("PM", ("False", "True")), ("am/pm", ("x", "y"))],
)
def test_a_column_that_may_say_am_and_pm_is_asked_for(heading: str, words: tuple[str, str], tmp_path: Path) -> None:
    path = write(tmp_path / "half.csv", f"Time,{heading}", two(f"#,{words[0]}", f"#,{words[1]}"))
    with pytest.raises(RecordingError, match="neither AM nor PM"):
        read(path)


def test_a_format_of_24_hours_does_not_pass_over_pm(tmp_path: Path) -> None:
    path = write(tmp_path / "half.csv", "Time,AM/PM", two("#,AM", "#,PM"))
    time = {"column": "Time", "format": "%H:%M:%S"}
    with pytest.raises(TwoReadingsError, match="24-hour time") as caught:
        read(path, check_content({"time": time}, "mapping"))
    assert read(path, check_content(dict(caught.value.remedies[0]), "mapping")).time[-1] == HALF_DAY


@pytest.mark.parametrize("words", [("früh", "spät"), ("mañana", "tarde"), ("AM", "PM"), ("run", "stop")])
def test_times_of_24_hours_stay_beside_shifts(words: tuple[str, str], tmp_path: Path) -> None:
    later = [f"14:0{k}:00" for k in range(6)]
    cells = two(f"#,{words[0]}", f"#,{words[1]}", (MORNING, later))
    assert read(write(tmp_path / "shift.csv", "Time,Schicht", cells)).time[-1] == 6 * 3600 + 240


def test_a_clock_of_twelve_hours_without_am_and_pm_is_named(tmp_path: Path) -> None:
    for heading, before in (("Time", ""), ("Date,Time", "2026-03-04,")):
        cells = [before + t for t in ("12:57:00", "12:58:00", "12:59:00", "01:00:00", "01:01:00")]
        path = write(tmp_path / "noon.csv", heading, cells)
        with pytest.raises(TwoReadingsError, match="AM and PM"):
            read(path)
        assert run(["map", str(path), "--yes", "-o", str(tmp_path / "noon.toml")]) == 2


DAYS = [
    *(("04 Mar", "05 Mar"), ("Mar 04", "Mar 05"), ("04-Mar", "05-Mar"), ("04/03", "05/03"), ("3/4", "3/5")),
    *(("Wed", "Thu"), ("Mi", "Do"), ("mercredi", "jeudi"), ("mercoledì", "giovedì"), ("środa", "czwartek")),
    *(("Day 1", "Day 2"), ("Tag 1", "Tag 2"), ("04.03.", "05.03."), ("20260304", "20260305")),
    *(("Day one", "Day two"), ("1. Tag", "2. Tag")),
    *(("2026-W10-3", "2026-W10-4"), ("2026-063", "2026-064"), ("4. März", "5. März"), ("04 mars", "05 mars")),
]


@pytest.mark.parametrize(("days", "heading"), list(product(DAYS, ("Run", "Run date", "Messtag"))))
def test_one_day_later_beside_a_time_of_day_is_no_hour_later(
    days: tuple[str, str], heading: str, tmp_path: Path
) -> None:
    path = write(tmp_path / "days.csv", f"{heading},Time", two(f"{days[0]},#", f"{days[1]},#"))
    if days[0] == "20260304" and heading != "Run":
        assert read(path).time[-1] == WHOLE_DAY
        return
    if (days[0], heading) == ("1. Tag", "Run"):
        return  # runs may be counted so
    with pytest.raises(TwoReadingsError, match="in line 8, which is not the day"):
        read(path)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "days.toml")]) == 2
    given = check_content({"time": {"column": "Time", "format": "%H:%M:%S"}}, "mapping")
    with pytest.raises(TwoReadingsError, match="which is not the day"):
        read(path, given)


@pytest.mark.parametrize(("days", "heading"), list(product(DAYS, ("Run", "Messtag"))))
def test_days_that_change_at_midnight_are_not_asked_for(days: tuple[str, str], heading: str, tmp_path: Path) -> None:
    clocks = ([f"23:5{k}:00" for k in range(10)], [f"00:0{k}:00" for k in range(10)])
    path = write(tmp_path / "night.csv", f"{heading},Time", two(f"{days[0]},#", f"{days[1]},#", clocks))
    assert read(path).time[-1] == 19 * 60


def test_a_counter_of_days_counts_and_one_of_runs_does_not(tmp_path: Path) -> None:
    with pytest.raises(TwoReadingsError, match="which is not the day"):
        read(write(tmp_path / "d.csv", "Test day,Time", two("1,#", "2,#")))
    other = [("Run", "1", "2"), ("Step", "Step 1", "Step 2"), ("Part", "1/2", "2/2"), ("Update", "ok", "late")]
    for heading, first, second in (*other, ("Datum X", "A", "B"), ("Phase", "warm-up", "cool-down")):
        path = write(tmp_path / "r.csv", f"Time,{heading}", two(f"#,{first}", f"#,{second}"))
        assert read(path).time[-1] == SAME_DAY


def test_times_that_passed_may_run_on_through_a_day(tmp_path: Path) -> None:
    clocks = ([f"{h:02}:00:00" for h in range(4)], [f"{h:02}:00:00" for h in range(4, 9)])
    for heading in ("Elapsed time", "Time"):
        path = write(tmp_path / "p.csv", f"Weekday,{heading}", two("Wed,#", "Thu,#", clocks))
        assert read(path).time[-1] == 8 * 3600


SHORT = ([t[:5] for t in MORNING], [t[:5] for t in LATER])


def test_dates_of_digits_alone_are_read_beside_hours_and_minutes(tmp_path: Path) -> None:
    path = write(tmp_path / "d.csv", "Messtag,Zeit", two("20260304,#", "20260305,#", SHORT))
    assert (read(path).time[-1], read(path).start) == (WHOLE_DAY, "2026-03-04T08:01:00")
    said = {"column": "Zeit", "date": "Messtag", "format": "%Y%m%d %H:%M"}
    assert read(path, check_content({"time": said}, "mapping")).time[-1] == WHOLE_DAY
    book = openpyxl.Workbook()
    assert book.active is not None
    book.active.append(["Messtag", "Zeit", "T1_C", "z_um"])
    for k, cell in enumerate(two("20260304,#", "20260305,#", SHORT)):
        book.active.append([int(cell[:8]), cell[9:], 20 + k / 9, k / 5])
    book.save(tmp_path / "d.xlsx")
    for mapping in (None, check_content({"time": said}, "mapping")):
        assert read(tmp_path / "d.xlsx", mapping).time[-1] == WHOLE_DAY


def test_a_format_of_the_time_alone_loses_no_date(tmp_path: Path) -> None:
    path = write(tmp_path / "d.csv", "Date,Time", two("2026-03-04,#", "2026-03-05,#", SHORT))
    said = {"time": {"column": "Time", "format": "%H:%M"}}
    with pytest.raises(TwoReadingsError, match="in line 8, which is not the day"):
        read(path, check_content(said, "mapping"))
    left = read(path, check_content({**said, "columns": {"Date": {"role": "ignore"}}}, "mapping"))
    assert left.time[-1] == SAME_DAY
    assert any("left out, as the mapping specifies" in note for note in left.notes)


def test_a_format_that_passes_over_the_day_loses_no_date(tmp_path: Path) -> None:
    path = write(tmp_path / "d.csv", "Day,Time", two("Wed,#", "Thu,#"))
    said = {"time": {"column": "Time", "date": "Day", "format": "%a %H:%M:%S"}}
    with pytest.raises(TwoReadingsError, match="which is not the day"):
        read(path, check_content(said, "mapping"))


@pytest.mark.parametrize(
    ("days", "form"), [(("04.03.", "05.03."), "%d.%m."), (("04-Mar", "05-Mar"), "%d-%b"), (("Mar 4", "Mar 5"), "%b %d")]
)
def test_the_format_that_is_offered_fits(days: tuple[str, str], form: str, tmp_path: Path) -> None:
    path = write(tmp_path / "d.csv", "Date,Time", two(f"{days[0]},#", f"{days[1]},#"))
    with pytest.raises(RecordingError, match="state how it is written") as caught:
        read_or_offer(path)
    assert caught.value.remedies[0]["time"]["format"] == f"{form} %H:%M:%S"
    mended = read(path, check_content(dict(caught.value.remedies[0]), "mapping"))
    assert (mended.time[-1], mended.start) == (WHOLE_DAY, "")


def test_no_format_is_offered_that_does_not_fit(tmp_path: Path) -> None:
    with pytest.raises(TwoReadingsError, match=r'format = "%M:%S.%f"'):
        read(write(tmp_path / "m.csv", "Time", [f"00:{k}0.0" for k in range(6)]))
    with pytest.raises(RecordingError, match=r"and format, in the letters of strptime; if 'Day' holds no dates"):
        read(write(tmp_path / "w.csv", "Day,Time", two("Wed,#", "Thu,#")))


def test_a_date_in_the_first_row_of_each_day_alone_is_missing_in_the_others(tmp_path: Path) -> None:
    cells = [
        f"{day if k == 0 else ''},{t}" for day, c in zip("45", (MORNING, LATER), strict=True) for k, t in enumerate(c)
    ]
    cells = [c if c.startswith(",") else f"2026-03-0{c}" for c in cells]
    with pytest.raises(RecordingError, match=r"line 3, column 'Date': the date is missing \(in 10 rows, of 12\)"):
        read(write(tmp_path / "d.csv", "Date,Time", cells))


def test_a_clock_set_back_while_nothing_was_recorded_is_named(tmp_path: Path) -> None:
    cells = [f"2026-10-25 0{k // 60}:{k % 60:02}:00" for k in (*range(0, 166, 2), *range(140, 220, 2))]
    path = write(tmp_path / "back.csv", "timestamp", cells)
    with pytest.raises(RecordingError, match=r"line 85.*daylight saving"):
        read(path)


def test_map_names_the_row_that_check_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cells = [f"{t}" for t in (*range(100, 200), *range(50, 150))]
    path = write(tmp_path / "fall.csv", "time_s", cells)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "fall.toml")]) == 2
    assert "line 102, column" in capsys.readouterr().err


def test_a_time_in_five_columns_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "p.csv", "Year,Month,Day,Hour,Minute", [f"2026,3,4,8,{k}" for k in range(6)])
    with pytest.raises(RecordingError, match="is split over 5 columns, Year, Month, Day, Hour, Minute") as caught:
        read(path)
    assert not caught.value.remedies


def test_names_of_cycles_are_no_days(tmp_path: Path) -> None:
    """Three tests of a day each, one behind the other on a time that leaves the nights out."""
    rows = [f"{k * 600},day {1 + k // 4}" for k in range(12)]
    path = write(tmp_path / "cycles.csv", "time_s,cycle", rows)
    assert read(path).time[-1] == 6600.0
    assert len(read(path).cycles) == 3
