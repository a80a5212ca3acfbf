"""Terminal output of `check`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from thermocomp.api.check import CheckedRecordings
from thermocomp.cli.terminal import marked, print_table, words
from thermocomp.recordings.checks.findings import SEVERITIES, Finding
from thermocomp.recordings.recording import Recording
from thermocomp.report import records
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout, Toned

_TONES = {"trouble": "grave", "warning": "doubtful", "info": "soft"}
#: worst finding of a recording, the most serious first
_GRADES = (*SEVERITIES, None)
#: number of findings of one kind printed in full; for the rest only the channels are listed
_FULL = 4


def show_check(found: CheckedRecordings, console: Console) -> None:
    """Print a summary and all problems of recordings."""
    for r, mine, content in zip(found.recordings, found.findings, found.to_dict()["recordings"], strict=True):
        _show(r, mine, content, console)


def answer_check(found: CheckedRecordings, files: Sequence[Path], following: Sequence[str]) -> CommandAnswer:
    """Return the answer of ``check``: the recordings, the worst first, and the worst finding."""
    contents = sorted(found.to_dict()["recordings"], key=lambda r: _GRADES.index(r["worst"]))
    named = [(f, f"{r.name}:" if len(contents) > 1 else "") for r, fs in _pairs(found) for f in fs]
    told = sorted(named, key=lambda x: _GRADES.index(x[0].severity))
    bad = [
        " ".join(filter(None, (where, f.channel, f"{f.text}{_remedy(f)}"))) for f, where in told if f.severity != "info"
    ]
    temperatures, displacements = (max(_count(r, q) for r in contents) for q in ("temperature", "displacement"))
    amounts = {
        "recording": len(contents),
        "temperature": temperatures,
        "displacement": displacements,
        "thermal cycle": sum(len(r["cycles"]) for r in contents),
    }
    short = sum(records.count_short(r.cycles) for r in found.recordings)
    few = f" ({short} of them short)" * (short > 0 and amounts["thermal cycle"] > records.MOST_CYCLES)
    told_amounts = ", ".join(_amount(n, what) for what, n in amounts.items())
    head = f"{told_amounts}{few}: {_amount(len(bad), 'problem')} found."
    return CommandAnswer(head=head, table=_overview(contents), warnings=bad, files=files, following=following)


def _pairs(found: CheckedRecordings) -> list[tuple[Recording, Sequence[Finding]]]:
    return list(zip(found.recordings, found.findings, strict=True))


def _count(recording: dict[str, Any], quantity: str) -> int:
    return sum(c["quantity"] == quantity for c in recording["channels"])


def _amount(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"


def _remedy(finding: Finding) -> str:
    return "" if finding.remedy is None else f" (in a mapping: {records.remedy(finding.remedy)})"


def _overview(recordings: Sequence[dict[str, Any]]) -> Layout:
    columns = (
        Column("file", lambda r: Path(r["source"]).name or r["name"]),
        Column("rows", "rows", ">", whole=True),
        Column("hours", "hours", ".2f", whole=True),
        Column("cycles", lambda r: len(r["cycles"]), ">", whole=True),
        Column("worst", lambda r: _graded(r["worst"] or "nothing")),
        Column("first finding", _first),
    )
    return Layout(columns, recordings)


def _graded(severity: str) -> Toned:
    return Toned(severity, _TONES.get(severity, "good"))


def _first(r: dict[str, Any]) -> str:
    if not r["findings"]:
        return ""
    first, *more = r["findings"]
    return f"{first['kind']} {first['channel']}".strip() + (f", {len(more)} more" if more else "")


def _show(r: Recording, found: Sequence[Finding], content: dict[str, Any], console: Console) -> None:
    console.print(
        f"[bold]{words(r.source or r.name)}[/]: {len(r)} rows, {content['hours']:.2f} h, "
        f"a row every {r.sampling_interval:g} s" + (f", from {words(r.start)}" if r.start else "")
    )
    columns = (Column("channel", "name"), Column("quantity", "quantity"), Column("unit", "unit"), *records.RANGE)
    print_table(Layout(columns, content["channels"]), console)
    console.print(words(records.describe_cycles(r)))
    told = {f.text for f in found}
    for note in r.notes:
        if note not in told:  # an excluded column is also a finding
            console.print(f"[dim]note[/] {words(note)}")
    for kind in dict.fromkeys((f.severity, f.kind) for f in found):
        mine = [f for f in found if (f.severity, f.kind) == kind]
        for f in mine[:_FULL]:
            where = f"{words(f.channel)} " if f.channel else ""
            console.print(f"{marked(_graded(f.severity))} [bold]{where}[/]{words(f.text)}")
            if f.remedy is not None:
                console.print(f"  [dim]in a mapping: {words(records.remedy(f.remedy))}[/]")
        if rest := [f.channel for f in mine[_FULL:]]:
            console.print(f"{marked(_graded(kind[0]))} {kind[1]}, {len(rest)} more: [bold]{words(', '.join(rest))}[/]")
    if any(f.remedy is not None for f in found):
        console.print(
            "[dim]thermocomp map FILE writes these lines into a mapping, one after the other, asking first[/]"
        )
    if not found:
        console.print("[green]nothing wrong found[/]")
