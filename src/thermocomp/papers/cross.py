"""One table across the papers: every method on every experiment, judged on an unseen test (X-02, X-03)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from thermocomp.judging.compare import compare, n_pieces
from thermocomp.judging.replay import replay
from thermocomp.judging.results import Assessment
from thermocomp.judging.splits import Judging, Split, leave_one_cycle_out
from thermocomp.models.methods import expand
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import rms, stacked
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.study import Figure, Progress, Study, StudyTable, tell_nobody
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.datasets import record

#: methods of the papers, least squares for comparison, and ours; all are fast, `thermocomp.models.methods` has more
FAST = ("ols", "mra", "mlp", "ace", "grouping", "partial-f", "arx", "ace-monotone", "dynamic")
#: label of no compensation in the table
NONE = "none"


@dataclass(frozen=True)
class CrossExperiment:
    """A paper's experiment as a task: the first tests are for training, the last ones are unseen.

    Parameters
    ----------
    name : str
        Name of the experiment of the virtual machine.
    target : str or int
        Displacement, by name or index.
    unseen : int
        Number of tests at the end that are unseen.
    then : str
        Another experiment whose tests follow; if the same, the experiment is repeated on another day.
    """

    name: str
    target: str | int
    unseen: int = 1
    then: str = ""

    def recordings(self, seed: int) -> list[Recording]:
        """Run the experiment; `then` is run with the next seed, so with other weather and random draws."""
        return record(self.name, seed=seed) + (record(self.then, seed=seed + 1) if self.then else [])


EXPERIMENTS = (
    CrossExperiment("chen1996", "z_um", unseen=2, then="chen1996-new"),
    CrossExperiment("wessel-fem", -1),
    CrossExperiment("wessel-tool", 0),
    CrossExperiment("wessel-milling", 0),
    CrossExperiment("hwang", "z_um", then="hwang"),
    CrossExperiment("precompensation", 0),
    CrossExperiment("stepwise2017", "x1_um", then="stepwise2017-online"),
)


@dataclass(frozen=True, eq=False)
class Task:
    """Training and validation rows.

    Parameters
    ----------
    samples : Samples
        Samples with one target.
    """

    name: str
    samples: Samples
    judging: Judging


@dataclass(frozen=True)
class Row:
    """Result of one method on one task; nan if it could not be fitted.

    Parameters
    ----------
    fit_rms : float
        RMS of the replay on the training rows, pooled over all training runs [um].
    rms, max_abs, peak_to_peak : float
        Errors on the unseen rows [um].
    noise_rms : float
        RMS with uniform noise of +-0.4 degC on every temperature [um] (C-33).
    lost_rms : float
        RMS without the input whose loss does most harm [um] (C-34).
    lost : str
        Name of that input.
    sensors : int
        Number of inputs that affect the result; the largest of all training runs.
    fit_s : float
        Duration of the fits [s].
    failure : str
        Reason why the fit failed; empty if it succeeded.
    """

    task: str
    method: str
    fit_rms: float
    rms: float
    max_abs: float
    peak_to_peak: float
    noise_rms: float
    lost_rms: float
    lost: str = ""
    sensors: int = 0
    fit_s: float = 0.0
    failure: str = ""


def simulate_task(experiment: CrossExperiment, seed: int) -> Task:
    """Run an experiment on the virtual machine; its last tests are unseen."""
    recordings = experiment.recordings(seed)
    target = experiment.target
    name = target if isinstance(target, str) else recordings[0].displacements[target].name
    samples = stacked(recordings, [name])
    unseen = samples.test >= len(recordings) - experiment.unseen
    split = Split("unseen tests", ~unseen, unseen)
    return Task(f"{experiment.name}, {name}", samples, Judging("whole tests left out", (split,)))


def take_task(recordings: Sequence[Recording], target: str) -> Task:
    """Return a task from recordings of a real machine: each thermal cycle is unseen once (X-02)."""
    samples = stacked(recordings, [target])
    name = f"{samples.test_names[0]}{' ...' if len(recordings) > 1 else ''}, {target}"
    return Task(name, samples, leave_one_cycle_out(samples))


def judge(task: Task, methods: Sequence[str], progress: Progress = tell_nobody, *, jobs: int = 1) -> list[Row]:
    """Judge methods on a task; the first row of the result is without compensation."""
    pieces, done = n_pieces(task.samples, methods, task.judging), 0

    def tell(what: str) -> None:
        nonlocal done
        done += 1
        progress(done / pieces, f"{task.name}: {what}")

    found = compare(task.samples, methods, task.judging, limits=None, jobs=jobs, progress=tell)
    rows = [_none(task, found.overall()[0])]
    for overall in found.overall():
        rows.append(_row(task, overall, [a for a in found.assessments if a.model == overall.model]))
    return rows


def run(
    seed: int,
    progress: Progress = tell_nobody,
    recordings: Sequence[Recording] = (),
    *,
    methods: Sequence[str] = FAST,
    experiments: Sequence[CrossExperiment] = EXPERIMENTS,
    targets: Sequence[str] | None = None,
    jobs: int = 1,
) -> Study:
    """Judge the methods on all experiments, and on measured recordings.

    Parameters
    ----------
    targets : sequence of str, optional
        Displacements of the measured machine. Default: all.
    """
    names = expand(methods)
    if targets is None:
        targets = [c.name for c in recordings[0].displacements] if recordings else []
    real = [take_task(recordings, target) for target in targets]  # first, so that unusable input is reported at once
    n = len(experiments) + len(real)
    rows: list[list[Row]] = []

    def tell(share: float, what: str) -> None:
        progress((len(rows) + share) / n, what)

    for experiment in experiments:
        tell(0.0, f"{experiment.name}: recording")
        rows.append(judge(simulate_task(experiment, seed), names, tell, jobs=jobs))
    for task in real:
        rows.append(judge(task, names, tell, jobs=jobs))
    progress(1.0, "done")
    return Study(
        name="cross",
        title="The methods on all experiments",
        claims=tuple(
            claim
            for k, mine in enumerate(rows)
            if any(not r.failure for r in mine[1:])
            for claim in (simulated if k < len(experiments) else measured)(mine)
        ),
        tables=(_overview(rows), *map(_table, rows)) if rows else (),
        figures=(_figure(rows),),
        numbers={f"{r.task}, {r.method}: rms_um": r.rms for mine in rows for r in mine if not r.failure},
    )


def _row(task: Task, overall: Assessment, blocks: Sequence[Assessment]) -> Row:
    stressed = overall.robustness
    lost, lost_rms = stressed.worst_lost if stressed else ("", float("nan"))
    if stressed and not overall.sensors:  # a constant: there is no sensor to lose
        lost_rms = overall.metric("rms")
    return Row(
        task=task.name,
        method=overall.model,
        fit_rms=_fit_rms(task, blocks) if not overall.failure else float("nan"),
        rms=overall.metric("rms"),
        max_abs=overall.metric("max_abs"),
        peak_to_peak=overall.metric("peak_to_peak"),
        noise_rms=stressed.noise_rms["uniform"][0] if stressed else float("nan"),
        lost_rms=lost_rms,
        lost=lost,
        sensors=overall.n_sensors[1],
        fit_s=overall.fit_s,
        failure=overall.failure,
    )


def _none(task: Task, first: Assessment) -> Row:
    learned = np.any([s.learn for s in task.judging.splits], axis=0)
    none = first.none_metric("rms")
    return Row(
        task=task.name,
        method=NONE,
        fit_rms=rms(task.samples.deviations[learned, 0]),
        rms=none,
        max_abs=first.none_metric("max_abs"),
        peak_to_peak=first.none_metric("peak_to_peak"),
        noise_rms=none,
        lost_rms=none,
    )


def _fit_rms(task: Task, blocks: Sequence[Assessment]) -> float:
    """Return the RMS of the models replayed on their training rows, in the order of the splits."""
    splits = {s.block: s for s in task.judging.splits}
    residuals = []
    for block in blocks:
        if block.frozen is not None:
            learned = splits[block.block].learn & np.isfinite(task.samples.deviations[:, 0])
            residuals.append(task.samples.deviations[learned, 0] - replay(block.frozen, task.samples, learned)[0])
    return rms(np.concatenate(residuals))


simulated = Claims[Sequence[Row]](__name__, section="simulated")
measured = Claims[Sequence[Row]](__name__, section="measured")
exhibits = Exhibits(__name__)


@simulated.facts
@measured.facts
def _useful(rows: Sequence[Row]) -> Facts:
    """Return the facts of the claim implied by every paper: its method is useful in an unseen test."""
    none, *judged = rows
    fitted = [r for r in judged if not r.failure]
    failed = [r.method for r in judged if r.failure]
    harmful = [(r.method, r.rms) for r in fitted if not r.rms < none.rms]
    several = len(fitted) > 2
    return {
        "none": none,
        "best": min(fitted, key=lambda r: r.rms),
        "fitted": len(fitted),
        "harmful": harmful,
        "holds": not harmful,
        "compared": True,
        "ratio": np.median([r.rms / r.fit_rms for r in fitted if r.fit_rms > 0]),
        "ranked": several,
        "rank": spearmanr([r.fit_rms for r in fitted], [r.rms for r in fitted]).statistic if several else np.nan,
        "closest": min(fitted, key=lambda r: r.fit_rms),
        "worse": bool(harmful),
        "unfitted": bool(failed),
        "failed": failed,
    }


def _overview(rows: Sequence[Sequence[Row]]) -> StudyTable:
    """Return the overview table of all methods on all experiments (X-03)."""
    cells = [
        [first.method, *("-" if mine[k].failure else f"{mine[k].rms:.2f}" for mine in rows)]
        for k, first in enumerate(rows[0])
    ]
    tasks = (mine[0].task.replace(", ", " ") for mine in rows)
    caption = (
        "RMS [um] in unseen tests (X-03). Every method is given all temperatures and the spindle speed, and uses those "
        "that it supports; -: it could not be fitted."
    )
    return StudyTable(caption, ("method", *tasks), cells)


def _table(rows: Sequence[Row]) -> StudyTable:
    cells: list[tuple[str, list[str], str, str, str]] = []
    for r in rows:
        if r.failure:
            cells.append((r.method, ["-"] * 6, f"not fitted: {r.failure.partition(':')[0]}", "", ""))
            continue
        errors = [f"{e:.2f}" for e in (r.fit_rms, r.rms, r.max_abs, r.peak_to_peak, r.noise_rms, r.lost_rms)]
        cells.append((r.method, errors, r.lost, str(r.sensors), f"{r.fit_s:.2f}"))
    return exhibits.table("task", cells, task=rows[0].task)


def _figure(rows: Sequence[Sequence[Row]]) -> Figure:
    places = np.arange(1, len(rows) + 1, dtype=np.float64)
    shares = {
        first.method: np.array([mine[k].rms / mine[0].rms for mine in rows]) for k, first in enumerate(rows[0]) if k
    }
    tasks = [f"{k} {mine[0].task}" for k, mine in enumerate(rows, start=1)]
    return exhibits.figure("cross-unseen", (places, shares), tasks=tasks)
