"""Process that reads files for the page: one task as JSON on standard input, its result as JSON on standard output.

Files of others are read here and not in the server: a file that takes too long or too much memory ends this process
alone, and the training code is never loaded by the server.
"""

import json
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from tomlkit.exceptions import TOMLKitError

from thermocomp.app.project import settings_of
from thermocomp.app.store import NAME
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.columns import plan
from thermocomp.recordings.readers.mapping import Mapping as ColumnMapping
from thermocomp.recordings.readers.mending import Draft, located, mend, take_best, to_toml
from thermocomp.recordings.readers.opening import open_table
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.readers.workbook import list_sheets
from thermocomp.recordings.recording import Recording
from thermocomp.report import checks
from thermocomp.report.language import translate, use_language

#: first rows and columns shown, and points of a curve
ROWS, COLUMNS, POINTS = 8, 200, 3000


def preview(file: str, mapping: str, guess: bool, answers: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what a file contains, how its columns were understood, what is wrong with it, and its curves.

    Parameters
    ----------
    file : str
        Path of the recording.
    mapping : str
        TOML of its mapping, to which `answers` are added; it may be empty.
    guess : bool
        Take the best guess where something is unknown.
    answers : list of mapping
        Entries added to the mapping.

    Returns
    -------
    dict
        ``mapping`` is the new TOML. Of a file that cannot be read there are ``error`` and ``options``, the possible
        entries of the mapping.
    """
    draft = Draft(mapping)
    for answer in answers:
        try:
            draft = Draft() if "sheet" in answer.get("read", {}) else draft  # of another sheet all is different
            draft.add(answer)
            draft.text.encode()  # half a character
        except (AttributeError, TypeError, ValueError, TOMLKitError) as e:
            raise InputError(f"{str(answer)[:200]} is no entry of a mapping: {e}") from e
    text = draft.text
    try:
        mended = mend(file, text, take_best if guess else lambda _: None, translate)
    except InputError as e:
        message = str(e).removeprefix(f"{file}: ")
        options = [_option(r, to_toml(r)) for r in e.remedies]
        return {"mapping": text, "error": message, "options": options, **_raw(file, draft)}
    recording, whole = mended.recording, Draft(mended.text).mapping(file)
    findings = check(recording)
    table, told = open_table(file, whole)[0], {f.text for f in findings}
    ways = [located(f, recording, whole, table.headings) if f.remedy else {} for f in findings]
    return {
        "mapping": mended.text,
        "ignored": {name: c.reason for name, c in whole.columns.items() if c.role == "ignore" and c.reason},
        **_sheets(file, whole),
        "summary": translate(_summary(recording)),
        "columns": _columns(table, whole),
        "questions": [
            {"text": translate(q.text), "severity": q.severity, "options": [_option(o, to_toml(o)) for o in q.options]}
            for q, answer in mended.decided
            if answer is None and q.severity in ("error", "column")
        ],
        "findings": [
            {
                "severity": f.severity,
                "channel": f.channel,
                "text": translate(f.text),
                **_option(way, to_toml(way) if way else ""),
            }
            for f, way in zip(findings, ways, strict=True)
        ],
        "notes": [translate(n) for n in dict.fromkeys((*recording.notes, *recording.changed)) if n not in told],
        "targets": [c.name for c in recording.displacements],
        "inputs": {  # and whether they are inputs of the models if none are named
            **{c.name: True for c in recording.temperatures},
            **{c.name: k == 0 for k, c in enumerate(recording.of_quantity("spindle_speed"))},
        },
        "cycles": [{"name": c.name, "start_s": float(recording.time[c.start])} for c in recording.cycles],
        "origin_s": recording.origin,
        "panels": checks.panels(recording, findings, POINTS),
    }


def _summary(r: Recording) -> Message:
    return Message(
        "{name}: {rows} rows, {hours:.1f} h, temperatures: {temperatures}, displacements: {displacements}, thermal "
        "cycles: {cycles}",
        name=r.name,
        rows=len(r),
        hours=float(r.time[-1]) / 3600,
        temperatures=len(r.temperatures),
        displacements=len(r.displacements),
        cycles=len(r.cycles),
    )


def settings(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return an empty dict if settings of a project are valid.

    Raises
    ------
    InputError
        They are not.
    """
    settings_of(content, NAME)
    return {}


def _option(remedy: Mapping[str, Any], text: str) -> dict[str, Any]:
    return {"remedy": remedy, "toml": text}


def _sheets(file: str, mapping: ColumnMapping) -> dict[str, Any]:
    """Return the sheets of a workbook, and the one that the mapping names."""
    path = Path(file)
    names = list_sheets(path, mapping.limits) if path.suffix.lower() in (".xlsx", ".ods") else []
    return {"sheets": names[:COLUMNS], "sheet": mapping.read.sheet} if len(names) > 1 else {}


def _raw(file: str, draft: Draft) -> dict[str, Any]:
    """Return what is known of a file that cannot be read: its sheets, its first rows."""
    found: dict[str, Any] = {}
    with suppress(Exception):  # it is damaged in one way or another, and the reason is known
        found |= _sheets(file, mapping := draft.mapping(file))
        table = open_table(file, mapping)[0]
        found |= {
            "columns": [
                {"heading": h, "number": k + 1, "cells": _cells(table, k), "kind": "ignored", "scale": 1.0}
                for k, h in enumerate(table.headings[:COLUMNS])
            ]
        }
    return found


def _cells(table: FileTable, column: int) -> list[str]:
    if cells := table.head(column)[:ROWS]:
        return cells
    if not table.is_number(column, empty=False):
        return []
    return [f"{v:g}" for v in table.load([column], [])[0][column].head(ROWS)]


def _columns(table: FileTable, mapping: ColumnMapping) -> list[dict[str, Any]]:
    """Return the first columns of a file: heading, first cells, and how they are understood."""
    planned = plan(table, mapping)
    channels = {c.index: c for c in planned.columns}
    times = {planned.times.time, planned.times.date, *planned.beside}
    found = []
    for k, heading in enumerate(table.headings[:COLUMNS]):
        c = channels.get(k)
        if k in times:
            kind = "time"
        elif k == planned.cycle:
            kind = "cycle"
        else:
            kind = "ignored" if c is None else c.channel.quantity
        found.append(
            {
                "heading": heading,
                "number": k + 1,
                "cells": _cells(table, k),
                "kind": kind,
                "channel": "" if c is None else c.channel.name,
                "unit": planned.time_unit if kind == "time" else "" if c is None else c.unit.symbol,
                "scale": 1.0 if c is None else c.rule.scale,
            }
        )
    return found


_TASKS: dict[str, Callable[..., dict[str, Any]]] = {"preview": preview, "settings": settings}


def do_task(task: dict[str, Any]) -> dict[str, Any]:
    """Return the result of a task: its name, the language of the texts, and the keywords of its function.

    Raises
    ------
    InputError
        The task is refused.
    """
    given = dict(task)
    with use_language(given.pop("language", "") or "en"):
        return _TASKS[given.pop("task")](**given)


def main() -> None:
    """Do the task on standard input."""
    task = sys.stdin.read()
    if not task:  # the server has ended
        return
    try:
        found = do_task(json.loads(task))
    except InputError as e:
        found = {"refused": str(e)}
    sys.stdout.write(json.dumps(found, allow_nan=False))


if __name__ == "__main__":
    main()
