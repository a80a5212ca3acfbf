"""The page and its runs are killed at random moments: nothing shown as saved is lost, and no file is half."""

import contextlib
import json
import os
import random
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from pageserver import start_page
from projects import small_project

from thermocomp.api.keywords import silent
from thermocomp.app.project import Project
from thermocomp.app.runfolder import runs_of
from thermocomp.app.running import run_project
from thermocomp.app.store import Store
from thermocomp.files import modelfile
from thermocomp.files.scratch import is_scratch

DRIFT = "files/drift.csv"


@dataclass
class Shown:
    """What the page has confirmed."""

    name: int = 0
    asked_name: int = 0
    scale: int = 1
    asked_scale: int = 1
    dropped: dict[str, bytes] = field(default_factory=dict)
    sent: set[bytes] = field(default_factory=set)

    @property
    def confirmed(self) -> int:
        return self.name + self.scale + len(self.dropped)


def edit(client: httpx.Client, shown: Shown) -> None:
    shown.asked_name += 1
    client.put("api/settings", json={"name": str(shown.asked_name)}).raise_for_status()
    shown.name = shown.asked_name


def answer(client: httpx.Client, shown: Shown) -> None:
    shown.asked_scale += 1
    column = {"column": "x_um", "role": "displacement", "unit": "um", "scale": float(shown.asked_scale)}
    client.post(f"api/recordings/{DRIFT}", json=[{"columns": {"x_um": column}}]).raise_for_status()
    shown.scale = shown.asked_scale


def drop(client: httpx.Client, shown: Shown) -> None:
    rows = b"".join(b"%d,20,%d\n" % (k, k) for k in range(3000))
    content = b"time_s,t1_C,q_um\n%b%d,20,1\n" % (rows, time.time_ns())
    shown.sent.add(content)
    found = client.put("api/drop/more.csv", content=content).raise_for_status().json()
    shown.dropped[found["file"]] = content


def begin(client: httpx.Client, _: Shown) -> None:
    client.post("api/runs?again=true")  # refused while one is going on
    time.sleep(0.5)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(stat.parent.name))
    return found


def kill_once(folder: Path, shown: Shown, lot: random.Random) -> None:
    """Work with a page in several threads until it is killed, with or without its runs and readers."""
    process, address = start_page(folder)
    ended = threading.Event()

    def work(what: Callable[[httpx.Client, Shown], None]) -> None:
        with contextlib.suppress(httpx.HTTPError), httpx.Client(base_url=address, timeout=60.0) as client:
            while not ended.is_set():
                what(client, shown)

    threads = [threading.Thread(target=work, args=(what,)) for what in (edit, answer, drop, begin)]
    for thread in threads:
        thread.start()
    wanted, latest = shown.confirmed + lot.randrange(6), time.monotonic() + 60.0
    while shown.confirmed < wanted and time.monotonic() < latest:
        time.sleep(0.01)
    time.sleep(lot.uniform(0.0, 1.0))
    started = children(process.pid)
    for pid in started if lot.random() < 0.7 else []:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    time.sleep(lot.choice((0.0, 0.3)))
    process.kill()
    process.communicate()
    ended.set()
    for thread in threads:
        thread.join()
    for pid in started:  # a run goes on without its page
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def look(folder: Path, shown: Shown) -> None:
    """Assert that the project opens, with what was confirmed, and that each file is whole."""
    content = Store(folder).content()
    Project(folder)
    assert shown.name <= int(content["name"]) <= shown.asked_name  # what was asked for at a kill may have been done
    mapping = next((r.get("mapping") for r in content["recordings"] if r["file"] == DRIFT), None)
    scale = float((folder / mapping).read_text().partition("scale = ")[2].split()[0]) if mapping else 1.0
    assert shown.scale <= scale <= shown.asked_scale
    named = {r["file"] for r in content["recordings"]}
    assert set(shown.dropped) <= named
    for file in (folder / "files").glob("more*.csv"):
        assert file.read_bytes() in shown.sent
    assert all((folder / file).read_bytes() == text for file, text in shown.dropped.items())
    for run in runs_of(folder):
        state = run.read()
        assert all((run.path / name).stat().st_size for step in state["steps"] for name in step["files"])
        for path in (p for p in run.path.iterdir() if not is_scratch(p.name)):
            if path.name == "model.json":
                modelfile.read(path)
            elif path.suffix == ".json":
                json.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".html":
                assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")


@pytest.mark.parametrize(
    "kills", [1, pytest.param(int(os.environ.get("THERMOCOMP_KILLS", "100")), marks=pytest.mark.long)]
)
def test_nothing_shown_as_saved_is_lost(tmp_path: Path, kills: int) -> None:
    folder, shown, lot = small_project(tmp_path / "project"), Shown(), random.Random(kills)
    edited = folder / "project.toml"
    edited.write_text(edited.read_text(encoding="utf-8").replace("Small machine", "0"), encoding="utf-8")
    for k in range(kills):
        kill_once(folder, shown, lot)
        look(folder, shown)
        print(f"{k + 1} kills: {shown.name} settings, {shown.scale} mappings, {len(shown.dropped)} files", flush=True)
    document = Store(folder).document()
    document["recordings"] = [{"file": DRIFT}]
    edited.write_text(document.as_string(), encoding="utf-8")
    assert run_project(Project(folder), silent, again=True).folder.read()["state"] == "done"
