"""Columns of a wide table that are named after components: EXX_250_um, EYX_z0_100_um."""

import re

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Channel
from thermocomp.recordings.recording import Recording

_NUMBER = r"-?\d+(?:\.\d+)?"
#: code, positions of other axes, position of the axis itself, unit
_NAME = re.compile(rf"(?P<code>E[XYZABC][XYZ])_(?P<others>(?:[xyz]{_NUMBER}_)*)(?P<own>{_NUMBER})_(?P<unit>um|urad)")


def codes(recording: Recording) -> tuple[str, ...]:
    """Return the error components that have their own columns, in the order of `thermocomp.core.components`."""
    return tuple(c.code for c in COMPONENTS if columns_of(recording, c.code)[0])


def is_code_column(channel: Channel) -> bool:
    """Return whether a column is named after a component."""
    return _NAME.fullmatch(channel.name) is not None


def columns_of(recording: Recording, code: str) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the columns that are named after a component.

    Columns with the position of another axis in their name, ``EYX_z0_100_um``, are left out if there are columns
    without it: their values include the angles of the axes multiplied by that distance.

    Returns
    -------
    found : dict of str to float
        Position by column [mm]; empty if none is named after the component.
    """
    matches = [match for c in recording.channels if (match := _NAME.fullmatch(c.name)) and match["code"] == code]
    found = {match[0]: float(match["own"]) for match in matches if not match["others"]}
    return found, tuple(match[0] for match in matches if match["others"])
