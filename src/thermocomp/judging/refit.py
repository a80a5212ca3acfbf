"""Model written to the file: a method fitted to all rows, tested with noise and lost sensors.

It was trained on more data than the judged models, and may depend more on a single sensor than they do.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from thermocomp.core.inputs import Support
from thermocomp.core.messages import Message
from thermocomp.core.model import ErrorModel
from thermocomp.judging.guards import Guard, find_guard
from thermocomp.judging.pieces import work_through
from thermocomp.judging.results import Assessment
from thermocomp.judging.robustness import stress, worse
from thermocomp.models.methods import METHODS
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples


def stress_written(judged: Assessment, model: ErrorModel, samples: Samples, guard: Guard | None = None) -> Assessment:
    """Return an assessment with the robustness of the model in the model file, where that is worse."""
    if judged.robustness is None:
        return judged
    k = [t.name for t in samples.targets].index(model.target)
    rows = samples.valid & np.isfinite(samples.deviations[:, k])
    own = stress(model, samples, samples.deviations[rows, k], rows, guard=guard).robustness
    return replace(judged, robustness=worse(judged.robustness, own))


def support_of(judged: Assessment, support: Support) -> Support:
    """Return the support of the model written to the file: outside of a duty that alone is proved, it fades."""
    limited = judged.verdict.word == "accepted for this duty" and support.policy == "clip"
    return replace(support, policy="fade") if limited else support


def refit_accepted(
    judged: Sequence[Assessment], samples: Samples, support: Support, *, watch: bool, jobs: int
) -> list[Assessment]:
    """Fit accepted methods to all rows, as in `thermocomp.judging.study.fit`, and test their robustness."""
    wanted = [a for a in judged if a.overall and a.accepted and a.deployable]
    everything = np.ones(len(samples), dtype=np.bool_)
    guard = find_guard(samples, everything, everything) if watch and wanted else None
    found = work_through(partial(_refit, samples, support, guard), wanted, _not_refitted, jobs=jobs)
    tried = {(a.target, a.model): a for a in found}
    return [tried.get((a.target, a.model), a) if a.overall else a for a in judged]


def _refit(samples: Samples, support: Support, guard: Guard | None, judged: Assessment) -> Assessment:
    k = [t.name for t in samples.targets].index(judged.target)
    written = train(
        judged.model, samples, k, np.ones(len(samples), dtype=np.bool_), support=support_of(judged, support)
    )
    return stress_written(judged, written.model, samples, guard)


def _not_refitted(judged: Assessment, why: str) -> Assessment:
    return replace(
        judged, verdict=replace(judged.verdict, caps=(Message("cannot be fitted to all rows: {why}", why=why),))
    )


def fit_whole(method: str, samples: Samples, target: int) -> ErrorModel:
    """Return the frozen model of a method fitted to all rows."""
    return train(method, samples, target, np.ones(len(samples), dtype=np.bool_)).model


def describe_method(name: str) -> str:
    """Return a sentence that describes a method."""
    return Message(METHODS[name].summary if name in METHODS else "an estimator supplied by the user")
