"""Sound recordings, measured and virtual: `check` finds no trouble in them."""

from pathlib import Path

import pytest
from drifttests import write_drift

from thermocomp.recordings.checks.quality import check, lasting_trouble, troubled_rows
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.readers.mending import mend, take_best
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.virtual import datasets as virtual

ROOT = Path(__file__).resolve().parents[2]
#: experiment, seed and how many tests it has
VIRTUAL = [
    ("demo", 0, 1),
    ("demo", 1, 1),
    ("demo", 7, 1),
    ("random", 0, 1),
    ("random", 3, 1),
    ("random", 8, 1),
    ("etve", 0, 1),
    ("etve", 4, 1),
    ("chen1996", 2, 5),
    ("chen1996-law", 1, 3),
    ("chen1996-new", 5, 2),
    ("chen1996-slope", 0, 1),
    ("hwang", 0, 1),
    ("hwang", 6, 1),
    ("iso230-axis", 0, 3),
    ("iso230-spindle", 3, 2),
    ("precompensation", 2, 2),
    ("precompensation-cut", 0, 1),
    ("probing", 1, 1),
    ("stepwise2017", 4, 1),
    ("stepwise2017-online", 2, 1),
    ("wessel-fem", 0, 2),
    ("wessel-milling", 3, 5),
    ("wessel-tool", 1, 2),
]


def _trouble(recording: Recording) -> list[tuple[str, str, str]]:
    return [(f.channel, f.kind, f.text) for f in check(recording) if f.severity == "trouble"]


@pytest.mark.parametrize(("experiment", "seed", "tests"), VIRTUAL)
def test_the_virtual_machine_raises_no_trouble(experiment: str, seed: int, tests: int) -> None:
    recordings = virtual.record(experiment, seed=seed)

    assert len(recordings) == tests
    for recording in recordings:
        assert _trouble(recording) == []
        assert troubled_rows(recording) == {}
        assert lasting_trouble(check(recording)) == ()


def test_a_measured_spindle_test_raises_no_trouble(shared_data: Path) -> None:
    assert _trouble(read(shared_data / "fl_thermal" / "recording.csv")) == []


def test_a_measured_printer_raises_no_trouble_once_it_is_mapped(shared_data: Path) -> None:
    voron = read_mapping(ROOT / "tests" / "recordings" / "voron.toml")
    names = sorted(p.name for p in (shared_data / "voron_frame").glob("*.csv"))
    assert len(names) >= 2
    for name in names:
        found = _trouble(read(shared_data / "voron_frame" / name, voron))
        # one of the printers has no chamber sensor, which its own test marks as missing
        assert [f for f in found if f[:2] != ("chamber_t", "missing-value code")] == []


@pytest.mark.parametrize(("name", "mapping"), [("drift.csv", None), ("frame.csv", "voron.toml")])
def test_the_examples_of_the_pages_raise_no_trouble(name: str, mapping: str | None) -> None:
    files = ROOT / "docs" / "files"
    assert _trouble(read(files / name, read_mapping(files / mapping) if mapping else None)) == []


def test_work_at_the_same_hours_of_each_day_is_no_clock(tmp_path: Path) -> None:
    """The air warms up with the day, as the machine does: four weeks of a logger."""
    (path,) = write_drift("month.csv", tmp_path)
    assert check(mend(str(path), "", take_best).recording) == ()
