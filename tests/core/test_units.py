"""Units change at the doors only."""

import pytest

from thermocomp.core.exceptions import UnitError
from thermocomp.core.units import unit


@pytest.mark.parametrize(
    ("symbol", "quantity", "value", "expected"),
    [
        ("K", "temperature", 293.15, 20.0),
        ("degF", "temperature", 68.0, 20.0),
        ("°C", "temperature", 20.0, 20.0),
        ("mm", "displacement", 0.05, 50.0),
        ("mm", "position", 500.0, 500.0),
        ("m", "position", 0.5, 500.0),
        ("rpm", "spindle_speed", 1250.0, 1250.0),
        ("Hz", "spindle_speed", 20.0, 1200.0),
        ("h", "time", 2.0, 7200.0),
        ("arcsec", "angle", 1.0, 4.84813681109536),
        ("in", "displacement", 0.001, 25.4),
    ],
)
def test_conversion(symbol: str, quantity: str, value: float, expected: float) -> None:
    u = unit(symbol, quantity)
    assert u.scale * value + u.shift == pytest.approx(expected, abs=1e-9)


def test_bare_mm_is_a_displacement() -> None:
    assert unit("mm").quantity == "displacement"


def test_unknown_unit_names_the_nearest() -> None:
    with pytest.raises(UnitError, match=r"unknown unit 'degc'.*did you mean .*degC"):
        unit("degc")


def test_wrong_quantity_says_what_it_measures() -> None:
    with pytest.raises(UnitError, match=r"'rpm' measures spindle_speed, not temperature; .*degC, K, degF"):
        unit("rpm", "temperature")


def test_unknown_quantity() -> None:
    with pytest.raises(UnitError, match="unknown quantity 'colour'"):
        unit("degC", "colour")
