"""What a terminal shows: tables, and words that stand out."""

from collections.abc import Collection
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from thermocomp.report.layout import Column, Layout, Toned, verdict

#: of all commands
console = Console(highlight=False)

_TONES = {"good": "green", "doubtful": "yellow", "bad": "red", "grave": "bold red", "soft": "dim", "strong": "bold"}
_ROWS = {"best": "bold green", "none": "dim"}


def marked(text: str) -> str:
    """Return text for rich, in its tone if it has one."""
    return f"[{_TONES[text.tone]}]{escape(text)}[/]" if isinstance(text, Toned) else escape(text)


def mark(word: str) -> str:
    """Return a verdict in its colour."""
    return marked(verdict(word))


def print_table(t: Layout, console: Console, **how: Any) -> None:
    """Print a table; where it is too wide, its lists of names follow below it.

    Parameters
    ----------
    t : Layout
    console : Console
    **how
        Of `rich.table.Table`.
    """
    lists = [c for c in t.columns if c.below]
    table = _table(t, (), how)
    if lists and console.measure(table).maximum > console.width:
        table = _table(t, lists, how)
    else:
        lists = []
    console.print(table)
    for column in lists:
        console.print(f"[dim]{escape(column.heading)}[/]")
        for k, row in enumerate(t.rows):
            told = f"  {escape(t.columns[0].text(row))}: {escape(column.text(row))}"
            console.print(told, style=_ROWS.get(t.tone(k)))
    if t.note:
        console.print(escape(t.note), style="dim")


def _table(t: Layout, without: Collection[Column], how: dict[str, Any]) -> Table:
    table = Table(title=escape(t.title) or None, caption=escape(t.caption) or None, **how)
    columns = [c for c in t.columns if c not in without]
    for c in columns:
        # what may be broken is folded, not cut; a number that finds no room shows that it is cut
        heading = escape(f"{c.heading}, {c.unit}" if c.unit else c.heading)
        table.add_column(
            heading,
            justify="right" if c.form else "left",
            no_wrap=c.whole,
            overflow="ellipsis" if c.whole else "fold",
        )
    for k, row in enumerate(t.rows):
        if k in t.sections:
            table.add_section()
        table.add_row(*(marked(c.text(row)) for c in columns), style=_ROWS.get(t.tone(k)))
    return table
