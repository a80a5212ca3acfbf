"""Readings and corrections as JSON messages: bounded, and nothing is guessed at."""

import json
import math
from collections.abc import Mapping
from typing import Any

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ReadingError
from thermocomp.core.reading import Reading

#: bytes of a message, and values in it, at most
MOST_BYTES, MOST_VALUES = 65_536, 1_000


def read_message(payload: bytes | str, arrived: float, names: Mapping[str, str]) -> Reading:
    """Return the reading in a message.

    Parameters
    ----------
    payload : bytes or str
        JSON: values by channel, such as ``{"t1_C": 21.3, "spindle_rpm": 4000}``; with ``time`` (s since 1970) when
        it was taken. What is no number is missing.
    arrived : float
        The clock, now [s]: its time if it does not say.
    names : mapping of str to str
        Channel by the name in the message, for those that are called otherwise there.

    Raises
    ------
    ReadingError
        It is too large, no JSON, or no table.
    """
    if len(payload) > MOST_BYTES:
        raise ReadingError(f"a message of {len(payload):,} bytes; at most {MOST_BYTES:,}")
    try:
        content = json.loads(payload)
    except (ValueError, RecursionError) as e:
        raise ReadingError(f"a message that is no JSON: {str(e)[:80]}") from e
    if not isinstance(content, dict):
        raise ReadingError(f'a message that is no table of values: {str(content)[:40]}; want {{"t1_C": 21.3}}')
    if len(content) > MOST_VALUES:
        raise ReadingError(f"a message of {len(content):,} values; at most {MOST_VALUES:,}")
    stamp = content.pop("time", None)
    if stamp is not None and _number(stamp) is None:
        raise ReadingError(f"a message whose time is {str(stamp)[:40]!r}: want seconds since 1970")
    values = {names.get(name, name): v for name, raw in content.items() if (v := _number(raw)) is not None}
    return Reading(arrived if stamp is None else float(stamp), values)


def write_message(corrections: Mapping[str, Correction], stamp: float) -> str:
    """Return corrections as a message: offset [um], slope [um/m] and reference position [mm] by axis or target."""
    table = {
        name: {"offset_um": c.offset, "slope_um_per_m": c.slope, "reference_position_mm": c.reference_position}
        for name, c in corrections.items()
    }
    return json.dumps({"time": stamp, "corrections": table}, allow_nan=False)


def _number(value: Any) -> float | None:
    if type(value) not in (int, float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
