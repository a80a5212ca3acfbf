"""Possible contact of the tool with the part, and the change of the correction allowed during contact."""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.arcs import length
from thermocomp.nc.interpreter.block import Block

#: path length in a cut over which the correction changes by at most one step [mm]
SPREAD = 10.0
#: largest slope with which an approach by feed takes up the correction after machine coordinates [um/mm]
STEEPEST = 10.0
#: a tool that is raised by more has left the surface; levels that differ by less are equal [mm]
CLEAR = 0.5


@dataclass
class Contact:
    """Contact state: from a feed move until the tool is lifted, changed, or moved in machine coordinates.

    The program does not specify which cuts are finishing cuts, so each is treated as one. A rapid that stays at depth
    is part of the cut: it may lead to the next pass over the same face.

    Parameters
    ----------
    step : float
        Maximum change of the correction per 10 mm of path [um].
    safe_z : float or None
        Work coordinate Z at and above which the tool is never in contact [mm].
    """

    step: float
    safe_z: float | None = None
    touching: bool = field(default=False, init=False)
    _way: list[float] = field(default_factory=lambda: [math.inf] * 3, init=False)  # since last change
    _length: float = field(default=0.0, init=False)

    def begin(self, block: Block) -> None:
        """Update the contact state at the start of a block, before `most` is called."""
        if block.tool_change is not None:
            self._leave()
        self._length = sum(map(length, block.moves))

    def most(self, block: Block, axis: int) -> float:
        """Return the maximum change of the correction of an axis in a block [um]."""
        rapid = not block.moves or block.moves[-1].rapid
        if (rapid and not self.touching) or self._above(block):
            return math.inf
        if rapid and self._lifts(block) and (axis == 2 or block.modal.plane != 17):
            return math.inf  # lifted along a wall
        if not self.touching and abs(block.end[axis] - block.start[axis]) > CLEAR:
            return math.inf  # approach
        spread = self._length / SPREAD
        return self.step * (max(spread, 1.0) if self._way[axis] >= SPREAD else math.floor(spread))

    def takes_up(self, block: Block, gap: float, *, known: bool) -> bool:
        """Return whether an axis without a correction may take up all of it [um]: the tool is free for long enough.

        Parameters
        ----------
        known : bool
            The position of the axis before the block is known, so that the length of the block is, too.
        """
        long = not known or abs(gap) <= STEEPEST * self._length
        return not self.touching and (long or block.moves[-1].rapid)

    def end(self, block: Block, changed: list[bool]) -> None:
        """Record the end of a block, and the axes whose correction changed in it."""
        self._way = [0.0 if c else w + self._length for c, w in zip(changed, self._way, strict=True)]
        if not block.moves:
            return
        rapid = block.moves[-1].rapid
        machine = block.kind == "machine"
        if machine and not rapid and "Z" not in block.words and block.modal.plane == 17:
            return  # fed in machine coordinates: a tool in contact stays there
        if (
            machine
            or block.kind in ("home", "cycle")
            or (rapid and (not self.touching or self._lifts(block)))
            or self._above(block)
        ):
            self._leave()
        elif not rapid:
            self.touching = True

    def _leave(self) -> None:
        self.touching, self._way = False, [math.inf] * 3

    def _lifts(self, block: Block) -> bool:
        """Return whether the tool is lifted: along Z, or in any direction under G18 and G19 (lathe, horizontal)."""
        if block.modal.plane == 17:
            return block.end[2] - block.start[2] > CLEAR
        return math.dist(block.start, block.end) > CLEAR

    def _above(self, block: Block) -> bool:
        return self.safe_z is not None and block.known[2] and min(block.start[2], block.end[2]) >= self.safe_z - 1e-9
