"""The spindle: shaft with rotor, bearings, housing, stator and test bar, as bodies of revolution."""

from finite_elements.materials import data
from finite_elements.part import Part
from finite_elements.revolution import Revolution, Table


def spindle(table: Table | None = None) -> Part:
    """Return the spindle as a part, z = 0 at the flange, z towards the tool."""
    return Revolution(data("spindle.toml") if table is None else table).part("spindle")
