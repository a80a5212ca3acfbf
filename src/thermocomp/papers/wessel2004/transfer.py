"""Wessel's conclusions: a model learned with one mounting of the tool, used with the others (W-10, W-14)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from thermocomp.models.ace import ACE
from thermocomp.models.ols import LeastSquares
from thermocomp.papers import common
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import fit_and_freeze, residual, rms, trained
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.study import Part, Progress
from thermocomp.papers.wessel2004.sets import PAPERS_OWN, name_set
from thermocomp.papers.wessel2004.trial import AVERAGED, SWEEPS, stacked
from thermocomp.virtual.datasets import record
from thermocomp.virtual.kits import KITS
from thermocomp.virtual.protocol import Physics

#: criterion, defined before the first run: share of the RMS without compensation that a transferred model may leave
SHARE = 0.2


@dataclass(frozen=True, eq=False)
class Transfer:
    """Errors of models with the mounting that they learned, and with others.

    Parameters
    ----------
    errors : mapping of (str, str) to mapping of str to float
        RMS in the unseen test by method (``none`` ``mlr`` ``ace`` ``averaged``), by the mountings in training and test
        [um].
    """

    errors: Mapping[tuple[str, str], Mapping[str, float]]

    @cached_property
    def others(self) -> list[tuple[str, str]]:
        """Pairs of different mountings."""
        return [pair for pair in self.errors if pair[0] != pair[1]]

    def share(self, pair: tuple[str, str]) -> float:
        """Return the RMS of ACE as a share of that without compensation."""
        return self.errors[pair]["ace"] / self.errors[pair]["none"]

    def own(self, pair: tuple[str, str]) -> float:
        """Return the RMS of the ACE that was trained with the mounting of the test [um]."""
        return self.errors[pair[1], pair[1]]["ace"]


def transfer(seed: int, progress: Progress, physics: Physics | None = None) -> Part:
    """Use the models of each mounting of the resting tool with every other one (W-14)."""
    progress(0.0, "three mountings")
    mountings = KITS["tool"].mountings
    tests = {m: record("wessel-tool", physics=physics, mounting=m, seed=seed) for m in mountings}
    read = {m: [stacked([r], 0, PAPERS_OWN) for r in each] for m, each in tests.items()}
    zeroed = {m: [stacked([r], 0, PAPERS_OWN, rezero=True) for r in each] for m, each in tests.items()}
    errors: dict[tuple[str, str], dict[str, float]] = {}
    for source, (learned, _) in read.items():
        (target,) = (c.name for c in learned.targets)
        static = {"mlr": LeastSquares(), "ace": ACE(max_sweeps=SWEEPS)}
        models = {name: fit_and_freeze(e, learned, [target])[target] for name, e in static.items()}
        averaged = trained(AVERAGED, zeroed[source][0])
        for used, (_, unseen) in read.items():
            found = {"none": rms(common.take_measured(unseen, target))}
            found |= {name: rms(residual(model, unseen)) for name, model in models.items()}
            errors[source, used] = found | {AVERAGED: rms(residual(averaged, zeroed[used][1]))}
    t = Transfer(errors)
    table = exhibits.table("transfer", [(*pair, e) for pair, e in errors.items()], set=name_set(PAPERS_OWN))
    worst = max(t.others, key=t.share)
    numbers = {f"transfer_worst_{name}_rms_um": errors[worst][name] for name in ("none", "ace", "mlr", AVERAGED)}
    return Part(claims(t), (table,), (), numbers)


claims, exhibits = Claims[Transfer](__name__), Exhibits(__name__)


@claims.facts
def _transferred(t: Transfer) -> Facts:
    worst = max(t.others, key=t.share)
    farthest = max(t.others, key=lambda pair: t.errors[pair]["ace"] / t.own(pair))
    facts: Facts = {"worst": " to ".join(worst), "farthest": " to ".join(farthest), "share": t.share(worst)}
    facts |= {"before": t.errors[worst]["none"], "after": t.errors[worst]["ace"], "own": t.own(worst)}
    return facts | {"ratio": t.errors[farthest]["ace"] / t.own(farthest)}
