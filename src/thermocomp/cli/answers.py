"""Answer of a command: at most twelve lines and one table; all other results are printed with ``--details`` only."""

import shlex
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from thermocomp.cli.terminal import ROW_STYLES, marked, words
from thermocomp.core.shown import shorten
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Layout, PrintedLine, Toned

#: largest number of lines, and of lines of the table without its heading
LINES, ROWS = 12, 25
#: lines left for what is printed before the answer: a data-quality problem, and the progress of the first minutes
BEFORE = 3
#: largest length of a word in a cell [characters]
WORD = 26


def fold(text: str, lines: int, width: int, more: str = "") -> list[str]:
    """Return a text and `more` in lines of whole words; a text that does not fit ends with dots before `more`."""
    kept, dots = text[: lines * width].split(" "), ""
    if len(text) > lines * width:
        kept[-1], dots = "", " ..."
    while True:
        told = f"{' '.join(kept).rstrip()}{dots}{more}"
        folded = textwrap.wrap(told, width, break_long_words=False, break_on_hyphens=False)
        if len(folded) <= lines or len(kept) < 2:
            return folded
        kept.pop()
        dots = " ..."


def free(name: str) -> Path:
    """Return a path of the current folder that does not exist: the name, or the name with a number."""
    path, number = Path(name), 1
    while path.exists():
        number += 1
        path = Path(name).with_stem(f"{Path(name).stem}-{number}")
    return path


def count_others(number: int) -> str:
    """Return the number of warnings that are not printed, and how to print them."""
    return f" ({number} more: --details)" if number else ""


def print_answer(
    answer: CommandAnswer, console: Console, *, hint: bool = True, count: bool = False, room: int = LINES - BEFORE
) -> None:
    """Print an answer.

    Parameters
    ----------
    answer : CommandAnswer
    console : Console
    hint : bool
        Say that ``--details`` prints more.
    count : bool
        Without the hint: add the number of further warnings to the first.
    room : int
        Largest number of lines.
    """
    written = [f"Written: {', '.join(map(str, answer.files))}"] if answer.files else []
    if len(answer.files) > 1:  # a single path is never cut
        written = fold(written[0], 2, console.width)
    following = _command(answer.following, console.width) if answer.following else []
    warned = [PrintedLine(text, Toned("Warning: ", "doubtful")) for text in answer.warnings[:1]]
    uncounted = count_others(max(len(answer.warnings) - 1, 0)) if count else ""
    left = room - len(written) - hint - len(following)
    for head, each in ((3, 2), (2, 2), (2, 1), (1, 1)):
        first = _folded(PrintedLine(answer.head), head, console) if answer.head else []
        others = [text for line in answer.lines for text in _folded(line, each, console)]
        others += [text for line in warned for text in _folded(line, each, console, uncounted)]
        if len(first) + len(others) <= left:
            break
    _print(first, console)
    rows = 0 if answer.table is None else _print_table(answer.table, console)
    _print(others, console)
    _print(map(words, written), console)
    if hint:
        hidden = ((rows, "rows"), (len(answer.warnings) - 1, "warnings"))
        more = [
            *(f"{n} more {what if n > 1 else what.removesuffix('s')}" for n, what in hidden if n > 0),
            "all results",
        ]
        console.print(words(f"--details prints {' and '.join(more)}."), style="dim", soft_wrap=True)
    for text in following:
        console.print(text, markup=False, soft_wrap=True)  # a mark-up would double the backslashes


def print_folded(line: PrintedLine, lines: int, console: Console, more: str = "") -> None:
    """Print a line of text, in at most `lines` lines of the terminal, before an answer."""
    _print(_folded(line, lines, console, more), console)


def _folded(line: PrintedLine, lines: int, console: Console, more: str = "") -> list[str]:
    """Return a line of text as marked lines of the terminal."""
    mark = line.mark or Toned("", "strong")
    first, *rest = fold(f"{mark}{line.text}", lines, console.width, more)
    return [f"{marked(mark)}{words(first.removeprefix(mark))}", *map(words, rest)]


def _print(folded: Iterable[str], console: Console) -> None:
    for text in folded:
        console.print(text, soft_wrap=True)


def _command(command: Sequence[str], width: int) -> list[str]:
    """Return a command in lines that a shell joins, none of which ends with the name of an option."""
    lines, quoted = ["Next:"], [shlex.quote(word) for word in command]
    for word, after in zip(quoted, [*quoted[1:], ""], strict=True):
        needed = len(f"{word} {after}" if word.startswith("-") else word)
        if len(lines[-1]) + needed + 3 > width:
            lines[-1] += " \\"
            lines.append("   ")
        lines[-1] += f" {word}"
    return lines


def _print_table(t: Layout, console: Console) -> int:
    """Print a table without breaking words; return the number of rows that do not fit."""
    heads = [f"{c.heading}, {c.unit}" if c.unit else c.heading for c in t.columns]
    rows = [[_shortened(c.text(row), WORD) for c in t.columns] for row in t.rows]
    widths = _widths([heads, *rows], console.width)
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    for c, head, width in zip(t.columns, heads, widths, strict=True):
        table.add_column(words(head), justify="right" if c.form else "left", width=width)
    used = shown = 0
    for k, row in enumerate(rows):
        cells = [_shortened(cell, width) for cell, width in zip(row, widths, strict=True)]
        used += max(len(textwrap.wrap(cell, width)) for cell, width in zip(cells, widths, strict=True))
        if used > ROWS:
            break
        table.add_row(*map(marked, cells), style=ROW_STYLES.get(t.tone(k)))
        shown += 1
    console.print("", table, "", sep="\n")
    return len(rows) - shown


def _shortened(cell: str, longest: int) -> str:
    """Return a cell without words longer than a number of characters."""
    text = " ".join(shorten(word, max(longest, 4)) for word in cell.split())
    return Toned(text, cell.tone) if isinstance(cell, Toned) else text


def _widths(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the width of each column: headings in the first row are folded first, then the widest cells."""
    columns = list(zip(*rows, strict=True))
    least = [max((len(word) for cell in column for word in cell.split()), default=1) for column in columns]
    cells = [max(own, *map(len, column[1:]), 1) for own, column in zip(least, columns, strict=True)]
    widths = [max(own, len(column[0])) for own, column in zip(cells, columns, strict=True)]
    while sum(widths) + 2 * (len(widths) - 1) > width:
        loose = next(k for k in (_wider(widths, cells), _wider(widths, least), range(len(widths))) if k)
        widths[max(loose, key=lambda k: widths[k])] -= 1
    return widths


def _wider(widths: Sequence[int], least: Sequence[int]) -> list[int]:
    """Return the columns that are wider than a least width."""
    return [k for k, (own, other) in enumerate(zip(widths, least, strict=True)) if own > other]
