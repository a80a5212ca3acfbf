"""Which model is for which axis."""

from dataclasses import replace

import pytest
from driftmodels import judged, lags

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.nc.thermal.stations import Station, stations


def models(*targets: str) -> list[ErrorModel]:
    return [judged(lags(t), 2.0) for t in targets]


def places(found: list[Station]) -> dict[str, str]:
    return {s.model.target: str(s) for s in found}


@pytest.mark.parametrize(
    ("targets", "wanted"),
    [
        (("z_um",), ["Z"]),
        (("x", "Y_um", "z"), ["X", "Y", "Z"]),
        (("z_at_0_um", "z_at_200_um"), ["Z at Z 0 mm", "Z at Z 200 mm"]),
        (("z_at_-12.5", "z_at_200mm"), ["Z at Z -12.5 mm", "Z at Z 200 mm"]),
        (("x_at_z0", "x_at_Z300_um", "z"), ["X at Z 0 mm", "X at Z 300 mm", "Z"]),
    ],
)
def test_names_that_say_it(targets: tuple[str, ...], wanted: list[str]) -> None:
    assert places(stations(models(*targets))) == dict(zip(targets, wanted, strict=True))


def test_stations_are_ordered() -> None:
    found = stations(models("z_at_400", "x", "z_at_-10", "z_at_90"))
    assert [str(s) for s in found] == ["X", "Z at Z -10 mm", "Z at Z 90 mm", "Z at Z 400 mm"]


def test_the_user_says_it() -> None:
    known = models("ch1_um", "low", "high", "z")
    assert places(stations(known, ["ch1=Z"])) == {"ch1_um": "Z"}
    assert places(stations(known, ["z", " low = x at z 0 mm", "high=X at Z 0.3 m"])) == {
        "low": "X at Z 0 mm",
        "high": "X at Z 300 mm",
        "z": "Z",
    }


@pytest.mark.parametrize(
    ("targets", "texts", "says"),
    [
        (("ch3", "z"), [], r"'ch3' does not state which axis.*ch3=Z.*targets are ch3, z"),
        (("x_at_200", "x_at_0"), [], "'x_at_200' does not state"),
        (("ch3", "z"), ["ch4=Z"], "no model of 'ch4'.*ch3"),
        (("ch3",), ["ch3=Z", "ch3=X"], "ch3 was given before"),
        (("ch3",), ["ch3=A"], "expected an axis"),
        (("ch3",), ["ch3=Z at Z 200"], "has no unit; write 200 mm"),
        (("ch3",), ["ch3=Z at Z 200 degC"], "measures temperature"),
        (("z_at_200",), [], "one model at a position.*z_at_200=Z"),
        (("z_um", "ch3"), ["z_um", "ch3=Z"], "several models"),
        (("z_um", "z_at_200"), [], "several models"),
        (("z_at_200", "z_at_200_um"), ["z_at_200", "z_at_200_um"], "same position"),
        (("a", "b"), ["a=Z at Z 0 mm", "b=Z at X 10 mm"], "along a single axis"),
        (("z", "z"), [], "two models for the same target"),
        ((), [], "no model"),
    ],
)
def test_what_is_refused(targets: tuple[str, ...], texts: list[str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        stations(models(*targets), texts)


def test_a_station_is_in_um_and_along_an_axis() -> None:
    with pytest.raises(InputError, match="predicts urad"):
        Station("Z", replace(lags(), unit="urad"))
    with pytest.raises(InputError, match="axes are X, Y and Z"):
        Station("A", lags())
    with pytest.raises(InputError, match="axes are X, Y and Z"):
        Station("X", lags(), "B", 1.0)
    with pytest.raises(InputError, match="finite"):
        Station("X", lags(), "Z", float("nan"))
