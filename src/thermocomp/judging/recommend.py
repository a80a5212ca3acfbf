"""Recommended method: selected again in each fold, with the left-out block (cycle or file) excluded.

The error of a selection among methods is not the error of the method with the best result: the best of twenty is partly
luck. Therefore the selection is repeated for every left-out block, by the error in use on the other blocks (nested
cross-validation, Varma and Simon 2006), and the selected method is judged on the left-out block. The error with clean
readings is that of models trained without either block. The effects of noise and of lost sensors are those on the other
blocks, of models trained with the left-out block: effects of readings on a model, not its error on that block.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.messages import Message
from thermocomp.judging.do_no_harm import Verdict, join_verdicts
from thermocomp.judging.inuse import InUse, least, pool
from thermocomp.judging.splits import Judging, Split
from thermocomp.models.training import fit_method
from thermocomp.recordings.samples import Samples

#: up to this number of blocks every pair is left out; with more, the others are left out in `GROUPS` groups per block
PAIRS = 8
GROUPS = 3
#: minimum number of blocks for a selection
LEAST = 3


@dataclass(frozen=True)
class Inner:
    """An inner split, with the pairs of blocks for which it gives an error.

    Parameters
    ----------
    split : Split
        Its `judge` marks all rows that are left out: those of the outer block and of the inner block or blocks.
    scores : tuple of (int, int)
        Pairs (outer left-out block, inner block) for which it gives an error.
    """

    split: Split
    scores: tuple[tuple[int, int], ...]


def inner_splits(judging: Judging) -> list[Inner]:
    """Return the inner splits needed to select a method with each block left out in turn."""
    splits = judging.splits
    n = len(splits)
    if n < LEAST:
        return []
    if n <= PAIRS:
        pairs = [(u, v) for u in range(n) for v in range(u + 1, n)]
        return [_inner(splits, (u, v), ((u, v), (v, u))) for u, v in pairs]
    found = []
    for u in range(n):
        others = [v for v in range(n) if v != u]
        for k in range(GROUPS):
            group = others[k::GROUPS]
            found.append(_inner(splits, (u, *group), tuple((u, v) for v in group)))
    return found


def _inner(splits: Sequence[Split], out: Sequence[int], scores: tuple[tuple[int, int], ...]) -> Inner:
    learn = np.logical_and.reduce([splits[u].learn for u in out])
    judge = np.logical_or.reduce([splits[u].judge for u in out])
    return Inner(Split(" and ".join(splits[u].block for u in out), learn, judge), scores)


def score(samples: Samples, by_target: Sequence[Judging], piece: tuple[int, str, Inner]) -> list[float]:
    """Return the RMS of a method for each of the `scores` of an inner split.

    Returns
    -------
    list of float
        [um]
    """
    target, name, inner = piece
    predicted = fit_method(name, samples, target, inner.split.learn).predicted
    found = []
    for _, v in inner.scores:
        residual = (samples.deviations[:, target] - predicted)[by_target[target].splits[v].judge]
        residual = residual[np.isfinite(residual)]
        found.append(float(np.sqrt(np.mean(residual**2))) if residual.size else np.inf)
    return found


@dataclass(frozen=True)
class Recommendation:
    """The recommended method for a target, and the verdict on the selection procedure.

    Parameters
    ----------
    chosen : tuple of str
        Method selected with each block left out.
    verdict : Verdict
        Verdict on the selection: each block is predicted by the method selected with this block left out.
    """

    target: str
    method: str
    chosen: tuple[str, ...]
    verdict: Verdict


def recommend(
    target: str,
    methods: Sequence[str],
    parts: Mapping[str, Sequence[Verdict]],
    used: Mapping[str, Sequence[tuple[InUse, int]]],
    inner: Mapping[str, Sequence[Sequence[float]]],
    inners: Sequence[Inner],
) -> Recommendation | None:
    """Recommend a method for a target.

    Parameters
    ----------
    parts : mapping of str to sequence of Verdict
        By method: verdict on each left-out block.
    used : mapping of str to sequence of (InUse, int)
        By method: error in use on each left-out block, and its number of rows.
    inner : mapping of str to sequence of sequence of float
        By method: result of `score` for each of `inners`.

    Returns
    -------
    Recommendation or None
        None if there are too few blocks or too few methods for a selection.
    """
    if not inners or not methods:
        return None
    n = len(parts[methods[0]])
    errors: list[dict[str, InUse]] = []
    for u in range(n):
        errors.append({})
        for name in methods:
            clean = {
                v: rms
                for found, values in zip(inners, inner[name], strict=True)
                for (outer, v), rms in zip(found.scores, values, strict=True)
                if outer == u
            }
            errors[u][name] = pool([(used[name][v][0].about(rms), used[name][v][1]) for v, rms in clean.items()])
    chosen = tuple(least(of) for of in errors)
    judged = [parts[name][u] for u, name in enumerate(chosen)]
    method = least({name: pool(used[name]) for name in methods})
    return Recommendation(target, method, chosen, join_verdicts(judged, about="the choice"))


def correct_verdicts(
    verdicts: Mapping[str, Verdict], primary: str | None, found: Recommendation | None
) -> dict[str, Verdict]:
    """Correct the verdicts on the methods tried for one target for the number of methods."""
    after = dict(zip(verdicts, holm(list(verdicts.values())), strict=True))
    if primary is not None:
        after[primary] = replace(after[primary], p=None, about=Message("primary method set before the evaluation"))
    elif found is not None and found.verdict.accepted:
        mine = after[found.method]
        better = min(found.verdict.p_value, mine.p_value)
        after[found.method] = replace(
            mine,
            p=better,
            about=Message(
                "selected again in each fold with the left-out cycle or file excluded, so the selection is part of the "
                "test"
            ),
        )
    return after


def holm(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Correct the verdicts on several methods for their number (Holm 1979)."""
    n = len(verdicts)
    raw = np.array([v.p_values[v.worst] if v.units else 1.0 for v in verdicts])
    order = np.argsort(raw, kind="stable")
    corrected = np.empty(n)
    corrected[order] = np.minimum(np.maximum.accumulate(raw[order] * (n - np.arange(n))), 1.0)
    return [replace(v, p=float(p), tried=n) for v, p in zip(verdicts, corrected, strict=True)]
