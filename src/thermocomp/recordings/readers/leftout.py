"""Columns that are left out, and the information missing in their headings."""

from collections.abc import Sequence
from difflib import get_close_matches

from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.core.messages import Message
from thermocomp.core.units import find_unit
from thermocomp.recordings.headings import BRACKETS, HOUSE_SUFFIX, SUFFIXES, find_named_quantity

#: units of the output of transducers, in lower case
_ELECTRIC = ("v", "mv", "vdc", "v dc", "volt", "volts", "ma", "pulses", "imp", "counts", "inc", "digits")


def refuse_nameless(headings: Sequence[str], source: str) -> None:
    """Reject numeric columns whose names suggest a temperature, a displacement or a speed but have no unit."""
    asked = {h: q for h in headings if not _says_unit(h) and (q := find_named_quantity(h))}
    if not asked:
        return
    heading, quantity = next(iter(asked.items()))
    units = {"temperature": "degC, K or degF", "displacement": "um, mm or nm", "spindle_speed": "rpm or Hz"}[quantity]
    several = len(asked) > 1
    raise RecordingError(
        f"{source}: column{'s' * several} {', '.join(map(repr, asked))} {'have' if several else 'has'} no unit: "
        f"{heading!r} may be a {quantity.replace('_', ' ')} in {units}; append the unit to the name, such as "
        f'"{heading} [{units.split(",")[0].split(" ")[0]}]", or write a mapping [columns.NAME] with column = '
        f'"{heading}" and unit, or role = "ignore" if it is not needed'
    )


def why_left_out(heading: str) -> str:
    """Return the information that is missing in an uninterpretable heading, and the required action."""
    found = BRACKETS.fullmatch(heading.strip())
    symbol = (found["square"] or found["round"] or "").strip() if found else heading.rpartition("_")[2]
    if unit := find_electric_unit(heading):
        return Message(
            "{heading!r} is in {unit}: {sensitivity}, in a mapping [columns.NAME] with its column",
            heading=heading,
            unit=unit,
            sensitivity=tell_sensitivity(unit),
        )
    mapped = Message('a mapping [columns.NAME] with column = "{heading}" and', heading=heading)
    ignore = Message('role = "ignore" if it is of no use')
    if not found and "_" not in heading:
        return Message(
            "{heading!r} has no unit; append it to the name (t1_C), or write {mapped} role and unit, or {ignore}",
            heading=heading,
            mapped=mapped,
            ignore=ignore,
        )
    try:
        meant = find_unit(symbol)
    except UnitError:
        near = get_close_matches(symbol, SUFFIXES, n=3, cutoff=0.5)
        known = Message(
            "the nearest are {names}" if near else "known units are {names} and others",
            names=", ".join(near or HOUSE_SUFFIX),
        )
        return Message(
            "{heading!r}: {symbol!r} is not a known unit, {known}; correct the heading, or write {mapped} role and "
            "unit, or {ignore}",
            heading=heading,
            symbol=symbol,
            known=known,
            mapped=mapped,
            ignore=ignore,
        )
    if meant.quantity == "time":
        return Message(
            "{heading!r}: the time is taken from another column; write {mapped} role and unit if it is not a time",
            heading=heading,
            mapped=mapped,
        )
    return Message(
        "{heading!r}: {symbol!r} is read as a unit of {quantity} only with a mapping; write {mapped} role = "
        '"{quantity}" and unit = "{unit}" if it is one, or {ignore}',
        heading=heading,
        symbol=symbol,
        quantity=meant.quantity,
        mapped=mapped,
        unit=symbol or meant.symbol,
        ignore=ignore,
    )


def find_electric_unit(heading: str) -> str:
    """Return the unit of a heading with the output of a transducer, such as ``V`` or ``mA``; empty if it has none."""
    found = BRACKETS.fullmatch(heading.strip())
    symbol = (found["square"] or found["round"] or "").strip() if found else heading.rpartition("_")[2]
    return symbol if symbol.casefold() in _ELECTRIC and symbol != heading else ""


def tell_sensitivity(unit: str) -> str:
    """Return how the output of a transducer becomes a channel."""
    return Message(
        'state its sensitivity: role = "displacement", unit = "um" and scale = the um per {unit}, or role = '
        '"spindle_speed", unit = "1/min" and scale = the speed per {unit} (600 if 10 {unit} are 6000 1/min), and zero',
        unit=unit,
    )


def _says_unit(heading: str) -> bool:
    """Return whether a heading contains a unit, even one that is not supported here."""
    found = BRACKETS.fullmatch(heading.strip())
    return found is not None and (found["square"] or found["round"] or "").strip() not in ("", "1")
