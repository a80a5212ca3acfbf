"""Content of the report of a comparison, as plain numbers and text for the template."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from thermocomp.core.messages import Message, join
from thermocomp.core.validity import Validity
from thermocomp.judging import coverage, do_no_harm
from thermocomp.judging.choice import Table
from thermocomp.judging.inuse import WEIGHTS
from thermocomp.judging.metrics import METRICS
from thermocomp.judging.refit import describe_method, fit_whole
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.robustness import Robustness
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.report import declared, records
from thermocomp.report.running import describe_running

#: ratio of the RMS of rows unlike the training to that of all rows above which they are a caution
WORSE = 1.25
#: metrics of the main table, in order
SHOWN = ("mae", "rms", "max_abs", "peak_to_peak", "reduction")


def summarise(
    comparison: Comparison, recordings: Sequence[Recording], samples: Samples | None = None
) -> dict[str, Any]:
    """Return the content of the report as text and numbers.

    Parameters
    ----------
    samples : Samples, optional
        All rows of the comparison: the best method is fitted to them for its formula, as ``thermocomp fit`` does.
        Default: none, the formula is that of one fold, and is marked accordingly.
    """
    targets = list(dict.fromkeys(a.target for a in comparison.assessments))
    return {
        "judging": comparison.judging.name,
        "headers": declared.header_lines(recordings),
        "verdict": verdict(comparison),
        "covered": None
        if samples is None
        else _covered(coverage.find_validity(samples, comparison.judging, recordings)),
        "cautions": cautions(comparison),
        "running": describe_running(comparison.overall()),
        "starts": [start.told(name) for name, start in comparison.starts],
        "usable": [t for t in targets if comparison.best(t) is not None],
        "targets": [_target(comparison, t, samples) for t in targets],
        "recordings": [_recording(r) for r in recordings],
        "models": [{"name": m, "summary": describe_method(m)} for m in _models(comparison)],
        "metrics": [METRICS[name] for name in SHOWN],
        "condition_number": comparison.collinearity.condition_number,
        "vif": sorted(
            zip(comparison.collinearity.names, comparison.collinearity.vif, strict=True), key=lambda v: -v[1]
        ),
    }


def verdict(comparison: Comparison) -> str:
    """Return the verdict of a comparison in one sentence."""
    targets = list(dict.fromkeys(a.target for a in comparison.assessments))
    best = {t: comparison.best(t) for t in targets}
    usable = {t: a for t, a in best.items() if a is not None}
    left = [t for t in targets if t not in usable]
    if not usable:
        untried = any(do_no_harm.UNTRIED in a.verdict.caps for a in comparison.overall())
        why = do_no_harm.UNTRIED if untried else Message("none was accepted on unseen cycles")
        return Message("No model may run yet for {targets}: {reason}.", targets=_list(targets), reason=why)
    by_model: dict[str, list[str]] = {}
    for t, a in usable.items():
        by_model.setdefault(a.model, []).append(t)
    uses = [Message("{model} for {targets}", model=m, targets=_list(t)) for m, t in by_model.items()]
    limited = [t for t, a in usable.items() if a.word == "accepted for this duty"]
    return Message(
        "Use {uses}: on unseen data, the RMS falls from {without} to {with_} um{duty}{left}.",
        uses=join(uses, "; "),
        without=_span([a.none_metric("rms") for a in usable.values()]),
        with_=_span([a.metric("rms") for a in usable.values()]),
        duty=Message("; for this duty only ({targets}): the drift was much the same each time", targets=_list(limited))
        if limited
        else "",
        left=Message("; no model passed for {targets}", targets=_list(left)) if left else "",
    )


def describe_choice(comparison: Comparison, target: str) -> str:
    """Return the numbers behind the recommended method of a target, or which one is written if none is accepted."""
    best, chosen = comparison.best(target), comparison.written(target)
    if chosen is None:
        return Message("no method can be written")
    e, other = comparison.in_use(chosen), comparison.next_best(target)
    text = Message(
        "error in use {rms:.2f} um (root mean square, weights {weights}, of {clean:.2f} with clean readings, "
        "{noisy:.2f} with noise of {noise:.2g} degC, {known}, and {lost:.2f} with one sensor lost)",
        rms=e.rms,
        weights=":".join(f"{w:g}" for w in WEIGHTS),
        clean=e.clean,
        noisy=e.noisy,
        noise=comparison.noise,
        known=Message("stated" if comparison.stated else "estimated"),
        lost=e.lost,
    )
    if best is None:
        none = Message("none is accepted; fit writes {model}, {word}: ", model=chosen.model, word=Message(chosen.word))
        return join([none, text])
    if other is None:
        alone = sum(a.target == target for a in comparison.overall()) == 1
        return text if alone else join([text, Message("; no other method is accepted")])
    further = comparison.in_use(other).rms
    tie = [Message(", a tie: fewer sensors or coefficients")] if further < e.rms else []
    return join([text, Message("; {model} {rms:.2f} um", model=other.model, rms=further), *tie])


def cautions(comparison: Comparison) -> list[str]:
    """Return cautions not contained in the verdict: noise, disturbed readings, readings outside the training range."""
    best = [a for t in dict.fromkeys(a.target for a in comparison.assessments) if (a := comparison.best(t)) is not None]
    known = [(a, a.robustness) for a in best if a.robustness is not None]
    found = list[str]()
    if comparison.left:
        found.append(
            Message(
                "the comparison was stopped: {n} combinations of method and target were not judged.", n=comparison.left
            )
        )
    for why in dict.fromkeys(comparison.unwatched.values()):
        blocks = _list([block for block, of in comparison.unwatched.items() if of == why])
        found.append(
            Message(
                "no watch could be trained without {blocks}, so lost sensors are judged there as undetected: {why}",
                blocks=blocks,
                why=why,
            )
        )
    loud = [(a, r.noisy_rms) for a, r in known]
    loud = [(a, noisy) for a, noisy in loud if 2 * a.metric("rms") < noisy <= a.none_metric("rms")]
    if loud:
        text = _list(
            [
                Message("{target} from {low:.1f} to {high:.1f}", target=a.target, low=a.metric("rms"), high=noisy)
                for a, noisy in loud
            ]
        )
        found.append(
            Message(
                "noise of {noise:g} degC on every temperature raises the RMS [um]: {of}.",
                noise=known[0][1].noise,
                of=text,
            )
        )
    found += harms(comparison)
    beyond = [f"{a.target} ({100 * r.outside:.0f} %)" for a, r in known if r.outside > 0.1]
    if beyond:
        found.append(Message("many rows are outside the trained range of the models: {of}.", of=_list(beyond)))
    # no caution if the error there is as elsewhere: such rows were judged in left-out cycles
    found += [
        Message("{target}: {what}.", target=a.target, what=describe_unlike(r))
        for a, r in known
        if r.unlike > 0.1 and r.unlike_rms > WORSE * a.metric("rms")
    ]
    return found


def harms(comparison: Comparison) -> list[str]:
    """Return usable models that disturbed readings make worse than no compensation, but within the margin.

    Beyond the margin a model is unproven, with this as its reason.
    """
    best = [comparison.best(target) for target in dict.fromkeys(a.target for a in comparison.assessments)]
    return [
        Message("{model} for {target} is {harm}.", model=a.model, target=a.target, harm=a.robustness.harm)
        for a in best
        if a is not None and a.robustness is not None and a.robustness.harm
    ]


def describe_unlike(r: Robustness) -> str:
    """Return the fraction of rows outside the joint support and the error there, as text."""
    return Message(
        "{share:.0f} % of the rows are unlike the training data (in the combination of inputs, or by a speed between "
        "trained speeds); the RMS there is {rms:.2f} um",
        share=100 * r.unlike,
        rms=r.unlike_rms,
    )


def _covered(judged: Validity) -> Table:
    table = coverage.table({Message("judged"): judged})
    for_these = Message("The errors above apply to these conditions; no other conditions were judged.")
    return replace(table, caption=join([table.caption, for_these], " "))


def _models(comparison: Comparison) -> list[str]:
    return list(dict.fromkeys(a.model for a in comparison.assessments))


def _target(comparison: Comparison, target: str, samples: Samples | None) -> dict[str, Any]:
    overall = [a for a in comparison.overall() if a.target == target]
    none = overall[0]
    best = comparison.best(target)
    measured = best or next((a for a in overall if a.uncertainty is not None), none)
    cycles = [u.name for u in max((a.verdict.units for a in overall), key=len)]
    return {
        "name": target,
        "none": {m: none.none_metric(m) for m in SHOWN if m != "reduction"},
        "uncertainty": measured.uncertainty,
        "budget": declared.budget(measured),
        "rows": overall,
        "cycles": cycles,
        "per_cycle": [
            {"model": a.model, "cells": [{u.name: u for u in a.verdict.units}.get(name) for name in cycles]}
            for a in overall
        ],
        "banded": any(a.band for a in overall),
        "best": best.model if best else None,
        "choice": "" if samples is None else describe_choice(comparison, target),
        "formula": _formula(comparison, best, samples),
    }


def _formula(comparison: Comparison, best: Assessment | None, samples: Samples | None) -> dict[str, Any] | None:
    if best is None:
        return None
    if samples is not None:
        k = [c.name for c in samples.targets].index(best.target)
        model = fit_whole(best.model, samples, k)
    else:
        folds = [
            a.frozen
            for a in comparison.assessments
            if a.target == best.target and a.model == best.model and a.frozen is not None
        ]
        model = folds[-1]
    learned = model.provenance.cycles if model.provenance else ()
    return {
        "text": model.formula(),
        "model": model,
        "band": "" if model.band is None else model.band.tell(model.unit),
        "family": model.family,
        "support": model.support,
        "inputs": model.inputs,
        "of": Message("fitted to all rows, as thermocomp fit does for the model file")
        if samples is not None
        else Message(
            "of one fold only, trained on {cycles}; thermocomp fit fits it to all rows", cycles=", ".join(learned)
        ),
    }


def _recording(r: Recording) -> dict[str, Any]:
    return {
        **records.recording(r, check(r)),
        "file": r.source.replace("\\", "/").rsplit("/", 1)[-1] or r.name,
        "sha256": r.sha256,
        "start": r.start,
        "temperatures": len(r.temperatures),
        "displacements": [c.name for c in r.displacements],
        "cycle_hours": [(r.time[c.stop - 1] - r.time[c.start]) / 3600 for c in r.cycles],
    }


def _list(names: Sequence[str]) -> str:
    if len(names) == 1:
        return names[0]
    return Message("{names} and {last}", names=join(names[:-1], ", "), last=names[-1])


def _span(values: Sequence[float]) -> Message:
    low, high = min(values), max(values)
    same = f"{low:.1f}" == f"{high:.1f}"
    return Message("{low:.1f}" if same else "{low:.1f}-{high:.1f}", low=low, high=high)
