"""Corrections as words of a program: conversion from machine axes, and writing; all else is preserved byte for byte."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from thermocomp.nc.interpreter.block import Block, Modal
from thermocomp.nc.parser.line import Word

#: maximum line length for all controls: LinuxCNC reads characters after the 252nd as the next line
LONGEST = 240

_MM = 1e-3  # mm per um
_COMMENTS = re.compile(r"\([^()]*\)|;.*")

Vector = tuple[float, float, float]
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
        """Return the number of decimals for the unit in force."""
        return self.inch if inch else self.mm


#: LinuxCNC reads any number of decimals; a Fanuc with a least increment of 1 um (IS-B) at most these
DIGITS = {"linuxcnc": Digits(), "fanuc": Digits(3, 4)}


@dataclass(frozen=True)
class Frame:
    """Conversion of a tool shift [um, machine axes] into words of X, Y and Z, under one modal state.

    Parameters
    ----------
    scale : tuple of float
        Program units per um, of X, Y and Z.
    cosine, sine : float
        Cosine and sine of the rotation of the work coordinate system about Z.
    digits : int
        Number of decimals.
    """

    scale: Vector
    cosine: float
    sine: float
    digits: int

    @classmethod
    def of(cls, modal: Modal, digits: Digits) -> "Frame":
        """Return the conversion for a modal state."""
        unit = _MM / 25.4 if modal.inch else _MM
        turned = math.radians(modal.rotation)
        scale = (2 * unit if modal.diameter else unit, unit, unit)
        return cls(scale, math.cos(turned), math.sin(turned), digits.of(modal.inch))

    @property
    def turned(self) -> bool:
        """Whether X and Y of the program differ in direction from those of the machine."""
        return self.sine != 0 or self.cosine != 1

    def words(self, shift: Vector) -> Vector:
        """Return the amounts that a shift [um, machine axes] adds to absolute words, rounded to the decimals."""
        x, y, z = shift
        if self.turned:
            x, y = self.cosine * x + self.sine * y, self.cosine * y - self.sine * x
        digits = self.digits
        a, b, c = self.scale
        return round(a * x, digits) + 0.0, round(b * y, digits) + 0.0, round(c * z, digits) + 0.0

    def shift(self, words: Vector) -> Vector:
        """Return the shift [um, machine axes] for given amounts added to words."""
        x, y, z = (w / s for w, s in zip(words, self.scale, strict=True))
        if self.turned:
            x, y = self.cosine * x - self.sine * y, self.cosine * y + self.sine * x
        return x, y, z


def format_number(value: float, digits: int) -> str:
    """Return a number as text, always with a decimal point, and without redundant zeros."""
    text = f"{value:.{digits}f}".rstrip("0")
    if text.endswith("."):
        text += "0"
    return text.removeprefix("-") if text.strip("-0.") == "" else text


def shift_words(block: Block, shifts: Shifts, added: Mapping[str, float], digits: int) -> str:
    """Return the line of a block with shifted words."""
    text = block.line.text
    if added:
        insert = "".join(f" {letter}{format_number(value, digits)}" for letter, value in added.items())
        behind = max(word.end for word in block.line.words)
        text = text[:behind] + insert + text[behind:]
    changed = [(block.words[letter], shift) for letter, shift in shifts.items() if shift]
    changed.sort(key=lambda change: change[0].start, reverse=True)
    for word, shift in changed:
        value = format_shifted(word, block.values[word.letter], shift, digits)
        text = text[: word.start + 1] + value + text[word.end :]
    return text


def part_comments(text: str) -> tuple[str, ...]:
    """Return a line; if it is too long, its comments are moved to a line before it."""
    comments = _COMMENTS.findall(text)
    if len(text) <= LONGEST or not comments:
        return (text,)
    code = _COMMENTS.sub("", text)
    ending = code[len(code.rstrip()) :].lstrip(" \t")
    return " ".join(c.rstrip() for c in comments) + ending, code.rstrip() + ending


def format_shifted(word: Word, value: float, shift: float, digits: int) -> str:
    """Return the text of a shifted value."""
    if word.number is None:
        return f"[{word.value.strip()}{'+' if shift > 0 else ''}{format_number(shift, digits)}]"
    point = word.value.find(".")
    decimals = 0 if point < 0 else sum(map(str.isdigit, word.value[point:]))
    return format_number(value + shift, max(digits, decimals))
