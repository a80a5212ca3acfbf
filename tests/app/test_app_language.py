"""The page of a project in German: chosen, or as the browser asks; its reports too."""

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from apppages import TOKEN, asked_of
from browsing import chromium
from pageserver import served
from projects import small_project
from smallmachine import small_machine

from thermocomp.app.project import Project
from thermocomp.app.running import run_project
from thermocomp.app.store import Store
from thermocomp.core.exceptions import InputError
from thermocomp.recordings.readers import recordings as files
from thermocomp.report.language import load_words


@pytest.mark.parametrize(
    ("accepted", "language"),
    [("de-CH,de;q=0.9,en;q=0.8", "de"), ("fr-FR,en;q=0.5", "en"), ("en-US,de;q=0.9", "en"), ("", "en"), ("*", "en")],
)
def test_as_the_browser_asks_until_it_is_chosen(accepted: str, language: str, tmp_path: Path) -> None:
    async def work(client: httpx.AsyncClient) -> None:
        asked = {"Accept-Language": accepted}
        page = (await client.get(f"/{TOKEN}/", headers=asked)).text
        assert f'<html lang="{language}">' in page
        assert ("1 Dateien" in page) == (language == "de")
        (await client.put(f"/{TOKEN}/api/settings", json={"language": "de"})).raise_for_status()
        assert '<html lang="de">' in (await client.get(f"/{TOKEN}/", headers=asked)).text
        assert (await client.put(f"/{TOKEN}/api/settings", json={"language": "xx"})).status_code == 422

    asked_of(small_project(tmp_path / "project"), work)


@pytest.mark.parametrize("language", ['"xx"', "5", '["de"]', "{de = 1}"])
def test_an_unknown_language_in_the_file_leaves_the_page_as_the_browser_asks(language: str, tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    file = folder / "project.toml"
    file.write_text(f"language = {language}\n{file.read_text(encoding='utf-8')}", encoding="utf-8")

    async def work(client: httpx.AsyncClient) -> None:
        assert '<html lang="de">' in (await client.get(f"/{TOKEN}/", headers={"Accept-Language": "de"})).text

    asked_of(folder, work)
    with pytest.raises(InputError, match="language"):
        Project(folder)


def test_findings_are_in_the_language_of_the_project(tmp_path: Path) -> None:
    recording = small_machine()
    recording.table.loc[recording.table.index[30:60], recording.temperatures[0].name] = 21.5
    files.write(recording, tmp_path / "stuck.csv", overwrite=True)
    content = (tmp_path / "stuck.csv").read_bytes()

    async def work(client: httpx.AsyncClient) -> None:
        def told(found: dict[str, Any]) -> str:
            return " ".join(f["text"] for f in found["findings"])

        found = (await client.put(f"/{TOKEN}/api/drop/stuck.csv", content=content)).json()
        assert "29 of 800 values (3.6%) missing" in told(found)
        await client.put(f"/{TOKEN}/api/settings", json={"language": "de"})
        found = (await client.get(f"/{TOKEN}/api/recordings/{found['file']}")).json()
        assert "29 von 800 Werten (3,6%) fehlen" in told(found)

    asked_of(tmp_path / "project", work)


def test_the_reports_of_a_run_are_german(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    project = folder / "project.toml"
    head = 'language = "de"\nname = "Fräse <b>4</b>"\n'
    project.write_text(
        head + project.read_text(encoding="utf-8").replace('name = "Small machine"', ""), encoding="utf-8"
    )

    run = run_project(Project(folder), lambda *_: None)

    began = datetime.fromisoformat(run.folder.state.began).astimezone()
    for name in ("check.html", "comparison.html"):
        page = (run.folder.path / name).read_text(encoding="utf-8")
        assert f"Fräse &lt;b&gt;4&lt;/b&gt; \N{MIDDLE DOT} {began:%d.%m.%y, %H:%M} \N{MIDDLE DOT} thermocomp" in page
    assert "Prüfung der Aufzeichnung" in (run.folder.path / "check.html").read_text(encoding="utf-8")
    report = (run.folder.path / "comparison.html").read_text(encoding="utf-8")
    assert "Fehler auf nicht gelernten Daten" in report
    compared = json.loads((run.folder.path / "compare.json").read_text(encoding="utf-8"))
    assert all(
        r["verdict"] in ("accepted", "accepted for this duty", "unproven", "refused") for r in compared["results"]
    )


def test_no_english_on_the_page(tmp_path: Path) -> None:
    """Whole way in a browser: none of the translated texts is left in English."""
    folder = small_project(tmp_path / "project")
    english = [text for text in load_words("de", "app/static/", "report/static/") if len(text) > 12 and "{" not in text]
    with served(folder) as address, chromium() as browser:
        context = browser.new_context(bypass_csp=True, locale="de-DE", viewport={"width": 400, "height": 800})
        page, errors = context.new_page(), list[str]()
        page.on("pageerror", lambda e: errors.append(str(e)))
        page.goto(address)
        page.wait_for_selector("#recordings canvas", timeout=120_000)
        page.locator("#tab-judge").click()
        page.locator("#start").click()
        page.wait_for_selector("#verdict table", timeout=240_000)
        assert json.loads((folder / "runs/1/run.json").read_text(encoding="utf-8"))["state"] == "done"
        texts = []
        for tab in ("files", "judge", "plan", "deploy"):
            page.locator(f"#tab-{tab}").click()
            texts.append(page.inner_text("body"))
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert not [text for text in english if any(text in shown for shown in texts)]
        assert "Ergebnis von Lauf 1, auf nicht gelernten Daten" in texts[1]
        assert "die Wirkung von Rauschen und eines Sensorausfalls wurde nicht geprüft" in (
            page.text_content("#verdict") or ""
        )
        page.select_option("#language", "en")
        page.wait_for_function("document.documentElement.lang === 'en'")
        assert errors == []
    assert Store(folder).content()["language"] == "en"
