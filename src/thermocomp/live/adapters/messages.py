"""Readings and corrections as JSON messages: bounded in size and validated strictly."""

import json
import math
from collections.abc import Mapping
from typing import Any

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ReadingError
from thermocomp.core.ports import TargetStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.core.shown import escape, explain_unfit
from thermocomp.core.strictjson import parse_json

#: maximum size [bytes] and number of values of a message
MOST_BYTES, MOST_VALUES = 65_536, 1_000
#: numbers of a measurement and their defaults; the first is mandatory
_NUMBERS = {"measured_um": None, "repeatability_um": 0.5, "position_mm": 0.0}
#: maximum deviation of a tool point [um]
_FAR = 1e5
_LINES = str.maketrans("\t\r\n", "   ")
_KNOWN = {"time", "id", "target", "under_correction", *_NUMBERS}
#: maximum length of an id [characters]
_LONG = 200


def read_message(
    payload: bytes | str, arrived: float, names: Mapping[str, str], unread: dict[str, str] | None = None
) -> Reading:
    """Return the reading in a message.

    Parameters
    ----------
    arrived : float
        Present time of the clock [s], used if the message has no time.
    unread : dict of str to str, optional
        Channels whose last value was not a number, and that value; updated.
    """
    content = _table(payload, '{"t1_C": 21.3}')
    if len(content) > MOST_VALUES:
        raise ReadingError(f"a message of {len(content):,} values; at most {MOST_VALUES:,} are accepted")
    stamp = content.pop("time", None)
    if stamp is not None and _number(stamp) is None:
        raise ReadingError(
            f"a message with time {escape(stamp, 40)!r}: expected seconds since 1970 as a number, such as "
            "1790000000.0; without time a message counts from its arrival"
        )
    values = {names.get(name, name): v for name, raw in content.items() if (v := _number(raw)) is not None}
    if unread is not None and (unread or len(values) < len(content)):
        others = {names.get(n, n): escape(json.dumps(v), 40) for n, v in content.items() if _number(v) is None}
        found = {n: v for n, v in (unread | others).items() if n not in values}
        unread.clear()
        unread.update(list(found.items())[-MOST_VALUES:])
    if not values:
        raise ReadingError(
            'a message without any number; expected a number, not in quotes, for each channel: {"t1_C": 21.3}'
        )
    return Reading(arrived if stamp is None else float(stamp), values)


def read_measurement(payload: bytes | str, arrived: float) -> Measurement:
    """Return the measurement of the tool point in a message.

    Parameters
    ----------
    arrived : float
        Present time of the clock [s], used if the message has no time.
    """
    example = '{"id": "17", "target": "z_um", "measured_um": 3.2, "under_correction": true}'
    content = _table(payload, example)
    found = {k: _number(content.get(k, default)) for k, default in _NUMBERS.items()}
    found["time"] = _number(content.get("time", arrived))
    target, left, own = content.get("target"), content.get("under_correction"), content.get("id", "")
    wrong = [k for k, v in found.items() if v is None] + ["target"] * (not isinstance(target, str))
    wrong += ["id"] * (type(own) not in (str, int) or len(str(own)) > _LONG or ("id" in content and own == ""))
    wrong += ["under_correction"] * (not isinstance(left, bool)) + sorted(content.keys() - _KNOWN)
    if wrong:
        raise ReadingError(
            f"a measurement with missing, invalid or unknown keys: {escape(', '.join(wrong), 80)}; expected {example}"
        )
    if why := explain_unfit(str(target)):
        raise ReadingError(f"a measurement whose target is not a valid name: {why}")
    if max(abs(found[k] or 0.0) for k in _NUMBERS) > _FAR or (found["repeatability_um"] or 0.0) < 0.0:
        raise ReadingError(
            f"a measurement with a number beyond {_FAR:g} um or mm, or with a negative repeatability; check the units"
        )
    at, measured, spread, position = (v or 0.0 for v in map(found.get, ("time", *_NUMBERS)))
    keys = [f"id {own}"] * ("id" in content) + [f"time {at!r}"] * ("time" in content)
    keys = keys or [f"content {measured} um at {position} mm, give or take {spread} um, {left}"]
    return Measurement(
        time=at,
        target=str(target),
        measured=measured,
        left=bool(left),
        repeatability=spread,
        position=position,
        keys=tuple(keys),
    )


def write_message(
    corrections: Mapping[str, Correction],
    stamp: float,
    statuses: Mapping[str, TargetStatus] | None = None,
    sequence: int | None = None,
) -> str:
    """Return corrections as a message: offset [um], slope [um/m] and reference position [mm] by axis or target.

    Parameters
    ----------
    stamp : float
        Time of the message [s since 1970].
    statuses : mapping of str to TargetStatus, optional
        Status of each target, with its reason and the half-width of its band [um].
    sequence : int, optional
        Number of the message since the start of the service.
    """
    table: dict[str, dict[str, Any]] = {}
    for name, c in corrections.items():
        own: dict[str, Any] = {
            "offset_um": c.offset,
            "slope_um_per_m": c.slope,
            "reference_position_mm": c.reference_position,
        }
        if status := (statuses or {}).get(name):
            own |= {"state": status.word, "reason": status.reason, "half_width_um": status.half_width}
        table[name] = own
    head = {"time": stamp} if sequence is None else {"time": stamp, "sequence": sequence}
    return json.dumps({**head, "corrections": table}, allow_nan=False)


def read_corrections(payload: bytes | str) -> dict[str, Correction]:
    """Return the corrections in a message of `write_message`, by axis or target.

    Raises
    ------
    ReadingError
        It is not such a message.
    """
    example = '{"corrections": {"z_um": {"offset_um": -3.2, "slope_um_per_m": 0.0, "reference_position_mm": 0.0}}}'
    table = _table(payload, example).get("corrections")
    found = dict[str, Correction]()
    for name, own in table.items() if isinstance(table, dict) else ():
        keys = ("offset_um", "slope_um_per_m", "reference_position_mm")
        numbers = [_number(own.get(key)) if isinstance(own, dict) else None for key in keys]
        if None in numbers or explain_unfit(name):
            raise ReadingError(f"a message without the numbers of a correction; expected {example}")
        found[name] = Correction(*(n for n in numbers if n is not None))
    return found


def read_time(payload: bytes | str) -> float:
    """Return the time of a message of `write_message` [s since 1970]; -inf if it has none."""
    found = _number(_table(payload, "{}").get("time"))
    return -math.inf if found is None else found


def _table(payload: bytes | str, example: str) -> dict[str, Any]:
    if len(payload) > MOST_BYTES:
        raise ReadingError(f"a message of {len(payload):,} bytes; at most {MOST_BYTES:,} are accepted")
    try:
        content = parse_json(payload)
    except ValueError as e:
        raise ReadingError(f"a message that is not JSON: {escape(e, 80)}; expected {example}") from e
    if not isinstance(content, dict):
        raise ReadingError(f"a message that is not a table of values: {escape(content, 40)}; expected {example}")
    for name, value in content.items():
        if why := explain_unfit(name) or (isinstance(value, str) and not _is_text(value) and explain_unfit(value)):
            raise ReadingError(f"a message with invalid text: {why}")
    return content


def _is_text(value: str) -> bool:
    """Return whether a value is printable apart from tabs and line breaks."""
    return value.translate(_LINES).isprintable()


def _number(value: Any) -> float | None:
    if type(value) not in (int, float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
