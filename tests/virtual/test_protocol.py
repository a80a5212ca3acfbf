"""A protocol says what is done; a seed draws what it leaves open."""

from typing import Any

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.virtual.machine import FeedDrive
from thermocomp.virtual.protocol import Experiment, PlannedTest, Programme
from thermocomp.virtual.segments import Feed, Lot, SteadySegment, Stretch, Stroke
from thermocomp.virtual.sensors import SensorFault

MINUTE = 60.0


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_lot_knows_all_that_can_be_drawn() -> None:
    assert Lot(between=(600.0, 800.0), step=50.0).values == (600.0, 650.0, 700.0, 750.0, 800.0)
    assert Lot(one_of=(120.0, 370.0)).values == (120.0, 370.0)
    for wrong in (
        {},
        {"between": (1.0, 2.0)},
        {"step": 1.0},
        {"between": (1.0, 2.0), "step": 0.3},
        {"between": (2.0, 1.0), "step": 1.0},
        {"between": (1.0, 2.0), "step": 1.0, "one_of": (1.0,)},
    ):
        with pytest.raises(InputError):
            Lot(**wrong)


def test_a_stretch_becomes_segments() -> None:
    stretch = Stretch(
        segments=(
            Stretch(duration=60.0),
            Stretch(
                duration=120.0,
                speed=2000.0,
                feed=Feed(x=100.0, z=300.0),
                stroke=Stroke(y=(100.0, 200.0)),
                loads={"tool_tip": 40.0},
                cooled=False,
                powered=True,
            ),
        )
    )
    full = FeedDrive(2000.0, (100.0, 0.0, 300.0), (None, (100.0, 200.0), None), {"tool_tip": 40.0}, False, True)
    assert stretch.draw(rng()) == [SteadySegment(60.0), SteadySegment(120.0, full)]


def test_what_is_switched_off_stands_whatever_it_inherits() -> None:
    stretch = Stretch(speed=2000.0, feed=Feed(x=100.0), segments=(Stretch(duration=60.0, powered=False),))
    (segment,) = stretch.draw(rng())
    assert segment.drive == FeedDrive(powered=False)


def test_what_is_said_outside_holds_within() -> None:
    stretch = Stretch(
        duration=60.0,
        speed=1000.0,
        segments=(Stretch(), Stretch(speed=0.0, segments=(Stretch(duration=30.0), Stretch(cooled=False)))),
    )
    expected = [
        SteadySegment(60.0, FeedDrive(1000.0)),
        SteadySegment(30.0, FeedDrive(0.0)),
        SteadySegment(60.0, FeedDrive(0.0, cooled=False)),
    ]
    assert stretch.draw(rng()) == expected
    assert [path for path, _ in stretch.leaves()] == [
        ("segments", 0),
        ("segments", 1, "segments", 0),
        ("segments", 1, "segments", 1),
    ]


def test_what_is_repeated_is_drawn_anew() -> None:
    lot = Lot(between=(600.0, 2600.0), step=50.0)
    stretch = Stretch(repeat=40, segments=(Stretch(duration=60.0, speed=lot), Stretch(duration=30.0)))
    drawn = stretch.draw(rng())
    speeds = [s.drive.speed for s in drawn]
    assert len(drawn) == 80
    assert speeds[1::2] == [0.0] * 40
    assert set(speeds[::2]) <= set(lot.values)
    assert len(set(speeds[::2])) > 15
    assert stretch.draw(rng()) == drawn
    assert stretch.draw(rng(1)) != drawn


def test_shuffled_keeps_what_there_is() -> None:
    stretch = Stretch(duration=60.0, repeat=4, order="shuffled", segments=tuple(Stretch(speed=v) for v in (0.0, 1.0)))
    orders = {tuple(s.drive.speed for s in stretch.draw(rng(seed))) for seed in range(10)}
    assert all(sorted(order) == [0.0] * 4 + [1.0] * 4 for order in orders)
    assert len(orders) > 5


def test_drawn_goes_by_weight() -> None:
    parts = (Stretch(speed=1.0, weight=4.0), Stretch(speed=0.0))
    stretch = Stretch(duration=60.0, repeat=2000, order="drawn", segments=parts)
    assert np.mean([s.drive.speed for s in stretch.draw(rng())]) == pytest.approx(0.8, abs=0.03)


@pytest.mark.parametrize(
    ("wrong", "path"),
    [
        ({"repeat": 0}, ("repeat",)),
        ({"repeat": 2}, ("repeat",)),
        ({"order": "shuffled"}, ("order",)),
        ({"weight": 0.0}, ("weight",)),
        ({"segments": (Stretch(), Stretch(weight=2.0))}, ("segments", 1, "weight")),
    ],
)
def test_an_impossible_stretch_is_refused(wrong: dict[str, Any], path: tuple[str | int, ...]) -> None:
    with pytest.raises(SettingError) as e:
        Stretch(**wrong)
    assert e.value.path == path


def test_strokes_lie_within_the_travel() -> None:
    assert Stroke(x=(0.0, 600.0)).x == (0.0, 600.0)
    for wrong in ((200.0, 100.0), (0.0, 601.0), (-1.0, 0.0)):
        with pytest.raises(InputError, match="within the travel from 0 to 600 mm"):
            Stroke(x=wrong)


def plan(**more: Any) -> PlannedTest:
    return PlannedTest(sampling=10.0, **({"duration": MINUTE} | more))


def test_tests_have_the_names_of_their_experiment() -> None:
    assert Experiment(name="e", tests=(plan(),)).names == ("e",)
    assert Experiment(name="e", tests=(plan(), plan(name="hot"), plan())).names == ("e-1", "e-hot", "e-3")
    assert Experiment(name="e", tests=(plan(name="a", copies=3),)).names == ("e-a-1", "e-a-2", "e-a-3")
    with pytest.raises(SettingError, match="two tests are named 'e-a'"):
        Experiment(name="e", tests=(plan(name="a"), plan(name="a")))


def test_no_test_depends_on_the_others() -> None:
    lot = Lot(between=(0.0, 3000.0), step=1.0)
    both = Experiment(name="e", tests=(plan(name="a", speed=lot), plan(name="b", speed=lot))).programmes(3)
    alone = Experiment(name="e", tests=(plan(name="b", speed=lot),)).programmes(3)
    assert both[1] == alone[0]
    assert both[0].segments != both[1].segments
    copies = Experiment(name="e", tests=(plan(copies=5, speed=lot),)).programmes(3)
    assert len({p.segments[0].drive.speed for p in copies}) == 5


def test_the_soak_hears_nothing_of_the_test() -> None:
    (programme,) = Experiment(name="e", tests=(plan(speed=1000.0, soak=Stretch(duration=3600.0)),)).programmes()
    assert programme.soak == (SteadySegment(3600.0),)
    assert programme.segments == (SteadySegment(MINUTE, FeedDrive(1000.0)),)
    assert Programme(name="p", sampling=10.0, segments=()).soak == (SteadySegment(12 * 3600.0),)


@pytest.mark.parametrize(
    ("wrong", "path", "message"),
    [
        ({"sampling": 0.0}, ("sampling",), "positive"),
        ({"places": (), "probes": ()}, ("places",), "nothing is recorded"),
        ({"duration": None}, ("duration",), "missing"),
        ({"duration": -60.0}, ("duration",), "positive"),
        ({"duration": 25.0}, ("duration",), "25 s is not a multiple of the 10 s"),
        ({"duration": Lot(one_of=(20.0, 25.0))}, ("duration",), "25 s is not a multiple"),
        ({"segments": (Stretch(), Stretch(duration=5.0))}, ("segments", 1, "duration"), "5 s is not a multiple"),
        ({"soak": Stretch(speed=100.0)}, ("soak", "duration"), "missing"),
        ({"copies": 0}, ("copies",), "expected 1 to 10000 copies, found 0"),
        ({"weight": 2.0}, ("weight",), "applies only"),
        ({"foundation": -31.0}, ("foundation",), "from -30 to 30"),
    ],
)
def test_an_impossible_test_is_refused(wrong: dict[str, Any], path: tuple[str | int, ...], message: str) -> None:
    with pytest.raises(SettingError, match=message) as e:
        PlannedTest(**({"sampling": 10.0, "duration": MINUTE} | wrong))
    assert e.value.path == path


@pytest.mark.parametrize(
    ("wrong", "machine", "path", "message"),
    [
        ({"places": ("hosing",)}, "centre", ("places",), "nearest are housing"),
        ({"probes": ("zz",)}, "centre", ("probes",), "no probe 'zz'"),
        ({"probes": {"z": "z", "z_": "z"}}, "centre", (), ""),
        ({"speed": 9000.0}, "centre", ("speed",), "the top speed of the spindle is 3500 1/min"),
        ({"loads": {"tip": 1.0}}, "centre", ("loads",), "nearest are tool_tip"),
        (
            {"soak": Stretch(duration=60.0, speed=9000.0)},
            "centre",
            ("soak", "speed"),
            "the top speed of the spindle is 3500 1/min",
        ),
        ({"speed": 100.0}, "tool", ("speed",), "no spindle"),
        ({"feed": Feed(x=1.0)}, "tool", ("feed",), "no axes"),
        ({"mounting": "shrunk"}, "tool", ("mounting",), "nearest are shrink"),
        ({"mounting": "shrink"}, "centre", ("mounting",), "only the resting tool"),
        ({"foundation": 2.0}, "centre", ("foundation",), "only the resting tool"),
        ({"faults": (SensorFault("t_hosing_C", "lost", 0.0),)}, "centre", ("faults", 0, "channel"), "t_housing_C"),
        ({}, "lathe", ("machine",), "there are centre, tool"),
    ],
)
def test_what_a_machine_does_not_have_is_refused(
    wrong: dict[str, Any], machine: str, path: tuple[str | int, ...], message: str
) -> None:
    tests = (plan(), plan(**wrong))
    if not message:
        assert Experiment(name="e", machine=machine, tests=tests).machine == machine
        return
    with pytest.raises(SettingError, match=message) as e:
        Experiment(name="e", machine=machine, tests=tests)
    assert e.value.path == (path if path == ("machine",) else ("tests", 1, *path))
