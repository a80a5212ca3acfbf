"""Names of channels from the header of a logger: from a list of the channels, or from labelled rows."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from thermocomp.core.messages import Message, join
from thermocomp.core.units import is_unit
from thermocomp.recordings.headings import BRACKETS, is_understood
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.words import read_words

#: headings of the names in a list of channels, or labels of a row of names
_NAMES = frozenset(read_words("channel_names"))
#: a heading that consists of the number of a channel, its name and its unit: ``101 <Bearing> (C)``
_WHOLE = re.compile(r"\d+ *<(?P<name>[^<>]*\w[^<>]*)>(?P<unit> *\([^()]*\))?")


def name_channels(table: FileTable, mapping: Mapping) -> FileTable:
    """Return a table whose columns have the names that the rows above state; those that a mapping names are kept."""
    used = {rule.column or name for name, rule in mapping.columns.items()}
    used |= {mapping.time.column, mapping.time.date, mapping.cycles.column}
    listed, row = _read_list(table.above), _read_row(table)
    found: dict[int, tuple[str, str]] = {}
    for k, heading in enumerate(table.headings):
        split = BRACKETS.fullmatch(heading)
        base = split["base"] if split else heading
        if whole := _WHOLE.fullmatch(heading):
            found[k] = whole["name"].strip(), (whole["unit"] or "").strip(" ()")
        elif not is_understood(base) and (said := row.get(k) or listed.get(base.casefold())):
            found[k] = said[0], (split["square"] or split["round"] or "") if split else said[1]
        if k in found and not used.isdisjoint((heading, base)):
            del found[k]
    counts = Counter(name.casefold() for name, _ in found.values())
    taken = {h.casefold() for k, h in enumerate(table.headings) if k not in found}
    headings = list(table.headings)
    for k, (name, unit) in found.items():
        old = re.split(r"[<\[(]", headings[k])[0].strip()
        whole_name = name if counts[name.casefold()] == 1 and name.casefold() not in taken else f"{old} {name}"
        headings[k] = f"{whole_name} [{unit}]" if unit else whole_name
    if headings == list(table.headings):
        return table
    changed = [(old, new) for old, new in zip(table.headings, headings, strict=True) if old != new]
    pairs = [Message("{old!r} is {new!r}", old=old, new=new) for old, new in changed]
    return replace(
        table,
        headings=tuple(headings),
        notes=(*table.notes, Message("the header names: {names}", names=join(pairs, ", "))),
    )


def _bare(cell: str) -> str:
    return cell.strip().strip(":").strip().casefold()


def _read_list(above: Sequence[Sequence[str]]) -> dict[str, tuple[str, str]]:
    """Return name and unit by number of the channel, from a list with a row per channel."""
    found: dict[str, tuple[str, str]] = {}
    column = None
    for row in above:
        places = [k for k, cell in enumerate(row) if k and _bare(cell) in _NAMES]
        if places:
            column = places[0]
        elif column is not None and column < len(row) and row[0].strip() and row[column].strip():
            units = [cell.strip().strip("[]") for cell in row[column + 1 :]]
            units = [unit for unit in units if unit and is_unit(unit) and unit != "1"]
            found.setdefault(_bare(row[0]), (" ".join(row[column].split()), units[-1] if units else ""))
        else:
            column = None
    return found


def _read_row(table: FileTable) -> dict[int, tuple[str, str]]:
    """Return the names by column, from a row whose first cell is a label and whose others are different names."""
    width = len(table.headings)
    for row in table.above:
        if row and _bare(row[0]) in _NAMES and len(row) in (width, width + 1):
            named = {k: row[k].strip() for k in range(1, width) if row[k].strip()}
            if len(named) > 1 and len({*named.values()}) == len(named):
                return {k: (name, "") for k, name in named.items()}
    return {}
