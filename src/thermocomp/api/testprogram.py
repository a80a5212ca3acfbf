"""A thermal test as an NC program, and its measurement sheet."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.files.draft import drafts
from thermocomp.judging.planning.trial import Trial
from thermocomp.recordings.readers.tables import defuse

Dialect = Literal["linuxcnc", "fanuc"]

#: longest dwell, so that the controller shows the progress of the test [s]
LONGEST = 1800.0
#: shortest interval between two measurements [s]
_SHORTEST = 60.0


class ProgramStretch(NamedTuple):
    """A period of a test without changes."""

    start: float  #: time since the start of the test [s]
    duration: float  #: [s]
    speed: float  #: spindle speed [1/min]
    first: bool  #: whether the speed has changed


def stretches(trial: Trial, every: float = 0.0) -> Iterator[ProgramStretch]:
    """Divide a test into periods without a change of speed and without a measurement.

    Parameters
    ----------
    trial : Trial
    every : float
        Time between two measurements [s]; 0: no measurements, and long periods are divided into half hours.

    Yields
    ------
    ProgramStretch
    """
    start = 0.0
    for speed, duration in trial.steps:
        done = 0.0
        while done < duration - 1e-6:
            part = min(every or LONGEST, LONGEST, duration - done)
            yield ProgramStretch(start + done, part, speed, done == 0)
            done += part
        start += duration


def write_program(trial: Trial, dialect: Dialect, every: float = 0.0) -> str:
    """Return a test as an NC program.

    The program turns the spindle, stops it and waits; it moves no axis. For a measurement it stops the spindle and
    calls a routine that does nothing until the user fills it in.

    Parameters
    ----------
    trial : Trial
    dialect : {'linuxcnc', 'fanuc'}
    every : float
        Time between two measurements with a touch probe [s]; 0: a logger measures continuously.

    Returns
    -------
    str

    Raises
    ------
    InputError
        The time between two measurements is invalid, or the speed is not an integer.
    """
    if every and not _SHORTEST <= every <= LONGEST:
        raise InputError(
            f"a measurement every {every / 60:g} min: expected 1 to {LONGEST / 60:g} min, or 0 if a logger measures"
        )
    if trial.speed != round(trial.speed):
        raise InputError(f"spindle speed {trial.speed:g} 1/min: a program needs a whole number")
    lines = [*_head(trial, dialect, every)]
    running = 0.0
    for part in stretches(trial, every):
        if part.first:
            what = f"{part.speed:.0f} 1/min" if part.speed else "spindle stopped"
            lines.append(_comment(f"{clock(part.start)} {what} for {_length(trial, part)}", dialect))
        if every:
            lines += ["M5"] * (running > 0) + _measure(dialect)
            running = 0.0
        if part.speed != running:
            lines.append(f"S{part.speed:.0f} M3" if part.speed else "M5")
            running = part.speed
        lines.append(f"G4 P{part.duration:.0f}" if dialect == "linuxcnc" else f"G04 P{1000 * part.duration:.0f}")
    lines += [_comment(f"{clock(trial.duration)} end", dialect), "M5", *(_measure(dialect) if every else []), "M30"]
    return "\n".join([*lines, *(["%"] if dialect == "fanuc" else []), ""])


def write_sheet(trial: Trial, channels: Sequence[Channel], every: float = 0.0) -> str:
    """Return the measurement sheet of a test: a CSV file with the times; once filled in, it is a recording.

    Parameters
    ----------
    trial : Trial
    channels : sequence of Channel
        Temperatures and displacements to be recorded.
    every : float
        Time between two measurements [s]; 0: half an hour.

    Returns
    -------
    str
    """
    text = io.StringIO()
    sheet = csv.writer(text, lineterminator="\n")
    names = [c.name for c in channels if c.quantity != "spindle_speed"]
    if trial.kind == "random":
        text.write(f"# speeds in a random order, seed {trial.seed}\n")
    sheet.writerow(["time_min", "spindle_rpm", *map(defuse, names), "action"])
    parts = list(stretches(trial, every))
    before = 0.0
    for part in parts:
        do = "record all values"
        if part.first and part.start:
            do += f", then {f'run at {part.speed:.0f} 1/min' if part.speed else 'stop the spindle'}"
        if trial.kind == "room" and part.first and part.start:
            do = "record all values, then let the room temperature change: heating, doors, night"
        # the speed of a row is that of the preceding period
        sheet.writerow([f"{part.start / 60:g}", f"{before:g}", *[""] * len(names), do])
        before = part.speed
    sheet.writerow(
        [f"{trial.duration / 60:g}", f"{before:g}", *[""] * len(names), "record all values: end of the test"]
    )
    return text.getvalue()


def write_test(
    trial: Trial,
    program: Path,
    channels: Sequence[Channel],
    *,
    dialect: Dialect = "linuxcnc",
    every: float = 0.0,
    picture: bytes = b"",
    overwrite: bool = False,
) -> Path:
    """Write a test: its NC program, and next to it the sheet and a figure that shows the purpose of the test.

    Parameters
    ----------
    trial : Trial
    program : Path
    channels : sequence of Channel
        As for `write_sheet`.
    dialect, every
        As for `write_program`.
    picture : bytes
        Figure as PNG; empty: none.
    overwrite : bool

    Returns
    -------
    Path
        Path of the sheet.

    Raises
    ------
    InputError
        The test or a file cannot be written; see `thermocomp.files.draft.drafts`.
    """
    sheet = sheet_of(program)
    contents = {
        sheet: write_sheet(trial, channels, every).encode("utf-8"),
        program: write_program(trial, dialect, every).encode("ascii"),
    }
    if picture:
        contents = {picture_of(program): picture} | contents
    with drafts(list(contents), overwrite=overwrite) as started:
        for target, content in contents.items():
            started[target].write_bytes(content)
        started.publish()
    return sheet


def sheet_of(program: Path) -> Path:
    """Return the path of the sheet of a program."""
    return program.with_suffix(".csv")


def picture_of(program: Path) -> Path:
    """Return the path of the figure of a program."""
    return program.with_suffix(".png")


def clock(seconds: float) -> str:
    """Return a time as hours and minutes, such as 6:15."""
    minutes = round(seconds / 60)
    return f"{minutes // 60}:{minutes % 60:02d}"


def _length(trial: Trial, part: ProgramStretch) -> str:
    """Return the duration until the next change of speed, as text."""
    end, own = 0.0, 0.0
    for _, duration in trial.steps:
        if end <= part.start + 1e-6:
            own = duration
        end += duration
    return f"{own / 60:g} min" if own < 3600 else f"{own / 3600:g} h"


def _head(trial: Trial, dialect: Dialect, every: float) -> Iterator[str]:
    if dialect == "fanuc":
        yield "%"
        yield "O1001 (THERMAL TEST)"
    yield _comment("thermal test, planned by thermocomp", dialect)
    yield _comment(trial.words.translate(str.maketrans("", "", ",()")), dialect)
    yield _comment(f"total {clock(trial.duration)} h, no axis moves", dialect)
    yield _comment("before the start: machine rested, spindle free to turn, door closed", dialect)
    if trial.kind == "room":
        yield _comment("the room temperature must change during the test", dialect)
    if every and dialect == "linuxcnc":
        yield "o<probe> sub"
        yield _comment("fill in: approach, G38.2, record the value, retract; as written, nothing moves", dialect)
        yield "o<probe> endsub"
    yield "G97"
    yield "M5"


def _measure(dialect: Dialect) -> list[str]:
    """Return the lines of a measurement with the spindle stopped."""
    return ["o<probe> call"] if dialect == "linuxcnc" else ["(FILL IN: G65 P9810 X Y Z F, YOUR PROBING CYCLE)"]


def _comment(text: str, dialect: Dialect) -> str:
    return f"({text.upper() if dialect == 'fanuc' else text})"
