"""The bed against closed forms: fields that are linear in the sheet displace it without any stress."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from finite_elements.bed import Bed
from finite_elements.machines import dimensions
from finite_elements.materials import data, material
from finite_elements.part import Part

IRON = material("grey_iron")
BED = Bed(**dimensions(data("centre.toml")["bed"]), table=-0.65, foot=0.45, shoe=0.25)
ALPHA = 1e6 * IRON.expansion


@pytest.fixture(scope="module")
def part() -> Part:
    return BED.part("bed", IRON)


def test_it_has_the_mass_and_the_surface_of_its_walls(part: Part) -> None:
    walls = BED.width * (BED.top + BED.bottom) + BED.web * (BED.height - BED.top - BED.bottom)
    assert part.capacity.sum() == pytest.approx(IRON.heat_capacity * walls * BED.length)
    area = {k: s.area for k, s in part.surfaces.items()}
    box = 2 * (BED.length * BED.height + BED.width * BED.height + BED.length * BED.width)
    assert sum(area.values()) == pytest.approx(box)
    assert area["bottom"] == pytest.approx(BED.length * BED.width)
    assert part.surfaces["bottom"].height.sum() == pytest.approx(area["bottom"] * (BED.base - 1.2))


def test_an_evenly_warm_bed_only_grows(part: Part) -> None:
    grown = {name: float(row.sum()) for name, row in part.observables.items()}
    assert grown["z"] == pytest.approx(ALPHA * (BED.bearing - BED.table), rel=1e-3)
    assert grown["foot"] == pytest.approx(ALPHA * 2 * BED.shoe, rel=0.01)
    for name in ("y", "a_foot", "a_table"):
        assert grown[name] == pytest.approx(0.0, abs=1e-6)


def test_a_warm_top_crowns_it_and_column_and_table_lean_away_from_each_other(part: Part) -> None:
    gradient = 2.0 / BED.height  # the top 2 K warmer than the underside
    rise = gradient * (BED.space().points[1] - BED.height / 2)
    # u_y = alpha gradient (y^2 - z^2) / 2: its slope along z is the tilt about X, with the other sign
    assert part.observables["a_foot"] @ rise == pytest.approx(ALPHA * gradient * BED.foot, rel=2e-3)
    assert part.observables["a_table"] @ rise == pytest.approx(ALPHA * gradient * BED.table, rel=2e-3)
    higher = ALPHA * gradient * (BED.table**2 + 0.2**2 - BED.foot**2 - BED.shoe**2) / 2
    assert part.observables["y"] @ rise == pytest.approx(higher, rel=5e-3)
    # the top's growth, less what it would be at the middle of the height
    assert part.observables["z"] @ rise == pytest.approx(ALPHA * (BED.bearing - BED.table), rel=2e-3)


def test_finer_elements_say_the_same(part: Part) -> None:
    fine = replace(BED, cells=(56, 10)).part("bed", IRON)
    answers = []
    for p in (part, fine):
        stiffness = p.conduction + 8.0 * p.surfaces["outside"].mass + 5.0 * p.surfaces["bottom"].mass
        rise = spsolve(stiffness.tocsc(), 100.0 * p.patches["table"] + 50.0 * p.patches["hydraulics"])
        answers.append([float(row @ rise) for row in p.observables.values()])
    assert answers[0] == pytest.approx(answers[1], rel=5e-3)


def test_its_patches_are_where_their_names_say(part: Part) -> None:
    z, y = BED.space().points
    for patch, at in (("front", BED.table), ("rear", BED.foot), ("shoe_rear", BED.foot + BED.shoe), ("bearing", 1.0)):
        assert part.patches[patch] @ z == pytest.approx(at, abs=2e-3)
        assert part.patches[patch] @ y == pytest.approx(BED.height)
    assert np.array([part.patches["mount_front"] @ z, part.patches["mount_rear"] @ z]) == pytest.approx(
        [-BED.mount, BED.mount], abs=2e-3
    )
