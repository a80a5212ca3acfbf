"""Header comment of a revised program: what was done, and that it must not be revised again."""

import re
import textwrap
from collections.abc import Sequence

from thermocomp.nc.parser.line import Line

#: beginning of every header line; a program with such a line has been revised
MARK = "THERMOCOMP"
#: default number of header lines, fixed before their content is known at the end of the program
LINES = 9
#: maximum width of a comment on old controls
WIDTH = 78
#: characters available for text in a line
ROOM = WIDTH - len(MARK) - 3

_NUMBER = re.compile(r"\s*[O:]\s*\d+\b", re.IGNORECASE)
#: brackets end a comment; % ends a program on old controls, even in a comment; ; ends a block on some controls
_TOLD = str.maketrans("()%;", "[]_,")


def make_blank(ending: str, lines: int = LINES) -> tuple[str, ...]:
    """Return a header of empty comment lines, to be filled in later."""
    return tuple(f"({MARK} {k}){ending}" for k in range(lines))


def fill(facts: Sequence[str], ending: str, lines: int = LINES, *, upper: bool = False) -> tuple[str, ...]:
    """Return the header with its texts filled in."""
    said = ["REVISED FOR THERMAL DRIFT: DO NOT REVISE AGAIN", *facts]
    said += ["-"] * (lines - len(said))
    texts = (clean_comment(text)[:ROOM] for text in said[:lines])
    return tuple(f"({MARK} {text.upper() if upper else text}){ending}" for text in texts)


def clean_comment(text: str) -> str:
    """Return a text that is valid in any comment: printable ASCII without characters that end one."""
    return "".join(c if " " <= c <= "~" else "_" for c in text.translate(_TOLD))


def wrap_text(text: str, lines: int | None = None) -> list[str]:
    """Return a text divided into header lines, as many as needed; dots replace the part beyond a maximum number."""
    return textwrap.wrap(text, ROOM, max_lines=lines, placeholder=" ...")


def refuse_revised(line: Line) -> None:
    """Raise `ProgramError` if a comment shows that the program has been revised."""
    if f"{MARK} REVISED" in line.comment:
        raise line.fault(
            "has been revised by thermocomp already: its drift would be corrected twice; revise the original",
        )


def comes_first(line: Line) -> bool:
    """Return whether a line must stay before the header: ``%``, the program number, or an empty line."""
    return line.demarcation or not line.text.strip() or bool(_NUMBER.match(line.text) and not line.flow)
