"""Thermal cycles by hand on the page: dragged, moved, merged, split, and found again; each change can be undone."""

from pathlib import Path
from typing import TYPE_CHECKING

from apppages import opened
from projects import QUICK, small_project

import thermocomp as tc
from thermocomp.app.project import Project

if TYPE_CHECKING:
    from playwright.sync_api import Page


def borders(folder: Path) -> list[int]:
    """Row of each border, as a run reads the recording."""
    (first,) = Project(folder).settings.recordings
    recording = tc.read(folder / first.file, folder / first.mapping if first.mapping else None)
    return [c.start for c in recording.cycles][1:]


def wait_for(page: "Page", number: int) -> None:
    page.wait_for_selector(f"details.cycles summary:has-text('Thermal cycles: {number}')", timeout=120_000)
    page.wait_for_function("document.getElementById('busy').textContent === ''")


def test_cycles_by_keys(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK)
    before = borders(folder)
    with opened(folder) as page:
        wait_for(page, 4)
        page.locator("details.cycles summary").press("Enter")
        page.get_by_label("merge cycle 2").press("Enter")
        wait_for(page, 3)
        assert borders(folder) == before[1:]
        page.get_by_label("split cycle 3").press("Enter")
        wait_for(page, 4)
        assert borders(folder)[:2] == before[1:]
        page.get_by_label("start of cycle 2").fill("6.05")
        page.get_by_label("start of cycle 2").press("Tab")
        page.wait_for_function("document.querySelectorAll('.cycles input')[1].value === '6.0500'", timeout=120_000)
        assert borders(folder)[0] == round(6.05 * 60)
        page.get_by_role("button", name="Undo the last change").press("Enter")
        page.wait_for_function("document.querySelectorAll('.cycles input')[1].value !== '6.0500'", timeout=120_000)
        assert borders(folder)[:2] == before[1:]
        page.get_by_label("start of cycle 2").fill("0")
        page.get_by_label("start of cycle 2").press("Tab")
        page.wait_for_selector("#recordings .trouble:has-text('would have no rows')", timeout=120_000)
        page.get_by_role("button", name="Undo the last change").press("Enter")
        wait_for(page, 4)
        page.get_by_role("button", name="Find the cycles again").press("Enter")
        page.wait_for_selector("#recordings pre:has-text('starts = []')", state="attached", timeout=120_000)
        assert borders(folder) == before


def test_a_border_is_dragged(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK)
    before = borders(folder)
    with opened(folder, width=1200, dark=False) as page:
        wait_for(page, 4)
        over = page.locator("#recordings .u-over").last
        over.scroll_into_view_if_needed()
        box = over.bounding_box()
        assert box is not None
        hours = 799 / 60
        x = box["x"] + box["width"] * before[0] / 60 / hours
        page.mouse.move(x, box["y"] + 60)
        page.mouse.down()
        page.mouse.move(x + 50, box["y"] + 60, steps=4)
        page.mouse.up()
        page.wait_for_selector("#recordings pre", state="attached", timeout=120_000)
        moved = borders(folder)
        assert moved[1:] == before[1:]
        assert abs(moved[0] - before[0] - 50 / box["width"] * hours * 60) < 3
        page.mouse.move(2, 2)
