"""Tables and claims of Hwang, Wessel and the table across the papers: which column, which size, which recordings."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.models.selection.collinearity import Spectrum
from thermocomp.models.selection.grouping import Interval
from thermocomp.papers import cross
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017.setup import LEAST, PURSUIT, STEPWISE
from thermocomp.papers.study import Study
from thermocomp.papers.wessel2004 import sets, spindle
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording


def test_the_smallest_mean_square_is_that_with_grouping() -> None:
    """H-05: of the curve of the representatives; without grouping it has another minimum."""
    with_, without = (
        [SimpleNamespace(columns=range(k), mse=abs(k - best) + 1.0) for k in (1, 2, 3, 4)] for best in (2, 4)
    )
    found: Any = SimpleNamespace(
        grouped=SimpleNamespace(curve_=with_, groups_=range(4)),
        single=SimpleNamespace(curve_=without, groups_=range(4)),
    )
    facts = hwang._fewer(found)
    assert (facts["variables"], facts["best"].mse) == (2, 1.0)


def test_collinearity_at_every_threshold() -> None:
    """H-14, H-16: eigenvalues, the sum of their inverses and the condition, each in its column."""
    grouped = SimpleNamespace(
        groups_=((0,), (1,)), searched_=(3, 4), standard_error_=1.0, spectrum_=Spectrum((10.0, 2.0))
    )
    table = hwang.exhibits.table("thresholds", [(Interval(0.5, 0.75, ((0,),)), grouped, "", 0.5, "T1 T2", 7.0)])
    cells = dict(zip(table.header, table.rows[0], strict=True))
    assert cells["smallest eigenvalue"] == "2"
    assert cells["sum of 1/eigenvalue"] == "0.6"
    assert cells["condition"] == "5"


def test_only_other_models_count_as_thresholds_at_which_grouping_helps() -> None:
    """H-14: two of three are other models, and of one of these the smallest eigenvalue is larger."""

    def at(smallest: float, *selected: int) -> Any:
        return SimpleNamespace(selected_=selected, spectrum_=Spectrum((10.0, smallest)))

    single = at(1.0, 0, 1)
    swept = [(None, g) for g in (at(2.0, 0, 2), at(0.5, 1, 2), single)]
    facts = hwang._collinearity(SimpleNamespace(grouped=swept[0][1], single=single, swept=swept))
    assert (facts["larger"], facts["compared"]) == (1, 2)


def test_errors_by_the_number_of_neighbours() -> None:
    """W-05: the error of each, then the difference from k = 2."""
    sweep = {1: (0.5, 0.05), 2: (0.25, 0.0)}
    table = spindle.exhibits.table("neighbours", sweep.items())
    assert [list(row) for row in table.rows] == [["1", "0.500", "0.050"], ["2", "0.250", "0.000"]]
    assert [h.startswith("RMS difference") for h in table.header] == [False, False, True]


def test_the_smallest_number_is_enough_for_every_displacement() -> None:
    """W-12."""
    by_size = {1: np.array([0.995, 0.9]), 2: np.array([0.999, 0.98]), 3: np.array([0.999, 0.991])}
    (claim,) = sets.claims.judged("enough", SimpleNamespace(by_size=by_size))  # type: ignore[arg-type]
    assert claim.finding.endswith("above 0.99 for every displacement: 3.")


def test_figure_6_shows_each_method_by_its_own_error() -> None:
    """T-08, T-09: on-line, the drift, its predictions and what each of them leaves."""
    x, hours = np.arange(5.0), np.linspace(0.0, 4 * 3600.0, 5)
    left = {m: np.full(5, k) for k, m in enumerate((STEPWISE, LEAST, PURSUIT), start=1)}
    online = SimpleNamespace(time=hours, deviations=x[:, None])
    fit = SimpleNamespace(
        time=hours,
        deviations=-x[:, None],
        inputs=[SimpleNamespace(name=f"t_{k}_C") for k in range(24)],
        values=np.zeros((5, 24)),
    )
    thinned = [SimpleNamespace(rows=k, names=()) for k in (1, 2)]
    figures = stepwise2017._figures(SimpleNamespace(fit=fit, online=online, left=left, thinned=thinned))  # type: ignore[arg-type]
    (figure,) = (f for f in figures if f.key == "stepwise2017-fig6")
    predicted, residual = ({c.label: c.y.tolist() for c in p.curves} for p in figure.panels)
    assert residual == {m: e.tolist() for m, e in left.items()}
    assert predicted == {m: (x - e).tolist() for m, e in left.items()} | {"measured": x.tolist()}


def test_every_measured_recording_is_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """X-02: of all files that are given, and for every displacement."""
    for k in range(2):
        recordings.write(small_machine((1000.0 + k, 2500.0), seed=k), tmp_path / f"test{k}.csv")
    judged: list[tuple[list[str], str]] = []
    take = cross.take_task

    def taken(given: Sequence[Recording], target: str) -> cross.Task:
        judged.append(([r.name for r in given], target))
        return take(given, target)

    def study(*_: Any, **__: Any) -> list[cross.Row]:
        return [cross.Row("a task", m, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0) for m in (cross.NONE, "ols")]

    run_cross = cross.run

    def without_experiments(*given: Any, **more: Any) -> Study:
        return run_cross(*given, **more, experiments=[])

    monkeypatch.setattr(cross, "take_task", taken)
    monkeypatch.setattr(cross, "judge", study)
    monkeypatch.setattr(cross, "run", without_experiments)
    files = [str(tmp_path / f"test{k}.csv") for k in range(2)]
    assert run(["papers", "cross", "--models", "ols", "--with", files[0], "--with", files[1], "--json"]) == 0
    assert sorted(judged) == [(["test0", "test1"], t) for t in ("x_um", "z_um")]
