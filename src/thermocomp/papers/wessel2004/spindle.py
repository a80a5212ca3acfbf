"""Wessel's section III: the finite-element spindle, learned in one speed regime, estimated in another."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thermocomp.models.ace import ACE
from thermocomp.papers.common import rms
from thermocomp.papers.pictures import curves
from thermocomp.papers.study import BoolArray, Claims, Figure, Ours, Panel, Part, Progress, StudyTable
from thermocomp.papers.wessel2004.trial import (
    ACE_NAME,
    MLR_NAME,
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

#: maximal correlation of the reference series, number of its rows and their interval [s] (W-06)
PAPER_PSI, PAPER_ROWS, PAPER_INTERVAL = 0.9994, 199, 100.0
#: numbers of neighbours tried in the paper (W-05)
NEIGHBOURS = range(1, 11)

# Criteria of the claims, defined before the first run:
#: minimum maximal correlation for the model to hold; the paper's own limit for enough temperatures (W-12)
GOOD_PSI = 0.99
#: maximum RMS for an estimate "quite close to the original", as a share of the displacement's span
CLOSE = 0.05


@dataclass(frozen=True, eq=False)
class Spindle:
    """The two series.

    Parameters
    ----------
    recordings : sequence of Recording
        Learned and estimated recording.
    found : MillingTrial
    peaked : MillingTrial
        Trial with the wider series as the estimated one: `found`, or with the two series exchanged.
    """

    recordings: Sequence[Recording]
    found: MillingTrial
    peaked: MillingTrial

    @property
    def how(self) -> str:
        """Note on `peaked` if it has the two series exchanged; else empty."""
        return "" if self.peaked is self.found else "the two series exchanged: "

    @property
    def span(self) -> float:
        """Span of the estimated displacement [um]."""
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
    """Reproduce section III (W-01 to W-07).

    Parameters
    ----------
    seed : int
    progress : callable
    physics : {'linear', 'nonlinear'}, optional

    Returns
    -------
    Part
    """
    progress(0.0, "finite-element spindle")
    recordings = record("wessel-fem", physics=physics, seed=seed)
    target = len(recordings[0].displacements) - 1  # S4, at the front tip of the tool
    temperatures = range(len(recordings[0].temperatures))
    found = trial(recordings, target, temperatures)
    exchanged = not found.beyond.any()  # the wider series must be the estimated one
    peaked = trial(recordings[::-1], target, temperatures, beside=False) if exchanged else found
    s = Spindle(recordings, found, peaked)
    tables = (
        found.table("Finite-element spindle: the displacement at the tip in the test series"),
        StudyTable(
            "ACE in the test series with k neighbours",
            ("k", "RMS [um]", "RMS difference from k = 2 [um]"),
            [[str(k), f"{error:.3f}", f"{difference:.3f}"] for k, (error, difference) in s.sweep.items()],
        ),
    )
    numbers = found.numbers("fem") | found.rms_by_method("fem")
    numbers |= {
        "fem_span_um": s.span,
        "fem_sweeps": float(len(found.ace.errors_)),
        "fem_beyond": float(found.beyond.mean()),
        "fem_neighbours_um": max(d for _, d in s.sweep.values()),
    }
    return Part(claims(s), tables, _figures(s), numbers)


# -- claims ------------------------------------------------------------------------------------------------------------

claims = Claims[Spindle]()


@claims.add("W-06", "Two series, each of 199 rows 100 s apart", f"{PAPER_ROWS} rows, {PAPER_INTERVAL:g} s")
def _series(s: Spindle) -> str:
    intervals = ", ".join(f"{r.sampling_interval:g}" for r in s.recordings)
    return f"{', '.join(str(len(r)) for r in s.recordings)} rows, {intervals} s"


@claims.add(
    "W-02 W-03 W-04 W-06 E-W3 E-W5",
    f"The transformations fit: the maximal correlation of the reference series is above {GOOD_PSI}",
    f"Psi = {PAPER_PSI}",
)
def _fits(s: Spindle) -> Ours:
    ace = s.found.ace
    return Ours(
        f"Psi = {ace.psi_:.4f}",
        ace.psi_ > GOOD_PSI,
        note=f"After {len(ace.errors_)} sweeps (until the error fails to decrease). Psi is a fit, and does not "
        f"depend on which side is normalised (E-W3). theta falls over {ace.falling_theta_:.0%} of its steps, "
        "where its inverse is not unique (E-W5).",
    )


@claims.add(
    "W-05 W-13",
    f"The estimate is quite close to the test series: RMS below {CLOSE:.0%} of the displacement's span",
    "a figure",
)
def _close(s: Spindle) -> Ours:
    ace = s.found.rms(ACE_NAME)
    others = ", ".join(f"{m} {s.found.rms(m):.2f} um" for m in s.found.estimates if m != ACE_NAME)
    return Ours(
        f"{ace:.2f} um, {ace / s.span:.1%} of {s.span:.1f} um",
        ace < CLOSE * s.span,
        note=f"By the other methods: {others}.",
    )


@claims.add(
    "W-01",
    "Linear regression is not sufficient: ACE has the smaller RMS in the test series",
    "no number for this series",
)
def _bent(s: Spindle) -> Ours:
    ace, mlr = s.found.rms(ACE_NAME), s.found.rms(MLR_NAME)
    return Ours(
        f"MLR {mlr:.2f} um, ACE {ace:.2f} um",
        ace < mlr,
        "The paper's evidence is that the curves are bent; bends of several can cancel.",
        note=s.found.reasons(),
    )


@claims.add("W-05", f"k = 1 to 10 neighbours: only slight differences, below {SLIGHT:.0%} of the span", "slight")
def _neighbours(s: Spindle) -> Ours:
    errors, learned = [e for e, _ in s.sweep.values()], s.found.learned
    worst = max(s.sweep, key=lambda k: s.sweep[k][1])
    differs = s.sweep[worst][1]
    step = float(np.median(np.abs(np.diff(np.sort(learned.deviations[:, 0])))))
    return Ours(
        f"at most {differs:.2f} um ({differs / s.span:.1%}) from the estimate with k = 2, at k = {worst}",
        differs < SLIGHT * s.span,
        f"The RMS error itself goes from {min(errors):.2f} to {max(errors):.2f} um. Neighbours are averaged among "
        f"{len(learned)} rows whose displacements are {step:.2f} um apart in the median, and across the branches of a "
        f"theta that falls over {s.found.ace.falling_theta_:.0%} of its steps.",
    )


NO_PEAK = Ours(
    "no row beyond",
    note="The displacements that are estimated stay within those that were learned: there is no peak to crop.",
)


@claims.add(
    "W-07 W-13", "Peaks beyond the displacements that were learned are cropped, and worse than the rest", "a figure"
)
def _cropped(s: Spindle) -> Ours:
    found = s.peaked
    beyond, estimate, error = found.beyond, found.estimates[ACE_NAME], found.residual(ACE_NAME)
    if not beyond.any():
        return NO_PEAK._replace(holds=False)
    seen = found.learned.deviations[:, 0]
    out, inside = rms(error[beyond]), rms(error[~beyond])
    kept = bool((estimate[beyond] >= seen.min()).all() and (estimate[beyond] <= seen.max()).all())
    return Ours(
        f"{s.how}{beyond.sum()} rows in {len(runs(beyond))} peak(s): RMS {out:.2f} um, {inside:.2f} um in the others",
        kept and out > inside,
        note=f"Learned from {seen.min():.1f} to {seen.max():.1f} um, to be estimated from {found.measured.min():.1f} "
        f"to {found.measured.max():.1f} um.",
    )


@claims.add("W-07", "The support guard flags every cropped peak (ours)")
def _guarded(s: Spindle) -> Ours:
    beyond, flagged = s.peaked.beyond, s.peaked.flagged
    if not beyond.any():
        return NO_PEAK
    met = [bool(flagged[p].any()) for p in runs(beyond)]
    return Ours(
        f"{s.how}{sum(met)} of {len(met)} peak(s), {flagged[beyond].mean():.0%} of their rows; "
        f"{flagged[~beyond].mean():.0%} of the others",
        all(met),
        "The guard looks at temperatures; in the peaks it missed only the displacement left its range.",
    )


def runs(rows: BoolArray) -> list[slice]:
    """Return the runs of consecutive true rows."""
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
    hours, warned = found.unseen.time / 3600, "ACE, flagged by the guard"
    estimated = {"measured": found.measured, "ACE": found.estimates[ACE_NAME]}
    if found.flagged.any():
        estimated[warned] = np.where(found.flagged, found.estimates[ACE_NAME], np.nan)
    return (
        Figure(
            "wessel2004-fig2a",
            "Fig. 2a: the reference series.",
            recorded(spindle.recordings[:1], range(len(temperatures))),
        ),
        Figure(
            "wessel2004-fig2b",
            f"Fig. 2b: optimal transformations for {s}, their sum against theta, and what is left.",
            transformed,
            columns=2,
        ),
        Figure(
            "wessel2004-fig3",
            f"Fig. 3: temperatures of the test series, and {s} measured and estimated; where the guard warns, a "
            "temperature is outside what was learned.",
            [
                Panel("", "time [h]", "temperature [degC]", curves(hours, named(found.unseen))),
                Panel("", "time [h]", f"{s} [um]", curves(hours, estimated, dashed=["ACE"], points=[warned])),
            ],
        ),
        Figure(
            "wessel2004-loops",
            f"Not in the paper: {s} against each temperature in the reference series. The loops are the hysteresis: "
            "one temperature, two displacements.",
            loops(found.learned),
            columns=3,
        ),
    )
