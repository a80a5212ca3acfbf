"""Terminal output: tables and highlighted text."""

from collections.abc import Iterable, Iterator
from typing import Any

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook
from rich.markup import escape
from rich.segment import Segment
from rich.table import Table

from thermocomp.core.shown import replace_unprintable
from thermocomp.report.layout import Item, Layout, Toned, verdict


def make_console(**how: Any) -> Console:
    """Return a console that prints text unaltered (no emoji for ``:names:``) and executes no control codes.

    Parameters
    ----------
    **how
        Keyword arguments passed to `rich.console.Console`.
    """
    made = Console(highlight=False, emoji=False, **how)
    made.push_render_hook(_Printable())
    return made


class _Printable(RenderHook):
    """Filter that removes cursor-moving characters from all printed text."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        return [_Cleaned(r) for r in renderables]


class _Cleaned:
    def __init__(self, inner: ConsoleRenderable) -> None:
        self.inner = inner

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        for part in console.render(self.inner, options):
            text = part.text if part.control else "\n".join(map(replace_unprintable, part.text.split("\n")))
            yield part._replace(text=text)


#: console of all commands
console = make_console()

_TONES = {
    "good": "green",
    "doubtful": "yellow",
    "bad": "red",
    "grave": "bold red",
    "soft": "dim",
    "strong": "bold",
    "chosen": "bold green",
}
#: styles of highlighted rows
ROW_STYLES = {"best": "bold green", "none": "dim"}


def words(text: object) -> str:
    """Return external text, typed or from files, escaped for rich: without markup, cursor control and line breaks.

    All such text passes through here before it is printed; a test checks this.
    """
    return escape(replace_unprintable(text))


def marked(text: str) -> str:
    """Return text for rich, in its tone if it has one."""
    return f"[{_TONES[text.tone]}]{words(text)}[/]" if isinstance(text, Toned) else words(text)


def mark(word: str) -> str:
    """Return a verdict, coloured."""
    return marked(verdict(word))


def print_items(items: Iterable[Item], console: Console) -> None:
    """Print lines and tables."""
    for item in items:
        if isinstance(item, Layout):
            print_table(item, console)
        else:
            console.print(f"{marked(item.mark) if item.mark else ''}{words(item.text)}", soft_wrap=item.whole)


def print_table(t: Layout, console: Console, **how: Any) -> None:
    """Print a table.

    Parameters
    ----------
    t : Layout
    console : Console
    **how
        Keyword arguments passed to `rich.table.Table`.
    """
    table = Table(title=words(t.title) or None, caption=words(t.caption) or None, **how)
    for c in t.columns:
        # wrappable cells are folded, not cut; a number that does not fit is visibly cut
        table.add_column(
            words(f"{c.heading}, {c.unit}" if c.unit else c.heading),
            justify="right" if c.form else "left",
            no_wrap=c.whole,
            overflow="ellipsis" if c.whole else "fold",
        )
    for k, row in enumerate(t.rows):
        if k in t.sections:
            table.add_section()
        table.add_row(*(marked(c.text(row)) for c in t.columns), style=ROW_STYLES.get(t.tone(k)))
    console.print(table)
    if t.note:
        console.print(words(t.note), style="dim")
