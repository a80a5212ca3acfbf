"""Whole jobs: fit one method with its honest error, judge model files on recordings."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermocomp.assessment.compare import Assessment, Comparison, compare, judge, per_cycle
from thermocomp.assessment.splits import Judging, Split
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel, HonestError, Support
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.methods import deployable, expand
from thermocomp.models.training import train
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples, stack


def _silent(_: str) -> None:
    pass


@dataclass(frozen=True)
class Fitted:
    """A method fitted to everything, with its error on what it had not seen.

    Parameters
    ----------
    models : tuple of ErrorModel
        One per target.
    estimators : tuple of ThermalRegressor
        The same before freezing.
    r_squared : tuple of float
        In-sample, about the mean: what a fit promises, not what it keeps.
    comparison : Comparison
        The method on the unseen blocks.
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
    support: Support = Support(),
    jobs: int = 1,
    progress: Callable[[str], None] = _silent,
) -> Fitted:
    """Judge a method on unseen blocks, then fit it to all rows.

    Parameters
    ----------
    samples : Samples
    method : str or estimator
        See `thermocomp.models.methods.expand`.
    judging : Judging
    support : Support
        For the models.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    progress : callable
        Called with a line of text after each piece of work: ``n_pieces`` of them and one per target.

    Returns
    -------
    Fitted

    Raises
    ------
    InputError
        The method is unknown, or cannot be frozen, so there would be no model.
    """
    (method,) = expand([method])
    if not deployable(method):
        raise InputError(f"{method} cannot be frozen to plain numbers: judge it with 'compare', fit another method")
    comparison = compare(samples, [method], judging, support=support, robustness=False, jobs=jobs, progress=progress)
    models, estimators, r_squared = [], [], []
    everything = np.ones(len(samples), dtype=np.bool_)
    for k, overall in enumerate(comparison.overall()):
        trained = train(method, samples, k, everything, support=support)
        progress(f"{overall.target} {method} all rows")
        models.append(replace(trained.model, honest_error=honest_error(overall, judging)))
        estimators.append(trained.estimator)
        r_squared.append(trained.r_squared)
    return Fitted(tuple(models), tuple(estimators), tuple(r_squared), comparison)


def honest_error(overall: Assessment, judging: Judging) -> HonestError:
    """Summarise an assessment for the model file.

    Raises
    ------
    InputError
        The method could not be fitted in one of the splits, so there is no error to state.
    """
    if overall.failure:
        raise InputError(f"{overall.target}: cannot be judged: {overall.failure}")
    return HonestError(
        protocol=judging.name,
        mae=overall.metric("mae"),
        rms=overall.metric("rms"),
        max_abs=overall.metric("max_abs"),
        none_mae=overall.none_metric("mae"),
        none_rms=overall.none_metric("rms"),
        cycles={c.cycle: c.rms for c in overall.verdict.cycles if np.isfinite(c.rms)},
        verdict="accepted" if overall.accepted else "refused",
        reason=overall.reason,
    )


@dataclass(frozen=True)
class Judged:
    """Model files judged on recordings.

    Parameters
    ----------
    models : tuple of ErrorModel
    assessments : tuple of Assessment
        Per model and cycle, and per model over all cycles.
    seen : tuple of str
        Names of recordings that a model was fitted to: no honest test.
    """

    models: tuple[ErrorModel, ...]
    assessments: tuple[Assessment, ...]
    seen: tuple[str, ...]

    def overall(self) -> tuple[Assessment, ...]:
        """Return one assessment per model, over all cycles."""
        return tuple(a for a in self.assessments if a.overall)


def assess(
    models: Sequence[ErrorModel], recordings: Sequence[Recording], *, progress: Callable[[str], None] = _silent
) -> Judged:
    """Judge frozen models on recordings: per cycle, with noise, with lost sensors, outside the trained range.

    Parameters
    ----------
    models : sequence of ErrorModel
    recordings : sequence of Recording
        With the models' inputs and targets.
    progress : callable
        Called with a line of text per model.

    Returns
    -------
    Judged

    Raises
    ------
    InputError
        A channel the models need is not in the recordings.
    """
    found: list[Assessment] = []
    hashes = {h for m in models if m.provenance for h in m.provenance.data_sha256}
    seen = tuple(r.name for r in recordings if r.fingerprint in hashes)
    caveat = f"no honest test: fitted to {', '.join(seen)}; judge it on another recording" if seen else ""
    for model in models:
        progress(f"{model.target} {model.family}")
        rezero = any(i.rezero for i in model.inputs)
        samples = stack(recordings, [model.target], [i.name for i in model.inputs], rezero=rezero)
        everything = Split("all cycles", np.zeros(len(samples), np.bool_), np.ones(len(samples), np.bool_))
        name = model.provenance.method if model.provenance else model.family
        overall = replace(judge(name, model, samples, everything), overall=True, caveat=caveat)
        cut = per_cycle(overall)
        found += [*cut, overall] if len(cut) > 1 else [overall]
    return Judged(tuple(models), tuple(found), seen)
