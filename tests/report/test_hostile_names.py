"""Names that people typed are words in every figure and on every page: no formula, no tag, none of them missing."""

import ast
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from hostile import NAMES, renamed
from matplotlib.figure import Figure
from ownscripts import without_scripts
from smallmachine import small_machine

from thermocomp.core.shown import shorten
from thermocomp.iso230 import part2
from thermocomp.iso230.report import iso230 as iso230pages
from thermocomp.iso230.report import iso230figures
from thermocomp.judging import assessing, selecting, splits
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.settling.settling import time_constants
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.papers.report import papers
from thermocomp.papers.study import Claim, Panel, PlotCurve, Study, StudyTable
from thermocomp.papers.study import Figure as StudyFigure
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.report import assessed, checks, drawing, faults, figures, html
from thermocomp.volumetric.positioning import Positioning

REPORT = Path(figures.__file__).parent


def texts(svg: str) -> list[str]:
    """The texts of a figure, which must be XML; a formula would be in pieces."""
    root = ElementTree.fromstring(svg)
    assert not list(root.iter("{http://www.w3.org/2000/svg}tspan"))
    return [e.text or "" for e in root.iter("{http://www.w3.org/2000/svg}text")]


def is_sound(page: str) -> None:
    """Nothing but our own tags, nothing that cannot be printed, and bytes can be made of it."""
    tags: set[str] = set()

    class Tags(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            tags.add(tag)
            assert not any(name.startswith("on") for name, _ in attrs)

    Tags().feed(without_scripts(page))
    assert not tags & {"script", "img", "iframe", "object", "link"}
    assert all(c.isprintable() or c == "\n" for c in page)
    page.encode("utf-8")


def mixed(recording: Recording, first: int) -> Recording:
    """A recording whose names are all others."""
    names = [NAMES[(first + k) % len(NAMES)].encode("utf-8", "replace").decode() for k in range(40)]
    channels = tuple(replace(c, name=f"{names[k]}{k}", place=names[k]) for k, c in enumerate(recording.channels))
    table = recording.table.set_axis([c.name for c in channels], axis=1)
    cycles = tuple(replace(c, name=f"{names[k + 6]}{k}") for k, c in enumerate(recording.cycles))
    return replace(recording, name=names[10], source=names[11], channels=channels, table=table, cycles=cycles)


@pytest.mark.parametrize("name", NAMES)
def test_what_was_measured(name: str) -> None:
    recording = renamed(small_machine(dt=200.0), name)
    said = [t.strip() for t in texts(figures.measured(recording))]
    assert all(shorten(c.name, 48).strip() in said for c in recording.channels if c.quantity != "spindle_speed")
    finding = Finding("warning", "kind", recording.channels[0].name, name, rows=np.arange(3))
    page = checks.render([recording], [[finding]])
    is_sound(page)
    assert page.count(
        shorten(name, 48).split("...")[0].replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")[:20]
    )


def test_what_failed() -> None:
    """A model takes no name with unprintable characters, and none of more than 200: these are the others."""
    names = [n for n in NAMES if n.strip() and n.isprintable() and len(n) <= 200]
    assert len(names) > 10
    for k in range(0, len(names), 4):
        plain = small_machine(dt=200.0)
        renames = dict(zip(("t1_C", "t2_C", "t3_C", "z_um"), (names + names)[k : k + 4], strict=True))
        channels = tuple(replace(c, name=renames.get(c.name, c.name)) for c in plain.channels)
        recording = replace(plain, table=plain.table.rename(columns=renames), channels=channels, name=names[k])
        samples = stack([recording], [renames["z_um"]])
        every = np.ones(len(samples), np.bool_)
        model = replace(train("ols", samples, 0, every).model, watch=find_watch(samples, every))
        lost = replace(recording, table=recording.table.assign(**{renames["t1_C"]: np.nan}))
        judged = assessing.assess([model], [recording], starts=Start())
        (log,) = find_faults(judged, [lost])
        assert renames["t1_C"] in log.failed
        said = [t.strip() for t in (*texts(faults.draw_timeline(log, lost)), *texts(faults.draw_stand_ins(log)))]
        assert shorten(renames["t1_C"], 28).strip() in said
        is_sound(assessed.render(judged, [lost]))


@pytest.mark.parametrize("first", range(0, len(NAMES), 12))
def test_a_whole_report(first: int) -> None:
    recording = mixed(small_machine(dt=200.0), first)
    speed = small_machine(dt=200.0).speed
    assert recording.speed is not None
    assert speed is not None
    # a model takes no name with unprintable characters; that of the speed stands in every model
    channels = tuple(speed if c is recording.speed else c for c in recording.channels)
    table = recording.table.rename(columns={recording.speed.name: speed.name})
    recording = replace(recording, channels=channels, table=table)
    samples = stack([recording], [c.name for c in recording.displacements])
    result = compare(samples, ["ols", "partial-f"], splits.leave_one_cycle_out(samples))
    assessments = tuple(
        replace(a, model=f"{NAMES[first]}{a.model}", robustness=a.robustness) for a in result.assessments
    )
    odd = replace(result, assessments=assessments, recommended=())
    is_sound(html.render(result, [recording]))
    said = [t.strip() for t in texts(figures.overview(odd))]
    assert all(shorten(a.model, 48).strip() in said for a in assessments)
    for a in odd.overall():
        blocks = [b for b in assessments if (b.target, b.model) == (a.target, a.model) and not b.overall]
        texts(figures.prediction(a, blocks, [recording.time]))
        if a.robustness is not None:  # nothing is judged of a model that was refused
            texts(figures.robustness([a]))
    fits = all(a.robustness is not None for a in odd.overall())
    for method in ("grouping", "subsets", *(("pareto",) if fits else ()), "ace"):
        settings = Settings() if method == "grouping" else Settings(max_sensors=2)
        choices = selecting.select(method, samples, splits.leave_one_cycle_out(samples), settings)
        is_sound(html.render_choices(choices, [recording]))


@pytest.mark.parametrize("first", range(0, len(NAMES), 12))
def test_iso230_and_papers(first: int) -> None:
    recording = mixed(small_machine(dt=200.0), first)
    name, other = NAMES[first], NAMES[(first + 1) % len(NAMES)]
    settlings = time_constants(recording)
    texts(iso230figures.time_constants(settlings))
    rng = np.random.default_rng(0)
    positions = np.linspace(0, 500, 6)
    up = 0.02 * positions + rng.normal(size=(5, 6))
    result = part2.assess(Positioning(name, other, "um", positions, up, up - 2, f"{name}.csv"))
    is_sound(iso230pages.render([], [(recording, settlings)], [result]))
    curve = PlotCurve(name, positions, positions)
    study = Study(
        "x", name, (Claim((name,), name, name, other, False, name),),
        (StudyTable(name, (name, other), [[name, other]]),),
        (StudyFigure("key", name, [Panel(name, name, other, [curve, replace(curve, label=other)])]),), {},
    )  # fmt: skip
    is_sound(papers.render([study], seed=0))
    said = [t.strip() for t in texts(papers.draw(study.figures[0]))]
    assert shorten(name, 48).strip() in said


def test_a_user_s_own_settings_change_nothing() -> None:
    """With TeX in a matplotlibrc, names would be programs."""
    with mpl.rc_context({"text.usetex": True, "text.parse_math": True}):
        recording = renamed(small_machine(dt=200.0), "\\input{x} $a$ ")
        assert any("\\input{x} $a$" in t for t in texts(figures.measured(recording)))


def test_letters_without_a_glyph_warn_nobody_and_other_warnings_stay() -> None:
    with drawing.drawing("x"):
        figure = Figure()
        figure.subplots().set_title("\u6e29\u5ea6")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert drawing.png(figure).startswith(b"\x89PNG")
            assert "\u6e29\u5ea6" in texts(drawing.svg(figure))


def test_nothing_else_draws_names_or_saves_figures() -> None:
    ours = {"[0.5, 1.5, 2.5, 3.5], ['X', 'Y', 'Z', 'volume']", "sizes, names"}  # names of axes, numbers of sensors
    ours.add("np.arange(len(order) + 1) + 0.5, [*labels, 'all components together']")
    elsewhere = ("legend", "savefig", "print_figure", "set_yticklabels", "set_xticklabels")
    for path in REPORT.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if path.name == "drawing.py" or not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            assert node.func.attr not in elsewhere, path
            if node.func.attr in ("set_yticks", "set_xticks") and len(node.args) > 1:
                assert ", ".join(map(ast.unparse, node.args)) in ours, f"{path}: name_ticks"
