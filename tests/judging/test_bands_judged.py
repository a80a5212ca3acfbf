"""Bands where a model is judged: made of the rows learned from alone, and what they held of the others."""

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from smallmachine import small_machine

from thermocomp.cli.terminal import print_items
from thermocomp.core.band import Band
from thermocomp.core.inputs import Input
from thermocomp.core.joint import JointSupport
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.judging import assessing, splits, study
from thermocomp.judging.compare import compare, split_by_cycle
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.report import printed, records
from thermocomp.report.bands import describe_bands
from thermocomp.runtime import batch

MODEL = PacedDynamic(
    target="z_um",
    unit="um",
    inputs=(
        Input("T", "temperature", "degC", 20.0, False, -10.0, 20.0),
        Input("n", "spindle_speed", "1/min", 0.0, False, -6000.0, 6000.0),
    ),
    time_constants=(600.0,),
    temperatures=(LaggedInput(0, 0.5, (2.0,)),),
    top_speed=6000.0,
    states=(SpeedState(1, 2.0, 3600.0, 1200.0, 30.0),),
    spread=((0.1, 0.2, 3.0),),
    joint=JointSupport((0,), (2.0,), ((0.0,),), 1.0),
    band=Band(0.9, "assumption", 4, 1.0, 2.0, 3.0, (1,), 0.5),
)
TIME = np.arange(0.0, 3600.0, 60.0)
ROWS = np.column_stack([20.0 + TIME / 600.0, np.where(TIME < 1800, 3000.0, 0.0)])


@pytest.fixture(scope="module")
def samples() -> Samples:
    return stack([small_machine()], ["z_um"])


@pytest.fixture(scope="module")
def comparison(samples: Samples) -> Comparison:
    return compare(samples, ["averaged", "ols"], splits.leave_one_cycle_out(samples), robustness=False)


def of(comparison: Comparison, model: str) -> list[Assessment]:
    return [a for a in comparison.assessments if a.model == model]


def test_a_replay_gives_the_half_width_of_each_step() -> None:
    found = batch.run(MODEL, None, TIME, ROWS)
    state = MODEL.init()
    for k, row in enumerate(ROWS):
        state, _ = MODEL.step(state, row, 60.0)
        assert found.half_width[k] == pytest.approx(MODEL.half_width(state, row), rel=1e-12)
    assert np.isnan(batch.run(replace(MODEL, band=None), None, TIME, ROWS).half_width).all()


def test_a_row_without_a_reading_keeps_the_width_as_it_keeps_the_answer() -> None:
    rows = ROWS.copy()
    rows[[0, 10, 11], 0] = np.nan
    found = batch.run(MODEL, None, TIME, rows)
    assert np.isnan(found.half_width[0])  # nothing was said yet
    assert (found.half_width[10:12] == found.half_width[9]).all()


def test_a_deviation_that_counts_anew_has_no_band() -> None:
    assert np.isnan(batch.run(MODEL, None, TIME, ROWS, anew=30).half_width).all()


def test_the_band_is_that_of_the_cycles_learned_from(samples: Samples, comparison: Comparison) -> None:
    *cycles, whole = of(comparison, "averaged")
    assert len(cycles) == 4
    assert whole.band == cycles[0].band == "90 % band by assumption, 3 cycles"
    split = splits.leave_one_cycle_out(samples).splits[1]
    model = train("averaged", samples, 0, split.learn).model
    # the judged displacements say nothing of it: any others leave the same band
    other = replace(samples, deviations=np.where(split.judge[:, None], 1e6, samples.deviations))
    assert train("averaged", other, 0, split.learn).model.band == model.band
    a = cycles[1]
    assert a.frozen is not None
    assert a.frozen.band == model.band
    assert a.half_widths is not None
    assert a.alone is not None
    assert a.coverage == (np.abs(a.measured - a.alone) <= a.half_widths).mean()
    assert a.half_width == a.half_widths.mean()


def test_all_cycles_together_count_each_row(comparison: Comparison) -> None:
    *cycles, whole = of(comparison, "averaged")
    rows = [len(a.measured) for a in cycles]
    assert whole.coverage == pytest.approx(np.average([a.coverage for a in cycles], weights=rows))
    assert whole.half_width == pytest.approx(np.average([a.half_width for a in cycles], weights=rows))


def test_coverage_is_a_share_of_rows_with_a_band(comparison: Comparison) -> None:
    a = of(comparison, "averaged")[-1]
    n = len(a.measured)
    assert replace(a, half_widths=np.zeros(n)).coverage == 0.0
    assert replace(a, half_widths=np.full(n, 1e9)).coverage == 1.0
    half = np.where(np.arange(n) < n // 2, np.nan, 1e9)
    assert replace(a, half_widths=half).coverage == 1.0
    assert replace(a, half_widths=half).half_width == pytest.approx(1e9)
    assert replace(a, half_widths=half, alone=a.measured + 2e9).coverage == 0.0


def test_a_model_without_a_band_says_nothing(comparison: Comparison) -> None:
    a = of(comparison, "ols")[-1]
    assert a.band == ""
    assert np.isnan(a.coverage)
    assert np.isnan(a.half_width)
    assert records.assessment(a)["band"] is None


def test_a_cycle_without_a_band_has_no_words(comparison: Comparison) -> None:
    whole = of(comparison, "averaged")[-1]
    widths = np.where(whole.cycle == 1, np.nan, 1.0)
    cut = split_by_cycle(replace(whole, half_widths=widths))
    assert [bool(a.band) for a in cut] == [True, False, True, True]


def test_where_all_counts_anew_nothing_is_said_of_the_band(comparison: Comparison) -> None:
    frozen = of(comparison, "averaged")[0].frozen
    assert frozen is not None
    warm = replace(small_machine((1500.0, 2000.0), seed=3), name="warm")
    earlier = small_machine((1200.0, 2200.0), seed=2)
    judged = assessing.assess([frozen], [warm], starts=Start("rezeroed", earlier=(earlier,)))
    (whole,) = judged.overall()
    assert np.isfinite(whole.metric("rms"))
    assert whole.band == ""
    assert np.isnan(whole.coverage)
    assert len(describe_bands(judged.models, judged.overall())) == 1
    assert "held" not in describe_bands(judged.models, judged.overall())[0]


def test_the_tables_and_lines_say_it(comparison: Comparison, capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(width=120)
    whole = of(comparison, "averaged")[-1]
    print_items(printed.comparison(comparison), console)
    shown = " ".join(capsys.readouterr().out.split())
    assert "held" in shown
    assert f"{100 * whole.coverage:.0f} %" in shown
    assert "90 % band by assumption, 3 cycles" in shown
    bare = replace(comparison, assessments=tuple(of(comparison, "ols")))
    print_items(printed.comparison(bare), console)
    assert "band" not in capsys.readouterr().out.replace("dead band", "")


def test_who_fits_and_assesses_is_told(samples: Samples, capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(width=400)
    fitted = study.fit(samples, "averaged", splits.leave_one_cycle_out(samples))
    (model,) = fitted.models
    assert model.band is not None
    print_items(printed.fit(fitted), console)
    shown = capsys.readouterr().out
    assert model.band.tell("um") in shown
    assert f"contains {100 * fitted.comparison.overall()[0].coverage:.0f} % of the judged rows" in shown
    assert "(90 % band by assumption, 3 cycles)" in shown
    tests = [small_machine((1500.0, 2000.0), seed=3)]
    judged = assessing.assess([model], tests)
    print_items(printed.assess(judged, tests), console)
    shown = capsys.readouterr().out
    assert "90 % band by assumption, 4 cycles: half-width at least" in shown
    assert 0.0 < judged.overall()[0].half_width < 100.0


def test_the_words_of_a_band_give_the_half_widths_where_structures_agree() -> None:
    band = Band(0.9, "assumption", 4, 1.5, 2.0, 3.0, (1,))
    assert band.tell("um") == (
        "90 % band by assumption, 4 cycles: half-width at least 4.50 um at rest and 3.00 um with the spindle running, "
        "more where the averaged models disagree"
    )
    assert "4.50 um at rest and 4.50 um with the spindle running" in replace(band, speeds=()).tell("um")
