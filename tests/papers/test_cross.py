"""The table across the papers: what is learned, what is judged, and what each figure in it means."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError
from thermocomp.judging.compare import compare as judging_compare
from thermocomp.judging.robustness import stress
from thermocomp.models.methods import METHODS
from thermocomp.models.training import train
from thermocomp.papers import cross
from thermocomp.papers.cross import CrossExperiment, Row
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording

METHODS_HERE = ("ols", "dynamic", "arx")


def three_tests(name: str, seed: int) -> list[Recording]:
    """Return an experiment of three tests; without a spindle speed if it is the resting one."""
    speeds = ((1000.0, 2500.0), (3000.0, 1800.0), (2200.0,))
    found = [replace(small_machine(s, seed=10 * seed + k), name=f"{name}-{k}") for k, s in enumerate(speeds)]
    if name != "resting":
        return found
    still = []
    for r in found:
        kept = tuple(c for c in r.channels if c.quantity != "spindle_speed")
        still.append(replace(r, table=r.table[[c.name for c in kept]], channels=kept, cycles=make_single_cycle(len(r))))
    return still


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """The small machine in place of the virtual one; what was asked of it."""
    asked: list[tuple[str, int]] = []

    def record(name: str, *, seed: int) -> list[Recording]:
        asked.append((name, seed))
        return three_tests(name, seed)

    monkeypatch.setattr(cross, "record", record)
    return asked


def row(rows: Sequence[Row], method: str) -> Row:
    (found,) = [r for r in rows if r.method == method]
    return found


def test_the_last_tests_are_unseen(machine: list[tuple[str, int]]) -> None:
    task = cross.simulate_task(CrossExperiment("moving", "z_um", unseen=2), seed=3)
    (split,) = task.judging.splits
    np.testing.assert_array_equal(split.learn, task.samples.test == 0)
    np.testing.assert_array_equal(split.judge, task.samples.test > 0)
    assert machine == [("moving", 3)]
    assert task.name == "moving, z_um"


def test_what_follows_has_another_seed(machine: list[tuple[str, int]]) -> None:
    task = cross.simulate_task(CrossExperiment("moving", -1, then="later"), seed=3)
    assert machine == [("moving", 3), ("later", 4)]
    assert task.samples.targets[0].name == "x_um"
    np.testing.assert_array_equal(task.judging.splits[0].judge, task.samples.test == 5)


@pytest.mark.usefixtures("machine")
def test_figures_of_a_row() -> None:
    task = cross.simulate_task(CrossExperiment("moving", "z_um"), seed=0)
    rows = cross.judge(task, METHODS_HERE)
    assert [r.method for r in rows] == [cross.NONE, *METHODS_HERE]
    split, y = task.judging.splits[0], task.samples.deviations[:, 0]
    none = row(rows, cross.NONE)
    assert none.rms == pytest.approx(np.sqrt(np.mean(y[split.judge] ** 2)))
    assert none.fit_rms == pytest.approx(np.sqrt(np.mean(y[split.learn] ** 2)))
    assert (none.sensors, none.noise_rms, none.lost_rms) == (0, none.rms, none.rms)

    trained = train("ols", task.samples, 0, split.learn)
    X = task.samples.only([i.name for i in trained.model.inputs]).frame()
    residual = y - trained.estimator.predict(X)
    ols = row(rows, "ols")
    assert ols.fit_rms == pytest.approx(np.sqrt(np.mean(residual[split.learn] ** 2)))
    assert ols.rms == pytest.approx(np.sqrt(np.mean(residual[split.judge] ** 2)))
    assert ols.max_abs == pytest.approx(np.abs(residual[split.judge]).max())
    assert ols.peak_to_peak == pytest.approx(np.ptp(residual[split.judge]))
    stressed = stress(trained.model, task.samples, y[split.judge], split.judge).robustness
    assert ols.noise_rms == stressed.noise_rms["uniform"][0] > ols.rms
    assert (ols.lost, ols.lost_rms) == stressed.worst_lost
    assert ols.sensors == 3
    assert row(rows, "arx").noise_rms == pytest.approx(row(rows, "arx").rms)  # it knows no temperature


def test_of_a_measured_machine_every_cycle_is_unseen_once(recording: Recording) -> None:
    task = cross.take_task([recording], "x_um")
    assert len(task.judging.splits) == 4
    assert np.sum([s.judge for s in task.judging.splits], axis=0).tolist() == [1] * len(recording)
    (none, ols) = cross.judge(task, ["ols"])
    y, squares, n = task.samples.deviations[:, 0], 0.0, 0
    for s in task.judging.splits:
        trained = train("ols", task.samples, 0, s.learn)
        fitted = trained.estimator.predict(task.samples.only([i.name for i in trained.model.inputs]).frame())
        squares, n = squares + float(((y - fitted)[s.learn] ** 2).sum()), n + int(s.learn.sum())
    assert ols.fit_rms == pytest.approx(np.sqrt(squares / n))
    assert none.rms == pytest.approx(np.sqrt(np.mean(y**2)))


@pytest.mark.usefixtures("machine")
def test_a_method_that_cannot_be_fitted_is_told(recording: Recording) -> None:
    study = cross.run(0, methods=METHODS_HERE, experiments=[CrossExperiment("resting", "z_um")])
    (claim,) = study.claims
    assert claim.finding.endswith("Not fitted: arx.")
    overview, table = study.tables
    assert ["arx", "-"] in [list(r) for r in overview.rows]
    cells = next(r for r in table.rows if r[0] == "arx")
    assert cells[7].startswith("not fitted: there is no spindle speed")
    assert "resting, z_um, arx: rms_um" not in study.numbers
    assert all(len(r) == len(t.header) for t in study.tables for r in t.rows)
    # one method that could be fitted is enough for a finding, none is not
    for methods, n_claims in ((("ols", "arx"), 1), (("arx",), 0)):
        again = cross.run(0, methods=methods, experiments=[CrossExperiment("resting", "z_um")])
        assert len(again.claims) == n_claims


def test_numbers_of_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """X-02: the middle number of sensors of the splits; the first of the errors with noise."""
    monkeypatch.setattr(cross, "_fit_rms", lambda *_: 0.5)
    robustness = SimpleNamespace(worst_lost=("t1_C", 9.0), noise_rms={"uniform": (3.0, 4.0), "normal": (5.0, 6.0)})
    overall = SimpleNamespace(
        robustness=robustness,
        model="ols",
        sensors=("t1_C",),
        n_sensors=(1, 2, 4),
        failure="",
        fit_s=0.1,
        metric=lambda name: {"rms": 1.0, "max_abs": 2.0, "peak_to_peak": 2.5}[name],
    )
    made = cross._row(SimpleNamespace(name="task"), overall, [])  # type: ignore[arg-type]
    assert made == Row(
        task="task",
        method="ols",
        fit_rms=0.5,
        rms=1.0,
        max_abs=2.0,
        peak_to_peak=2.5,
        noise_rms=3.0,
        lost_rms=9.0,
        lost="t1_C",
        sensors=2,
        fit_s=0.1,
        failure="",
    )
    overall.sensors = ()
    assert cross._row(SimpleNamespace(name="task"), overall, []).lost_rms == 1.0  # type: ignore[arg-type]


@pytest.mark.usefixtures("machine")
def test_one_table_of_all(recording: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[float] = []
    jobs: list[int] = []

    def compare(*given: Any, **more: Any) -> Any:
        jobs.append(more["jobs"])
        return judging_compare(*given, **more)

    monkeypatch.setattr(cross, "compare", compare)
    study = cross.run(
        0,
        lambda share, _: told.append(share),
        [recording],
        methods=("ols", "dynamic"),
        experiments=[CrossExperiment("moving", "z_um"), CrossExperiment("resting", "x_um")],
    )
    assert jobs == [1] * 4  # one process, unless more are asked for
    assert told == sorted(told)
    assert told[-1] == 1.0
    overview, *tables = study.tables
    assert all(len(r) == len(t.header) for t in study.tables for r in t.rows)
    tasks = ["moving, z_um", "resting, x_um", "small, z_um", "small, x_um"]
    assert list(overview.header[1:]) == [task.replace(",", "") for task in tasks]
    assert [r[0] for r in overview.rows] == [cross.NONE, "ols", "dynamic"]
    for task, table, k in zip(tasks, tables, range(1, 5), strict=True):
        assert table.caption.startswith(task)
        assert [r[0] for r in table.rows] == [cross.NONE, "ols", "dynamic"]
        assert [r[2] for r in table.rows] == [r[k] for r in overview.rows]
    assert [c.ids for c in study.claims] == [("X-03",), ("X-03",), ("X-02", "X-03"), ("X-02", "X-03")]
    ratio = study.numbers["moving, z_um, ols: rms_um"] / study.numbers["moving, z_um, none: rms_um"]
    (panel,) = study.figures[0].panels
    assert panel.curves[0].label == "ols"
    assert panel.curves[0].y[0] == pytest.approx(ratio)
    assert panel.curves[0].x.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert "1 moving, z_um; 2 resting, x_um;" in study.figures[0].caption


def test_a_method_that_does_harm_is_a_finding() -> None:
    def made(method: str, rms: float) -> Row:
        return Row("a task", method, 1.0, rms, 0.0, 0.0, 0.0, 0.0, "", 1, 0.0)

    (good,) = cross.simulated([made("none", 5.0), made("ols", 4.0), made("mlp", 2.0)])
    assert good.holds
    assert good.ours == "best mlp 2.00 um of 5.00 um; 0 of 2 do harm"
    (bad,) = cross.measured([made("none", 5.0), made("ols", 6.0), made("mlp", 2.0)])
    assert bad.ids == ("X-02", "X-03")
    assert bad.holds is False
    assert "Worse than no compensation: ols 6.0 um." in bad.finding


def test_methods_are_known_and_unknown_ones_refused() -> None:
    assert set(cross.FAST) <= set(METHODS)
    with pytest.raises(InputError, match="unknown model 'olss'"):
        cross.run(0, methods=["olss"], experiments=[])


def test_a_measured_machine(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """X-02: `papers cross --with` on every fifth row of fl_thermal, which was measured.

    Least squares fits four times better than it keeps, a memory keeps what it fits.
    """
    lines = (shared_data / "fl_thermal" / "recording.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "fl.csv").write_text("".join([lines[0], *lines[1::5]]), encoding="utf-8")
    monkeypatch.setattr(cross, "run", partial(cross.run, experiments=[]))
    asked = ["--with", str(tmp_path / "fl.csv"), "--target", "ch1_um", "--models", "ols", "dynamic", "--json"]
    assert run(["papers", "cross", *asked]) == 0
    (study,) = json.loads(capsys.readouterr().out)["studies"]
    rms = {m: study["numbers"][f"fl, ch1_um, {m}: rms_um"] for m in (cross.NONE, "ols", "dynamic")}
    assert rms["dynamic"] < 2.0
    assert 3 * rms["dynamic"] < rms["ols"] < rms[cross.NONE]
    (ols,) = (r for r in study["tables"][1]["rows"] if r[0] == "ols")
    assert float(ols[2]) > 4 * float(ols[1])
    (claim,) = study["claims"]
    assert claim["ids"] == ["X-02", "X-03"]


@pytest.mark.usefixtures("machine")
def test_the_table_has_every_method_and_figure_that_the_requirement_names() -> None:
    """X-03: MRA, ANN, ACE, grouping, precompensation and partial F beside no compensation, in this order of columns."""
    papers = ("mra", "mlp", "ace", "grouping", "arx", "partial-f")
    assert set(papers) <= set(cross.FAST)
    study = cross.run(0, methods=papers, experiments=[CrossExperiment("moving", "z_um")])
    task = cross.simulate_task(CrossExperiment("moving", "z_um"), seed=0)
    rows = {r.method: r for r in cross.judge(task, papers)}
    _, table = study.tables
    columns = ("method", "fit", "unseen", "max", "p-p", "noise", "lost", "worst input", "inputs", "fit [s]")
    assert tuple(table.header) == columns
    assert [r[0] for r in table.rows] == [cross.NONE, *papers]
    for cells in table.rows:
        r = rows[cells[0]]
        errors = (r.fit_rms, r.rms, r.max_abs, r.peak_to_peak, r.noise_rms, r.lost_rms)
        assert list(cells[1:7]) == [f"{e:.2f}" for e in errors]
        assert (r.failure, list(cells[7:9])) == ("", [r.lost, str(r.sensors)])
        assert len({*cells[1:5]}) == 4  # of each method, the figures are different ones
    assert rows["arx"].sensors == 1
    assert all(1 <= rows[m].sensors <= 4 for m in papers)
    assert all(float(cells[-1]) >= 0 for cells in table.rows if cells[0] in papers)
