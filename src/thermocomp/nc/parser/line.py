"""Parsed line of an NC program that preserves every byte of the text (ISO 6983 words)."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from thermocomp.core.exceptions import ProgramError

Controller = Literal["linuxcnc", "fanuc"]


class Word(NamedTuple):
    """Letter and its value, such as ``X12.5``, ``Z - 1 . 5`` or ``Y[#3+2]``."""

    letter: str  #: upper case
    start: int  #: column of the letter in the text of the line (0-based)
    end: int  #: column after the last character of the value
    value: str  #: value as written, spaces included
    number: float | None  #: value of a plain number; None if it must be evaluated


class Assignment(NamedTuple):
    """Assignment to a parameter, such as ``#5 = [#4 + 1]``."""

    target: str  #: as written, without spaces: ``#5``, ``#<depth>``, ``#[#1+2]``
    value: str  #: value as written
    start: int  #: column of the ``#``
    end: int  #: column after the last character of the value


@dataclass(slots=True)
class Line:
    """One line of a program.

    Parameters
    ----------
    number : int
        Line number (1-based).
    text : str
        The whole line with its ending: the joined texts of all lines are the file.
    words : list of Word
        Words in the order of the line, without the line number ``N``.
    optional : bool
        The line begins with ``/``: block delete may skip it.
    flow : str
        Flow control, as written: an O-word with its operands, ``IF``, ``WHILE``, ``GOTO``, ``DO``, ``END``; empty if
        there is none. Such a line has no words.
    demarcation : bool
        The line consists of ``%`` only.
    comment : str
        All comments on the line, without their delimiters, concatenated.
    label : str
        Line number word, such as ``120``; empty without one.
    error : str
        Part that cannot be parsed, and its position; empty if there is none.
    """

    number: int
    text: str
    words: list[Word] = field(default_factory=list)
    assignments: list[Assignment] = field(default_factory=list)
    optional: bool = False
    flow: str = ""
    demarcation: bool = False
    comment: str = ""
    label: str = ""
    error: str = ""

    def fault(self, reason: str) -> ProgramError:
        """Return a `ProgramError` with the number of this line."""
        return ProgramError(self.number, reason)
