"""Whether a program stays where the machine can go: if it does not, it is wrong, or what was told of its origins."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from thermocomp.compensation.nc.following.block import Setup
from thermocomp.compensation.nc.revising.revise import Revised

#: so far beyond the travel an axis has to go before anybody is told [mm]
BEYOND = 1.0


@dataclass
class Travel:
    """Follows the cuts of a program in machine coordinates, where these are known.

    Parameters
    ----------
    setup : Setup
        Only cuts in a work coordinate system whose origin it tells are looked at, and Z only where the tool's length is
        told too.
    limits : mapping of str to tuple of float
        Lowest and highest position by axis [mm].
    """

    setup: Setup
    limits: Mapping[str, tuple[float, float]]
    _farthest: dict[str, tuple[float, float, int]] = field(default_factory=dict, init=False)  # beyond, position, line
    _tool: int = field(default=0, init=False)
    _length_told: bool = field(default=True, init=False)

    def take(self, revised: Revised) -> None:
        """Take a line in, in its order."""
        block = revised.block
        if block is None:
            return
        if block.tool_change is not None:
            self._tool = block.tool_change
        if any(code.startswith("G43") for code in block.codes):
            tool = int(block.values.get("H", self._tool))
            self._length_told = not tool or tool in self.setup.tools
        elif "G49" in block.codes:
            self._length_told = True
        if block.modal.system not in self.setup.offsets or all(m.rapid for m in block.moves):
            return
        for k, axis in enumerate("XYZ"):
            if axis not in self.limits or not block.known[k] or (axis == "Z" and not self._length_told):
                continue
            low, high = self.limits[axis]
            for move in block.moves:
                position = move.end[k]
                beyond = max(low - position, position - high)
                if not move.rapid and beyond > max(BEYOND, self._farthest.get(axis, (0.0,))[0]):
                    self._farthest[axis] = beyond, position, block.line.number

    def warnings(self) -> list[str]:
        """Return which axes have left their travel, and where they were the farthest beyond."""
        return [
            f"{axis} goes to {position:.6g} mm at line {line}, in machine coordinates: outside its travel, "
            f"{self.limits[axis][0]:g} to {self.limits[axis][1]:g} mm; check the program and the origins"
            for axis, (_, position, line) in sorted(self._farthest.items())
        ]
