"""The experiments that come with the package have the papers' shapes, and look like measurements."""

import math
import re
from functools import cache
from itertools import combinations, groupby

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.recordings.recording import Recording
from thermocomp.virtual import experiments
from thermocomp.virtual.datasets import EXPERIMENTS, find_experiment, record
from thermocomp.virtual.experiments import SimulatedTest, simulate
from thermocomp.virtual.kits import CHEN_PLACES, HWANG_PLACES

FloatArray = NDArray[np.float64]
HOUR, MINUTE = 3600.0, 60.0
PROMISED = {"chen1996", "chen1996-law", "chen1996-new", "chen1996-slope"}
PROMISED |= {"wessel-fem", "wessel-tool", "wessel-milling", "wessel-sets"}
PROMISED |= {"hwang", "stepwise2017", "stepwise2017-online", "precompensation", "precompensation-cut"}
PROMISED |= {"etve", "iso230-spindle", "iso230-axis", "probing", "random", "demo", "volumetric", "volumetric-new"}


@cache
def simulated(experiment: str, seed: int = 0) -> tuple[SimulatedTest, ...]:
    return tuple(simulate(EXPERIMENTS[experiment], seed=seed))


def columns(test: SimulatedTest, *quantities: str) -> FloatArray:
    return test.values[:, [k for k, c in enumerate(test.channels) if c.quantity in quantities]]


def column(test: SimulatedTest, name: str) -> FloatArray:
    return test.values[:, [c.name for c in test.channels].index(name)]


def names(test: SimulatedTest, quantity: str) -> list[str]:
    return [c.name for c in test.channels if c.quantity == quantity]


def shapes(experiment: str) -> list[tuple[int, int, int]]:
    """Rows, temperatures and displacements of each test."""
    return [(len(t.time), len(names(t, "temperature")), len(t.displacements)) for t in simulated(experiment)]


def test_the_promised_experiments_are_there() -> None:
    assert set(EXPERIMENTS) == PROMISED
    assert len(EXPERIMENTS) == len(PROMISED)
    assert all(e.description and "\n" not in e.description for e in EXPERIMENTS.values())


@pytest.mark.parametrize("experiment", sorted(PROMISED))
def test_every_experiment_is_well_formed(experiment: str) -> None:
    for test in simulated(experiment):
        assert test.values.shape == (len(test.time), len(test.channels))
        assert test.truth.shape == (len(test.time), len(test.displacements))
        assert test.time[0] == 0.0
        np.testing.assert_allclose(np.diff(test.time), test.time[1])
        assert len({c.name for c in test.channels}) == len(test.channels)
        temperatures = columns(test, "temperature")
        assert temperatures.min() > 10.0
        assert temperatures.max() < 75.0
        # the probes say the truth but for their noise and drift
        errors = columns(test, "displacement", "angle") - test.truth
        said = np.isfinite(errors)
        assert said.all() == (experiment != "probing")
        assert np.abs(errors[said]).max() < 2.5
        assert np.isfinite(test.truth).all()
        # all count from the start but what sees the shape of the cold guides, too
        shaped = [re.match(r"._laser|E[XYZABC][XYZ]_|C0Y|B0Z|A0Z", c.name) is not None for c in test.displacements]
        np.testing.assert_array_equal(test.truth[0][~np.array(shaped)], 0.0)
        assert len(names(test, "spindle_speed")) == (0 if experiment in ("wessel-tool", "wessel-sets") else 1)


def test_a_test_does_not_depend_on_its_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """X-01: it is computed block by block; sensors, weather and machine go on where the last one ended."""
    whole = record("precompensation-cut", seed=3)[0].table
    monkeypatch.setattr(experiments, "BLOCK", 7)
    np.testing.assert_allclose(record("precompensation-cut", seed=3)[0].table, whole, rtol=0, atol=1e-9)


def test_shapes_are_those_of_the_papers() -> None:
    assert shapes("chen1996") == [(162, 24, 5)] * 5  # 810 rows
    assert shapes("chen1996-slope") == [(51, 24, 24)]  # twelve displacements, twelve angles
    assert shapes("chen1996-law") == [(85, 8, 12)] * 3  # five runs make one of 51 profiles
    assert shapes("wessel-fem") == [(199, 3, 2)] * 2
    assert [s[1:] for s in shapes("wessel-tool")] == [(9, 3)] * 2
    assert shapes("wessel-milling") == [(81, 3, 1)] * 5
    assert [s[1:] for s in shapes("wessel-sets")] == [(9, 3)] * 23
    assert shapes("hwang") == [(37, 14, 1)]
    assert [s[1:] for s in shapes("stepwise2017") + shapes("stepwise2017-online")] == [(24, 1)] * 2
    assert [s[2] for s in shapes("precompensation") + shapes("precompensation-cut")] == [4] * 3
    assert [s[2] for s in shapes("iso230-axis")] == [7, 12, 7]
    ((rows, sensors, displacements),) = shapes("demo")
    assert rows <= 8000
    assert (sensors, displacements) == (16, 5)


def test_chen_protocol() -> None:
    for test, speed in zip(simulated("chen1996"), (600, 1000, 1500, 2100, 2600), strict=True):
        rpm = column(test, "spindle_rpm")
        assert test.name == f"chen1996-{speed}"
        assert set(rpm) == {0.0, speed}
        assert rpm[0] == rpm[1] == 0.0
        assert np.count_nonzero(rpm) * 360.0 == 6 * HOUR
        assert np.count_nonzero(rpm[-100:]) == 0  # 10 h of cooling
        assert (len(rpm), test.time[1]) == (162, 360.0)
        assert all(f"t_{place}_C" in names(test, "temperature") for place in CHEN_PLACES)
    constant, drawn = simulated("chen1996-new")
    assert np.count_nonzero(column(constant, "spindle_rpm") == 1250.0) * 360.0 == 6.5 * HOUR
    assert (constant.time[1], constant.time[-1]) == (360.0, 12.1 * HOUR)
    assert column(constant, "spindle_rpm")[:3].tolist() == [0.0, 0.0, 1250.0]
    assert (drawn.time[1], drawn.time[-1]) == (180.0, pytest.approx(9.05 * HOUR))
    rpm = column(drawn, "spindle_rpm")[2:].reshape(12, 15)
    assert (np.ptp(rpm[:, :10], axis=1) == 0.0).all()
    assert (rpm[:, :10] > 0).all()
    assert (rpm[:, 10:] == 0).all()
    assert len(set(rpm[:, 0])) > 4
    assert {*rpm[:, 0]} <= {600.0 + 50.0 * k for k in range(41)}


def test_stepwise_protocol() -> None:
    """T-01: 24 temperatures at different places, the error of X; four speeds, the machine cools down after each."""
    (test,) = simulated("stepwise2017")
    assert len({*names(test, "temperature")}) == 24
    assert names(test, "displacement") == ["x1_um"]
    runs = [(speed, len([*rows]) / 12) for speed, rows in groupby(column(test, "spindle_rpm")[1:].tolist())]
    assert runs == [(0, 0.5), (1500, 3.5), (0, 2.5), (3000, 3.5), (0, 2.5), (800, 3.5), (0, 2.5), (2200, 3.5), (0, 2.5)]
    assert test.time[1] == HOUR / 12


def test_hwang_protocol() -> None:
    orders = set()
    for seed in range(3):
        (test,) = simulated("hwang", seed)
        assert names(test, "temperature") == [f"t_{p}_C" for p in HWANG_PLACES]
        rpm, feed = column(test, "spindle_rpm"), column(test, "feed_mm_min")
        assert test.time[-1] == 6 * HOUR
        assert set(zip(rpm.tolist(), feed.round().tolist(), strict=True)) == {(0, 0), (600, 508), (3000, 2006)}
        assert (rpm[1:].reshape(12, 3) == rpm[1::3, None]).all()  # 30 min each
        assert all(np.count_nonzero(rpm[1::3] == speed) == 4 for speed in (0, 600, 3000))
        orders.add(tuple(rpm[1::3]))
    assert len(orders) == 3


def test_wessel_calculated_spindle() -> None:
    for test in simulated("wessel-fem"):
        assert test.time[1] == 100.0
        assert names(test, "temperature") == ["t_t2_C", "t_t3_C", "t_t4_C"]
        assert names(test, "displacement") == ["s3_um", "s4_um"]
        np.testing.assert_array_equal(columns(test, "displacement"), test.truth)


def test_wessel_heated_tool() -> None:
    training, test = simulated("wessel-tool")
    assert names(training, "temperature") == [f"t_t{k}_C" for k in range(1, 10)]
    assert np.ptp(column(training, "t_t9_C")) < 2.0  # the room
    heating = np.gradient(column(training, "t_t8_C"))
    assert heating[100:380].mean() > 0 > heating[400:560].mean()  # the break near row 400
    assert heating[580:900].mean() > 0
    assert np.gradient(column(test, "t_t8_C"))[100:780].mean() > 0
    # three sources that act apart from each other (W-15): heater, hot-air gun, soldering iron
    for planned in EXPERIMENTS["wessel-tool"].tests:
        acting = {frozenset(s.loads or {}) for s in planned.segments}
        assert acting == {
            frozenset(s) for s in ((), ("heater",), ("hot_air",), ("heater", "hot_air"), ("heater", "tip"))
        }
    # "a sufficient range of values in the learning series"
    assert (training.truth.max(axis=0) > test.truth.max(axis=0)).all()
    passed = column(training, "t_t8_C")
    assert passed.min() < 30.0
    assert passed.max() > 50.0


def test_wessel_three_mountings_in_a_thermal_cell() -> None:
    """W-10, W-15: 23 data sets of three mountings, in rooms with gradients and on foundations of other temperatures."""
    planned = EXPERIMENTS["wessel-sets"].programmes(0)
    mountings = [p.mounting for p in planned]
    assert {m: mountings.count(m) for m in mountings} == {"hydraulic": 8, "shrink": 8, "collet": 7}
    assert {(p.climate.mean, p.climate.layers, p.foundation) for p in planned} == {
        (18.0, 1.5, 2.0),
        (22.0, 0.2, 0.0),
        (26.0, -0.5, -3.0),
    }
    assert {name for p in planned for s in p.segments for name in s.drive.loads} == {"heater", "hot_air", "tip"}
    # the same test in another chuck: the tip is displaced otherwise
    tips = [record("wessel-tool", mounting=m)[1].table["s1_um"] for m in ("", "hydraulic", "shrink", "collet")]
    assert tips[0].equals(tips[1])
    assert min(float((a - b).abs().max()) for a, b in combinations(tips[1:], 2)) > 1.0


def test_wessel_days_of_milling() -> None:
    days = simulated("wessel-milling")
    assert [d.name for d in days] == [f"wessel-milling-day{k}" for k in range(1, 6)]
    speeds = {float(round(1000 * v / (np.pi * 50))) for v in (120, 200, 370)}
    assert {float(v) for d in days for v in column(d, "spindle_rpm")} == speeds | {0.0}
    assert np.count_nonzero(np.diff(column(days[4], "spindle_rpm"))) > 8  # repeatedly changed


def test_positions_of_precompensation_differ() -> None:
    identification, verification = simulated("precompensation")
    spread = np.ptp(identification.truth, axis=1).max()
    assert 1.0 < spread < 0.5 * np.abs(identification.truth).max()
    assert set(np.unique(column(verification, "spindle_rpm"))) != set(np.unique(column(identification, "spindle_rpm")))
    (cut,) = simulated("precompensation-cut")
    rpm = column(cut, "spindle_rpm")
    assert cut.time[-1] == 70 * MINUTE
    assert set(rpm[1:6]) == set(rpm[-5:]) == {2000.0}
    assert len(set(rpm[6:66])) > 4


def test_environment_test_has_no_spindle() -> None:
    (test,) = simulated("etve")
    assert test.time[-1] == 24 * HOUR
    assert not column(test, "spindle_rpm").any()
    assert np.ptp(column(test, "t_air_C")) > 2.0
    assert 2.0 < np.abs(test.truth).max() < 50.0
    assert (column(test, "t_air_top_C") - column(test, "t_air_floor_C")).mean() > 0.5


def test_slopes_of_the_laser_profiles() -> None:
    (test,) = simulated("chen1996-slope")
    positions = np.arange(0.0, 551.0, 50.0)
    thermal = (test.truth - test.truth[0])[:, : len(positions)]
    np.testing.assert_array_equal(thermal[:, 0], 0.0)
    slopes = thermal @ positions / (positions @ positions)
    # mostly a slope (C-05)
    assert np.abs(thermal - np.outer(slopes, positions)).max() < 0.2 * np.abs(thermal).max()
    warm = 1e3 * slopes[19]  # at the end of the run [um/m]
    assert abs(warm) > 20.0
    assert abs(1e3 * slopes[-1]) < 0.5 * abs(warm)
    assert np.ptp(test.truth[:, -1]) > 1.0  # urad: the yaw of Y follows the sides of the column (C-36)


def test_axis_tests_warm_the_axis_that_moves() -> None:
    for axis, test in zip("xyz", simulated("iso230-axis"), strict=True):
        rises = {a: float(column(test, f"t_{a}_bearing_C")[25] - column(test, f"t_{a}_bearing_C")[0]) for a in "xyz"}
        assert max(rises, key=lambda a: rises[a]) == axis
        assert np.ptp(test.truth[25] - test.truth[0]) > 10.0


def test_a_seed_fixes_everything() -> None:
    first, other = simulated("random", 4)[0], simulated("random", 5)[0]
    (again,) = simulate(EXPERIMENTS["random"], seed=4)
    np.testing.assert_array_equal(first.values, again.values)
    assert not np.array_equal(first.truth, other.truth)


def test_linear_regression_is_no_complete_answer() -> None:
    """Six cycles, each left out in turn: worse than in-sample, far better than nothing."""
    (test,) = simulated("demo")
    rpm = column(test, "spindle_rpm")
    starts = np.flatnonzero((rpm[:-1] == 0) & (rpm[1:] > 0)) + 1
    assert len(starts) == 6
    assert len(set(rpm)) == 7
    cycle = np.searchsorted(starts[1:], np.arange(len(rpm)), side="right")
    temperatures = columns(test, "temperature")
    design = np.column_stack([np.ones(len(rpm)), temperatures - temperatures[0]])
    for name in ("y1_um", "z_um"):
        y = column(test, name)
        seen = y - design @ np.linalg.lstsq(design, y)[0]
        unseen = np.empty(len(y))
        for k in range(6):
            out = cycle == k
            unseen[out] = y[out] - design[out] @ np.linalg.lstsq(design[~out], y[~out])[0]
        rms_seen, rms_unseen, rms_none = (float(np.sqrt(np.mean(e**2))) for e in (seen, unseen, y))
        assert rms_unseen > 1.25 * rms_seen
        assert rms_seen > 2 * 0.15  # not just the probes' noise
        assert rms_unseen < 0.5 * rms_none


def test_a_recording_of_each_test() -> None:
    told: list[str] = []
    recordings = record("chen1996-new", seed=1, progress=told.append)
    assert all(isinstance(r, Recording) for r in recordings)
    assert [r.name for r in recordings] == told == ["chen1996-new-1250", "chen1996-new-random"]
    assert len(recordings[1].cycles) == 12
    assert record("wessel-tool")[0].speed is None
    quiet, noisy = (record("hwang", sensor_noise=s)[0] for s in (0.0, 0.4))
    assert not np.array_equal(quiet.table["t_x_nut_C"], noisy.table["t_x_nut_C"])
    np.testing.assert_array_equal(quiet.table["z_um"], noisy.table["z_um"])
    assert record(find_experiment("hwang"), sensor_noise=0.0)[0].fingerprint == quiet.fingerprint


def test_an_unknown_experiment_is_refused() -> None:
    with pytest.raises(InputError, match=r"'chen1969'; the nearest are chen1996.*such as my_test\.toml"):
        record("chen1969")
    with pytest.raises(InputError, match=r"there are chen1996, .*demo"):
        record("qqqq")
    with pytest.raises(InputError, match=r"nowhere\.toml: no such protocol file"):
        record("nowhere.toml")


def test_along_the_body_diagonal() -> None:
    (plan,) = EXPERIMENTS["hwang"].programmes(0)
    for segment in plan.segments:
        feed = segment.drive.feed
        assert feed == (feed[0],) * 3
        assert math.hypot(*feed) == pytest.approx({0: 0, 600: 508, 3000: 2006}[int(segment.drive.speed)], abs=0.01)


def test_cold_then_warm_then_stopped() -> None:
    for plan, test in zip(EXPERIMENTS["chen1996"].programmes(0), simulated("chen1996"), strict=True):
        start, warm, cool = plan.segments
        assert [s.duration / HOUR for s in (start, warm, cool)] == [0.1, 6, 10]
        assert any(warm.drive.feed)
        for rest in (*plan.soak, start, cool):
            assert (rest.drive.speed, rest.drive.feed) == (0, (0, 0, 0))
        assert {"x1_um", "y1_um", "z_um"} <= {*names(test, "displacement")}


def test_speeds_that_were_not_trained() -> None:
    _, drawn = simulated("chen1996-new")
    speeds = {*column(drawn, "spindle_rpm")} - {0.0}
    assert len(speeds - {600, 1000, 1500, 2100, 2600}) > len(speeds) / 2


def test_two_regimes_of_the_calculated_spindle() -> None:
    reference, test = (column(t, "spindle_rpm") for t in simulated("wessel-fem"))
    assert not {*reference} & {*test} - {0.0}
