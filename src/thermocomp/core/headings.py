"""What a heading says: ``t1_C``, ``drift_mm``, ``T1 [degC]`` carry the unit of their column."""

import re
from dataclasses import dataclass, replace
from difflib import get_close_matches

from thermocomp.core.exceptions import UnitError
from thermocomp.core.units import SPELLINGS, Unit, find_unit

# What may stand behind the last underscore. Not m, in, Hz, 1: coolant_in, mains_Hz, t_1 mean other things.
SUFFIXES = {
    **{s: s for s in ("C", "degC", "°C", "K", "F", "degF", "°F", "nm", "um", "µm", "μm", "mm", "urad", "µrad", "mrad")},
    **{s: s for s in ("arcsec", "rpm", "s", "ms", "min", "h")},
    "RPM": "rpm",
    "mm_min": "mm/min",
    "m_min": "m/min",
}
#: what may stand behind a name without brackets, as in "T1 °C", "T1 in °C", "T1 / °C" and "T1, °C": no letter alone
_BEHIND = re.compile(
    r"(?P<base>.*?[^\s/,;:])(?:\s*[/,;:]\s*|\s+in\s+|\s+)(?P<unit>(?:°|º|˚|deg ?|Grad )[CF]|℃"
    r"|(?:\d[\d.,/]* ?)?(?:[µμu]m|mm)|[µμ]rad|rpm|(?:U|1|r|tr|rev)/min|min(?:-1|\^-1|⁻¹))"
    r"|(?P<base2>.*\S)\s+(?:/|in)\s+(?P<unit2>K|s|ms|min|h)"
)
# In brackets anything but what would turn any frequency into a spindle speed, or a number into a channel.
_NOT_IN_BRACKETS = ("", "1")
_FREQUENCIES = ("Hz", "1/s")
HOUSE_SUFFIX = {"degC": "C", "um": "um", "urad": "urad", "1/min": "rpm", "mm": "mm", "mm/min": "mm_min", "s": "s"}
BRACKETS = re.compile(r"(?P<base>.*\S)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
_AXIS = re.compile(r"[xyzuvw]\d?")


@dataclass(frozen=True)
class Meaning:
    """What a heading with a unit says.

    Parameters
    ----------
    name : str
        Channel name: the heading with the suffix of the house unit.
    base : str
        The heading without its unit.
    unit : Unit
    """

    name: str
    base: str
    unit: Unit


def understand(heading: str) -> Meaning | None:
    """Find the unit in a heading: ``t1_C``, ``drift_mm``, ``T1 [degC]``, ``Temp 1 (°C)``.

    Returns
    -------
    Meaning or None
        None if there is no unit in it. A length is a position where the heading says so (``x_mm``, ``pos_x_mm``).

    Raises
    ------
    UnitError
        The brackets hold what looks like a mistyped unit.
    """
    heading = heading.strip()
    found = BRACKETS.fullmatch(heading)
    if found:
        base, symbol = found["base"], (found["square"] or found["round"] or "").strip()
        turning = any(word in base.casefold() for word in ("spindle", "speed", "spindel", "drehzahl", "broche"))
        if symbol in _NOT_IN_BRACKETS or (symbol in _FREQUENCIES and not turning):
            return None
        symbol = SUFFIXES.get(symbol, symbol)
        try:
            meant = find_unit(symbol)
        except UnitError:
            # [kW], [%] or (front) are columns of no use here; [degX] is a slip that would lose a sensor silently
            words = get_close_matches(symbol.casefold(), SPELLINGS, n=1, cutoff=0.85)
            if words or get_close_matches(symbol, SUFFIXES, n=1, cutoff=0.6):
                raise
            return None
        said = _suffix(base)
        if said and replace(find_unit(SUFFIXES[said]), symbol=meant.symbol) == meant:  # x_um [um]: twice
            inner = understand(base)
            if inner is not None and (inner.unit.scale, inner.unit.shift) == (1, 0):
                return Meaning(base, inner.base, inner.unit)
    else:
        suffix = _suffix(heading)
        behind = _BEHIND.fullmatch(heading)
        if suffix:
            base, meant = heading[: -len(suffix) - 1], find_unit(SUFFIXES[suffix])
        elif behind:
            base, meant = behind["base"] or behind["base2"], find_unit(behind["unit"] or behind["unit2"])
        else:
            return None
    if meant.quantity == "displacement" and _is_position(base, meant.symbol):
        meant = find_unit(meant.symbol, "position")
    # one word, so that the name can go into a formula or a controller
    return Meaning(f"{'_'.join(base.split())}_{HOUSE_SUFFIX[meant.house]}", base, meant)


def _suffix(heading: str) -> str:
    """Return the unit behind the last underscore of a heading, as it is written there."""
    ends = (s for s in SUFFIXES if heading.endswith(f"_{s}") and len(heading) > len(s) + 1)
    return max(ends, key=len, default="")


def _is_position(base: str, symbol: str) -> bool:
    words = re.split(r"[\s_.-]+", base.casefold())
    if any(w in ("pos", "position") for w in words):
        return True
    return symbol == "mm" and all(_AXIS.fullmatch(w) for w in words)
