"""Inspection of a part that was milled on the virtual machine (C-37)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
import pytest

from thermocomp.papers.chen1996 import part
from thermocomp.papers.chen1996.anywhere import WITHOUT, UnseenTest, left
from thermocomp.papers.chen1996.part import PLACES, Part, inspect, measure, mill
from thermocomp.papers.chen1996.unseen import MRA, NET
from thermocomp.papers.chen1996.volume import DYNAMIC
from thermocomp.runtime.geometry.volumetric import ThermalStates
from thermocomp.virtual.axes import STATIONS
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.volume import VolumetricTruth

NAMES = MachiningCentre().observables


@dataclass(frozen=True)
class Share:
    """Predicted states that correct a share of the true error."""

    share: float
    observables: np.ndarray

    def __getitem__(self, row: int) -> "Corrected":
        return Corrected(self.share, self.observables[0], self.observables[row])


@dataclass(frozen=True)
class Corrected:
    share: float
    start: np.ndarray
    now: np.ndarray

    def correction(self, points: np.ndarray, tool: tuple[float, float, float]) -> np.ndarray:
        return -self.share * left(VolumetricTruth(NAMES), self.start, self.now, points, np.tile(tool, (len(points), 1)))


def day(gains: Mapping[str, float], growth: float = -60.0, screw: float = 100.0) -> UnseenTest:
    """Return a day of six hours on which spindle and screw of Y grow: Z at the end [um], slope of Y [um/m]."""
    time = 600.0 * np.arange(37, dtype=np.float64)
    warm = time / time[-1]
    observables = np.zeros((len(time), len(NAMES)))
    observables[:, NAMES.index("z")] = growth * warm
    for y in STATIONS["y"]:
        observables[:, NAMES.index(f"EYY@{y}")] = screw * warm * 1e-3 * (y - 250)
    states = {name: Share(1.0 - 1.0 / gain, observables) for name, gain in gains.items()}
    return UnseenTest(observables, time, cast("Mapping[str, ThermalStates]", states))


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure without error."""
    monkeypatch.setattr(part, "POINT", 0.0)
    monkeypatch.setattr(part, "SCALE", 0.0)


@pytest.mark.usefixtures("exact")
def test_a_length_and_a_depth_are_those_that_the_machine_has_grown() -> None:
    """C-37: hourly, relative to the drawing; the cold floor at the first place is the reference of depths."""
    found = inspect([day({MRA: 5.0})], 0)
    cold = mill(day({}), WITHOUT, [0]).mean(axis=2)[0]
    hours = np.arange(1, 7) / 6.0
    assert found.lengths[WITHOUT].shape == (6, 2)
    assert found.depths[WITHOUT].shape == (6, 4)
    for k in range(2):
        grown = cold[2 * k + 1, 1] - cold[2 * k, 1] + 100.0 * 0.450 * hours
        assert found.lengths[WITHOUT][:, k] == pytest.approx(grown, abs=0.05)
    assert found.depths[WITHOUT][:, 0] == pytest.approx(-60.0 * hours, abs=0.05)
    assert found.true[MRA] == pytest.approx(found.largest[MRA])
    assert found.depths[WITHOUT][:, 3] == pytest.approx(cold[3, 2] - cold[0, 2] - 60.0 * hours, abs=0.05)


@pytest.mark.usefixtures("exact")
@pytest.mark.parametrize(("gain", "holds"), [(12.0, (False, False)), (13.5, (True, False)), (25.5, (True, True))])
def test_the_factors_are_those_of_the_paper(gain: float, holds: tuple[bool, bool]) -> None:
    """C-37: 92.4 -> 7.2 um and 196 -> 8 um, by the better of the paper's methods, whatever ours do."""
    for gains in ({MRA: gain, NET: 2.0}, {MRA: 2.0, NET: gain}):
        found = inspect([day(gains | {DYNAMIC: 100.0}), day(gains | {DYNAMIC: 100.0}, -20.0, 50.0)], 0)
        assert found.gain(DYNAMIC) == pytest.approx((100.0, 100.0), rel=0.05)
        claims = part.claims(found)
        assert tuple(c.holds for c in claims) == holds
        assert {i for c in claims for i in c.ids} == {"C-37"}


def test_lengths_and_depths_have_gains_of_their_own() -> None:
    one = np.ones((1, 1))
    found = Part({WITHOUT: 10 * one, MRA: -2 * one}, {WITHOUT: 30 * one, MRA: 3 * one}, {})
    assert found.gain(MRA) == (5.0, 10.0)


def test_the_measurement_has_the_uncertainty_that_is_stated() -> None:
    milled, rng = np.random.default_rng(1).normal(size=(3, len(PLACES), 5, 3)), np.random.default_rng(2)
    errors = rng.normal(0.0, 0.003 / np.sqrt(3)) * PLACES, rng.normal(0.0, 1.5 / np.sqrt(3), milled.shape)
    expected = errors[0] + (milled + errors[1]).sum(axis=2) / 5  # of the scale, and of each point
    np.testing.assert_allclose(measure(milled, np.random.default_rng(2)), expected, rtol=0, atol=1e-12)
    rng = np.random.default_rng(0)
    found = np.array([measure(np.zeros((1, len(PLACES), 5, 3)), rng)[0] for _ in range(4000)])
    assert np.std(found[:, 1, 1] - found[:, 0, 1]) == pytest.approx(part.uncertainty(450.0), rel=0.05)
    assert np.std(found[:, 1, 2] - found[:, 0, 2]) == pytest.approx(part.uncertainty(0.0), rel=0.05)
    assert part.uncertainty(450.0) == pytest.approx(0.95, abs=0.01)
    found_day = inspect([day({MRA: 5.0, NET: 5.0})], 0)
    assert found_day.true[WITHOUT] != found_day.largest[WITHOUT]
    (claim, _) = part.claims(found_day)
    assert f"up to {found_day.true[MRA][0]:.1f} um, 5.0 times less" in claim.finding
    assert "uncertainty of the measurement 1.0 um" in claim.text


def test_the_table_has_the_paper_s_numbers_beside_ours() -> None:
    found = inspect([day({MRA: 5.0, NET: 4.0})], 0)
    (table,) = part.tables(found)
    assert [row[0] for row in table.rows] == [WITHOUT, MRA, NET, "the paper"]
    assert table.rows[-1][2:4] == ["92.4 -> 7.2", "12.8"]
    assert table.rows[1][2] == f"{part.numbers(found)['part_length_mra_um']:.1f}"


def test_lengths_and_depths_of_several_days() -> None:
    """C-37: between the walls of two places in Y, and between a floor in Z and the first one of the day."""
    days = [np.random.default_rng(k).normal(size=(2, 4, len(PLACES), 3)) for k in range(2)]
    lengths, depths = part._dimensions(("a", "b"), days)
    for k, name in enumerate(("a", "b")):
        rows = [(p[k, row], p[k, 0]) for p in days for row in (1, 2, 3)]
        assert lengths[name].tolist() == [[r[1, 1] - r[0, 1], r[3, 1] - r[2, 1]] for r, _ in rows]
        assert depths[name].tolist() == [[r[m, 2] - cold[0, 2] for m in range(4)] for r, cold in rows]
        largest = (max(abs(np.ravel(lengths[name]))), max(abs(np.ravel(depths[name]))))
        assert part._largest(lengths, depths)[name] == pytest.approx(largest)
