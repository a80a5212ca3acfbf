"""Units at the interfaces: internally all values are in house units: mm, um, urad, degC, s, 1/min."""

import math
import re
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache

from thermocomp.core.exceptions import UnitError


@dataclass(frozen=True)
class Unit:
    """A unit allowed in files, and its conversion to the house unit of its quantity.

    ``value_in_house_unit = scale * value + shift``

    Parameters
    ----------
    symbol : str
        Symbol as written in files, such as ``degF``.
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
    # of a machine under compensation: residual displacement, and correction added by the controller
    "residual": "um",
    "correction": "um",
}

_UNITS = [
    Unit("s", "time", "s", 1.0),
    Unit("ms", "time", "s", 1e-3),
    Unit("min", "time", "s", 60.0),
    Unit("h", "time", "s", 3600.0),
    Unit("d", "time", "s", 86400.0),
    Unit("degC", "temperature", "degC", 1.0),
    Unit(symbol="K", quantity="temperature", house="degC", scale=1.0, shift=-273.15),
    Unit(symbol="degF", quantity="temperature", house="degC", scale=5.0 / 9.0, shift=-160.0 / 9.0),
    Unit("nm", "displacement", "um", 1e-3),
    Unit("um", "displacement", "um", 1.0),
    Unit("mm", "displacement", "um", 1e3),
    Unit("m", "displacement", "um", 1e6),
    Unit("in", "displacement", "um", 25.4e3),
    Unit("mil", "displacement", "um", 25.4),
    Unit("uin", "displacement", "um", 25.4e-3),
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
#: quantities measured in the same way as displacements; not suggested in messages
_COMPENSATED = ("residual", "correction")
_UNITS += [replace(u, quantity=q) for q in _COMPENSATED for u in _UNITS if u.quantity == "displacement"]

#: alternative spellings found in files
_ALIASES = {
    "C": "degC",
    "°C": "degC",
    "°c": "degC",
    "C°": "degC",
    "F": "degF",
    "°F": "degF",
    "um/m": "urad",
    "u": "um",
    "MM": "mm",
    "UM": "um",
    "MIN": "min",
    "SEC": "s",
    "HRS": "h",
    "Hz": "1/s",
    "": "1",
}
#: words found in files, in several languages, in lower case
_WORDS = {
    word: unit
    for unit, words in {
        "s": "sec secs second seconds sek sekunde sekunden seg seconde secondes secondi",
        "min": "mins minute minutes minuten minuti minutos",
        "h": "hr hrs hour hours std stunde stunden heure heures ore horas",
        "d": "day days tag tage jour jours",
        "ms": "msec millisecond milliseconds millisekunden",
        "degC": "celsius grad_c grad_celsius grd_c deg_c degc deg._c degree_c degrees_c degree_celsius "
        "degrees_celsius oc "
        "°celsius cel gradi_c degrés_c grados_c",
        "K": "kelvin",
        "degF": "fahrenheit deg_f degf degrees_f degree_f",
        "nm": "nanometer nanometers",
        "um": "micron microns micrometer micrometers micrometre micrometres mikrometer mikron mkm my mue_m",
        "mm": "millimeter millimeters millimetre millimetres",
        "in": "inch inches zoll",
        "mil": "mils thou",
        "uin": "uinch microinch microinches uinches u_in",
        "1/min": "1/min rpm r/min rev/min revs/min u/min u_/_min upm umdr/min /min min-1 min^-1 1/minute tr/min "
        "giri/min "
        "rot/min obr/min ot/min o/min r.p.m umdr./min umdrehungen/min revolutions/min min**-1 min_-1",
        "1/s": "rps rev/s u/s s-1 s^-1",
        "mm/s2": "mm/s^2",
        "m/s2": "m/s^2",
    }.items()
    for word in words.split()
}
#: all accepted spellings of words
SPELLINGS = tuple(_WORDS)
#: equivalent characters, including typical results of a wrong encoding
_SIGNS = str.maketrans(
    {"µ": "u", "μ": "u", "º": "°", "˚": "°", "²": "2", "−": "-", "⁻": "-", "¹": "1", "³": "3", "·": "*", "×": "*"}
)
#: a multiple of a unit, such as 0.001 mm, 1/1000 mm, 10 um
_COUNT = re.compile(r"(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)(?:/(\d+))? ?\*? ?([^\d\s/*].*)")
#: powers of ten in all supported spellings: 10^-3 mm, 10-3 mm, 10**3 rpm, E-3 mm, x1000 rpm
_POWER = re.compile(r"(?<![\d.])(?:10(?:\^|\*\*)?|[eE])([-+]\d)(?=[ *])|(?<![\d.])(?:10(?:\^|\*\*))(\d)(?=[ *])")

#: a number and its unit, such as 12.5 mm, 1e-3urad or 6000 1/min
_MEASURED = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,].*?|(?<=\s)1/.*?)\s*")

_SYMBOLS = frozenset(u.symbol for u in _UNITS)
_BY_KEY = {(u.symbol, u.quantity): u for u in _UNITS}


def find_unit(symbol: str, quantity: str | None = None) -> Unit:
    """Return the unit with a given symbol.

    Parameters
    ----------
    symbol : str
        The unit as written in a file, such as ``degC``, ``C``, ``rpm``, ``mm``.
    quantity : str, optional
        Expected quantity. Default: the first quantity with this unit, so that ``mm`` alone is a displacement.

    Returns
    -------
    Unit

    Raises
    ------
    UnitError
        The unit is unknown, or belongs to another quantity.
    """
    if quantity is not None and quantity not in HOUSE_UNITS:
        raise UnitError(f"unknown quantity {quantity!r}; expected one of {', '.join(HOUSE_UNITS)}")
    name = _name(symbol)
    counted = _COUNT.fullmatch(name)
    if counted is not None:
        base = find_unit(counted[3], quantity)
        factor = float(counted[1].replace(",", ".")) / float(counted[2] or 1)
        if not base.shift and factor:
            return replace(base, symbol=symbol, scale=base.scale * factor)
    if quantity is not None:
        found = _BY_KEY.get((name, quantity))
        if found is not None:
            return found
    fitting = [u for u in _UNITS if u.symbol == name]
    if quantity is None and fitting:
        return fitting[0]
    if fitting:
        measures = " or ".join(dict.fromkeys(u.quantity for u in fitting if u.quantity not in _COMPENSATED))
        usable = ", ".join(u.symbol for u in _UNITS if u.quantity == quantity)
        raise UnitError(f"unit {symbol!r} measures {measures}, not {quantity}; for {quantity} use one of {usable}")
    known = list(dict.fromkeys([u.symbol for u in _UNITS] + [a for a in (*_ALIASES, *_WORDS) if a]))
    near = get_close_matches(symbol, known, n=9, cutoff=0.5)
    meant = list(dict.fromkeys(_ALIASES.get(n) or _WORDS.get(n, n) for n in near))[:3]
    hint = f"; did you mean {' or '.join(meant)}?" if meant else "."
    raise UnitError(f"unknown unit {symbol!r}{hint} Known units: {', '.join(dict.fromkeys(u.symbol for u in _UNITS))}")


@lru_cache(maxsize=4096)
def is_unit(symbol: str) -> bool:
    """Return whether a symbol is a known unit."""
    name = _name(symbol)
    counted = _COUNT.fullmatch(name)
    return name in _SYMBOLS or (counted is not None and _name(counted[3]) in _SYMBOLS)


def _name(symbol: str) -> str:
    """Return the standard symbol of a unit given in any spelling."""
    plain = " ".join(symbol.removeprefix("Â").replace("℃", "°C").replace("℉", "°F").translate(_SIGNS).split())
    plain = _POWER.sub(lambda found: f"1e{found[1] or found[2]}", plain.replace("° ", "°"))
    plain = re.sub(r"^[x*] ?(?=\d)", "", plain)  # x1000 rpm
    word = plain.casefold().removesuffix(".").replace(" ", "_")
    return _ALIASES.get(plain) or _WORDS.get(word, plain)


def read_with_unit(text: object, quantity: str) -> float | None:
    """Read a value written with its unit.

    Parameters
    ----------
    text : object
        Value with unit, such as ``"250 mm"``.
    quantity : str
        Required quantity, a key of `HOUSE_UNITS`.

    Returns
    -------
    float or None
        Value in the house unit; None if the text is not a number with a unit.

    Raises
    ------
    UnitError
        The unit is unknown, or belongs to another quantity; or the number is not finite.
    """
    found = _MEASURED.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        return None
    known = find_unit(found[2], quantity)
    value = known.scale * float(found[1]) + known.shift
    if not math.isfinite(value):
        raise UnitError("the value is not a finite number")
    return value
