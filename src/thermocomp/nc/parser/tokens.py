"""Tokeniser of ISO 6983 programs that preserves the text (syntax of LinuxCNC and Fanuc).

Both controls ignore blanks, tabs and case outside comments: ``g 0 x - 1 . 5`` is ``G0X-1.5``. Ordinary lines (words,
comments, line number, block delete) are parsed unchanged by one regular expression; all other lines by
`thermocomp.nc.parser.squeezed`.
"""

import io
import re
from collections.abc import Iterable, Iterator
from typing import TextIO

from thermocomp.core.exceptions import InputError
from thermocomp.nc.parser.line import Controller, Line, Word
from thermocomp.nc.parser.squeezed import BLANK, read_slowly, runs_python

#: maximum length of a line [characters]; without a limit, a file of garbage would be read into memory completely
LONGEST = 1_000_000

# Fast parser. Other lines are left to the slow parser, so it may be strict: numbers without blanks inside, no nested
# brackets, no assignments. [0-9] because \d matches digits of all scripts.
_NO_MORE_DIGITS = r"(?![ \t]*[0-9.])"
_HEAD = re.compile(r"[ \t]*(/?)[ \t]*(?:[Nn][ \t]*([0-9]++)" + _NO_MORE_DIGITS + ")?").match
_NUMBER, _VALUE, _COMMENT, _REST, _END = 2, 3, 4, 5, 6  # groups of an item


def _item(letters: str, rest: str) -> re.Pattern[str]:
    return re.compile(
        rf"[ \t]*(?:([{letters}])[ \t]*"
        rf"(?:([-+]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++){_NO_MORE_DIGITS})"
        rf"|([-+]?(?:\[[^][()\r\n;\0]*\]|\#(?:[0-9]++{_NO_MORE_DIGITS}|<[^][<>()\r\n;\0]*>))))"
        r"|\(([^()\r\n\0]*)\)"
        rf"|;({rest})"
        r"|([ \t\f\v]*(?:\r?\n)?\Z))"
    )


_ITEM = {
    "linuxcnc": _item("A-MP-Za-mp-z@^$", r"[^\r\n\0]*").match,  # @ ^ polar coordinates, $ number of the spindle
    "fanuc": _item("A-MP-Za-mp-z", r"[ \t]*(?=[\r\n]|\Z)").match,
}

# Fastest parser, for most lines of a long program: only a few words with plain numbers.
_FEW = 6
_PLAIN_WORD = r"[ \t]*([A-MP-Z])([-+]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++))"
_WORDS = re.compile(_PLAIN_WORD + f"(?:{_PLAIN_WORD}" * (_FEW - 1) + ")?" * (_FEW - 1) + r"[ \t]*(?:\r?\n)?\Z").match

_ORDINARY = 300  # maximum length [characters], so that no number can be infinite
_new_word = tuple.__new__  # takes half the time of Word(...)


def program_lines(stream: TextIO) -> Iterator[str]:
    r"""Yield the lines of a program, with their endings: the joined lines are the file."""
    while text := stream.readline(LONGEST):
        if len(text) == LONGEST:
            raise InputError(
                f"a line has {LONGEST} characters or more: this is not an NC program; "
                "save the program as text, with line ends"
            )
        yield text


def split_lines(text: str) -> Iterator[str]:
    r"""Yield the lines of a text, as `program_lines` does for a file."""
    return program_lines(io.StringIO(text, newline=""))


def read_lines(texts: Iterable[str], controller: Controller = "linuxcnc") -> Iterator[Line]:
    """Yield the parsed lines, numbered from 1; see `read_line`."""
    for number, text in enumerate(texts, 1):
        yield read_line(text, number, controller)


def read_line(text: str, number: int, controller: Controller = "linuxcnc") -> Line:
    """Tokenise a line. Never raises: errors are reported in ``Line.error``, with the column.

    Parameters
    ----------
    controller : {'linuxcnc', 'fanuc'}
        Control whose syntax the program uses. LinuxCNC: O-words, several assignments on a line, comments after ``;``.
        Fanuc: program numbers, ``IF [..] GOTO``, ``/2``, assignments without brackets, ``;`` ends the line.
    """
    found = _WORDS(text)
    if found is not None and len(text) < _ORDINARY and (few := _few_words(found)) is not None:
        return Line(number, text, few)
    item = _ITEM[controller]
    found = _HEAD(text)
    if found is None or len(text) >= _ORDINARY:  # every part of the head is optional, so it always matches
        return read_slowly(text, number, controller)
    slash, label = found.groups()
    place = found.end()
    words: list[Word] = []
    letters = comment = ""
    while True:
        found = item(text, place)
        if found is None:
            return read_slowly(text, number, controller)
        kind = found.lastindex or 0
        place = found.end()
        if kind <= _VALUE:
            letter, value = found.group(1, kind)
            letter = letter.upper()
            if letter in letters and letter not in "GM":
                return read_slowly(text, number, controller)
            letters += letter
            plain = float(value) if kind == _NUMBER else None
            words.append(_new_word(Word, (letter, found.start(1), place, value, plain)))
        elif kind == _END:
            return Line(number, text, words, optional=slash != "", comment=comment, label=label or "")
        else:
            remark = found.group(kind) if kind == _COMMENT else found.group(kind).rstrip(BLANK)
            if controller == "linuxcnc" and runs_python(remark):
                return read_slowly(text, number, controller)
            comment = f"{comment} {remark}" if comment and remark else comment or remark


def _few_words(found: re.Match[str]) -> list[Word] | None:
    """Return the words of a simple line; None if a letter occurs twice."""
    groups, spans = found.groups(), found.regs
    last = found.lastindex or 0
    letters = groups[0:last:2]
    if len(set(letters)) < len(letters):
        return None
    return [
        _new_word(Word, (groups[k], spans[k + 1][0], spans[k + 2][1], groups[k + 1], float(groups[k + 1])))
        for k in range(0, last, 2)
    ]
