"""Sensors on the sketch of a machine: by mouse and by keys, kept in the settings, without a new run."""

from pathlib import Path
from typing import Any

import pytest
from apppages import TOKEN, asked_of, opened
from httpx import AsyncClient
from projects import QUICK, small_project

from thermocomp.app.project import Project
from thermocomp.app.store import Store


def sketch(folder: Path) -> Any:
    return Store(folder).content().get("sketch")


def test_sensors_are_placed(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK)
    before = Project(folder).fingerprint()
    with opened(folder) as page:
        page.wait_for_selector("#sketch:not([hidden])", timeout=120_000)
        page.locator("#sketch summary").press("Enter")
        assert page.locator("#sketch g.free").count() == 3
        first, second = (page.get_by_role("button", name=f"{name}, ") for name in ("t1_C", "t2_C"))
        for key in ("ArrowRight", "ArrowUp", "ArrowUp"):
            first.press(key)
        page.wait_for_function("state.settings.sketch && 't1_C' in state.settings.sketch.places")
        assert sketch(folder) == {"machine": "mill", "places": {"t1_C": [0.5, 0.46]}}
        area, dot = page.locator("#sketch svg").bounding_box(), second.locator("circle").bounding_box()
        assert area is not None
        assert dot is not None
        page.mouse.move(dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
        page.mouse.down()
        page.mouse.move(area["x"] + 0.25 * area["width"], area["y"] + 0.5 * area["height"], steps=3)
        page.mouse.up()
        page.wait_for_function("'t2_C' in state.settings.sketch.places")
        assert sketch(folder)["places"]["t2_C"] == pytest.approx([0.25, 0.57], abs=0.01)  # 228 units high, of which 200
        outline = page.locator("#sketch path").first.get_attribute("d")
        page.select_option("#machine", "lathe")
        assert page.locator("#sketch path").first.get_attribute("d") != outline
        page.wait_for_function("state.settings.sketch.machine === 'lathe'")
        first.press("Delete")
        page.wait_for_function("!('t1_C' in state.settings.sketch.places)")
        page.reload()
        page.wait_for_selector("#sketch:not([hidden])", timeout=120_000)
        page.locator("#sketch summary").press("Enter")
        assert page.input_value("#machine") == "lathe"
        assert page.locator("#sketch g:not(.free)").count() == 1
    assert Project(folder).fingerprint() == before


def test_places_outside_the_sketch_are_refused(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK)

    async def work(client: AsyncClient) -> None:
        for wrong in ({"places": {"t1_C": [0.5, 1.5]}}, {"places": {"t1_C": [0.5]}}, {"machine": "oven"}):
            assert (await client.put(f"/{TOKEN}/api/settings", json={"sketch": wrong})).status_code == 422
        right = {"places": {"<img src=x onerror=alert(1)>": [0.5, 1.0]}}
        assert (await client.put(f"/{TOKEN}/api/settings", json={"sketch": right})).status_code == 200

    asked_of(folder, work)
    assert sketch(folder)["places"] == {"<img src=x onerror=alert(1)>": [0.5, 1.0]}
