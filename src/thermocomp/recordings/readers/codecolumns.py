"""Columns of a wide table that are called after components: EXX_250_um, EYX_z0_100_um."""

import re

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Channel
from thermocomp.recordings.recording import Recording

_NUMBER = r"-?\d+(?:\.\d+)?"
#: code, positions of other axes, own position, unit
_NAME = re.compile(rf"(?P<code>E[XYZABC][XYZ])_(?P<others>(?:[xyz]{_NUMBER}_)*)(?P<own>{_NUMBER})_(?P<unit>um|urad)")


def codes(recording: Recording) -> tuple[str, ...]:
    """Return the components that have separate columns, in the order of `thermocomp.core.components`."""
    return tuple(c.code for c in COMPONENTS if columns_of(recording, c.code)[0])


def is_code_column(channel: Channel) -> bool:
    """Return whether a column is called after a component."""
    return _NAME.fullmatch(channel.name) is not None


def columns_of(recording: Recording, code: str) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the columns that are called after a component.

    Columns whose name tells where another axis stood, ``EYX_z0_100_um``, are left out beside those that do not: what
    was read there holds the turns of the axes times that way.

    Parameters
    ----------
    recording : Recording
    code : str
        Code of the component.

    Returns
    -------
    found : dict of str to float
        Position by column [mm]; empty if none is called after the component.
    left_out : tuple of str
        Columns with positions of other axes.
    """
    matches = [match for c in recording.channels if (match := _NAME.fullmatch(c.name)) and match["code"] == code]
    found = {match[0]: float(match["own"]) for match in matches if not match["others"]}
    return found, tuple(match[0] for match in matches if match["others"])
