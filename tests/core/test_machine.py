"""Machine, axes, channels, corrections and limits refuse nonsense where they are made."""

from typing import Any

import pytest
from volumetricmachine import line

from thermocomp.core.components import COMPONENTS
from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError, SettingError, UnitError
from thermocomp.core.machine import Axis, Channel, Machine, Source
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile, SplineProfile
from thermocomp.core.structure import Structure


def test_machine_carries_its_reference_temperature() -> None:
    machine = Machine("mill", Structure.parse("w X' b t"), (Axis("X", (0.0, 500.0)),))
    assert machine.reference_temperature == 20.0


def test_axis_refuses_falling_travel_and_other_letters() -> None:
    with pytest.raises(InputError, match="must be less than"):
        Axis("X", (500.0, 0.0))
    with pytest.raises(InputError, match="expected X, Y or Z"):
        Axis("U", (0.0, 1.0))


def test_axis_refuses_numbers_that_are_none() -> None:
    nan, inf = float("nan"), float("inf")
    bad: dict[str, Any] = {
        "travel": (0.0, inf),
        "measured_at": (0.0, nan, 0.0),
        "measured_tool": (0.0, inf, 0.0),
        "reference_position": nan,
    }
    for key, value in bad.items():
        with pytest.raises(SettingError, match="finite number") as caught:
            Axis("X", **{"travel": (0.0, 1.0), key: value})
        assert caught.value.path == (key,)


def test_axis_was_measured_on_one_of_its_sides() -> None:
    assert Axis("X", (0.0, 1.0)).measured_on == "tool"
    with pytest.raises(SettingError, match="'table': must be 'tool' or 'workpiece'") as caught:
        Axis("X", (0.0, 1.0), measured_on="table")  # type: ignore[arg-type]
    assert caught.value.path == ("measured_on",)


XZ = (Axis("X", (0.0, 500.0)), Axis("Z", (0.0, 300.0)))


def profiled(axis: str, unit: str = "um") -> PositionModel:
    return PositionModel(target="e", unit=unit, axis=axis, travel=(0.0, 1.0))  # type: ignore[arg-type]


def splined(axis: str, along: str, start: float = 0.0) -> PositionModel:
    profile = SplineProfile(axis=along, knots=(start, start + 100.0), pieces=((0.0, 1.0, 0.0, 0.0),))
    return PositionModel(target="e", unit="um", axis=axis, travel=(0.0, 1.0), profile=profile)


def sloped(start: float) -> PositionModel:
    slope = line("EXX", "um/m", {"t": 1.0})
    return PositionModel(target="e", unit="um", axis="X", travel=(start, start + 100.0), slopes=(slope,))


def bent(axis: int) -> PositionModel:
    """Return a model along X whose profile depends on another axis too."""
    exponents = ((1, 0, 0), (1 if axis == 0 else 0, 1 if axis == 1 else 0, 1 if axis == 2 else 0))
    profile = PolynomialProfile(
        exponents=exponents, coefficients=(1.0, 1.0), low=(0.0, 0.0, 0.0), high=(500.0, 100.0, 100.0)
    )
    return PositionModel(target="e", unit="um", axis="X", travel=(0.0, 500.0), profile=profile)


def test_ranges_that_reach_the_travel_are_enough() -> None:
    for source in (splined("X", "X", 500.0), splined("X", "X", -100.0), sloped(499.0), bent(2)):
        Machine("mill", Structure.parse("XFZ"), XZ, {"EXX": source})
    assert bent(2).ranges() == (("profile", "X", (0.0, 500.0)), ("profile", "Z", (0.0, 100.0)))
    assert sloped(1.0).ranges() == (("slope", "X", (1.0, 101.0)),)


def test_every_component_may_be_told() -> None:
    """C-01, C-02: 18 by models of position, 14 by numbers."""
    axes = (*XZ, Axis("Y", (0.0, 400.0)))
    sources = {c.code: 1.0 if c.depends_on is None else profiled(c.depends_on, c.unit) for c in COMPONENTS}
    machine = Machine("mill", Structure.parse("XFZY"), axes, sources)
    assert len(machine.components) == 32
    assert sum(isinstance(s, PositionModel) for s in machine.components.values()) == 18
    assert machine.axis("Y").travel == (0.0, 400.0)


@pytest.mark.parametrize(
    ("code", "source", "message"),
    [
        ("EXQ", 1.0, "there is no component 'EXQ'"),
        ("EXY", 1.0, "the machine has no axis Y"),
        ("C0Y", 1.0, "squareness of Y to X: the machine has no axis Y"),
        ("XOY", 1.0, "the machine has no axis Y"),
        ("EXX", float("nan"), "must be a finite number"),
        ("EAX", line("EAX", "um", {"t": 1.0}), "the model is in um; roll of X is in urad"),
        ("EAX", profiled("X"), "the model is in um; roll of X is in urad"),
        ("B0Z", profiled("Z", "urad"), "does not depend on a position"),
        ("EXX", profiled("Z"), "expected a model along X, found one along Z"),
        ("EXX", True, "True: must be a number or a model"),
        ("EXX", "1 um", "'1 um': must be a number or a model"),
        ("EXX", 10_001.0, "10001 um is more than 10 mm: check the unit"),
        ("EAX", -20_000.0, "-20000 urad is more than 10 mrad: check the unit"),
        ("EXX", splined("X", "Z"), "positioning of X: its profile is along Z, but its model is along X"),
        (
            "EXX",
            splined("X", "X", 501.0),
            "its profile is known for X = 501 to 601 mm, but the axis travels from 0 to 500 mm",
        ),
        ("EXX", sloped(600.0), "its slope is known for X = 600 to 700 mm, but the axis travels from 0 to 500 mm"),
        ("EXX", bent(1), "its profile depends on axis Y, which this machine does not have"),
    ],
)
def test_machine_refuses_a_source_that_does_not_fit(code: str, source: Source, message: str) -> None:
    with pytest.raises(SettingError, match=message) as caught:
        Machine("mill", Structure.parse("XFZ"), XZ, {"EXZ": 1.0, code: source})
    assert caught.value.path == ("components", code)


def test_machine_refuses_axes_that_are_not_its_structure() -> None:
    for axes, wrong in (((*XZ, Axis("Y", (0.0, 1.0))), "Y"), (XZ[:1], "Z"), ((*XZ, XZ[0]), "X")):
        with pytest.raises(SettingError, match=f"axis {wrong} ") as caught:
            Machine("mill", Structure.parse("XFZ"), axes)
        assert caught.value.path == ("axes", wrong)
    with pytest.raises(InputError, match="machine mill: there is no axis 'Y'; there are X, Z"):
        Machine("mill", Structure.parse("XFZ"), XZ).axis("Y")


def test_machine_refuses_numbers_that_are_none() -> None:
    nan = float("nan")
    for bad in ({"tool": (0.0, 0.0, nan)}, {"spindle_tool": (nan, 0.0, 0.0)}, {"reference_temperature": nan}):
        with pytest.raises(SettingError, match="must be finite") as caught:
            Machine("mill", Structure.parse("XFZ"), XZ, **bad)
        assert caught.value.path == tuple(bad)


def test_channel_refuses_a_unit_that_does_not_measure_its_quantity() -> None:
    with pytest.raises(UnitError):
        Channel("t1", "temperature", "um")


def test_correction_is_minus_the_deviation_everywhere() -> None:
    grown = Deviation(offset=10.0, slope=20.0, reference_position=100.0)
    correction = Correction.opposing(grown)
    assert grown.at(600.0) == pytest.approx(10.0 + 20.0 * 0.5)
    for position in (0.0, 100.0, 600.0):
        assert correction.at(position) == pytest.approx(-grown.at(position))


def test_a_zero_deviation_gives_a_positive_zero() -> None:
    assert str(Correction.opposing(Deviation(0.0)).offset) == "0.0"


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("key", ["offset", "slope", "reference_position"])
def test_a_correction_is_of_finite_numbers(key: str, bad: float) -> None:
    numbers = {"offset": 0.0, key: bad}
    with pytest.raises(InputError, match=f"deviation: .* {bad}.*: must be finite numbers"):
        Deviation(**numbers)
    with pytest.raises(InputError, match=f"correction: .* {bad}.*: must be finite numbers"):
        Correction(**numbers)


@pytest.mark.parametrize(
    "bad", [{"magnitude": 0.0}, {"rate": -1.0}, {"reading_age": float("nan")}, {"dead_band": -1.0}]
)
def test_limits_must_limit(bad: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Limits(**bad)
