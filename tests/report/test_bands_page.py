"""The page of a model with a band: the band about its curve, its words, and what its answer is made of."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from smallmachine import crowded_machine, small_machine

from thermocomp.core.contributions import gains
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.judging.replay import replay
from thermocomp.judging.results import Comparison
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.report import contributions, figures, html
from thermocomp.report.drawing import Drawn
from thermocomp.report.layout import in_um

WORDS = "90 % band by assumption, 3 cycles"


@pytest.fixture(scope="module")
def samples() -> Samples:
    return stack([small_machine()], ["z_um"])


@pytest.fixture(scope="module")
def comparison(samples: Samples) -> Comparison:
    return compare(samples, ["averaged", "ols"], splits.leave_one_cycle_out(samples), robustness=False)


def drawn(comparison: Comparison, model: str) -> Drawn:
    *blocks, whole = (a for a in comparison.assessments if a.model == model)
    return figures.prediction(whole, blocks, [small_machine().time])


def test_the_band_lies_about_the_prediction(comparison: Comparison) -> None:
    # as if limits had held the correction back: the band is that of the model
    apart = tuple(replace(a, predicted=a.predicted - 50.0) for a in comparison.assessments)
    shown = drawn(replace(comparison, assessments=apart), "averaged")
    assert WORDS in shown
    *blocks, _ = (a for a in comparison.assessments if a.model == "averaged")
    assert len(blocks) == 4
    for ax, block in zip(shown.figure.axes, blocks, strict=False):  # the last panels of the grid stay empty
        (area,) = (c for c in ax.collections if isinstance(c, PolyCollection))
        assert block.alone is not None
        assert block.half_widths is not None
        ends = np.array(area.get_paths()[0].to_polygons()[0])[:, 1]
        assert ends.min() == pytest.approx((block.alone - block.half_widths).min())
        assert ends.max() == pytest.approx((block.alone + block.half_widths).max())


def test_without_a_band_nothing_is_drawn(comparison: Comparison) -> None:
    shown = drawn(comparison, "ols")
    assert "band" not in shown
    assert not any(isinstance(c, PolyCollection) for ax in shown.figure.axes for c in ax.collections)


def test_a_model_without_an_input_is_drawn_as_a_constant(samples: Samples) -> None:
    model = train("averaged", samples, 0, np.ones(len(samples), np.bool_)).model
    assert isinstance(model, PacedDynamic)
    bare = replace(model, inputs=(), temperatures=(), states=(), spread=(), band=None, joint=None, intercept=2.5)
    answer = contributions.explain(bare, samples)
    assert np.asarray(answer.figure.figure.axes[0].lines[1].get_ydata()).tolist() == [2.5] * len(samples)
    assert not answer.table.rows


def test_the_page_says_it(comparison: Comparison, samples: Samples) -> None:
    page = html.render(comparison, [small_machine()], samples)
    best = comparison.best("z_um")
    assert best is not None
    assert best.model == "averaged"
    assert f"<td>{best.half_width:.2f}</td>" in page
    assert f"contains {100 * best.coverage:.0f} % of the judged rows" in page
    assert "90 % band by assumption, 4 cycles: half-width at least" in page
    assert "contributions to the prediction" in page
    model = train("averaged", samples, 0, np.ones(len(samples), np.bool_)).model
    assert isinstance(model, PacedDynamic)
    for g in gains(model, 60.0):
        row = f'<td class="l">{g.name}</td><td>{in_um(g.instantaneous)}</td><td>{in_um(g.settled)}</td>'
        assert row in page
    assert "Time constants of the temperature lags: 10, 30, 90 min." in page
    bare = replace(comparison, assessments=tuple(a for a in comparison.assessments if a.model == "ols"))
    page = html.render(bare, [small_machine()], samples)
    assert "share of the judged rows" not in page
    assert "made of" not in page


def test_six_inputs_are_drawn_and_the_others_as_one() -> None:
    samples = stack([crowded_machine()], ["z_um"])
    model = train("averaged", samples, 0, samples.cycle < 3).model
    assert isinstance(model, PacedDynamic)
    assert len(model.inputs) == 7
    shown = contributions.explain(model, samples).figure
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in shown.figure.axes[0].lines[1:]}
    first, *six, other = lines.values()
    assert next(iter(lines)) == "prediction: sum of all"
    assert next(reversed(lines)) == "sum of 1 more"
    assert len(six) == 6
    assert first == pytest.approx(sum(six) + other)  # few rows: none is thinned out
    assert first == pytest.approx(replay(model, samples, np.ones(len(samples), np.bool_))[0], abs=1e-9)
