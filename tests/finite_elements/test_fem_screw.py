"""The ball screw against closed forms of bars and fins."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from finite_elements.materials import material
from finite_elements.part import Part
from finite_elements.screw import Screw
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import N_HATS

STEEL = material("steel")
SCREW = Screw(diameter=0.04, length=1.0, nut=(0.2, 0.8), cells=60)
POSITIONS = (0, 150, 300, 600)
SECTION = np.pi / 4 * 0.04**2


@pytest.fixture(scope="module")
def part() -> Part:
    return SCREW.part("screw", STEEL, POSITIONS)


def field(part: Part, slope: float) -> np.ndarray:
    """Temperatures that grow from the bearing on, found from the part's own places: hats are linear in the distance."""
    at = [part.patches[f"hat_{k}"] for k in range(1, N_HATS - 1)]
    ends = [part.patches["bearing"], part.patches["end"]]
    want = slope * np.array([*(0.3, 0.4, 0.5, 0.6, 0.7), 0.0, 1.0])
    # smoothest field with these values: without conduction anywhere it is the straight line
    rows = np.array([*at, *ends])
    n = part.n
    system = np.block([[part.conduction.toarray(), rows.T], [rows, np.zeros((len(want), len(want)))]])
    return np.asarray(np.linalg.lstsq(system, np.concatenate([np.zeros(n), want]), rcond=None)[0][:n])


def test_an_evenly_warm_screw_grows_by_alpha_l(part: Part) -> None:
    for p in POSITIONS:
        assert part.observables[f"at@{p}"].sum() == pytest.approx(1e6 * STEEL.expansion * (0.2 + p / 1000), rel=1e-12)


def test_a_screw_whose_nut_comes_nearer_counts_its_positions_from_the_far_end() -> None:
    part = Screw(diameter=0.04, length=1.0, nut=(0.9, 0.3)).part("screw", STEEL, (0, 600))
    assert part.observables["at@0"].sum() == pytest.approx(1e6 * STEEL.expansion * 0.9)
    assert part.observables["at@600"].sum() == pytest.approx(1e6 * STEEL.expansion * 0.3)


def test_a_screw_that_is_warmer_from_the_bearing_on_grows_with_the_square(part: Part) -> None:
    rise = field(part, 10.0)  # 10 K/m
    for p in POSITIONS:
        d = 0.2 + p / 1000
        assert part.observables[f"at@{p}"] @ rise == pytest.approx(1e6 * STEEL.expansion * 10.0 * d**2 / 2, rel=1e-9)


def test_it_holds_the_heat_of_its_volume_and_conducts_like_a_bar(part: Part) -> None:
    assert part.capacity.sum() == pytest.approx(STEEL.heat_capacity * SECTION * 1.0)
    rise = field(part, 10.0)
    flow = part.conduction @ rise
    # 10 K/m along a bar: the heat comes in at the far end and leaves at the bearing
    inner = np.abs(flow) < 1e-9
    assert flow.max() == pytest.approx(STEEL.conductivity * SECTION * 10.0)
    assert flow.min() == pytest.approx(-STEEL.conductivity * SECTION * 10.0)
    assert inner.sum() == part.n - 2


def test_heat_at_the_bearing_decays_along_it_as_in_a_fin(part: Part) -> None:
    film, heat = 12.0, 5.0
    air = part.surfaces["air"]
    assert air.area == pytest.approx(np.pi * 0.04 * 1.0)
    rise = spsolve((part.conduction + film * air.mass).tocsc(), heat * part.patches["bearing"])
    m = np.sqrt(film * np.pi * 0.04 / (STEEL.conductivity * SECTION))
    root = heat / (STEEL.conductivity * SECTION * m * np.tanh(m))
    assert part.patches["bearing"] @ rise == pytest.approx(root, rel=1e-6)
    assert part.patches["end"] @ rise == pytest.approx(root / np.cosh(m), rel=1e-6)
    # expansion up to d: the integral of cosh(m (1 - x)) / cosh(m)
    grown = 1e6 * STEEL.expansion * root * (np.sinh(m) - np.sinh(m * (1 - 0.5))) / (m * np.cosh(m))
    assert part.observables["at@300"] @ rise == pytest.approx(grown, rel=1e-6)


def test_hats_cover_the_travel_evenly(part: Part) -> None:
    hats = np.array([part.patches[f"hat_{k}"] for k in range(N_HATS)])
    shares = np.array([0.5, 1, 1, 1, 1, 1, 0.5]) / (N_HATS - 1)
    assert np.abs(shares @ hats - part.patches["middle"]).max() < 1e-12
    rise = field(part, 1.0)
    assert hats[1:-1] @ rise == pytest.approx([0.3, 0.4, 0.5, 0.6, 0.7])
    assert part.patches["middle"] @ rise == pytest.approx(0.5)
    assert part.surfaces["nut"].area == pytest.approx(np.pi * 0.04 * 0.6)


def test_a_nut_that_leaves_the_screw_is_refused() -> None:
    with pytest.raises(InputError, match="not within the length"):
        Screw(diameter=0.04, length=0.7, nut=(0.2, 0.8)).part("screw", STEEL)
