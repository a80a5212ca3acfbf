"""Writing of shifts into the words of a line; everything else is preserved byte for byte."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from thermocomp.nc.interpreter.block import Block
from thermocomp.nc.parser.line import Line, Word

#: maximum line length for all controls: LinuxCNC reads characters after the 252nd as the next line
LONGEST = 240

_COMMENTS = re.compile(r"\([^()]*\)|;.*")

#: letter -> amount added to its value, in the program's units
Shifts = Mapping[str, float]


@dataclass(frozen=True)
class Digits:
    """Number of decimals of a written length.

    Parameters
    ----------
    mm, inch : int
        Decimals to which a correction is rounded, so that words are not rounded a second time.
    """

    mm: int = 4
    inch: int = 6

    def of(self, inch: bool) -> int:
        """Return the decimals in the unit in force."""
        return self.inch if inch else self.mm


#: LinuxCNC reads any number of decimals; a Fanuc with a least increment of 1 um (IS-B) at most these
DIGITS = {"linuxcnc": Digits(), "fanuc": Digits(3, 4)}


def format_number(value: float, digits: int) -> str:
    """Return a number as text, always with a decimal point, and without redundant zeros."""
    text = f"{value:.{digits}f}".rstrip("0")
    if text.endswith("."):
        text += "0"
    return text.removeprefix("-") if text.strip("-0.") == "" else text


def shift_words(block: Block, shifts: Shifts, added: Mapping[str, float], digits: int) -> str:
    """Return the line of a block with shifted words.

    Parameters
    ----------
    block : Block
    shifts : mapping of str to float
        Shift by letter of a word on the line; a word with a shift of 0 is unchanged.
    added : mapping of str to float
        Words to be appended after the last word of the line, in this order.
    digits : int
        Decimals of shifts and added words.

    Returns
    -------
    str
    """
    line = block.line
    text = line.text
    if added:
        insert = "".join(f" {letter}{format_number(value, digits)}" for letter, value in added.items())
        behind = _end(line)
        text = text[:behind] + insert + text[behind:]
    changed = [(block.words[letter], shift) for letter, shift in shifts.items() if shift]
    changed.sort(key=_start, reverse=True)
    for word, shift in changed:
        text = (
            text[: word.start + 1] + format_shifted(word, block.values[word.letter], shift, digits) + text[word.end :]
        )
    return text


def part_comments(text: str) -> tuple[str, ...]:
    """Return a line; if it is too long, its comments are moved to a line before it."""
    comments = _COMMENTS.findall(text)
    if len(text) <= LONGEST or not comments:
        return (text,)
    code = _COMMENTS.sub("", text)
    ending = code[len(code.rstrip()) :].lstrip(" \t")
    return " ".join(c.rstrip() for c in comments) + ending, code.rstrip() + ending


def _start(change: tuple[Word, float]) -> int:
    return change[0].start


def _end(line: Line) -> int:
    """Return the column after the last word of a line."""
    return max(word.end for word in line.words)


def format_shifted(word: Word, value: float, shift: float, digits: int) -> str:
    """Return the text of a shifted value.

    Parameters
    ----------
    word : Word
    value, shift : float
        Value and shift, in the program's units.
    digits : int
        Minimum number of decimals; a word with more keeps them.
    """
    if word.number is None:
        return f"[{word.value.strip()}{'+' if shift > 0 else ''}{format_number(shift, digits)}]"
    point = word.value.find(".")
    decimals = 0 if point < 0 else sum(map(str.isdigit, word.value[point:]))
    return format_number(value + shift, max(digits, decimals))
