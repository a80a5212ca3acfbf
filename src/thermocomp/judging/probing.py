"""Probings (measurements of the tool point) during a test: their schedule and their effect."""

import math
import re
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import InputError

_WRITTEN = re.compile(r"every (?P<n>\d*\.?\d+) ?(?P<unit>h|hours?|min|minutes?)(, ?(?P<um>\d*\.?\d+) ?um)?")
_SECONDS = {"h": 3600.0, "m": 60.0}


@dataclass(frozen=True)
class Probings:
    """Probings of a running machine at regular intervals.

    Parameters
    ----------
    every : float
        Interval of the probings; the first is one interval after the start [s].
    repeatability : float
        Repeatability of the probe, standard deviation [um].

    Raises
    ------
    InputError
        A number is not positive, or the repeatability negative.

    Examples
    --------
    >>> from thermocomp import Probings
    >>> Probings.parse("every 2 h, 0.3 um")
    Probings(every=7200.0, repeatability=0.3)
    """

    every: float
    repeatability: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.every < np.inf or not 0.0 <= self.repeatability < np.inf:
            raise InputError(
                f"probings every {self.every:g} s, repeatability {self.repeatability:g} um: expected an interval "
                "above 0 s and a repeatability of at least 0 um"
            )

    @classmethod
    def parse(cls, text: str) -> "Probings":
        """Parse probings as written on the command line, such as ``every 2 h`` or ``every 30 min, 0.3 um``.

        Raises
        ------
        InputError
            The text has neither form.
        """
        found = _WRITTEN.fullmatch(text.strip())
        if found is None:
            raise InputError(
                f"probing {text!r}: write the interval in h or min, and the probe's repeatability (standard "
                f"deviation) if it is not {cls.repeatability:g} um, such as 'every 2 h' or 'every 30 min, 0.3 um'"
            )
        every = float(found["n"]) * _SECONDS[found["unit"][0]]
        return cls(every) if found["um"] is None else cls(every, float(found["um"]))

    @classmethod
    def of(cls, given: object) -> "Probings | None":
        """Return probings as given in Python: as text, as an object, or None.

        Raises
        ------
        InputError
            The argument has another type.
        """
        if given is None or isinstance(given, Probings):
            return given
        if isinstance(given, str):
            return cls.parse(given)
        raise InputError(f"probing {given!r}: expected text such as 'every 2 h', or Probings(every=7200.0)")

    def find_rows(self, time: FloatArray, usable: BoolArray) -> NDArray[np.intp]:
        """Return the rows in which probings are made.

        Parameters
        ----------
        time : ndarray of shape (n_rows,)
            In ascending order [s].
        usable : ndarray of bool of shape (n_rows,)
            Rows with a deviation that can be probed; the first one is the start.

        Returns
        -------
        ndarray of int
            The first usable row of each interval after the first.
        """
        rows = np.flatnonzero(usable)
        if not rows.size:
            return rows
        interval = np.floor((time[rows] - time[rows[0]]) / self.every + 1e-9)
        return rows[np.flatnonzero(np.diff(interval, prepend=0.0) > 0)]

    @property
    def words(self) -> str:
        """Short description of the probings, as in all outputs."""
        often = f"{self.every / 3600:g} h" if self.every >= 3600 else f"{self.every / 60:g} min"
        return f"a probing every {often}"


class ProbingGain(NamedTuple):
    """Error that a model would leave with probings.

    The gain is the mean over the thermal cycles of the reduction of their RMS.
    """

    plan: Probings
    rms: float  #: over all judged rows [um]
    gain: float  #: [um]
    error: float  #: standard error of the gain; nan for a single cycle [um]

    @property
    def words(self) -> str:
        """The gain as text."""
        error = "" if math.isnan(self.error) else f" +- {self.error:.2f}"
        return f"{self.plan.words} would leave {self.rms:.2f} um RMS (gain per cycle {self.gain:.2f}{error} um)"


def find_gain(plan: Probings, without: FloatArray, probed: FloatArray, cycle: NDArray[np.intp]) -> ProbingGain:
    """Return the effect of probings on a residual.

    Parameters
    ----------
    without, probed : ndarray of shape (n_judged,)
        Residual without and with probings [um].
    cycle : ndarray of int of shape (n_judged,)
        Thermal cycle of each row, different in each recording.
    """

    def rms(values: FloatArray) -> float:
        return float(np.sqrt(np.mean(values**2)))

    gains = np.array([rms(without[cycle == c]) - rms(probed[cycle == c]) for c in np.unique(cycle)])
    error = float(gains.std(ddof=1) / math.sqrt(len(gains))) if len(gains) > 1 else math.nan
    return ProbingGain(plan, rms(probed), float(gains.mean()), error)


@dataclass(frozen=True, eq=False)
class Probed:
    """Effect of probings on the judged rows.

    Parameters
    ----------
    at : ndarray of bool of shape (n_judged,)
        A probing was made: it takes effect from the next row on.
    shift : ndarray of shape (n_judged,)
        Learned shift, which is included in the correction [um].
    without : ndarray of shape (n_judged,)
        Minus the correction that would have been in force without probings [um].
    refused : tuple of str
        Reasons why probings were not used.
    """

    plan: Probings
    at: BoolArray
    shift: FloatArray
    without: FloatArray
    refused: tuple[str, ...] = ()

    def take(self, rows: BoolArray) -> "Probed":
        """Return the effect of the probings in selected rows."""
        return replace(self, at=self.at[rows], shift=self.shift[rows], without=self.without[rows])

    def held(self, measured: FloatArray, test: NDArray[np.intp]) -> FloatArray:
        """Return the correction from probings alone: the last one, held; zero before the first of a test [um]."""
        rows = np.arange(len(measured))
        last = np.maximum.accumulate(np.where(self.at, rows, -1))
        before = np.concatenate([[-1], last[:-1]])[: len(rows)]  # it takes effect from the next row on
        known = (before >= 0) & (test == test[before])
        return np.where(known, measured[before], 0.0)
