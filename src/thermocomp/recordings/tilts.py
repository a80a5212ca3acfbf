"""Tilts: angles from the readings of two probes at a known distance along the test bar."""

from collections.abc import Sequence
from dataclasses import replace

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.units import read_with_unit
from thermocomp.recordings.recording import Recording


def with_tilts(tests: Sequence[Recording], tilts: Sequence[str]) -> tuple[list[Recording], list[str]]:
    """Return recordings with the tilts of the test bar as additional channels.

    Returns
    -------
    list of Recording
        Recordings with the additional channels [urad].
    """
    found, names = list(tests), []
    for text in tilts:
        name, equals, rest = text.partition("=")
        parts = rest.rsplit(":", 2)
        distance = read_with_unit(parts[2], "position") if len(parts) == 3 else None
        if not equals or name[:1] not in ("A", "B") or distance is None:
            raise InputError(
                f"--tilt {text!r}: write name, probe at the tip, probe nearer to the spindle and their distance, such "
                "as A0C=y1_um:y2_um:100mm; the name begins with A (turn about X, probes along Y) or B"
            )
        if not distance > 0:
            raise InputError(f"--tilt {text!r}: the distance must be positive")
        for k, test in enumerate(found):
            if name in test.table.columns:
                raise InputError(f"{test.name}: a channel {name!r} already exists: choose another name for the tilt")
            tip, spindle = (test.channel(part) for part in parts[:2])
            for probe in (tip, spindle):
                if probe.quantity != "displacement":
                    raise InputError(f"{test.name}: {probe.name} is a {probe.quantity}; probes measure displacements")
            lean = 1e3 * (test.table[tip.name] - test.table[spindle.name]) / distance
            table = test.table.assign(**{name: lean if name[0] == "A" else -lean})
            about = "X" if name[0] == "A" else "Y"
            place = f"tilt about {about} by {tip.name} and {spindle.name}, {distance:g} mm apart"
            found[k] = replace(test, table=table, channels=(*test.channels, Channel(name, "angle", "urad", place)))
        names.append(name)
    return found, names
