"""Compare methods on unseen blocks: train, replay, judge."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from thermocomp.assessment import harm, metrics
from thermocomp.assessment.diagnostics import Collinearity, collinearity
from thermocomp.assessment.replay import replay
from thermocomp.assessment.robustness import Robustness, pooled, stress
from thermocomp.assessment.splits import Judging, Split, called, stretches
from thermocomp.core.exceptions import FitError
from thermocomp.core.model import ErrorModel, Support
from thermocomp.models.methods import deployable, expand
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.training import train
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

#: name of the block that holds all unseen cycles together
ALL = "all unseen cycles"


@dataclass(frozen=True, eq=False)
class Assessment:
    """How one model did for one target on one unseen block.

    Parameters
    ----------
    model, target, block : str
    measured, predicted : ndarray of shape (n_judged,)
        Deviations [um].
    row, test, cycle : ndarray of int of shape (n_judged,)
        Where the rows stand in their file, which file, which thermal cycle.
    verdict : Verdict
        Of the do-no-harm gate.
    sensors : tuple of str
        Inputs with an influence; those of all models, if several were trained.
    fit_s : float
        The fits took [s].
    n_effective : float
        Independent rows the residual is worth.
    robustness : Robustness or None
    frozen : ErrorModel or None
        The model that was replayed; None for several blocks together, or if it could not be fitted.
    failure : str
        Why the method could not be fitted; empty if it could.
    caveat : str
        Why this is no honest test, whatever the figures say; empty if it is one.
    overall : bool
        It is the last word on this model and target: all that was judged, not one cycle of it.
    n_sensors : tuple of (int, int)
        Fewest and most inputs with an influence in one model.
    """

    model: str
    target: str
    block: str
    measured: FloatArray
    predicted: FloatArray
    row: IntArray
    test: IntArray
    cycle: IntArray
    verdict: harm.Verdict
    sensors: tuple[str, ...]
    fit_s: float
    n_effective: float
    robustness: Robustness | None = None
    frozen: ErrorModel | None = None
    failure: str = ""
    caveat: str = ""
    overall: bool = False
    n_sensors: tuple[int, int] = (0, 0)

    def metric(self, name: str) -> float:
        """Return a metric of `thermocomp.assessment.metrics`; nan if the method could not be fitted."""
        return float("nan") if self.failure else metrics.METRICS[name](self.measured, self.predicted)

    def none_metric(self, name: str) -> float:
        """Return the metric without compensation."""
        return (
            metrics.METRICS[name](self.measured, np.zeros_like(self.measured)) if self.measured.size else float("nan")
        )

    @property
    def accepted(self) -> bool:
        """True if the gate let it pass."""
        return not self.failure and not self.caveat and self.verdict.accepted

    @property
    def reason(self) -> str:
        """Why it was accepted or refused."""
        if self.failure:
            return f"could not be judged: {self.failure}"
        return self.caveat or self.verdict.reason


@dataclass(frozen=True)
class Comparison:
    """Several methods on the same unseen blocks.

    Parameters
    ----------
    judging : Judging
    assessments : tuple of Assessment
        Per target, method and block; with several blocks also one for all of them together.
    collinearity : Collinearity
        Of the temperatures.
    left : int
        Pairs of method and target that were not judged, because the work was stopped.
    """

    judging: Judging
    assessments: tuple[Assessment, ...]
    collinearity: Collinearity
    left: int = 0

    def overall(self) -> tuple[Assessment, ...]:
        """Return one assessment per target and method: over all its blocks."""
        return tuple(a for a in self.assessments if a.overall)

    def best(self, target: str) -> Assessment | None:
        """Return the accepted assessment with the smallest RMS for a target, of the methods that can be deployed."""
        fit = [a for a in self.overall() if a.target == target and a.accepted and deployable(a.model)]
        return min(fit, key=lambda a: a.metric("rms"), default=None)


def compare(
    samples: Samples,
    methods: Sequence[Any],
    judging: Judging,
    *,
    support: Support = Support(),
    robustness: bool = True,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Train every method for every target and judge it on what it has not seen.

    Stopped by the keyboard, it returns the methods that were judged on all blocks, and how many were not.

    Parameters
    ----------
    samples : Samples
    methods : sequence of str or estimator
        ``all`` stands for all of them; see `thermocomp.models.methods.expand`.
    judging : Judging
        What is learned from and what is judged.
    support : Support
        What the models do outside their trained range.
    robustness : bool
        Also replay with noise and lost sensors.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    progress : callable
        Called with a line of text after each piece of work; there are `n_pieces` of them.

    Returns
    -------
    Comparison
    """
    names = expand(methods)
    pieces = [(k, n, split) for k in range(len(samples.targets)) for n in names for split in judging.splits]
    done: list[Assessment] = []
    work = (delayed(_assess_method)(samples, n, k, split, support, robustness) for k, n, split in pieces)
    try:
        for a in Parallel(n_jobs=jobs, return_as="generator")(work):
            progress(f"{a.target} {a.model} {a.block}")
            done.append(a)
    except KeyboardInterrupt:
        if len(done) < len(judging.splits):
            raise
    found: list[Assessment] = []
    whole = len(done) // len(judging.splits)  # a method that was judged on some of the blocks only is left out
    for k in range(whole):
        parts = done[k * len(judging.splits) : (k + 1) * len(judging.splits)]
        found += parts if len(parts) > 1 else []
        found.append(_together(parts))
    temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    values = samples.change()[samples.valid][:, temperatures]
    heat = collinearity(values, tuple(samples.inputs[j].name for j in temperatures))
    return Comparison(judging, tuple(found), heat, left=len(pieces) // len(judging.splits) - whole)


def n_pieces(samples: Samples, methods: Sequence[Any], judging: Judging) -> int:
    """Return the number of pieces of work of `compare`."""
    return len(samples.targets) * len(expand(methods)) * len(judging.splits)


def judge(
    name: str, model: ErrorModel, samples: Samples, split: Split, *, fit_s: float = 0.0, robustness: bool = True
) -> Assessment:
    """Judge a frozen model on a block.

    Parameters
    ----------
    name : str
        What to call the model.
    model : ErrorModel
    samples : Samples
        With all of the model's inputs, and its target.
    split : Split
        Only its block is looked at.
    fit_s : float
        The fit took [s].
    robustness : bool
        Also replay with noise and lost sensors.

    Returns
    -------
    Assessment

    """
    target = [c.name for c in samples.targets].index(model.target)
    rows = split.judge & np.isfinite(samples.deviations[:, target])
    if not rows.any():
        return _failed(samples, name, target, split, f"{model.target} has no number in {split.block} to judge against")
    measured = samples.deviations[rows, target]
    stressed = stress(model, samples, measured, rows) if robustness else None
    predicted = stressed.predicted if stressed else replay(model, samples, rows)[0]
    if not np.isfinite(metrics.rms(measured, predicted)):
        return _failed(samples, name, target, split, f"the residual of {model.target} is beyond all numbers")
    return Assessment(
        model=name,
        target=model.target,
        block=split.block,
        measured=measured,
        predicted=predicted,
        row=samples.row[rows],
        test=samples.test[rows],
        cycle=samples.cycle[rows],
        verdict=harm.judge(
            measured, predicted, [(split.name, rows[rows])] if split.whole else list(_segments(samples, rows))
        ),
        sensors=model.sensors,
        n_sensors=(len(model.sensors), len(model.sensors)),
        fit_s=fit_s,
        n_effective=effective_sample_size(measured - predicted),
        robustness=stressed.robustness if stressed else None,
        frozen=model,
    )


def per_cycle(whole: Assessment) -> list[Assessment]:
    """Cut an assessment into its thermal cycles; what needs a replay of its own (robustness) stays with the whole."""
    found = []
    for verdict, block in zip(whole.verdict.cycles, stretches(whole.cycle, whole.test), strict=True):
        rows = np.isin(whole.cycle, block)
        measured, predicted = whole.measured[rows], whole.predicted[rows]
        found.append(
            replace(
                whole,
                block=f"cycle {verdict.cycle}",
                measured=measured,
                predicted=predicted,
                row=whole.row[rows],
                test=whole.test[rows],
                cycle=whole.cycle[rows],
                verdict=harm.Verdict((verdict,), whole.verdict.level),
                n_effective=effective_sample_size(measured - predicted),
                robustness=None,
                overall=False,
            )
        )
    return found


def _assess_method(
    samples: Samples, name: str, target: int, split: Split, support: Support, robustness: bool
) -> Assessment:
    try:
        trained = train(name, samples, target, split.learn, support=support)
    except FitError as e:
        return _failed(samples, name, target, split, str(e))
    return judge(name, trained.model, samples, split, fit_s=trained.seconds, robustness=robustness)


def _failed(samples: Samples, name: str, target: int, split: Split, why: str) -> Assessment:
    """Return the assessment of a method that gave no prediction: refused, and said why."""
    rows = split.judge & np.isfinite(samples.deviations[:, target])
    measured = samples.deviations[rows, target]
    return Assessment(
        model=name,
        target=samples.targets[target].name,
        block=split.block,
        measured=measured,
        predicted=np.zeros_like(measured),
        row=samples.row[rows],
        test=samples.test[rows],
        cycle=samples.cycle[rows],
        verdict=harm.Verdict((), harm.LEVEL),
        sensors=(),
        fit_s=0.0,
        n_effective=float("nan"),
        failure=why,
    )


def _segments(samples: Samples, rows: BoolArray) -> Iterator[tuple[str, BoolArray]]:
    cycle = samples.cycle[rows]
    for block in stretches(cycle, samples.test[rows]):
        mine, name = np.isin(cycle, block), called(samples, block)
        whole = mine.sum() == np.isin(samples.cycle, block).sum()
        yield name if whole else f"part of {name}", mine


def _together(parts: Sequence[Assessment]) -> Assessment:
    if len(parts) == 1:
        return replace(parts[0], overall=True)
    first = parts[0]
    failures = [a.failure for a in parts if a.failure]
    return replace(
        first,
        block=ALL,
        measured=np.concatenate([a.measured for a in parts]),
        predicted=np.concatenate([a.predicted for a in parts]),
        row=np.concatenate([a.row for a in parts]),
        test=np.concatenate([a.test for a in parts]),
        cycle=np.concatenate([a.cycle for a in parts]),
        verdict=harm.Verdict(tuple(c for a in parts for c in a.verdict.cycles), first.verdict.level),
        sensors=tuple(dict.fromkeys(s for a in parts for s in a.sensors)),
        n_sensors=(min(a.n_sensors[0] for a in parts), max(a.n_sensors[1] for a in parts)),
        fit_s=sum(a.fit_s for a in parts),
        n_effective=sum(a.n_effective for a in parts),
        robustness=pooled([(a.robustness, len(a.measured)) for a in parts]),
        frozen=None,
        failure=failures[0] if failures else "",
        overall=True,
    )
