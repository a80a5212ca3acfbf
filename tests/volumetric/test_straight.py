"""Straight lines of the axes: what K0 + tanb (P - P0) can take away, and what it tells that it leaves."""

import numpy as np
import pytest
from volumetricmachine import by_hand

from thermocomp.core.machine import Source
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile
from thermocomp.runtime.geometry.field import ErrorField
from thermocomp.runtime.geometry.straight import straight_lines
from thermocomp.runtime.geometry.volumetric import VolumetricModel


def along(axis: str, component: str, *coefficients: float) -> PositionModel:
    """Return a polynomial in u = (p - 300 mm) / 300 mm: from -1 to 1 over the travel."""
    k = "XYZ".index(axis)
    powers = tuple(tuple(n * (i == k) for i in range(3)) for n in range(len(coefficients)))
    profile = PolynomialProfile(
        exponents=powers,  # type: ignore[arg-type]
        coefficients=coefficients,
        centre=(300.0, 300.0, 300.0),
        scale=(300.0, 300.0, 300.0),
        low=(-100.0, -100.0, -100.0),
        high=(700.0, 700.0, 700.0),
    )
    unit = "um" if component[1] in "XYZ" else "urad"
    return PositionModel(target=component, unit=unit, axis=axis, travel=(0.0, 600.0), profile=profile)  # type: ignore[arg-type]


def field_of(components: dict[str, Source], code: str = "XYZ", reference: float = 100.0) -> ErrorField:
    model = VolumetricModel(by_hand(code, components, reference=reference))
    return model.step(model.init(), {}, 0.0)[1]


def test_a_straight_error_is_taken_away_whole() -> None:
    """12 um in the middle and 30 um more per 300 mm: 100 um/m, and -8 um at P0 = 100 mm."""
    found = straight_lines(field_of({"EXX": along("X", "EXX", 12.0, 30.0), "EYY": 4.0}), (0.0, 50.0, 60.0))
    x, y, z = found.lines
    assert (x.axis, y.axis, z.axis) == ("X", "Y", "Z")
    assert x.deviation.offset == pytest.approx(-8.0)
    assert x.deviation.slope == pytest.approx(100.0)
    assert x.deviation.reference_position == 100.0
    assert x.correction.at(600.0) == pytest.approx(-42.0)
    assert y.correction.offset == pytest.approx(-4.0)
    assert str(z.correction.offset) == "0.0"
    assert found.before.largest == pytest.approx(np.hypot(42.0, 4.0))
    # the slope of 1e-4 acts on the correction too: 42 um times 1e-4
    assert found.after.largest == pytest.approx(42.0 * 1e-4, rel=1e-3)
    assert x.along.largest == pytest.approx(42.0 * 1e-4, rel=1e-3)


def test_the_remainder_of_a_parabola() -> None:
    """Least squares of u^2 on many stations: 1/3; it leaves 2/3 at the ends and 2/sqrt(45) rms."""
    found = straight_lines(field_of({"EZZ": along("Z", "EZZ", 0.0, 0.0, 9.0)}), (0.0, 0.0, 0.0), stations=2001)
    line = found.lines[2]
    assert line.deviation.slope == pytest.approx(0.0, abs=1e-9)
    assert line.deviation.offset == pytest.approx(3.0, rel=2e-3)
    assert line.along.largest == pytest.approx(6.0, rel=2e-3)
    assert line.along.rms == pytest.approx(9.0 * 2 / np.sqrt(45), rel=2e-3)
    # u^2 at the 9 points of the grid is 0, 1/16, 1/4 ...
    u = np.linspace(-1, 1, 9)
    assert line.volume.rms == pytest.approx(float(np.sqrt(np.mean((9 * u**2 - 3) ** 2))), rel=2e-3)
    assert found.after.rms == pytest.approx(line.volume.rms)


def test_it_is_the_best_line() -> None:
    field = field_of({"EXX": along("X", "EXX", 1.0, -7.0, 5.0, 20.0), "B0Z": 30.0}, "XFZY")
    at = (0.0, 150.0, 420.0)
    line = straight_lines(field, at, stations=31).lines[0]
    positions = np.linspace(0, 600, 31)
    points = np.column_stack([positions, np.full(31, 150.0), np.full(31, 420.0)])
    errors = field.error(points)[:, 0]
    slope, offset = np.polyfit(1e-3 * (positions - 100.0), errors, 1)
    assert line.deviation.slope == pytest.approx(slope)
    assert line.deviation.offset == pytest.approx(offset)
    left = errors - offset - slope * 1e-3 * (positions - 100.0)
    assert line.along.rms == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=1e-3)


def test_lines_know_nothing_of_the_other_axes() -> None:
    """A tilt of Y about Z makes an X error that grows with the lever; the line of X, laid at one Y, cannot know."""
    field = field_of({"ECY": along("Y", "ECY", 0.0, 50.0), "EXX": along("X", "EXX", 0.0, 20.0)}, "YXFZ")
    found = straight_lines(field, (300.0, 300.0, 300.0), tool=(0.0, 100.0, -50.0))
    x, y, _ = found.lines
    assert x.along.largest < 0.01
    # dx = -C Ly with Ly = 100 mm and C of up to 50 urad: 5 um at the ends of Y
    assert x.volume.largest == pytest.approx(5.0, abs=0.01)
    # dy = C Lx: at the X of the line Lx = 290 mm, its slope is known; elsewhere up to 300 mm off: 15 um
    assert y.along.largest < 0.01
    assert y.volume.largest == pytest.approx(15.0, abs=0.05)
    assert found.after.largest == pytest.approx(np.hypot(5.0, 15.0), abs=0.05)
    assert found.before.rms > 1.2 * found.after.rms


def test_by_exact_transforms_nearly_the_same() -> None:
    field = field_of({"ECX": 40.0, "EAY": along("Y", "EAY", 0.0, 30.0), "EXX": 8.0}, "XYFZ")
    first = straight_lines(field, (100.0, 200.0, 300.0))
    exactly = straight_lines(field, (100.0, 200.0, 300.0), exact=True)
    assert first.before.rms != exactly.before.rms
    assert exactly.before.rms == pytest.approx(first.before.rms, rel=1e-3)
    assert exactly.lines[0].deviation.slope == pytest.approx(first.lines[0].deviation.slope, abs=0.01)


def test_a_machine_of_two_axes_has_two_lines() -> None:
    found = straight_lines(field_of({"EXX": along("X", "EXX", 5.0, 3.0), "YOX": 7.0}, "XFZ"), (0.0, 0.0, 0.0))
    assert [line.axis for line in found.lines] == ["X", "Z"]
    # nothing of it can move along Y: that error stays
    assert found.after.largest == pytest.approx(7.0, abs=1e-3)
