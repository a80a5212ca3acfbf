"""Precompensation: a program is revised before it is run, by the drift it will cause (P-06).

Everything streams: lines are read, followed, timed, corrected and read again one after the other; what a run tells as a
whole (`Revision`) grows with it.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from thermocomp.compensation.nc.following.block import Block, Point, Setup
from thermocomp.compensation.nc.following.follower import follow
from thermocomp.compensation.nc.reading.line import Line
from thermocomp.compensation.nc.reading.recognise import recognise
from thermocomp.compensation.nc.reading.tokens import read_lines
from thermocomp.compensation.nc.revising import header
from thermocomp.compensation.nc.revising.check import Check
from thermocomp.compensation.nc.revising.demand import Demand, Drifting, Left
from thermocomp.compensation.nc.revising.frame import Vector
from thermocomp.compensation.nc.revising.method import Method
from thermocomp.compensation.nc.revising.offset import ending
from thermocomp.compensation.nc.timing.timeline import Kinematics, timed
from thermocomp.core.exceptions import ProgramError

#: lines by which the control is recognised that a program is for
FIRST = 200


class Revised(NamedTuple):
    """A line, and what has become of it."""

    number: int  #: of the original line; 0 for the header
    text: str  #: the original line; empty for the header
    texts: tuple[str, ...]  #: what stands in its place
    block: Block | None  #: what it does; None for the header and for what stands behind the end
    start: float  #: when it begins [s]
    end: float  #: when it ends [s]
    deviation: Vector  #: drift at its end, at its place [um, machine axes]
    carried: Vector  #: correction that the axes carry at its end [um, machine axes]
    inner: Vector  #: and on the way, in a cycle that ends where it began


@dataclass
class Revision:
    """One run of the revision.

    Parameters
    ----------
    setup : Setup
    kinematics : Kinematics
    drift : Drifting
        At its start state.
    method : Method
    demand : Demand

    Attributes
    ----------
    left : Left
        What the correction leaves of the drift in the cuts.
    lines, changed : int
        Lines read, and how many of them are not as they were.
    seconds : float
        How long the program runs [s].
    tool_changes : list of float
        When [s].
    slowest, fastest : float
        Spindle speeds met [1/min].
    """

    setup: Setup
    kinematics: Kinematics
    drift: Drifting
    method: Method
    demand: Demand
    left: Left = field(default_factory=Left, init=False)
    lines: int = field(default=0, init=False)
    changed: int = field(default=0, init=False)
    seconds: float = field(default=0.0, init=False)
    tool_changes: list[float] = field(default_factory=list, init=False)
    slowest: float = field(default=float("inf"), init=False)
    fastest: float = field(default=0.0, init=False)

    def revise(self, texts: Iterable[str]) -> Iterator[Revised]:
        """Revise a program.

        Parameters
        ----------
        texts : iterable of str
            Its lines, with their endings.

        Yields
        ------
        Revised
            For every line in order, and once for an empty header (`thermocomp.compensation.nc.revising.header`).

        Raises
        ------
        ProgramError
            The program cannot be revised safely; what was yielded before is worth nothing.
        InputError
            It is not an ISO program.
        """
        rest = iter(texts)
        first = list(itertools.islice(rest, FIRST))
        recognise(first)
        lines = self._guarded(read_lines(itertools.chain(first, rest), self.setup.controller))
        check = Check(self.setup)
        steered = _Spindle(self.setup)
        point: Point = (0.0, 0.0, 0.0)
        deviation = self.drift.deviation(point)
        headed = ended = False
        carried = self.method.carried
        for block, start, end in timed(follow(lines, self.setup), self.kinematics):
            line = block.line
            if not headed and not header.comes_first(line):
                yield self._header(line.text, deviation, carried)
                headed = True
            self._advance(end - self.seconds, steered.speed(block))
            self.seconds = end
            if block.tool_change is not None:
                self.tool_changes.append(start)
            before = deviation, carried
            if block.moves:
                point = block.moves[-1].end
            deviation = self.drift.deviation(point)
            change = self.method.revise(block, self.demand.at(end, self.drift, point))
            check.check(block, change)
            carried = change.after
            if block.moves:
                self.left.take(block, (before, (deviation, carried)))
            ended |= block.ends
            yield self._told(
                Revised(line.number, line.text, change.texts, block, start, end, deviation, carried, change.inner)
            )
        if not headed:
            raise ProgramError(max(self.lines, 1), "there is nothing in this program")
        if not ended and any(carried):
            self._refuse_open()
        for line in lines:
            yield self._told(
                Revised(
                    line.number, line.text, (line.text,), None, self.seconds, self.seconds, deviation, carried, carried
                )
            )

    def _guarded(self, lines: Iterable[Line]) -> Iterator[Line]:
        for line in lines:
            if line.comment:
                header.refuse_revised(line)
            yield line

    def _header(self, text: str, deviation: Vector, carried: Vector) -> Revised:
        return Revised(0, "", header.blank(ending(text)), None, 0.0, 0.0, deviation, carried, carried)

    def _told(self, revised: Revised) -> Revised:
        self.lines += 1
        self.changed += revised.texts != (revised.text,)
        return revised

    def _advance(self, dt: float, speed: float) -> None:
        if dt > 0:
            self.drift.advance(dt, speed)
            if speed:
                self.slowest = min(self.slowest, abs(speed))
                self.fastest = max(self.fastest, abs(speed))

    def _refuse_open(self) -> None:
        """Raise `ProgramError` if an offset would stay in force behind the last line."""
        if self.method.leaves_offset:
            raise ProgramError(
                self.lines, "the program has no end (M2, M30 or %) at which the offset could be taken back"
            )


@dataclass
class _Spindle:
    """Spindle speed, also of a program that finds the spindle running."""

    setup: Setup
    _told: bool = False

    def speed(self, block: Block) -> float:
        """Return the speed in a block [1/min].

        Raises
        ------
        ProgramError
            The program cuts, and nobody knows how fast the spindle turns.
        """
        if not self._told:
            self._told = any(code in ("M3", "M4", "M5") for code in block.codes)
            if not self._told and self.setup.speed:
                return self.setup.speed
            if not self._told and any(not m.rapid for m in block.moves):
                raise ProgramError(
                    block.line.number,
                    "the program cuts, but has not said how fast the spindle turns (S, M3): its drift is unknown; "
                    "state the speed it finds with --speed",
                )
        return block.speed
