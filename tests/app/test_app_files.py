"""Files of loggers, spreadsheets and databases go from the drop to a verdict in the page alone, in a few clicks."""

import os
import statistics
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browsing import chromium
from drifttests import ONE_FILE, write_drift
from pageserver import served

if TYPE_CHECKING:
    from playwright.sync_api import Page

#: of a comparison with all methods [ms]
LONGEST = 900_000


class Hand:
    """Uses a page as a person does, and counts the clicks."""

    def __init__(self, page: "Page") -> None:
        self.page, self.clicks = page, 0
        self.errors = list[str]()
        page.on("pageerror", lambda e: self.errors.append(str(e)))

    def click(self, what: str, text: str | None = None) -> None:
        self.page.locator(what, has_text=text).first.click()
        self.clicks += 1

    def choose(self, files: list[Path]) -> None:
        """Choose files in the dialog of the system: a click on the page, and one in the dialog."""
        with self.page.expect_file_chooser() as chooser:
            self.page.locator("#drop label").click()
        chooser.value.set_files(files)
        self.clicks += 2
        self.page.wait_for_selector(f"#recordings .card >> nth={len(files) - 1}", timeout=120_000)
        self.page.wait_for_selector("#busy:empty", state="attached", timeout=120_000)


def to_verdict(page: "Page", files: list[Path]) -> int:
    """Go from the drop of files to the verdict; return the number of clicks."""
    hand = Hand(page)
    hand.choose(files)
    if len(files) > 1:
        hand.click("#join")
    hand.click("#to-judge")
    hand.click("#start")
    page.wait_for_selector("#verdict table, #progress .failed", timeout=LONGEST)
    assert page.locator("#progress .failed").count() == 0, page.inner_text("#progress")
    assert set(page.locator("#verdict tbody tr td:nth-child(3)").all_inner_texts()) <= {
        "accepted",
        "accepted for this duty",
        "unproven",
        "refused",
    }
    assert hand.errors == []
    return hand.clicks


@pytest.mark.parametrize("name", ["Driftversuch März.xlsx", "two loggers"])
def test_it_goes_from_the_drop_to_a_verdict(tmp_path: Path, name: str) -> None:
    """With one quick method; all methods, and the other files: `test_eleven_files_in_few_clicks`."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "project.toml").write_text(
        '[compare]\nmodels = ["ols"]\nrobustness = false\njobs = 1\n', encoding="utf-8"
    )
    with served(folder) as address, chromium() as browser:
        page = browser.new_page()
        page.goto(address)
        assert to_verdict(page, write_drift(name, tmp_path)) <= 12


@pytest.mark.long
def test_eleven_files_in_few_clicks(tmp_path: Path) -> None:
    clicks, real = dict[str, int](), Path(os.environ.get("THERMOCOMP_DATA", "../shared/data")) / "fl_thermal"
    for name in [*ONE_FILE, "two loggers", "fl_thermal"]:
        if name == "fl_thermal" and not real.exists():
            continue
        (tmp_path / name).mkdir()
        files = [real / "recording.csv"] if name == "fl_thermal" else write_drift(name, tmp_path / name)
        with served(tmp_path / name / "project") as address, chromium() as browser:
            page, began = browser.new_page(), time.monotonic()
            page.goto(address)
            clicks[name] = to_verdict(page, files)
            print(
                f"{name}: {clicks[name]} clicks, {time.monotonic() - began:.0f} s, {page.inner_text('#verdict table')}"
            )
    assert statistics.median(clicks.values()) <= 12, clicks


def test_a_hopeless_file_ends_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "report.pdf").write_bytes(b"%PDF-1.7 a report of the drift test, as a document")
    (tmp_path / "words.csv").write_bytes(b"remark,by\nthe machine was warm,lab\nthe door was open,lab\n")
    with served(tmp_path / "project") as address, chromium() as browser:
        page = browser.new_page()
        page.goto(address)
        hand = Hand(page)
        hand.choose([tmp_path / "report.pdf", tmp_path / "words.csv"])
        for card in page.locator("#recordings .card").all():
            assert "Export it again from the logger as a table" in card.inner_text()
        for file in ("report.pdf", "words.csv"):
            hand.click(f"[data-file='files/{file}'] button", "Remove")
        page.wait_for_selector("#recordings:empty", state="attached")
        assert page.is_hidden("#to-judge")
        assert hand.errors == []
