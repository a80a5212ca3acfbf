"""Deviation, correction and the limits of a correction."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.messages import Message

#: scalar or array of positions
_Position = TypeVar("_Position", float, NDArray[np.float64])


@dataclass(frozen=True)
class Deviation:
    """Actual minus commanded tool point along one axis: an offset at a position, and a slope along the travel.

    Parameters
    ----------
    offset : float
        Deviation at the reference position [um].
    slope : float
        Change of the deviation along the axis [um/m].
    reference_position : float
        Position at which `offset` is valid [mm].

    Raises
    ------
    InputError
        A number is NaN or infinite.

    Examples
    --------
    >>> from thermocomp import Deviation
    >>> Deviation(offset=12.0, slope=20.0, reference_position=100.0).at(350.0)  # [um]
    17.0
    """

    offset: float
    slope: float = 0.0
    reference_position: float = 0.0

    def __post_init__(self) -> None:
        _check_finite("deviation", self.offset, self.slope, self.reference_position)

    def at(self, position: _Position) -> _Position:
        """Return the deviation [um] at a position [mm] (Chen 1996, Eq. 2 to first order)."""
        return self.offset + self.slope * 1e-3 * (position - self.reference_position)

    def less(self, other: "Deviation") -> "Deviation":
        """Return this deviation minus another one, with the reference position of this one."""
        at = self.reference_position
        return Deviation(self.offset - other.at(at), self.slope - other.slope, at)


@dataclass(frozen=True)
class Correction:
    """Correction that a controller adds along one axis: minus the deviation.

    Siemens and Beckhoff/ISG use the form ``K(T, P) = K0(T) + tan b(T) (P - P0)``, and Heidenhain an equivalent one.

    Parameters
    ----------
    offset : float
        K0 [um].
    slope : float
        tan b [um/m].
    reference_position : float
        P0 [mm].

    Raises
    ------
    InputError
        A number is NaN or infinite, which must never reach a controller.

    Examples
    --------
    >>> from thermocomp import Correction, Deviation
    >>> Correction.opposing(Deviation(12.0, slope=20.0)).at(250.0)  # [um]
    -17.0
    """

    offset: float
    slope: float = 0.0
    reference_position: float = 0.0

    def __post_init__(self) -> None:
        _check_finite("correction", self.offset, self.slope, self.reference_position)

    @classmethod
    def opposing(cls, deviation: Deviation) -> "Correction":
        """Return the correction that cancels `deviation`; the sign is changed only here."""
        # "0.0 -" rather than a bare minus: a zero deviation must not become -0.0 in a journal or a controller
        return cls(0.0 - deviation.offset, 0.0 - deviation.slope, deviation.reference_position)

    def at(self, position: _Position) -> _Position:
        """Return the correction [um] at a position [mm]."""
        return self.offset + self.slope * 1e-3 * (position - self.reference_position)


def uncompensated(residual: _Position, correction: _Position) -> _Position:
    """Return the uncompensated deviation: the measured residual minus the correction.

    The residual error of the tool point is the sum of the deviation of the machine and the correction added by the
    controller. Both have the same zero. They are separated only here.

    Parameters
    ----------
    residual, correction : float or ndarray
        [um]
    """
    return residual - correction


@dataclass(frozen=True)
class Limits:
    """Limits of a correction.

    Parameters
    ----------
    magnitude : float
        Largest correction in either direction [um].
    rate : float
        Fastest change of the correction [um/s].
    dead_band : float
        Dead band [um]: a new target closer than this to the correction in force is ignored.
    reading_age : float
        Maximum age of a reading; older readings are not used [s].
    hold : float
        Hold time of a correction without valid readings [s].
    fade : float
        Time constant of the decay of the correction to zero after the hold time [s].

    Examples
    --------
    >>> from thermocomp import Limits
    >>> Limits(magnitude=80.0, rate=0.05).in_words()
    'at most 80 um, 0.05 um/s, dead band 0 um'
    """

    magnitude: float = 500.0
    rate: float = 0.1
    dead_band: float = 0.0
    reading_age: float = 60.0
    hold: float = 1800.0
    fade: float = 3600.0

    def __post_init__(self) -> None:
        values = {name: getattr(self, name) for name in ("magnitude", "rate", "reading_age", "hold", "fade")}
        wrong = [f"limit {name} = {value}: must be positive" for name, value in values.items() if not value > 0]  # nan
        if not (self.dead_band >= 0 and math.isfinite(self.dead_band)):
            wrong.append(f"limit dead_band = {self.dead_band}: must be finite and not negative")
        if wrong:
            raise SettingError("; ".join(wrong))

    def in_words(self) -> Message:
        """Return the limits as text, such as ``at most 500 um, 0.1 um/s, dead band 0 um``."""
        return Message(
            "at most {magnitude:g} um, {rate:g} um/s, dead band {dead_band:g} um",
            magnitude=self.magnitude,
            rate=self.rate,
            dead_band=self.dead_band,
        )


def _check_finite(what: str, offset: float, slope: float, reference_position: float) -> None:
    if not (math.isfinite(offset) and math.isfinite(slope) and math.isfinite(reference_position)):
        raise InputError(
            f"{what}: offset {offset}, slope {slope}, reference position {reference_position}: must be finite numbers"
        )
