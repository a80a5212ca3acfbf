"""Fitting of one method, with its error on unseen data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError, accepted
from thermocomp.judging import coverage
from thermocomp.judging.compare import compare
from thermocomp.judging.guards import find_guard
from thermocomp.judging.refit import stress_written, support_of
from thermocomp.judging.results import Assessment, Comparison, Rules
from thermocomp.judging.splits import Judging
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.methods import deployable, expand
from thermocomp.models.training import train
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples


@dataclass(frozen=True)
class Fitted:
    """A method fitted to all rows, with its error on unseen data.

    Parameters
    ----------
    models : tuple of ErrorModel
        One per target.
    estimators : tuple of ThermalRegressor
        Estimators of the models, before freezing.
    r_squared : tuple of float
        In-sample R2, about the mean: goodness of fit, not of prediction.
    comparison : Comparison
        Results of the method on the unseen blocks.
    """

    models: tuple[ErrorModel, ...]
    estimators: tuple[ThermalRegressor, ...]
    r_squared: tuple[float, ...]
    comparison: Comparison


def fit(
    samples: Samples,
    method: Any,
    judging: Judging,
    *,
    rules: Rules = Rules(),
    support: Support = Support(),
    recordings: Sequence[Recording] = (),
    limits: Limits = Limits(),
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Fitted:
    """Judge a method on unseen blocks, then fit it to all rows."""
    (method,) = expand([method])
    if not deployable(method):
        raise InputError(f"{method} cannot be stored as coefficients: judge it with 'compare', or fit another method")
    everything = np.ones(len(samples), dtype=np.bool_)
    written = [train(method, samples, k, everything, support=support, prints=True) for k in range(len(samples.targets))]
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    watched = list(dict.fromkeys([*(i.name for w in written for i in w.model.inputs), *speeds]))
    comparison = compare(
        samples,
        [method],
        judging,
        rules=rules,
        support=support,
        refit=False,
        limits=limits,
        watched=watched,
        jobs=jobs,
        progress=progress,
    )
    known = samples.only(watched)
    names = [c.name for c in samples.inputs]
    guard = find_guard(known, everything, everything)
    let = guard and guard.among([names.index(c.name) for c in known.inputs])
    covered = coverage.find_validity(samples, judging, recordings)
    models, tried = list[ErrorModel](), dict[str, Assessment]()
    for overall, trained in zip(comparison.overall(), written, strict=True):
        progress(f"{overall.target} {method} all rows")
        model = replace(trained.model, support=support_of(overall, support))
        tried[overall.target] = stress_written(overall, model, samples, let)
        honest = honest_error(tried[overall.target], judging)
        models.append(replace(model, honest_error=honest, validity=covered, watch=guard.watch if guard else None))
    judged = tuple(tried[a.target] if a.overall else a for a in comparison.assessments)
    return Fitted(
        tuple(models),
        tuple(w.estimator for w in written),
        tuple(w.r_squared for w in written),
        replace(comparison, assessments=judged),
    )


def honest_error(overall: Assessment, judging: Judging) -> HonestError:
    """Summarise an assessment for the model file."""
    if overall.failure:
        raise InputError(f"{overall.target} cannot be judged: {overall.failure}")
    rms, none = overall.metric("rms"), overall.none_metric("rms")
    word, reason = overall.word, overall.reason
    if accepted(word) and rms > none:  # one long cycle, within the margin, against many short ones
        word, reason = "unproven", f"{reason}; over all rows RMS {rms:.2f}, {none:.2f} without compensation"
    return HonestError(
        protocol=judging.name,
        mae=overall.metric("mae"),
        rms=rms,
        max_abs=overall.metric("max_abs"),
        none_mae=overall.none_metric("mae"),
        none_rms=none,
        cycles={u.name: u.rms for u in overall.verdict.units},
        verdict=word,
        reason=reason,
        units=len(overall.verdict.units),
        tried=overall.verdict.tried,
        rules=RULES,
        harm_margin=overall.verdict.stated,
        lost={**tried.lost_rms, **tried.together_rms} if (tried := overall.robustness) else {},
    )
