"""Precompensation: revision of a program before it is run, by the drift it will cause (P-06).

All steps are streamed: lines are read, interpreted, timed, corrected and checked one by one; the results for the
whole run (`Revision`) are updated with each line.
"""

import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import add, sub
from typing import NamedTuple

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.interpreter.arcs import find_point, length
from thermocomp.nc.interpreter.block import Block, Point, Setup
from thermocomp.nc.interpreter.codes import ROTARY
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.line import Line
from thermocomp.nc.parser.recognise import recognised
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.rewrite import header, known
from thermocomp.nc.rewrite.check import Check
from thermocomp.nc.rewrite.conditions import Conditions
from thermocomp.nc.rewrite.demand import DENSE, OFTEN, CutErrors, Demand, DriftSource, Elsewhere, Left
from thermocomp.nc.rewrite.method import Change, CorrectionMethod
from thermocomp.nc.rewrite.offset import ending
from thermocomp.nc.rewrite.split import Sample, axes_to_split, beside, may_split, pieces, samples_below, shares
from thermocomp.nc.rewrite.text import Vector

MOST_PIECES = 1000
#: the drift continues within a line: a residual up to this multiple of the tolerance is not reported as caused by a
#: held correction
TELLING = 1.1
_PLAIN = frozenset(("G0", "G1"))


class Revised(NamedTuple):
    """Original line of a program with its revised lines."""

    number: int  #: number of the original line; 0 for the header
    text: str  #: the original line; empty for the header
    texts: tuple[str, ...]  #: lines that replace it
    block: Block | None  #: effect of the line; None for the header and after the end of the program
    start: float  #: start time [s]
    end: float  #: end time [s]
    deviation: Vector  #: drift at the end of the line, at its end position [um, machine axes]
    carried: Vector  #: correction of the axes at the end of the line [um, machine axes]
    inner: Vector  #: correction during a cycle that ends at its start
    cut: CutErrors | None = None  #: errors in the line, if the tool cuts
    other: Vector | None = None  #: alternative correction at the end, if the program does not determine which
    placed: bool = True  #: previous positions of its axes are known; otherwise the line may move them or not
    knots: tuple[Vector, ...] = ()  #: corrections at the inner ends of the pieces of a split line [um]


@dataclass
class Revision:
    """Revision of one program, block by block.

    Parameters
    ----------
    drift : DriftSource
        Drift in its initial state.
    header_lines : int
        Number of header lines.
    split : bool
        A long cut is split if a single change of the correction would leave more than one step in its middle.
    conditions : Conditions
        Assumptions about the run, and other runs that show what they are worth.
    stock_top : float or None
        Work coordinate Z above which the tool does not cut [mm]; None: every feed move counts.

    Attributes
    ----------
    left : Left
        Remaining drift in the cuts after the correction.
    elsewhere : Elsewhere
        Error with a different work offset, if the drift depends on the position.
    taken_system : bool
        The tool cut before the program specified a work coordinate system: G54 was assumed.
    corrected : bool
        A correction was in force at some point.
    lines, changed : int
        Number of lines read, and of lines changed.
    seconds : float
        Duration of the program [s].
    tool_changes : list of float
        Times of the tool changes [s].
    slowest, fastest : float
        Lowest and highest spindle speed [1/min].
    held : dict of str to (float, int)
        By reason why a correction could not follow the drift in a cut: the largest residual [um], and its line.
    standing : int
        First line that cuts while the spindle is stopped; 0 if there is none.
    ended : bool
        The program has an end: M2, M30 or a closing ``%``.
    idle : int
        Number of lines with words after the end of the program, which are not corrected.
    """

    setup: Setup
    kinematics: MotionLimits
    drift: DriftSource
    method: CorrectionMethod
    demand: Demand
    header_lines: int = header.LINES
    split: bool = True
    conditions: Conditions = field(default_factory=Conditions)
    stock_top: float | None = None
    left: Left = field(default_factory=Left, init=False)
    elsewhere: Elsewhere = field(default_factory=Elsewhere, init=False)
    taken_system: bool = field(default=False, init=False)
    corrected: bool = field(default=False, init=False)
    lines: int = field(default=0, init=False)
    changed: int = field(default=0, init=False)
    seconds: float = field(default=0.0, init=False)
    tool_changes: list[float] = field(default_factory=list, init=False)
    slowest: float = field(default=float("inf"), init=False)
    fastest: float = field(default=0.0, init=False)
    held: dict[str, tuple[float, int]] = field(default_factory=dict, init=False)
    standing: int = field(default=0, init=False)
    ended: bool = field(default=False, init=False)
    idle: int = field(default=0, init=False)
    _touching: bool = field(default=False, init=False)
    _why: str = field(default="", init=False)  # reason that held the correction in the previous cut

    def rehearse(self, texts: Iterable[str]) -> Iterator[Block]:
        """Run through a program without corrections, to refuse it early for reasons that do not depend on the drift."""
        method, steered = copy.deepcopy(self.method), known.SpindleState(self.setup)
        nothing: Vector = (0.0, 0.0, 0.0)
        modal, seen = None, set[tuple[str, ...]]()
        for block in follow_program(self._read(texts), self.setup):
            steered.speed(block)
            known.refuse_unknown(block, self.setup, by_position=self.drift.by_position)
            # lines with the same words and modal state as an earlier one do not change a method without corrections
            words = tuple(block.words)
            plain = block.kind == "line" and _PLAIN.issuperset(block.codes) and not block.line.optional
            if not plain or block.modal is not modal:
                modal = block.modal
                seen.clear()
            elif words in seen:
                yield block
                continue
            if plain and ROTARY.isdisjoint(words):  # for rotary axes, the position matters too
                seen.add(words)
            method.revise(block, nothing)
            yield block

    def revise(self, texts: Iterable[str]) -> Iterator[Revised]:
        """Yield each line of a program with its revised lines."""
        check = Check(self.setup)
        steered = known.SpindleState(self.setup)
        point: Point = (0.0, 0.0, 0.0)
        deviation = self.drift.deviation(point)
        headed = False
        carried = self.method.carried
        blocks = follow_program(self._read(texts), self.setup)
        for block, start, end in self.conditions.time(blocks, self.kinematics):
            line = block.line
            if not headed and not header.comes_first(line):
                yield self._header(line.text, deviation, carried)
                headed = True
            known.refuse_unknown(block, self.setup, by_position=self.drift.by_position)
            cutting = self._cuts(block)
            speed = steered.speed(block)
            self._note_block(block, start, speed, cutting)
            samples, message = self._drive(block, end - self.seconds, speed, point, cutting)
            top = self.stock_top if self.method.before[2] and block.known[2] and not block.turned else None
            self.seconds = end
            if block.moves:
                point = block.moves[-1].end
            deviation = self.drift.deviation(point)
            demand = self._demanded(line.number, end, point)
            samples.append(Sample(1.0, deviation, demand))
            change, knots = self._changed(block, samples, check, message)
            carried = change.after
            known.refuse_untold_rotation(block, carried)
            if block.kind == "cycle":
                knots = [(0.0, change.inner), (1.0, change.inner)]
            cut = self._note_cut(block, samples, knots, demand, (end, point), top) if cutting else None
            if cut is None:
                self._why = ""
            self.idle += self.ended and bool(line.words)
            self.ended |= block.ends
            revised = Revised(
                number=line.number,
                text=line.text,
                texts=change.texts,
                block=block,
                start=start,
                end=end,
                deviation=deviation,
                carried=carried,
                inner=change.inner,
                cut=cut,
                other=change.other,
                placed=change.placed,
                knots=tuple(carried for _, carried in knots[1:-1]),
            )
            self.lines += 1
            self.changed += revised.texts != (revised.text,)
            self.corrected = self.corrected or any(carried) or any(change.inner)
            yield revised
        if not headed:
            raise ProgramError(max(self.lines, 1), "the program is empty")
        self._refuse_open(carried)

    def _note_cut(
        self,
        block: Block,
        samples: Sequence[Sample],
        knots: list[tuple[float, Vector]],
        demand: Vector,
        end: tuple[float, Point],
        top: float | None,
    ) -> CutErrors | None:
        """Record what a cut below the top of the stock leaves, and why; `end` is its time [s] and position."""
        self.conditions.take(block, samples, knots, top, end[0], local=self.drift.by_position)
        if not (samples := samples_below(block, samples, top)):
            return None
        cut = self.left.take(block.line.number, beside(samples, knots))
        self._note_held(block, demand, samples[0].deviation, (knots[0][1], knots[-1][1]), cut)
        self.taken_system |= not block.modal.system_told
        if self.drift.by_position:
            self.elsewhere.take(*end, self.drift)
        return cut

    def _read(self, texts: Iterable[str]) -> Iterator[Line]:
        """Yield the parsed lines of a program; raise `ProgramError` if it has been revised before."""
        for line in read_lines(recognised(texts), self.setup.controller):
            if line.comment:
                header.refuse_revised(line)
            yield line

    def _header(self, text: str, deviation: Vector, carried: Vector) -> Revised:
        return Revised(
            number=0,
            text="",
            texts=header.make_blank(ending(text), self.header_lines),
            block=None,
            start=0.0,
            end=0.0,
            deviation=deviation,
            carried=carried,
            inner=carried,
        )

    def _changed(
        self, block: Block, samples: list[Sample], check: Check, message: tuple[str, ...]
    ) -> tuple[Change, list[tuple[float, Vector]]]:
        """Return the revised lines of a block, after a message, and the corrections along its path."""
        method = self.method
        before, begun = method.before, method.carried
        parts = [1.0]
        if len(samples) > 2 and samples[1].demand is not None:
            axes = axes_to_split(block, before)
            parts = shares(samples, begun, axes, method.step, length(block.moves[0]))
        if len(parts) > 1 and not self._worth(block, samples, parts):
            parts = [1.0]
        if len(parts) == 1:
            change = method.revise(block, samples[-1].demand or begun)
            change = change._replace(texts=(*message, *change.texts))
            check.check(block, change)
            return change, [(0.0, begun), (1.0, change.after)]
        demands = {s.share: s.demand for s in samples}
        changes = []
        for piece, share in zip(pieces(block, parts, before, self.setup.controller), parts, strict=True):
            change = method.revise(piece, demands[share] or begun)
            check.check(piece, change)
            changes.append(change)
        knots = [(0.0, begun), *((share, c.after) for share, c in zip(parts, changes, strict=True))]
        texts = tuple(text for c in changes for text in c.texts)
        return changes[-1]._replace(texts=texts, before=begun, placed=changes[0].placed), knots

    def _worth(self, block: Block, samples: list[Sample], parts: list[float]) -> bool:
        """Return whether splitting a cut reduces its residual, with an increase at the end of at most one step."""
        found = []
        for ends in ([1.0], parts):
            method = copy.deepcopy(self.method)
            demands = {s.share: s.demand or method.carried for s in samples}
            knots = [(0.0, method.carried)]
            for piece, share in zip(pieces(block, ends, method.before, self.setup.controller), ends, strict=True):
                knots.append((share, method.revise(piece, demands[share]).after))
            left = [max(map(abs, map(add, *pair))) for pair in beside(samples, knots)]
            found.append((max(left), left[-1]))
        (whole, at_end), (split, at_its_end) = found
        return bool(split < whole and at_its_end <= at_end + self.method.step)

    def _demanded(self, line: int, end: float, point: Point) -> Vector:
        try:
            return self.demand.at(end, self.drift, point)
        except InputError as e:
            raise ProgramError(line, str(e)) from e

    def _cuts(self, block: Block) -> bool:
        """Return whether the tool may cut in a block: it moves at feed rate, or stays in contact after a cut."""
        if block.tool_change is not None or block.kind in ("machine", "home"):
            self._touching = False
        elif block.moves:
            self._touching = not block.moves[-1].rapid
            return any(not m.rapid for m in block.moves)
        return self._touching

    def _drive(
        self, block: Block, dt: float, speed: float, point: Point, cutting: bool
    ) -> tuple[list[Sample], tuple[str, ...]]:
        """Advance the drift over a block, also that of other runs; return the samples of a cut and a message."""
        places = self._places(block, dt, point) if cutting else []
        self.conditions.begin(block, self.drift)
        shown = self.setup.controller == "linuxcnc"
        message = self.conditions.message(block, self.drift, dt, speed, point, shown=shown)
        self.conditions.advance(block, dt, speed, places)
        return self._advance(block, dt, speed, places), message

    def _places(self, block: Block, dt: float, point: Point) -> list[Point]:
        """Return the places of the samples of a cut, at equal parts of its path, including both ends."""
        move = block.moves[0] if len(block.moves) == 1 else None
        count = math.ceil(dt / OFTEN)
        if move is not None and self.drift.by_position:
            count = max(count, math.ceil(length(move) / DENSE))
        count = min(max(count, 1), MOST_PIECES)
        inner = [point if move is None else find_point(move, k / count) for k in range(1, count)]
        return [point, *inner, block.moves[-1].end if block.moves else point]

    def _advance(self, block: Block, dt: float, speed: float, places: Sequence[Point]) -> list[Sample]:
        """Advance the drift over a block; return the samples of a cut, except that at its end."""
        if dt > 0 and speed:
            self.slowest = min(self.slowest, abs(speed))
            self.fastest = max(self.fastest, abs(speed))
        if not places:
            if dt > 0:
                self.drift.advance(dt, speed)
            return []
        count = len(places) - 1
        samples = [Sample(0.0, self.drift.deviation(places[0]), None)]
        asked = count > 1 and self.split and self.method.splits and may_split(block, self.method.before)
        for k in range(1, count + 1):
            if dt > 0:
                self.drift.advance(dt / count, speed)
            if k < count:
                time = self.seconds + dt * k / count
                demand = self._demanded(block.line.number, time, places[k]) if asked else None
                samples.append(Sample(k / count, self.drift.deviation(places[k]), demand))
        return samples

    def _note_block(self, block: Block, start: float, speed: float, cutting: bool) -> None:
        if block.tool_change is not None:
            self.tool_changes.append(start)
        if not (speed or self.standing) and cutting and block.kind in ("line", "arc", "curve") and block.moves:
            self.standing = block.line.number

    def _note_held(
        self, block: Block, demand: Vector, drift: Vector, ends: tuple[Vector, Vector], cut: CutErrors
    ) -> None:
        """Record the reason that held the correction in a cut, given the drift at its start."""
        tolerance = self.demand.tolerance
        gap = max(*cut.left[1], -min(cut.left[0]))
        if gap <= TELLING * tolerance:
            self._why = ""
            return
        if max(map(abs, map(sub, demand, ends[1]))) > tolerance:
            self._why = self.method.held_by(block)
        elif self.demand.every is not None:
            self._why = "the time between updates"
        elif gap > max(map(abs, map(add, drift, ends[0]))):
            self._why = "the length of the line, along which the drift is not linear"
        else:
            self._why = self._why or "the moves before the cut, in which the correction could not change"
        if gap > self.held.get(self._why, (0.0, 0))[0]:
            self.held[self._why] = gap, block.line.number

    def _refuse_open(self, carried: Vector) -> None:
        """Raise `ProgramError` if an offset would remain in force after the last line."""
        if not self.ended and any(carried) and self.method.leaves_offset:
            raise ProgramError(
                self.lines,
                "the program has no end (M2, M30 or %) at which the offset could be cancelled; add M2 or M30",
            )
