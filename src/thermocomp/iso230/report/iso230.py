"""Thermal tests (ISO 230-3), positioning (ISO 230-2) and time constants as one offline page."""

from collections.abc import Sequence
from pathlib import Path

from thermocomp.iso230 import tables
from thermocomp.iso230.part2 import PositioningResult
from thermocomp.iso230.report import iso230figures as figures
from thermocomp.iso230.thermaltest import TITLES, ThermalTest
from thermocomp.judging.settling.settling import Settling
from thermocomp.recordings.recording import Recording
from thermocomp.report.html import page

#: recordings, each with the time constants of its channels
Settlings = Sequence[tuple[Recording, Sequence[Settling]]]


def render(thermal: Sequence[ThermalTest], settlings: Settlings, positioned: Sequence[PositioningResult]) -> str:
    """Return the page about ISO 230 tests as self-contained HTML."""
    names = [t.name for t in thermal] + list(dict.fromkeys(Path(r.test.source).name for r in positioned))
    return page(
        "iso230.html",
        names=names,
        thermal=[
            {
                "title": TITLES[t.kind],
                "test": t,
                "figure": figures.thermal(t),
                "profiles": [figures.profiles(t, k) for k in range(len(t.targets))],
                "tables": tables.thermal_tables(t),
            }
            for t in thermal
        ],
        settlings=[
            {"name": r.name, "figure": figures.time_constants(mine), "tables": tables.time_constant_tables(mine)}
            for r, mine in settlings
            if mine
        ],
        positioned=[(r, figures.positioning(r)) for r in positioned],
        positioning_tables=tables.positioning_tables(positioned),
    )
