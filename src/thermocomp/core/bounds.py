"""Bounds of numbers and names in a model: defined once, and so wide that no machine comes near.

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
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import SettingError

FloatArray = NDArray[np.float64]

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

#: single precision: its least and its largest number
_TINY, _LARGEST = float(np.finfo(np.float32).smallest_subnormal), float(np.finfo(np.float32).max)
#: magnitudes that a check lets nothing go below, and beyond; those that single precision does not hold exactly
_FLOORS = np.array([0.0, LEAST**2, LEAST, TICK])
_CEILINGS = np.array([1.0 - LEAST, READING, COEFFICIENT, MEMORY, _LARGEST])


def round_within(
    values: ArrayLike, least: float | FloatArray = -_LARGEST, most: float | FloatArray = _LARGEST
) -> FloatArray:
    """Return numbers as single precision holds them, as near as can be within bounds.

    Parameters
    ----------
    values : array-like of float
    least, most : float or ndarray
        Bounds, the same for all or one per number; a number of single precision lies within them.

    Returns
    -------
    ndarray of float
        nan stays nan.
    """
    with np.errstate(over="ignore", under="ignore"):
        near = np.clip(np.asarray(values, dtype=np.float64), least, most).astype(np.float32)
        above, below = (np.nextafter(near, np.float32(end)) for end in (np.inf, -np.inf))
        exact = near.astype(np.float64)  # else the bounds would be rounded before they are compared
        return np.where(exact < least, above, np.where(exact > most, below, near)).astype(np.float64)


def round_single(values: ArrayLike) -> FloatArray:
    """Return numbers as single precision holds them, on the same side of every bound of a model as they are.

    The one place where a number loses digits: what keeps to the bounds of this file does so afterwards. What is not
    zero does not become zero, and what is finite stays finite.

    Parameters
    ----------
    values : array-like of float
        nan and infinities stay as they are.

    Returns
    -------
    ndarray of float
        Array of the same shape. A row that increases strictly still does.
    """
    exact = np.asarray(values, dtype=np.float64)
    size = np.abs(exact)
    floors = np.maximum(_FLOORS[np.searchsorted(_FLOORS, size, side="right") - 1], _TINY * (size > 0))
    ceilings = _CEILINGS[np.minimum(np.searchsorted(_CEILINGS, size), len(_CEILINGS) - 1)]
    found = np.where(np.isfinite(exact), np.copysign(round_within(size, floors, ceilings), exact), exact)
    if found.ndim == 1 and np.isfinite(exact).all() and (np.diff(exact) > 0).all() and (np.diff(found) <= 0).any():
        return _spread(found, ceilings)
    return found


def _spread(rising: FloatArray, most: FloatArray) -> FloatArray:
    """Return numbers that rise, of which some have become the same, a step of single precision apart."""
    found = rising.astype(np.float32)
    for k in range(1, len(found)):
        found[k] = max(found[k], np.nextafter(found[k - 1], np.float32(np.inf)))
    found[-1] = round_within(found[-1], most=most[-1])
    for k in range(len(found) - 2, -1, -1):
        found[k] = min(found[k], np.nextafter(found[k + 1], np.float32(-np.inf)))
    return found.astype(np.float64)


def check_finite(owner: str, most: float = COEFFICIENT, **numbers: Any) -> None:
    """Refuse numbers that are not finite, or beyond a bound.

    Parameters
    ----------
    owner : str
        Owner of the values, for messages.
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
        Owner of the values, for messages.
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
        Owner of the values, for messages.
    most : int
    **entries : sequence
        Sequences of limited length, by name.

    Raises
    ------
    SettingError
        Names all that have more.
    """
    wrong = [f"{len(found):,} {name}, at most {most:,}" for name, found in entries.items() if len(found) > most]
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_name(what: str, name: str, most: int = NAME) -> None:
    """Refuse what is not a name: empty, too long, or with characters that break a line or a terminal.

    Parameters
    ----------
    what : str
        Kind of the named object.
    name : str
    most : int
        Characters it may have.

    Raises
    ------
    SettingError
        The value is invalid; the message contains the kind of name.
    """
    if not name.strip() or len(name) > most:
        raise SettingError(f"{what}: a name has 1 to {most} characters, found {len(name.strip())}")
    for c in name:
        kind = unicodedata.category(c)
        if kind[0] == "C" or kind in ("Zl", "Zp"):
            raise SettingError(f"{what}: {name[:40]!a} is not a name: it contains the character {c!a}")
