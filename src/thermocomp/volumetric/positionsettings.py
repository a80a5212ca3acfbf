"""How position-dependent errors are fitted and judged, for Python and the command line alike."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.api.inputs import LeaveOne

#: with so many recordings each is left out in turn, else each thermal cycle
MANY = 3


@dataclass(frozen=True, kw_only=True)
class PositionSettings:
    """How profiles are read, fitted and judged; what is not given is found out from them.

    Parameters
    ----------
    columns : str
        Names of the columns of one component, * standing for the position in mm, such as 'y_laser_*'; of a long table
        the column of the error. Without it those that are called after the component, such as EYY_250_um, or else
        those that end in a position and the unit, such as y_laser_250_um.
    positions : Path
        TOML file that says where each column was measured, for columns that have no position in their name.
    layout : str
        wide: a row per thermal state, a column per position; long: a row per position. Found out if not given.
    mapping : Path
        TOML file that says what the columns are.
    model : str
        Method for the slopes, as in ``thermocomp compare``, all but gp.
    inputs : list of str
        Channels to predict the slopes from; all temperatures and the spindle speed if not given.
    slopes : int
        Highest power of the position; 0: the cold profile alone. As many as are worth it if not given.
    offset : bool
        Model a shift of the whole profile too. If not given: where it is more than noise.
    profile : str
        polynomial or spline, for the cold profile.
    order : int
        Of the polynomial, or number of knots of the spline; chosen by points left out if not given.
    reference : list of int
        States of each test that count as cold, from 0: their mean is the cold profile. The first if not given.
    reference_position : float
        Where the slopes turn [mm]; where the thermal part is smallest if not given.
    split : str
        Judge by time: shares of the states such as 0.6/0.4, or hours such as 10h/6h.
    leave_one_cycle_out : bool
        Judge on each thermal cycle in turn (what is done with fewer than three recordings, if nothing is said).
    leave_one_file_out : bool
        Judge on each recording in turn (what is done with three and more).
    absolute : bool
        Count all tests from one cold state, the mean of theirs, with temperatures as they are: for a machine that is
        not the same every morning. Without it each test counts from its own.
    jobs : int
        Processes to share the work among; -1 takes all cores.
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
        """Return what is left out in turn; with many recordings each of them, if nothing is said."""
        asked = (self.split is not None) + self.leave_one_cycle_out + self.leave_one_file_out
        if asked > 1:
            raise InputError("--split, --leave-one-cycle-out, --leave-one-file-out exclude each other: choose one")
        if self.leave_one_file_out or (recordings >= MANY and not asked):
            return "file"
        return "cycle" if self.leave_one_cycle_out else None
