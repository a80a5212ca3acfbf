"""Conditions covered by the units on which a model was judged."""

from dataclasses import dataclass

from thermocomp.core.bounds import COEFFICIENT, check_between, check_finite, check_name
from thermocomp.core.exceptions import SettingError


@dataclass(frozen=True)
class Validity:
    """Conditions covered by the judged units, for which the honest error is valid.

    Parameters
    ----------
    units : int
        Cycles, files or blocks that were judged.
    independent : int
        Number of them when similar ones count once.
    nearest : float or None
        Distance of the two units that are most alike, in standard deviations of the inputs; None with a single unit.
        Below `thermocomp.judging.coverage.ALIKE` two units are alike.
    speeds : tuple of float
        Spindle speeds that were run; those nearer than 2 % of the largest are one [1/min]; empty if none was recorded.
    ambient : tuple of float or None
        Lowest and highest temperature of the surroundings [degC]; None if no channel is named after them.
    ambient_channel : str
        That channel; empty if there is none.
    start : tuple of float or None
        Lowest and highest mean of all temperatures at the start of a unit [degC]; None without a temperature.
    days : int
        Calendar days with a judged row; 0 if the recordings have no time stamps.
    hours : float
        Judged in all [h].

    Raises
    ------
    InputError
        Fewer units than independent ones, or numbers that count or measure nothing.
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

    def __post_init__(self) -> None:
        if not 0 <= self.independent <= self.units:
            raise SettingError(f"validity: {self.independent} independent of {self.units} units")
        check_between("validity", 0, COEFFICIENT, nearest=self.nearest or 0.0, days=self.days, hours=self.hours)
        check_finite("validity", speeds=self.speeds, ambient=self.ambient or (), start=self.start or ())
        if self.ambient_channel:
            check_name("validity", self.ambient_channel)
