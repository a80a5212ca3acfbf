"""The TOML door of protocols: what is written is what is done; what cannot be used is told to the key."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.climate import CLIMATES, STABLE, Climate
from thermocomp.virtual.datasets import EXPERIMENTS
from thermocomp.virtual.instruments import Touch
from thermocomp.virtual.kits import KITS
from thermocomp.virtual.protocol import Experiment, PlannedTest
from thermocomp.virtual.protocolfile import TIMES, read_protocol
from thermocomp.virtual.segments import Feed, Lot, SteadySegment, Stretch, Stroke
from thermocomp.virtual.sensors import SensorFault

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "protocols.rst").read_text(encoding="utf-8")


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_one_test_without_tables(tmp_path: Path) -> None:
    path = written(tmp_path, 'sampling = "10 s"\nduration = "1.5 h"\nspeed = 2000\nplaces = "usual"')
    expected = PlannedTest(sampling=10.0, duration=5400.0, speed=2000.0, places=("usual",))
    assert read_protocol(path) == Experiment(name="mine", tests=(expected,))


def test_everything_that_can_be_written(tmp_path: Path) -> None:
    text = """
description = "all of it"
machine = "centre"
physics = "nonlinear"
sampling = "1 min"
climate = {like = "stable", mean = 19, memory = "2 h", begin = "6.5 h"}
places = {t1 = "housing", t2 = "table"}
perfect = true
soak = {duration = "2 h", powered = false}

[probes]
mine = "z_at_200"
sum = {z = 1, "zz@200" = -1}

[touch]
every = "30 min"
points = {a = [0, 100, 200]}
noise = 1

[[faults]]
channel = "t_t1_C"
kind = "drift"
start = "10 min"
end = "1 h"
size = 2

[[segments]]
duration = {between = ["10 min", "30 min"], step = "5 min"}
speed = {one_of = [100, 200]}
feed = {x = 600, z = {between = [0, 100], step = 50}}
stroke = {y = [100, 200]}
loads = {tool_tip = 40}
cooled = false

[[segments]]
repeat = 3
order = "drawn"
segments = [{duration = "90 s", weight = 2}, {duration = "1 min", powered = false}]

[[tests]]
name = "first"

[[tests]]
copies = 2
soak = "8 h"
perfect = false
"""
    with pytest.raises(
        InputError, match=r"\[\[segments\]\] 2, \[\[segments\]\] 1, key 'duration' = '90 s': 90 s is no"
    ):
        read_protocol(written(tmp_path, text))
    experiment = read_protocol(written(tmp_path, text.replace("90 s", "2 min")))
    assert (experiment.description, experiment.machine, experiment.physics) == ("all of it", "centre", "nonlinear")
    assert experiment.names == ("mine-first", "mine-2-1", "mine-2-2")
    first, second = experiment.tests
    assert first.climate == Climate(
        19.0, STABLE.daily, STABLE.wander, 7200.0, STABLE.layers, 0.0, STABLE.draught, 23400
    )
    assert first.places == {"t1": "housing", "t2": "table"}
    assert first.probes == {"mine": "z_at_200", "sum": {"z": 1.0, "zz@200": -1.0}}
    assert first.touch == Touch(1800.0, {"a": (0.0, 100.0, 200.0)}, noise=1.0)
    assert first.faults == (SensorFault("t_t1_C", "drift", 600.0, 3600.0, 2.0),)
    assert first.soak == Stretch(duration=7200.0, powered=False)
    assert first.perfect
    assert first.segments == (
        Stretch(
            duration=Lot(between=(600.0, 1800.0), step=300.0),
            speed=Lot(one_of=(100.0, 200.0)),
            feed=Feed(x=600.0, z=Lot(between=(0.0, 100.0), step=50.0)),
            stroke=Stroke(y=(100.0, 200.0)),
            loads={"tool_tip": 40.0},
            cooled=False,
        ),
        Stretch(
            repeat=3,
            order="drawn",
            segments=(Stretch(duration=120.0, weight=2.0), Stretch(duration=60.0, powered=False)),
        ),
    )
    assert second.soak == Stretch(duration=28800.0)
    assert not second.perfect
    assert second.segments == first.segments


def test_a_test_goes_over_what_all_share(tmp_path: Path) -> None:
    text = 'sampling = "1 min"\nspeed = 100\nduration = "1 h"\n[[tests]]\n[[tests]]\nspeed = 200\nsampling = "2 min"'
    one, two = read_protocol(written(tmp_path, text)).programmes()
    assert (one.segments[0].drive.speed, two.segments[0].drive.speed) == (100.0, 200.0)
    assert (one.sampling, two.sampling) == (60.0, 120.0)


@pytest.mark.parametrize(
    ("text", "seconds"), [("90 s", 90), ("1.5 min", 90), ("2 h", 7200), ("2h", 7200), ("60000 ms", 60), ("1 hr", 3600)]
)
def test_times_are_written_with_their_unit(text: str, seconds: float, tmp_path: Path) -> None:
    (programme,) = read_protocol(written(tmp_path, f'sampling = "30 s"\nduration = "{text}"')).programmes()
    assert programme.segments == (SteadySegment(float(seconds)),)


HEAD = 'sampling = "10 s"\n'
BODY = HEAD + 'segments = [{duration = "1 min"}]\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = [", "not valid TOML"),
        ('duration = "1 min"', "key 'sampling': is missing"),
        (HEAD + "sped = 3", "key 'sped' = 3: there is no key 'sped'; the nearest are speed"),
        (HEAD + 'duration = "25 s"', "key 'duration' = '25 s': 25 s is not a multiple of the 10 s between two rows"),
        (HEAD + 'duration = "-1 h"', "key 'duration' = '-1 h': -3600 s: must be positive"),
        (HEAD + "duration = 30", "key 'duration' = 30: write a time with its unit, such as"),
        (HEAD + 'duration = "inf h"', "key 'duration' = 'inf h': write a time with its unit"),
        (HEAD + 'duration = "3 parsec"', "key 'duration' = '3 parsec': unknown unit 'parsec'"),
        (HEAD + 'duration = "3 mm"', "unit 'mm' measures displacement or position, not time"),
        (HEAD + "speed = 100", "key 'duration': is missing: state how long it lasts"),
        (HEAD + "segments = 3", "key 'segments' = 3: must be a list"),
        (HEAD + "segments = [3]", "[[segments]] 1: must be a table"),
        (HEAD + 'duration = "1 min"\nspeed = inf', "key 'speed' = inf: Input should be a finite number"),
        (HEAD + 'duration = "1 min"\nspeed = "fast"', "key 'speed' = 'fast': Input should be a valid number"),
        (HEAD + 'segments = [{duration = "1 min", speed = 9000}]', "[[segments]] 1, key 'speed' = 9000: 9000 1/min"),
        (
            HEAD + 'segments = [{duration = "1 min", speed = {betwen = [0, 1]}}]',
            "[speed], key 'betwen' = [0, 1]: there",
        ),
        (HEAD + 'segments = [{duration = "1 min", speed = {between = [0, 1]}}]', "write either one_of = [...], or"),
        (HEAD + 'segments = [{duration = {one_of = ["1 min", "15 s"]}}]', "15 s is not a multiple"),
        (
            HEAD + 'segments = [{duration = {one_of = ["1 min", 15]}}]',
            "key 'one_of' = ['1 min', 15]: write a time with its",
        ),
        (
            HEAD + 'segments = [{duration = "1 min", feed = {w = 3}}]',
            "[feed], key 'w' = 3: there is no key 'w'; there are",
        ),
        (HEAD + 'segments = [{duration = "1 min", feed = 3}]', "[[segments]] 1, key 'feed' = 3: must be a table"),
        (
            HEAD + 'segments = [{duration = "1 min", stroke = {x = [0, 700]}}]',
            "[stroke], key 'x' = [0, 700]: expected positions that increase",
        ),
        (HEAD + 'segments = [{duration = "1 min", loads = {tip = 3}}]', "no load 'tip'; the nearest are tool_tip"),
        (HEAD + 'order = "random"\nsegments = [{duration = "1 min"}]', "key 'order' = 'random': Input should be"),
        (BODY + 'machine = "lathe"', "key 'machine' = 'lathe': there is no machine 'lathe'; there are centre, tool"),
        (
            BODY + 'climate = "tropic"',
            "key 'climate' = 'tropic': there is no climate 'tropic'; the nearest are workshop",
        ),
        (BODY + "climate = {meen = 3}", "[climate], key 'meen' = 3: there is no key 'meen'; the nearest are mean"),
        (BODY + 'climate = {memory = "0 s"}', "[climate], key 'memory' = '0 s': expected a positive time"),
        (BODY + "climate = 20", "key 'climate' = 20: must be a table"),
        (
            BODY + 'places = ["hosing"]',
            "key 'places' = ['hosing']: there is no place 'hosing'; the nearest are housing",
        ),
        (
            BODY + 'places = ["shaft"]',
            "'shaft' is on a rotating part: its temperature can only be calculated, with perfect = true",
        ),
        (BODY + 'probes = ["w"]', "key 'probes' = ['w']: there is no probe 'w'; there are x1"),
        (
            BODY + 'touch = {every = "0 s", points = {a = [0, 0, 0]}}',
            "[touch], key 'every' = '0 s': expected a positive interval",
        ),
        (BODY + 'touch = {every = "1 h", points = {a = [0, 0]}}', "[points], key 'a' = [0, 0]: has too few values"),
        (
            BODY + 'touch = {every = "1 h", points = {a = [0, 0, 900]}}',
            "[points], key 'a' = [0, 0, 900]: is beyond the",
        ),
        (BODY + '[[faults]]\nchannel = "t_air_C"\nkind = "lost"', "[[faults]] 1, key 'start': is missing"),
        (
            BODY + '[[faults]]\nchannel = "t_air_C"\nkind = "lost"\nstart = "2 h"',
            "[[faults]] 1, key 'start' = '2 h': 7200 s: start of the fault: must be from 0 to the end of the test, "
            "60 s",
        ),
        (HEAD + 'segments = [{duration = "10000000 h"}]', "give 3.6e+09 rows; at most 10,000,000"),
        (BODY + "copies = 1000000", "key 'copies' = 1000000: expected 1 to 10000 copies"),
        (HEAD + 'duration = "1 min"\nrepeat = 1000000\nsegments = [{}]', "expected 1 to 10000 repeats"),
        (HEAD + 'segments = [{duration = "1 min", speed = {between = [0, 3000], step = 1e-6}}]', "use a larger step"),
        (HEAD + 'segments = [{duration = "1 min", powered = "no"}]', "must be true or false, without quotes"),
        (BODY + "perfect = 1", "key 'perfect' = 1: must be true or false"),
        (HEAD + 'segments = [{duration = "1 min", speed = true}]', "must be a value other than true and false"),
        (
            HEAD + 'segments = [{duration = "1 min", speed = "1000"}]',
            "expected a number, found the text '1000'; write it without quotes",
        ),
        (BODY + "climate = {mean = 1e6}", "1e+06 degC: must be from -30 to 60"),
        (
            BODY + 'touch = {every = "1 h", noise = -3, points = {a = [0, 0, 0]}}',
            "'noise' = -3: expected at least 0 um",
        ),
        (
            BODY + '[[faults]]\nchannel = "air"\nkind = "lost"\nstart = "30 s"',
            "[[faults]] 1, key 'channel' = 'air': there",
        ),
        (
            BODY + '[[faults]]\nchannel = "air"\nkind = "dead"\nstart = "1 h"',
            "key 'kind' = 'dead': Input should be 'stuck'",
        ),
        (
            BODY + '[[tests]]\n[[tests]]\nmachine = "tool"',
            "[[tests]] 2, key 'machine' = 'tool': there is no key 'machine'",
        ),
        (BODY + '[[tests]]\nname = "a"\n[[tests]]\nname = "a"', "two tests are named 'mine-a'"),
        (BODY + "tests = 3", "key 'tests' = 3: must be a list of tables"),
        (BODY + "tests = []", "key 'tests' = []: an experiment needs at least one test"),
    ],
)
def test_what_cannot_be_used_is_told_to_the_key(text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as e:
        read_protocol(path)
    assert str(e.value).startswith(f"{path}: ")
    assert message in str(e.value)


def test_no_file_and_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such protocol file"):
        read_protocol(tmp_path / "none.toml")
    (tmp_path / "odd.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as a protocol"):
        read_protocol(tmp_path / "odd.toml")


TABLES: dict[str, type] = {
    "tests": PlannedTest,
    "segments": Stretch,
    "climate": Climate,
    "touch": Touch,
    "faults": SensorFault,
}


def test_the_page_describes_every_key_and_no_other() -> None:
    keys_of_file = PAGE.partition("What can be measured")[0]
    sections = re.split(r"^``\[\[?(\S+?)\]\]?``\n\^+\n", keys_of_file, flags=re.MULTILINE)
    described = {
        table: set(re.findall(r"^``(\w+)``$", text, re.MULTILINE))
        for table, text in zip(sections[1::2], sections[2::2], strict=True)
    }
    keys = {table: {f.name for f in fields(cls)} for table, cls in TABLES.items()}
    keys["tests"] -= keys["segments"]
    keys["climate"].add("like")
    assert described == keys
    assert {f.name for f in fields(Experiment)} - {"name", "tests"} <= set(
        re.findall(r"^``(\w+)``$", sections[0], re.MULTILINE)
    )


def test_the_page_names_everything() -> None:
    for name, experiment in EXPERIMENTS.items():
        assert f"``{name}``" in PAGE
        assert experiment.description in " ".join(PAGE.split())
    for kit in KITS.values():
        plain = [o for o in kit.observables if "@" not in o]
        for name in (*kit.places, *kit.inner, *kit.probes, *kit.outfits, *kit.nests, *kit.loads, *plain):
            assert f"``{name}``" in PAGE, name
    for name in CLIMATES:
        assert f"``{name}``" in PAGE
    assert set(TIMES) <= {f.name for cls in (*TABLES.values(), PlannedTest) for f in fields(cls)}


@pytest.mark.parametrize("example", sorted((DOCS / "files").glob("*_test.toml")), ids=lambda p: p.stem)
def test_the_examples_of_the_page_can_be_run(example: Path) -> None:
    assert example.name in PAGE
    assert read_protocol(example).programmes(seed=1)
