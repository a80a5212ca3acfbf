"""Figures with more cycles, decades and longer names than find room: what is drawn can be read."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from smallmachine import small_machine

from thermocomp.judging import budget, splits
from thermocomp.judging.compare import compare
from thermocomp.judging.results import Comparison
from thermocomp.models.selection.standins import StandInAnswer
from thermocomp.recordings.samples import Samples
from thermocomp.report import figures, html, selections
from thermocomp.report.drawing import drawing, log_ticks

NAMES = ("x_um", *(f"displacement_{k}_of_a_very_long_name_um" for k in range(4)))


def boxes(figure: Figure, texts: list[Text]) -> list[Bbox]:
    figure.draw_without_rendering()
    return [t.get_window_extent() for t in texts if t.get_text() and t.get_visible()]


def apart(found: list[Bbox]) -> bool:
    """Return whether none of the boxes covers another."""
    return not any(a.overlaps(b) for k, a in enumerate(found) for b in found[k + 1 :])


@pytest.mark.parametrize("cycles", [4, 14, 40])
def test_names_of_cycles_do_not_run_into_each_other(cycles: int) -> None:
    recording = small_machine(tuple(1000.0 + 100.0 * k for k in range(cycles)))
    long = replace(recording.channels[0], name="temperature_of_the_front_bearing_left_C")
    table = recording.table.rename(columns={"t1_C": long.name})
    crowded = replace(recording, table=table, channels=(long, *recording.channels[1:]))
    figure = figures.measured(crowded).figure
    texts = list(figure.axes[0].texts)
    assert texts[0].get_text().startswith(" 1 (")
    assert len(texts) == cycles if cycles == 4 else 3 <= len(texts) < cycles
    assert apart(boxes(figure, texts))


@pytest.mark.parametrize("ends", [(0.92, 1.02), (0.31, 1.05), (0.6, 11.0), (0.11, 14.0), (0.02, 900.0), (1e-5, 1e5)])
def test_ticks_of_a_logarithmic_axis_do_not_run_into_each_other(ends: tuple[float, float]) -> None:
    with drawing("ticks"):
        figure = Figure(figsize=(6.0, 3.4), layout="constrained")
        ax = figure.subplots()
        ax.plot([1, 2], ends)
        log_ticks(ax, "y")
        figure.draw_without_rendering()
    ticks = [t.label1 for t in (*ax.yaxis.get_major_ticks(), *ax.yaxis.get_minor_ticks())]
    low, high = ax.get_ylim()
    shown = sorted(
        (t for t in ticks if t.get_text() and low <= t.get_position()[1] <= high), key=lambda t: t.get_position()[1]
    )
    assert 2 <= len(shown) < 14
    found = boxes(figure, shown)
    assert all(a.y1 < b.y1 and not a.overlaps(b) for a, b in pairwise(found))


def few(names: tuple[str, ...], condition: float) -> budget.Budget:
    """Return a budget of up to four sensors for some targets."""
    shape = (1, 4, len(names), 3)
    return budget.Budget(
        targets=names,
        unit="um",
        scales=np.ones(len(names)),
        candidates=("a", "b", "c", "d"),
        sensors=(("a",), ("a", "b"), ("a", "b", "c"), ("a", "b", "c", "d")),
        models=("ols",),
        blocks=("1", "2", "3"),
        rms=np.broadcast_to(np.array([9.0, 3.0, 1.2, 0.7])[None, :, None, None], shape),
        none=np.full((len(names), 3), 20.0),
        rows=np.full((len(names), 3), 100.0),
        frequency=np.ones((4, 4)),
        condition=np.geomspace(1, condition, 4),
        answer=StandInAnswer(np.zeros((1, 4, len(names))), np.eye(4), 0.4),
    )


@pytest.mark.parametrize(
    ("names", "title"),
    [
        (("displacement_of_the_spindle_nose_along_z_um",), "displacement_of_the_spindle_nose_along_z_um: error"),
        (("ch1_um", "ch2_um", "ch3_um", "ch4_um", "ch5_um"), "ch1_um, ch2_um, ch3_um, ch4_um, ch5_um: error"),
        (NAMES, "5 displacements: error"),
    ],
)
def test_the_title_of_a_selection_is_whole(names: tuple[str, ...], title: str) -> None:
    drawn = selections.budget(few(names, 600.0))
    assert f"{title} against the number of temperature sensors" in drawn
    heading = next(t for t in drawn.figure.findobj(Text) if "error against" in t.get_text())
    (box,) = boxes(drawn.figure, [heading])
    assert box.x1 <= drawn.figure.bbox.x1


@pytest.mark.parametrize("condition", [1.6, 9.5, 600.0, 1e7])
def test_the_panel_of_the_condition_can_be_read(condition: float) -> None:
    figure = selections.budget(few(("x_um",), condition)).figure
    figure.draw_without_rendering()
    for ax in figure.axes[:2]:
        low, high = ax.get_ylim()
        ticks = [t.label1 for t in (*ax.yaxis.get_major_ticks(), *ax.yaxis.get_minor_ticks())]
        shown = [t for t in ticks if t.get_text() and low <= t.get_position()[1] <= high]
        assert shown
        assert apart(boxes(figure, shown))


@pytest.fixture(scope="module")
def comparison(samples: Samples) -> Comparison:
    return compare(samples, ["ols"], splits.leave_one_cycle_out(samples))


def test_a_name_lies_above_the_bar(comparison: Comparison) -> None:
    (ax,) = figures.robustness(comparison.overall()).figure.axes
    (name,) = ax.texts[:1]
    patch = name.get_bbox_patch()
    assert patch is not None
    assert patch.get_facecolor()[:3] == (1.0, 1.0, 1.0)
    assert name.get_zorder() > max(line.get_zorder() for line in ax.lines if line.get_linewidth() == 2.5)


def test_names_of_displacements_do_not_run_into_each_other(comparison: Comparison) -> None:
    both = [
        replace(a, target=f"displacement_of_the_spindle_nose_{k}_um") for k in range(2) for a in comparison.assessments
    ]
    drawn = figures.overview(replace(comparison, assessments=tuple(both)))
    assert apart(boxes(drawn.figure, [ax.yaxis.label for ax in drawn.figure.axes]))


def test_what_does_no_harm_was_tried(comparison: Comparison) -> None:
    calm = tuple(
        replace(
            a,
            robustness=a.robustness
            and replace(a.robustness, noise_rms=dict.fromkeys(("uniform", "normal"), (0.0, 0.0)), lost_rms={}),
        )
        for a in comparison.assessments
    )
    assert "no disturbance tried</td>" in html.render(replace(comparison, assessments=calm), [small_machine()])
