"""Compare methods on unseen blocks: train, replay, judge."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.messages import Message
from thermocomp.judging import do_no_harm
from thermocomp.judging.diagnostics import Collinearity, collinearity
from thermocomp.judging.guards import Guard, find_guard
from thermocomp.judging.inuse import noise_of
from thermocomp.judging.judge import drop_unreadable, judge, refuse_method
from thermocomp.judging.leaks import refuse_leaks
from thermocomp.judging.pieces import work_through
from thermocomp.judging.recommend import Inner, Recommendation, correct_verdicts, inner_splits, recommend, score
from thermocomp.judging.refit import refit_accepted
from thermocomp.judging.results import Assessment, Comparison, Rules
from thermocomp.judging.robustness import pool_robustness
from thermocomp.judging.splits import MIN_ROWS, Judging, Split, join_short_cycles
from thermocomp.models.methods import deployable, expand
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples

#: fields of an assessment with a value for each judged row
_PER_ROW = ("measured", "predicted", "row", "test", "cycle")
#: name of the block of all unseen cycles together
ALL = "all unseen cycles"


def compare(
    samples: Samples,
    methods: Sequence[Any] | Mapping[str, Sequence[Any]],
    judging: Judging,
    *,
    rules: Rules = Rules(),
    support: Support = Support(),
    robustness: bool = True,
    refit: bool = True,
    limits: Limits | None = Limits(),
    watched: Sequence[str] | None = None,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Train every method for every target and judge it on unseen data.

    After a keyboard interrupt, the methods already judged on all blocks are returned, with the number of the others.

    Parameters
    ----------
    methods : sequence, or mapping of str to sequence
        Methods for all targets, or by target; targets that are not in a mapping are not judged.
    limits : Limits or None
        Limits of the judged compensator. None: the models alone are judged, as in papers, and their sensors are not
        monitored.
    watched : sequence of str, optional
        Inputs of the sensor watch. Default: all.
    """
    refuse_leaks(samples, judging)
    names = methods_of(samples, methods)
    rules.check([name for mine in names for name in mine])
    by_target = [drop_unreadable(samples, k, judging) for k in range(len(samples.targets))]
    pieces = [(k, name, s) for k, own in enumerate(by_target) for name in names[k] for s in own.splits]
    noise = noise_of(samples) if rules.noise is None else rules.noise
    done: list[Assessment] = []
    guards, unwatched = _guards(samples, by_target, watched, jobs) if robustness and limits is not None else ({}, {})
    work = partial(_assess_method, samples, rules, support, robustness, limits, guards)
    scores: dict[int, dict[str, list[list[float]]]] = {}
    inners = [_inners(mine, own, rules) for mine, own in zip(names, by_target, strict=True)]
    try:
        for a in work_through(work, pieces, partial(refuse_method, samples), jobs=jobs):
            progress(f"{a.target} {a.model} {a.block}")
            done.append(a)
        scores = _scores(samples, names, by_target, inners, jobs, progress)
    except KeyboardInterrupt:
        if len(done) < len(by_target[0].splits):
            raise
    found: list[Assessment] = []
    recommended: list[Recommendation] = []
    finished = 0
    for k, target in enumerate(samples.targets):
        parts = [(name, a) for (of, name, _), a in zip(pieces, done, strict=False) if of == k]
        if not (mine := _complete(parts, len(by_target[k].splits))):
            continue
        finished += len(mine)
        verdicts = {name: [a.verdict for a in p] for name, p in mine.items()}
        used = {name: [(a.in_use(noise), len(a.measured)) for a in p] for name, p in mine.items()}
        best = recommend(target.name, list(scores[k]), verdicts, used, scores[k], inners[k]) if k in scores else None
        recommended += [best] if best else []
        found += _concluded(mine, verdicts, rules, best)
    if robustness and refit:
        found = refit_accepted(found, samples, support, watch=limits is not None, jobs=jobs)
    return Comparison(
        judging,
        tuple(found),
        _heat(samples),
        left=sum(map(len, names)) - finished,
        recommended=tuple(recommended),
        starts=tuple(zip(samples.test_names, samples.starts, strict=False)),
        noise=noise,
        stated=rules.noise is not None,
        unwatched=unwatched,
    )


def _guards(
    samples: Samples, by_target: Sequence[Judging], watched: Sequence[str] | None, jobs: int
) -> tuple[dict[str, Guard | None], dict[str, str]]:
    """Return the readings that a watch passes on in each block, and why a watch could not be trained, by block.

    The watch of a block is trained on its training rows.
    """
    splits = {split.name: split for own in by_target for split in own.splits}
    known = samples if watched is None else samples.only(watched)
    work: Callable[[Split], Guard | str | None] = partial(_guard, known)
    found = dict(zip(splits, work_through(work, list(splits.values()), jobs=jobs), strict=True))
    names = [c.name for c in samples.inputs]
    place = [names.index(c.name) for c in known.inputs]
    guards = {name: g.among(place) if isinstance(g, Guard) else None for name, g in found.items()}
    return guards, {name: why for name, why in found.items() if isinstance(why, str)}


def _guard(samples: Samples, split: Split) -> Guard | None:
    return find_guard(samples, split.learn, split.judge)


def _complete(parts: Iterable[tuple[str, Assessment]], blocks: int) -> dict[str, list[Assessment]]:
    """Return the assessments by model; methods not judged on all blocks are left out."""
    found: dict[str, list[Assessment]] = {}
    for name, a in parts:
        found.setdefault(name, []).append(a)
    return {p[0].model: p for p in found.values() if len(p) == blocks}


def _concluded(
    parts: dict[str, list[Assessment]],
    verdicts: dict[str, list[do_no_harm.Verdict]],
    rules: Rules,
    best: Recommendation | None,
) -> list[Assessment]:
    """Return the results for one target: each method in each block, and over all blocks with its verdict."""
    whole = {name: do_no_harm.join_verdicts(v) for name, v in verdicts.items()}
    after = correct_verdicts(whole, rules.primary, best)
    found = []
    for name, p in parts.items():
        found += p if len(p) > 1 else []
        found.append(replace(_together(p), verdict=after[name]))
    return found


def _heat(samples: Samples) -> Collinearity:
    """Return the collinearity of the temperatures in all complete rows."""
    temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    values = samples.change()[samples.valid][:, temperatures]
    return collinearity(values, tuple(samples.inputs[j].name for j in temperatures))


def _inners(names: Sequence[str], judging: Judging, rules: Rules) -> list[Inner]:
    """Return the inner splits for recommending a method; empty with one method only, or with a primary one."""
    choices = sum(deployable(name) for name in names)
    return inner_splits(judging) if choices > 1 and rules.primary is None else []


def _scores(
    samples: Samples,
    names: Sequence[Sequence[str]],
    by_target: Sequence[Judging],
    inners: Sequence[Sequence[Inner]],
    jobs: int,
    progress: Callable[[str], None],
) -> dict[int, dict[str, list[list[float]]]]:
    """Return the RMS on each inner split, per target and eligible method."""
    kept = [[name for name in mine if deployable(name)] for mine in names]
    pieces = [(k, name, inner) for k, own in enumerate(inners) for name in kept[k] for inner in own]
    found: dict[int, dict[str, list[list[float]]]] = {
        k: {name: [] for name in kept[k]} for k, own in enumerate(inners) if own
    }
    results = work_through(partial(score, samples, by_target), pieces, _no_score, jobs=jobs)
    for (k, name, inner), values in zip(pieces, results, strict=True):
        progress(f"{samples.targets[k].name} {name} without {inner.split.block}")
        found[k][name].append(values)
    return found


def methods_of(samples: Samples, methods: Sequence[Any] | Mapping[str, Sequence[Any]]) -> list[list[str]]:
    """Return the names of the methods for each target."""
    if not isinstance(methods, Mapping):
        return [expand(methods)] * len(samples.targets)
    known = [t.name for t in samples.targets]
    if strange := [t for t in methods if t not in known]:
        raise InputError(f"a model for {strange[0]!r}, which is not a target; the targets are {', '.join(known)}")
    return [expand(methods[t]) if t in methods else [] for t in known]


def n_pieces(
    samples: Samples,
    methods: Sequence[Any] | Mapping[str, Sequence[Any]],
    judging: Judging,
    rules: Rules = Rules(),
) -> int:
    """Return the number of tasks of `compare`."""
    total = 0
    for k, names in enumerate(methods_of(samples, methods)):
        own = drop_unreadable(samples, k, judging)
        total += len(names) * len(own.splits) + sum(map(deployable, names)) * len(_inners(names, own, rules))
    return total


def split_by_cycle(whole: Assessment) -> list[Assessment]:
    """Split an assessment into its thermal cycles; results that need a separate replay are not split."""
    found = []
    blocks = [b for b in join_short_cycles(whole.cycle, whole.test) if np.isin(whole.cycle, b).sum() >= MIN_ROWS]
    for unit, block in zip(whole.verdict.units, blocks, strict=True):
        rows = np.isin(whole.cycle, block)
        cut = {name: getattr(whole, name)[rows] for name in _PER_ROW}
        half_widths = None if whole.half_widths is None else whole.half_widths[rows]
        found.append(
            replace(
                whole,
                **cut,
                block=Message("cycle {name}", name=unit.name),
                alone=None if whole.alone is None else whole.alone[rows],
                half_widths=half_widths,
                band=whole.band if half_widths is not None and np.isfinite(half_widths).any() else "",
                probed=whole.probed and whole.probed.take(rows),
                verdict=replace(whole.verdict, units=(unit,)),
                n_effective=effective_sample_size(cut["measured"] - cut["predicted"]),
                robustness=None,
                overall=False,
            )
        )
    return found


def _assess_method(
    samples: Samples,
    rules: Rules,
    support: Support,
    robustness: bool,
    limits: Limits | None,
    guards: dict[str, Guard | None],
    piece: tuple[int, str, Split],
) -> Assessment:
    target, name, split = piece
    told = robustness or support.policy != "clip"
    trained = train(name, samples, target, split.learn, support=support, joint=told)
    first = int(np.argmax(split.judge))
    return judge(
        name,
        trained.model,
        samples,
        split,
        learned=samples.learned(target, split.learn & samples.valid, before=first),
        rules=rules,
        fit_s=trained.seconds,
        robustness=robustness,
        limits=limits,
        guard=guards.get(split.name),
    )


def _no_score(piece: tuple[int, str, Inner], _: str) -> list[float]:
    return [np.inf] * len(piece[2].scores)


def _together(parts: Sequence[Assessment]) -> Assessment:
    if len(parts) == 1:
        return replace(parts[0], overall=True)
    first = parts[0]
    failures = [a.failure for a in parts if a.failure]
    joined: dict[str, Any] = {name: np.concatenate([getattr(a, name) for a in parts]) for name in _PER_ROW}
    return replace(
        first,
        **joined,
        block=ALL,
        verdict=do_no_harm.join_verdicts([a.verdict for a in parts]),
        sensors=tuple(dict.fromkeys(s for a in parts for s in a.sensors)),
        n_sensors=(min(a.n_sensors[0] for a in parts), max(a.n_sensors[1] for a in parts)),
        fit_s=sum(a.fit_s for a in parts),
        n_effective=sum(a.n_effective for a in parts),
        robustness=pool_robustness([(a.robustness, len(a.measured)) for a in parts]),
        alone=np.concatenate([a.predicted if a.alone is None else a.alone for a in parts]),
        rejected=sum(a.rejected for a in parts),
        turned_away=next((a.turned_away for a in parts if a.turned_away), ""),
        half_widths=np.concatenate(
            [np.full(len(a.measured), np.nan) if a.half_widths is None else a.half_widths for a in parts]
        ),
        band="; ".join(dict.fromkeys(a.band for a in parts if a.band)),
        frozen=None,
        failure=failures[0] if failures else "",
        overall=True,
    )
