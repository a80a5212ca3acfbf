"""Splitting of a long cut if a single linear change of the correction would leave too large an error in its middle."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

from thermocomp.nc.interpreter.arcs import CENTRE, find_point
from thermocomp.nc.interpreter.block import PLANES, Block, Known, Move, Point, triple
from thermocomp.nc.interpreter.codes import ROTARY
from thermocomp.nc.parser.line import Controller
from thermocomp.nc.parser.tokens import read_line
from thermocomp.nc.rewrite.method import AXES
from thermocomp.nc.rewrite.offset import ending
from thermocomp.nc.rewrite.text import Vector, format_number

#: decimals of positions inside a cut: their rounding is a thousandth of that of a correction
DIGITS: Final = 6
#: minimum length of a piece [mm]
SHORTEST: Final = 2.0
#: maximum number of pieces of a cut
MOST: Final = 64
#: codes allowed next to the motion code: they take effect before the first piece and stay in force
_BESIDE: Final = frozenset(
    {"G1", "G2", "G3", "G17", "G18", "G19", "G90", "G90.1", "G91.1", "G94"}
    | {"M3", "M4", "M5", "M7", "M8", "M9", "M48", "M49"}
)


class Sample(NamedTuple):
    """Deviation at a position in a block, and the correction that it requires."""

    share: float  #: fraction of the path
    deviation: Vector  #: deviation of the tool point [um]
    demand: Vector | None  #: required correction of the axes [um]; None: not computed


def may_split(block: Block, before: Known) -> bool:
    """Return whether a block is a plain cut with known positions."""
    modal, words = block.modal, block.words
    ends = block.line.text.endswith(("\r", "\n"))  # not the last line of a file
    if len(block.moves) != 1 or block.kind not in ("line", "arc") or block.line.optional or not ends:
        return False
    move = block.moves[0]
    if move.rapid or modal.motion not in ("G1", "G2", "G3") or not _BESIDE.issuperset(block.codes):
        return False
    if modal.cutter or modal.diameter or modal.blend is None or modal.exact_stop or modal.feed_mode != 94:
        return False
    if not modal.absolute or not ROTARY.isdisjoint(words) or any(w.number is None for w in words.values()):
        return False
    needed = [i for i, letter in enumerate(AXES) if letter in words]
    if move.arc is not None:
        if modal.rotation or move.arc.turns != 1:
            return False
        needed += PLANES[move.arc.plane][:2]
    return all(before[i] for i in needed)


def shares(samples: Sequence[Sample], carried: Vector, axes: Sequence[int], step: float, way: float) -> list[float]:
    """Return the ends of the parts of a cut, as fractions of its path; a single one if it is not split.

    Parameters
    ----------
    carried : tuple of float
        Corrections of the axes at the start [um].
    step : float
        Allowed residual inside a piece [um].
    way : float
        Length of the cut [mm].
    """
    wanted = [carried if k == 0 else s.demand or carried for k, s in enumerate(samples)]
    ends = [0, len(samples) - 1]
    while len(ends) <= MOST:
        worst, where = step, 0
        for first, last in pairwise(ends):
            if (samples[last].share - samples[first].share) * way < 2.0 * SHORTEST:
                continue
            for k in range(first + 1, last):
                part = (samples[k].share - samples[first].share) / (samples[last].share - samples[first].share)
                for i in axes:
                    between = wanted[first][i] + part * (wanted[last][i] - wanted[first][i])
                    if abs(wanted[k][i] - between) > worst:
                        worst, where = abs(wanted[k][i] - between), k
        if not where:
            break
        ends = sorted([*ends, where])
    return [samples[k].share for k in ends[1:]]


def beside(samples: Sequence[Sample], knots: Sequence[tuple[float, Vector]]) -> Iterator[tuple[Vector, Vector]]:
    """Yield deviation and correction of each sample: the correction is linear between knots."""
    k = 1
    for sample in samples:
        while sample.share > knots[k][0]:
            k += 1
        (first, before), (last, after) = knots[k - 1 : k + 1]
        if before == after:
            yield sample.deviation, after
            continue
        part = (sample.share - first) / (last - first)
        yield sample.deviation, triple(b + part * (a - b) for b, a in zip(before, after, strict=True))


def samples_below(block: Block, samples: Sequence[Sample], top: float | None) -> Sequence[Sample]:
    """Return the samples of a cut that are not above the top of the stock, with one where the tool passes it.

    Parameters
    ----------
    top : float or None
        Work coordinate Z [mm]; None: unknown, as is that of the tool: all samples count.
    """
    first, last = block.start[2], block.end[2]
    if top is None or max(first, last) <= top or len(block.moves) > 1:
        return samples
    if min(first, last) > top:
        return ()
    share = (top - first) / (last - first)
    before, after = next(pair for pair in pairwise(samples) if pair[1].share >= share)
    part = (share - before.share) / (after.share - before.share)
    there = triple(a + part * (b - a) for a, b in zip(before.deviation, after.deviation, strict=True))
    sunk = [s for s in samples if (s.share > share) == (last < first) and s.share != share]
    passing = Sample(share, there, None)
    return [passing, *sunk] if last < first else [*sunk, passing]


def axes_to_split(block: Block, before: Known) -> list[int]:
    """Return the axes whose correction can change within a block: all for a line, the third one for an arc."""
    arc = block.moves[0].arc
    found = range(3) if arc is None else (PLANES[arc.plane][2],)
    return [i for i in found if AXES[i] in block.words or before[i]]


def pieces(block: Block, parts: Sequence[float], before: Known, controller: Controller) -> Iterator[Block]:
    """Yield the pieces of a block, as if each were a line of the program."""
    move, modal = block.moves[0], block.modal
    unit = 25.4 if modal.inch else 1.0
    shift = [p - m for p, m in zip(block.start, move.start, strict=True)]
    place, start = block.start, move.start
    known = triple(b or letter in block.words for letter, b in zip(AXES, before, strict=True))
    words, drop = _words(block), "R" if move.arc else ""
    for k, share in enumerate(parts):
        last = k == len(parts) - 1
        end = move.end if last else find_point(move, share)
        goal = block.end if last else _place(block, end, share, shift)
        values = {AXES[i]: goal[i] / unit for i in words}
        if move.arc is not None:
            values |= _centre(move, place, shift, modal.arc_absolute, unit)
        text = _bare(values) + ending(block.line.text) if k else _written(block, values, drop)
        line = read_line(text, block.line.number, controller)
        yield replace(
            block,
            line=line,
            codes=() if k else block.codes,
            words={w.letter: w for w in line.words if w.letter not in "GM"},
            values={w.letter: w.number for w in line.words if w.letter not in "GM" and w.number is not None},
            start=place,
            end=goal,
            known=block.known if last else known,
            moves=[replace(move, start=start, end=end)],
        )
        place, start = goal, end


def _words(block: Block) -> list[int]:
    """Return the axes that have a word in every piece of a split block."""
    arc = block.moves[0].arc
    plane = () if arc is None else PLANES[arc.plane][:2]
    return [i for i, letter in enumerate(AXES) if letter in block.words or i in plane]


def _place(block: Block, end: Point, share: float, shift: Sequence[float]) -> Point:
    """Return a position inside a cut in program coordinates, rounded as written [mm]."""
    if block.moves[0].arc is None:
        exact = [a + share * (b - a) for a, b in zip(block.start, block.end, strict=True)]
    else:
        exact = [m + s for m, s in zip(end, shift, strict=True)]
    unit = 25.4 if block.modal.inch else 1.0
    return triple(round(v / unit, DIGITS) * unit for v in exact)


def _centre(move: Move, place: Point, shift: Sequence[float], absolute: bool, unit: float) -> dict[str, float]:
    """Return the words of an arc's centre [program units]."""
    assert move.arc is not None
    found = {}
    for letter, i, middle in zip(CENTRE[move.arc.plane], PLANES[move.arc.plane], move.arc.centre, strict=False):
        found[letter] = (middle + shift[i] - (0.0 if absolute else place[i])) / unit
    return found


def _bare(values: dict[str, float]) -> str:
    return " ".join(f"{letter}{format_number(value, DIGITS)}" for letter, value in values.items())


def _written(block: Block, values: dict[str, float], drop: str) -> str:
    """Return the line of a block with the given words; additional ones are appended after its last word."""
    text = block.line.text
    behind = max(word.end for word in block.line.words)
    added = _bare({letter: value for letter, value in values.items() if letter not in block.words})
    text = f"{text[:behind]}{' ' if added else ''}{added}{text[behind:]}"
    for word in sorted(block.words.values(), key=lambda w: w.start, reverse=True):
        if word.letter in drop:
            text = text[: word.start] + text[word.end :]
        elif word.letter in values:
            text = text[: word.start + 1] + format_number(values[word.letter], DIGITS) + text[word.end :]
    return text
