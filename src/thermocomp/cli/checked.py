"""What `check` prints: tables for people, JSON for machines."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from thermocomp.cli.jsonoutput import print_json
from thermocomp.recording.findings import Finding
from thermocomp.recording.recording import Recording

_STYLE = {"trouble": "bold red", "warning": "yellow", "info": "dim"}
#: files beyond which each gets one line
MANY = 3
#: findings of one kind that are printed in full; of the others the channels are named
_FULL = 4


def show_check(
    tests: Sequence[Recording],
    findings: Sequence[Sequence[Finding]],
    page: Path | None,
    console: Console,
    *,
    as_json: bool,
) -> None:
    """Print what recordings hold and what is wrong with them; of more than three, one line each.

    Parameters
    ----------
    tests : sequence of Recording
    findings : sequence of sequence of Finding
        Of each recording, the gravest first.
    page : Path or None
        Page that was written.
    console : Console
    as_json : bool
        Print JSON instead of tables.
    """
    if as_json:
        recordings = [recording_content(r, found) for r, found in zip(tests, findings, strict=True)]
        print_json({"recordings": recordings, "page": None if page is None else str(page)}, console)
        return
    if len(tests) > MANY:
        console.print(_overview(tests, findings))
        console.print("[dim]name a file alone to see all that was found in it, or write a page with -o[/]")
    else:
        for r, found in zip(tests, findings, strict=True):
            _show(r, found, console)
    if page is not None:
        console.print(f"Page: {escape(str(page))}", soft_wrap=True)


def _overview(tests: Sequence[Recording], findings: Sequence[Sequence[Finding]]) -> Table:
    table = Table()
    for heading in ("file", "rows", "hours", "cycles", "worst", "first finding"):
        right = heading in ("rows", "hours", "cycles")
        table.add_column(heading, justify="right" if right else "left", overflow="fold", no_wrap=right)
    for r, found in zip(tests, findings, strict=True):
        worst = found[0].severity if found else "nothing"
        first = f"{found[0].kind} {found[0].channel}".strip() if found else ""
        more = f", {len(found) - 1} more" if len(found) > 1 else ""
        table.add_row(
            escape(r.source or r.name),
            str(len(r)),
            f"{(r.time[-1] - r.time[0]) / 3600:.2f}",
            str(len(r.cycles)),
            f"[{_STYLE.get(worst, 'green')}]{worst}[/]",
            escape(first + more),
        )
    return table


def _show(r: Recording, found: Sequence[Finding], console: Console) -> None:
    hours = (r.time[-1] - r.time[0]) / 3600
    console.print(
        f"[bold]{escape(r.source or r.name)}[/]: {len(r)} rows, {hours:.2f} h, "
        f"a row every {r.sampling_interval:g} s" + (f", from {r.start}" if r.start else "")
    )
    table = Table()
    for heading in ("channel", "quantity", "unit", "smallest", "largest", "missing"):
        table.add_column(heading, justify="right" if heading in ("smallest", "largest", "missing") else "left")
    for c in r.channels:
        values = r.table[c.name].to_numpy()
        finite = values[np.isfinite(values)]
        low, high = (f"{finite.min():.4g}", f"{finite.max():.4g}") if finite.size else ("", "")
        table.add_row(escape(c.name), c.quantity, c.unit, low, high, str(len(values) - finite.size or ""))
    console.print(table)
    cycles = ", ".join(f"{c.name}: rows {c.start}-{c.stop - 1}" for c in r.cycles)
    console.print(f"{len(r.cycles)} thermal cycle(s): {escape(cycles)}")
    told = {f.text for f in found}
    for note in r.notes:
        if note not in told:  # a column that was left out is a finding too
            console.print(f"[dim]note[/] {escape(note)}")
    for kind in dict.fromkeys((f.severity, f.kind) for f in found):
        mine = [f for f in found if (f.severity, f.kind) == kind]
        for f in mine[:_FULL]:
            where = f"{escape(f.channel)} " if f.channel else ""
            console.print(f"[{_STYLE[f.severity]}]{f.severity}[/] [bold]{where}[/]{escape(f.text)}")
        if rest := [f.channel for f in mine[_FULL:]]:
            style = f"[{_STYLE[kind[0]]}]{kind[0]}[/]"
            console.print(f"{style} {kind[1]}, {len(rest)} more: [bold]{escape(', '.join(rest))}[/]")
    if not found:
        console.print("[green]nothing wrong found[/]")


def recording_content(r: Recording, found: Sequence[Finding]) -> dict[str, Any]:
    """Return a recording and its findings as plain numbers and text."""
    return {
        "name": r.name,
        "source": r.source,
        "rows": len(r),
        "hours": float(r.time[-1] - r.time[0]) / 3600,
        "sampling_interval_s": r.sampling_interval,
        "channels": [{"name": c.name, "quantity": c.quantity, "unit": c.unit, "place": c.place} for c in r.channels],
        "cycles": [{"name": c.name, "start": c.start, "stop": c.stop} for c in r.cycles],
        "notes": list(r.notes),
        "worst": found[0].severity if found else None,
        "findings": [
            {
                "severity": f.severity,
                "kind": f.kind,
                "channel": f.channel,
                "text": f.text,
                "row": f.row,
                "rows": None if f.rows is None else stretches(f.rows),
            }
            for f in found
        ],
    }


def stretches(rows: Sequence[int] | np.ndarray[Any, Any]) -> list[list[int]]:
    """Return rows as stretches: first row, and the row after the last."""
    ordered = np.unique(rows)
    cuts = [0, *(np.flatnonzero(np.diff(ordered) > 1) + 1).tolist(), len(ordered)]
    return [[int(ordered[a]), int(ordered[b - 1]) + 1] for a, b in pairwise(cuts)] if len(ordered) else []
