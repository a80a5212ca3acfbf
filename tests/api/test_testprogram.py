"""A thermal test as an NC program: what is written is read, runs in LinuxCNC, and its sheet is a recording."""

import csv
import io
from pathlib import Path
from typing import get_args

import pytest

from thermocomp.api.testprogram import Dialect, stretches, write_program, write_sheet, write_test
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.judging.planning.planning import make_grid
from thermocomp.judging.planning.trial import Trial
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.recordings.readers import recordings

GRID = make_grid(4321.0, 2.0)
CHANNELS = (
    Channel("t_bearing_C", "temperature", "degC"),
    Channel("spindle_rpm", "spindle_speed", "1/min"),
    Channel("z_um", "displacement", "um"),
)


def timeline(text: str, dialect: Dialect) -> list[tuple[float, float]]:
    """Return speed and duration of each dwell of a program, by the words of its lines."""
    speed = set_speed = 0.0
    found = []
    for line in read_lines(text.splitlines(keepends=True), dialect):
        words = {w.letter: w.number or 0.0 for w in line.words if w.letter not in "GM"}
        codes = {f"{w.letter}{w.number:g}" for w in line.words if w.letter in "GM"}
        set_speed = words.get("S", set_speed)
        speed = set_speed if "M3" in codes else 0.0 if "M5" in codes else speed
        if "G4" in codes:
            found.append((speed, words["P"] / (1.0 if dialect == "linuxcnc" else 1000.0)))
    return found


def merged(steps: list[tuple[float, float]]) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for speed, duration in steps:
        if found and found[-1][0] == speed:
            found[-1] = (speed, found[-1][1] + duration)
        else:
            found.append((speed, duration))
    return found


@pytest.mark.parametrize("dialect", get_args(Dialect))
@pytest.mark.parametrize("every", [0.0, 600.0, 1800.0])
@pytest.mark.parametrize("trial", GRID, ids=lambda t: f"{t.kind}-{t.speed:.0f}")
def test_a_program_does_what_the_test_says(trial: Trial, every: float, dialect: Dialect) -> None:
    text = write_program(trial, dialect, every)
    assert text.isascii()
    assert merged(timeline(text, dialect)) == merged(list(trial.steps))
    assert text.rstrip().removesuffix("%").rstrip().endswith("M30")


@pytest.mark.parametrize("dialect", get_args(Dialect))
def test_the_interpreter_of_the_house_follows_it_and_nothing_moves(dialect: Dialect) -> None:
    text = write_program(GRID[1], dialect)
    blocks = list(follow_program(read_lines(text.splitlines(keepends=True), dialect), Setup(controller=dialect)))
    assert len(blocks) > 10
    assert not any(word in text for word in ("G0 ", "G1 ", "X", "Y") if dialect == "linuxcnc")


def test_the_spindle_stands_where_it_is_measured() -> None:
    lines = write_program(GRID[1], "linuxcnc", 600.0).splitlines()
    calls = [k for k, line in enumerate(lines) if line == "o<probe> call"]
    assert len(calls) == len(list(stretches(GRID[1], 600.0))) + 1
    for k in calls:
        last = next(line for line in reversed(lines[:k]) if line.endswith(("M3", "M5")))
        assert last == "M5"
    assert write_program(GRID[1], "linuxcnc").count("probe") == 0


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("trial", [GRID[0], GRID[1], GRID[-1]], ids=lambda t: t.kind)
@pytest.mark.parametrize("every", [0.0, 1200.0])
def test_linuxcnc_runs_it(trial: Trial, every: float, tmp_path: Path) -> None:
    path = tmp_path / "test.ngc"
    path.write_text(write_program(trial, "linuxcnc", every), encoding="ascii")
    calls = [call for call in rs274.read(path, None) if call.line]
    dwells, speed, chosen = [], 0.0, 0.0
    for call in calls:
        chosen = call.values[-1] if call.kind == "speed" else chosen
        speed = chosen if call.kind == "m3" else 0.0 if call.kind == "m5" else speed
        dwells += [(speed, call.values[0])] if call.kind == "dwell" else []
    assert merged(dwells) == merged(list(trial.steps))
    assert not {"rapid", "feed", "arc", "probe", "tap"} & {call.kind for call in calls}
    assert calls[-1].kind == "end"


@pytest.mark.parametrize("kind", ["stop", "random"])
def test_the_sheet_filled_in_is_a_recording(kind: str, tmp_path: Path) -> None:
    trial = next(t for t in GRID if t.kind == kind)
    order, *rows = csv.reader(io.StringIO(("" if kind == "random" else "\n") + write_sheet(trial, CHANNELS, 600.0)))
    assert order == (["# speeds in a random order", " seed 0"] if kind == "random" else [])
    assert rows[0] == ["time_min", "spindle_rpm", "t_bearing_C", "z_um", "action"]
    assert rows[3][-1] == f"record all values, then run at {trial.speeds[0]:.0f} 1/min"
    filled = [rows[0], *([*row[:2], f"{20 + k / 10}", f"{k}", row[-1]] for k, row in enumerate(rows[1:]))]
    path = tmp_path / "filled.csv"
    lines = [",".join(order), *(",".join(f'"{c}"' if "," in c else c for c in row) for row in filled)]
    path.write_text("\n".join(lines), encoding="utf-8")
    found = recordings.read(path)
    assert found.time[-1] == trial.duration
    assert [c.name for c in found.channels] == ["spindle_rpm", "t_bearing_C", "z_um"]
    speed = found.table["spindle_rpm"]
    assert speed[0] == speed[2] == 0.0 < speed[3]  # a row tells what led to it
    assert speed.max() == trial.speed


def test_a_channel_is_no_formula_on_the_sheet() -> None:
    text = write_sheet(GRID[1], [Channel('=HYPERLINK("x")', "temperature", "degC")])
    assert text.splitlines()[0].split(",")[2].startswith("\"'=")


def test_nothing_is_overwritten_and_both_files_come_or_none(tmp_path: Path) -> None:
    program = tmp_path / "test.ngc"
    (tmp_path / "test.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"test\.csv: the file exists already"):
        write_test(GRID[0], program, CHANNELS)
    assert not program.exists()
    assert (tmp_path / "test.csv").read_text(encoding="utf-8") == "mine"
    assert write_test(GRID[0], program, CHANNELS, overwrite=True) == tmp_path / "test.csv"
    assert program.read_text(encoding="ascii").startswith("(thermal test")


@pytest.mark.parametrize("every", [-60.0, 30.0, 7200.0, float("nan")])
def test_a_measurement_that_cannot_be_is_refused(every: float) -> None:
    with pytest.raises(InputError, match="expected 1 to 30 min, or 0 if a logger measures"):
        write_program(GRID[0], "linuxcnc", every)


def test_a_broken_speed_is_refused() -> None:
    with pytest.raises(InputError, match=r"100\.5 1/min: a program needs a whole number"):
        write_program(Trial("run", 100.5, ((0.0, 900.0), (100.5, 3600.0))), "fanuc")
