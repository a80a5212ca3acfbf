"""Machine, axes, channels, corrections and limits refuse nonsense where they are made."""

from collections.abc import Iterator, Mapping

import pytest

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.machine import Axis, Channel, Machine
from thermocomp.core.ports import CorrectionSink, TemperatureSource
from thermocomp.core.reading import Reading
from thermocomp.core.structure import Structure


def test_machine_carries_its_reference_temperature() -> None:
    machine = Machine("mill", Structure.parse("w X' b t"), (Axis("X", (0.0, 500.0)),))
    assert machine.reference_temperature == 20.0


def test_axis_refuses_falling_travel_and_other_letters() -> None:
    with pytest.raises(InputError, match="must rise"):
        Axis("X", (500.0, 0.0))
    with pytest.raises(InputError, match="expected X, Y or Z"):
        Axis("U", (0.0, 1.0))


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


@pytest.mark.parametrize(
    "bad", [{"magnitude": 0.0}, {"rate": -1.0}, {"reading_age": float("nan")}, {"dead_band": -1.0}]
)
def test_limits_must_limit(bad: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Limits(**bad)


class Replaying:
    """A source that plays readings back, and a sink that keeps what it is given."""

    def __init__(self, readings: list[Reading]) -> None:
        self.kept = readings
        self.applied: list[Mapping[str, Correction]] = []

    def readings(self) -> Iterator[Reading]:
        yield from self.kept

    def apply(self, corrections: Mapping[str, Correction]) -> None:
        self.applied.append(corrections)


def test_ports_are_filled_by_shape_not_by_inheritance() -> None:
    both = Replaying([Reading(0.0, {"t": 20.0})])
    assert isinstance(both, TemperatureSource)
    assert isinstance(both, CorrectionSink)
    assert not isinstance(Limits(), TemperatureSource)
    for reading in both.readings():
        both.apply({"z": Correction(-reading.values["t"])})
    assert both.applied == [{"z": Correction(-20.0)}]
