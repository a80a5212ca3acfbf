"""`thermocomp serve --check`: all that would keep the service from starting, before it is started."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import ACCEPTED
from smallmill import warmed

from thermocomp.core.alone import alone
from thermocomp.core.exceptions import InputError
from thermocomp.files import modelfile
from thermocomp.live.config import read_config
from thermocomp.live.findings import find_faults, find_faults_now, runs_now

GOOD = """
models = ["model.json"]
state = "state.json"
own_compensation = "off"

[[sources]]
kind = "mqtt"
topic = "machine/7/temperatures"

[[sources]]
kind = "replay"
file = "day.csv"

[[sinks]]
kind = "mqtt"
topic = "machine/7/corrections"

[[sinks]]
kind = "file"
file = "out.json"

[journal]
file = "live.db"

[page]
port = 0
token_file = "token.txt"
"""


def lay(folder: Path, text: str = GOOD) -> Path:
    model = replace(warmed("z_um", "um", 1.0), honest_error=ACCEPTED)
    modelfile.write([model], folder / "model.json", overwrite=True)
    (folder / "day.csv").write_text("time_s,t1_C\n0,20.0\n1,21.0\n", encoding="ascii")
    (folder / "token.txt").write_text("0123456789abcdef", encoding="ascii")
    (folder / "token.txt").chmod(0o600)
    path = folder / "serve.toml"
    path.write_text(text, encoding="utf-8")
    return path


def checked(path: Path, *more: str) -> tuple[int, str]:
    command = [sys.executable, "-m", "thermocomp", "serve", str(path), "--check", *more]
    found = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60, env=dict(os.environ))
    return found.returncode, found.stdout + found.stderr


@contextmanager
def taken() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening.getsockname()[1]


def test_what_is_good_passes_and_nothing_is_written(tmp_path: Path) -> None:
    path = lay(tmp_path)
    before = sorted(p.name for p in tmp_path.iterdir())
    code, said = checked(path)
    assert (code, "z_um: may run" in said) == (0, True), said
    assert sorted(p.name for p in tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        *(
            ('"machine/7/temperatures"', f'"{topic}"', says)
            for topic, says in (
                ("machine/#/x", "put it at the end"),
                ("machine/#x", "a wildcard must be a whole level: '#x'"),
                ("machine/x#", "a wildcard must be a whole level"),
                ("a+/b", "a wildcard must be a whole level"),
                ("##", "a wildcard must be a whole level"),
                ("#/", "put it at the end"),
                ("", "name a topic"),
                ("  ", "name a topic"),
                ("a\\u0000b", "non-printable characters"),
                ("$share/g", "$share/GROUP/TOPIC"),
                ("$share/+/t", "$share/GROUP/TOPIC"),
                ("é" * 40_000, "longer than 65,535 bytes"),
                ("machine/7/+", "receives the corrections"),
                ("#", "receives the corrections"),
                ("machine/7/corrections/#", "receives the corrections"),
            )
        ),
        *(
            ('"machine/7/corrections"', f'"{topic}"', says)
            for topic, says in (
                ("a/+", "must not contain wildcards"),
                ("a#b", "must not contain wildcards"),
                ("$SYS/a", "reserved for the broker"),
            )
        ),
        *(
            ('topic = "machine/7/temperatures"', f'topic = "a"\nhost = "{host}"', "sources.1: host = ")
            for host in ("", " ", "a b", "mqtt://broker", "broker:1883", "a..b", ".", "x" * 64, "256.1.1.1", "1.2.3")
        ),
        ('topic = "machine/7/temperatures"', 'topic = "a"\nport = 70000', "port = 70000"),
        (
            'topic = "machine/7/temperatures"',
            'topic = "a"\nnames = {a = "t", b = "t"}',
            "several entries name the channel t",
        ),
        ('kind = "replay"\nfile = "day.csv"', 'kind = "simulated"\nseed = -1', "seed = -1"),
        (
            'kind = "replay"\nfile = "day.csv"',
            'kind = "mqtt"\ntopic = "machine/7/temperatures"',
            "2 sources with the same topic = 'machine/7/temperatures'",
        ),
        ('kind = "mqtt"\ntopic = "machine/7/corrections"', 'kind = "file"\nfile = "out.json"', "2 sinks with the same"),
        ("port = 0", 'host = ""', "page: host = ''"),
        ("port = 0", 'host = "a b"', "page: host = 'a b'"),
        ("port = 0", 'hosts = ["mill:8731"]', "page: hosts = 'mill:8731'"),
        ("port = 0", "port = 65536", "page: port = 65536"),
        ("port = 0", "settled = 0", "settled = 0"),
    ],
)
def test_what_a_configuration_says_of_the_network(old: str, new: str, says: str, tmp_path: Path) -> None:
    assert GOOD.count(old) == 1
    with pytest.raises(InputError) as caught:
        read_config(lay(tmp_path, GOOD.replace(old, new)))
    assert says in str(caught.value)
    assert str(caught.value).replace("\n", "").isprintable()


@pytest.mark.parametrize(
    "topic", ["#", "+", "+/+", "a/#", "/", "a//b", "+/a/#", "$SYS/#", "$share/g/a/#", "é" * 30_000, "a b"]
)
def test_topics_that_can_be(topic: str, tmp_path: Path) -> None:
    text = GOOD.replace('kind = "mqtt"\ntopic = "machine/7/corrections"', 'kind = "file"\nfile = "other.json"')
    read_config(lay(tmp_path, text.replace("machine/7/temperatures", topic)))


@pytest.mark.parametrize("host", ["::1", "127.0.0.1", "mill7", "mill-7.shop.example.", "bücher.example", "my_host"])
def test_hosts_that_can_be(host: str, tmp_path: Path) -> None:
    read_config(lay(tmp_path, GOOD.replace('corrections"', f'corrections"\nhost = "{host}"')))
    read_config(lay(tmp_path, GOOD.replace("port = 0", f'host = "{host}"\nhosts = ["{host}"]')))


def faults(path: Path) -> list[str]:
    settings = read_config(path)
    return [*find_faults(settings), *find_faults_now(settings, settings.config.page)]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('state = "state.json"', 'state = "day.csv"', "day.csv: this file is named more than once"),
        ('state = "state.json"', 'state = "out.json"', "out.json: this file is named more than once"),
        ('state = "state.json"', 'state = "live.db"', "live.db: this file is named more than once"),
        ('state = "state.json"', 'state = "./model.json"', "model.json: this file is named more than once"),
        ('file = "out.json"', 'file = "pipe"', "pipe: this is a pipe or a device"),
        ('file = "out.json"', 'file = "none/out.json"', "there is no folder"),
        ('file = "out.json"', 'file = "."', "is a folder"),
        ('file = "day.csv"', 'file = "token.txt"', "token.txt: the file has no column time_s"),
        ('file = "day.csv"', 'file = "broken.csv"', "broken.csv: line 3 cannot be read"),
        ('token_file = "token.txt"', 'token_file = "short.txt"', "short.txt: the token has only 5 characters"),
        ('token_file = "token.txt"', 'token_file = "missing.txt"', "missing.txt: no such file"),
        ('state = "state.json"', 'state = "/proc/state.json"', "no file can be created in the folder /proc"),
        ('token_file = "token.txt"', 'token_file = "two.txt"', "two.txt: expected one token in one line"),
        ('token_file = "token.txt"', 'token_file = "."', "this is a folder; name a file"),
        ("port = 0", 'host = "203.0.113.7"', "page on 203.0.113.7"),
        ("port = 0", 'host = "nowhere.invalid"', "page on nowhere.invalid"),
        ('kind = "file"\nfile = "out.json"', 'kind = "linuxcnc"\nsocket = "s.sock"\naxes = {z_um = "Z"}', "not set up"),
        (
            'kind = "file"\nfile = "out.json"',
            'kind = "linuxcnc"\nsocket = "day.csv"\naxes = {z_um = "Z"}',
            "not a socket",
        ),
        (
            'kind = "file"\nfile = "out.json"',
            f'kind = "linuxcnc"\nsocket = "{"s" * 120}"\naxes = {{z_um = "Z"}}',
            "at most 107 bytes",
        ),
    ],
)
def test_what_is_there_and_what_is_not(old: str, new: str, says: str, tmp_path: Path) -> None:
    path = lay(tmp_path, GOOD.replace(old, new))
    os.mkfifo(tmp_path / "pipe")
    for name, text in (("short.txt", "short"), ("two.txt", "0123456789abcdef\nfedcba9876543210\n")):
        (tmp_path / name).write_text(text, encoding="ascii")
        (tmp_path / name).chmod(0o600)
    (tmp_path / "broken.csv").write_bytes(b"time_s,t1_C\n0,20\n1,\xff\n")
    found = faults(path)
    assert any(says in line for line in found), found


@pytest.mark.parametrize("name", ["live.000001.db", "live.000017.db-wal", "live.db.lock", "state.json.lock"])
def test_what_the_service_itself_writes_is_no_sink(name: str, tmp_path: Path) -> None:
    found = list(find_faults(read_config(lay(tmp_path, GOOD.replace("out.json", name)))))
    assert any("would be overwritten" in fault for fault in found)


def test_a_lock_that_cannot_be_opened(tmp_path: Path) -> None:
    (tmp_path / "state.json.lock").mkdir()
    long = "s" * 252
    for text, says in ((GOOD, "state.json.lock: this is a folder"), (GOOD.replace("state.json", long), "at most 255")):
        assert any(says in fault for fault in find_faults(read_config(lay(tmp_path, text))))


def test_an_axis_that_the_set_up_does_not_correct(tmp_path: Path) -> None:
    text = GOOD.replace('kind = "file"\nfile = "out.json"', 'kind = "linuxcnc"\nsocket = "s"\naxes = {z_um = "Z"}')
    path = lay(tmp_path, text)
    hal = tmp_path / "thermocomp.hal"
    hal.write_text("loadusr -Wn thermocomp python3 thermocomp_hal.py --axis x,0.0,1.0 --unit mm\n", encoding="ascii")
    (found,) = faults(path)
    assert "no correction of axis Z" in found
    hal.write_text("loadusr ... --axis x,0.0,1.0 --axis z,-5.0,1.0 --unit mm\n", encoding="ascii")
    assert faults(path) == []


def test_a_port_that_is_taken_is_found_with_all_else(tmp_path: Path) -> None:
    with taken() as port:
        path = lay(tmp_path, GOOD.replace("port = 0", f"port = {port}").replace("day.csv", "no.csv"))
        code, said = checked(path)
        assert code == 2
        assert f"page on 127.0.0.1, port {port}" in said
        assert "as found now" in said
        assert "no.csv: no such file" in said
        assert checked(lay(tmp_path), "--port", str(port))[0] == 2
    code, said = checked(lay(tmp_path))
    assert code == 0, said


def test_beside_the_running_service_its_port_is_taken_rightly(tmp_path: Path) -> None:
    with taken() as port:
        settings = read_config(lay(tmp_path, GOOD.replace("port = 0", f"port = {port}")))
        assert not runs_now(settings)
        with alone(tmp_path / "state.json"):
            assert runs_now(settings)
            assert list(find_faults_now(settings, settings.config.page)) == []
        assert not runs_now(settings)
        assert len(list(find_faults_now(settings, settings.config.page))) == 1
