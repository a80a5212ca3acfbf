"""Units change at the doors only."""

import pytest

from thermocomp.core.exceptions import UnitError
from thermocomp.core.units import find_unit, read_with_unit


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
        ("m/s2", "acceleration", 5.0, 5000.0),
        ("mm/s²", "acceleration", 800.0, 800.0),
    ],
)
def test_conversion(symbol: str, quantity: str, value: float, expected: float) -> None:
    u = find_unit(symbol, quantity)
    assert u.scale * value + u.shift == pytest.approx(expected, abs=1e-9)


def test_bare_mm_is_a_displacement() -> None:
    assert find_unit("mm").quantity == "displacement"


def test_unknown_unit_names_the_nearest() -> None:
    with pytest.raises(UnitError, match=r"unknown unit 'degcc'.*did you mean .*degC"):
        find_unit("degcc")


def test_wrong_quantity_says_what_it_measures() -> None:
    with pytest.raises(UnitError, match=r"'rpm' measures spindle_speed, not temperature; .*degC, K, degF"):
        find_unit("rpm", "temperature")


def test_unknown_quantity() -> None:
    with pytest.raises(UnitError, match="unknown quantity 'colour'"):
        find_unit("degC", "colour")


@pytest.mark.parametrize(
    ("text", "quantity", "value"),
    [
        ("250 mm", "position", 250.0),
        (" -1.5e-1m ", "position", -150.0),
        (".5 urad", "angle", 0.5),
        ("+3. µm", "displacement", 3.0),
        ("68 °F", "temperature", 20.0),
        ("1.5 h", "time", 5400.0),
        ("2 days", "time", 172800.0),
        ("1 day", "time", 86400.0),
        ("0.5 d", "time", 43200.0),
        ("6000 1/min", "spindle_speed", 6000.0),
        ("100 1/s", "spindle_speed", 6000.0),
    ],
)
def test_a_value_with_its_unit(text: str, quantity: str, value: float) -> None:
    assert read_with_unit(text, quantity) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", [250, 250.0, None, True, ["250 mm"], "", "mm", "250", "12,5 mm", "1 2 mm", "1.2.3 mm"])
def test_what_is_no_value_with_its_unit(text: object) -> None:
    assert read_with_unit(text, "position") is None


def test_a_value_with_a_wrong_unit_or_without_end() -> None:
    with pytest.raises(UnitError, match="'degC' measures temperature, not position"):
        read_with_unit("250 degC", "position")
    with pytest.raises(UnitError, match="the value is not a finite number"):
        read_with_unit("1e999 mm", "position")
