"""Judge one model on one unseen block: residual, and whether the model may run."""

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.correction import Limits
from thermocomp.core.learned import Learned
from thermocomp.core.messages import Message
from thermocomp.core.model import ErrorModel
from thermocomp.judging import do_no_harm, judgedunits, metrics
from thermocomp.judging.guards import Guard
from thermocomp.judging.probing import Probings
from thermocomp.judging.replay import replay_compensated
from thermocomp.judging.results import Assessment, Rules
from thermocomp.judging.robustness import stress
from thermocomp.judging.splits import MIN_ROWS, Judging, Split, join_short_cycles, name_cycles
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.recordings.samples import Samples


def drop_unreadable(samples: Samples, target: int, judging: Judging) -> Judging:
    """Return a judging scheme without the blocks in which a target has too few values for a result."""
    known = np.isfinite(samples.deviations[:, target])
    kept = tuple(s for s in judging.splits if np.count_nonzero(s.judge & known) >= MIN_ROWS)
    return replace(judging, splits=kept) if kept else judging


def judge(
    name: str,
    model: ErrorModel,
    samples: Samples,
    split: Split,
    *,
    learned: Learned | None = None,
    rules: Rules = Rules(),
    fit_s: float = 0.0,
    robustness: bool = True,
    limits: Limits | None = Limits(),
    guard: Guard | None = None,
    probings: Probings | None = None,
    widening: FloatArray | None = None,
    watched: Collection[str] = (),
) -> Assessment:
    """Judge a frozen model on a block by the residual of a compensator that runs it.

    The verdict is based, in each judged part, on the worse of the compensator and the model alone: no model is
    accepted merely because limits clip its output.

    Parameters
    ----------
    learned : Learned, optional
        Reference for the model. Default: its own training statistics.
    fit_s : float
        Duration of the fit [s].
    limits : Limits or None
        Limits of the compensator; None: the model alone is judged.
    guard : Guard, optional
        Readings that a watch, trained without the block, passes on while sensors fail. Default: failures go undetected.
    widening : ndarray of shape (n_rows,), optional
        See `replay_compensated`.
    """
    target = [c.name for c in samples.targets].index(model.target)
    rows, piece = split.judge & np.isfinite(samples.deviations[:, target]), (target, name, split)
    if not rows.any():
        return refuse_method(samples, piece, f"{model.target} has no measured value in {split.block}")
    measured = samples.deviations[rows, target]
    if learned is None and model.provenance is not None:
        learned = model.provenance.learned
    ran = replay_compensated(model, samples, rows, limits or Limits(), probings, widening)
    stressed = stress(model, samples, measured, rows, guard=guard) if robustness else None
    predicted = ran.deviation if limits is None else ran.compensated
    if not np.isfinite(metrics.rms(measured, ran.deviation)):
        return refuse_method(samples, piece, f"the residual of {model.target} is not finite")
    return Assessment(
        model=name,
        target=model.target,
        block=split.block,
        measured=measured,
        predicted=predicted,
        row=samples.row[rows],
        test=samples.test[rows],
        cycle=samples.cycle[rows],
        verdict=_verdict(model, samples, split, learned, rules, rows, measured, (predicted, ran.deviation), watched),
        sensors=model.sensors,
        n_sensors=(len(model.sensors), len(model.sensors)),
        fit_s=fit_s,
        n_effective=effective_sample_size(measured - predicted),
        robustness=stressed.robustness if stressed else None,
        frozen=model,
        alone=ran.deviation,
        limits=None if limits is None else ran.limits,
        rejected=0 if limits is None else int(ran.rejected.sum()),
        turned_away="" if limits is None else ran.why,
        half_widths=None if model.band is None else ran.half_width,
        band=model.band.words if model.band is not None and np.isfinite(ran.half_width).any() else "",
        probed=ran.probed,
    )


def _verdict(
    model: ErrorModel,
    samples: Samples,
    split: Split,
    learned: Learned | None,
    rules: Rules,
    rows: BoolArray,
    measured: FloatArray,
    both: tuple[FloatArray, FloatArray],
    watched: Collection[str],
) -> do_no_harm.Verdict:
    """Return the verdict on `rows`, in each judged part on the worse of the compensator and the model alone."""
    target = [c.name for c in samples.targets].index(model.target)
    segments = [(split.name, rows[rows])] if split.whole else list(_segments(samples, rows))
    against, (run, alone) = learned or samples.learned(target, rows), both
    return do_no_harm.Verdict(
        units=tuple(
            judgedunits.measure(
                unit,
                measured[mine],
                run[mine],
                against,
                alone=alone[mine],
                unit=model.unit,
                margin=rules.margin,
                stretch=split.stretch,
                series=_place(samples, np.flatnonzero(rows)[mine]),
            )
            for unit, mine in segments
            if mine.sum() >= MIN_ROWS
        ),
        unit=model.unit,
        caps=_caps(split, learned, samples, target, watched),
        refusal="" if model.sensors else Message("a model without a sensor is a constant, not a compensation"),
        stated=rules.margin,
    )


def _place(samples: Samples, rows: IntArray) -> tuple[str, FloatArray]:
    """Return the recording of a cycle, day or file (see `Samples.begin`), and the time of its rows since its start [s].

    The files of a day follow each other by their time stamps.
    """
    tests = np.unique(samples.test[rows])
    record, begin = samples.begin(int(tests[0]))
    if len(tests) == 1:
        return record, begin + samples.time[rows]
    clock = samples.clock()[rows]
    return record, begin + samples.time[rows[0]] + (clock - clock[0]).astype(np.float64)


def _caps(
    split: Split, learned: Learned | None, samples: Samples, target: int, watched: Collection[str]
) -> tuple[str, ...]:
    """Return the reasons that prevent acceptance of a model, whatever its errors.

    Faults of monitored temperatures (`watched`) do not count: the model is judged with the replacement values.
    """
    others = {c.name for k, c in enumerate(samples.targets) if k != target} | set(watched)
    found = [text for channel, text in samples.trouble if channel not in others]
    if split.stretch:
        found.append(Message("judged on one section that continues the training data"))
    if learned is None:
        found.append(
            Message(
                "the model does not contain the mean and last value of the training data, so it cannot be compared "
                "with these constants"
            )
        )
    return tuple(found)


def refuse_method(samples: Samples, piece: tuple[int, str, Split], why: str) -> Assessment:
    """Return the assessment of a method without a prediction: refused."""
    target, name, split = piece
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
        verdict=do_no_harm.Verdict((), refusal=why),
        failure=why,
    )


def _segments(samples: Samples, rows: BoolArray) -> Iterator[tuple[str, BoolArray]]:
    cycle = samples.cycle[rows]
    for block in join_short_cycles(cycle, samples.test[rows]):
        mine, name = np.isin(cycle, block), name_cycles(samples, block)
        whole = mine.sum() == np.isin(samples.cycle, block).sum()
        yield name if whole else f"part of {name}", mine
