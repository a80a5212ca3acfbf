"""Units at the doors: inside the house everything is mm, um, urad, degC, s, 1/min."""

import math
import re
from dataclasses import dataclass
from difflib import get_close_matches

from thermocomp.core.exceptions import UnitError


@dataclass(frozen=True)
class Unit:
    """A unit a file may use, and how it becomes the house unit of its quantity.

    ``value_in_house_unit = scale * value + shift``

    Parameters
    ----------
    symbol : str
        As written in files, such as ``degF``.
    quantity : str
        A key of `HOUSE_UNITS`.
    house : str
        House unit of that quantity.
    scale : float
        [house unit per unit]
    shift : float
        [house unit]
    """

    symbol: str
    quantity: str
    house: str
    scale: float
    shift: float = 0.0


#: house unit of every quantity
HOUSE_UNITS: dict[str, str] = {
    "time": "s",
    "temperature": "degC",
    "displacement": "um",
    "angle": "urad",
    "spindle_speed": "1/min",
    "position": "mm",
    "feed": "mm/min",
    "acceleration": "mm/s2",
    "dimensionless": "1",
}

_UNITS = [
    Unit("s", "time", "s", 1.0),
    Unit("ms", "time", "s", 1e-3),
    Unit("min", "time", "s", 60.0),
    Unit("h", "time", "s", 3600.0),
    Unit("d", "time", "s", 86400.0),
    Unit("degC", "temperature", "degC", 1.0),
    Unit("K", "temperature", "degC", 1.0, -273.15),
    Unit("degF", "temperature", "degC", 5.0 / 9.0, -160.0 / 9.0),
    Unit("nm", "displacement", "um", 1e-3),
    Unit("um", "displacement", "um", 1.0),
    Unit("mm", "displacement", "um", 1e3),
    Unit("m", "displacement", "um", 1e6),
    Unit("in", "displacement", "um", 25.4e3),
    Unit("urad", "angle", "urad", 1.0),
    Unit("mrad", "angle", "urad", 1e3),
    Unit("arcsec", "angle", "urad", 4.84813681109536),
    Unit("1/min", "spindle_speed", "1/min", 1.0),
    Unit("1/s", "spindle_speed", "1/min", 60.0),
    Unit("um", "position", "mm", 1e-3),
    Unit("mm", "position", "mm", 1.0),
    Unit("m", "position", "mm", 1e3),
    Unit("in", "position", "mm", 25.4),
    Unit("mm/min", "feed", "mm/min", 1.0),
    Unit("m/min", "feed", "mm/min", 1e3),
    Unit("mm/s2", "acceleration", "mm/s2", 1.0),
    Unit("m/s2", "acceleration", "mm/s2", 1e3),
    Unit("1", "dimensionless", "1", 1.0),
]

#: spellings met in files
_ALIASES = {
    "sec": "s",
    "seconds": "s",
    "minutes": "min",
    "hours": "h",
    "hr": "h",
    "day": "d",
    "days": "d",
    "C": "degC",
    "°C": "degC",
    "celsius": "degC",
    "kelvin": "K",
    "F": "degF",
    "°F": "degF",
    "µm": "um",
    "μm": "um",
    "micron": "um",
    "inch": "in",
    "um/m": "urad",
    "µm/m": "urad",
    "mm/s²": "mm/s2",
    "m/s²": "m/s2",
    "mm/s^2": "mm/s2",
    "m/s^2": "m/s2",
    "µrad": "urad",
    "μrad": "urad",
    "rpm": "1/min",
    "r/min": "1/min",
    "min-1": "1/min",
    "Hz": "1/s",
    "": "1",
}

#: a number and its unit, such as 12.5 mm, 1e-3urad or 6000 1/min
_MEASURED = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,].*?|(?<=\s)1/.*?)\s*")

_BY_KEY = {(u.symbol, u.quantity): u for u in _UNITS}


def find_unit(symbol: str, quantity: str | None = None) -> Unit:
    """Look a unit up.

    Parameters
    ----------
    symbol : str
        The unit as written in a file, such as ``degC``, ``C``, ``rpm``, ``mm``.
    quantity : str, optional
        The quantity it must measure; without it the first quantity the unit fits is taken, so a bare ``mm`` is a
        displacement.

    Returns
    -------
    Unit

    Raises
    ------
    UnitError
        The unit is unknown, or does not measure the quantity.
    """
    if quantity is not None and quantity not in HOUSE_UNITS:
        raise UnitError(f"unknown quantity {quantity!r}; known are {', '.join(HOUSE_UNITS)}")
    name = _ALIASES.get(symbol, symbol)
    if quantity is not None:
        found = _BY_KEY.get((name, quantity))
        if found is not None:
            return found
    fitting = [u for u in _UNITS if u.symbol == name]
    if quantity is None and fitting:
        return fitting[0]
    if fitting:
        measures = " or ".join(dict.fromkeys(u.quantity for u in fitting))
        usable = ", ".join(u.symbol for u in _UNITS if u.quantity == quantity)
        raise UnitError(f"unit {symbol!r} measures {measures}, not {quantity}; for {quantity} use one of {usable}")
    known = list(dict.fromkeys([u.symbol for u in _UNITS] + [a for a in _ALIASES if a]))
    near = get_close_matches(symbol, known, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(near)}?" if near else "."
    raise UnitError(f"unknown unit {symbol!r}{hint} Known units: {', '.join(dict.fromkeys(u.symbol for u in _UNITS))}")


def read_with_unit(text: object, quantity: str) -> float | None:
    """Read a value that is written with its unit.

    Parameters
    ----------
    text : object
        Such as ``"250 mm"``.
    quantity : str
        What it must measure, a key of `HOUSE_UNITS`.

    Returns
    -------
    float or None
        In the house unit; None: it is no text of a number and a unit.

    Raises
    ------
    UnitError
        The unit is unknown, or does not measure the quantity; or the number is not finite.
    """
    found = _MEASURED.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        return None
    known = find_unit(found[2], quantity)
    value = known.scale * float(found[1]) + known.shift
    if not math.isfinite(value):
        raise UnitError("is no finite number")
    return value
