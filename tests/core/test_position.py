"""PositionModel: profile + offset + slopes (C-04, C-05, C-24)."""

import math

import numpy as np
import pytest
from volumetricmachine import line

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.exceptions import InputError
from thermocomp.core.position import PositionModel, slope_unit
from thermocomp.core.profile import PolynomialProfile

PROFILE = PolynomialProfile(
    exponents=((1, 0, 0), (0, 1, 0)),
    coefficients=(0.01, -0.02),
    low=(0.0, 0.0, 0.0),
    high=(600.0, 500.0, 0.0),
)


def test_profile_offset_and_slopes_add_up() -> None:
    model = PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(50.0, 550.0),
        reference_position=300.0,
        profile=PROFILE,
        offset=line("EXX", "um", {"t": 1.0}),
        slopes=(line("EXX", "um/m", {"t": 1.0}), line("EXX", "um/m^2", {"t": 1.0})),
    )
    assert model.powers == (0, 1, 2)
    assert [m.unit for m in model.models] == ["um", "um/m", "um/m^2"]
    points = np.array([[500.0, 100.0, 0.0], [300.0, 0.0, 7.0], [580.0, 0.0, 0.0], [-10.0, 0.0, 0.0]])
    # q = 0.2, 0; beyond the travel the value at its end: q = 0.25, -0.25
    expected = [5 - 2 + 4 + 0.2 * 30 + 0.04 * 100, 3 + 4, 5.8 + 4 + 7.5 + 6.25, 0 + 4 - 7.5 + 6.25]
    factors = np.array([4.0, 30.0, 100.0])
    assert model.at(points, factors) == pytest.approx(expected)
    assert model.at(points.reshape(2, 2, 3), factors).shape == (2, 2)
    assert [float(model.at(p, factors)) for p in points] == pytest.approx(expected)
    with pytest.raises(ValueError, match="argument 2"):
        model.at(points, factors[:2])


def test_chen_has_no_offset_and_counts_from_zero() -> None:
    """C-24 with E-C6: k_1 of T3 = 10, T4 = 20, T6-T8 = 2, T7-T9 = 1 degC is 60.5 um/m: 30 um at 500 mm."""
    slope = line("EYY", "um/m", {"T3": 0.465, "T4": 2.705}, differences=[("T6", "T8", 3.675), ("T7", "T9", -5.589)])
    model = PositionModel(target="EYY", unit="um", axis="Y", travel=(0.0, 550.0), slopes=(slope,))
    assert model.powers == (1,)
    state, _ = slope.step(slope.init(), np.full(6, 20.0), 0.0)
    warm = {"T3": 30.0, "T4": 40.0, "T6": 23.0, "T8": 21.0, "T7": 25.0, "T9": 24.0}
    _, k_1 = slope.step(state, np.array([warm[i.name] for i in slope.inputs]), 60.0)
    assert float(k_1) == pytest.approx(60.5, abs=0.05)
    assert float(model.at(np.array([0.0, 500.0, 0.0]), np.array([k_1]))) == pytest.approx(30.0, abs=0.3)


def test_an_empty_model_is_zero_and_an_offset_alone_is_the_same_everywhere() -> None:
    empty = PositionModel(target="EAX", unit="urad", axis="X", travel=(0.0, 1.0))
    assert empty.at(np.zeros((2, 3)), np.zeros(0)).tolist() == [0.0, 0.0]
    flat = PositionModel(target="EAX", unit="urad", axis="X", travel=(0.0, 1.0), offset=line("EAX", "urad", {"t": 1.0}))
    values = flat.at(np.zeros((2, 2, 3)), np.array([6.0]))
    assert values.tolist() == [[6.0, 6.0], [6.0, 6.0]]
    values[0, 0] = 1.0  # nobody else's array
    assert flat.at(np.zeros(3), np.array([6.0])).shape == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": "mm"}, "unit 'mm': expected um or urad"),
        ({"axis": "A"}, "axis 'A': expected X, Y or Z"),
        ({"travel": (600.0, 0.0)}, "travel .* must increase"),
        ({"travel": (0.0, np.inf)}, "travel must be finite"),
        ({"reference_position": np.nan}, "reference_position must be finite"),
        ({"offset": line("EXX", "um/m", {"t": 1.0})}, "k_0 is in um/m, must be in um"),
        ({"slopes": (line("EXX", "um", {"t": 1.0}),)}, "k_1 is in um, must be in um/m"),
        ({"slopes": (line("EXX", "um/m", {"t": 1.0}),) * 2}, "k_2 is in um/m, must be in um/m\\^2"),
    ],
)
def test_models_that_are_none(change: dict[str, object], message: str) -> None:
    good = {"target": "EXX", "unit": "um", "axis": "X", "travel": (0.0, 600.0)}
    with pytest.raises(InputError, match=f"model of EXX: {message}"):
        PositionModel(**{**good, **change})  # type: ignore[arg-type]


def test_units_of_the_factors() -> None:
    assert [slope_unit("urad", k) for k in range(4)] == ["urad", "urad/m", "urad/m^2", "urad/m^3"]


def test_a_slope_counts_from_its_reference_position() -> None:
    """C-04, P-06: 2 um and 30 um/m, 400 mm from where they were learned; the correction is the opposite."""
    deviation = Deviation(2.0, 30.0, 100.0)
    assert deviation.at(500.0) == pytest.approx(14.0, rel=1e-14)
    assert Correction.opposing(deviation) == Correction(-2.0, -30.0, 100.0)
    assert math.copysign(1.0, Correction.opposing(Deviation(0.0)).offset) == 1.0
