"""Thermal cycles from the spindle speed, or given."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.cycles import Cycle, find_cycles, make_single_cycle, split_at, split_by_labels
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.readers.recordings import read


@given(
    stretches=st.lists(st.tuples(st.integers(1, 40), st.sampled_from([0.0, 1000.0, -2500.0, np.nan])), min_size=1),
    dt=st.sampled_from([1.0, 15.0, 60.0, 400.0]),
    limits=st.tuples(st.sampled_from([0.0, 300.0]), st.sampled_from([0.0, 300.0])),
)
def test_cycles_cover_all_rows_without_overlap(
    stretches: list[tuple[int, float]], dt: float, limits: tuple[float, float]
) -> None:
    speed = np.concatenate([np.full(n, v) for n, v in stretches])
    time = np.arange(len(speed), dtype=np.float64) * dt

    cycles = find_cycles(time, speed, min_run=limits[0], min_stop=limits[1])

    assert [row for c in cycles for row in range(c.start, c.stop)] == list(range(len(speed)))
    assert len({c.name for c in cycles}) == len(cycles)


@given(
    halves=st.lists(st.tuples(st.integers(6, 30), st.integers(6, 30), st.floats(100, 5000)), min_size=1, max_size=6),
    lead=st.integers(0, 10),
)
def test_each_run_and_the_stop_that_follows_is_a_cycle(halves: list[tuple[int, int, float]], lead: int) -> None:
    speed = np.concatenate([np.zeros(lead), *(np.r_[np.full(run, v), np.zeros(stop)] for run, stop, v in halves)])
    lengths = [run + stop for run, stop, _ in halves]
    lengths[0] += lead  # rows before the first run belong to it

    cycles = find_cycles(np.arange(0.0, 60.0 * len(speed), 60.0), speed)

    assert [len(c) for c in cycles] == lengths
    assert [c.name for c in cycles] == [f"{k} ({v:.0f} 1/min)" for k, (_, _, v) in enumerate(halves, start=1)]


def test_short_runs_and_stops_do_not_split() -> None:
    time = np.arange(0.0, 24000.0, 60.0)
    speed = np.where(time % 12000 < 6000, 2000.0, 0.0)
    tool_change = speed.copy()
    tool_change[20:23] = 0.0
    probing = speed.copy()
    probing[150:153] = 500.0

    assert [c.start for c in find_cycles(time, tool_change)] == [0, 200]
    assert [c.start for c in find_cycles(time, probing)] == [0, 200]
    assert [c.start for c in find_cycles(time, tool_change, min_stop=60.0)] == [0, 23, 200]


def test_a_speed_that_jitters_is_named_by_its_median_and_one_that_varies_by_its_range() -> None:
    time = np.arange(0.0, 12000.0, 60.0)
    jitter = np.where(time < 6000, 2000 + np.random.default_rng(1).normal(size=200), 0.0)
    steps = np.where(time < 6000, np.where(time < 3000, 1000.0, 3000.0), 0.0)

    assert [c.name for c in find_cycles(time, jitter)] == ["1 (2000 1/min)"]
    assert [c.name for c in find_cycles(time, steps)] == ["1 (1000-3000 1/min)"]


@pytest.mark.parametrize("speed", [np.zeros(5), np.full(5, np.nan), np.full(5, 1000.0)])
def test_a_spindle_that_never_starts_anew_gives_one_cycle(speed: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    (cycle,) = find_cycles(np.arange(5.0), speed)

    assert (cycle.start, cycle.stop) == (0, 5)


def test_labels_become_cycles() -> None:
    assert split_by_labels(["a", "a", "b"]) == (Cycle("a", 0, 2), Cycle("b", 2, 3))
    assert split_by_labels([1.0, 1.0, 2.5]) == (Cycle("1", 0, 2), Cycle("2.5", 2, 3))
    with pytest.raises(RecordingError, match=r"'a' appears again at row 2"):
        split_by_labels(["a", "b", "a"])


def test_the_whole_test_is_one_cycle() -> None:
    assert make_single_cycle(7) == (Cycle("whole test", 0, 7),)
    assert len(make_single_cycle(7)[0]) == 7


def test_cycles_begin_where_the_user_says() -> None:
    time = np.arange(0.0, 600.0, 60.0)
    speed = np.r_[0.0, 1000.0, 1000.0, 0.0, 0.0, 2000.0, 2000.0, 0.0, np.nan, 0.0]

    assert split_at(time, [240.0], speed) == (Cycle("1 (1000 1/min)", 0, 4), Cycle("2 (2000 1/min)", 4, 10))
    assert split_at(time, [210.0, 540.0]) == (Cycle("1", 0, 4), Cycle("2", 4, 9), Cycle("3", 9, 10))
    for starts, empty in (([0.0], 1), ([600.0], 2), ([240.0, 240.0], 2), ([480.0, 240.0], 2), ([-60.0], 1)):
        with pytest.raises(RecordingError, match=f"cycle {empty} would have no rows"):
            split_at(time, starts, speed)


def test_cycles_of_a_mapping(tmp_path: Path) -> None:
    """Seconds since the first row of the file, whatever is cut, or time stamps; labels of the file do not matter."""
    rows = "".join(f"2024-05-06 08:{k:02d}:00,{20 + k},{k},{k // 5}\n" for k in range(20))
    (tmp_path / "a.csv").write_text(f"timestamp,t1 [degC],z [um],cycle\n{rows}", encoding="utf-8")
    cut = '[[clean]]\ndo = "cut"\ntimes = [[0, 120]]\n'
    for starts in ("[600]", '["2024-05-06T08:10:00"]'):
        (tmp_path / "m.toml").write_text(f"[cycles]\nstarts = {starts}\n{cut}", encoding="utf-8")
        found = read(tmp_path / "a.csv", read_mapping(tmp_path / "m.toml"))
        assert [(c.start, c.stop) for c in found.cycles] == [(0, 7), (7, 17)]
    (tmp_path / "m.toml").write_text(f"[cycles]\nstarts = [60]\n{cut}", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"a\.csv: thermal cycle 1 would have no rows"):
        read(tmp_path / "a.csv", read_mapping(tmp_path / "m.toml"))
