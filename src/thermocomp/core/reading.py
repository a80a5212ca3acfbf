"""Readings of all sensors at one instant, and measurements of the tool point."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


@dataclass(frozen=True)
class Reading:
    """One synchronised sample of all sensors of a machine.

    Parameters
    ----------
    time : float
        Time of the reading on any monotonic clock [s].
    values : mapping of str to float
        Channel name to value in house units: temperatures [degC], spindle speed [1/min].
    positions : mapping of str to float
        Axis letter to position [mm].
    counter : float
        Number that changes with each reading of the source; 0: the source does not count.

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
    counter: float = 0.0


class Measurement(NamedTuple):
    """Deviation of a target, or position error of an axis, measured at the tool point while the machine runs."""

    time: float  #: seconds since 1970
    target: str
    measured: float  #: deviation [um]
    left: bool  #: True: residual under the correction in force; False: deviation without correction
    repeatability: float = 0.5  #: standard deviation [um]
    position: float = 0.0  #: axis position [mm]
    keys: tuple[str, ...] = ()  #: id, time and content: a measurement that shares one of them is a repetition
