"""Judge models of position-dependent errors: whole profiles, in thermal cycles that were not learned from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.assessment import harm, metrics
from thermocomp.assessment.replay import replay
from thermocomp.assessment.splits import Judging, Split, leave_one_cycle_out
from thermocomp.core.exceptions import FitError
from thermocomp.core.model import HonestError
from thermocomp.models.position import PositionFit, PositionOptions, fit_position, slope_samples
from thermocomp.recording.profiles import Profiles
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: fewer profiles of a cycle than this say nothing about it; each has many points, and they are far apart in time
MIN_STATES = 8


@dataclass(frozen=True)
class CycleErrors:
    """Errors of the profiles of one thermal cycle.

    Parameters
    ----------
    cycle : str
    n_states : int
        Profiles that were judged.
    none, geometric, model : float
        RMS over their points [unit]: without compensation, with the cold profile alone, with the whole model.
    none_max, model_max : float
        Largest error [unit].
    """

    cycle: str
    n_states: int
    none: float
    geometric: float
    model: float
    none_max: float
    model_max: float


@dataclass(frozen=True, eq=False)
class PositionAssessment:
    """How a position model does on cycles that it has not seen.

    Parameters
    ----------
    protocol : str
        How they were chosen.
    cycles : tuple of CycleErrors
    overall : CycleErrors
        Of all of them together.
    harmless, useful : Verdict
        The do-no-harm gate: beside no compensation, and beside the cold profile alone, which tells whether the thermal
        part is of use.
    factors : tuple of HonestError
        Of each factor's model on the same states [unit/m^i]; verdict and reason are those of the whole.
    unit : {'um', 'urad'}
    """

    protocol: str
    cycles: tuple[CycleErrors, ...]
    overall: CycleErrors
    harmless: harm.Verdict
    useful: harm.Verdict
    factors: tuple[HonestError, ...]
    unit: str

    @property
    def accepted(self) -> bool:
        """True if the model is surely better than none, and than its cold profile alone, in every cycle."""
        return self.harmless.accepted and self.useful.accepted

    @property
    def reason(self) -> str:
        """Why it is accepted or refused."""
        return _reason(self.harmless, self.useful)


@dataclass(frozen=True, eq=False)
class PositionStudy:
    """A position model fitted to everything, with its error on what it had not seen.

    Parameters
    ----------
    fit : PositionFit
        The models of its factors carry the honest error.
    assessment : PositionAssessment
    """

    fit: PositionFit
    assessment: PositionAssessment


def study(
    profiles: Profiles | Sequence[Profiles],
    options: PositionOptions = PositionOptions(),  # noqa: B008 - frozen
    *,
    judging: Callable[[Samples], Judging] = leave_one_cycle_out,
    progress: Callable[[str], None] = lambda _: None,
) -> PositionStudy:
    """Judge how a position-dependent error is modelled on unseen cycles, then fit it to everything.

    In each split everything is learned anew: cold profile, its order, slopes. The cold profile of a test of which only
    a part is left out is its zero: it is used, and not judged. A left-out test is judged by the cold profiles of the
    others.

    Parameters
    ----------
    profiles : Profiles or sequence of Profiles
        Of one component, one per test.
    options : PositionOptions
    judging : callable
        Makes splits of the states, such as those of `thermocomp.assessment.splits`.
    progress : callable
        Called with a line of text after each fit.

    Returns
    -------
    PositionStudy

    Raises
    ------
    InputError
        There is nothing to leave out, or an option cannot be.
    FitError
        It cannot be fitted, to all states or to those of a split, or nothing is left to judge on.
    """
    tests = (profiles,) if isinstance(profiles, Profiles) else tuple(profiles)
    samples, _ = slope_samples(tests, options)
    chosen = judging(samples)
    parts = []
    for split in chosen.splits:
        parts.append(_judged(tests, options, split))
        progress(f"{tests[0].target} {split.block}")
    fit = fit_position(tests, options)
    progress(f"{tests[0].target} all states")
    assessment = _together(chosen.name, parts, samples, tests)
    honest = assessment.factors
    trained = tuple(
        replace(t, model=replace(t.model, honest_error=h)) for t, h in zip(fit.trained, honest, strict=True)
    )
    models = [t.model for t in trained]
    model = replace(
        fit.model, offset=models[0] if options.offset else None, slopes=tuple(models[1:] if options.offset else models)
    )
    return PositionStudy(replace(fit, model=model, trained=trained), assessment)


@dataclass(frozen=True, eq=False)
class _Part:
    """What was judged in one split: errors of all points per state, measured and predicted factors."""

    state: NDArray[np.intp]  # (n,) row of the samples
    errors: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]  # per state: none, cold profile alone, model
    measured: FloatArray  # (n, n_factors)
    predicted: FloatArray


def _judged(tests: Sequence[Profiles], options: PositionOptions, split: Split) -> _Part:
    fit = fit_position(tests, options, learn=split.learn)
    samples, model = fit.samples, fit.model
    rows = split.judge.copy()
    for k, test in enumerate(tests):
        mine = np.flatnonzero(samples.test == k)
        rows[mine[test.reference_rows(options.reference)]] &= not split.learn[mine].any()
    state = np.flatnonzero(rows)
    factors = np.stack([replay(m, samples, rows)[0] for m in model.models], axis=1)
    assert model.profile is not None
    errors = []
    for row, factor in zip(state, factors, strict=True):
        test = tests[int(samples.test[row])]
        measured = test.values[int(samples.row[row])]
        there = np.isfinite(measured)
        points, measured = test.points[there], measured[there]
        errors.append((measured, measured - model.profile.at(points), measured - model.at(points, factor)))
    return _Part(state, tuple(errors), samples.deviations[rows], factors)


def _together(protocol: str, parts: Sequence[_Part], samples: Samples, tests: Sequence[Profiles]) -> PositionAssessment:
    unit = tests[0].unit
    rows = np.concatenate([p.state for p in parts])
    triples = [e for p in parts for e in p.errors]
    filled = np.array([e[0].size > 0 for e in triples], dtype=np.bool_)
    if not filled.any():
        raise FitError(f"{tests[0].target}: no profile is left to judge on")
    rms = np.array([[_rms(e) for e in triple] for triple in triples])
    cycle = samples.cycle[rows]
    segments = [(samples.cycle_names[k], filled & (cycle == k)) for k in np.unique(cycle)]
    none, geometric, left = rms.T
    # The gate looks at residual and drift of each row; those of a profile are its RMS.
    harmless, useful = (
        harm.judge(before, before - left, segments, least=MIN_STATES, unit=unit) for before in (none, geometric)
    )
    measured = np.concatenate([p.measured for p in parts])
    predicted = np.concatenate([p.predicted for p in parts])
    verdict: Literal["accepted", "refused"] = "accepted" if harmless.accepted and useful.accepted else "refused"
    factors = []
    for j in range(measured.shape[1]):
        m, p = measured[:, j], predicted[:, j]
        there = np.isfinite(m)
        known = [(name, mine & there) for name, mine in segments if (mine & there).any()]
        m_there, p_there = m[there], p[there]
        factors.append(
            HonestError(
                protocol=protocol,
                mae=metrics.mae(m_there, p_there),
                rms=metrics.rms(m_there, p_there),
                max_abs=metrics.max_abs(m_there, p_there),
                none_mae=metrics.mae(m_there, 0 * m_there),
                none_rms=metrics.rms(m_there, 0 * m_there),
                cycles={name: metrics.rms(m[mine], p[mine]) for name, mine in known},
                verdict=verdict,
                reason=_reason(harmless, useful),
            )
        )
    return PositionAssessment(
        protocol=protocol,
        cycles=tuple(_errors(name, triples, mine) for name, mine in segments if mine.any()),
        overall=_errors("all", triples, filled),
        harmless=harmless,
        useful=useful,
        factors=tuple(factors),
        unit=unit,
    )


def _errors(name: str, triples: Sequence[tuple[FloatArray, FloatArray, FloatArray]], mine: BoolArray) -> CycleErrors:
    none, geometric, left = (
        np.concatenate([t[j] for t, wanted in zip(triples, mine, strict=True) if wanted]) for j in range(3)
    )
    return CycleErrors(
        cycle=name,
        n_states=int(mine.sum()),
        none=_rms(none),
        geometric=_rms(geometric),
        model=_rms(left),
        none_max=float(np.abs(none).max()),
        model_max=float(np.abs(left).max()),
    )


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")


def _reason(harmless: harm.Verdict, useful: harm.Verdict) -> str:
    if harmless.accepted and not useful.accepted:
        return f"beside its cold profile alone: {useful.reason.replace('without compensation', 'with that alone')}"
    return harmless.reason
