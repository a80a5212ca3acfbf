"""Fitting of one method per target, with its error on unseen data."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError, accepted
from thermocomp.core.validity import Validity
from thermocomp.judging import coverage
from thermocomp.judging.compare import compare
from thermocomp.judging.guards import find_guard
from thermocomp.judging.refit import stress_written, support_of
from thermocomp.judging.results import Assessment, Comparison, Rules
from thermocomp.judging.splits import Judging
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.methods import deployable, expand
from thermocomp.models.training import Trained, train
from thermocomp.models.watching import find_watch
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
    methods: Any,
    judging: Judging,
    *,
    compared: Comparison | None = None,
    rules: Rules = Rules(),
    support: Support = Support(),
    recordings: Sequence[Recording] = (),
    limits: Limits = Limits(),
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Fitted:
    """Judge a method per target on unseen blocks, then fit it to all rows.

    Parameters
    ----------
    methods : method, or mapping of str to method
        Method for all targets, or by target.
    compared : Comparison, optional
        Targets without a method get the one that it recommends, with its results there.
    """
    names = [t.name for t in samples.targets]
    given = methods if isinstance(methods, Mapping) else dict.fromkeys(names, methods)
    given = {target: expand([method])[0] for target, method in given.items()}
    chosen = dict.fromkeys(names, "") | given
    for target in [t for t in names if t not in given]:
        if (best := compared.written(target) if compared else None) is None:
            raise InputError(f"{target}: no method could be fitted and judged that can be stored as coefficients")
        chosen[target] = best.model
    for method in given.values():
        if not deployable(method):
            raise InputError(
                f"{method} cannot be stored as coefficients: judge it with 'compare', or fit another method"
            )
    everything = np.ones(len(samples), dtype=np.bool_)
    written = [train(m, samples, k, everything, support=support, prints=True) for k, m in enumerate(chosen.values())]
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    watched = list(dict.fromkeys([*(i.name for w in written for i in w.model.inputs), *speeds]))
    parts = [compared.of({t: m for t, m in chosen.items() if t not in given})] if compared else []
    if given:
        parts += [
            compare(
                samples,
                {target: [method] for target, method in given.items()},
                judging,
                rules=replace(rules, primary=None),
                support=support,
                refit=False,
                limits=limits,
                watched=watched,
                jobs=jobs,
                progress=progress,
            )
        ]
    if any(c.left for c in parts):
        raise KeyboardInterrupt
    ordered = (a for t in names for c in parts for a in c.assessments if a.target == t)
    return _write(
        replace(parts[0], assessments=tuple(ordered)),
        samples,
        written,
        watched,
        tested={*names} - {*given},
        support=support,
        covered=coverage.find_validity(samples, judging, recordings),
        tests=tuple(t.stated() for t in dict.fromkeys(r.declared.test for r in recordings) if t.stated()),
    )


def _write(
    comparison: Comparison,
    samples: Samples,
    written: Sequence[Trained],
    watched: Sequence[str],
    *,
    tested: Collection[str],
    support: Support,
    covered: Validity | None,
    tests: tuple[dict[str, str], ...],
) -> Fitted:
    """Add to each model its error on unseen data and the watch; `tested`: targets whose methods were compared."""
    everything = np.ones(len(samples), dtype=np.bool_)
    known, names = samples.only(watched), [c.name for c in samples.inputs]
    # `compare` has tested accepted models as written, with a watch of all inputs
    done = {a.target for a in comparison.overall() if a.target in tested and a.accepted and len(watched) == len(names)}
    guard = find_guard(known, everything, everything) if len(done) < len(written) else None
    watch = guard.watch if guard else find_watch(known, everything)
    let = guard and guard.among([names.index(c.name) for c in known.inputs])
    models, tried = list[ErrorModel](), dict[str, Assessment]()
    for overall, trained in zip(comparison.overall(), written, strict=True):
        model = replace(trained.model, support=support_of(overall, support))
        tried[overall.target] = overall if overall.target in done else stress_written(overall, model, samples, let)
        honest = honest_error(tried[overall.target], comparison.judging, comparison.noise)
        made = model.provenance and replace(model.provenance, tests=tests)
        models.append(replace(model, honest_error=honest, validity=covered, watch=watch, provenance=made))
    judged = tuple(tried[a.target] if a.overall else a for a in comparison.assessments)
    return Fitted(
        tuple(models),
        tuple(w.estimator for w in written),
        tuple(w.r_squared for w in written),
        replace(comparison, assessments=judged),
    )


def honest_error(overall: Assessment, judging: Judging, noise: float = 0.0) -> HonestError:
    """Summarise an assessment for the model file; noise of the temperatures in use [degC], 0 if it is not known."""
    word, reason = overall.word, overall.reason
    if overall.failure or word == "not unseen":
        raise InputError(f"{overall.target} cannot be judged: {overall.failure or reason}")
    rms, none = overall.metric("rms"), overall.none_metric("rms")
    if accepted(word) and rms > none:  # one long cycle, within the margin, against many short ones
        word, reason = "unproven", f"{reason}; over all rows RMS {rms:.2f}, {none:.2f} without compensation"
    used = overall.in_use(noise)
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
        noise=noise,
        scatter=float(np.sqrt(max(used.noisy**2 - used.clean**2, 0.0))),
    )
