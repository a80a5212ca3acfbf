"""Wessel's Appendix B: choice of temperatures by the maximal correlation of all sets on all data sets."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thermocomp.models.selection.equivalents import Equivalents, equivalents
from thermocomp.models.selection.maximal_correlation import (
    DataSet,
    MaximalCorrelations,
    maximal_correlations,
    subsets_up_to,
)
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.study import FloatArray, Part, Progress, StudyTable
from thermocomp.virtual.datasets import record
from thermocomp.virtual.protocol import Physics

#: numbers of temperature sets (nine temperatures), of models of all sets and of models of at most three (W-10)
PAPER_SETS, PAPER_MODELS, PAPER_SMALL_SETS = 511, 35_259, 129
#: the chosen set, 0-based (W-11)
PAPERS_OWN = (0, 1, 7)
#: Psi exceeded by triples, so that larger sets were not examined (W-12)
ENOUGH_PSI = 0.99
#: maximum number of temperatures in a set
MOST = 3
#: decrease of the error that counts as no decrease, for sets of at most three and for larger ones, which the paper did
#: not try; with zero the computation takes five times as long and changes Psi by about 1e-5
TOLERANCE, TOLERANCE_LARGER = 1e-6, 1e-5


@dataclass(frozen=True, eq=False)
class Selection:
    """Results of Appendix B.

    Parameters
    ----------
    psi, larger : MaximalCorrelations
        Maximal correlations of the sets of at most three, and of all larger ones.
    small, holm, converged : Equivalents
        Comparison of the sets of at most three: without correction for their number, with Holm's correction, and with
        fully converged sweeps.
    rows : sequence of int
        Number of rows of each data set.
    seconds : float
        Computing time of all models [s].
    """

    psi: MaximalCorrelations
    larger: MaximalCorrelations
    small: Equivalents
    holm: Equivalents
    converged: Equivalents
    rows: Sequence[int]
    seconds: float

    @cached_property
    def chosen(self) -> tuple[int, ...]:
        """Indices (0-based) of the temperatures in the chosen set."""
        return _choice(self.small)

    @cached_property
    def by_size(self) -> dict[int, FloatArray]:
        """Mean Psi of the best set for each displacement, by the number of temperatures."""
        found: dict[int, FloatArray] = {}
        for psi in (self.psi, self.larger):
            sizes, means = np.array([len(s) for s in psi.subsets]), psi.psi.mean(axis=2)
            found |= {int(k): means[:, sizes == k].max(axis=1) for k in np.unique(sizes)}
        return found

    @property
    def sets(self) -> int:
        """Number of all sets of temperatures."""
        return len(self.psi.subsets) + len(self.larger.subsets)

    def models(self, sets: int) -> int:
        """Return the number of models for a number of sets: one per set, data set and displacement."""
        return sets * len(self.rows) * len(self.psi.psi)


def appendix_b(seed: int, progress: Progress, physics: Physics | None = None) -> Selection:
    """Reproduce Appendix B: selection of temperatures by maximal correlation (W-10 to W-12)."""
    progress(0.0, "23 data sets on the resting tool")
    recordings = record("wessel-sets", physics=physics, seed=seed)
    data = [DataSet(r.name, r.values(r.temperatures), r.values(r.displacements)) for r in recordings]
    every = subsets_up_to(len(recordings[0].temperatures))
    sets, larger = [s for s in every if len(s) <= MOST], [s for s in every if len(s) > MOST]
    progress(0.2, f"maximal correlation of {len(every)} sets")
    begin = time.perf_counter()
    psi = maximal_correlations(data, sets, converged=False, tolerance=TOLERANCE, jobs=-1)
    progress(0.5, f"maximal correlation of {len(every)} sets")
    more = maximal_correlations(data, larger, converged=False, tolerance=TOLERANCE_LARGER, jobs=-1)
    seconds = time.perf_counter() - begin
    progress(0.9, "sets that are as good as the best")
    limit = maximal_correlations(data, sets, jobs=-1)
    small, holm, converged = (
        equivalents(list(found.psi), sets, holm=h) for found, h in ((psi, False), (psi, True), (limit, False))
    )
    return Selection(
        psi=psi,
        larger=more,
        small=small,
        holm=holm,
        converged=converged,
        rows=[len(r) for r in recordings],
        seconds=seconds,
    )


def told(s: Selection) -> Part:
    """Return the claims, tables and key numbers of Appendix B."""
    counts = s.small.equivalent.sum(axis=1)
    best = s.by_size[MOST].min()
    numbers = exhibits.numbers("sets", s, models=s.models(s.sets), best_psi=best, equivalent=counts)
    return Part(claims(s), _tables(s), (), numbers)


def _choice(small: Equivalents) -> tuple[int, ...]:
    """Return the chosen set: the paper's last step was subjective, ours is the largest sum of Psi."""
    equals = small.common or tuple(dict.fromkeys(small.subsets[k] for k in small.best))
    total = dict(zip(small.subsets, small.summed.sum(axis=0).tolist(), strict=True))
    return max(equals, key=lambda s: total[s])


def name_set(places: Sequence[int]) -> str:
    """Return the name of a set as in the paper: ``{T1, T2, T8}``."""
    return "{" + ", ".join(f"T{j + 1}" for j in places) + "}"


# -- claims ------------------------------------------------------------------------------------------------------------

claims, exhibits = Claims[Selection](__name__), Exhibits(__name__)


@claims.facts
def _calculated(s: Selection) -> Facts:
    small, models = len(s.psi.subsets), s.models(s.sets)
    matches = (s.sets, models, small) == (PAPER_SETS, PAPER_MODELS, PAPER_SMALL_SETS)
    facts = {"models": models, "small": small, "small_models": s.models(small), "holds": None if matches else False}
    return facts | {"matches": matches, "fewest": min(s.rows), "most": max(s.rows)}


@claims.facts
def _enough(s: Selection) -> Facts:
    best = s.by_size
    least = next((k for k, psi in best.items() if (psi > ENOUGH_PSI).all()), "none")
    holds = (best[MOST] > ENOUGH_PSI).all()
    return {
        "best": [(k, best[k]) for k in (1, 2, MOST, max(best))],
        "least": least,
        "single": best[1].min(),
        "holds": holds,
    }


@claims.facts
def _several(s: Selection) -> Facts:
    common = s.small.common
    shown = " ".join(map(name_set, common[:6])) + (" ..." if len(common) > 6 else "")
    several = len(common) > 1 and bool((s.small.equivalent.sum(axis=1) > 1).all())  # the best is equal to itself
    facts: Facts = {"shown": shown or "none", "holds": several}
    for name, found in (("small", s.small), ("holm", s.holm), ("converged", s.converged)):
        facts |= {f"counts_{name}": True, f"equivalent_{name}": found.equivalent.sum(axis=1)}
    return facts


@claims.facts
def _shared(s: Selection) -> Facts:
    small, common = s.small, s.small.common
    pair = tuple(sorted(set.intersection(*map(set, common)))) if common else ()
    if not pair:
        return {"pair": "none", "holds": False, "why": "nothing" if common else "none"}
    if pair in common:
        return {"pair": name_set(pair), "holds": False, "why": "enough"}
    p_values = small.p_values[:, small.subsets.index(pair)]
    return {"pair": name_set(pair), "holds": True, "why": "worse", "p_values": p_values}


# -- tables ------------------------------------------------------------------------------------------------------------


def _tables(s: Selection) -> tuple[StudyTable, ...]:
    targets = [f"S{d + 1}" for d in range(len(s.psi.psi))]
    special = {"the paper's": PAPERS_OWN, "chosen": s.chosen}
    listed = [
        (
            name_set(r.subset),
            [v / len(s.psi.tests) for v in r.summed],
            min(r.p_values),
            [targets[d] for d in r.equivalent],
            [word for word, subset in special.items() if subset == r.subset],
        )
        for k, r in enumerate(s.small.table())
        if k < 12 or r.subset in special.values()
    ]
    return exhibits.table("sizes", s.by_size.items()), exhibits.table("sets", listed)
