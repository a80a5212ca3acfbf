"""A configuration: all that is wrong with it at once, in words that help."""

import random
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from thermocomp.core.exceptions import InputError
from thermocomp.live.adapters.network import MqttIn
from thermocomp.live.config import Page, read_config

GOOD = """
models = ["model.json"]
state = "state.json"

[limits]
magnitude = 80.0
rate = 0.05

[[sources]]
kind = "mqtt"
topic = "machine/7/temperatures"
names = {motor = "t_motor_C"}

[[sinks]]
kind = "file"
file = "corrections.json"

[page]
port = 8080
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "serve.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_it_says(tmp_path: Path) -> None:
    config, folder = read_config(written(tmp_path, GOOD))
    assert folder == tmp_path
    assert config.sources == (MqttIn(kind="mqtt", topic="machine/7/temperatures", names={"motor": "t_motor_C"}),)
    assert (config.limits.magnitude, config.limits.hold) == (80.0, 1800.0)
    assert config.page == Page(port=8080)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('models = ["model.json"]', "", "name at least one model file"),
        ('models = ["model.json"]', "models = []", "name at least one model file"),
        ('models = ["model.json"]', 'models = "model.json"', "models must be a list"),
        ('models = ["model.json"]', "models = [7]", "models.1: Input should be a valid string, found 7"),
        ('state = "state.json"', 'stat = "state.json"', "stat is not a known key"),
        ("magnitude = 80.0", "magnitude = -1.0", "limits: limit magnitude = -1.0: must be positive"),
        ("magnitude = 80.0", 'magnitude = "80 um"', "limits.magnitude: Input should be a valid number"),
        ("rate = 0.05", "rates = 0.05", "limits.rates is not a known key"),
        ('kind = "mqtt"', 'kind = "mqqt"', "sources.1: kind = 'mqqt' is not one of 'mqtt', 'replay', 'simulated'"),
        ('kind = "mqtt"', "", 'sources.1 has no kind: write kind = "..."'),
        ('topic = "machine/7/temperatures"', "", "sources.1.topic is missing"),
        ('topic = "machine/7/temperatures"', "topic = 7", "sources.1.topic: Input should be a valid string"),
        ('topic = "machine/7/temperatures"', 'topic = ""', "topic = '': name a topic"),
        ('topic = "machine/7/temperatures"', 'topic = "a"\nport = 0', "port = 0: expected a port from 1 to 65535"),
        ('names = {motor = "t_motor_C"}', 'names = ["t_motor_C"]', "sources.1.names must be a table"),
        ('kind = "file"', 'kind = "linux"', "sinks.1: kind = 'linux' is not one of"),
        ("port = 8080", "port = 80800", "page: port = 80800: expected a port from 0"),
        ("port = 8080", 'port = "8080"', "page.port: Input should be a valid integer, found '8080'"),
        ("[page]", "[pages]", "pages is not a known key"),
        ('state = "state.json"', "speed = 60.0", "a machine that is read by kind = 'mqtt' runs in real time"),
        ('state = "state.json"', "speed = 0.0", "speed: Input should be greater than 0, found 0.0"),
        ('state = "state.json"', 'state = "state.json', "not valid TOML"),
        ('state = "state.json"', 'own_compensation = "on"', "the same error would be corrected twice"),
        ('state = "state.json"', 'own_compensation = "maybe"', "own_compensation: Input should be 'on', 'off' or"),
        ('state = "state.json"', 'at_stop = "drop"', "at_stop: Input should be 'hold' or 'fade'"),
        ("[page]", '[journal]\nfile = "live.db"\n[page]', 'own_compensation = "unknown": write "off" or "on"'),
        ("[page]", '[journal]\nfile = "a"\nfiles = 1\n[page]', "journal: size_mb = 64, files = 1: expected"),
        (
            "[page]",
            '[journal]\nfile = "a"\nchannels = {t = "heat"}\n[page]',
            "journal: channels: heat: expected one of time, temperature",
        ),
        ("[page]", '[[probes]]\nkind = "mqtt"\n[page]', "probes.1.topic is missing"),
        ("[page]", '[[probes]]\nkind = "simulated"\nevery = 0.0\n[page]', "probes.1: every = 0"),
        ('kind = "file"\nfile = "corrections.json"', 'kind = "file"', "sinks.1.file is missing"),
        ("[page]", "[journal]\n[page]", "journal.file is missing"),
        ('kind = "file"\nfile = "corrections.json"', 'kind = "mqtt"\ntopic = "m/#"', "must not contain wildcards"),
        ("port = 8080", "settled = 0.0", "page: settled = 0: expected more than 0 um"),
        ('kind = "file"\nfile = "corrections.json"', 'kind = "linuxcnc"\nsocket = "s"', "sinks.1.axes is missing"),
        (
            'kind = "file"\nfile = "corrections.json"',
            'kind = "linuxcnc"\nsocket = "s"\naxes = {z_um = "A"}',
            "sinks.1: axes = {'z_um': 'A'}: expected a linear axis for each target",
        ),
    ],
)
def test_what_is_wrong(old: str, new: str, says: str, tmp_path: Path) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match=r"serve\.toml") as caught:
        read_config(written(tmp_path, GOOD.replace(old, new)))
    assert says in str(caught.value)


def test_all_that_is_wrong_is_said_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("rate = 0.05", "rates = 0.05").replace("port = 8080", 'port = "x"').replace("file =", "fil =")
    with pytest.raises(InputError) as caught:
        read_config(written(tmp_path, text))
    lines = str(caught.value).splitlines()
    assert lines[0].endswith("4 errors to correct:")
    for word in ("limits.rates", "page.port", "sinks.1.fil ", "sinks.1.file"):
        assert any(word in line for line in lines)
    assert len(lines) == 5


def test_a_key_of_a_wrong_type_hides_nothing(tmp_path: Path) -> None:
    text = GOOD.replace("rate = 0.05", 'rate = "x"\nhold = 0.0\nfade = -1.0').replace(
        "port = 8080", 'port = "x"\nsettled = 0.0'
    )
    with pytest.raises(InputError) as caught:
        read_config(written(tmp_path, text.replace('topic = "', 'port = "x"\ntopic = " " # ', 1)))
    found = sorted(line.strip() for line in str(caught.value).splitlines()[1:])
    said = (
        "limits.rate: Input should be a valid number",
        "limits: limit hold = 0.0: must be positive; limit fade = -1.0: must be positive",
        "page.port: Input should be a valid integer",
        "page: settled = 0: expected more than 0 um",
        "sources.1.port: Input should be a valid integer",
        "sources.1: topic = ' ': name a topic, such as",
    )
    for line, start in zip(found, sorted(said), strict=True):
        assert line.startswith(start)


def test_a_key_that_is_called_as_a_kind_is_a_key(tmp_path: Path) -> None:
    text = GOOD.replace('names = {motor = "t_motor_C"}', "names = {motor = 1}\nmqtt = -1")
    with pytest.raises(InputError) as caught:
        read_config(written(tmp_path, text))
    found = [line.strip() for line in str(caught.value).splitlines()[1:]]
    assert found == [
        "sources.1.names.motor: Input should be a valid string, found 1",
        "sources.1.mqtt is not a known key",
    ]


def spots(content: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if path:
        yield path
    inner = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for k, value in inner:
        yield from spots(value, (*path, k))


def test_whatever_is_written_there_is_told_not_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(1)
    values = [0, -1, 1.5, "x", "", True, [], [1], ["a", {"b": 1}], {}, {"kind": "mqtt"}, {"file": {"b": []}}, [[1]]]
    known = dict[str, TypeAdapter[Any]]()

    def adapter(made: type) -> TypeAdapter[Any]:
        """Make one validator of the same sections: it takes most of the time."""
        sections = str(made.__annotations__)
        if sections not in known:
            known[sections] = TypeAdapter(made)
        return known[sections]

    monkeypatch.setattr("thermocomp.live.config.TypeAdapter", adapter)
    refused = 0
    for _ in range(2000):
        content = tomllib.loads(GOOD)
        content["sinks"] += [{"kind": "linuxcnc", "socket": "s", "axes": {"z_um": "Z"}}]
        for _ in range(rng.randint(1, 5)):
            *way, last = rng.choice(list(spots(content)))
            table: Any = content
            for k in way:
                table = table[k]
            if isinstance(table, dict) and rng.random() < 0.3:
                last = rng.choice(["mqtt", "file", "kind", "other"])
            table[last] = deepcopy(rng.choice(values))
        monkeypatch.setattr("thermocomp.live.config.read_toml", lambda *_, content=content: content)
        try:
            read_config("serve.toml")
        except InputError as e:
            first, *rest = str(e).splitlines()
            assert first == f"serve.toml: {len(rest)} error{'s' if len(rest) > 1 else ''} to correct:"
            refused += 1
    assert refused > 1500


def test_all_that_does_not_fit_together_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_config(written(tmp_path, 'models = []\nsources = []\nown_compensation = "on"\n'))
    assert str(caught.value).splitlines()[0].endswith("3 errors to correct:")


def test_there_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such configuration"):
        read_config(tmp_path / "serve.toml")
