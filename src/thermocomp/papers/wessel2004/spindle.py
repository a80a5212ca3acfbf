"""Wessel's section III: the finite-element spindle; models are trained in one speed regime and used in another."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thermocomp.models.ace import ACE
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import rms
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.pictures import curves
from thermocomp.papers.study import BoolArray, Figure, Panel, Part, Progress
from thermocomp.papers.wessel2004.trial import (
    ACE_NAME,
    SLIGHT,
    SWEEPS,
    MillingTrial,
    loops,
    named,
    place,
    recorded,
    trial,
)
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.datasets import record
from thermocomp.virtual.protocol import Physics

#: numbers of neighbours tried in the paper (W-05)
NEIGHBOURS = range(1, 11)

# Criteria of the claims, defined before the first run:
#: minimum maximal correlation for the model to hold; the paper's own limit for enough temperatures (W-12)
GOOD_PSI = 0.99
#: maximal correlation of the reference series in the paper (W-06)
PAPER_PSI = 0.9994
#: maximum RMS for an estimate "quite close to the original", as a share of the displacement's span
CLOSE = 0.05


@dataclass(frozen=True, eq=False)
class Spindle:
    """Results for the finite-element spindle: two series, of which one is estimated from the other.

    Parameters
    ----------
    recordings : sequence of Recording
        Recording used for training, and recording to be estimated.
    peaked : MillingTrial
        Trial in which the series with the wider span is estimated: `found`, or a trial with the two series exchanged.
    """

    recordings: Sequence[Recording]
    found: MillingTrial
    peaked: MillingTrial

    @property
    def exchanged(self) -> bool:
        """Whether `peaked` has the two series exchanged."""
        return self.peaked is not self.found

    @property
    def span(self) -> float:
        """Maximum minus minimum of the measured displacement in the estimated series [um]."""
        return float(np.ptp(self.found.measured))

    @cached_property
    def sweep(self) -> dict[int, tuple[float, float]]:
        """RMS error and RMS difference from the estimate with 2 neighbours, by the number of neighbours [um]."""
        learned, unseen, measured = self.found.learned, self.found.unseen, self.found.measured
        by_k = {k: ACE(neighbours=k, max_sweeps=SWEEPS) for k in NEIGHBOURS}
        estimates = {
            k: ace.fit(learned.values, learned.deviations[:, 0]).predict(unseen.values) for k, ace in by_k.items()
        }
        return {k: (rms(measured - e), rms(e - estimates[2])) for k, e in estimates.items()}


def spindle(seed: int, progress: Progress, physics: Physics | None = None) -> Part:
    """Reproduce section III, the finite-element spindle (W-01 to W-07)."""
    progress(0.0, "finite-element spindle")
    recordings = record("wessel-fem", physics=physics, seed=seed)
    reference, _ = recordings
    target = len(reference.displacements) - 1  # S4, at the front tip of the tool
    temperatures = range(len(reference.temperatures))
    found = trial(recordings, target, temperatures)
    exchanged = not found.beyond.any()  # the wider series must be the estimated one
    peaked = trial(recordings[::-1], target, temperatures, beside=False) if exchanged else found
    s = Spindle(recordings, found, peaked)
    tables = (
        found.table("Finite-element spindle: the displacement at the tip in the test series"),
        exhibits.table("neighbours", s.sweep.items()),
    )
    numbers = found.numbers("fem") | found.rms_by_method("fem")
    neighbours = max(d for _, d in s.sweep.values())
    numbers |= exhibits.numbers("spindle", s, beyond=found.beyond.mean(), neighbours=neighbours)
    return Part(claims(s), tables, _figures(s), numbers)


# -- claims ------------------------------------------------------------------------------------------------------------

claims, exhibits = Claims[Spindle](__name__), Exhibits(__name__)


@claims.facts
def _series(s: Spindle) -> Facts:
    return {"rows": [len(r) for r in s.recordings], "intervals": [r.sampling_interval for r in s.recordings]}


@claims.facts
def _fits(s: Spindle) -> Facts:
    learned = s.found.learned
    return {"single": max(ACE().fit(x[:, None], learned.deviations[:, 0]).psi_ for x in learned.values.T)}


@claims.facts
def _close(s: Spindle) -> Facts:
    ace = s.found.rms(ACE_NAME)
    return {"ace": ace, "share": ace / s.span, "beside": s.found.rms_beside(ACE_NAME)}


@claims.facts
def _bent(s: Spindle) -> Facts:
    return s.found.reasons()


@claims.facts
def _neighbours(s: Spindle) -> Facts:
    errors = [e for e, _ in s.sweep.values()]
    worst = max(s.sweep, key=lambda k: s.sweep[k][1])
    differs = s.sweep[worst][1]
    step = float(np.median(np.abs(np.diff(np.sort(s.found.learned.deviations[:, 0])))))
    facts = {"differs": differs, "share": differs / s.span, "holds": differs < SLIGHT * s.span}
    return facts | {"worst": worst, "least": min(errors), "most": max(errors), "step": step}


@claims.facts
def _cropped(s: Spindle) -> Facts:
    found, beyond = s.peaked, s.peaked.beyond
    if not beyond.any():
        return {"peak": False, "range": False, "holds": False}
    estimate, error, seen = found.estimates[ACE_NAME], found.residual(ACE_NAME), found.learned.deviations[:, 0]
    out, inside = rms(error[beyond]), rms(error[~beyond])
    kept = bool((estimate[beyond] >= seen.min()).all() and (estimate[beyond] <= seen.max()).all())
    facts = {"peak": True, "range": True, "holds": kept and out > inside, "out": out, "inside": inside}
    facts |= {"beyond": beyond.sum(), "peaks": len(runs(beyond)), "low": seen.min(), "high": seen.max()}
    return facts | {"lowest": found.measured.min(), "highest": found.measured.max()}


@claims.facts
def _guarded(s: Spindle) -> Facts:
    beyond, flagged = s.peaked.beyond, s.peaked.flagged
    if not beyond.any():
        return {"peak": False, "range": False}
    met = [bool(flagged[p].any()) for p in runs(beyond)]
    facts = {"peak": True, "range": True, "holds": all(met), "met": sum(met), "peaks": len(met)}
    return facts | {"inside": flagged[beyond].mean(), "others": flagged[~beyond].mean()}


def runs(rows: BoolArray) -> list[slice]:
    """Return start and end of each run of consecutive rows in which a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


# -- figures -----------------------------------------------------------------------------------------------------------


def _figures(spindle: Spindle) -> tuple[Figure, ...]:
    found = spindle.found
    temperatures, s = list(named(found.learned)), place(found.target)
    theta, total = found.ace.theta_, found.ace.sum_phi_
    transformed = [
        Panel(f"({number}) {function}({name})", f"{name} [{unit}]", "[1]", curves(t.x, {"": t.y}))
        for number, function, name, unit, t in (
            ("i", "theta", s, "um", theta),
            *zip(("ii", "iii", "iv"), ("phi",) * 3, temperatures, ("degC",) * 3, found.ace.phi_, strict=False),
        )
    ]
    transformed += [
        Panel("(v)", "theta", "sum of phi", curves(total.x, {"": total.y}, "points")),
        Panel("(vi)", f"{s} [um]", "theta - sum of phi", curves(theta.x, {"": total.x - total.y}, "points")),
    ]
    hours, warm = found.unseen.time / 3600, named(found.unseen)
    estimated = {"measured": found.measured, "ACE": found.estimates[ACE_NAME]}
    if found.flagged.any():
        estimated["ACE, flagged by the guard"] = np.where(found.flagged, found.estimates[ACE_NAME], np.nan)
    reference = recorded(spindle.recordings[:1], range(len(temperatures)))
    return (
        exhibits.figure("wessel2004-fig2a", *reference),
        exhibits.figure("wessel2004-fig2b", *transformed, s=s),
        exhibits.figure("wessel2004-fig3", (hours, warm), (hours, estimated), s=s),
        exhibits.figure("wessel2004-loops", *loops(found.learned), s=s),
    )
