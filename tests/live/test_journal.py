"""The journal: what was flushed is there whatever happens, and what happens never reaches the service."""

import os
import random
import resource
import signal
import sqlite3
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.machine import Channel
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import (
    KINDS,
    LONGEST,
    AlarmRow,
    ConfirmationRow,
    DemandRow,
    MeasurementRow,
    ReadingRow,
    ReferenceRow,
    Row,
    StartRow,
    StateRow,
    TargetRow,
    UpdateRow,
    dumps,
    kind_of,
    loads,
    measured_by,
)

CHANNELS = (Channel("t1_C", "temperature", "degC"), Channel("spindle_rpm", "spindle_speed", "1/min", "motor"))
START = StartRow(1000.0, (TargetRow("z_um"), TargetRow("Z", position=250.0)), CHANNELS, "off", 5.0)
SMALL = JournalLimits(size_bytes=2**16, files=3)
ROWS: tuple[Row, ...] = (
    ReadingRow(1001.0, {"t1_C": 20.125, "spindle_rpm": 3000.0}),
    DemandRow(1001.0, "z_um", Correction(-12.5)),
    ConfirmationRow(1001.5, "Z", Correction(-12.0, 3.0, 250.0)),
    StateRow(1002.0, "z_um", "holding", "no reading for 3 s"),
    ReferenceRow(1003.0, "z_um", "homing", Deviation(4.0)),
    MeasurementRow(1004.0, "z_um", 3.25, "probing", False, 250.0, Correction(-12.0)),
    MeasurementRow(1004.5, "z_um", 3.25, "tool_length", True),
    AlarmRow(1005.0, "sensor", 't1_C "stuck"\n'),
    UpdateRow(1006.0, "z_um", 15.0, 12.5, 14.5, ""),
)


def opened(folder: Path, limits: JournalLimits = SMALL, start: StartRow = START) -> Journal:
    return Journal.open(folder / "live.db", limits, start)


def read(folder: Path) -> list[Row]:
    return [s.row for s in JournalReader(folder / "live.db").rows()]


def alarm(k: int) -> AlarmRow:
    return AlarmRow(2000.0 + k, "count", f"{k:06d}" + "x" * 100)


def numbers(rows: list[Row]) -> list[int]:
    return [int(r.text[:6]) for r in rows if isinstance(r, AlarmRow)]


# -- what is written is read -------------------------------------------------------------------------------------------


def test_rows_come_back_as_they_were(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    for row in ROWS:
        journal.add(row)
    assert journal.status().waiting == len(ROWS)
    assert journal.flush()
    status = journal.status()
    assert (status.confirmed, status.waiting, status.lost, status.refused, status.reason) == (len(ROWS), 0, 0, 0, "")
    assert read(tmp_path) == [START, *ROWS]  # while it is open
    assert {p.stat().st_mode & 0o777 for p in tmp_path.glob("live.*.db*")} == {0o600}  # the owner alone
    journal.close()
    journal.close()
    assert read(tmp_path) == [START, *ROWS]
    assert {kind_of(r) for r in ROWS} | {"start"} == set(KINDS)
    summary = JournalReader(tmp_path / "live.db").summary()
    assert (summary.first, summary.last, summary.lost) == (1000.0, 1006.0, 0)
    assert summary.counts == {**dict.fromkeys(KINDS, 1), "measurement": 2}


def test_what_a_commit_promises_is_asked_for(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    assert journal._connection is not None
    assert journal._connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert journal._connection.execute("PRAGMA synchronous").fetchone() == (2,)  # FULL
    journal.close()


_number = st.floats(-1e15, 1e15, allow_nan=False)
_text = st.text(max_size=50)
_correction = st.builds(Correction, _number, _number, _number)
_by_type: dict[Any, st.SearchStrategy[Any]] = {float: _number, str: _text}
_rows = st.one_of(
    st.builds(DemandRow, _number, _text, _correction),
    st.builds(ConfirmationRow, _number, _text, _correction),
    st.builds(StateRow, _number, _text, st.sampled_from(["active", "holding", "fading", "suspended", "shadow"]), _text),
    st.builds(ReferenceRow, _number, _text, _text, st.builds(Deviation, _number, _number, _number)),
    st.builds(
        MeasurementRow,
        _number,
        _text,
        _number,
        st.sampled_from(["probing", "work_offset", "tool_length"]),
        st.booleans(),
        _number,
        st.none() | _correction,
    ),
    st.builds(AlarmRow, _number, _text, _text),
    st.builds(UpdateRow, _number, _text, _number, _number, _number, _text),
    st.builds(ReadingRow, _number, st.fixed_dictionaries({}, optional={c.name: _number for c in CHANNELS})),
)


@given(_rows)
def test_every_row_comes_back_from_its_text(row: Row) -> None:
    text = dumps(row, START)
    assert text.isascii()
    assert loads(kind_of(row), row.time, text, START) == row


@settings(max_examples=30, deadline=None)
@given(st.lists(_rows, max_size=30), st.integers(1, 5))
@example([AlarmRow(-0.0, "", ""), DemandRow(-0.0, "", Correction(-0.0))], 1)
def test_all_rows_come_back_from_the_file(rows: list[Row], every: int) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        journal = opened(Path(folder))
        for k, row in enumerate(rows):
            journal.add(row)
            assert k % every or journal.flush()
        journal.close()
        found = read(Path(folder))
    found.remove(START)
    plain = [r._replace(time=r.time + 0.0) for r in rows]  # without -0.0
    assert sorted(found, key=repr) == sorted(plain, key=repr)
    assert [r.time for r in found] == sorted(r.time for r in rows)


_anything = st.one_of(
    st.none(),
    st.booleans(),
    st.text(max_size=5),
    st.floats(),
    st.integers(),
    st.just(10**400),
    st.just("x" * 10_000),
    st.just("\ud800"),
    st.just(np.float32(1.5)),
    st.just(np.float64("nan")),
    st.binary(max_size=3),
    st.just([1.0]),
    _correction,
)


@settings(max_examples=300, deadline=None)
@given(kind=st.sampled_from([k for k in KINDS.values() if k is not StartRow]), data=st.data())
def test_hostile_rows_never_raise_and_never_make_a_journal_unreadable(kind: Any, data: st.DataObject) -> None:
    values = [data.draw(_anything) for _ in kind._fields]
    if kind is ReadingRow:
        values[1] = data.draw(_anything | st.dictionaries(st.sampled_from(["t1_C", "spindle_rpm", "x"]), _anything))
    journal = Journal(Path("nowhere") / "live.db", SMALL, START)
    journal.add(kind(*values))
    status = journal.status()
    assert status.waiting + status.refused == 1
    assert bool(status.refused) == bool(status.reason)
    for _, at, name, text in journal._waiting:
        row = loads(name, at, text, START)
        assert all(abs(v) <= 1e15 for v in row if isinstance(v, float))
        assert all(len(v) <= LONGEST for v in row if isinstance(v, str))


@pytest.mark.parametrize("row", [None, 3, "text", (1.0, "z_um"), START])
def test_what_is_no_row_is_counted(row: Any, tmp_path: Path) -> None:
    journal = opened(tmp_path)
    journal.add(row)
    assert journal.status().refused == (row is not START)
    journal.close()


def test_of_a_reading_what_is_no_number_is_missing() -> None:
    bad: dict[str, Any] = {"t1_C": float("inf"), "spindle_rpm": "fast", "unknown": 1.0}
    assert loads("reading", 1.0, dumps(ReadingRow(1.0, bad), START), START) == ReadingRow(1.0, {})
    some: dict[str, Any] = {"t1_C": np.float32(1.5), "spindle_rpm": None}
    assert loads("reading", 1.0, dumps(ReadingRow(1.0, some), START), START) == ReadingRow(1.0, {"t1_C": 1.5})


@pytest.mark.parametrize(
    "start",
    [
        START._replace(time=float("nan")),
        START._replace(own_compensation="perhaps"),  # type: ignore[arg-type]
        START._replace(confirm_within=0.0),
        START._replace(targets=(TargetRow("z_um"), TargetRow("z_um"))),
        START._replace(channels=(CHANNELS[0], CHANNELS[0])),
        START._replace(targets=None),  # type: ignore[arg-type]
        START._replace(targets=(TargetRow("z_um", position=float("inf")),)),
    ],
)
def test_a_start_that_cannot_be_is_said_at_once(start: StartRow, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"live\.db: the journal cannot be started"):
        opened(tmp_path, start=start)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong", [{"size_bytes": 100}, {"files": 1}, {"waiting_bytes": 0}])
def test_limits_that_are_none(wrong: dict[str, int]) -> None:
    with pytest.raises(SettingError, match=next(iter(wrong))):
        JournalLimits(**wrong)


# -- trap 5: what a measurement under compensation tells ---------------------------------------------------------------


@pytest.mark.parametrize("correction", [Correction(0.0), Correction(-11.0), Correction(-9.0, 40.0, 100.0)])
@pytest.mark.parametrize("kind", ["probing", "work_offset", "tool_length"])
def test_the_deviation_is_the_same_by_either_frame_with_any_correction(correction: Correction, kind: Any) -> None:
    surface, deviation, at = 5000.0, 12.0, 250.0  # um, um, mm
    motor = surface - deviation  # there the tool point is at the surface: what #5063 reports
    commanded = motor - correction.at(at)  # what #<_z> reports
    by_motor = MeasurementRow(1.0, "z_um", surface - motor, kind, True, at, correction)
    by_command = MeasurementRow(1.0, "z_um", surface - commanded, kind, False, at, correction)
    assert measured_by(by_motor, START) == pytest.approx(deviation)
    assert measured_by(by_command, START) == pytest.approx(deviation)
    assert by_motor.compensated == by_command.compensated == (correction.offset != 0.0)
    # where the row does not tell, who knows may
    assert measured_by(by_command._replace(in_force=None), START, correction) == pytest.approx(deviation)
    assert measured_by(by_motor._replace(in_force=None), START) == pytest.approx(deviation)


def test_what_cannot_be_known_is_none() -> None:
    row = MeasurementRow(1.0, "z_um", 3.0, "probing", False)
    assert row.compensated is None
    assert measured_by(row, START) is None
    for own in ("on", "unknown"):
        beside = START._replace(own_compensation=own)
        for frame in (True, False):
            told = row._replace(includes_offset=frame, in_force=Correction(0.0))
            assert measured_by(told, START) == 3.0
            assert measured_by(told, beside) is None


# -- kills -------------------------------------------------------------------------------------------------------------


def killed(folder: Path, first: int, seconds: float, seed: int) -> int:
    """Let a process open a journal and write from a number on, kill it, and return the number after the last confirmed.

    It may be killed before it has opened the file, too.
    """
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            journal = opened(folder, JournalLimits(size_bytes=2**16, files=1000))
            for k in range(first, first + 10**6):
                journal.add(alarm(k))
                if (k + seed) % 17 == 0:
                    if not journal.flush():
                        os.write(into, journal.status().reason.encode())
                        break
                    os.write(into, f"{k + 1}\n".encode())
        finally:
            os._exit(1)
    os.close(into)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    with os.fdopen(out) as pipe:
        said = pipe.read()
    assert os.WTERMSIG(status) == signal.SIGKILL, said
    return int((said.split() or [str(first)])[-1])


def check_kills(folder: Path, n: int) -> None:
    draw = random.Random(20240601)
    confirmed: set[int] = set()
    first = began = 0
    for seed in range(n):
        end = killed(folder, first, draw.choice([draw.uniform(0.0, 0.02), draw.uniform(0.0, 0.3)]), seed)
        confirmed |= set(range(first, end))
        began += end > first
        first = end + 10_000  # what was written and not known to be is not counted
        if seed % 10 == 9:
            again = opened(folder, JournalLimits(size_bytes=2**16, files=1000))
            assert again.status().reason == ""
            again.close()
    assert n / 3 < began
    assert began < n or n < 100  # of few, all may have begun on a machine that is busy
    found = read(folder)
    texts = [r.text for r in found if isinstance(r, AlarmRow)]
    assert {alarm(k).text for k in confirmed} <= set(texts)
    assert len(texts) == len(set(texts))
    assert JournalReader(folder / "live.db").summary().lost == 0
    assert [p for p in folder.iterdir() if "refused" in p.name] == []


def test_what_was_confirmed_outlasts_kills(tmp_path: Path) -> None:
    check_kills(tmp_path, 10)


@pytest.mark.long
def test_what_was_confirmed_outlasts_200_kills(tmp_path: Path) -> None:
    check_kills(tmp_path, 200)


def test_rows_are_added_while_others_are_flushed(tmp_path: Path) -> None:
    journal = opened(tmp_path, JournalLimits(size_bytes=2**16, files=1000))
    done = threading.Event()

    def flush() -> None:
        while not done.is_set():
            assert journal.flush()
            journal.status()

    def add(first: int) -> None:
        for k in range(first, first + 3000):
            journal.add(alarm(k))

    flushing = [threading.Thread(target=flush) for _ in range(2)]
    adding = [threading.Thread(target=add, args=(k * 3000,)) for k in range(3)]
    for thread in flushing + adding:
        thread.start()
    for thread in adding:
        thread.join()
    done.set()
    for thread in flushing:
        thread.join()
    journal.close()
    assert journal.status().confirmed == 9000
    assert numbers(read(tmp_path)) == list(range(9000))
    assert JournalReader(tmp_path / "live.db").summary().lost == 0


def test_two_services_in_one_journal_lose_nothing(tmp_path: Path) -> None:
    one, two = opened(tmp_path), opened(tmp_path, start=START._replace(channels=CHANNELS[:1]))
    for k in range(200):
        (one if k % 2 else two).add(alarm(k))
        (one if k % 2 else two).add(ReadingRow(5000.0 + k, {"t1_C": float(k), "spindle_rpm": 1.0}))
        assert one.flush()
        assert two.flush()
    one.close()
    two.close()
    found = read(tmp_path)
    assert numbers(found) == list(range(200))
    readings = [r.values for r in found if isinstance(r, ReadingRow)]
    assert readings == [{"t1_C": float(k)} | ({"spindle_rpm": 1.0} if k % 2 else {}) for k in range(200)]


# -- bounds ------------------------------------------------------------------------------------------------------------


def test_files_are_turned_over_and_the_oldest_goes(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    for k in range(6000):
        journal.add(alarm(k))
        if k % 50 == 49:
            assert journal.flush()
            status = journal.status()
            assert status.files <= SMALL.files
            assert status.size_bytes <= SMALL.files * (SMALL.size_bytes + 2**17)
    journal.close()
    found = numbers(read(tmp_path))
    assert found == list(range(found[0], 6000))  # the newest, without a gap, also across files
    assert 250 < len(found) < 3000
    names = sorted(p.name for p in tmp_path.iterdir())
    assert len(names) == 3
    assert names[0] > "live.000005.db"
    reader = JournalReader(tmp_path / "live.db")
    assert sum(isinstance(s.row, StartRow) for s in reader.rows()) == 1
    assert reader.summary().lost == 0
    assert numbers([s.row for s in reader.latest(250)]) == list(range(5750, 6000))
    one = [s.row for s in JournalReader(tmp_path / names[1]).rows()]
    assert one[0] == START
    assert set(numbers(one)) < set(found)


def test_readings_are_understood_in_every_file(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    for k in range(3000):
        journal.add(ReadingRow(2000.0 + k, {"t1_C": k / 7}))
        assert k % 100 or journal.flush()
    journal.close()
    assert len(list(tmp_path.iterdir())) > 1
    found = [r for r in read(tmp_path) if isinstance(r, ReadingRow)]
    assert all(r.values == {"t1_C": (r.time - 2000.0) / 7} for r in found)


def test_runs_follow_each_other_in_one_file(tmp_path: Path) -> None:
    for run in range(3):
        journal = opened(tmp_path, start=START._replace(time=1000.0 * run))
        journal.add(AlarmRow(1000.0 * run + 1, "run", str(run)))
        journal.close()
    assert [type(r) for r in read(tmp_path)] == [StartRow, AlarmRow] * 3
    assert [p.name for p in tmp_path.iterdir()] == ["live.000001.db"]


def test_rows_are_read_in_the_order_of_their_times(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    draw = random.Random(3)
    times = [draw.uniform(1000.0, 2000.0) for _ in range(3000)]
    for k, at in enumerate(times):
        journal.add(AlarmRow(at, "count", "x" * 100))
        assert k % 100 or journal.flush()
    journal.close()
    assert len(list(tmp_path.iterdir())) == 3
    found = [r.time for r in read(tmp_path)]
    assert found == sorted(found)


# -- disks -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def few_bytes() -> Iterator[Any]:
    """Let files grow to so many bytes, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(size: int | None) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (before[0] if size is None else size, before[1]))

    yield limit
    limit(None)


@pytest.mark.parametrize("room", [0, 1, 4096, 100_000])
def test_a_full_disk_loses_only_what_is_told(room: int, tmp_path: Path, few_bytes: Any) -> None:
    limits = JournalLimits(files=2, waiting_bytes=2**16)
    few_bytes(room)
    journal = opened(tmp_path, limits)
    confirmed: list[int] = []
    for k in range(2000):
        journal.add(alarm(k))
        if k % 50 == 49 and journal.flush():
            confirmed = list(range(k + 1))
    status = journal.status()
    assert not journal.flush()
    assert "disk" in status.reason or "full" in status.reason or "open" in status.reason, status.reason
    assert status.waiting > 100
    assert status.lost > 100
    assert status.confirmed == len(confirmed)
    assert status.confirmed + status.waiting + status.lost == 2000
    few_bytes(None)
    assert journal.flush()  # there is room again
    after = journal.status()
    assert (after.waiting, after.lost, after.reason) == (0, status.lost, "")
    assert after.confirmed == status.confirmed + status.waiting
    journal.close()
    found = numbers(read(tmp_path))
    assert found == [*confirmed, *range(2000 - status.waiting, 2000)]
    assert JournalReader(tmp_path / "live.db").summary().lost == (status.lost if confirmed else 0)


def test_a_failing_commit_is_done_again_once(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    assert journal._connection is not None
    real = journal._connection

    class Failing:
        def execute(self, sql: str) -> Any:
            found = real.execute(sql)
            if sql == "COMMIT":  # it was done, and nobody knows
                raise sqlite3.OperationalError("disk I/O error")
            return found

        def executemany(self, *words: Any) -> Any:
            return real.executemany(*words)

        def close(self) -> None:
            real.close()

    journal._connection = Failing()  # type: ignore[assignment]
    journal.add(alarm(1))
    assert not journal.flush()
    assert journal.status()[3:5] == (0, 1)
    journal.add(alarm(2))
    assert journal.flush()
    journal.close()
    assert numbers(read(tmp_path)) == [1, 2]


def test_what_waits_is_bounded_and_in_order(tmp_path: Path) -> None:
    journal = opened(tmp_path, JournalLimits(waiting_bytes=2**15))
    for k in range(1000):
        journal.add(alarm(k))
        assert journal._bytes <= 2**15
    status = journal.status()
    assert status.lost + status.waiting == 1000
    assert 50 < status.waiting < 200
    assert journal._connection is not None
    real = journal._connection

    class Failing:
        def execute(self, sql: str) -> Any:
            journal.add(alarm(1000))  # meanwhile
            raise sqlite3.OperationalError("database or disk is full")

        def close(self) -> None:
            real.close()

    journal._connection = Failing()  # type: ignore[assignment]
    assert not journal.flush()
    assert journal._bytes <= 2**15
    numbers_waiting = [w[0] for w in journal._waiting]
    assert numbers_waiting == sorted(numbers_waiting)
    assert journal.status().lost == status.lost + 1
    assert journal.flush()
    journal.close()
    assert numbers(read(tmp_path)) == list(range(status.lost + 1, 1001))
    assert journal._bytes == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_to(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    journal = opened(tmp_path)
    journal.add(alarm(1))
    assert not journal.flush()
    assert journal.status().reason
    tmp_path.chmod(0o700)
    assert journal.flush()
    journal.close()


@pytest.mark.parametrize("is_file", [False, True])
def test_a_folder_that_is_not_there(is_file: bool, tmp_path: Path) -> None:
    place = tmp_path / "none" / "live.db"
    if is_file:
        place.parent.write_text("a file")
    journal = Journal.open(place, SMALL, START)
    journal.add(alarm(1))
    assert not journal.flush()
    assert journal.status()[:6] == (None, 0, 0, 0, 1, 0)
    assert journal.status().reason
    journal.close()


def test_a_file_that_somebody_locks(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    other = sqlite3.connect(tmp_path / "live.000001.db", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    journal.add(alarm(1))
    assert not journal.flush()
    assert "locked" in journal.status().reason
    late = opened(tmp_path)
    assert "locked" in late.status().reason
    other.execute("ROLLBACK")
    other.close()
    assert journal.flush()
    assert late.flush()
    for j in (journal, late):
        j.close()
    assert numbers(read(tmp_path)) == [1]


def test_a_reader_keeps_nobody_from_writing(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    for k in range(100):
        journal.add(alarm(k))
    journal.flush()
    rows = JournalReader(tmp_path / "live.db").rows()
    assert isinstance(next(rows).row, StartRow)
    for k in range(100, 4000):
        journal.add(alarm(k))
        assert k % 100 or journal.flush()
    journal.close()
    assert numbers([s.row for s in rows]) == list(range(100))  # as it was when it began


# -- damage ------------------------------------------------------------------------------------------------------------


def full(folder: Path) -> Path:
    journal = opened(folder, JournalLimits())
    for k in range(1000):
        journal.add(alarm(k))
    journal.close()
    return folder / "live.000001.db"


@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_file_is_set_aside_or_read_and_never_lies(seed: int, tmp_path: Path) -> None:
    path, draw = full(tmp_path), random.Random(seed)
    content = bytearray(path.read_bytes())
    way = seed % 4
    if way == 0:
        content = content[: draw.randrange(1, len(content))]
    elif way == 1:
        for _ in range(draw.choice([1, 10, 1000])):
            content[draw.randrange(len(content))] = draw.randrange(256)
    elif way == 2:
        begin = draw.randrange(len(content))
        content[begin : begin + 5000] = bytes(5000)
    else:
        content = bytearray(draw.randbytes(draw.choice([1, 100, 10_000])))
    path.write_bytes(content)
    try:
        found: list[Row] | None = read(tmp_path)
    except InputError as e:
        assert "live.000001.db: " in str(e)  # noqa: PT017
        found = None
    for row in found or ():
        assert not isinstance(row, AlarmRow) or row == alarm(int(row.text[:6]))
    journal = opened(tmp_path)
    journal.add(alarm(5000))
    assert journal.flush()
    aside = path.with_name("live.000001.db.refused")
    status = journal.status()
    journal.close()
    if aside.exists():
        assert aside.read_bytes() == content
        assert "live.000001.db.refused" in status.reason
        assert not path.exists()
        assert numbers(read(tmp_path)) == [5000]
    assert 7000.0 in [s.row.time for s in JournalReader(sorted(tmp_path.glob("live.??????.db"))[-1]).latest(1)]


def test_damage_while_it_runs(tmp_path: Path) -> None:
    journal = opened(tmp_path, JournalLimits())
    for k in range(2000):
        journal.add(alarm(k))
    assert journal.flush()
    path = tmp_path / "live.000001.db"
    for part in (path, path.with_name("live.000001.db-wal")):
        with part.open("r+b") as file:
            file.write(b"damage" * 10_000)
    for k in range(2000, 2200):
        journal.add(alarm(k))
        journal.flush()  # what it sees of that is told when it next opens the file
    journal.close()
    after = opened(tmp_path)
    after.add(alarm(3000))
    assert after.flush()
    after.close()
    assert path.with_name("live.000001.db.refused").exists()
    assert numbers(read(tmp_path))[-1] == 3000


def test_damage_that_a_commit_meets(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    connection = journal._connection
    assert connection is not None
    journal.add(alarm(1))
    assert journal.flush()
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
    connection.execute("PRAGMA shrink_memory").fetchall()
    path = tmp_path / "live.000001.db"
    with path.open("r+b") as file:
        file.write(os.urandom(path.stat().st_size))
    other = sqlite3.connect(path)  # what was read before is not trusted any more
    other.close()
    for k in range(2, 50):
        journal.add(alarm(k))
        journal.flush()
    assert journal.flush()
    journal.close()
    assert sorted(p.name for p in tmp_path.glob("*.refused")) == ["live.000001.db.refused"]
    found = numbers(read(tmp_path))
    assert found == list(range(found[0], 50))


def test_a_file_that_somebody_removes_is_begun_anew(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    journal.add(alarm(1))
    assert journal.flush()
    for path in tmp_path.iterdir():
        path.unlink()
    journal.add(alarm(2))
    assert journal.flush()
    assert "live.000001.db was removed" in journal.status().reason
    journal.close()
    assert numbers(read(tmp_path)) == [2]


def test_what_belongs_to_a_damaged_file_goes_with_it(tmp_path: Path) -> None:
    path = full(tmp_path)
    content = bytearray(path.read_bytes())
    content[20_000:40_000] = os.urandom(20_000)
    path.write_bytes(content)
    reader = sqlite3.connect(path)  # who has it open keeps its log there
    reader.execute("PRAGMA user_version").fetchall()
    reader.execute("BEGIN").fetchall()
    reader.execute("SELECT COUNT(*) FROM sqlite_master").fetchall()
    assert path.with_name("live.000001.db-wal").exists()
    journal = opened(tmp_path)
    journal.add(alarm(2))
    journal.close()
    names = sorted(p.name for p in tmp_path.iterdir())
    reader.close()
    assert names == ["live.000001.db.refused", "live.000001.db.refused-wal", "live.000002.db"]
    assert numbers(read(tmp_path)) == [2]


def test_what_the_log_still_has_is_not_lost_with_the_file(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    journal.add(alarm(1))
    assert journal.flush()
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "live.000001.db").write_text("damaged " * 1000)
    (copy / "live.000001.db-wal").write_bytes((tmp_path / "live.000001.db-wal").read_bytes())
    opened(copy).close()
    journal.close()
    assert numbers(read(copy)) == [1]


def test_nothing_set_aside_is_ever_written_over(tmp_path: Path) -> None:
    for k in range(3):
        journal = opened(tmp_path)
        journal.close()
        newest = sorted(tmp_path.glob("live.??????.db"))[-1]
        newest.write_text(f"damaged {k}")
    opened(tmp_path).close()
    assert [p.read_text() for p in sorted(tmp_path.glob("*.refused"))] == ["damaged 0", "damaged 1", "damaged 2"]


def test_a_newer_version_is_refused_by_name_and_left_alone(tmp_path: Path) -> None:
    path = full(tmp_path)
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 2")
    connection.close()
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"live\.000001\.db: a journal of version 2, but this thermocomp supports 1"):
        read(tmp_path)
    journal = opened(tmp_path)
    journal.add(alarm(1))
    assert journal.flush()
    assert journal.status().file == tmp_path / "live.000002.db"
    assert "version 2" in journal.status().reason
    journal.close()
    assert path.read_bytes() == before


def test_what_is_no_journal(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.db: there is no journal of that name"):
        JournalReader(tmp_path / "nothing.db")
    text = tmp_path / "notes.txt"
    text.write_text("no database " * 100)
    with pytest.raises(InputError, match=r"notes\.txt: this is not a journal of thermocomp, and not a database"):
        JournalReader(text)
    other = tmp_path / "other.db"
    with sqlite3.connect(other) as connection:
        connection.execute("CREATE TABLE rows (id INTEGER)")
    connection.close()
    with pytest.raises(InputError, match=r"other\.db: this is not a journal of thermocomp but another database"):
        JournalReader(other)


def test_a_row_that_was_changed_is_found(tmp_path: Path) -> None:
    path = full(tmp_path)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE rows SET time = time + 1 WHERE seq = 7")
    connection.close()
    with pytest.raises(InputError, match=r"live\.000001\.db: row 7 of run \d+ is damaged"):
        read(tmp_path)


@pytest.mark.parametrize("killed_after", ["open", "schema"])
def test_a_file_that_was_only_begun(killed_after: str, tmp_path: Path) -> None:
    path = tmp_path / "live.000001.db"
    path.touch()
    assert list(JournalReader(tmp_path / "live.db").rows()) == []
    if killed_after == "schema":
        connection = sqlite3.connect(path, isolation_level=None)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.close()
    journal = opened(tmp_path)
    journal.add(alarm(1))
    journal.close()
    assert [p.name for p in tmp_path.iterdir()] == ["live.000001.db"]
    assert numbers(read(tmp_path)) == [1]
