"""Corners of a Fanuc program, ``,C`` (chamfer) and ``,R`` (rounding), as plain moves.

The corner is cut between two feed lines of the plane XY in G90; others are refused with line and reason.
"""

import math
import re
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from thermocomp.nc.interpreter.block import Block, Setup
from thermocomp.nc.interpreter.interpret import Follower
from thermocomp.nc.parser.tokens import read_line

_CORNER: Final = re.compile(r",[ \t]*([CR])[ \t]*((?:[0-9]+\.?[0-9]*|\.[0-9]+))(?=[^0-9.]|$)", re.IGNORECASE)
_COMMENT: Final = re.compile(r"\([^()]*\)|;.*")
#: codes that may be on the lines of a corner: they do not change how its path is read
_BESIDE: Final = frozenset({"G1", "G17", "G90", "G94", "M3", "M4", "M7", "M8", "M9"})
_LETTERS: Final = frozenset("XYFS")
#: a smaller angle between both lines has no corner; one closer to a half turn has no room for it [rad]
_FLAT: Final = 1e-3

_Flat = tuple[float, float]


class _Corner(NamedTuple):
    """Line that ends in a corner, before the next line is known."""

    block: Block  #: of the line without the corner
    kind: str  #: C or R
    size: float  #: [mm]
    start: _Flat  #: end of the corner before it, or of the line before it [mm]
    between: list[tuple[str, int]]  #: lines without words after it


def write_corners(lines: Iterable[tuple[str, int]], setup: Setup) -> Iterator[tuple[str, int]]:
    """Yield the lines of a program, each with its number, with plain moves for its corners."""
    lines = list(lines)
    if not any(_CORNER.search(_COMMENT.sub("", text)) for text, _ in lines):
        yield from lines
        return
    follower, corner = Follower(setup), None
    known = False
    for text, number in lines:
        found = None if {"(", ";"} & set(text.partition(",")[0]) else _CORNER.search(text)
        plain = text if found is None else text[: found.start()] + text[found.end() :]
        line = read_line(plain, number, "fanuc")
        if corner is not None and not (line.words or line.assignments or line.flow or line.error):
            corner.between.append((text, number))
            continue
        block = follower.step(line)
        start = block.start[:2]
        if (corner is not None or found is not None) and not (known and _plain(block)):
            raise line.fault(
                "a corner (,R or ,C) needs two feed lines of X and Y in G90, G17, one after the other, from a known "
                "position; write its moves"
            )
        if corner is not None:
            texts, start = _cut(corner, block)
            yield from ((t, corner.block.line.number) for t in texts)
            yield from corner.between
            if "G1" not in block.codes:  # a rounding is an arc
                at = line.words[0].start
                block.line = line = read_line(f"{plain[:at]}G1 {plain[at:]}", number, "fanuc")
        known, corner = block.known[0] and block.known[1], None
        if found is None:
            yield line.text, number
            continue
        if "." not in found[2]:
            raise line.fault(f",{found[1]}{found[2]} has no decimal point; write it")
        size = float(found[2]) * (25.4 if block.modal.inch else 1.0)
        corner = _Corner(block=block, kind=found[1].upper(), size=size, start=start, between=[])
    if corner is not None:
        raise corner.block.error("a corner (,R or ,C) without a line after it; write its moves")


def _plain(block: Block) -> bool:
    """Return whether a line is a feed move of X and Y whose end is known."""
    modal = block.modal
    told = block.kind == "line" and modal.motion == "G1" and modal.absolute and modal.plane == 17 and not modal.turned
    beside = _BESIDE.issuperset(block.codes) and _LETTERS.issuperset(block.words) and not block.line.optional
    number = all(word.number is not None for word in block.words.values())
    return told and beside and number and modal.feed_mode != 93 and block.known[0] and block.known[1]


def _cut(corner: _Corner, following: Block) -> tuple[list[str], _Flat]:
    """Return the line up to a corner and the corner, and where it ends [mm]."""
    block, line = corner.block, corner.block.line
    x, y = block.end[:2]
    first, second = _direction(corner.start, (x, y)), _direction((x, y), following.end[:2])
    turn = math.atan2(first[0] * second[1] - first[1] * second[0], first[0] * second[0] + first[1] * second[1])
    room = min(math.dist(corner.start, (x, y)), math.dist((x, y), following.end[:2]))
    flat = not _FLAT < abs(turn) < math.pi - _FLAT
    away = corner.size if corner.kind == "C" or flat else corner.size * math.tan(abs(turn) / 2.0)
    if flat or away > room or not room:
        raise block.error(f"the corner ,{corner.kind} does not fit between its lines; write its moves")
    before = (x - away * first[0], y - away * first[1])
    after = (x + away * second[0], y + away * second[1])
    words = [word for word in line.words if word.letter in "XY"]
    text, at = line.text, words[0].start
    for word in reversed(words):
        text = text[: word.start] + text[word.end :]
    text = f"{text[:at]}{_place(before, block)} {text[at:].lstrip(' ')}"
    arc = f"G{3 if turn > 0 else 2} {_place(after, block)} R{_number(corner.size, block)}"
    bend = f"G1 {_place(after, block)}" if corner.kind == "C" else arc
    ending = line.text[len(line.text.rstrip("\r\n")) :] or "\n"
    return [text, bend + ending], after


def _direction(a: _Flat, b: _Flat) -> _Flat:
    way = math.dist(a, b) or 1.0
    return (b[0] - a[0]) / way, (b[1] - a[1]) / way


def _place(point: _Flat, block: Block) -> str:
    return f"X{_number(point[0], block)} Y{_number(point[1], block)}"


def _number(value: float, block: Block) -> str:
    """Return a length as a Fanuc reads it, in the unit in force."""
    text = f"{value / 25.4:.4f}" if block.modal.inch else f"{value:.3f}"
    return text.rstrip("0") if text.strip("-0.") else "0."
