"""`JobState`: what one job leaves behind for the next one."""

from dataclasses import dataclass

from thermocomp.core.bounds import MEMORY, READING, check_between, check_finite, check_name
from thermocomp.core.exceptions import SettingError


@dataclass(frozen=True)
class StationState:
    """Model state of one station.

    Parameters
    ----------
    station : str
        Which one, such as ``Z at Z 200 mm``.
    target : str
        Of its model.
    model : str
        Which numbers the model is made of: a hash.
    reference : tuple of float
        What counts as zero, per input.
    memory : tuple of float
    deviation : float
        Last deviation given [um].
    zero : float
        Deviation that counts as zero [um].
    doubt : float
        What the bound was widened by because the model had left its trained range [um].
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
    """State that one job leaves for the next one (E-P5).

    Parameters
    ----------
    stations : tuple of StationState
    zero_known : bool
        The deviation that counts as zero is no prediction: the machine was cold then, or measured.

    Raises
    ------
    InputError
        There is no station, or one of them is there twice.
    """

    stations: tuple[StationState, ...]
    zero_known: bool

    def __post_init__(self) -> None:
        names = [s.station for s in self.stations]
        if not names or len(set(names)) != len(names):
            raise SettingError(f"state of a job: expected each station once, found {', '.join(names) or 'none'}")
