"""The page of a project: who may use it, what it does with files of any kind, and the whole way in a real browser."""

import asyncio
import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from browsing import RUN_AXE, axe, chromium
from projects import QUICK, small_project
from smallmachine import small_machine

from thermocomp.app import workers
from thermocomp.app.store import Store
from thermocomp.app.web import make_app
from thermocomp.core.exceptions import InputError
from thermocomp.recordings.readers import recordings as files

if TYPE_CHECKING:
    from playwright.sync_api import Page

TOKEN = "a-secret-of-the-test"
DRIFT = "files/drift.csv"


def run(folder: Path, work: Callable[[httpx.AsyncClient], Awaitable[None]], host: str = "127.0.0.1") -> None:
    async def whole() -> None:
        store = Store(folder)
        transport = httpx.ASGITransport(app=make_app(store, TOKEN))
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            try:
                await work(client)
            finally:
                await store.workers.close()

    asyncio.run(whole())


def csv_text(folder: Path) -> bytes:
    files.write(small_machine(), folder / "small.csv", overwrite=True)
    return (folder / "small.csv").read_bytes()


def test_only_with_the_address_from_the_terminal(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")

    async def work(client: httpx.AsyncClient) -> None:
        for path in ("/", "/api/project", "/wrong/", "/wrong/api/project", f"/{TOKEN}x/", "/static/app.js"):
            assert (await client.get(path)).status_code == 404
        page = await client.get(f"/{TOKEN}/")
        assert page.status_code == 200
        assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
        for path in ("app.js", "app.css", "curves.js", "uplot.min.js"):
            assert (await client.get(f"/{TOKEN}/static/{path}")).status_code == 200
        other = {"Origin": "http://evil.example"}
        assert (await client.put(f"/{TOKEN}/api/settings", json={"name": "x"}, headers=other)).status_code == 403
        assert (await client.get(f"/{TOKEN}/", headers={"Host": "evil.example"})).status_code == 400

    run(folder, work)
    assert (folder / "project.toml").read_text(encoding="utf-8") == QUICK


def test_settings_keep_comments_and_earlier_versions(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")

    async def work(client: httpx.AsyncClient) -> None:
        told = await client.put(f"/{TOKEN}/api/settings", json={"name": 'A "name"', "export": {"to": "c99"}})
        assert told.json()["settings"]["name"] == 'A "name"'
        refused = await client.put(f"/{TOKEN}/api/settings", json={"compare": {"modls": ["ols"]}})
        assert refused.status_code == 422
        assert "compare.modls: this key does not exist" in refused.json()["detail"]
        assert (await client.put(f"/{TOKEN}/api/settings", json={"export": None})).status_code == 200
        for body in ("[1]", "nonsense", '{"name": 1}', '{"compare": {"noise": NaN}}'):
            answer = await client.put(
                f"/{TOKEN}/api/settings", content=body, headers={"content-type": "application/json"}
            )
            assert answer.status_code == 422

    run(folder, work)
    text = (folder / "project.toml").read_text(encoding="utf-8")
    assert "# a comment of the user" in text
    assert "export" not in text
    assert (folder / "history" / "project.toml.1").read_text(encoding="utf-8") == QUICK
    assert 'to = "c99"' in (folder / "history" / "project.toml.2").read_text(encoding="utf-8")


def test_a_file_is_dropped_understood_changed_and_removed(tmp_path: Path) -> None:
    content, folder = csv_text(tmp_path), tmp_path / "new"

    async def work(client: httpx.AsyncClient) -> None:
        found = (await client.put(f"/{TOKEN}/api/drop/Prüfung 1.csv", content=content)).json()
        name = found["file"]
        assert name == "files/Prüfung 1.csv"
        kinds = {c["heading"]: c["kind"] for c in found["columns"]}
        assert kinds["time_s"] == "time"
        assert kinds["z_um"] == "displacement"
        assert found["targets"]
        assert found["panels"]
        again = await client.put(f"/{TOKEN}/api/drop/another.csv", content=content)
        assert again.status_code == 422
        assert "has this file already, as Prüfung 1.csv" in again.json()["detail"]
        other = (await client.put(f"/{TOKEN}/api/drop/Prüfung 1.csv", content=content + b"\n")).json()
        assert other["file"] == "files/Prüfung 1-2.csv"
        ignored = {"columns": {"x_um": {"column": "x_um", "role": "ignore"}}}
        changed = (await client.post(f"/{TOKEN}/api/recordings/{name}", json=[ignored])).json()
        assert {c["heading"]: c["kind"] for c in changed["columns"]}["x_um"] == "ignored"
        assert 'role = "ignore"' in (folder / f"{name}.toml").read_text(encoding="utf-8")
        ignored["columns"]["x_um"]["role"] = "displacement"
        await client.post(f"/{TOKEN}/api/recordings/{name}", json=[ignored])
        back = (await client.post(f"/{TOKEN}/api/undo/{name}")).json()
        assert {c["heading"]: c["kind"] for c in back["columns"]}["x_um"] == "ignored"
        assert (await client.get(f"/{TOKEN}/api/recordings/{name}")).json() == back
        assert (await client.post(f"/{TOKEN}/api/undo/{name}")).status_code == 422
        moved = (await client.post(f"/{TOKEN}/api/uses/{name}?to=assess")).json()["settings"]
        assert (len(moved["recordings"]), moved["assess"]) == (1, [{"file": name, "mapping": f"{name}.toml"}])
        assert (await client.post(f"/{TOKEN}/api/uses/{name}?to=elsewhere")).status_code == 422
        back_again = (await client.post(f"/{TOKEN}/api/uses/{name}?to=recordings")).json()["settings"]
        assert "assess" not in back_again
        joined = (await client.put(f"/{TOKEN}/api/settings", json={"join": {}})).json()["settings"]
        assert joined["join"] == {}
        left = (await client.delete(f"/{TOKEN}/api/recordings/{name}")).json()["settings"]["recordings"]
        assert [r["file"] for r in left] == ["files/Prüfung 1-2.csv"]
        assert (folder / name).exists()
        assert (await client.get(f"/{TOKEN}/api/recordings/{name}")).status_code == 422

    run(folder, work)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("photo.png", b"\x89PNG\r\n\x1a\n" + bytes(99), "files with the extension '.png' cannot be read"),
        ("empty.csv", b"", "empty"),
        ("words.csv", b"one,two\nthree,four\n", "no time column"),
        ("broken.xlsx", b"PK\x03\x04" + bytes(99), ""),
    ],
)
def test_a_hopeless_file_says_what_to_do(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    async def work(client: httpx.AsyncClient) -> None:
        answer = await client.put(f"/{TOKEN}/api/drop/{name}", content=content)
        assert answer.status_code == 200
        assert says in answer.json()["error"]
        assert len(answer.json()["error"]) > 20

    run(tmp_path / "project", work)


def test_a_guess_is_kept_as_the_mapping(tmp_path: Path) -> None:
    rows = "\n".join(f"{60 * k};{20 + 0.1 * k:.1f};{0.5 * k:.1f}" for k in range(40))
    content = f"time_s;Lager;z_um\n{rows}\n".encode()

    async def work(client: httpx.AsyncClient) -> None:
        found = (await client.put(f"/{TOKEN}/api/drop/drift.csv", content=content)).json()
        assert {c["heading"]: c["kind"] for c in found["columns"]}["Lager"] == "temperature"
        project = (await client.get(f"/{TOKEN}/api/project")).json()
        assert project["settings"]["recordings"] == [{"file": DRIFT, "mapping": f"{DRIFT}.toml"}]
        assert (await client.get(f"/{TOKEN}/api/recordings/{DRIFT}")).json() == found

    run(tmp_path / "project", work)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("..%2F..%2Fetc%2Fpasswd.csv", None),
        ("..%5C..%5Cautoexec.csv", "autoexec.csv"),
        ("CON.csv", "_CON.csv"),
        ("<img src=x onerror=alert(1)>.csv", "_img src_x onerror_alert(1)_.csv"),
        (" ..csv", "recording.csv"),
        ("a" * 300 + ".csv", "a" * 80 + ".csv"),
    ],
)
def test_names_stay_in_the_folder(tmp_path: Path, name: str, kept: str | None) -> None:
    content, folder = csv_text(tmp_path), tmp_path / "deep" / "project"

    async def work(client: httpx.AsyncClient) -> None:
        answer = await client.put(f"/{TOKEN}/api/drop/{name}", content=content)
        assert answer.status_code == (200 if kept else 404)

    run(folder, work)
    assert [p.name for p in (folder / "files").iterdir() if p.suffix == ".csv"] == ([kept] if kept else [])
    assert {p.name for p in tmp_path.rglob("*.csv")} == {"small.csv", *([kept] if kept else [])}


def test_files_outside_are_never_served(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    (folder / "runs" / "1").mkdir(parents=True)
    (folder / "runs" / "1" / "report.html").write_text("<script>1</script>", encoding="utf-8")
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    (folder / "runs" / "1" / "link.txt").symlink_to(tmp_path / "secret.txt")

    async def work(client: httpx.AsyncClient) -> None:
        page = await client.get(f"/{TOKEN}/runs/1/report.html")
        assert page.headers["content-security-policy"].startswith("sandbox allow-scripts")
        for path in ("../../project.toml", "..%2F..%2Fproject.toml", "link.txt", "none", "", "%00"):
            assert (await client.get(f"/{TOKEN}/runs/1/{path}")).status_code in (400, 404, 422)
        assert (await client.get(f"/{TOKEN}/runs/2/report.html")).status_code == 404
        for path in ("../secret.txt", "..%2Fsecret.txt", "project.toml"):
            assert (await client.get(f"/{TOKEN}/api/recordings/{path}")).status_code in (404, 422)

    run(folder, work)


def test_a_reader_that_does_not_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 0.05)

    async def work() -> None:
        source = workers.Workers()
        task = {"task": "preview", "file": str(tmp_path / "x.csv"), "mapping": "", "guess": False, "answers": []}
        with pytest.raises(InputError, match=r"more than 0\.05 s"):
            await source.ask(task)
        await source.close()

    asyncio.run(work())


def test_a_project_that_is_no_toml(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", "nonsense [")
    with pytest.raises(InputError, match="not valid TOML"):
        Store(folder)


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    """A page as the command serves it; yields its address."""
    words = [sys.executable, "-m", "thermocomp", "app", str(folder), "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield next(line.strip() for line in process.stdout if line.startswith("http://127.0.0.1:"))
        finally:
            process.terminate()
            process.communicate()


def seen_by_axe(page: "Page") -> Any:
    page.evaluate(axe())
    return page.evaluate(RUN_AXE)


def test_the_whole_way_in_a_browser(tmp_path: Path) -> None:
    """From the drop to an exported model, often by keys alone; the model is that of the command line."""
    (tmp_path / "drift.csv").write_bytes(csv_text(tmp_path))
    folder = tmp_path / "project"
    with served(folder) as address, chromium() as browser:
        context = browser.new_context(bypass_csp=True, viewport={"width": 400, "height": 800}, color_scheme="dark")
        page, errors = context.new_page(), list[str]()
        page.on("pageerror", lambda e: errors.append(str(e)))
        page.goto(address)
        page.set_input_files("#chosen", tmp_path / "drift.csv")
        page.wait_for_selector("#recordings table", timeout=120_000)
        page.wait_for_selector("#recordings canvas")
        assert page.locator(".kind.displacement").count() >= 2
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert seen_by_axe(page) == []
        page.locator("#recordings th button", has_text="x_um").focus()
        page.keyboard.press("Enter")
        page.select_option("dialog select", "ignore")
        assert seen_by_axe(page) == []
        page.locator("dialog .main").press("Enter")
        page.wait_for_selector(".kind.ignored", timeout=120_000)
        page.locator("#tab-files").focus()
        page.keyboard.press("ArrowRight")
        assert page.locator("#targets input").count() == 1
        for name in ("partial-f", "mra", "dynamic", "averaged"):
            page.uncheck(f"#methods input[value={name}]")
        page.locator("#start").press("Enter")
        page.wait_for_selector("#verdict table", timeout=240_000)
        assert "z_um" in page.inner_text("#verdict")
        assert seen_by_axe(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        page.reload()
        page.locator("#tab-deploy").click()
        page.select_option("#to", "linuxcnc")
        page.route(
            "**/api/runs?*", lambda route: route.fulfill(status=422, json={"detail": "refused for a test"}), times=1
        )
        page.locator("#target .main").press("Enter")
        page.get_by_text("refused for a test").wait_for()
        page.locator("#package", has_text="Nothing is exported yet.").wait_for()
        page.locator("#target .main").press("Enter")
        page.wait_for_selector("#package a.main", timeout=120_000)
        assert seen_by_axe(page) == []
        assert errors == []
    assert json.loads((folder / "runs" / "1" / "run.json").read_text(encoding="utf-8"))["state"] == "done"
    line = [sys.executable, "-m", "thermocomp", "fit", str(folder / DRIFT), "--mapping", str(folder / f"{DRIFT}.toml")]
    subprocess.run([*line, "--model", "ols", "-o", str(tmp_path / "model.json")], check=False, capture_output=True)
    assert (folder / "runs" / "1" / "model.json").read_bytes() == (tmp_path / "model.json").read_bytes()


def test_a_killed_server_loses_nothing(tmp_path: Path) -> None:
    """Killed while settings are changed: the project opens, with those that were confirmed or those asked for."""
    folder, number = small_project(tmp_path / "project"), 0
    for k in range(3):
        words = [sys.executable, "-m", "thermocomp", "app", str(folder), "--no-browser"]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            address = next(line.strip() for line in process.stdout if line.startswith("http://127.0.0.1:"))
            confirmed, timer = number, threading.Timer(0.15 * k, process.kill)
            with contextlib.suppress(httpx.HTTPError), httpx.Client(timeout=120.0) as client:
                while number < confirmed + 1 + k or process.poll() is None:
                    number += 1
                    client.put(f"{address}api/settings", json={"name": str(number)}).raise_for_status()
                    confirmed = number
                    if not timer.is_alive():
                        timer.start()
            process.kill()
            process.communicate()
        found = Store(folder).content()
        assert found["recordings"] == [{"file": DRIFT}]
        assert int(found["name"]) in (confirmed, number)
