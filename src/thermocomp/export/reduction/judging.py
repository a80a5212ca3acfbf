"""Reduction: the best model of a controller's form, judged on unseen cycles, next to the full model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.export.reduction.models import LinearReduction
from thermocomp.export.reduction.reduced import LeftOut, Reduced, RemainingError, Shape
from thermocomp.judging import metrics
from thermocomp.judging.compare import compare
from thermocomp.judging.replay import are_absolute, replay
from thermocomp.judging.results import Assessment, Comparison, Rules
from thermocomp.judging.splits import Judging, by_rows, leave_one_cycle_out
from thermocomp.judging.study import honest_error
from thermocomp.models.methods import METHODS, NamedEstimator, deployable
from thermocomp.models.training import train
from thermocomp.recordings.checks.sound import drop_unsound
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start

FloatArray = NDArray[np.float64]

NAME = "reduced"
#: a controller's formula has no trained range and extrapolates
UNBOUNDED = Support("clip", margin=1e3)
#: training and judged fractions of a single cycle: an estimate, not a proof
_SHARES = (0.6, 0.4)


@dataclass(frozen=True, eq=False)
class Reduction:
    """A reduced model and its judging results.

    Parameters
    ----------
    blocks : tuple of Assessment
        Results on each unseen block.
    full : tuple of Assessment
        Results of the full model on the same blocks; empty if it could not be refitted.
    time : tuple of ndarray
        Times of the rows of each recording [s].
    """

    reduced: Reduced
    blocks: tuple[Assessment, ...]
    full: tuple[Assessment, ...]
    time: tuple[FloatArray, ...]


def reduce_model(
    model: ErrorModel,
    axis: str,
    recordings: Sequence[Recording],
    shape: Shape,
    *,
    sensors: Sequence[str] | None = None,
    starts: Start | Sequence[Start] | None = None,
    rules: Rules = Rules(),
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Reduction:
    """Fit the best model of a form to recordings, and judge it next to the full model.

    For each unseen cycle, sensors are selected by cross-validation on the other cycles. The judged model has rounded
    coefficients, as printed, and no trained range, like the controller. The full model is also refitted without each
    cycle if its method is known; otherwise its error is taken from its file.

    Parameters
    ----------
    shape : Shape
    sensors : sequence of str, optional
        Candidate temperatures. Default: all.
    starts : Start or sequence of Start, optional
        Initial state of the recordings. Default: determined from the recordings.
    """
    samples = _samples(model, recordings, shape, starts)
    heat = [c.name for c in samples.inputs if c.quantity == "temperature"]
    if unknown := [s for s in sensors or () if s not in heat]:
        raise InputError(f"--sensors {', '.join(unknown)}: no such temperature; there are {', '.join(heat)}")
    if not heat:
        raise InputError(
            f"{recordings[0].name}: no temperature was recorded, so the controller has no input for a compensation"
        )
    judging, known = _judging(samples), samples.only(sensors or heat)
    taken = {"", model.target, *(c.name for c in known.inputs)}
    known = replace(known, trouble=tuple(t for t in known.trouble if t[0] in taken))
    estimator = LinearReduction(max_sensors=shape.sensors, fit_intercept=shape.constant and not samples.rezero)
    named = NamedEstimator(NAME, estimator)
    found = compare(known, [named], judging, rules=rules, support=UNBOUNDED, limits=None, jobs=jobs, progress=progress)
    (overall,) = found.overall()
    every = np.ones(len(known), dtype=np.bool_)
    honest = honest_error(overall, judging)
    written = replace(train(named, known, 0, every, support=UNBOUNDED, joint=False).model, honest_error=honest)
    method = method_of(model, samples)
    beside = compare(
        samples, [method], judging, robustness=False, refit=False, limits=None, jobs=jobs, progress=progress
    ) if method else None  # fmt: skip
    if beside is not None and beside.overall()[0].failure:
        beside = None
    blocks, full = _blocks(found), _blocks(beside)
    rows = known.valid & np.isfinite(known.deviations[:, 0]) & (known.cycle >= 0)
    said, _ = replay(written, known, rows)
    reduced = Reduced(
        model=written,
        axis=axis,
        beside=_beside(model, method if full else "", judging),
        none=RemainingError(overall.none_metric("rms"), overall.none_metric("max_abs")),
        full=_full(model, beside),
        reduced=_left(overall),
        cycles=tuple(_left_outs(blocks, full)),
        replayed=_of(known.deviations[rows, 0] - said),
        most=float(max(np.abs(a).max(initial=0.0) for a in (said, *(b.predicted for b in blocks)))),
    )
    return Reduction(reduced, blocks, full, tuple(r.time for r in recordings))


def method_of(model: ErrorModel, samples: Samples) -> str:
    """Return the method by which a model was fitted if it can be refitted in this way; otherwise an empty string."""
    known = model.provenance
    if known is None or known.method not in METHODS or not deployable(known.method):
        return ""
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    own = METHODS[known.method].build(speeds).get_params()
    return known.method if known.parameters == {k: repr(v) for k, v in own.items()} else ""


def _samples(
    model: ErrorModel, recordings: Sequence[Recording], shape: Shape, starts: Start | Sequence[Start] | None
) -> Samples:
    """Return the samples needed for refitting the full model, and for selecting the reduced one."""
    first = recordings[0]
    speeds = (first.speed.name,) if first.speed is not None else ()
    names = dict.fromkeys([*(c.name for c in first.temperatures), *speeds, *(i.name for i in model.inputs)])
    rezero = not (shape.constant and are_absolute([model]))
    samples = stack(recordings, [model.target], list(names), rezero=rezero, zeroing=model.zeroing, starts=starts)
    return drop_unsound(samples, recordings)


def _judging(samples: Samples) -> Judging:
    """Return a scheme that leaves out each thermal cycle in turn, or the last part of a single cycle."""
    if len(samples.cycle_names) > 1:
        return leave_one_cycle_out(samples)
    return by_rows(samples, *_SHARES)


def _blocks(found: Comparison | None) -> tuple[Assessment, ...]:
    """Return the assessments of the single blocks; the overall assessment if there is only one block."""
    if found is None:
        return ()
    return tuple(a for a in found.assessments if not a.overall) or found.overall()


def _left_outs(blocks: Sequence[Assessment], full: Sequence[Assessment]) -> list[LeftOut]:
    others = {a.block: a.metric("rms") for a in full}
    return [
        LeftOut(
            name=a.block,
            model=a.frozen,
            none=a.none_metric("rms"),
            full=others.get(a.block, math.nan),
            reduced=a.metric("rms"),
        )
        for a in blocks
        if a.frozen is not None
    ]


def _beside(model: ErrorModel, method: str, judging: Judging) -> str:
    if method:
        return (
            f"method {method}, fitted again for this comparison; both models are judged in the same way: {judging.name}"
        )
    if model.honest_error is None:
        return "the method of the model is not known, and the model was never judged on unseen cycles"
    return (
        "the method of the model, or its settings, are not known: the error is that in the model file "
        f"({model.honest_error.protocol}), not one on the cycles of these recordings"
    )


def _full(model: ErrorModel, beside: Comparison | None) -> RemainingError:
    if beside is not None:
        return _left(beside.overall()[0])
    found = model.honest_error
    return RemainingError(math.nan, math.nan) if found is None else RemainingError(found.rms, found.max_abs)


def _left(found: Assessment) -> RemainingError:
    return RemainingError(found.metric("rms"), found.metric("max_abs"))


def _of(residual: FloatArray) -> RemainingError:
    nothing = np.zeros_like(residual)
    return RemainingError(metrics.METRICS["rms"](residual, nothing), metrics.METRICS["max_abs"](residual, nothing))
