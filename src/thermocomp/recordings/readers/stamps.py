"""Dates and times of day in forms used by people and programs: detection of those with a single interpretation."""

import re
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from thermocomp.core.messages import Message
from thermocomp.recordings.headings import find_date_orders
from thermocomp.recordings.readers.dateorder import DateChoice, IntArray, find_longest_step, find_order, rises
from thermocomp.recordings.words import read_word_groups

_CHUNK = 100_000
#: steps between rows caused only by a wrong order [d]: of day and month, of day and year
_MONTH, _YEAR = 26, 300
_DATE = (
    r"'?(?P<a>\d{1,4}|[^\W\d_]{3,9})(?P<sep>[./-]|\.? )(?P<b>\d{1,2}|[^\W\d_]{3,9})(?P<sep2>[./-]|[.,]? )(?P<c>\d{1,4})"
)
_CLOCK = r"(?P<hour>\d{1,2}):\d\d(?P<seconds>:\d\d(?:(?P<dot>[.,:])\d+)?)?(?: ?(?P<half>[AaPp]\.?[Mm]\.?))?"
_ZONE = r" ?(?P<zone>Z|[A-Z]{3,4}|[+-]\d\d:?\d\d)?"
_STAMP = re.compile(rf"{_DATE}(?:(?P<join>T|[ ,;_-]+){_CLOCK}{_ZONE})?|(?P<clock>{_CLOCK.replace('?P<', '?P<only_')})")
_ISO = re.compile(
    r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:?\d\d)?)?|\d{8}T\d{4,6}(?:\.\d+)?Z?"
)
#: month names and similar words in languages other than English, in lower case
_MONTHS = {name: str(k) for k, names in enumerate(read_word_groups("months"), start=1) for name in names}
#: names of time zones with a unique offset from UTC
_ZONES = {
    **dict.fromkeys(("UTC", "GMT", "WET", "UT"), "+00:00"),
    **dict.fromkeys(("CET", "MEZ", "WEST"), "+01:00"),
    **dict.fromkeys(("CEST", "MESZ", "EET"), "+02:00"),
    "EEST": "+03:00",
}
_WORDS = {"dmy": "day/month/year", "mdy": "month/day/year", "ymd": "year/month/day", "ydm": "year/day/month"}


class Parsed(NamedTuple):
    """Timestamps as read from their cells, and the start time."""

    stamps: "pd.Series[pd.Timestamp]"  #: in UTC; NaT where a cell is not a timestamp
    start: str  #: the first one in ISO 8601, in the local time of its clock
    notes: tuple[str, ...]


class AmbiguousDatesError(ValueError):
    """Error for dates that can be read in several ways.

    Parameters
    ----------
    readings : dict of str to Series of Timestamp
        Timestamps by format, in the letters of `datetime.strptime`, most likely first.
    orders : list of str
        Each order as text.
    why : str
        Reason why none of them is taken.
    """

    def __init__(
        self, readings: "dict[str, pd.Series[pd.Timestamp]]", orders: list[str], why: str = "no row shows which"
    ) -> None:
        super().__init__(f"{' or '.join(orders)}, and {why}")
        self.readings = readings
        self.orders = orders

    def tell(self) -> str:
        """Return the first and last time and the duration under each order, as text."""
        told = []
        for order, stamps in zip(self.orders, self.readings.values(), strict=True):
            begin, end = stamps.iloc[0].tz_localize(None), stamps.iloc[-1].tz_localize(None)
            told.append(f"{order}: from {begin} to {end}, {(end - begin).total_seconds() / 3600:.2f} h")
        return "; ".join(told)


def parse_stamps(text: "pd.Series[Any]", heading: str) -> Parsed | None:
    """Read timestamps in an unknown form.

    Returns
    -------
    Parsed or None
        None: the form of the first cell is unknown.
    """
    first = text.iloc[0].strip()
    shape = _STAMP.fullmatch(first)
    said = find_date_orders(heading)
    if _ISO.fullmatch(first) and (shape is None or "ydm" not in said):
        found = parse(text, "ISO8601")
        if shape is not None:
            _refuse_other_order(text, shape, "ymd", found, by_heading=False)
        return _parsed(found, first, "ISO8601", ())
    if shape is None or shape["clock"]:
        return None
    plain = _simplify(text, shape)
    orders = _orders(shape, said)
    stated = [order for order in said if order in orders] if len(orders) > 1 else orders
    notes: tuple[str, ...] = ()
    if len(stated) == 1:
        found = parse(plain, _format(shape, stated[0]))
        if len(orders) > 1:
            notes = (Message("the dates are {order}, as the heading specifies", order=Message(_WORDS[stated[0]])),)
            _refuse_impossible(plain, shape, orders, stated[0], found)
        _refuse_other_order(plain, shape, stated[0], found, by_heading=len(orders) > 1)
    orders = stated or orders  # two are stated if the row of units contradicts the heading
    as_usual = _has_points(shape) and "dmy" in orders and not stated
    read = {"dmy": parse(plain, _format(shape, "dmy"))} if as_usual else {}
    if not any(_is_one_stretch(stamps) for stamps in read.values()):
        read |= {order: parse(plain, _format(shape, order)) for order in orders if order not in read}
    whole = [order for order, stamps in read.items() if stamps.notna().all()]
    if len(whole) > 1:
        instants = {o: _instants(read[o]) for o in whole}
        choice = _choose(shape, instants) if as_usual else find_order(instants)
        if not choice.order:
            possible = [o for o in whole if rises(_instants(read[o]))] or whole
            # formats with AM and PM usually have the month first
            possible.sort(key=lambda o: not (shape["half"] and o == "mdy"))
            asked = {_shown_format(shape, o): read[o] for o in possible}
            why = "heading and row of units contradict each other" if stated else "no row shows which"
            raise AmbiguousDatesError(asked, [_WORDS[o] for o in possible], why)
        if choice.why:
            notes = (Message("the dates are {order}: {why}", order=Message(_WORDS[choice.order]), why=choice.why),)
        whole = [choice.order]
    elif whole and len(orders) > 1 and not (_has_points(shape) and whole == ["dmy"]):
        proof = Message("{date!r} is not a date otherwise", date=_find_proof(plain, read, whole[0]))
        notes = (Message("the dates are {order}: {why}", order=Message(_WORDS[whole[0]]), why=proof),)
    best = whole[0] if whole else max(orders, key=lambda o: int(read[o].notna().sum()))
    if shape["zone"] in _ZONES and _ZONES[shape["zone"]] != "+00:00":
        notes += (Message("{zone} is taken as UTC{offset}", zone=shape["zone"], offset=_ZONES[shape["zone"]]),)
    return _parsed(read[best], plain.iloc[0], _format(shape, best), notes)


def _refuse_impossible(
    plain: "pd.Series[Any]", shape: re.Match[str], orders: list[str], stated: str, found: "pd.Series[pd.Timestamp]"
) -> None:
    """Reject an order given by the heading if a row is no such date and all rows are dates in another order."""
    if found.notna().all():
        return
    read = {o: parse(plain, _format(shape, o)) for o in orders if o != stated}
    read = {o: stamps for o, stamps in read.items() if stamps.notna().all()}
    if read:
        wrong = plain.iloc[int(found.isna().to_numpy().argmax())]
        why = f"{wrong!r} is not {_WORDS[stated]}, which the heading specifies"
        raise AmbiguousDatesError({_shown_format(shape, o): s for o, s in read.items()}, [_WORDS[o] for o in read], why)


def _refuse_other_order(
    plain: "pd.Series[Any]", shape: re.Match[str], stated: str, found: "pd.Series[pd.Timestamp]", *, by_heading: bool
) -> None:
    """Reject an order given by the heading or the year if rows are consecutive only in another order.

    An order given by the heading is rejected, too, if time increases only in another order.
    """
    if not (shape["a"].isdigit() and shape["b"].isdigit()) or not found.notna().all():
        return
    falls = by_heading and not rises(_instants(found))
    if not falls and find_longest_step(_instants(found)) < _MONTH:
        return
    swapped = "".join({"d": "m", "m": "d"}.get(letter, letter) for letter in stated)
    other = parse(plain, _format(shape, swapped))
    read = {stated: found, swapped: other}
    if not other.notna().all():
        return
    choice = find_order({o: _instants(s) for o, s in read.items()})
    if choice.order == swapped and (by_heading or choice.by == "going on"):
        raise AmbiguousDatesError({_shown_format(shape, o): s for o, s in read.items()}, [_WORDS[o] for o in read])


def has_day(form: str) -> bool:
    """Return whether a format contains the day, and not only the time of day."""
    return re.search(r"%[djxcDFeG]", form) is not None


def parse(text: "pd.Series[Any]", form: str) -> "pd.Series[pd.Timestamp]":
    """Return timestamps read in a known form, in UTC; NaT where a cell does not match."""
    # in chunks, and without a cache of texts: pandas would store objects, which are far larger than the times
    parts = [text.iloc[k : k + _CHUNK] for k in range(0, len(text), _CHUNK)]
    found = [pd.to_datetime(p, format=form, utc=True, errors="coerce", cache=False) for p in parts]
    stamps = pd.concat(found)
    if stamps.isna().any():  # programs may omit a zero fraction
        other = form.replace("%S.%f", "%S") if "%S.%f" in form else form.replace("%S", "%S.%f")
        stamps = stamps.fillna(pd.to_datetime(text, format=other, utc=True, errors="coerce"))
    return stamps


def read_days(text: "pd.Series[Any]") -> list[IntArray]:
    """Return the possible days of timestamps, counted from 1970, under each order in which all are valid dates."""
    plain = text.str.strip()
    if _ISO.fullmatch(plain.iloc[0]):
        read = [parse(plain, "ISO8601")]
    elif (shape := _STAMP.fullmatch(plain.iloc[0])) is not None and not shape["clock"]:
        plain = _simplify(text, shape)
        read = [parse(plain, _format(shape, order)) for order in _orders(shape, ())]
    else:
        return []
    return [_instants(stamps) // 86_400_000_000_000 for stamps in read if stamps.notna().all()]


def _parsed(stamps: "pd.Series[pd.Timestamp]", first: str, form: str, notes: tuple[str, ...]) -> Parsed:
    forms = [form, form.replace(".%f", "")]
    starts = (pd.to_datetime(pd.Series([first]), format=f, errors="coerce").iloc[0] for f in forms)
    return Parsed(stamps, next((s.isoformat() for s in starts if not pd.isna(s)), ""), notes)


def _simplify(text: "pd.Series[Any]", shape: re.Match[str]) -> "pd.Series[Any]":
    """Convert parts that no format covers: month names, zone names, separators before a fraction."""
    plain = text.str.strip().str.lstrip("'")
    if not (shape["a"].isdigit() and shape["b"].isdigit()):
        plain = plain.str.replace(r"[^\W\d_]{3,}(?=[ ,./-])", _month, regex=True)
    if shape["dot"] in (",", ":"):
        plain = plain.str.replace(rf"(:\d\d:\d\d){shape['dot']}(\d+)", r"\1.\2", regex=True)
    if shape["half"]:
        plain = plain.str.replace(r" ?([AaPp])\.?[Mm]\.?(?=$| )", lambda m: f" {m[1].upper()}M", regex=True)
    if shape["zone"] and shape["zone"].isalpha():
        plain = plain.str.replace(
            r" ?([A-Z]{2,4})$", lambda m: _ZONES.get(m[1], "+00:00" if m[1] == "Z" else m[0]), regex=True
        )
        plain = plain.str.replace(r"Z$", "+00:00", regex=True)
    elif shape["zone"]:
        plain = plain.str.replace(r" ?([+-]\d\d:?\d\d)$", r"\1", regex=True)
    return plain


def _has_points(shape: re.Match[str]) -> bool:
    return shape["sep"].startswith(".") and shape["a"].isdigit() and shape["b"].isdigit() and len(shape["a"]) < 3


def _is_one_stretch(stamps: "pd.Series[pd.Timestamp]") -> bool:
    """Return whether all are valid dates and increase without a gap typical of a wrong order."""
    return bool(stamps.notna().all()) and rises(t := _instants(stamps)) and find_longest_step(t) < _MONTH


def _choose(shape: re.Match[str], read: dict[str, IntArray]) -> DateChoice:
    """Select the order of dates that are valid in several orders."""
    choice = find_order(read)
    if not _has_points(shape) or "dmy" not in read:
        return choice
    if choice.order == "dmy":
        return DateChoice("dmy", "", "")
    day_first = DateChoice("dmy", "", "dates with points usually have the day first")
    if choice.by == "going on":
        return choice
    year_first = read.get("ymd")
    if year_first is None or not rises(year_first):
        return day_first
    longest, other = find_longest_step(read["dmy"]), find_longest_step(year_first)
    if not rises(read["dmy"]):
        return choice if choice.order == "ymd" and other < _MONTH else day_first
    return DateChoice("", "", "") if longest >= _YEAR and longest > other else day_first


def _instants(stamps: "pd.Series[pd.Timestamp]") -> IntArray:
    return stamps.to_numpy(dtype="M8[ns]").view(np.int64)


def _month(found: re.Match[str]) -> str:
    return _MONTHS.get(found[0].casefold(), found[0])


def _orders(shape: re.Match[str], said: tuple[str, ...]) -> list[str]:
    """Return the orders that a first cell may have; year, day, month only if the heading says so."""
    a, b, c = shape["a"], shape["b"], shape["c"]
    rare = ["ydm"] if "ydm" in said and b.isdigit() else []
    if len(a) == 4 and a.isdigit():
        return ["ymd", *rare]
    if not a.isdigit():
        return ["mdy"]
    if not b.isdigit():
        return ["dmy"]
    return ["dmy", "mdy"] if len(c) == 4 else ["dmy", "mdy", "ymd", *rare]


def _format(shape: re.Match[str], order: str) -> str:
    """Return the format that matches the simplified cells."""
    digits = shape["c" if order[2] == "y" else "a"]
    letters = {"d": "%d", "m": "%m", "y": "%Y" if len(digits) == 4 else "%y"}
    form = f"{letters[order[0]]}{shape['sep']}{letters[order[1]]}{shape['sep2']}{letters[order[2]]}"
    if shape["hour"] is None:
        return form
    form += f"{shape['join']}{'%I' if shape['half'] else '%H'}:%M"
    if shape["seconds"]:
        form += ":%S.%f" if shape["dot"] else ":%S"
    return form + (" %p" if shape["half"] else "") + ("%z" if shape["zone"] else "")


def _shown_format(shape: re.Match[str], order: str) -> str:
    """Return the format of the cells as written in the file."""
    form = _format(shape, order)
    return form.replace("%S.", f"%S{shape['dot']}") if shape["dot"] else form


def _find_proof(text: "pd.Series[Any]", read: dict[str, "pd.Series[pd.Timestamp]"], order: str) -> str:
    """Return the first cell that is a valid date in one order only."""
    others = np.logical_and.reduce([s.isna().to_numpy() for o, s in read.items() if o != order])
    return str(text.iloc[int(np.flatnonzero(others)[0])]) if others.any() else str(text.iloc[0])
