"""Error profiles from tables: wide, with one column per position, or long, with one row per position."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from thermocomp.core.components import BY_CODE
from thermocomp.core.exceptions import InputError, RecordingError, UnitError
from thermocomp.core.machine import Channel
from thermocomp.core.units import read_with_unit
from thermocomp.files.tomlfile import read_toml
from thermocomp.recordings.profiles import MIN_POSITIONS, QUANTITY, Place, ProfileOptions, Profiles
from thermocomp.recordings.readers.codecolumns import codes, columns_of
from thermocomp.recordings.readers.codecolumns import is_code_column as is_profile
from thermocomp.recordings.readers.longtables import read_long
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.recordings import read as read_recording
from thermocomp.recordings.readers.recordings import read_rows
from thermocomp.recordings.recording import Recording

Layout = Literal["wide", "long"]

#: start of a note on columns of a component that could not be used
NOT_TAKEN = "not taken:"

#: default column names of a wide table: y_laser_250_um, a_y_-50_urad
_PLACED = re.compile(r"(?P<base>.+)_(?P<position>-?\d+(?:\.\d+)?)_(?:um|urad)")


def read(
    path: str | Path,
    options: ProfileOptions | str,
    mapping: Mapping | None = None,
    *,
    layout: Layout | None = None,
) -> Profiles:
    """Read the profiles of one component from a file.

    Parameters
    ----------
    layout : {'wide', 'long'}, optional
        A row per thermal state and a column per position, or a row per position. Default: detected automatically.
    """
    wanted = ProfileOptions(target=options) if isinstance(options, str) else options
    wanted.about  # noqa: B018 - raises an error before a long file is read
    if layout is None:
        rows = read_rows(path, mapping, rising=False)
        has_position = any(c.quantity == "position" for c in rows.channels)
        placed = [c for c in rows.channels if _PLACED.fullmatch(c.name)]
        named = len(placed) >= MIN_POSITIONS or wanted.places or "*" in wanted.columns
        layout = "long" if has_position and not named else "wide"
    if layout == "wide":
        return from_recording(read_recording(path, mapping), wanted)
    return read_long(path, mapping, wanted)


def read_components(
    paths: Sequence[str | Path],
    components: Sequence[str] = (),
    mapping: Mapping | None = None,
) -> dict[str, tuple[Profiles, ...]]:
    """Read the profiles of several components from wide tables whose columns are named after them."""
    recordings = [read_recording(path, mapping) for path in paths]
    wanted = components or list(dict.fromkeys(code for r in recordings for code in codes(r)))
    for r in recordings:
        for code in wanted or [""]:
            if code not in codes(r):
                like = f"{code or 'EXX'}_250_{BY_CODE[code].unit if code in BY_CODE else 'um'}"
                raise RecordingError(
                    f"{r.source}: no column is named after {code or 'an error component'}, such as {like} (position "
                    "in mm, unit); if the columns have other names, read one component at a time"
                )
    return {code: tuple(from_recording(r, code) for r in recordings) for code in wanted}


def from_recording(recording: Recording, options: ProfileOptions | str) -> Profiles:
    """Extract profiles from a recording with one column per position."""
    wanted = ProfileOptions(target=options) if isinstance(options, str) else options
    axis, unit = wanted.about
    owner = f"{recording.source or recording.name}: {wanted.target}"
    notes = recording.notes
    called, elsewhere = columns_of(recording, wanted.target)
    if wanted.places is not None:
        found = [(recording.channel(name), place) for name, place in wanted.places.items()]
    elif wanted.columns:
        found = [(c, {axis: p}) for c, p in _matching(recording, wanted.columns)]
    elif called:
        found = [(recording.channel(name), {axis: p}) for name, p in called.items()]
        if elsewhere:
            why = (
                "at another position, angular errors act through a lever arm: subtract their effect, and read a "
                "long table"
            )
            notes += (f"{NOT_TAKEN} {elsewhere[0]} to {elsewhere[-1]}: {why}",)
    else:
        found = [(c, {axis: p}) for c, p in _by_name(recording, QUANTITY[unit], owner)]
        _refuse_another_axis(wanted.target, axis, found, owner)
    if not found:
        what = f"called {wanted.columns!r}" if wanted.columns else f"like y_laser_250_{unit} (position in mm, unit)"
        raise RecordingError(
            f"{owner}: no column is {what}; state which columns hold the profile, such as 'y_laser_*', or use layout "
            "'long' for a table with a row per position. The columns are "
            + ", ".join(c.name for c in recording.channels if c.quantity in QUANTITY.values())
        )
    mixed = [c for c, _ in found if c.quantity != QUANTITY[unit]]
    if mixed:
        one, it, its = ("column", "it", "its") if len(mixed) == 1 else ("each of the columns", "them", "their")
        raise UnitError(
            f"{owner}: {one} {', '.join(repr(c.name) for c in mixed)} measures {mixed[0].quantity} in {mixed[0].unit} "
            f"among {QUANTITY[unit]}s in {unit}: leave {it} out, or correct {its} unit"
        )
    for channel, place in found:
        if axis not in place:
            raise InputError(
                f"{owner}: column {channel.name!r}: its entry in [positions] does not give the position of {axis}"
            )
    points = np.array([[place.get(a, 0.0) for a in "XYZ"] for _, place in found])
    taken = [c for c, _ in found]
    rest = tuple(c for c in recording.channels if c not in taken and not (called and is_profile(c)))
    states = replace(recording, table=recording.table[[c.name for c in rest]], channels=rest, notes=notes)
    return Profiles(
        target=wanted.target, unit=unit, axis=axis, points=points, values=recording.values(taken), states=states
    )


def read_places(path: str | Path) -> dict[str, Place]:
    """Read a TOML file with the measuring position of each column of a wide table.

    Examples
    --------
    ::

        [positions]
        probe_1 = { y = "0 mm" }
        probe_2 = { y = "250 mm", x = "300 mm" }
    """
    source = Path(path)
    content = read_toml(source, "file of positions")
    table = content.get("positions")
    if not isinstance(table, dict) or not table or len(content) > 1:
        raise InputError(f"{source}: expected one table [positions] with a key per column, and nothing else")
    return {name: _read_place(value, f"{source}: [positions] {name}") for name, value in table.items()}


def _read_place(value: Any, where: str) -> Place:
    if not isinstance(value, dict) or not value or any(a.upper() not in ("X", "Y", "Z") for a in value):
        raise InputError(f'{where} = {value!r}: write the axes\' positions, such as {{ y = "250 mm" }}')
    place = {}
    for axis, text in value.items():
        try:
            position = read_with_unit(text, "position")
        except UnitError as e:
            raise UnitError(f"{where}.{axis} = {text!r}: {e}") from e
        if position is None:
            raise InputError(f'{where}.{axis} = {text!r}: write a position with its unit, such as "250 mm"')
        place[axis.upper()] = position
    return place


def _matching(recording: Recording, pattern: str) -> list[tuple[Channel, float]]:
    """Return the channels whose name or alias matches `pattern`, and their positions."""
    shape = re.compile(re.escape(pattern).replace(r"\*", r"(-?\d+(?:\.\d+)?)", 1).replace(r"\*", ".*"))
    if "*" not in pattern:
        raise InputError(f"columns {pattern!r}: put * where the position is in the name, such as y_laser_*")
    found = []
    for c in recording.channels:
        names = [c.name, *(alias for alias, name in recording.aliases.items() if name == c.name)]
        without = re.sub(r"_(um|urad)$", "", c.name)
        matches = [m for name in (*names, without) if (m := shape.fullmatch(name))]
        if matches:
            found.append((c, float(matches[0][1])))
    return found


def _by_name(recording: Recording, quantity: str, owner: str) -> list[tuple[Channel, float]]:
    """Return the channels of a quantity with a position in their name; all must have the same base name.

    Channels of another quantity with this base name that continue the positions are included: their unit is wrong.
    """
    placed = [(c, m) for c in recording.channels if (m := _PLACED.fullmatch(c.name))]
    found = [(c, m) for c, m in placed if c.quantity == quantity]
    bases = list(dict.fromkeys(m["base"] for _, m in found))
    if len(bases) > 1:
        raise RecordingError(
            f"{owner}: there are profiles {', '.join(f'{b}_*' for b in bases)}; state which columns to use, such "
            f"as '{bases[0]}_*'"
        )
    there = {m["position"] for _, m in found}
    strange = [(c, m) for c, m in placed if m["base"] in bases and m["position"] not in there]
    return [(c, float(m["position"])) for c, m in (*found, *strange)]


def _refuse_another_axis(target: str, axis: str, found: Sequence[tuple[Channel, Place]], owner: str) -> None:
    """Reject columns found by name that are named after an axis not involved in the error."""
    for c, _ in found[:1]:
        called = re.match(r"([xyz])(?:\d?_)", c.name)
        if called and target in BY_CODE and called[1].upper() not in (axis, target[1]):
            raise RecordingError(
                f"{owner}: columns like {c.name!r} seem to contain {called[1].upper()}, not {target}; if they are "
                "nevertheless meant, specify the columns to use"
            )
