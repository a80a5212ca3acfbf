"""Selection of sensors by each method, in a common form: the sensors, the reason, and the underlying tables."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import groupby

import numpy as np
from joblib import effective_n_jobs

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.judging import budget, maximal, pareto
from thermocomp.judging.candidates import Candidates
from thermocomp.judging.choice import Cell, Choice, Progress, Settings, Table
from thermocomp.judging.leaks import refuse_leaks
from thermocomp.judging.pieces import elsewhere, explain
from thermocomp.judging.splits import Judging
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.numerics.leastsquares import join_columns, triangle
from thermocomp.models.numerics.stepwise import StepwiseStep
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.selection import grouping
from thermocomp.models.selection.collinearity import screen
from thermocomp.models.subsets import BestSubset
from thermocomp.recordings.samples import Samples

#: methods whose tasks can be shared among the workers of a cluster
SHARED = ("pareto", "ace")


def n_pieces(method: str, samples: Samples, judging: Judging, settings: Settings) -> int:
    """Return the maximum number of tasks of `select`."""
    if method == "pareto":
        return budget.n_pieces(samples, judging, settings.models, settings.most("pareto"))
    if method == "ace":
        return len(samples.targets) * len(samples.cycle_names)
    return 1 if method == "correlation" else len(samples.targets)


def select(
    method: str,
    samples: Samples,
    judging: Judging,
    settings: Settings,
    *,
    jobs: int = 1,
    progress: Progress = lambda _, steps=1: None,  # noqa: ARG005
) -> tuple[Choice, ...]:
    """Select sensors for every target by one of the selection methods."""
    if elsewhere.get() is not None and method not in SHARED:
        raise InputError(f"{method} does not support a scheduler (only {' and '.join(SHARED)} do); omit the scheduler")
    if method == "pareto":
        refuse_leaks(samples, judging)
    if method == "ace":
        return (maximal.choose(samples, settings, jobs=jobs, progress=progress),)
    if method == "correlation":
        screened = _by_correlation(samples, settings)
        progress(f"{screened.target}: chosen")
        return (screened,)
    choosers: dict[str, Callable[[Candidates], Choice]] = {
        "grouping": lambda c: _by_grouping(c, settings),
        "subsets": lambda c: _by_subsets(c, settings, jobs=jobs, progress=progress),
        "partial-f": lambda c: _by_steps(c, "partial-f"),
        "stepwise": lambda c: _by_steps(c, "stepwise"),
    }
    found: list[Choice] = []
    errors: list[Exception] = []
    together: list[int] = []
    for k, target in enumerate(samples.targets):
        try:
            candidates = Candidates.of(samples, k)
            if method == "pareto":
                budget.judged_blocks(samples, k, judging)
                together.append(k)
            else:
                found.append(choosers[method](candidates))
                progress(f"{target.name}: chosen")
        except Exception as e:  # noqa: BLE001 - whatever fails for one target, the other targets keep their choice
            errors.append(e)
            why = explain(e)
            found.append(
                Choice(
                    method=method,
                    target=target.name,
                    sensors=(),
                    reason=f"no sensors could be selected: {why}",
                    tables=(),
                    failure=why,
                )
            )
    if together:
        few = tuple(samples.targets[k] for k in together)
        samples = replace(samples, targets=few, deviations=samples.deviations[:, together])
        found.append(pareto.choose(samples, judging, settings, jobs=jobs, progress=progress))
    if len(errors) == len(found):
        raise errors[0]
    return tuple(found)


def _by_correlation(samples: Samples, settings: Settings) -> Choice:
    """Screen by correlation with all targets together, and among the temperatures (C-11)."""
    temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    names, targets = [samples.inputs[j].name for j in temperatures], [t.name for t in samples.targets]
    rows = samples.valid & np.isfinite(samples.deviations).all(axis=1)
    if not temperatures or rows.sum() < 3:
        raise FitError("screening needs at least one temperature and 3 complete rows")
    found = screen(samples.change()[rows][:, temperatures], samples.deviations[rows], settings.most("correlation"))
    if not found.kept:
        raise FitError(
            f"no temperature varies together with {' or '.join(targets)}; use recordings in which they change"
        )
    still = [t for t, r in zip(targets, found.relevance.T, strict=True) if np.isnan(r).all()]
    shown: list[tuple[Cell, ...]] = []
    for place, j in enumerate(found.order, start=1):
        near = found.nearest(j)
        alike = ("", None) if near is None else (names[near], float(found.likeness[near, j]))
        kept = place if place <= len(found.kept) else None
        shown.append((kept, names[j], *found.relevance[j].tolist(), *alike))
    table = Table(
        title="Correlation with the targets, and with the most similar sensor kept before",
        columns=("kept", "sensor", *(f"r {t}" for t in targets), "most similar", "r"),
        rows=tuple(shown),
        caption="Each step keeps the sensor with the largest product of the share of a target that it explains and the "
        "share of its own variance that the sensors kept before do not: r^2 (1 - r^2).",
    )
    return Choice(
        method="correlation",
        target=", ".join(targets),
        sensors=tuple(names[j] for j in found.kept),
        reason=f"{len(found.kept)} of {len(names)} temperatures that are correlated with a target and differ from each "
        "other",
        tables=(table,),
        notes=(
            "A first screening: correlation is no error on unseen cycles. Choose among these sensors by another "
            "method, with --inputs.",
            *(f"{t} is constant: it was not considered." for t in still),
        ),
        details=found,
    )


def _by_grouping(candidates: Candidates, settings: Settings) -> Choice:
    """Select by correlation grouping and successive regression (H-01 to H-06)."""
    found = CorrelationGrouping(
        threshold=settings.threshold, absolute=settings.unsigned, reference=settings.reference
    ).fit(candidates.X, candidates.y)
    taking = {features: k in found.participating_ for k, features in enumerate(found.groups_)}
    own = [next(i for i in g if i in found.representatives_) for g in found.groups_]
    groups = Table(
        f"Groups with a correlation above {settings.threshold:g}",
        ("group", "sensors", "representative", "used"),
        tuple(
            (k, " ".join(candidates.called(g)), candidates.names[r], "yes" if taking[g] else "")
            for k, (g, r) in enumerate(zip(found.groups_, own, strict=True), start=1)
        ),
    )
    curve = Table(
        title="Best subset of the representatives",
        columns=("number", "MSE_p [um^2]", "sensors"),
        rows=tuple((len(s.columns), s.mse, " ".join(candidates.called(s.columns))) for s in found.curve_),
        marked=int(np.argmin([s.mse for s in found.curve_])),
        caption=f"{found.searched_[0]} subsets of representatives, then {found.searched_[1]} combinations of members.",
    )
    sensors = candidates.called(found.selected_)
    needed = (*sensors, *((settings.reference,) if settings.reference else ()))
    return Choice(
        method="grouping",
        target=candidates.target,
        sensors=needed,
        reason=f"smallest residual mean square, {found.mse_:.4g} um^2, "
        f"among the members of {len(found.participating_)} of {len(found.groups_)} groups",
        tables=(groups, curve, candidates.repeats(sensors), _other_thresholds(candidates, found, settings)),
        notes=_dependence(found.n_effective_, len(candidates.y)),
        details=found,
    )


def _other_thresholds(candidates: Candidates, found: CorrelationGrouping, settings: Settings) -> Table:
    X = candidates.X.to_numpy()
    zero = candidates.names.index(settings.reference) if settings.reference is not None else None
    values = X if zero is None else X - X[:, [zero]]
    kept = list(found.candidates_)
    tri = triangle(join_columns(values[:, kept], candidates.y), intercept=True)
    swept = grouping.sweep(X[:, kept], tri, absolute=settings.unsigned)
    # thresholds that change the groups but not the sensors chosen are merged into one row
    alike = [
        list(part)
        for _, part in groupby(swept, lambda s: (len(s.interval.groups), s.choice.selected if s.choice else s.failure))
    ]
    return Table(
        "Results with other thresholds",
        ("from", "to below", "groups", "sensors", "MSE_p [um^2]", "sum 1/eigenvalue [1/degC^2]"),
        tuple(
            (
                part[0].interval.low,
                part[-1].interval.high,
                len(part[0].interval.groups),
                " ".join(candidates.called([kept[k] for k in part[0].choice.selected]))
                if part[0].choice
                else part[0].failure,
                part[0].choice.members.best.mse if part[0].choice else None,
                part[0].spectrum.sum_inverse if part[0].spectrum else None,
            )
            for part in alike
        ),
        next(
            (k for k, part in enumerate(alike) if part[0].interval.low <= settings.threshold < part[-1].interval.high),
            None,
        ),
    )


def _by_steps(candidates: Candidates, method: str) -> Choice:
    """Select by stepwise regression: ``partial-f`` (T-02 to T-06) or ``stepwise``, Chen's second-order one (C-15)."""
    estimator: PartialF | SecondOrderRegression = PartialF() if method == "partial-f" else SecondOrderRegression()
    found = estimator.fit(candidates.X, candidates.y)
    log: tuple[StepwiseStep, ...] = found.log_
    steps = Table(
        "Steps",
        ("step", "action", "term", "partial F", "R2", "gain in R2"),
        tuple((s.number, s.action, s.term, s.f, s.r_squared, s.r_squared_step) for s in log),
    )
    sensors = found.freeze(target=candidates.target).sensors
    rule = (
        "F 100 to enter, 50 to delete" if method == "partial-f" else "alpha .001 to enter, .015 to remove, second order"
    )
    return Choice(
        method=method,
        target=candidates.target,
        sensors=sensors,
        reason=f"{len(found.terms_)} terms by partial F ({rule}), R2 {found.r_squared_:.4f} {found.r_squared_kind_}",
        tables=(steps, candidates.repeats(sensors)),
        notes=_dependence(found.n_effective_, len(candidates.y)),
        details=found,
    )


def _by_subsets(candidates: Candidates, settings: Settings, *, jobs: int, progress: Progress) -> Choice:
    """Find the exact best subset of every size (H-05), and choose a size."""
    most = min(settings.most("subsets"), len(candidates.names))
    found = BestSubset(
        criterion=settings.criterion,
        max_size=most,
        jobs=effective_n_jobs(jobs),
        seconds=settings.seconds,
        progress=partial(progress, steps=0),
    )
    found.fit(candidates.X, candidates.y, cycle=candidates.cycle)
    headings = {
        "mse": "MSE_p [um^2]",
        "adjr2": "adjusted R2",
        "cp": "Cp",
        "bic": "BIC",
        "cycles": "RMS on left-out cycles [um]",
    }
    shown = [k for k in headings if k in found.scores_]
    best = found.subsets_.best
    table = Table(
        title="Best subset of every size",
        columns=("sensors", *(headings[k] for k in shown), "certificate", "selected"),
        rows=tuple(
            (
                len(s.columns),
                *(float(found.scores_[k][row]) for k in shown),
                "proven" if s.proven else "not proven",
                " ".join(candidates.called(s.columns)),
            )
            for row, s in enumerate(best)
        ),
        marked=next((row for row, s in enumerate(best) if s.columns == found.selected_), None),
        caption=f"{found.subsets_.nodes} of {found.subsets_.possible:.3g} sets were examined"
        + ("; the others cannot be better." if found.subsets_.proven else "."),
    )
    notes = _dependence(found.n_effective_, len(candidates.y))
    if found.subsets_.stopped:
        notes = (
            f"The search was stopped ({found.subsets_.stopped}): sets that are not proven may not be the best.",
            *notes,
        )
    if found.subsets_.left_out:
        left = ", ".join(candidates.called(found.subsets_.left_out))
        notes = (f"Not used: {left} (constant, or a copy of another sensor).", *notes)
    sensors = candidates.called(found.selected_)
    what = found.chosen_by_ or headings[found.criterion_]
    return Choice(
        method="subsets",
        target=candidates.target,
        sensors=sensors,
        reason=f"best {len(sensors)} of {len(candidates.names)} temperatures, "
        f"{'proven' if found.proven_ else 'not proven'}; number of sensors by {what}",
        tables=(table, candidates.repeats(sensors)),
        notes=notes,
        details=found,
    )


def _dependence(effective: float, rows: int) -> tuple[str, ...]:
    return (
        f"The effective sample size of the {rows} rows of this time series is about {effective:.0f}: criteria that "
        "treat rows as independent select too many sensors. See --method pareto for the error on unseen cycles.",
    )
