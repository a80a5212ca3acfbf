"""Settings for fitting and judging position-dependent errors, for Python and the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.api.inputs import LeaveOne

#: minimum number of recordings for leaving out each recording in turn, else each thermal cycle
MANY = 3


@dataclass(frozen=True, kw_only=True)
class PositionSettings:
    """Settings for reading, fitting and judging profiles; the defaults are determined from the profiles.

    Parameters
    ----------
    columns : str
        Column names of one component, with * for the position in mm, such as 'y_laser_*'; in a long table, the name of
        the column with the error. Default: columns named after the component, such as EYY_250_um, otherwise those whose
        names end in a position and the unit, such as y_laser_250_um.
    positions : Path
        TOML file with the measuring position of each column, for columns without a position in their name.
    layout : str
        Table layout. wide: a row per thermal state, a column per position; long: a row per position. Default:
        determined from the file.
    mapping : Path
        TOML mapping file: role and unit of each column.
    model : str
        Method for the slopes: any method of ``thermocomp compare`` except gp.
    inputs : list of str
        Channels used as inputs for the slopes. Default: all temperatures and the spindle speed.
    slopes : int
        Highest power of the position in the thermal part; 0: the cold profile only. Default: as many powers as are
        useful.
    offset : bool
        Also model a shift of the whole profile. Default: only where the shift exceeds the noise.
    profile : str
        Form of the cold profile: polynomial or spline.
    order : int
        Degree of the polynomial, or number of knots of the spline. Default: chosen by cross-validation over the points.
    reference : list of int
        States of each test that count as cold, as indices from 0; their mean is the cold profile. Default: the first
        state.
    reference_position : float
        Reference position of the slopes [mm]. Default: the position where the thermal part is smallest.
    split : str
        Chronological train/test split: fractions of the states such as 0.6/0.4, or durations such as 10h/6h.
    leave_one_cycle_out : bool
        Leave out each thermal cycle in turn and judge on it (default with fewer than three recordings).
    leave_one_file_out : bool
        Leave out each recording in turn and judge on it (default with three or more recordings).
    absolute : bool
        Use absolute temperatures and one common cold state, the mean of those of the tests: for a machine whose state
        differs from morning to morning. Default: each test relative to its own cold state.
    jobs : int
        Number of parallel processes; -1: one per core.
    """

    columns: str = ""
    positions: Path | None = None
    layout: Literal["wide", "long"] | None = None
    mapping: Path | None = None
    model: str = "dynamic"
    inputs: list[str] | None = None
    slopes: int | None = None
    offset: bool | None = None
    profile: Literal["polynomial", "spline"] = "polynomial"
    order: int | None = None
    reference: list[int] | None = None
    reference_position: float | None = None
    split: str | None = None
    leave_one_cycle_out: bool = False
    leave_one_file_out: bool = False
    absolute: bool = False
    jobs: int = -1

    def left_out(self, recordings: int) -> "LeaveOne | None":
        """Return what is left out in turn, cycles or recordings; by default recordings if there are at least `MANY`."""
        asked = (self.split is not None) + self.leave_one_cycle_out + self.leave_one_file_out
        if asked > 1:
            raise InputError("--split, --leave-one-cycle-out, --leave-one-file-out exclude each other: choose one")
        if self.leave_one_file_out or (recordings >= MANY and not asked):
            return "file"
        return "cycle" if self.leave_one_cycle_out else None
