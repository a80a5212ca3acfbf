"""Curves with hover and zoom, and every page in a real browser: screen, dark, phone, keyboard, without JavaScript."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browsing import RUN_AXE, axe, chromium, show
from smallmachine import small_machine
from watchedmachine import failing, watched_model

from thermocomp.judging import assessing, selecting, splits
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.starts import Start
from thermocomp.report import assessed, checks, curves, html
from thermocomp.report.figures import thin_points

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def _check() -> str:
    good = small_machine()
    table = good.table.copy()
    table.loc[400:402, "z_um"] += 4300.0
    table.loc[500:520, "t1_C"] = np.nan
    bad = replace(good, table=table)
    return checks.render([good, bad], [check(good), check(bad)])


def _assess() -> str:
    recording = failing(t1_C=(4.0, 4.0), t3_C=(9.0, None))
    return assessed.render(assessing.assess([watched_model()], [recording], starts=Start()), [recording])


@pytest.fixture(scope="module")
def pages(samples: Samples, recording: Recording) -> dict[str, str]:
    by_cycle = splits.leave_one_cycle_out(samples)
    judged = compare(samples, ["averaged"], by_cycle)
    return {
        "compare": html.render(judged, [recording], samples),
        "assess": _assess(),
        "check": _check(),
        "select": html.render_choices(selecting.select("grouping", samples, by_cycle, Settings()), [recording]),
    }


@pytest.fixture(scope="module")
def browser() -> "Iterator[Browser]":
    with chromium() as found:
        yield found


def panels(page: str) -> list[list[dict[str, Any]]]:
    return [json.loads(text) for text in re.findall(r'<script type="application/json">(.*?)</script>', page)]


@pytest.mark.parametrize("name", ["compare", "assess", "check", "select"])
def test_everyone_can_read_it(name: str, pages: dict[str, str], browser: "Browser", tmp_path: Path) -> None:
    """No serious fault for axe-core on a screen, in the dark and on a phone; no width scrolls sideways."""
    shown = browser.new_page(viewport={"width": 1100, "height": 900})
    show(shown, pages[name], tmp_path)
    shown.evaluate(axe())
    found = {"screen": shown.evaluate(RUN_AXE)}
    shown.emulate_media(color_scheme="dark")
    found["dark"] = shown.evaluate(RUN_AXE)
    for width in (1160, 1000, 750, 400):
        shown.set_viewport_size({"width": width, "height": 900})
        shown.wait_for_function(f"document.documentElement.scrollWidth <= {width}")  # curves follow the window
    found["phone"] = shown.evaluate(RUN_AXE)
    assert not any(found.values()), found
    assert shown.locator(".uplot").count() == sum(map(len, panels(pages[name])))
    shown.close()


def test_hover_zoom_and_keys(pages: dict[str, str], browser: "Browser", tmp_path: Path) -> None:
    shown = browser.new_page(viewport={"width": 1100, "height": 900})
    show(shown, pages["compare"], tmp_path)
    figure = shown.locator("figure.drawn").first
    assert figure.locator("> svg").is_hidden()
    speed, heat = figure.locator(".u-over").all()[:2]
    heat.scroll_into_view_if_needed()
    box = heat.bounding_box()
    assert box is not None
    shown.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20)
    times = figure.locator(".u-legend tr:first-child td")
    assert [t.split(" h")[0] for t in times.all_inner_texts()] == [times.first.inner_text().split(" h")[0]] * 3
    assert float(times.first.inner_text().split(" h")[0]) == pytest.approx(13.32 / 2, abs=0.1)
    value = figure.locator(".uplot").nth(1).locator("tr", has_text="t1_C").locator("td")
    assert 20 < float(value.inner_text()) < 42
    shown.mouse.down()
    shown.mouse.move(box["x"] + box["width"] * 0.75, box["y"] + 30, steps=3)
    shown.mouse.up()
    speed.focus()
    shown.keyboard.press("End")
    told = speed.get_attribute("aria-valuetext") or ""
    assert float(told.removeprefix("time ").split(" h")[0]) == pytest.approx(13.32 * 0.75, abs=0.1)  # zoomed alike
    shown.keyboard.press("Home")
    shown.keyboard.press("ArrowRight")
    assert float((speed.get_attribute("aria-valuetext") or "")[4:].split(" h")[0]) == pytest.approx(6.7, abs=0.1)
    figure.get_by_role("button", name="all").click()
    speed.focus()
    shown.keyboard.press("End")
    assert (speed.get_attribute("aria-valuetext") or "").startswith("time 13.32 h, 4 (3000 1/min); spindle_rpm 0")
    name = figure.get_by_role("button", name="t2_C")
    before = figure.locator("canvas").nth(1).evaluate("c => c.toDataURL()")
    name.focus()
    shown.keyboard.press("Enter")
    assert name.get_attribute("aria-pressed") == "false"
    shown.wait_for_function("before => document.querySelectorAll('canvas')[1].toDataURL() !== before", arg=before)
    shown.close()


def test_on_paper_and_without_javascript_the_pictures_stay(
    pages: dict[str, str], browser: "Browser", tmp_path: Path
) -> None:
    shown = browser.new_page(viewport={"width": 1100, "height": 900})
    show(shown, pages["compare"], tmp_path)
    shown.emulate_media(media="print")
    bare = browser.new_context(java_script_enabled=False).new_page()
    bare.goto((tmp_path / "page.html").as_uri())
    for page in (shown, bare):
        pictures = page.locator("figure:has(> script) > svg").all()
        assert len(pictures) == 3
        assert all(p.is_visible() for p in pictures)
        assert not any(c.is_visible() for c in page.locator(".curves").all())
    shown.close()


def test_curves_are_those_of_the_result(samples: Samples, recording: Recording) -> None:
    """Before and after of each unseen cycle, at the rows and to the digits that the page states."""
    judged = compare(samples, ["ols"], splits.leave_one_cycle_out(samples), robustness=False)
    (a,) = (a for a in judged.overall() if a.target == "z_um")
    (panel,) = curves.run(a, [recording])
    before, predicted, after = panel["curves"]
    hours = panel["first"] + panel["unit"] * np.cumsum(before["x"])
    assert hours == pytest.approx((recording.time[a.row] - recording.time[a.row[0]]) / 3600, abs=panel["unit"])
    assert before["y"] == pytest.approx(a.measured, abs=0.51 * 10 ** -panel["digits"])
    assert predicted["y"] == pytest.approx(a.predicted, abs=0.51 * 10 ** -panel["digits"])
    assert after["y"] == pytest.approx(a.measured - a.predicted, abs=0.51 * 10 ** -panel["digits"])
    assert [c[2] for c in panel["cycles"]] == [c.name for c in recording.cycles]
    for (_, _, _, told), block in zip(panel["cycles"], [b for b in judged.assessments if not b.overall], strict=False):
        assert told.startswith(f"RMS {block.metric('rms'):.2f} instead of {block.none_metric('rms'):.2f} µm")


def test_peaks_and_gaps_stay_where_points_are_left_out() -> None:
    x = np.arange(100_003.0)
    y = np.sin(x / 9000)
    y[[7, 50_001, 100_001]] = 50.0, -50.0, 40.0
    y[30_000:30_004] = np.nan
    hours, thin = thin_points(x, y, 400)
    assert len(hours) <= 410
    assert {7.0, 50_001.0, 100_001.0, 0.0, 100_002.0} <= set(hours)
    assert np.isnan(thin[(hours >= 30_000) & (hours < 30_004)]).all()
    assert np.isfinite(thin[(hours == 29_999) | (hours == 30_004)]).sum() == 2
    y[::2] = np.nan  # every other row empty: no gap is drawn, and the rest stays thin
    hours, thin = thin_points(x, y, 400)
    assert len(hours) <= 410
    assert np.isfinite(thin).all()
    assert -50.0 in thin
    assert len(thin_points(x, np.full(len(x), np.nan), 400)[0]) <= 410


def test_a_page_of_many_recordings_stays_below_the_limit() -> None:
    """Eight recordings of 20,000 rows with values missing here and there."""
    rng = np.random.default_rng(0)
    day = small_machine([1000.0 + 200 * k for k in range(10)], dt=6.0, noise=0.5)
    table = day.table.mask(rng.random(day.table.shape) < 0.001)
    days = [replace(day, name=f"day {k}", table=table) for k in range(8)]
    page = checks.render(days, [check(days[0])] * 8)
    assert len(page.encode()) < 2.5e6
    assert len(panels(page)) == 8
