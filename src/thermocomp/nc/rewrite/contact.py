"""Whether the tool may be in the part, and how much a correction may change there."""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.block import Block
from thermocomp.nc.rewrite.path import length

#: way over which the correction changes by one step at most, in a cut [mm]
SPREAD = 10.0
#: a tool that goes up by more than that has left the surface; levels nearer than that are the same [mm]
CLEAR = 0.5


@dataclass
class Contact:
    """The tool is in contact from a feed move on until it is lifted, changed, or sent off in machine coordinates.

    The program does not state which cut finishes, so each is treated as one that does. A rapid that stays at depth is
    part of the cut: it may lead to the next pass over the same face.

    Parameters
    ----------
    step : float
        The correction changes by that at most, per 10 mm of way [um].
    safe_z : float or None
        At and above this Z of the work coordinates the tool is never in contact [mm].
    """

    step: float
    safe_z: float | None = None
    touching: bool = field(default=False, init=False)
    _way: list[float] = field(default_factory=lambda: [math.inf] * 3, init=False)  # since the last change, per axis
    _length: float = field(default=0.0, init=False)

    def begin(self, block: Block) -> None:
        """Start a block, before `most` is called."""
        if block.tool_change is not None:
            self._leave()
        self._length = sum(map(length, block.moves))

    def most(self, block: Block, axis: int) -> float:
        """Return by how much the correction of an axis may change in a block [um]."""
        rapid = not block.moves or block.moves[-1].rapid
        if (rapid and not self.touching) or self._above(block):
            return math.inf
        if rapid and self._lifts(block) and (axis == 2 or block.modal.plane != 17):
            return math.inf  # along a wall it goes up, and nowhere else
        if not self.touching and abs(block.end[axis] - block.start[axis]) > CLEAR:
            return math.inf  # it comes down
        spread = self._length / SPREAD
        return self.step * (max(spread, 1.0) if self._way[axis] >= SPREAD else math.floor(spread))

    def end(self, block: Block, changed: list[bool]) -> None:
        """Register the end of a block, and the axes whose correction changed in it."""
        self._way = [0.0 if c else w + self._length for c, w in zip(changed, self._way, strict=True)]
        if not block.moves:
            return
        rapid = block.moves[-1].rapid
        if (
            block.kind in ("machine", "home", "cycle")
            or (rapid and (not self.touching or self._lifts(block)))
            or self._above(block)
        ):
            self._leave()
        elif not rapid:
            self.touching = True

    def _leave(self) -> None:
        self.touching, self._way = False, [math.inf] * 3

    def _lifts(self, block: Block) -> bool:
        """Return whether the tool is lifted: along Z, or on a lathe or a horizontal machine (G18, G19) anyhow."""
        if block.modal.plane == 17:
            return block.end[2] - block.start[2] > CLEAR
        return math.dist(block.start, block.end) > CLEAR

    def _above(self, block: Block) -> bool:
        return self.safe_z is not None and block.known[2] and min(block.start[2], block.end[2]) >= self.safe_z - 1e-9
