"""Whoever has not the address of the page gets nothing; whoever has it may send anything, and is answered in words."""

import asyncio
import json
import random
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest
from hostile import NAMES
from pageserver import served
from projects import QUICK, small_project

from thermocomp.app import worker, workers
from thermocomp.app.runfolder import new_run
from thermocomp.app.store import Store
from thermocomp.app.web import make_app
from thermocomp.core.exceptions import InputError
from thermocomp.live.page import connections

TOKEN = "a-secret-of-the-test"
JSON = {"content-type": "application/json"}
TABLES = ["name", "recordings", "join", "compare", "limits", "fit", "export", "assess", "columns"]
KEYS = ["columns", "time", "read", "column", "role", "unit", "scale", "format", "start", "rows", "file", "to", "models"]


def run(folder: Path, work: Callable[[httpx.AsyncClient, Store], Awaitable[None]]) -> None:
    async def whole() -> None:
        store = Store(folder)
        transport = httpx.ASGITransport(app=make_app(store, TOKEN))  # an exception in the server is raised here
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            try:
                await work(client, store)
            finally:
                await store.workers.close()

    asyncio.run(whole())


async def operations(client: httpx.AsyncClient) -> list[tuple[str, str]]:
    """Methods and paths of the page, by its own description; the stream of events has no end."""
    described = (await client.get(f"/{TOKEN}/openapi.json")).json()["paths"]
    return [(method.upper(), path) for path, ways in described.items() for method in ways if "events" not in path]


def test_without_the_token_nothing_is_served(tmp_path: Path) -> None:
    """Not even the description of the page, which names the token in its paths."""
    folder = small_project(tmp_path / "project")

    async def work(client: httpx.AsyncClient, _: Store) -> None:
        found = await operations(client)
        assert len(found) > 10
        for path in ("/openapi.json", "/docs", "/redoc", "/"):
            answer = await client.get(path)
            assert (answer.status_code, TOKEN in answer.text) == (404, False)
        for method, path in found:
            named = path.format(name="files/drift.csv", number=1, other=1)
            for without in (
                named.replace(TOKEN, "x"),
                named.replace(f"/{TOKEN}", ""),
                named.replace(TOKEN, TOKEN[:-1]),
            ):
                assert (await client.request(method, without)).status_code == 404
            other = await client.request(method, named, headers={"Host": "evil.example"})
            assert other.status_code == 400
            for foreign in ("http://evil.example", "null"):
                assert (await client.request(method, named, headers={"Origin": foreign})).status_code == 403

    run(folder, work)
    assert (folder / "project.toml").read_text(encoding="utf-8") == QUICK


@pytest.mark.parametrize(
    "body",
    ["[NaN]", '["\\ud800"]', '{"name": "\\ud800"}', '{"a": [null]}', '{"compare": {"\\ud800": 1}}',
     '{"compare":' + "[" * 900 + "]" * 900 + "}", "[" * 100_000, b"\xff\xfe"],
)  # fmt: skip
def test_settings_that_toml_cannot_hold_are_refused(tmp_path: Path, body: str | bytes) -> None:
    async def work(client: httpx.AsyncClient, _: Store) -> None:
        answer = await client.put(f"/{TOKEN}/api/settings", content=body, headers=JSON)
        assert answer.status_code in (400, 422)
        assert "ValueError" not in answer.json()["detail"]

    run(small_project(tmp_path / "project"), work)


class Drawn:
    """Requests of any kind: half of each is right, so that the rest is reached."""

    def __init__(self, seed: int, files: list[str]) -> None:
        self.lot, self.files = random.Random(seed), files

    def value(self, depth: int = 0) -> Any:
        kind = self.lot.randrange(6 if depth < 3 else 4)
        if kind > 3:
            some = range(self.lot.randrange(4))
            return (
                [self.value(depth + 1) for _ in some]
                if kind == 4
                else {self.key(): self.value(depth + 1) for _ in some}
            )
        odd: list[Any] = [None, True, {}, [], "", 0, -1, 2**63, -(10**400), 1e308, float("nan"), float("inf"), 0.5]
        known = ["ols", "z_um", "cycle", "temperature", "um", "ignore", "%Y", *self.files]
        return self.lot.choice((odd, known, [name[:300] for name in NAMES])[kind % 3])

    def key(self) -> str:
        return self.lot.choice([*KEYS, self.lot.choice(NAMES)[:99]])

    def body(self, path: str) -> bytes:
        lot = self.lot
        if lot.random() < 0.1:
            return lot.randbytes(lot.randrange(99))
        if path.endswith("settings"):
            return json.dumps({lot.choice(TABLES): self.value() for _ in range(lot.randrange(1, 4))}).encode()
        column = {lot.choice(["t1_C", "z_um", self.key()]): {self.key(): self.value() for _ in range(3)}}
        return json.dumps([lot.choice([{"columns": column}, {self.key(): self.value()}])]).encode()

    def path(self, path: str) -> str:
        """Fill in a name and a number."""
        name = self.lot.choice([*self.files, "comparison.html", "run.json", self.lot.choice(NAMES)[:300]])
        name = quote(name, errors="replace")
        path = path.replace("{number}", str(self.lot.choice((1, 2, 0, -1, 10**30, "x"))))
        question = self.lot.choice(("", "?to=assess", "?to=recordings", "?again=true", "?to=%00", "?again=[]"))
        return path.replace("{name}", name) + question


def try_requests(folder: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> dict[int, int]:
    """Send random requests to a page that reads files in its own process; return the answers by status."""

    async def ask(_: object, task: Mapping[str, Any]) -> dict[str, Any]:
        given = json.loads(json.dumps(dict(task)))
        try:
            found = worker.do_task(given)
        except InputError as e:
            raise InputError(str(e)) from e
        json.dumps(found, allow_nan=False)
        return found

    async def idle(_: Store, *, again: bool, number: int = 0) -> None: ...

    monkeypatch.setattr(workers.Workers, "ask", ask)
    monkeypatch.setattr(workers.Workers, "warm_up", lambda _: None)
    monkeypatch.setattr(Store, "start_run", idle)
    small_project(folder)
    done = new_run(folder)
    (done.path / "comparison.html").write_text("<p>", encoding="utf-8")
    done.save()
    found = dict[int, int]()

    async def work(client: httpx.AsyncClient, _: Store) -> None:
        known = await operations(client)
        for k in range(count):
            files = [f"files/{p.name}" for p in sorted((folder / "files").iterdir())[:6] if p.suffix != ".toml"]
            drawn = Drawn(k, files)
            method, path = drawn.lot.choice(known)
            sent = drawn.body(path) if method in ("POST", "PUT") else b""
            answer = await client.request(method, drawn.path(path), content=sent, headers=JSON)
            assert answer.status_code < 500, (k, method, path, sent)
            found[answer.status_code] = found.get(answer.status_code, 0) + 1
            if method == "DELETE" or k % 50 == 0:  # the next ones find the recording again
                (folder / "project.toml").write_text(QUICK, encoding="utf-8")
                for file in sorted((folder / "files").iterdir()):
                    if file.name != "drift.csv":
                        file.unlink()

    run(folder, work)
    return found


def test_random_requests_are_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert {200, 422, 404} <= set(try_requests(tmp_path / "project", 300, monkeypatch))


@pytest.mark.long
def test_many_random_requests_are_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    print(try_requests(tmp_path / "project", 20_000, monkeypatch))


def test_one_run_at_a_time_and_what_it_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also what it says before it has a folder: the recording is gone, the settings are not valid."""
    folder = small_project(tmp_path / "project")
    started = list[Any]()

    class Process:
        code: int | None = None

        def __init__(self, words: list[str], **options: Any) -> None:
            options["stdout"].write(b"error: files/drift.csv:\n  the file is missing\n")
            started.append(self)

        def poll(self) -> int | None:
            return self.code

    monkeypatch.setattr(subprocess, "Popen", Process)

    async def work(client: httpx.AsyncClient, _: Store) -> None:
        for status in (200, 422, 422):
            assert (await client.post(f"/{TOKEN}/api/runs")).status_code == status
        assert len(started) == 1
        assert (await client.get(f"/{TOKEN}/api/project")).json()["trouble"] == ""
        started[0].code = 2
        found = (await client.get(f"/{TOKEN}/api/project")).json()
        assert found["trouble"] == "error: files/drift.csv: the file is missing"
        assert (await client.post(f"/{TOKEN}/api/runs")).status_code == 200

    run(folder, work)


def test_a_run_whose_result_is_there_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its process needs a moment more to end: the next order on the page is obeyed, not refused."""
    folder, popen, started = small_project(tmp_path / "project"), subprocess.Popen, list[subprocess.Popen[bytes]]()

    def start(_: list[str], **options: Any) -> subprocess.Popen[bytes]:
        started.append(popen([sys.executable, "-c", "import time; time.sleep(3)"], **options))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)

    async def work(client: httpx.AsyncClient, _: Store) -> None:
        assert (await client.post(f"/{TOKEN}/api/runs")).status_code == 200
        assert (await client.post(f"/{TOKEN}/api/runs")).status_code == 422  # it has no result
        with new_run(folder).working():
            assert (await client.post(f"/{TOKEN}/api/runs")).status_code == 422
        assert started[0].poll() is None
        several = await asyncio.gather(*(client.post(f"/{TOKEN}/api/runs") for _ in range(3)))
        assert sorted(answer.status_code for answer in several) == [200, 422, 422]
        assert started[0].poll() == 0
        assert len(started) == 2
        started[1].wait()

    run(folder, work)


def test_a_slow_upload_is_not_cut_off(tmp_path: Path) -> None:
    """It takes longer than a page waits for a request, as a large file on a slow disk."""
    rows = b"".join(b"%d,20.5,%d\n" % (k, k) for k in range(40))
    with served(tmp_path / "project") as address:
        pause = connections.PATIENCE / 8

        def parts() -> Any:
            yield b"time_s,t1_C,z_um\n"
            for k in range(10):
                time.sleep(pause)
                yield rows[k * len(rows) // 10 : (k + 1) * len(rows) // 10]

        headers = {"Content-Length": str(len(rows) + 17)}
        answer = httpx.put(f"{address}api/drop/slow.csv", content=parts(), headers=headers, timeout=120.0)
        assert answer.json()["targets"] == ["z_um"]
