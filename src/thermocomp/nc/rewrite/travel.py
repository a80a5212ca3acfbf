"""Check that a program stays within the travel of the machine; otherwise the program or the given origins are wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from thermocomp.nc.rewrite.revise import Revised

#: minimum distance beyond the travel that is reported [mm]
BEYOND = 1.0


@dataclass
class Travel:
    """Check of the cuts of a program in machine coordinates, if program or setup define origin and tool length.

    Parameters
    ----------
    limits : mapping of str to tuple of float
        Lowest and highest position by axis [mm].
    """

    limits: Mapping[str, tuple[float, float]]
    _farthest: dict[str, tuple[float, float, int]] = field(default_factory=dict, init=False)  # beyond, position, line

    def take(self, revised: Revised) -> None:
        """Add a line, in order."""
        block = revised.block
        if block is None:
            return
        modal = block.modal
        if not modal.origin_told or all(m.rapid for m in block.moves):
            return
        for k, axis in enumerate("XYZ"):
            if axis not in self.limits or not block.known[k] or (axis == "Z" and modal.untold_tool is not None):
                continue
            low, high = self.limits[axis]
            for move in block.moves:
                position = move.end[k]
                beyond = max(low - position, position - high)
                if not move.rapid and beyond > max(BEYOND, self._farthest.get(axis, (0.0,))[0]):
                    self._farthest[axis] = beyond, position, block.line.number

    def warnings(self) -> list[str]:
        """Return warnings for the axes that exceed their travel, with the positions farthest beyond it."""
        return [
            f"{axis} goes to {position:.6g} mm at line {line}, in machine coordinates: outside its travel, "
            f"{self.limits[axis][0]:g} to {self.limits[axis][1]:g} mm; check the program and the origins"
            for axis, (_, position, line) in sorted(self._farthest.items())
        ]
