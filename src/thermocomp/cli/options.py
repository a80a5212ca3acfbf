"""Groups of options that several commands share, and the objects made from them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.api.inputs import LeaveOne

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
OptionalOutput = Annotated[Path | None, Parameter(name=["--output", "-o"])]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LeaveOneOut:
    """Cycles, days or files that are left out of the fit and judged, in turn.

    Parameters
    ----------
    leave_one_cycle_out : bool
        Leave out each thermal cycle in turn and judge on it. Default if no other split is given.
    leave_one_day_out : bool
        Leave out each day in turn and judge on it; the recordings need time stamps.
    leave_one_file_out : bool
        Leave out each recording in turn and judge on it.
    """

    leave_one_cycle_out: bool = False
    leave_one_day_out: bool = False
    leave_one_file_out: bool = False

    def value(self) -> "LeaveOne | None":
        """Return the option as an argument of the verbs.

        Raises
        ------
        InputError
            More than one option is given.
        """
        units: dict[LeaveOne, bool] = {
            "cycle": self.leave_one_cycle_out,
            "day": self.leave_one_day_out,
            "file": self.leave_one_file_out,
        }
        named: list[LeaveOne] = [unit for unit, asked in units.items() if asked]
        if len(named) > 1:
            ways = ", ".join(f"--leave-one-{unit}-out" for unit in named)
            raise InputError(f"{ways} exclude each other: choose one")
        return named[0] if named else None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CompensatorOptions:
    """Limits of the corrections.

    Parameters
    ----------
    magnitude : float
        Largest correction in either direction [um].
    rate : float
        Fastest change of a correction [um/s].
    dead_band : float
        Dead band of a correction: smaller changes are not applied [um].
    """

    magnitude: float = Limits.magnitude
    rate: float = Limits.rate
    dead_band: float = Limits.dead_band

    def value(self) -> Limits:
        """Return the limits as an object for the compensator."""
        return Limits(self.magnitude, self.rate, self.dead_band)
