"""Bounds of numbers and names in a model: defined in one place, and far wider than any machine needs.

A model is read from files that may have been altered. Within these bounds no computation of the model overflows: a
reading is clipped to the trained range, widened at most `MARGIN` times (2e15); a variable is a sum of at most `INPUTS`
readings, each multiplied by at most `COEFFICIENT` (2e33); a term is a product of at most `DEGREE` variables (3e266);
multiplied by a coefficient and summed over at most `ENTRIES` terms, the result is 3e286; the largest float is 1.8e308.
The past deviations of an autoregressive model grow by less: its free run must be stable, over at most `ORDER` ticks.
"""

import unicodedata
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import SettingError

FloatArray = NDArray[np.float64]

#: largest coefficient, weight, gain, threshold, curve value or intercept, such as 1 um per 1e-15 of an input [-]
COEFFICIENT = 1e15
#: largest reference or end of a trained range in house units: 1,000 km, 1e9 1/min, a time stamp
RANGE = 1e9
#: larger readings are clipped to this value, far outside every trained range
READING = 1e12
#: largest position [mm]: 10 km
POSITION = 1e7
#: largest value in the memory of a state: products of readings
MEMORY = 1e30
#: largest factor by which trained ranges may be widened or over which a deviation may fade, in range widths
MARGIN = 1e6
#: smallest scale, tolerance, time constant [s] or fraction used as a divisor
LEAST = 1e-6
#: longest time constant or time between two readings [s]: 300 years
GAP = 1e10
#: smallest interval of a model with ticks [s]
TICK = 1e-3
#: maximum number of inputs of a model
INPUTS = 1000
#: maximum number of variables or hidden nodes
NODES = 10_000
#: maximum number of terms, lags, or weights of a net
ENTRIES = 100_000
#: maximum number of factors of a term
DEGREE = 8
#: maximum exponent of a profile, and maximum power of ten of a term without its coefficient
EXPONENT, POWER_OF_TEN = 30, 200
#: maximum number of past values used in one tick of an autoregressive model
ORDER = 100
#: maximum number of characters of a name
NAME = 200

#: smallest and largest numbers in single precision
_TINY, _LARGEST = float(np.finfo(np.float32).smallest_subnormal), float(np.finfo(np.float32).max)
#: lower bounds of magnitudes in checks; single precision does not represent them exactly
_FLOORS = np.array([0.0, LEAST**2, LEAST, TICK])
_CEILINGS = np.array([1.0 - LEAST, READING, COEFFICIENT, MEMORY, _LARGEST])


def round_within(
    values: ArrayLike, least: float | FloatArray = -_LARGEST, most: float | FloatArray = _LARGEST
) -> FloatArray:
    """Return the single-precision numbers nearest to the given ones that lie within the bounds."""
    with np.errstate(over="ignore", under="ignore"):
        near = np.clip(np.asarray(values, dtype=np.float64), least, most).astype(np.float32)
        above, below = (np.nextafter(near, np.float32(end)) for end in (np.inf, -np.inf))
        exact = near.astype(np.float64)  # otherwise the bounds would be rounded before the comparison
        return np.where(exact < least, above, np.where(exact > most, below, near)).astype(np.float64)


def round_single(values: ArrayLike) -> FloatArray:
    """Return single-precision numbers, on the same side of every bound of a model as the originals.

    Numbers are rounded only here: values that satisfy the bounds of this module still do so afterwards. Non-zero values
    do not become zero, and finite values stay finite.

    Returns
    -------
    ndarray of float
        Array of the same shape. A strictly increasing row stays strictly increasing.
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
    """Return increasing numbers with equal neighbours separated by one step of single precision."""
    found = rising.astype(np.float32)
    for k in range(1, len(found)):
        found[k] = max(found[k], np.nextafter(found[k - 1], np.float32(np.inf)))
    found[-1] = round_within(found[-1], most=most[-1])
    for k in range(len(found) - 2, -1, -1):
        found[k] = min(found[k], np.nextafter(found[k + 1], np.float32(-np.inf)))
    return found.astype(np.float64)


def bound_readings(inputs: FloatArray) -> FloatArray:
    """Return readings clipped such that differences between them stay finite."""
    return np.minimum(np.maximum(inputs, -READING), READING)


def check_finite(owner: str, most: float = COEFFICIENT, **numbers: Any) -> None:
    """Reject numbers that are not finite or exceed a bound."""
    wrong = []
    for name, values in numbers.items():
        table = np.asarray(values, dtype=np.float64).ravel()
        off = table[~(np.abs(table) <= most)]
        if off.size:
            wrong.append(f"{name} must be finite numbers within {most:g} of zero, found {off[0]:g}")
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_between(owner: str, least: float, most: float, **numbers: Any) -> None:
    """Reject numbers outside a lower and an upper bound."""
    wrong = []
    for name, values in numbers.items():
        table = np.asarray(values, dtype=np.float64).ravel()
        off = table[~((table >= least) & (table <= most))]
        if off.size:
            wrong.append(f"{name} must be from {least:g} to {most:g}, found {off[0]:g}")
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_count(owner: str, most: int, **entries: Sequence[object]) -> None:
    """Reject sequences that are too long."""
    wrong = [
        f"{len(found):,} {name}, at most {most:,} are supported" for name, found in entries.items() if len(found) > most
    ]
    if wrong:
        raise SettingError(f"{owner}: {'; '.join(wrong)}")


def check_name(what: str, name: str, most: int = NAME) -> None:
    """Reject an invalid name: empty, too long, or with characters that break a line or a terminal."""
    if not name.strip() or len(name) > most:
        raise SettingError(f"{what}: expected a name of 1 to {most} characters, found {len(name.strip())}")
    for c in name:
        kind = unicodedata.category(c)
        if kind[0] == "C" or kind in ("Zl", "Zp"):
            raise SettingError(f"{what}: {name[:40]!a} is not a valid name: it contains the character {c!a}")
