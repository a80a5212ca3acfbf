"""Files made to do harm are dropped on the page: it answers in words, and no name in them runs as a script."""

import asyncio
import json
import random
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import httpx
import pytest
from browsing import chromium
from hostile import NAMES
from hostile_files import HOSTILE, bases, damaged
from pageserver import served
from smallmachine import small_machine

from thermocomp.app import worker, workers
from thermocomp.app.store import Store
from thermocomp.app.web import make_app
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from playwright.sync_api import Dialog, Page

TOKEN = "a-secret-of-the-test"
SCRIPT = "<img src=x onerror=window.hacked=1;alert(1)>"
#: text of a file name, a column, a cycle, a project: whatever is shown anywhere
SCRIPTS = [SCRIPT, "<script>window.hacked=1;alert(2)</script>", "\"'><svg onload=alert(3)>", "</script>" + SCRIPT]
FILE_NAMES = [
    *SCRIPTS,
    "../../x",
    "..\\..\\x",
    "CON",
    "nul",
    "x" * 5000,
    "\U0001f600",
    "a\x00b",
    ".",
    " ",
    "-rf",
    *NAMES,
]
#: files of a kind of their own that take little time
QUICK = [
    "parquet kinds",
    "parquet bytes",
    "parquet nested",
    "utf-16",
    "formulas",
    "own format",
    "cell beyond",
    "entities",
]
#: memory of a process that reads a file [MB]
MOST = 700


async def drop(client: httpx.AsyncClient, name: str, content: bytes) -> httpx.Response:
    place = quote(name, safe="", errors="replace")
    answer = await client.put(f"/{TOKEN}/api/drop/{place}", content=content)
    said = answer.json()
    assert answer.status_code in (200, 422, 404), name
    assert said.get("error") or said.get("columns") or said["detail"], name
    return answer


def drop_many(folder: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> dict[int, int]:
    """Drop damaged files under names of all kinds; they are read here, so that no error of the reader is overheard."""

    async def ask(_: object, task: Mapping[str, Any]) -> dict[str, Any]:
        given = json.loads(json.dumps(dict(task)))
        try:
            found: dict[str, Any] = json.loads(json.dumps(worker.do_task(given), allow_nan=False))
        except InputError as e:
            raise InputError(str(e)) from e
        return found

    monkeypatch.setattr(workers.Workers, "ask", ask)
    found, sound = dict[int, int](), bases()

    async def work() -> None:
        store = Store(folder)
        transport = httpx.ASGITransport(app=make_app(store, TOKEN))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            for kind in QUICK:
                await drop(client, f"{kind}.{HOSTILE[kind][0]}", HOSTILE[kind][1]())
            for k in range(count):
                ending, content = damaged(k, sound)
                lot = random.Random(k)
                name = f"{lot.choice(FILE_NAMES)}.{ending}"
                if lot.random() < 0.3:
                    heading = lot.choice(FILE_NAMES).encode("utf-8", "replace")
                    content = content.replace(b"t1_C", heading + b"_C").replace(b"Spindle", heading)
                status = (await drop(client, name, content)).status_code
                found[status] = found.get(status, 0) + 1
                if k % 20 == 19:  # the list of recordings is read and written at each drop
                    (folder / "project.toml").write_text("", encoding="utf-8")

    asyncio.run(work())
    assert {p.name for p in folder.iterdir()} <= {"files", "history", "project.toml"}
    assert all(p.resolve().parent == (folder / "files").resolve() for p in (folder / "files").iterdir())
    return found


def test_damaged_files_under_odd_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert drop_many(tmp_path / "project", 60, monkeypatch)[200] > 30


@pytest.mark.long
def test_many_damaged_files_under_odd_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    print(drop_many(tmp_path / "project", 2000, monkeypatch))


class Measured(workers.Workers):
    """Keeps the most memory that a reader has used [MB]."""

    most = 0

    async def watch(self) -> None:
        while True:
            for status in Path("/proc").glob("[0-9]*/status"):
                try:
                    if b"thermocomp.app.worker" in (status.parent / "cmdline").read_bytes():
                        self.most = max(self.most, int(status.read_text().partition("VmHWM:")[2].split()[0]) // 1024)
                except (OSError, IndexError):  # it has ended
                    continue
            await asyncio.sleep(0.05)


@pytest.mark.long
@pytest.mark.parametrize("name", HOSTILE)
def test_a_file_made_to_exhaust_ends_its_reader_alone(tmp_path: Path, name: str) -> None:
    """Bombs, very many columns, rows and cells, encodings: the page answers, in bounded memory."""
    ending, make = HOSTILE[name]

    async def work() -> None:
        store = Store(tmp_path)
        store.workers = measured = Measured()
        watching = asyncio.create_task(measured.watch())
        transport = httpx.ASGITransport(app=make_app(store, TOKEN))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            answer = await drop(client, f"{name}.{ending}", make())
            assert (await client.get(f"/{TOKEN}/api/project")).status_code == 200
        watching.cancel()
        await store.workers.close()
        print(f"{name}: {measured.most} MB, answer {len(answer.content):,} bytes")
        assert 0 < measured.most < MOST
        assert "process ended" not in answer.text
        assert len(answer.content) < 20_000_000

    asyncio.run(work())


def look_at(page: "Page") -> None:
    """Wait for what a script would have needed, and look for its traces."""
    page.wait_for_timeout(300)
    assert not page.evaluate("window.hacked")
    assert page.locator("img[src=x], svg[onload]").count() == 0


def test_no_name_runs_as_a_script(tmp_path: Path) -> None:
    """Of a folder, a project, a file, its columns, cycles and cells, on the page and in the results."""
    table = small_machine(dt=120.0).table.drop(columns="x_um")
    names = zip([*(s.replace('"', "") for s in SCRIPTS), "z"], ["degC", "degC", "degC", "rpm", "um"], strict=True)
    table.columns = [f'"{name} {k} ({unit})"' for k, (name, unit) in enumerate(names)]
    table.insert(0, "time_s", [120.0 * k for k in range(len(table))])
    table["cycle"] = [f"{SCRIPT}{k // 100}" for k in range(len(table))]
    text = ",".join(table.columns) + "\n" + table.to_csv(index=False, header=False)
    (tmp_path / f"{SCRIPT}.csv").write_text(text, encoding="utf-8")
    (tmp_path / "hopeless.csv").write_text(f"{SCRIPT},{SCRIPTS[1]}\n{SCRIPT},{SCRIPT}\n", encoding="utf-8")
    folder = tmp_path / SCRIPT.replace("/", "_")
    folder.mkdir()
    setting = json.dumps(SCRIPTS[1])
    (folder / "project.toml").write_text(
        f'name = {setting}\n[compare]\nmodels = ["ols"]\nrobustness = false\njobs = 1\n', encoding="utf-8"
    )
    with served(folder) as address, chromium() as browser:
        context, dialogs = browser.new_context(bypass_csp=True), list[str]()  # the policy would hide a fault
        page = context.new_page()

        def dismiss(dialog: "Dialog") -> None:
            dialogs.append(dialog.message)
            dialog.dismiss()

        context.on("dialog", dismiss)
        page.goto(address)
        page.set_input_files("#chosen", [tmp_path / f"{SCRIPT}.csv", tmp_path / "hopeless.csv"])
        page.wait_for_selector("#recordings .card >> nth=1 >> .trouble", timeout=120_000)
        page.wait_for_selector("#recordings canvas")
        look_at(page)
        page.locator("#recordings th button", has_text="onerror").first.click()
        look_at(page)
        page.locator("dialog button", has_text="Cancel").click()
        page.locator("[data-file='files/hopeless.csv'] button", has_text="Remove").click()
        page.locator("#tab-judge").click()
        page.locator("#start").click()
        page.wait_for_selector("#verdict table, #progress .failed", timeout=300_000)
        assert page.locator("#progress .failed").count() == 0, page.inner_text("#progress")
        look_at(page)
        for report in ("comparison.html", "check.html"):
            with context.expect_page() as opened:
                page.locator(f"#verdict a[href$='{report}']").click()
            opened.value.wait_for_load_state()
            assert "onerror" in opened.value.content()
            look_at(opened.value)
            opened.value.close()
        page.locator("#tab-deploy").click()
        page.locator("#target .main").click()
        page.wait_for_selector("#package a.main, #progress .failed", timeout=120_000)
        look_at(page)
        assert dialogs == []
