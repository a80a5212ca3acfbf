"""`JobState`: thermal state at the end of a job, for the next one."""

from dataclasses import dataclass

from thermocomp.core.bounds import MEMORY, READING, check_between, check_finite, check_name
from thermocomp.core.exceptions import SettingError


@dataclass(frozen=True)
class StationState:
    """Model state of one station.

    Parameters
    ----------
    station : str
        Name of the station, such as ``Z at Z 200 mm``.
    target : str
        Target of its model.
    model : str
        Hash of the parameters of the model.
    reference : tuple of float
        Zero of each input.
    deviation : float
        Last output deviation [um].
    zero : float
        Deviation that counts as zero [um].
    doubt : float
        Increase of the bound because the model has left its training range [um].
    """

    station: str
    target: str
    model: str
    reference: tuple[float, ...]
    memory: tuple[float, ...]
    deviation: float
    zero: float
    doubt: float

    def __post_init__(self) -> None:
        check_name("station", self.station)
        check_name("target", self.target)
        owner = f"state of {self.station}"
        check_finite(owner, READING, reference=self.reference)
        check_finite(owner, MEMORY, memory=self.memory, deviation=self.deviation, zero=self.zero)
        check_between(owner, 0.0, MEMORY, doubt=self.doubt)


@dataclass(frozen=True)
class JobState:
    """State at the end of a job, for the next one (E-P5).

    Parameters
    ----------
    zero_known : bool
        The deviation that counts as zero is not a prediction: the machine was cold at that time, or the deviation was
        measured.

    Raises
    ------
    InputError
        There is no station, or a station occurs twice.
    """

    stations: tuple[StationState, ...]
    zero_known: bool

    def __post_init__(self) -> None:
        names = [s.station for s in self.stations]
        if not names or len(set(names)) != len(names):
            raise SettingError(f"state of a job: expected each station once, found {', '.join(names) or 'none'}")
