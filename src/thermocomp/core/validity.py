"""Conditions covered by the cycles, files or blocks on which a model was judged."""

from dataclasses import dataclass
from typing import Literal

from thermocomp.core.bounds import COEFFICIENT, check_between, check_finite, check_name
from thermocomp.core.exceptions import SettingError


@dataclass(frozen=True)
class Validity:
    """Conditions covered by the judged cycles, files or blocks, for which the honest error is valid.

    Parameters
    ----------
    units : int
        Number of judged cycles, files or blocks.
    independent : int
        Number of these, with similar ones counted once.
    nearest : float or None
        Distance between the two most similar of these, in standard deviations of the inputs; None with a single one.
        Below `thermocomp.judging.coverage.ALIKE` the two count as alike.
    speeds : tuple of float
        Spindle speeds that were run; speeds within 2 % of the largest are merged [1/min]; empty if not recorded.
    ambient : tuple of float or None
        Minimum and maximum ambient temperature [degC]; None if no channel has a corresponding name.
    ambient_channel : str
        Channel of the ambient temperature; empty if there is none.
    start : tuple of float or None
        Minimum and maximum of the mean of all temperatures at the start of a judged cycle, file or block [degC]; None
        without temperatures.
    days : int
        Number of calendar days with judged rows; 0 if the recordings have no time stamps.
    hours : float
        Total judged duration [h].
    axes : {'moved', 'stood still', 'not recorded'}
        Whether axes moved in the judged rows, by channels of feeds and positions: their heat is judged only then.

    Raises
    ------
    InputError
        `units` is less than `independent`, or a count or value is invalid.
    """

    units: int
    independent: int
    nearest: float | None
    speeds: tuple[float, ...]
    ambient: tuple[float, float] | None
    ambient_channel: str
    start: tuple[float, float] | None
    days: int
    hours: float
    axes: Literal["moved", "stood still", "not recorded"] = "not recorded"

    def __post_init__(self) -> None:
        if not 0 <= self.independent <= self.units:
            raise SettingError(f"validity: independent = {self.independent}: expected 0 to units = {self.units}")
        check_between("validity", 0, COEFFICIENT, nearest=self.nearest or 0.0, days=self.days, hours=self.hours)
        check_finite("validity", speeds=self.speeds, ambient=self.ambient or (), start=self.start or ())
        if self.ambient_channel:
            check_name("validity", self.ambient_channel)
