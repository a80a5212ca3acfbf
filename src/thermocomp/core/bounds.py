"""What numbers and names a model may hold at all: stated once, and so wide that no machine comes near.

A model is read from files that somebody may have altered. Within these bounds nothing that it computes overflows: a
reading is clipped to the trained range, widened at most `MARGIN` times (2e15); a variable is a sum of at most `INPUTS`
of them, each by at most `COEFFICIENT` (2e33); a term is a product of at most `DEGREE` variables (3e266); by a
coefficient, and summed over as many as `ENTRIES`, that is 3e286, and a float ends at 1.8e308. What an autoregressive
model makes of its own past grows by less: its free run has to decay, over at most `ORDER` ticks.
"""

import unicodedata
from collections.abc import Sequence
from typing import Any

import numpy as np

from thermocomp.core.exceptions import SettingError

#: coefficients, weights, gains, thresholds, values of curves, intercepts: a micrometre per 1e-15 of an input [-]
COEFFICIENT = 1e15
#: references and ends of trained ranges in house units: 1,000 km, 1e9 1/min, a time stamp
RANGE = 1e9
#: readings beyond count as this: far outside every trained range
READING = 1e12
#: positions [mm]: 10 km
POSITION = 1e7
#: what a state remembers: products of readings
MEMORY = 1e30
#: trained ranges are widened by no more than so many of their widths, nor faded over more
MARGIN = 1e6
#: scales, tolerances, time constants [s] and shares that something is divided by
LEAST = 1e-6
#: time constants, and time between two readings [s]: 300 years
GAP = 1e10
#: interval of a model that ticks [s]: a millisecond
TICK = 1e-3
#: inputs of a model
INPUTS = 1000
#: variables, hidden nodes
NODES = 10_000
#: terms, lags, weights of a net
ENTRIES = 100_000
#: factors of a term
DEGREE = 8
#: exponents of a profile, and the largest value of a term without its coefficient, as a power of ten
EXPONENT, POWER_OF_TEN = 30, 200
#: past values that one tick of an autoregressive model is made of
ORDER = 100
#: characters of a name
NAME = 200


def check_finite(owner: str, most: float = COEFFICIENT, **numbers: Any) -> None:
    """Refuse numbers that are not finite, or beyond a bound.

    Parameters
    ----------
    owner : str
        Whose they are.
    most : float
        Largest magnitude.
    **numbers : float or nested sequence of float
        By what they are called.

    Raises
    ------
    SettingError
        Names all that hold such a number, and the first of each.
    """
    wrong = []
    for name, values in numbers.items():
        table = np.asarray(values, dtype=np.float64).ravel()
        off = table[~(np.abs(table) <= most)]
        if off.size:
            wrong.append(f"{name} must be finite numbers within {most:g} of zero, found {off[0]:g}")
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_between(owner: str, least: float, most: float, **numbers: Any) -> None:
    """Refuse numbers that are not between two bounds.

    Parameters
    ----------
    owner : str
        Whose they are.
    least, most : float
    **numbers : float or nested sequence of float
        By what they are called.

    Raises
    ------
    SettingError
        Names all that hold such a number, and the first of each.
    """
    wrong = []
    for name, values in numbers.items():
        table = np.asarray(values, dtype=np.float64).ravel()
        off = table[~((table >= least) & (table <= most))]
        if off.size:
            wrong.append(f"{name} must be from {least:g} to {most:g}, found {off[0]:g}")
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_count(owner: str, most: int, **entries: Sequence[object]) -> None:
    """Refuse what is too much.

    Parameters
    ----------
    owner : str
        Whose they are.
    most : int
    **entries : sequence
        Of at most so many entries, by what they are called.

    Raises
    ------
    SettingError
        Names all that have more.
    """
    wrong = [f"{len(found):,} {name}, at most {most:,}" for name, found in entries.items() if len(found) > most]
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_name(what: str, name: str, most: int = NAME) -> None:
    """Refuse what is no name: empty, too long, or with characters that break a line or a terminal.

    Parameters
    ----------
    what : str
        What it is the name of.
    name : str
    most : int
        Characters it may have.

    Raises
    ------
    SettingError
        The message says what the name is of.
    """
    if not name.strip() or len(name) > most:
        raise SettingError(f"{what}: a name has 1 to {most} characters, found {len(name.strip())}")
    for c in name:
        kind = unicodedata.category(c)
        if kind[0] == "C" or kind in ("Zl", "Zp"):
            raise SettingError(f"{what}: {name[:40]!a} is no name: it holds the character {c!a}")
