"""Selection of sensors by maximal correlation, for all targets together (Wessel)."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError
from thermocomp.judging.choice import Choice, Progress, Settings, Table
from thermocomp.judging.pieces import elsewhere, work_through
from thermocomp.models.selection.equivalents import Equivalents, equivalents
from thermocomp.models.selection.maximal_correlation import (
    DataSet,
    MaximalCorrelations,
    maximal_correlations,
    subsets_up_to,
)
from thermocomp.recordings.samples import Samples

#: half-width N of the boxcar of maximal correlation (W-04)
HALF_WINDOW = 10

#: Psi above which further sensors are not worthwhile (W-12)
ENOUGH_PSI = 0.99


def choose(samples: Samples, settings: Settings, *, jobs: int, progress: Progress) -> Choice:
    """Select for all targets together by maximal correlation (W-10 to W-12); every thermal cycle is a data set."""
    temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    names = [samples.inputs[j].name for j in temperatures]
    targets = tuple(c.name for c in samples.targets)
    rows = samples.valid & np.isfinite(samples.deviations).all(axis=1)
    sets = [
        DataSet(samples.cycle_names[k], samples.change()[mine][:, temperatures], samples.deviations[mine])
        for k in range(len(samples.cycle_names))
        if (mine := rows & (samples.cycle == k)).sum() > 2 * HALF_WINDOW
    ]
    if not temperatures or not sets:
        raise FitError(
            "maximal correlation needs at least one temperature and one thermal cycle with more than "
            f"{2 * HALF_WINDOW} complete rows"
        )
    subsets = subsets_up_to(len(names), settings.most("ace"))
    share = None if elsewhere.get() is None else _share
    psi = maximal_correlations(sets, subsets, half_window=HALF_WINDOW, jobs=jobs, share=share, progress=progress)
    done = np.isfinite(psi.psi).all(axis=(0, 1))
    if not done.any():
        raise FitError("the calculation was stopped before the first thermal cycle was completed")
    same = equivalents(list(psi.psi[:, :, done]), psi.subsets, level=settings.level, holm=settings.holm)

    total = dict(zip(same.subsets, same.summed.sum(axis=0).tolist(), strict=True))
    enough = psi.least_size(ENOUGH_PSI)
    equals = same.common or tuple(dict.fromkeys(same.subsets[k] for k in same.best))
    least = max(enough or settings.most("ace"), min(len(s) for s in equals))
    small = [s for s in equals if len(s) <= least]
    chosen = max(small, key=lambda s: total[s])
    notes = list(dict.fromkeys(n.partition(": ")[2] for n in same.notes))
    number = enough or f"more than {settings.most('ace')}"
    notes.append(f"A mean Psi of {ENOUGH_PSI:g} for every displacement needs {number} sensor(s); no more are selected.")
    notes.append(
        "Psi measures the fit within each cycle, not the error on unseen cycles: judge the set with 'compare --inputs'."
    )
    if not same.common:
        notes.append("No set is as good as the best for all displacements: the one shown is the best for one of them.")
    if not psi.complete:
        notes.append(f"Stopped: {int(done.sum())} of {len(sets)} thermal cycles were completed.")
    return Choice(
        method="ace",
        target=", ".join(targets),
        sensors=tuple(names[j] for j in chosen),
        reason=f"largest sum of Psi among the {len(same.common)} sets of up to {max(map(len, small))} sensors that are "
        "as good as the best for all displacements",
        tables=(_best_sets(psi, same, names, targets), _listed_sets(psi, same, names, targets, chosen)),
        notes=tuple(notes),
        details=same,
    )


def _share(work: Callable[[Any], Any], pieces: Sequence[Any]) -> Iterator[FloatArray]:
    for found in work_through(work, pieces, jobs=1):
        if isinstance(found, str):
            raise FitError(found)
        yield found


def _best_sets(psi: MaximalCorrelations, same: Equivalents, names: Sequence[str], targets: Sequence[str]) -> Table:
    done = int(np.isfinite(psi.psi).all(axis=(0, 1)).sum())
    return Table(
        title="Best set for each displacement",
        columns=("displacement", "best set", "mean Psi", "equivalent sets"),
        rows=tuple(
            (
                t,
                " ".join(names[j] for j in same.subsets[k]),
                float(same.summed[d, k] / done),
                int(same.equivalent[d].sum()),
            )
            for d, (t, k) in enumerate(zip(targets, same.best, strict=True))
        ),
        caption=f"{len(psi.subsets)} sets, {done} thermal cycles, {len(targets)} displacements: "
        f"{len(psi.subsets) * done * len(targets)} models.",
    )


def _listed_sets(
    psi: MaximalCorrelations, same: Equivalents, names: Sequence[str], targets: Sequence[str], chosen: Sequence[int]
) -> Table:
    done = int(np.isfinite(psi.psi).all(axis=(0, 1)).sum())
    shown = same.table()[:30]
    return Table(
        title="Sets by the number of displacements for which they are as good as the best",
        columns=("set", *(f"mean Psi {t}" for t in targets), "smallest p", "as good for"),
        rows=tuple(
            (
                " ".join(names[j] for j in row.subset),
                *(float(v / done) for v in row.summed),
                min(row.p_values),
                "all" if len(row.equivalent) == len(targets) else " ".join(targets[d] for d in row.equivalent),
            )
            for row in shown
        ),
        marked=next((k for k, row in enumerate(shown) if row.subset == chosen), None),
        caption=f"The first {len(shown)} of {len(psi.subsets)}.",
    )
