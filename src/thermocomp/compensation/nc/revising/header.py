"""The comment at the top of a revised program: what was done to it, and that it must not be done again."""

import re

from thermocomp.compensation.nc.reading.line import Line
from thermocomp.core.exceptions import ProgramError

#: every line of a header begins so; a program that has one has been revised
MARK = "THERMOCOMP"
#: lines of a header, always so many: what they say is known only when the program has been read to its end
LINES = 9
#: widest comment that old controls read
WIDTH = 78

_NUMBER = re.compile(r"\s*[O:]\s*\d+\b", re.IGNORECASE)


def blank(ending: str) -> tuple[str, ...]:
    """Return a header that says nothing yet."""
    return tuple(f"({MARK} {k}){ending}" for k in range(LINES))


def filled(facts: list[str], ending: str) -> tuple[str, ...]:
    """Return the header.

    Parameters
    ----------
    facts : list of str
        At most eight; what does not fit into a comment is cut or replaced.
    ending : str
        Of its lines.

    Returns
    -------
    tuple of str
    """
    said = ["REVISED FOR THERMAL DRIFT: DO NOT REVISE AGAIN", *facts]
    said += ["-"] * (LINES - len(said))
    return tuple(f"({MARK} {_plain(text)}){ending}" for text in said[:LINES])


def refuse_revised(line: Line) -> None:
    """Raise `ProgramError` if a comment says that the program has been revised."""
    if f"{MARK} REVISED" in line.comment:
        raise ProgramError(
            line.number,
            "has been revised by thermocomp already: its drift would be taken off twice; revise the original",
        )


def comes_first(line: Line) -> bool:
    """Return whether a line has to stay before the header: ``%``, the program's number, nothing at all."""
    return line.demarcation or not line.text.strip() or bool(_NUMBER.match(line.text) and not line.flow)


def _plain(text: str) -> str:
    text = text.replace("(", "[").replace(")", "]").encode("ascii", "replace").decode()
    return text[: WIDTH - len(MARK) - 3]
