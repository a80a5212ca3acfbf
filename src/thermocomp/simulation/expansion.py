"""From temperatures to the tool point: how the virtual machining centre expands.

Plausible engineering values, not those of a certain machine. The loop of lengths nearly closes: a machine that is
evenly warm is almost as accurate as a cold one, as real ones are (C-03).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.correction import Deviation
from thermocomp.simulation.machine import Truth

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Geometry:
    """Lengths of the parts that stand between tool and workpiece, and how their joints yield.

    Parameters
    ----------
    reference : float
        Temperature at which nothing deviates [degC].
    steel, iron : float
        Expansion of shaft and screws; of castings [um/(m K)].
    bar, nose, housing, headstock : float
        Lengths along Z of the test bar, of the shaft to the front bearing, to the flange, to the column [m].
    table_z, bed, screw_z : float
        Along Z: workpiece to table centre, table centre to bearing of Z, bearing to nut [m].
    height, column_top, screw_y : float
        Spindle above the bed, bearing of Y above the bed, bearing of Y down to its nut [m].
    table_y : float
        Workpiece above the bed [m].
    low : float
        Height of the column's lower half [m].
    bed_depth, bed_lever : float
        Height of the bed; length over which its bending tilts the column [m].
    screw_x : float
        Bearing of X to its nut [m].
    depth, width : float
        Distance of the column's front and rear, right and left walls [m].
    overhang : float
        Tool in front of the column's middle [m].
    bearing_span, mount : float
        Distance of the spindle's bearings; spindle above its mounting in the headstock [m].
    preload : float
        Axial shift of the shaft by thermal preload, per squared difference of shaft and housing [um/K^2].
    gib : float
        Sinking of the headstock in its guide, per squared difference of headstock and column [um/K^2].
    centrifugal, lift : float
        Shift of the shaft along Z and Y at top speed by centrifugal forces, with the square of speed [um].
    stiction : float
        How far the column's foot may want to slide on the bed before it does [um].
    """

    reference: float = 20.0
    steel: float = 11.7
    iron: float = 10.8
    bar: float = 0.12
    nose: float = 0.16
    housing: float = 0.14
    headstock: float = 0.40
    table_z: float = 0.20
    bed: float = 1.60
    screw_z: float = 0.60
    height: float = 0.95
    column_top: float = 1.35
    screw_y: float = 0.40
    table_y: float = 0.95
    low: float = 0.60
    bed_depth: float = 0.60
    bed_lever: float = 0.80
    screw_x: float = 0.45
    depth: float = 0.65
    width: float = 0.80
    overhang: float = 0.90
    bearing_span: float = 0.40
    mount: float = 0.16
    preload: float = 0.12
    gib: float = 0.3
    centrifugal: float = 4.0
    lift: float = -1.5
    stiction: float = 2.5

    def wish(self, temperatures: FloatArray, index: Mapping[str, int]) -> float:
        """Slide of the column's foot on the bed if nothing held it [um]."""
        t = temperatures
        foot = t[[index[f"{n}_low"] for n in _COLUMN]].mean()
        return float(self.iron * self.depth * (foot - t[index["bed_rear"]]))

    def slide(self, slid: float, wish: float) -> float:
        """Return how far the foot has slid [um]: it follows its wish, but for the friction that holds it (play)."""
        return min(max(slid, wish - self.stiction), wish + self.stiction)

    def truth(self, temperatures: FloatArray, index: Mapping[str, int], ratio: float, slid: float) -> Truth:
        """Return the deviation of the tool point.

        Parameters
        ----------
        temperatures : ndarray of shape (n_nodes,)
            [degC]
        index : mapping of str to int
            Position of each node.
        ratio : float
            Share of top speed.
        slid : float
            Slide of the column's foot [um].
        """
        rise = dict(zip(index, (temperatures - self.reference).tolist(), strict=True))
        iron, steel = self.iron, self.steel
        high, low = _walls(rise, ""), _walls(rise, "_low")
        # A wall warmer than the opposite one curves the column away from it; the lower half has the longer lever.
        lever_low, lever_high = self.low * (self.height - self.low / 2), (self.height - self.low) ** 2 / 2
        bend_z = iron / self.depth * (low.front_rear * lever_low + high.front_rear * lever_high)
        bend_x = -iron / self.width * (low.right_left * lever_low + high.right_left * lever_high)
        lean = iron / self.depth * (low.front_rear * self.low + high.front_rear * (self.height - self.low))
        # A bed that is warmer on top lifts its middle and lets the column lean back.
        crown = (rise["bed_front"] + rise["bed_rear"]) / 2 - rise["bed_bottom"]
        sag = iron * self.bed_lever * crown / self.bed_depth
        head = 0.6 * rise["headstock_front"] + 0.4 * rise["headstock_rear"]
        differential = rise["headstock_front"] - rise["headstock_rear"]
        tilt_a = lean + sag + iron * self.mount * differential / self.bearing_span
        tilt_b = iron * self.depth * high.right_left / self.width
        x = bend_x - tilt_b * self.overhang
        # The bearing of X sits on the right: its screw pushes the table to the left, its bed the bearing to the right.
        x += self.screw_x * (steel * rise["x_screw"] - iron * rise["bed_front"])
        y = iron * (self.low * low.mean + (self.column_top - self.low) * high.mean)
        y -= steel * self.screw_y * rise["y_screw"] + iron * self.table_y * rise["table"]
        y += tilt_a * self.overhang - self.gib * (head - high.mean) ** 2 + self.lift * ratio**2
        z = bend_z + sag * self.height - iron * self.headstock * head - iron * self.housing * rise["housing"]
        z -= steel * (self.nose * rise["shaft"] + self.bar * rise["tool"]) + iron * self.table_z * rise["table"]
        z += iron * self.bed * (rise["bed_front"] + rise["bed_rear"]) / 2 - steel * self.screw_z * rise["z_screw"]
        tightening = rise["shaft"] - rise["housing"]
        z += -self.preload * tightening * abs(tightening) + self.centrifugal * ratio**2 + slid
        return Truth(
            temperatures,
            x=Deviation(x, steel * rise["x_screw"]),
            y=Deviation(y, steel * rise["y_screw"]),
            z=Deviation(z, steel * rise["z_screw"]),
            tilt_a=tilt_a,
            tilt_b=tilt_b,
        )


_COLUMN = ("column_front_right", "column_front_left", "column_rear_right", "column_rear_left")


@dataclass(frozen=True)
class _Walls:
    """Mean of the four walls of half the column, front minus rear, right minus left [K]."""

    mean: float
    front_rear: float
    right_left: float


def _walls(rise: Mapping[str, float], half: str) -> _Walls:
    front_right, front_left, rear_right, rear_left = (rise[n + half] for n in _COLUMN)
    return _Walls(
        (front_right + front_left + rear_right + rear_left) / 4,
        (front_right + front_left - rear_right - rear_left) / 2,
        (front_right + rear_right - front_left - rear_left) / 2,
    )
