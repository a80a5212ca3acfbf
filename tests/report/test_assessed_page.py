"""The page of `assess`: verdicts, runs, and which sensors failed, what stood in and what it cost."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from ownscripts import without_scripts
from watchedmachine import failing, watched_model

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.files import modelfile
from thermocomp.judging import assessing
from thermocomp.judging.assessing import Judged
from thermocomp.judging.faultlog import FaultLog, find_costs, find_faults
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start
from thermocomp.report import assessed, faults
from thermocomp.report.language import translate
from thermocomp.report.layout import in_um
from thermocomp.report.sections import Section
from thermocomp.runtime.watchstate import WORDS


@pytest.fixture(scope="module")
def recording() -> Recording:
    return failing(t1_C=(4.0, 4.0), t3_C=(9.0, None))


@pytest.fixture(scope="module")
def judged(recording: Recording) -> Judged:
    return assessing.assess([watched_model()], [recording], starts=Start())


@pytest.fixture(scope="module")
def log(judged: Judged, recording: Recording) -> FaultLog:
    (found,) = find_faults(judged, [recording])
    return found


@pytest.fixture(scope="module")
def page(judged: Judged, recording: Recording) -> str:
    return assessed.render(judged, [recording])


def words(page: str) -> str:
    """The page without its figures."""
    told = re.sub(r"<svg.*?</svg>", "", without_scripts(page), flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", told)).split())


def test_the_verdict_of_each_cycle_is_there(judged: Judged, page: str) -> None:
    (whole,) = judged.overall()
    told = words(page)
    stated = f"({judged.stated['z_um']:.2f} µm stated in the model file)"
    here, none = f"{whole.metric('rms'):.2f} µm RMS", f"{whole.none_metric('rms'):.2f} µm."
    assert f"z_um: {whole.word}, {here} {stated} instead of {none}" in told
    assert translate(whole.reason) in told
    for unit in whole.verdict.units:
        assert unit.name in told
        assert f"{in_um(unit.rms)} / {in_um(unit.none_rms)}" in told
    assert "measured = without compensation" in page
    assert "The band contains" in told


def test_what_failed_and_what_it_cost(judged: Judged, log: FaultLog, page: str) -> None:
    told = words(page)
    assert "small" not in told
    assert "failing: 2 of 4 sensors failed, 2 did not" in told
    stepped, missing = log.faults
    assert f"t1_C stepped {stepped.begin / 3600:.2f} h the end {stepped.beside:+.1f} degC" in told
    assert f"t3_C missing {missing.begin / 3600:.2f} h the end" in told
    for c in find_costs(watched_model(), judged.overall()[0], [log]):
        row = [", ".join(c.failed) or "none", f"{c.hours:.1f}", in_um(c.rms), in_um(c.none_rms), in_um(c.honest)]
        assert " ".join([*row, "continues" if c.runs_on else "held, then fades"]) in told
    harm = "But: z_um: while t1_C, t3_C had failed, the machine would hold the correction, then fade it: "
    harm += f"{c.rms:.2f} um RMS"
    assert harm in told
    assert "Its correction is held for 30 min, then decays to zero with a time constant of 1 h" in told


def test_the_timeline_is_coloured_where_a_sensor_is_not_believed(log: FaultLog, recording: Recording) -> None:
    figure = faults.draw_timeline(log, recording).figure
    ax = figure.axes[-1]
    bars = [c for c in ax.collections if isinstance(c, PolyCollection)]
    drawn = {
        (str(bar.get_label()), round(float(x.min()) * 3600), round(float(x.max()) * 3600), round(float(y.mean())))
        for bar in bars
        for x, y in [np.asarray(bar.get_paths()[0].vertices).T]
    }
    assert drawn == {(f.word, round(f.begin), round(f.end), log.watch.failing.index(f.sensor)) for f in log.faults}
    assert {t.get_text() for t in ax.texts} == {f"{f.word} {f.begin / 3600:.1f} h" for f in log.faults}
    assert [t.get_text() for t in ax.get_yticklabels()] == list(log.watch.failing)
    speed = np.asarray(figure.axes[0].lines[0].get_ydata())
    assert speed == pytest.approx(recording.table["spindle_rpm"].to_numpy())


def test_every_failure_has_a_colour() -> None:
    assert set(faults.TINTS) == set(WORDS) - {"good"}


def test_what_stood_in_is_drawn_beside_the_reading(log: FaultLog) -> None:
    figure = faults.draw_stand_ins(log).figure
    shown = [ax for ax in figure.axes if ax.get_visible()]
    assert [ax.get_title(loc="left") for ax in shown] == ["t1_C", "t3_C"]
    for ax in shown:
        k = log.watch.names.index(ax.get_title(loc="left"))
        read, stood = (np.asarray(line.get_ydata()) for line in ax.lines)
        np.testing.assert_array_equal(read, log.read[:, k])
        np.testing.assert_array_equal(stood, log.stood_in[:, k])


def test_codes_of_a_dead_sensor_do_not_flatten_the_curves(judged: Judged) -> None:
    day = failing()
    table = day.table.copy()
    table.loc[day.time > 9 * 3600, "t1_C"] = -9999.0
    (log,) = find_faults(judged, [replace(day, name="failing", table=table)])
    low, high = faults.draw_stand_ins(log).figure.axes[0].get_ylim()
    truth = day.table["t1_C"]
    assert truth.min() - 8 < low < truth.min() + 1
    assert truth.max() - 1 < high < truth.max() + 8


def test_without_a_failure_there_is_a_sentence() -> None:
    day = failing()
    judged = assessing.assess([watched_model()], [day], starts=Start())
    none = "None of the 4 sensors failed: t1_C, t2_C, t3_C, spindle_rpm."
    assert faults.section(judged, [day]) == Section("Sensors", [none])
    page = assessed.render(judged, [day])
    assert "None of the 4 sensors failed" in page
    assert "fades" not in words(page)
    bare = replace(judged, models=(replace(watched_model(), watch=None),))
    (why,) = faults.section(bare, [day]).parts
    assert why == (
        "Temperature sensors were not monitored for faults: the model file contains no watch (fault detection); fit "
        "the model again."
    )


def test_the_verdict_stands_out_by_what_it_is(judged: Judged, recording: Recording) -> None:
    (whole,) = judged.overall()
    known = replace(judged, assessments=(replace(whole, caveat="not a test on unseen data"),))
    assert '<p class="verdict">z_um: not unseen' in assessed.render(known, [recording])
    sound = failing()  # a correction that is held for want of sensors is not accepted
    judged = assessing.assess([watched_model()], [sound], starts=Start())
    (whole,) = judged.overall()
    fine = replace(whole, verdict=replace(whole.verdict, caps=()), robustness=None)
    assert fine.accepted
    assert '<p class="verdict good">z_um: accepted' in assessed.render(replace(judged, assessments=(fine,)), [sound])


def test_what_was_bad_when_it_was_fitted_is_told_first(judged: Judged, recording: Recording) -> None:
    known = watched_model().honest_error
    assert known is not None
    bad = replace(watched_model(), honest_error=replace(known, verdict="refused", reason="does harm in 3"))
    told = words(assessed.render(replace(judged, models=(bad,)), [recording]))
    assert "But: z_um: refused when it was fitted: does harm in 3." in told
    never = replace(judged, models=(replace(bad, honest_error=None),))
    assert "But: z_um: never judged on unseen cycles" in words(assessed.render(never, [recording]))


def test_two_recordings_are_told_apart(recording: Recording) -> None:
    day = replace(failing(t2_C=(5.0, None)), name="other", start="2024-05-01T22:00:00")
    # another noise: the same day twice is refused
    table = day.table.assign(z_um=day.table["z_um"] + 0.01)
    both = [recording, replace(day, table=table)]
    judged = assessing.assess([watched_model()], both, starts=Start())
    page = words(assessed.render(judged, both))
    assert "failing: 2 of 4 sensors failed" in page
    assert "other: 1 of 4 sensors failed" in page
    assert "t2_C missing 5.00 h (2024-05-02 03:00) the end" in page
    clips = re.findall(r'<clipPath id="([^"]+)"', assessed.render(judged, both))
    assert len(clips) == len(set(clips))


def test_a_section_is_a_function_and_a_line(
    judged: Judged, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    more = (*assessed.SECTIONS, lambda j, _: Section("Probings", [f"{len(j.models)} <model>"], ["mind the probe"]))
    monkeypatch.setattr(assessed, "SECTIONS", (*more, lambda *_: None))
    page = assessed.render(judged, [recording])
    assert "<h2>Probings</h2>" in page
    assert "1 &lt;model&gt;" in page
    assert "<b>But:</b> mind the probe" in page


def test_the_page_needs_no_network_and_is_the_same_again(judged: Judged, recording: Recording, page: str) -> None:
    assert not re.findall(r"""(?:src|href)=["'](?!#)[^"']+["']""", page.replace("xlink:href", "href"))
    assert "<script" not in without_scripts(page)
    assert assessed.render(judged, [recording]) == page


def test_the_command_and_python_write_the_same_page(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    modelfile.write([watched_model()], Path("model.json"))
    recordings.write(recording, Path("failing.csv"))
    words = ["assess", "model.json", "failing.csv"]
    assert run([*words, "-o", "report.html"]) in (0, 1)
    assert "Written: report.html" in capsys.readouterr().out
    first = Path("report.html").read_bytes()
    assert b"<h2>Sensors</h2>" in first
    assert run([*words, "-o", "report.html"]) == 2
    assert "report.html: the file exists already" in " ".join(capsys.readouterr().err.split())
    assert run([*words, "-o", "model.html"]) in (0, 1)
    assert run([*words, "-o", "failing.csv", "--overwrite"]) == 2
    assert "is also an input" in " ".join(capsys.readouterr().err.split())
    assert run([*words, "-o", "report.txt"]) == 2
    found = tc.assess("model.json", "failing.csv")
    assert found.report("again.html") == Path("again.html")
    assert Path("again.html").read_bytes() == first
    with pytest.raises(tc.ThermocompError, match="exists already"):
        found.report("again.html")
    assert found.report("again.html", overwrite=True).read_bytes() == first
    assert run([*words, "-o", "report.html", "--overwrite", "--json"]) in (0, 1)
