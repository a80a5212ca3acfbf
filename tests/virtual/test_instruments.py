"""What can be mounted on the virtual machines, and what it reads of the truth."""

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import TEST_POSITION
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.geometry import cold_profile
from thermocomp.virtual.instruments import Touch, displacement, mounting, thermometer
from thermocomp.virtual.kits import CENTRE, CHEN_PLACES, HWANG_PLACES, KITS, Kit, labelled
from thermocomp.virtual.probes import positioning
from thermocomp.virtual.toolsystem import SOURCES, RestingTool


def test_the_kits_belong_to_their_machines() -> None:
    centre, tool = MachiningCentre(), RestingTool()
    machines = {"centre": (centre.places, centre.observables, centre.model.inputs)}
    machines["tool"] = (tool.places, tool.observables, tuple(SOURCES))
    assert {i for shares in SOURCES.values() for i in shares} <= {*tool.model.inputs}
    for name, kit in KITS.items():
        places, observables, inputs = machines[name]
        assert {p for p in (*kit.places, *kit.inner) if p not in kit.air} <= set(places)
        assert set(kit.observables) <= set(observables)
        assert set(kit.loads) <= set(inputs)
        for names in kit.outfits.values():
            assert set(names) <= set(kit.places)
        for names in kit.nests.values():
            assert all(set(kit.probe(n).reads) <= set(observables) for n in names)
    assert CENTRE.top_speed == centre.heat.top_speed


def test_the_outfits_of_the_papers() -> None:
    assert len(CENTRE.outfits["all"]) == 24  # T-01
    assert len(HWANG_PLACES) == 14  # H-08
    assert len(CHEN_PLACES) == 8  # C-11: dT5 is the mean of the last four
    assert len(KITS["tool"].outfits["all"]) == 9  # W-08
    assert labelled(["chen", "table"], CENTRE.outfits) == {p: p for p in (*CHEN_PLACES, "table")}
    assert labelled({"t2": "table"}, CENTRE.outfits) == {"t2": "table"}


def read(kit: Kit, probe: str, **truth: float) -> float:
    return sum(weight * truth.get(name, 0.0) for name, weight in kit.probe(probe).reads.items())


def test_the_nest_measures_displacements_and_tilts() -> None:
    truth = {"x": 1.0, "y": 2.0, "z": 3.0, "a": 40.0, "b": -30.0}
    assert [read(CENTRE, n, **truth) for n in ("x1", "y1", "z")] == [1.0, 2.0, 3.0]
    # 100 mm behind the tip, a positive rotation about Y has moved the bar to +X, one about X to -Y
    assert read(CENTRE, "x2", **truth) == pytest.approx(1.0 - 3.0)
    assert read(CENTRE, "y2", **truth) == pytest.approx(2.0 - 4.0)


def test_a_laser_reads_between_the_stations_from_its_first_position() -> None:
    profile = {"yy@0": 1.0, "yy@50": 3.0, "yy@100": 7.0, "yy@550": 20.0}
    assert [read(CENTRE, f"y_laser_{p}", **profile) for p in (0, 50, 75, 100, 550)] == [0.0, 2.0, 4.0, 6.0, 19.0]
    assert CENTRE.probe("x_laser_0").reads == {}
    assert positioning("x", 600.0) == {"xx@600": 1.0}
    assert positioning("z", 130.0) == pytest.approx({"zz@100": 0.7, "zz@200": 0.3})


def test_cold_profile_is_that_of_the_paper() -> None:
    expected = {0: 0.24, 50: 8.48, 100: 7.74, 250: -2.24, 500: -15.83, 550: -18.53}  # C-22
    for position, value in expected.items():
        assert cold_profile(position) == pytest.approx(value, abs=0.01)
        assert CENTRE.probe(f"y_laser_{position}").cold == pytest.approx(value, abs=0.01)
    assert CENTRE.probe("x_laser_100").cold == 0.0


def test_the_deviation_at_a_position_counts_from_the_test_position() -> None:
    line = {f"zz@{p}": 0.01 * p for p in range(0, 601, 100)} | {"z": 5.0}
    assert read(CENTRE, f"z_at_{TEST_POSITION['z']}", **line) == pytest.approx(5.0)
    assert read(CENTRE, "z_at_600", **line) == pytest.approx(5.0 + 0.01 * (600.0 - TEST_POSITION["z"]))


def test_a_sensor_on_a_surface_feels_the_air() -> None:
    felt = thermometer(CENTRE, "here", "housing", perfect=False, noise=None)
    contact = felt.reads["housing"]
    assert 0.88 <= contact <= 0.97
    assert felt.air == pytest.approx((1.0 - contact, 0.0, 0.0))
    assert felt.sensor.channel.name == "t_here_C"
    assert thermometer(CENTRE, "c", "coolant", perfect=False, noise=None).reads == {"coolant": 1.0}
    assert thermometer(CENTRE, "h", "housing", perfect=True, noise=None).air == (0.0, 0.0, 0.0)
    top = thermometer(CENTRE, "air_top", "air_top", perfect=False, noise=None)
    assert top.air == pytest.approx((1.0, 1.4, 0.0))
    assert mounting("housing") == mounting("housing") != mounting("table")


def test_only_a_calculation_looks_into_a_shaft() -> None:
    assert thermometer(CENTRE, "t3", "shaft", perfect=True, noise=None).reads == {"shaft": 1.0}
    with pytest.raises(InputError, match="'shaft' is on a rotating part"):
        thermometer(CENTRE, "t3", "shaft", perfect=False, noise=None)


def test_the_yaw_of_y_is_an_angle() -> None:
    yaw = displacement("p", CENTRE.probe("ECY_200"), perfect=False)
    assert (yaw.sensor.channel.name, yaw.sensor.channel.quantity) == ("p_urad", "angle")


def test_a_perfect_probe_has_no_errors() -> None:
    sensor = displacement("s4", CENTRE.probe("tip"), perfect=True).sensor
    assert (sensor.channel.name, sensor.noise, sensor.drift, sensor.resolution) == ("s4_um", 0.0, 0.0, 0.0)
    assert displacement("s4", CENTRE.probe("tip"), perfect=False).sensor.noise > 0.0
    assert CENTRE.probe({"z": 1.0, "zz@200": -1.0}).reads == {"z": 1.0, "zz@200": -1.0}


def test_a_laser_of_six_degrees_reads_the_components() -> None:
    assert len(CENTRE.nests["X_six"]) == 6 * 7
    assert len(CENTRE.nests["Y_six"]) == 6 * 12
    assert CENTRE.nests["EXX"] == tuple(f"EXX_{p}" for p in range(0, 601, 100))
    # a way counts from where the laser was set to zero, again in each profile
    assert CENTRE.probe("EYY_550").reads == {"EYY@550": 1.0, "EYY@250": -1.0}
    assert CENTRE.probe("EYY_550").cold == pytest.approx(-18.53 + 2.24, abs=0.01)
    assert CENTRE.probe("EXX_300").reads == {}
    assert CENTRE.probe("EAX_300").reads == {}
    assert CENTRE.probe("EAX_300").cold == 0.0
    # 300 mm behind the test position Z is swung by the roll of X: a table that tilts moves what stands on it
    assert CENTRE.probe("EYZ_600").reads == {"EYZ@600": 1.0, "EYZ@300": -1.0, "EAX@300": pytest.approx(-0.3)}
    assert CENTRE.probe("EZY_350").reads["EAX@300"] == pytest.approx(0.1)
    assert CENTRE.probe("EZY_350").reads["EAZ@300"] == pytest.approx(0.1)
    assert CENTRE.probe("EBZ_600").reads == {}
    assert CENTRE.probe("EBZ_600").cold != 0.0
    between = CENTRE.probe("EAY_75").reads
    assert sum(between.values()) == pytest.approx(0.0)
    assert {"EAY@50", "EAY@100", "EAY@250"} < set(between)
    # with Z elsewhere the roll of X has a lever
    roll: dict[str, object] = {"EAX@0": pytest.approx(-0.3), "EAX@300": pytest.approx(0.3)}
    assert CENTRE.probe("EYX_z600_0").reads == {**CENTRE.probe("EYX_0").reads, **roll}
    assert not CENTRE.probe("EYX_0").zeroed
    assert CENTRE.probe("z").zeroed
    assert CENTRE.probe("C0Y").cold == 14.0
    for name, unit, noise in (("EXX_0", "um", 0.3), ("ECX_0", "urad", 0.5), ("A0Z", "urad", 0.5)):
        sensor = displacement(name, CENTRE.probe(name), perfect=False).sensor
        assert (sensor.channel.name, sensor.noise) == (f"{name}_{unit}", noise)
    assert displacement("z", CENTRE.probe("z"), perfect=False).sensor.noise == 0.15
    for wrong, message in (
        ("EYY_600", "Y = 600 mm is beyond"),
        ("EYX_z700_0", "Z = 700 mm is beyond"),
        ("EYY_z0_100", "only the errors of X can"),
        ("EXW_0", "no probe 'EXW_0'"),
    ):
        with pytest.raises(InputError, match=message):
            CENTRE.probe(wrong)
    with pytest.raises(InputError, match="no probe 'EXX_0'"):
        KITS["tool"].probe("EXX_0")


def test_what_is_not_there_is_refused_and_the_nearest_told() -> None:
    with pytest.raises(InputError, match=r"no place 'hosing'; the nearest are housing"):
        CENTRE.place("hosing", perfect=False)
    with pytest.raises(InputError, match=r"no probe 'w'; there are x1, x2"):
        CENTRE.probe("w")
    with pytest.raises(InputError, match=r"Y = 600 mm is beyond the travel from 0 to 550 mm"):
        CENTRE.probe("y_laser_600")
    with pytest.raises(InputError, match=r"no observable 'xx@50'"):
        CENTRE.probe({"xx@50": 1.0})
    with pytest.raises(InputError, match="no probe 'z_at_0'"):
        KITS["tool"].probe("z_at_0")
    with pytest.raises(InputError, match="'t 2' cannot name a channel"):
        labelled({"t 2": "table"}, {})


def test_the_points_of_an_artefact() -> None:
    touch = Touch(1800.0, {"p": (400.0, 250.0, 300.0), "high": (300.0, 400.0, 300.0)})
    x, y, z, *high = touch.instruments(perfect=False)
    assert high[1].reads == {"y": 1.0, "yy@400": 1.0, "yy@250": -1.0}
    assert high[2].reads == {"z": 1.0, "zy@400": 1.0, "zy@250": -1.0}  # the column leans
    assert [i.sensor.channel.name for i in (x, y, z)] == ["x_p_um", "y_p_um", "z_p_um"]
    assert x.reads == {"x": 1.0, "xx@400": 1.0, "xx@300": -1.0}
    assert y.reads == {"y": 1.0}
    assert z.reads == {"z": 1.0}
    assert x.sensor.noise == 0.5
    assert touch.instruments(perfect=True)[0].sensor.noise == 0.0
    for wrong in ({}, {"p": (700.0, 0.0, 0.0)}, {"p q": (0.0, 0.0, 0.0)}):
        with pytest.raises(InputError):
            Touch(1800.0, wrong)
    with pytest.raises(InputError, match="positive"):
        Touch(0.0, {"p": (0.0, 0.0, 0.0)})


def test_a_probing_cycle_waits_until_the_spindle_stands() -> None:
    touch = Touch(300.0, {"p": (0.0, 0.0, 0.0)})
    time = np.arange(0.0, 1200.0, 60.0)
    always = touch.rows(time, np.ones(20, dtype=np.bool_))
    assert np.flatnonzero(always).tolist() == [0, 5, 10, 15]
    still = np.ones(20, dtype=np.bool_)
    still[3:12] = False
    # the cycle due at 300 s waits until 720 s, the next one is due at 900 s
    assert np.flatnonzero(touch.rows(time, still)).tolist() == [0, 12, 15]
    assert not touch.rows(time, np.zeros(20, dtype=np.bool_)).any()
