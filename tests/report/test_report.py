"""The report: one offline page that a real browser shows."""

import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from browsing import chromium
from ownscripts import without_scripts
from rich.console import Console
from smallmachine import small_machine

from thermocomp.api.results import Compared
from thermocomp.cli.terminal import print_items
from thermocomp.files import modelfile
from thermocomp.judging import splits, study
from thermocomp.judging.compare import compare
from thermocomp.judging.results import Comparison
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.report import figures, html, printed
from thermocomp.report.summary import cautions, summarise, verdict


@pytest.fixture(scope="module")
def comparison(samples: Samples) -> Comparison:
    return compare(samples, ["ols", "mra", "dynamic"], splits.leave_one_cycle_out(samples))


@pytest.fixture(scope="module")
def page(comparison: Comparison, recording: Recording) -> str:
    return html.render(comparison, [recording])


def test_verdict_is_one_true_sentence(comparison: Comparison) -> None:
    text = verdict(comparison)
    assert text.count(". ") == 0
    assert text.endswith(".")
    for target in ("z_um", "x_um"):
        best = comparison.best(target)
        assert best is None or best.model in text


def test_stopped_work_is_told_first(comparison: Comparison) -> None:
    assert cautions(replace(comparison, left=2))[0].startswith("the comparison was stopped: 2 combinations")


def test_no_model_no_recommendation(samples: Samples) -> None:
    flips = np.where(samples.cycle % 2 == 0, 5.0, -5.0)[:, None] * np.ones(2)  # nothing the inputs could explain
    unfit = replace(samples, deviations=flips)
    result = compare(unfit, ["ols", "mra"], splits.leave_one_cycle_out(unfit), robustness=False)
    assert result.best("z_um") is None
    assert verdict(result).startswith("No model may run yet for z_um and x_um")


def test_every_number_of_the_table_is_on_the_page(comparison: Comparison, page: str) -> None:
    for a in comparison.overall():
        assert f"{a.metric('rms'):.2f}" in page
        assert f"{a.none_metric('rms'):.2f}" in page


def test_summary_holds_what_was_measured(comparison: Comparison, recording: Recording) -> None:
    found = summarise(comparison, [recording])
    assert found["recordings"][0]["rows"] == 800
    assert [c["name"] for c in found["recordings"][0]["cycles"]] == [c.name for c in recording.cycles]
    assert [t["name"] for t in found["targets"]] == ["z_um", "x_um"]
    assert all(len(row["cells"]) == 4 for t in found["targets"] for row in t["per_cycle"])


def test_the_formula_is_that_of_the_model_file(
    comparison: Comparison, recording: Recording, samples: Samples, page: str, tmp_path: Path
) -> None:
    """What ``fit`` writes and ``compare`` shows is one model; without the rows the page says that it is one fold's."""
    shown = unescape(html.render(comparison, [recording], samples))
    assert "fitted to all rows, as thermocomp fit does" in shown
    told = 0
    for k, target in enumerate(c.name for c in samples.targets):
        best = comparison.best(target)
        if best is None:
            continue
        fitted = study.fit(samples, best.model, comparison.judging)
        modelfile.write(fitted.models, tmp_path / f"{k}.json")
        formula = modelfile.read(tmp_path / f"{k}.json")[k].formula()
        assert f"{target} = {formula}</code>" in shown
        assert f"{target} = {formula}</code>" not in unescape(page)
        told += 1
    assert told
    assert "of one fold only, trained on" in page


def test_what_disturbances_do_is_told_beside_the_verdict(
    comparison: Comparison, recording: Recording, page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (best,) = {a for a in comparison.overall() if a.target == "z_um" and a.model == "dynamic"}
    assert best.robustness is not None
    noise = max(mean for mean, _ in best.robustness.noise_rms.values())
    low = replace(best.robustness, none_rms=min(noise, *best.robustness.lost_rms.values()) / 2)
    spoiled = tuple(replace(a, robustness=low) if a.overall else a for a in comparison.assessments)
    bad = replace(comparison, assessments=spoiled)
    told = [a.reason for a in bad.overall() if a.word == "unproven" and "worse than no compensation (" in a.reason]
    assert told
    assert not [c for c in cautions(bad) if "worse than no compensation" in c]  # it is said once
    assert all("loss of spindle_rpm" in c for c in told)
    assert re.search(r"noise of 0.4 °C, (loss of \w+, )*loss of spindle_rpm", html.render(bad, [recording]))
    assert "worse than no compensation with" in page
    print_items(printed.comparison(bad), Console(width=400))
    assert all(c in capsys.readouterr().out for c in told[:1])
    results = [r for r in Compared(bad, (recording,)).to_dict()["results"] if "robustness" in r]
    assert any("loss of spindle_rpm" in r["robustness"]["worse_than_none"] for r in results)


def test_harm_within_the_margin_is_a_caution(comparison: Comparison) -> None:
    (best,) = {a for a in comparison.overall() if a.target == "z_um" and a.model == "dynamic"}
    assert best.accepted
    assert best.robustness is not None
    worst = max(best.robustness.lost_rms.values())
    spoiled = tuple(
        replace(a, robustness=replace(best.robustness, none_rms=worst - 0.01)) if a is best else a
        for a in comparison.assessments
    )
    assert [
        c
        for c in cautions(replace(comparison, assessments=spoiled))
        if "dynamic for z_um is worse than no compensation" in c
    ]


def test_the_page_needs_no_network(page: str) -> None:
    assert "<script" not in without_scripts(page)
    assert not re.findall(r"""(?:src|href)=["'](?!#)[^"']+["']""", page.replace("xlink:href", "href"))
    assert "url(http" not in page
    assert "@import" not in page


def test_ids_of_the_figures_do_not_collide(page: str) -> None:
    clips = re.findall(r'<clipPath id="([^"]+)"', page)
    assert len(clips) > 5
    assert len(clips) == len(set(clips))


def test_the_page_is_the_same_from_run_to_run(comparison: Comparison, recording: Recording, page: str) -> None:
    assert html.render(comparison, [recording]) == page


def test_a_split_and_a_speed_that_is_not_recorded() -> None:
    recording = small_machine()
    channels = tuple(c for c in recording.channels if c.name != "spindle_rpm")
    bare = Recording("bare", recording.time, recording.table.drop(columns="spindle_rpm"), channels, recording.cycles)
    samples = stack([bare], ["z_um"])
    result = compare(samples, ["ols", "dynamic"], splits.parse("0.6/0.2", samples), robustness=False)
    assert "rows 480-639" in html.render(result, [bare])


def test_names_from_a_file_cannot_inject_markup() -> None:
    recording = small_machine()
    evil = Recording("<script>alert(1)</script>", recording.time, recording.table, recording.channels, recording.cycles)
    samples = stack([evil], ["z_um"])
    result = compare(samples, ["ols"], splits.parse("0.6/0.2", samples), robustness=False)
    assert "<script>alert" not in html.render(result, [evil])


def test_a_real_browser_shows_it(page: str, tmp_path: Path) -> None:
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("chromium is not installed: apt-get install chromium (make test does)")
    source, picture = tmp_path / "report.html", tmp_path / "page.png"
    source.write_text(page, encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
    flags += [
        "--disable-background-networking",
        "--disable-component-update",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    shown = subprocess.run(
        [browser, *flags, "--window-size=1100,2400", f"--screenshot={picture}", "--dump-dom", source.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "Thermal compensation: can it be used?" in shown.stdout
    # matplotlib comes with the extra, so its reader will do: a page that was drawn is neither white nor of one colour
    from matplotlib.image import imread

    pixels = imread(picture)
    assert pixels.shape[:2] == (2400, 1100)
    ink = (pixels[..., :3].mean(axis=2) < 0.6).mean(axis=1)
    assert (ink > 0.01).mean() > 0.15


def test_a_name_with_a_formula_in_it_is_drawn(recording: Recording) -> None:
    names = ["a$\\frac$_C", *(c.name for c in recording.channels[1:])]
    channels = tuple(replace(c, name=n) for c, n in zip(recording.channels, names, strict=True))
    odd = replace(recording, table=recording.table.set_axis(names, axis=1), channels=channels, aliases={})
    assert "a$" in figures.measured(odd)


def test_on_a_phone_in_the_dark_and_on_paper(page: str, tmp_path: Path) -> None:
    """400 px without sideways scrolling, dark by wish, few sheets of A4, and a text in place of every figure."""
    source = tmp_path / "report.html"
    source.write_text(page, encoding="utf-8")
    with chromium() as browser:
        grounds = {}
        for scheme in ("light", "dark"):
            shown = browser.new_page(viewport={"width": 400, "height": 900}, color_scheme=scheme)
            shown.goto(source.as_uri())
            assert shown.evaluate("document.documentElement.scrollWidth") <= 400
            grounds[scheme] = shown.evaluate("getComputedStyle(document.body).backgroundColor")
        assert grounds == {"light": "rgb(255, 255, 255)", "dark": "rgb(20, 23, 27)"}
        figures = shown.locator("figure svg").all()
        assert len(figures) > 3
        assert all((f.get_attribute("aria-label") or "").strip() for f in figures)
        assert shown.locator("td").evaluate_all("cells => Math.max(...cells.map(c => c.textContent.length))") < 100
        sheets = len(re.findall(rb"/Type\s*/Page[^s]", shown.pdf(prefer_css_page_size=True)))
    assert sheets <= 6
