"""Errors of position models in unseen cycles, and the verdict on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError
from thermocomp.core.learned import Learned
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.size import Size
from thermocomp.judging import do_no_harm, judgedunits, metrics
from thermocomp.judging.baselines import compare_errors
from thermocomp.judging.replay import replay
from thermocomp.judging.splits import Judging, Split
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.samples import Samples
from thermocomp.volumetric.models.position import PositionFit, slope_samples
from thermocomp.volumetric.models.positionoptions import PositionOptions, reference_position

#: minimum number of profiles to judge a cycle by; each has many points, and profiles are far apart in time
MIN_STATES = 8
#: baselines of a position model
BESIDE = ("no compensation", "the cold profile alone")


class ComponentStates(NamedTuple):
    """A component: its tests, their states, and the splits."""

    tests: tuple[Profiles, ...]
    samples: Samples
    judging: Judging


@dataclass(frozen=True)
class CycleErrors:
    """Errors of the profiles of one thermal cycle, or of a test left out as a whole.

    Parameters
    ----------
    n_states : int
        Number of judged profiles.
    none, geometric, model : float
        RMS over their points [unit]: without compensation, with the cold profile alone, with the complete model.
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
    """Result of a position model on unseen cycles.

    Parameters
    ----------
    protocol : str
        Method of choosing the unseen cycles.
    overall : CycleErrors
        Errors over all cycles together.
    verdict : Verdict
        Verdict of the do-no-harm gate: compared with no compensation and, if there is a thermal part, with the cold
        profile alone; by cycles or, if files were left out, by files.
    factors : tuple of HonestError
        Errors of the model of each factor on the same states [unit/m^i]; verdict and reason are those of the complete
        model.
    """

    protocol: str
    cycles: tuple[CycleErrors, ...]
    overall: CycleErrors
    verdict: do_no_harm.Verdict
    factors: tuple[HonestError, ...]
    unit: str

    @property
    def accepted(self) -> bool:
        """Whether the model may run."""
        return self.verdict.accepted

    @property
    def reason(self) -> str:
        """Reason for the verdict, and the additional data needed for a decision."""
        return self.verdict.told


@dataclass(frozen=True, eq=False)
class JudgedSplit:
    """Judged data of one split: errors of all points per state, and predicted thermal parts."""

    state: NDArray[np.intp]  # (n,) row of the samples
    errors: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]  # per state: no model, cold profile alone, model
    thermal: tuple[FloatArray, ...]  # per state, at all points of its test


def judge_split(tests: Sequence[Profiles], fit: PositionFit, options: PositionOptions, split: Split) -> JudgedSplit:
    """Return the errors in the judged rows of a split, except those of cold profiles that serve as zero."""
    samples, model = fit.samples, fit.model
    rows = split.judge.copy()
    for k, test in enumerate(tests):
        mine = np.flatnonzero(samples.test == k)
        rows[mine[test.reference_rows(options.reference)]] &= not split.learn[mine].any()
    state = np.flatnonzero(rows)
    factors = np.array([replay(m, samples, rows)[0] for m in model.models]).reshape(-1, len(state)).T
    assert model.profile is not None
    errors, thermal = [], []
    for row, factor in zip(state, factors, strict=True):
        test = tests[int(samples.test[row])]
        measured, profile = test.values[int(samples.row[row])], model.profile.at(test.points)
        told = model.at(test.points, factor)
        there = np.isfinite(measured)
        errors.append((measured[there], (measured - profile)[there], (measured - told)[there]))
        thermal.append(told - profile)
    return JudgedSplit(state, tuple(errors), tuple(thermal))


def _factors(
    one: ComponentStates, parts: Sequence[JudgedSplit], options: PositionOptions
) -> tuple[FloatArray, FloatArray]:
    """Return factors, measured and predicted, (n, n_factors); predictions are projected from the model output.

    A split may use other powers; its thermal part is expressed in the powers of the complete model.
    """
    samples, _ = slope_samples(one.tests, options)
    turn = reference_position(one.tests, options)
    predicted = []
    for row, thermal in ((r, t) for p in parts for r, t in zip(p.state, p.thermal, strict=True)):
        q = 1e-3 * (one.tests[int(samples.test[row])].position - turn)
        reach = float(np.abs(q).max())
        found = np.linalg.lstsq(np.stack([(q / reach) ** k for k in options.powers], axis=1), thermal)[0]
        predicted.append(found / reach ** np.array(options.powers))
    return samples.deviations[np.concatenate([p.state for p in parts])], np.array(predicted)


def assess_together(one: ComponentStates, parts: Sequence[JudgedSplit], options: PositionOptions) -> PositionAssessment:
    """Return the assessment of a component over all of its splits."""
    samples, tests, protocol = one.samples, one.tests, one.judging.name
    unit = tests[0].unit
    rows = np.concatenate([p.state for p in parts])
    triples = [e for p in parts for e in p.errors]
    filled = np.array([e[0].size > 0 for e in triples], dtype=np.bool_)
    if not filled.any():
        raise FitError(f"{tests[0].target}: no profile is left for validation")
    segments: list[tuple[str, BoolArray]] = []
    for split, part in zip(one.judging.splits, parts, strict=True):
        mine = filled & np.isin(rows, part.state)
        if split.whole:
            segments.append((split.name, mine))
        else:
            cycle = samples.cycle[rows]
            segments += [(samples.cycle_names[k], mine & (cycle == k)) for k in np.unique(cycle[mine])]
    verdict = do_no_harm.Verdict(
        units=tuple(
            _unit(
                name, [t for t, wanted in zip(triples, mine, strict=True) if wanted], unit, thermal=bool(options.powers)
            )
            for name, mine in segments
            if mine.sum() >= MIN_STATES
        ),
        unit=unit,
        given=BESIDE,
        caps=("judged on one section that continues the training data",) if one.judging.splits[0].stretch else (),
    )
    measured, predicted = _factors(one, parts, options) if options.powers else (np.empty((len(rows), 0)),) * 2
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
                verdict=verdict.word,
                reason=verdict.told,
                units=len(verdict.units),
                rules=RULES,
            )
        )
    return PositionAssessment(
        protocol=protocol,
        cycles=tuple(_errors(name, triples, mine) for name, mine in segments if mine.any()),
        overall=_errors("all", triples, filled),
        verdict=verdict,
        factors=tuple(factors),
        unit=unit,
    )


def _unit(
    name: str, errors: Sequence[tuple[FloatArray, FloatArray, FloatArray]], unit: str, *, thermal: bool
) -> judgedunits.JudgedUnit:
    """Return a cycle with the errors of its profiles: without compensation, with the cold profile alone, model."""
    rms = np.array([[Size.of(e).rms for e in triple] for triple in errors])
    points = np.array([len(triple[0]) for triple in errors])
    weights = np.repeat(np.sqrt(np.mean(points) / points), points)  # every profile counts the same
    none, geometric, left = (weights * np.concatenate(e) for e in zip(*errors, strict=True))
    largest = float(rms[:, 0].max())
    return judgedunits.JudgedUnit(
        name=name,
        rows=len(rms),
        rms=Size.of(left).rms,
        largest=float(rms[:, 2].max()),
        baselines=tuple(compare_errors(left, other, 0.0) for other in ((none, geometric) if thermal else (none,))),
        none_largest=largest,
        noise=0.0,
        margin=judgedunits.margin_of(Learned(0.0, 0.0, 0.0, largest), unit),
        moves=True,
    )


def _errors(name: str, triples: Sequence[tuple[FloatArray, FloatArray, FloatArray]], mine: BoolArray) -> CycleErrors:
    none, geometric, left = (
        Size.of(np.concatenate([t[j] for t, wanted in zip(triples, mine, strict=True) if wanted])) for j in range(3)
    )
    return CycleErrors(
        cycle=name,
        n_states=int(mine.sum()),
        none=none.rms,
        geometric=geometric.rms,
        model=left.rms,
        none_max=none.largest,
        model_max=left.largest,
    )
