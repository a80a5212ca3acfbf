"""A line of an NC program, taken apart without losing a byte (ISO 6983 words)."""

from dataclasses import dataclass, field
from typing import NamedTuple


class Word(NamedTuple):
    """A letter and its value, such as ``X12.5``, ``Z - 1 . 5`` or ``Y[#3+2]``."""

    letter: str  #: upper case
    start: int  #: column of the letter in the line's text, from 0
    end: int  #: one past the last character of the value
    value: str  #: the value as it is written, spaces included
    number: float | None  #: the value of a plain number; None: it has to be evaluated


class Assignment(NamedTuple):
    """A parameter that is set, such as ``#5 = [#4 + 1]``."""

    target: str  #: as written, without spaces: ``#5``, ``#<depth>``, ``#[#1+2]``
    value: str  #: the value as it is written
    start: int  #: column of the ``#``
    end: int  #: one past the last character of the value


@dataclass(slots=True)
class Line:
    """One line.

    Parameters
    ----------
    number : int
        From 1.
    text : str
        The whole line with its ending: joined, the texts of all lines are the file.
    words : list of Word
        In the order they stand; without the line number ``N``.
    assignments : list of Assignment
    optional : bool
        It begins with ``/``: block delete may skip it.
    flow : str
        What steers the flow of the program, as written: an O-word with what follows, ``IF``, ``WHILE``, ``GOTO``,
        ``DO``, ``END``; empty if nothing does. Such a line has no words.
    demarcation : bool
        A line that is nothing but ``%``.
    comment : str
        All comments on the line, without their marks, one after the other.
    label : str
        Line number, such as ``120``; empty without one.
    error : str
        Part that cannot be understood, and its position; empty if all of it can be.
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
