"""The order of day and month is that in which a recording continues; where several do, it is asked for."""

from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError, TwoReadingsError
from thermocomp.recordings.readers.mapping import Mapping, TimeColumn, check_content
from thermocomp.recordings.readers.mending import read_or_offer
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

#: how dates are written of which day and month cannot be told apart
SLASHES = ("%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%d/%m/%y", "%m/%d/%y", "%y/%m/%d", "%y-%m-%d")
#: the last one nobody writes
POINTS = ("%d.%m.%Y", "%d.%m.%y", "%y.%m.%d", "%m.%d.%Y")
CLOCKS = (" %H:%M:%S", " %H:%M", " %I:%M:%S %p", ",%H:%M:%S")


def series(begin: datetime, step: timedelta, count: int) -> list[datetime]:
    return [begin + k * step for k in range(count)]


def written(path: Path, instants: list[datetime], form: str) -> Path:
    """Write a recording; a comma in the format parts date and time of day."""
    heading = "Date,Time" if "," in form else "Timestamp"
    rows = "".join(f"{t.strftime(form)},{20 + k % 40 / 10:.1f},{k % 40 / 5:.1f}\n" for k, t in enumerate(instants))
    path.write_text(f"{heading},t1_C,z_um\n{rows}", encoding="utf-8")
    return path


def seconds(instants: list[datetime]) -> list[float]:
    return [(t - instants[0]).total_seconds() for t in instants]


def as_it_was(recording: Recording, instants: list[datetime]) -> None:
    np.testing.assert_allclose(recording.time, seconds(instants), rtol=0, atol=1e-6)
    assert recording.start == instants[0].isoformat()


OVER_NIGHT = series(datetime(2024, 3, 5, 20, 20), timedelta(minutes=24), 60)
#: five days in a row, eight hours each
DAYS = [t for d in range(4, 9) for t in series(datetime(2024, 3, d, 8), timedelta(minutes=30), 17)]


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("form", [*SLASHES, *POINTS])
def test_rows_that_go_on_over_midnight_tell_the_order(form: str, clock: str, tmp_path: Path) -> None:
    as_it_was(read(written(tmp_path / "night.csv", OVER_NIGHT, form + clock)), OVER_NIGHT)


def months(begin: datetime, count: int) -> list[datetime]:
    return [begin.replace(month=begin.month + k) + timedelta(minutes=k) for k in range(count)]


@pytest.mark.parametrize("form", SLASHES[:6])
@pytest.mark.parametrize(
    "instants", [series(datetime(2024, 2, 1, 7), timedelta(days=1), 12), months(datetime(2024, 4, 1, 8), 7)]
)
def test_one_row_a_day_may_be_one_a_month(instants: list[datetime], form: str, tmp_path: Path) -> None:
    """The days of a month, each first of which follows another: 01/04, 01/05 ... of any machine that is measured."""
    path = written(tmp_path / "rare.csv", instants, f"{form} %H:%M")
    with pytest.raises(TwoReadingsError, match="no row shows which"):
        read(path)
    assert run(["map", str(path), "--yes"]) == 2


@pytest.mark.parametrize(("heading", "form"), [("Time [dd/mm/yyyy]", "%m/%d/%Y"), ("Timestamp", "%Y-%d-%m")])
def test_an_order_that_is_stated_and_breaks_the_recording_is_asked_for(heading: str, form: str, tmp_path: Path) -> None:
    night = series(datetime(2024, 3, 5, 20), timedelta(minutes=5), 100)
    path = written(tmp_path / "night.csv", night, f"{form} %H:%M")
    path.write_text(path.read_text("utf-8").replace("Timestamp", heading), "utf-8")
    with pytest.raises(TwoReadingsError, match="no row shows which"):
        read(path)
    as_it_was(read(path, Mapping(time=TimeColumn(heading, format=f"{form} %H:%M"))), night)


@pytest.mark.parametrize("form", SLASHES)
def test_several_rows_on_each_of_some_days_do_not(form: str, tmp_path: Path) -> None:
    """Tests on the same day of several months look alike."""
    path = written(tmp_path / "days.csv", DAYS, f"{form} %H:%M")
    with pytest.raises(TwoReadingsError, match="no row shows which"):
        read(path)
    assert run(["map", str(path), "--yes"]) == 2
    as_it_was(read(path, Mapping(time=TimeColumn("Timestamp", format=f"{form} %H:%M"))), DAYS)


@pytest.mark.parametrize("form", ["%d/%m/%Y", "%m/%d/%y"])
def test_a_late_proof_is_one(form: str, tmp_path: Path) -> None:
    """Two tests with a pause between them say nothing, but the second goes over midnight."""
    instants = series(datetime(2024, 3, 5, 8), timedelta(minutes=10), 40)
    instants += series(datetime(2024, 3, 7, 18), timedelta(minutes=10), 50)
    recording = read(written(tmp_path / "late.csv", instants, f"{form} %H:%M"))
    as_it_was(recording, instants)
    assert any("a gap of 30 days would lie between two rows that follow each other" in n for n in recording.notes)


def test_uneven_rows_and_a_short_pause_at_midnight_tell_it_too(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    passed = np.cumsum(rng.uniform(5, 1200, 200))
    instants = [datetime(2024, 4, 9, 12) + timedelta(seconds=int(s)) for s in passed]
    as_it_was(read(written(tmp_path / "uneven.csv", instants, "%m/%d/%Y %H:%M:%S")), instants)
    paused = series(datetime(2024, 4, 9, 22), timedelta(seconds=1), 7000)
    paused += series(datetime(2024, 4, 10, 0, 8), timedelta(seconds=1), 600)
    as_it_was(read(written(tmp_path / "paused.csv", paused, "%d/%m/%Y %H:%M:%S")), paused)


def two_days(path: Path, form: str = "%m/%d/%Y") -> Path:
    days = [t for d in (5, 6) for t in series(datetime(2024, 3, d, 8), timedelta(minutes=30), 17)]
    return written(path, days, f"{form} %H:%M")


def test_two_days_with_a_pause_may_be_a_month_apart_and_are_asked_for(tmp_path: Path) -> None:
    with pytest.raises(TwoReadingsError) as caught:
        read_or_offer(two_days(tmp_path / "two.csv"))
    said = str(caught.value)
    assert "day/month/year: from 2024-05-03 08:00:00 to 2024-06-03 16:00:00, 752.00 h" in said
    assert "month/day/year: from 2024-03-05 08:00:00 to 2024-03-06 16:00:00, 32.00 h" in said
    assert '[time] column = "Timestamp" and format = "%d/%m/%Y %H:%M" or format = "%m/%d/%Y %H:%M"' in said
    (offer,) = caught.value.__notes__
    assert offer.startswith("choose one, save it as two.toml")
    lines = offer.split("\n\n")[1].splitlines()
    assert all(line.startswith("# ") for line in lines)
    assert '# format = "%m/%d/%Y %H:%M"' in lines


@pytest.mark.parametrize("command", ["check", "map"])
def test_no_command_guesses_how_long_a_recording_took(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = two_days(tmp_path / "two.csv"), tmp_path / "two.toml"
    assert run([command, str(path), *(["--yes", "-o", str(output)] if command == "map" else [])]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert all(part in said for part in ("752.00 h", "32.00 h", "[time]"))
    assert not output.exists()


def test_minutes_and_seconds_are_not_taken_for_hours_and_minutes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "short.csv"
    path.write_text("Zeit,t1_C,z_um\n" + "".join(f"00:{k:02},20.{k},{k}\n" for k in range(30)), encoding="utf-8")
    assert run(["map", str(path), "--yes"]) == 2
    assert "hours and minutes or as minutes and seconds" in " ".join(capsys.readouterr().err.split())


def test_a_single_day_is_asked_for_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The duration is the same either way, but not that of the next test of this logger, read by the same mapping."""
    day = series(datetime(2024, 3, 5, 8), timedelta(minutes=10), 48)
    path, output = written(tmp_path / "day.csv", day, "%d/%m/%Y %H:%M"), tmp_path / "day.toml"
    with pytest.raises(TwoReadingsError, match=r"day/month/year or month/day/year, and no row shows which \(.*7\.83 h"):
        read(path)
    assert run(["map", str(path), "--yes", "-o", str(output)]) == 2
    assert '"%m/%d/%Y %H:%M"' in " ".join(capsys.readouterr().err.split())
    assert not output.exists()


def test_a_question_without_a_likely_answer_has_none_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answers = iter(["", "2", *["0"] * 20])
    monkeypatch.setattr("builtins.input", lambda: next(answers))
    assert run(["map", str(two_days(tmp_path / "two.csv"))]) == 0
    said = capsys.readouterr()
    assert "expected a number from 0 to 2" in said.err
    assert "%m/%d/%Y" in said.out


@pytest.mark.parametrize(
    ("stamps", "asks"),
    [
        # automatic checks on the first of each month are four days of January otherwise
        ([f"01/0{m}/2024 {h:02}:00" for m in range(5, 9) for h in (8, 9, 10)], True),
        ([f"01/0{m}/2024 08:00" for m in range(5, 9)], True),
        (["03/04/2024 08:00", "03/05/2024 08:00", "03/06/2024 08:00"], True),
        (["24.05.03 08:00", "24.05.03 09:00", "24.05.06 08:00"], True),
        (["19.01.01 06:00", "19.01.02 06:10", "19.02.02 06:20"], True),
        (["05/05/2024 08:00", "05/05/2024 09:00", "06/06/2024 08:00"], False),
        (["03.05.24 08:00", "03.05.24 09:00", "06.05.24 08:00"], False),
        (["03.05.2024 08:00", "03.06.2024 08:00", "03.07.2024 08:00", "03.08.2024 08:00"], False),
        (["24.12.31 23:50", "25.01.01 00:00", "25.01.01 00:10"], False),
    ],
)
def test_nothing_is_read_that_may_be_otherwise(stamps: list[str], asks: bool, tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    path.write_text("Time,t1_C\n" + "".join(f"{s},20.{k}\n" for k, s in enumerate(stamps)), encoding="utf-8")
    if asks:
        with pytest.raises(TwoReadingsError, match="can be read as"):
            read(path)
    else:
        assert len(read(path)) == len(stamps)


def test_points_put_the_day_first_unless_rows_go_on_otherwise(tmp_path: Path) -> None:
    tests = [t for m in (5, 6) for t in series(datetime(2024, m, 3, 8), timedelta(minutes=30), 17)]
    as_it_was(read(written(tmp_path / "points.csv", tests, "%d.%m.%Y %H:%M")), tests)


def test_a_row_of_units_may_state_the_order(tmp_path: Path) -> None:
    path = tmp_path / "units.csv"
    rows = "".join(f"03/0{d}/2024,0{h}:00:00,20.{h},{h}\n" for d in (5, 6) for h in (7, 8, 9))
    path.write_text("Date,Time,T1,Z\nmm/dd/yyyy,hh:mm:ss,degC,um\n" + rows, encoding="utf-8")
    recording = read(path)
    assert (recording.time[-1], recording.start) == (26 * 3600, "2024-03-05T07:00:00")


#: three days with pauses, of which no row shows the order
PAUSED = [t for d in (5, 6, 7) for t in series(datetime(2024, 3, d, 8), timedelta(minutes=5), 40)]


@pytest.mark.parametrize(
    ("said", "form"),
    [
        ("yyyy-dd-mm", "%Y-%d-%m %H:%M"),
        ("YYYY-DD-MM HH:MM", "%Y-%d-%m %H:%M"),
        ("yyyy-dd-mmThh:mm:ss", "%Y-%d-%mT%H:%M:%S"),
        ("JJJJ/TT/MM", "%Y/%d/%m %H:%M"),
        ("yy-dd-mm", "%y-%d-%m %H:%M"),
        ("yyyy/dd/mm", "%Y/%d/%m,%H:%M"),
        ("yyyy-dd-mm", "%Y-%d-%m,%H:%M:%S"),
        ("mm/dd/yyyy", "%m/%d/%Y %H:%M"),
        ("mm.dd.yyyy", "%m.%d.%Y,%H:%M"),
    ],
)
@pytest.mark.parametrize("below", [True, False])
def test_an_order_that_is_stated_applies(said: str, form: str, below: bool, tmp_path: Path) -> None:
    path = written(tmp_path / "stated.csv", PAUSED, form)
    headings, rows = path.read_text("utf-8").split("\n", 1)
    first, *others = headings.split(",")
    if below:
        clock = ["hh:mm"] if "," in form else []
        headings = "\n".join(
            (",".join((first, *others[: len(clock)], "T1", "Z")), ",".join((said, *clock, "degC", "um")))
        )
    else:
        headings = ",".join((f"{first} ({said})", *others))
    path.write_text(f"{headings}\n{rows}", "utf-8")
    recording = read(path)
    as_it_was(recording, PAUSED)
    assert any("as the heading specifies" in note for note in recording.notes)


def test_year_day_month_that_breaks_the_recording_is_asked_for(tmp_path: Path) -> None:
    night = series(datetime(2024, 3, 5, 20), timedelta(minutes=5), 100)
    path = written(tmp_path / "night.csv", night, "%Y-%m-%d %H:%M")
    path.write_text(path.read_text("utf-8").replace("Timestamp", "Time (yyyy-dd-mm)"), "utf-8")
    with pytest.raises(TwoReadingsError, match=r"year/day/month.* or year/month/day.*8\.25 h"):
        read(path)
    assert run(["map", str(path), "--yes"]) == 2


def test_a_stated_order_in_which_time_falls_is_asked_for(tmp_path: Path) -> None:
    """The tests are of 7 March and 5 April; by the heading, of 3 July and 4 May."""
    days = [t for m in (3, 4) for t in series(datetime(2024, m, 13 - 2 * m, 8), timedelta(minutes=5), 5)]
    path = written(tmp_path / "falls.csv", days, "%m/%d/%Y %H:%M")
    path.write_text(path.read_text("utf-8").replace("Timestamp", "Time (dd/mm/yyyy)"), "utf-8")
    with pytest.raises(TwoReadingsError, match="day/month/year or month/day/year"):
        read(path)


@pytest.mark.parametrize(("said", "form"), [("dd/mm/yyyy", "%m/%d/%Y %H:%M"), ("yyyy-dd-mm", "%Y-%m-%d %H:%M")])
def test_no_row_is_skipped_because_of_a_wrong_heading(said: str, form: str, tmp_path: Path) -> None:
    """The 13th of a month is no date in the order that is stated, the rows before it are."""
    days = [t for d in (11, 12, 13) for t in series(datetime(2024, 3, d, 8), timedelta(hours=1), 4)]
    path = written(tmp_path / "wrong.csv", days, form)
    path.write_text(path.read_text("utf-8").replace("Timestamp", f"Time ({said})"), "utf-8")
    with pytest.raises(TwoReadingsError, match=r"'.*13.*' is not \w+/\w+/\w+, which the heading specifies") as caught:
        read(path)
    as_it_was(read(path, check_content(dict(caught.value.remedies[0]), "m")), days)
    assert run(["map", str(path), "--yes"]) == 2


@pytest.mark.parametrize("points", [False, True])
@pytest.mark.parametrize("two", [False, True])
def test_heading_and_row_of_units_that_disagree(points: bool, two: bool, tmp_path: Path) -> None:
    """Rows that continue decide, with a note; else it is asked for."""
    path = tmp_path / "both.csv"
    said = ("dd/mm/yyyy", "mm/dd/yyyy")
    for heading, unit in (said, said[::-1]):
        for instants, asks in ((PAUSED, True), (OVER_NIGHT, False)):
            for form in ("%m/%d/%Y", "%d/%m/%Y"):
                rows = "".join(
                    f"{t.strftime(form)}{',' if two else ' '}{t:%H:%M},{20 + k / 9:.2f},{k}\n"
                    for k, t in enumerate(instants)
                )
                clock = ("Time,", "hh:mm,") if two else ("", "")
                head = f"Date ({heading}),{clock[0]}T1,Z\n{unit},{clock[1]}degC,um\n"
                path.write_text((head + rows).replace("/", "." if points else "/"), "utf-8")
                if not asks:
                    recording = read(path)
                    as_it_was(recording, instants)
                    assert any("the dates are" in note and "otherwise a gap" in note for note in recording.notes)
                    continue
                with pytest.raises(TwoReadingsError, match="heading and row of units contradict each other") as caught:
                    read(path)
                assert all(hours in str(caught.value) for hours in ("51.25 h", "1467.25 h"))
                read_as = [check_content(dict(way), "m") for way in caught.value.remedies]
                assert sorted(read(path, way).time[-1] / 3600 for way in read_as) == [51.25, 1467.25]
                date = {"time": {"column": "Time" if two else f"Date ({heading})", "format": read_as[0].time.format}}
                if points:
                    date["time"]["column"] = date["time"]["column"].replace("/", ".")
                date["time"] |= {"date": f"Date ({heading})".replace("/", "." if points else "/")} if two else {}
                assert read(path, check_content(date, "m")).time[-1] == read(path, read_as[0]).time[-1]


def test_points_whose_order_nothing_shows_are_noted(tmp_path: Path) -> None:
    tests = [t for m in (5, 6) for t in series(datetime(2024, m, 3, 8), timedelta(minutes=30), 17)]
    notes = read(written(tmp_path / "points.csv", tests, "%d.%m.%Y %H:%M")).notes
    assert "the dates are day/month/year: dates with points usually have the day first" in notes


def test_text_in_a_workbook_goes_on_too(tmp_path: Path) -> None:
    path = tmp_path / "night.xlsx"
    rows = [[f"{t:%m/%d/%Y}", f"{t:%H:%M:%S}", 20.0 + k / 9, k / 5] for k, t in enumerate(OVER_NIGHT)]
    pd.DataFrame(rows, columns=["Date", "Time", "t1_C", "z_um"]).to_excel(path, index=False)
    as_it_was(read(path), OVER_NIGHT)


def test_a_clock_that_is_set_back_does_not_hide_the_order(tmp_path: Path) -> None:
    night = [*series(datetime(2024, 11, 3, 0, 0), timedelta(minutes=10), 12)]
    night += series(datetime(2024, 11, 3, 1, 0), timedelta(minutes=10), 150)
    path = written(tmp_path / "autumn.csv", night, "%m/%d/%Y %H:%M")
    with pytest.raises(InputError, match=r"the clock was set back \(daylight saving\).*\[time\] zone"):
        read(path)
    recording = read(path, Mapping(TimeColumn(zone="America/New_York")))
    assert np.diff(recording.time).tolist() == [600.0] * (len(night) - 1)


# -- whatever is written is read as it was, or asked for --------------------------------------------------------------


@st.composite
def drawn(draw: st.DrawFn) -> list[datetime]:
    """Draw some tests on days of the first half of a year, hours to weeks apart."""
    when = datetime(draw(st.integers(2019, 2031)), draw(st.integers(1, 12)), draw(st.integers(1, 28)))
    when += timedelta(minutes=draw(st.integers(6 * 60, 20 * 60)))
    step = draw(st.sampled_from((10, 60, 300, 600, 1800, 3600)))
    uneven = draw(st.sampled_from((0, 0, step // 3)))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    found: list[datetime] = []
    for _ in range(draw(st.integers(1, 5))):
        for _ in range(draw(st.integers(2, 60))):
            found.append(when)
            when += timedelta(seconds=step + int(rng.integers(-uneven, uneven + 1)))
        when += timedelta(minutes=draw(st.sampled_from((5, 14 * 60, 24 * 60, 3 * 24 * 60, 7 * 24 * 60, 31 * 24 * 60))))
    return found


@settings(deadline=None, max_examples=300)
@given(drawn(), st.sampled_from((*SLASHES, *POINTS[:3])), st.sampled_from(CLOCKS))
def test_no_duration_is_wrong(tmp_path_factory: pytest.TempPathFactory, found: list[datetime], f: str, c: str) -> None:
    path = written(tmp_path_factory.getbasetemp() / "drawn.csv", found, f + c)
    kept = [datetime.strptime(t.strftime(f + c), f + c) for t in found]  # to the minute, in some forms
    with suppress(InputError):  # it is asked for
        np.testing.assert_allclose(read(path).time, seconds(kept), rtol=0, atol=1e-6)
