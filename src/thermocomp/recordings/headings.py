"""Interpretation of headings: ``t1_C``, ``drift_mm``, ``T1 [degC]`` contain the unit of their column."""

import re
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

from thermocomp.core.exceptions import UnitError
from thermocomp.core.units import SPELLINGS, Unit, find_unit, is_unit
from thermocomp.recordings.words import read_words

# Units allowed after the last underscore. Not m, in, Hz, 1: coolant_in, mains_Hz, t_1 have other meanings.
SUFFIXES = {
    **{s: s for s in ("C", "degC", "°C", "K", "F", "degF", "°F", "nm", "um", "µm", "μm", "mm", "urad", "µrad", "mrad")},
    **{s: s for s in ("arcsec", "rpm", "s", "ms", "min", "h")},
    "RPM": "rpm",
    "mm_min": "mm/min",
    "m_min": "m/min",
}
#: units allowed after a name without brackets, as in "T1 °C", "T1 in °C", "T1 / °C" and "T1, °C": no single letter
_BEHIND = re.compile(
    r"(?P<base>.*?[^\s/,;:])(?:\s*[/,;:]\s*|\s+in\s+|\s+)(?P<unit>(?:°|º|˚|[dD]eg\.? ?|DEG ?|Grad "
    r")[CF]|℃|(?:[cC]elsius|CELSIUS)"
    r"|(?:\d[\d.,/]* ?)?(?:[µμu]m|mm|UM|MM)|[µμ]rad|rpm|RPM|(?:U|1|r|tr|rev)/(?:min|MIN)|(?:min|MIN)(?:-1|\^-1|⁻¹))"
    r"|(?P<base2>.*\S)\s+(?:/|in)\s+(?P<unit2>K|s|ms|min|h)"
)
#: units of quantities that are not used; they are not typing errors
_OTHERS = frozenset(read_words("foreign_units"))
# In brackets all units except those that would make a frequency a spindle speed, or a plain number a channel.
_NOT_IN_BRACKETS = ("", "1")
_FREQUENCIES = ("Hz", "1/s")
HOUSE_SUFFIX = {"degC": "C", "um": "um", "urad": "urad", "1/min": "rpm", "mm": "mm", "mm/min": "mm_min", "s": "s"}
BRACKETS = re.compile(r"(?P<base>.*\S)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
#: a unit before the name, as in "[°C] T1"; or a remark after it, as in "T1 [°C] (front)"
_EARLIER = re.compile(r"(?P<before>.*?)\[(?P<unit>[^\[\]]*)\]\s*(?P<after>.+)")
_AXIS = re.compile(r"[xyzuvw]\d?")
_TURNING = ("spindle", "speed", "spindel", "drehzahl", "broche", "mandrin", "husillo", "mandrino")
#: names that define the quantity, whatever the unit
_NAMES = {
    "temperature": re.compile(r"t\d+|tc ?\d+|.*\btemp(?:\b|[ _.\d]|er).*|.*temperatur.*"),
    "spindle_speed": re.compile(rf".*(?:{'|'.join(_TURNING)}).*"),
    "displacement": re.compile(
        r".*(?:drift|displacement|verlagerung|verschiebung|abweichung|deviation|déplacement).*|weg ?\w?"
    ),
}
#: quantities that are not absolute temperatures although their unit suggests it
_ELECTRIC = re.compile(r"(?i)capaci|kapaz|charge|ladung")  # F and C are farads and coulombs there
_DIFFERENCE = re.compile(
    r"Δ.*|.*\b(?:delta|diff\w*|rise|dT\d*|d[Tt]emp\w*)\b.*|.*(?:erwärmung|übertemp|temperaturdiff|-änderung).*", re.I
)
#: headings of a time column, without their unit, in several languages
_TIMES = frozenset(read_words("times"))
#: words of a length that is not a position, although its name contains one
_ERRORS = frozenset(read_words("errors"))
#: letters of a date or time in a heading, such as hh:mm:ss and TT.MM.JJJJ
_FORMAT = re.compile(r"(?i)[dtgmyjahsf]{1,4}(?:[^a-zäöü]+[dtgmyjahsfp]{1,4})+")
#: a date in the format of a timestamp, with the T before the hours
_DAY_PART = "(?:d+|m+|y+|j+|a+|t+|g+)"
_DATE = re.compile(rf"(?<![a-z:]){_DAY_PART}(?:[-./ ]+{_DAY_PART})+(?:t(?=h)|(?![a-z:]))")
#: parts of the format of a clock: days, hours, minutes, seconds, and a fraction of a second
_CLOCK_PARTS = {
    **{"d": "d{1,3}|days?", "h": "h+(?:12|24)?|k+|hrs?|std", "m": "m+|n+|min?", "s": "ss?|se[ck]"},
    "f": "f+|0+|s{3,}|ms",
}
#: formats of times of day, as `find_clock_form` returns them
DAY_FORMS = ("hm", "hms", "hmsf")


@dataclass(frozen=True)
class Meaning:
    """Meaning of a heading with a unit.

    Parameters
    ----------
    name : str
        Channel name: the heading with the suffix of the house unit.
    base : str
        Heading without its unit.
    """

    name: str
    base: str
    unit: Unit


def understand(heading: str) -> Meaning | None:
    """Find the unit in a heading: ``t1_C``, ``drift_mm``, ``T1 [degC]``, ``Temp 1 (°C)``.

    Returns
    -------
    Meaning or None
        None if there is no unit. A length is a position if the heading names it as such (``x_mm``, ``pos_x_mm``), or a
        residual or correction of a machine under compensation (``z_residual_um``, ``z_correction_um``).
    """
    heading = strip_heading(heading)
    said = _in_brackets(heading) if "[" in heading or "(" in heading else _behind(heading)
    if said is None:
        return None
    base, meant = said
    inner = _behind(base) if heading.endswith((")", "]")) else None
    if inner is not None and inner[1] == meant:  # x_um [um]: duplicate unit
        twice = understand(base)
        if twice is not None and (twice.unit.scale, twice.unit.shift) == (1, 0):
            return Meaning(base, twice.base, twice.unit)
    other = (meant.symbol == "K" and _DIFFERENCE.fullmatch(base)) or _ELECTRIC.search(base)
    if other or (meant.quantity == "time" and find_named_quantity(base)):
        return None  # T1_min is the minimum of T1
    if meant.quantity == "displacement":
        meant = find_unit(meant.symbol, _kind_of_length(base, meant.symbol))
    # one word, so that the name can be used in a formula or a controller
    return Meaning(f"{'_'.join(base.split())}_{HOUSE_SUFFIX[meant.house]}", base, meant)


def _kind_of_length(base: str, symbol: str) -> str:
    """Return the quantity of a column with a unit of length: a displacement, a position and so on, by its name."""
    words = re.split(r"[\s_.-]+", base.casefold())
    measured = any(w in _ERRORS for w in words)  # the error of a position is a displacement
    named = any(w in ("pos", "position") for w in words) and not measured
    if named or (symbol == "mm" and all(_AXIS.fullmatch(w) for w in words)):
        return "position"
    return next((w for w in words if w in ("residual", "correction")), "displacement")


def _in_brackets(heading: str) -> tuple[str, Unit] | None:
    """Return name and unit of a heading with brackets: ``T1 [degC]``, ``[degC] T1``, ``T1 [degC] (front)``."""
    found, earlier = BRACKETS.fullmatch(heading), _EARLIER.fullmatch(heading)
    symbol = (found["square"] or found["round"] or "").strip() if found else ""
    before = earlier["unit"].strip() if earlier else ""
    if earlier and before not in _NOT_IN_BRACKETS and is_unit(before) and not (symbol and is_unit(symbol)):
        return f"{earlier['before']} {earlier['after']}".strip(), find_unit(before)
    if found is None:
        return _behind(heading)
    base = found["base"]
    turning = any(word in base.casefold() for word in _TURNING)
    if symbol in _NOT_IN_BRACKETS or (symbol in _FREQUENCIES and not turning):
        return None
    symbol = SUFFIXES.get(symbol, symbol)
    if symbol == "m" and is_time_name(base):
        raise UnitError("'m' denotes metres; write min for minutes")
    if is_unit(symbol):
        with suppress(UnitError):  # a fraction of degC
            return base, find_unit(symbol)
    return (base, find_unit(symbol)) if _is_mistyped(symbol) else None  # the error suggests the intended unit


@lru_cache(maxsize=1024)
def _is_mistyped(symbol: str) -> bool:
    """Return whether a unit is a typing error, such as [degX]; [kW], [%] or (front) mark columns that are not used."""
    return not (is_foreign_unit(symbol) or _is_format(symbol)) and bool(
        get_close_matches(symbol.casefold(), SPELLINGS, n=1, cutoff=0.85)
        or get_close_matches(symbol, SUFFIXES, n=1, cutoff=0.6)
    )


def _behind(heading: str) -> tuple[str, Unit] | None:
    """Return name and unit of a heading without brackets: ``t1_C``, ``T1 degC``, ``RPM``."""
    ends = [s for s in SUFFIXES if heading.endswith(f"_{s}") and len(heading) > len(s) + 1]
    if ends:
        suffix = max(ends, key=len)
        return heading[: -len(suffix) - 1], find_unit(SUFFIXES[suffix])
    behind = _BEHIND.fullmatch(heading)
    if behind:
        return behind["base"] or behind["base2"], find_unit(behind["unit"] or behind["unit2"])
    if is_unit(heading) and find_unit(heading).symbol == "1/min":  # a column named RPM
        return "spindle", find_unit(heading)
    return None


def strip_heading(heading: str) -> str:
    """Return a heading without leading and trailing blanks and colons."""
    return heading.strip().rstrip(":").strip()


def is_foreign_unit(symbol: str) -> bool:
    """Return whether a text is a unit of a quantity that is not used, such as ``%`` or ``kW``."""
    return symbol.casefold() in _OTHERS


def is_time_name(heading: str) -> bool:
    """Return whether a heading, without its unit, denotes a time."""
    return plain_name(heading) in _TIMES


def plain_name(heading: str) -> str:
    """Return a heading in lower case without date formats: ``Datum (TT.MM.JJJJ)`` becomes ``datum``."""
    return " ".join(strip_format(strip_format(heading)).casefold().split())


def strip_format(heading: str) -> str:
    """Return a heading without the date format in brackets at its end."""
    name = strip_heading(heading)
    found = BRACKETS.fullmatch(name)
    is_format = found and _is_format((found["square"] or found["round"] or "").strip())
    return found["base"] if found and is_format else name


def _is_format(text: str) -> bool:
    return _FORMAT.fullmatch(text) is not None or (":" in text and bool(find_clock_form(text)))


def find_date_orders(heading: str) -> tuple[str, ...]:
    """Return the orders of day, month and year in a heading, such as ``dmy``; two where a row of units disagrees."""
    inner = strip_format(heading)
    found = (find_date_order(heading), find_date_order(inner) if inner != strip_heading(heading) else "")
    return tuple(dict.fromkeys(order for order in found if order))


def find_clock_form(heading: str) -> str:
    """Return the format of a clock in a heading by one letter for each part; empty if it specifies none.

    ``d``, ``h``, ``m``, ``s`` are days to seconds, ``f`` is a fraction of a second: ``Time [mm:ss.fff]`` gives
    ``msf``, ``yyyy-mm-dd hh:mm`` gives ``hm``. A part of another kind is a question mark; so is the whole if the
    heading and the row of units specify different formats.
    """
    plain = re.sub(r"[\[(]?([hms]+)\](?=:)", r"\1", re.sub("['%]", "", heading.casefold()))  # [h]:mm as in Excel
    texts = [*re.findall(r"[\[(]([^\[\]()]*)[\])]", plain), re.sub(r"[\[(][^\[\]()]*[\])]", " ", plain)]
    forms = {_find_parts(text) for text in texts} - {""}
    return next(iter(forms)) if len(forms) == 1 else "?" * bool(forms)


def _find_parts(text: str) -> str:
    """Return the parts of the format of a clock, in the letters of `find_clock_form`."""
    words = [re.sub(r"[+±-].*|z+$", "", word) for word in re.split(r"[\s;_]+", _DATE.sub(" ", text))]
    found = [_read_parts(word) for word in words if word]
    if any("?" in parts for parts in found):  # then words of other kinds are around it, such as am/pm
        found = [_read_parts(word) for word in words if ":" in word]
    found = [parts for parts in found if len(parts.replace("?", "")) > 1 or parts in "dhmsf"]
    return "" if len(parts := "".join(found)) < 2 or not parts.strip("f") else parts


def _read_parts(word: str) -> str:
    parts = ""
    for part in filter(None, re.split("[:.,]", word)):
        kind = next((kind for kind, forms in _CLOCK_PARTS.items() if re.fullmatch(forms, part)), "?")
        parts += "f" if parts.endswith("s") and re.fullmatch(r"(.)\1*", part) else kind  # .mmm, .xxx
    return parts


def find_date_order(heading: str) -> str:
    """Return the order of day, month and year in a heading, such as ``dmy``; empty if it specifies none."""
    found = BRACKETS.fullmatch(strip_heading(heading))
    form = ((found["square"] or found["round"]) if found else heading).casefold()
    letters = re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])t(?=hh?\b)", " ", form))  # yyyy-mm-ddThh:mm
    if not all(re.fullmatch(r"([dtgmyjahsf])\1*|[ap]m?", word) for word in letters):
        return ""
    german = any(word[0] == "t" for word in letters)
    kinds = {"d": "d", "t": "d", "g": "d", "m": "m", "y": "y", "a": "y", "j": "y" if german else "d"}
    order = "".join(kinds.get(word[0], "") for word in letters[:3])
    return order if sorted(order) == ["d", "m", "y"] else ""


def find_named_quantity(base: str) -> str:
    """Return the quantity implied by a name without unit, such as temperature for ``T1``; empty if none."""
    name = " ".join(base.casefold().replace("_", " ").split())
    return next((quantity for quantity, words in _NAMES.items() if words.fullmatch(name)), "")


def is_understood(heading: str) -> bool:
    """Return whether `understand` finds a unit in a heading."""
    try:
        return understand(heading) is not None
    except UnitError:
        return False
