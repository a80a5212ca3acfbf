"""Wessel's Appendix B: which temperatures, by the maximal correlation of all sets on all data sets."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.datasets.virtual import record
from thermocomp.models.selection.equivalents import Equivalents, equivalents
from thermocomp.models.selection.maximal_correlation import (
    DataSet,
    MaximalCorrelations,
    maximal_correlations,
    subsets_up_to,
)
from thermocomp.papers.study import Claim, Progress, Table
from thermocomp.papers.wessel2004.trial import Part

#: mean Psi of the best set, for each displacement, by the number of temperatures
_BySize = dict[int, NDArray[np.float64]]

#: sets of nine temperatures, models of all and of at most three, and the data sets behind them (W-10)
PAPER_SETS, PAPER_MODELS, PAPER_SMALL_SETS, PAPER_DATA_SETS = 511, 35_259, 129, 23
#: equivalent sets for S1, S2, S3 and common ones; the sets they share; the one chosen (W-11)
PAPER_EQUIVALENT, PAPER_COMMON = (46, 7, 27), ((1, 2, 8), (2, 4, 8), (2, 5, 8), (2, 8, 9))
PAPER_SET = (1, 2, 8)
#: Psi that triples exceed, so that no more temperatures were looked at (W-12)
ENOUGH_PSI = 0.99
#: most temperatures in a set
MOST = 3
#: decrease of the error that counts as a failure, for the sets of at most three and for the larger ones, which the
#: paper did not try; down to zero it takes five times as long and moves Psi by some 1e-5
TOLERANCE, TOLERANCE_LARGER = 1e-6, 1e-5


@dataclass(frozen=True, eq=False)
class Selection:
    """What Appendix B finds.

    Parameters
    ----------
    psi : MaximalCorrelations
        Of the sets of at most three.
    small : Equivalents
        Their comparison.
    chosen : tuple of int
        Places of the temperatures, from 0.
    part : Part
    """

    psi: MaximalCorrelations
    small: Equivalents
    chosen: tuple[int, ...]
    part: Part


def appendix_b(seed: int, progress: Progress) -> Selection:
    """Redo Appendix B (W-10 to W-12).

    Parameters
    ----------
    seed : int
    progress : callable

    Returns
    -------
    Selection
    """
    progress(0.0, "23 data sets on the resting tool")
    recordings = record("wessel-sets", seed=seed)
    data = [DataSet(r.name, r.values(r.temperatures), r.values(r.displacements)) for r in recordings]
    n_temperatures, n_displacements = len(recordings[0].temperatures), len(recordings[0].displacements)
    every = subsets_up_to(n_temperatures)
    sets, larger = [s for s in every if len(s) <= MOST], [s for s in every if len(s) > MOST]
    models = len(every) * len(data) * n_displacements
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
    chosen = _choice(small)
    rows = [len(r) for r in recordings]
    matches = (len(every), models, len(sets)) == (PAPER_SETS, PAPER_MODELS, PAPER_SMALL_SETS)
    by_size = _best_by_size(psi) | _best_by_size(more)
    claims = (
        Claim(
            ("W-10",),
            "Nine temperatures, 23 data sets and three displacements make more models than can be calculated",
            f"{PAPER_SETS} sets, {PAPER_MODELS} models; of at most {MOST}: {PAPER_SMALL_SETS} sets",
            f"{len(every)} sets, {models} models in {seconds:.1f} s; of at most {MOST}: {len(sets)} sets, "
            f"{len(sets) * len(data) * n_displacements} models",
            None if matches else False,
            f"Data sets of {min(rows)} to {max(rows)} rows. The number is the paper's, the limit has gone."
            if matches
            else "The experiment has other numbers of sensors, probes or data sets than the paper's.",
        ),
        _enough(by_size),
        *_equal_claims(small, holm, converged),
    )
    numbers = {
        "sets_models": float(models),
        "sets_small": float(len(sets)),
        "sets_common": float(len(small.common)),
        "sets_common_holm": float(len(holm.common)),
        "sets_common_converged": float(len(converged.common)),
        "sets_best_psi": float(by_size[MOST].min()),
    }
    numbers |= {f"sets_equivalent_s{d + 1}": float(n) for d, n in enumerate(small.equivalent.sum(axis=1))}
    return Selection(psi, small, chosen, Part(claims, _tables(by_size, psi, small, chosen), (), numbers))


def _choice(small: Equivalents) -> tuple[int, ...]:
    """Choose one set: the paper's last step was subjective, ours is the greatest sum of Psi over all displacements."""
    equals = small.common or tuple(dict.fromkeys(small.subsets[k] for k in small.best))
    total = dict(zip(small.subsets, small.summed.sum(axis=0).tolist(), strict=True))
    return max(equals, key=lambda s: total[s])


def _enough(by_size: _BySize) -> Claim:
    told = "; ".join(f"{k}: {', '.join(f'{v:.4f}' for v in by_size[k])}" for k in (1, 2, MOST, max(by_size)))
    least = next((k for k, best in by_size.items() if (best > ENOUGH_PSI).all()), None)
    return Claim(
        ("W-12",),
        f"Three temperatures are enough: the best triples have a maximal correlation above {ENOUGH_PSI}",
        f"> {ENOUGH_PSI}",
        f"mean Psi of the best set for each displacement, by its size: {told}",
        bool((by_size[MOST] > ENOUGH_PSI).all()),
        f"Least number of temperatures with a mean above {ENOUGH_PSI} for every displacement: {least or 'none'}.",
    )


def _best_by_size(psi: MaximalCorrelations) -> _BySize:
    """Return the mean Psi of the best set of each size, for each displacement."""
    sizes = np.array([len(s) for s in psi.subsets])
    means = psi.psi.mean(axis=2)
    return {int(k): means[:, sizes == k].max(axis=1) for k in np.unique(sizes)}


def _equal_claims(small: Equivalents, holm: Equivalents, converged: Equivalents) -> tuple[Claim, Claim]:
    common = small.common
    shared = set.intersection(*(set(s) for s in common)) if common else set()
    pair = tuple(sorted(shared))
    worse = bool(shared) and pair not in common
    if not common:
        why = "No set is as good as the best for all displacements."
    elif not shared:
        why = "No temperature is in all of the common sets."
    elif not worse:
        why = f"{called(pair)} by itself is as good as the best for all displacements."
    else:
        p_values = small.p_values[:, small.subsets.index(pair)]
        told = ", ".join(f"{p:.2g}" for p in p_values)
        why = f"{called(pair)} by itself is told from the best: p = {told} for the displacements in turn."
    return (
        Claim(
            ("W-11", "E-W6"),
            "Several sets are as good as the best, and some are for all displacements",
            f"{', '.join(str(n) for n in PAPER_EQUIVALENT)} sets for S1, S2, S3; {len(PAPER_COMMON)} common: "
            + " ".join(called(tuple(j - 1 for j in s)) for s in PAPER_COMMON),
            f"{_counted(small)}: "
            + (" ".join(called(s) for s in common[:6]) + (" ..." if len(common) > 6 else "") or "none"),
            len(common) > 0,
            f"Level 0.05, which the paper does not state, without correction for the number of sets; by Holm's rule "
            f"{_counted(holm)}; with sweeps to the limit instead of the paper's rule {_counted(converged)}.",
        ),
        Claim(
            ("W-11",),
            "Some temperatures are in all common sets, but do not suffice by themselves",
            "T2 and T8",
            called(pair) if shared else "none",
            worse,
            why,
        ),
    )


def _counted(found: Equivalents) -> str:
    return f"{', '.join(str(n) for n in found.equivalent.sum(axis=1))} sets, {len(found.common)} common"


def called(places: tuple[int, ...]) -> str:
    """Write a set as the paper does: ``{T1, T2, T8}``."""
    return "{" + ", ".join(f"T{j + 1}" for j in places) + "}"


def _tables(
    by_size: _BySize, psi: MaximalCorrelations, small: Equivalents, chosen: tuple[int, ...]
) -> tuple[Table, ...]:
    n_tests = len(psi.tests)
    targets = [f"S{d + 1}" for d in range(len(psi.psi))]
    paper = tuple(j - 1 for j in PAPER_SET)
    rows = small.table()
    listed = [r for k, r in enumerate(rows) if k < 12 or r.subset in (paper, chosen)]
    return (
        Table(
            "Appendix B: mean Psi of the best set of each size",
            ("temperatures", *targets),
            [[str(k), *(f"{v:.4f}" for v in best)] for k, best in by_size.items()],
        ),
        Table(
            "Appendix B: sets of at most three, first those as good as the best for most displacements",
            ("set", *(f"mean Psi {t}" for t in targets), "smallest p", "as good for", ""),
            [
                [
                    called(r.subset),
                    *(f"{v / n_tests:.4f}" for v in r.summed),
                    f"{min(r.p_values):.2g}",
                    " ".join(targets[d] for d in r.equivalent),
                    " ".join(w for w, s in (("the paper's", paper), ("chosen", chosen)) if s == r.subset),
                ]
                for r in listed
            ],
        ),
    )
