"""The comment at the top of a revised program: what was done to it, and that it must not be done again."""

import re
import textwrap
from collections.abc import Sequence

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.parser.line import Line

#: every line of a header begins so; a program that has one has been revised
MARK = "THERMOCOMP"
#: lines of a header if nobody says how many: what they say is known only when the program has been read to its end
LINES = 9
#: widest comment that old controls read
WIDTH = 78
#: room for words in a line
ROOM = WIDTH - len(MARK) - 3

_NUMBER = re.compile(r"\s*[O:]\s*\d+\b", re.IGNORECASE)
#: brackets end a comment; % ends a program on old controls, even in a comment; ; ends a block on some
_TOLD = str.maketrans("()%;", "[]_,")


def make_blank(ending: str, lines: int = LINES) -> tuple[str, ...]:
    """Return a blank header."""
    return tuple(f"({MARK} {k}){ending}" for k in range(lines))


def fill(facts: Sequence[str], ending: str, lines: int = LINES, *, upper: bool = False) -> tuple[str, ...]:
    """Return the header.

    Parameters
    ----------
    facts : sequence of str
        At most ``lines - 1``; what does not fit into a comment is cut or replaced.
    ending : str
        Line ending.
    lines : int
        Number of lines.
    upper : bool
        In capitals: old controls have no small letters.

    Returns
    -------
    tuple of str
    """
    said = ["REVISED FOR THERMAL DRIFT: DO NOT REVISE AGAIN", *facts]
    said += ["-"] * (lines - len(said))
    texts = (clean_comment(text)[:ROOM] for text in said[:lines])
    return tuple(f"({MARK} {text.upper() if upper else text}){ending}" for text in texts)


def clean_comment(text: str) -> str:
    """Return a text that is valid in any comment: printable ASCII without characters that end one."""
    return "".join(c if " " <= c <= "~" else "_" for c in text.translate(_TOLD))


def wrap_text(text: str, lines: int | None = None) -> list[str]:
    """Return a text in lines of a header, as many as needed; dots replace the part beyond a given number."""
    return textwrap.wrap(text, ROOM, max_lines=lines, placeholder=" ...")


def refuse_revised(line: Line) -> None:
    """Raise `ProgramError` if a comment shows that the program has been revised."""
    if f"{MARK} REVISED" in line.comment:
        raise ProgramError(
            line.number,
            "has been revised by thermocomp already: its drift would be corrected twice; revise the original",
        )


def comes_first(line: Line) -> bool:
    """Return whether a line has to stay before the header: ``%``, the program's number, nothing at all."""
    return line.demarcation or not line.text.strip() or bool(_NUMBER.match(line.text) and not line.flow)
