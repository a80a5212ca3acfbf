"""The resting tool system of Wessel 2004, section IV (W-08): a heated hydraulic chuck on a fixed spindle shaft."""

from finite_elements.materials import data
from finite_elements.part import Part
from finite_elements.revolution import Revolution, Table


def toolholder(table: Table | None = None) -> Part:
    """Return the tool system as a part, its axis upright.

    Heat goes in at the patches ``heater`` (bearing fit of the shaft) and ``tip`` (cutting edges); ``t1`` ... ``t8`` are
    the paper's temperature places (``t9`` is the room), ``s1`` tip, ``s2`` chuck and ``s3`` flange its axial
    displacements, against the body.

    Parameters
    ----------
    table : mapping, optional
        As ``data/tool.toml``, which is used without it; see `finite_elements.revolution.Revolution`. Its
        ``film`` [W/(m2 K)] belongs to the surfaces of the same names.
    """
    return Revolution(data("tool.toml") if table is None else table).part("tool")
