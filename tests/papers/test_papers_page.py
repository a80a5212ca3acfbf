"""Studies of papers on a page: claims, figures, tables; nothing from outside."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from thermocomp.papers.report import papers
from thermocomp.papers.study import Claim, Figure, Panel, PlotCurve, Study, StudyTable

HOURS = np.linspace(0.0, 10.0, 5000)
CLAIMS = (
    Claim(("H-16",), "Grouping raises it", "3.3", "2.5", True),
    Claim(("H-18", "E-H8"), "It scatters <less>", "", "0.4", False, "It does not: the noise & all that."),
    Claim(("E-H7",), "Rows", "32", "37", None, "Look."),
)


@pytest.fixture
def study() -> Study:
    wave = PlotCurve("measured", HOURS, np.sin(HOURS))
    broken = PlotCurve("predicted", HOURS, np.where(HOURS > 5, np.nan, np.cos(HOURS)), "dashed")
    dots = PlotCurve("", HOURS, HOURS, "points")
    panels = [Panel("drift", "time [h]", "z [um]", [wave, broken]), Panel("", "T", "S", [dots])]
    figure = Figure("made-fig1", "Fig. 1: what was made up.", [*panels, panels[0]], columns=2)
    table = StudyTable("Errors", ("model", "who", "RMS [um]"), [["a", "b c", "1.25"], ["d", "", "-3e-4"]])
    return Study("made", "Somebody 1999: Made up", CLAIMS, (table,), (figure,), {"rms_um": 1.25})


def test_the_page_says_all_of_it(study: Study, tmp_path: Path) -> None:
    page = tmp_path / "papers.html"
    papers.write([study, replace(study, name="other")], page, seed=7)
    text = page.read_text(encoding="utf-8")
    assert text.count("1 of 2 claims hold on the virtual machine; 1 more number next to the paper") == 4
    assert "seed 7" in text
    assert 'href="#other"' in text
    for said in ("H-18,<br>E-H8", "It scatters &lt;less&gt;", "the noise &amp; all that", "Fig. 1: what was made up."):
        assert text.count(said) == 2
    assert re.findall(r'<span class="(?:ok|no|soft)">(yes|no|-)</span>', text) == ["yes", "no", "-"] * 2
    assert text.count("<svg") == 2
    assert '<th class="l">who</th><th>RMS [um]</th>' in text
    assert "<script" not in text
    assert "http" not in re.sub(r"http://(www\.w3|purl|creativecommons)\.org|https://matplotlib\.org", "", text)


def test_a_study_whose_claims_all_hold_is_green(study: Study) -> None:
    assert 'class="verdict good"' not in papers.render([study], seed=0)
    good = replace(study, claims=CLAIMS[:1])
    assert papers.headline(good) == "1 of 1 claims hold on the virtual machine"
    assert 'class="verdict good"' in papers.render([good], seed=0)
    part = replace(study, claims=(CLAIMS[0], replace(CLAIMS[0], finding="Half in the paper.", softer=True)))
    assert papers.headline(part) == "1 of 2 claims hold on the virtual machine, 1 in part"
    assert 'class="verdict good"' not in papers.render([part], seed=0)
    assert "holds: in part. Half in the paper." in papers.text(part)
    none = replace(CLAIMS[0], holds=None, finding="Nothing to compare.", testable=False)
    untested = replace(study, claims=(CLAIMS[0], none))
    assert papers.headline(untested) == "1 of 2 claims hold on the virtual machine, 1 not testable on it"
    assert 'class="verdict good"' not in papers.render([untested], seed=0)
    assert "holds: not testable. Nothing to compare." in papers.text(untested)
    with pytest.raises(ValueError, match="needs a finding"):
        replace(none, finding="")


def test_plain_text(study: Study) -> None:
    lines = papers.text(study).splitlines()
    assert lines[0] == "Somebody 1999: Made up"
    assert lines[3:7] == ["H-16: Grouping raises it", "    paper: 3.3", "    ours: 2.5", "    holds: yes"]
    some = papers.text(study, "E-H8", "E-H7").splitlines()
    assert some[:3] == [
        "H-18, E-H8: It scatters <less>",
        "    ours: 0.4",
        "    holds: no. It does not: the noise & all that.",
    ]
    assert some[-1] == "    note: Look."
    assert papers.format_table(study.tables[0]).splitlines() == [
        "Errors",
        "model  who  RMS [um]",
        "a      b c      1.25",
        "d              -3e-4",
    ]


def test_columns_of_numbers_stand_on_the_right() -> None:
    rows = [["a", "1", "12 %", "-1.5e-07", "nan", "1 2", "", "1,024"], ["b", "2", "", "3", "-", "3", "–", "7"]]
    assert papers.words(StudyTable("", "abcdefgh", rows)) == [0, 5]
    assert papers.words(StudyTable("", "ab", [["1", ""], ["2", ""], ["not fitted", ""]])) == []


def test_words_of_the_first_column_are_said_once() -> None:
    table = StudyTable("", ("a", "b"), [["x", "1"], ["x", "2"], ["y", "3"], ["x", "4"]])
    assert papers.rows(table) == [["x", "1"], ["", "2"], ["y", "3"], ["x", "4"]]
    numbers = StudyTable("", ("a", "b"), [["1", "1"], ["1", "2"]])
    assert papers.rows(numbers) == [["1", "1"], ["1", "2"]]


def test_panels_and_curves_are_drawn(study: Study) -> None:
    canvas = Canvas()
    papers.paint(study.figures[0], canvas)
    left, right, low, unused = canvas.axes
    assert not unused.get_visible()
    assert left.get_title() == low.get_title() == "drift"
    assert (left.get_xlabel(), left.get_ylabel()) == ("time [h]", "z [um]")
    line, dashed = left.get_lines()
    assert np.size(np.asarray(line.get_xdata())) < 0.5 * len(
        HOURS
    )  # thinned, but from end to end and over the whole height
    assert np.ptp(np.asarray(line.get_xdata(), dtype=float)) == 10
    assert np.ptp(np.asarray(line.get_ydata(), dtype=float)) == np.ptp(np.sin(HOURS))
    assert dashed.get_linestyle() == "--"
    legend = left.get_legend()
    assert legend is not None
    assert [t.get_text() for t in legend.get_texts()] == ["measured", "predicted"]
    assert right.get_legend() is None
    assert right.get_lines()[0].get_marker() == "."
    assert papers.size(study.figures[0])[1] > papers.size(replace(study.figures[0], columns=3))[1]


def test_the_same_picture_from_run_to_run_and_ids_of_its_own(study: Study) -> None:
    first = papers.draw(study.figures[0])
    assert first == papers.draw(study.figures[0])
    other = papers.draw(replace(study.figures[0], key="made-fig2"))
    ids = [set(re.findall(r'<clipPath id="([^"]+)"', svg)) for svg in (first, other)]
    assert ids[0]
    assert not ids[0] & ids[1]
