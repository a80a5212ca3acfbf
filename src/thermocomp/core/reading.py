"""Readings of the machine at one instant."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


@dataclass(frozen=True)
class Reading:
    """One synchronised sample of a machine's sensors.

    Parameters
    ----------
    time : float
        Time of the reading [s]; any clock that only moves forward.
    values : mapping of str to float
        Channel name to value in internal units: temperatures [degC], spindle speed [1/min].
    positions : mapping of str to float
        Axis letter to position [mm].

    Examples
    --------
    >>> from thermocomp import Reading
    >>> reading = Reading(60.0, {"t_front_C": 21.5, "spindle_rpm": 6000.0}, {"Z": 250.0})
    >>> reading.values["t_front_C"]
    21.5
    """

    time: float
    values: Mapping[str, float]
    positions: Mapping[str, float] = field(default_factory=dict)


class Measurement(NamedTuple):
    """The tool point of a target or axis, measured while the machine runs."""

    time: float  #: seconds since 1970
    target: str
    measured: float  #: deviation [um]
    left: bool  #: it is what the correction in force left; otherwise the correction is not in it
    repeatability: float = 0.5  #: standard deviation [um]
    position: float = 0.0  #: on the axis [mm]
    keys: tuple[str, ...] = ()  #: its id, its time, its content: a measurement with one of them again is the same
