"""The whole way by keys alone, in a narrow dark window and a wide bright one; axe-core finds no serious fault."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browsing import RUN_AXE, axe, chromium
from drifttests import write_drift
from pageserver import served

if TYPE_CHECKING:
    from playwright.sync_api import Page


class Keys:
    """Uses a page by keys alone."""

    def __init__(self, page: "Page", pictures: Path) -> None:
        self.page, self.pictures = page, pictures

    def go(self, selector: str) -> None:
        """Press Tab until an element that matches has the focus, and see that the focus is visible."""
        for k in range(150):
            if k:
                self.page.keyboard.press("Tab")
            if self.page.evaluate("s => document.activeElement.matches(s)", selector):
                seen = "getComputedStyle(document.activeElement).outlineStyle !== 'none'"
                assert self.page.evaluate(seen), f"the focus on {selector} cannot be seen"
                return
        raise AssertionError(f"no way to {selector}")

    def press(self, selector: str, *keys: str) -> None:
        self.go(selector)
        for key in keys or ("Enter",):
            self.page.keyboard.press(key)

    def look(self, state: str) -> None:
        """See that nothing is too wide, and what axe-core says."""
        self.page.evaluate(axe())
        assert self.page.evaluate(RUN_AXE) == [], state
        assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), state
        self.page.screenshot(path=self.pictures / f"{state}.png", full_page=True)


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), pytest.param(1200, "light", marks=pytest.mark.long)])
def test_the_whole_way_by_keys(tmp_path: Path, width: int, scheme: str) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    settings = '[compare]\nmodels = ["ols", "mra"]\nrobustness = false\njobs = 1\n'
    (folder / "project.toml").write_text(settings, encoding="utf-8")
    (tmp_path / "words.csv").write_bytes(b"remark,by\nthe machine was warm,lab\n")
    with served(folder) as address, chromium() as browser:
        context = browser.new_context(
            bypass_csp=True,
            viewport={"width": width, "height": 800},
            color_scheme="dark" if scheme == "dark" else "light",
        )
        page = context.new_page()
        keys = Keys(page, tmp_path)
        page.goto(address)
        page.wait_for_function("document.getElementById('command').textContent")
        keys.look("empty")
        keys.press("#name", *"Mill")
        with page.expect_file_chooser() as chooser:
            keys.press("#chosen")
        chooser.value.set_files([*write_drift("Driftversuch März.xlsx", tmp_path), tmp_path / "words.csv"])
        page.wait_for_selector("#recordings .card >> nth=1 >> .trouble", timeout=120_000)
        page.wait_for_selector("#recordings canvas")
        keys.look("files")
        keys.press("#recordings th:nth-child(8) button")
        keys.look("column")
        keys.press("dialog label:first-child select", "i")  # ignore
        keys.press("dialog .main")
        page.wait_for_selector("th:nth-child(8) .kind.ignored", timeout=120_000)
        keys.press("[data-file='files/words.csv'] h2 button")  # remove it
        page.wait_for_selector("[data-file='files/words.csv']", state="detached")
        keys.press("#to-judge")
        keys.press("#methods input[value=mra]", "Space")
        keys.look("judge")
        keys.press("#start")
        page.wait_for_selector("#progress progress", timeout=120_000)
        keys.look("running")
        page.wait_for_selector("#verdict table", timeout=300_000)
        keys.look("verdict")
        page.keyboard.press("Home")
        keys.press("#tab-judge", "ArrowRight", "ArrowRight")
        keys.press("#to", "s", "s")
        keys.press("#target .main")
        page.wait_for_selector("#package a.main", timeout=120_000)
        keys.look("deployed")
        keys.press("#package a.main")
    assert '"mra"' not in (folder / "runs" / "1" / "project.toml").read_text(encoding="utf-8")
    assert (folder / "project.toml").read_text(encoding="utf-8").startswith('name = "Mill"')
