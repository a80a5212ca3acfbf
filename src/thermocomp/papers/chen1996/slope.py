"""Chen, Yuan, Ni 1996, sections 3.3 and 4.3: the positioning error of Y, cold profile plus a slope that drifts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from thermocomp.files.profiles import from_recording
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.position import PositionFit, PositionOptions, fit_position, slope_samples
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import law
from thermocomp.papers.chen1996.law import HIDDEN, Law, r2_about_zero
from thermocomp.papers.chen1996.setup import (
    CLOSELY,
    DIFFERENCES,
    EQ6,
    EQ8,
    SLOPE_VARIABLES,
    SPEED,
    TEMPERATURES,
    TENFOLD,
    recordings,
    with_differences,
)
from thermocomp.papers.common import PAPERS_SUPPORT, Errors, judged, shown
from thermocomp.papers.study import Claim, Curve, Figure, Panel, Table
from thermocomp.recording.profiles import Profiles

FloatArray = NDArray[np.float64]

#: sets, unscreened and screened coefficients (C-23)
SETS, CANDIDATES = 51, 20
#: error of a dimension along Y before and after compensation [um] (C-35)
LATERAL = (92.4, 7.2)
#: how often the 5-8-1 net is trained (C-27)
STARTS = 5
#: share of the thermal part beside its straight line up to which the line is enough (C-05)
STRAIGHT = 0.1
NONE, MRA, NET, DYNAMIC, MEASURED = "no compensation", "MRA", "net", "dynamic (ours)", "measured slope"


@dataclass(frozen=True, eq=False)
class Positioning:
    """What was learned from the profiles of one test, and those of another day.

    Parameters
    ----------
    learned, other : Profiles
        EYY: the 51 sets, and the same test on another day.
    pitch : Profiles
        EAY, measured with the former.
    fits : mapping of str to PositionFit
        Of `learned`, one of each method; of the nets the one with the median error after training.
    nets : sequence of PositionFit
        5-8-1, each from another start.
    linear : PositionFit
        By stepwise regression on first-order terms alone.
    law : Law
        What became of a law that was planted.
    """

    learned: Profiles
    other: Profiles
    pitch: Profiles
    fits: Mapping[str, PositionFit]
    nets: Sequence[PositionFit]
    linear: PositionFit
    law: Law

    @property
    def regression(self) -> Any:
        """The SecondOrderRegression behind its fit."""
        return self.fits[MRA].trained[0].estimator

    @cached_property
    def net_r2(self) -> FloatArray:
        """R2 of the nets about zero, shape (n_starts,)."""
        k1 = self.slope(self.learned)
        return np.array([r2_about_zero(k1, n.trained[0].estimator.predict(n.samples.frame())) for n in self.nets])

    def geometric(self, day: Profiles) -> FloatArray:
        """Return the cold profile of `learned`, by its polynomial, shape (n_points,) [um] (C-07, C-22)."""
        return self.fits[MRA].profile.profile.at(day.points)

    def slope(self, day: Profiles) -> FloatArray:
        """Return the slope k1 of what comes on top, through position 0, shape (n_states,) [um/m] (C-04, E-C6)."""
        thermal = day.values - self.geometric(day)
        return 1e3 * (thermal @ day.position) / (day.position @ day.position)

    def predicted(self, fit: PositionFit, day: Profiles) -> FloatArray:
        """Return the slope that a model tells from the readings of a day, shape (n_states,) [um/m]."""
        model = fit.model.slopes[0]
        samples, _ = slope_samples([day], PositionOptions(inputs=[i.name for i in model.inputs]))
        return common.predicted(model, samples)

    def left(self, fit: PositionFit, day: Profiles) -> float:
        """Return the RMS of what a model leaves of the slope [um/m]."""
        return Errors.of(self.slope(day) - self.predicted(fit, day)).rms


def learn(seed: int, other_seed: int) -> Positioning:
    """Run the test on two days and fit what the paper fits to the first.

    Parameters
    ----------
    seed, other_seed : int
        Of weather and noise on the two days.

    Returns
    -------
    Positioning
    """
    (first,), (second,) = (map(with_differences, recordings("chen1996-slope", s)) for s in (seed, other_seed))
    learned, other = (from_recording(day, "EYY") for day in (first, second))
    paper = PositionOptions(order=EQ6.degree(), inputs=TEMPERATURES, support=PAPERS_SUPPORT)
    # The two regressions differ in their candidates only.
    regression, linear = (
        fit_position(
            learned,
            replace(
                paper,
                method=SecondOrderRegression(differences=DIFFERENCES, subset=SLOPE_VARIABLES, second_order=second),
            ),
        )
        for second in (True, False)
    )
    nets: list[PositionFit] = Parallel(n_jobs=-1, prefer="threads")(
        delayed(fit_position)(
            learned, replace(paper, inputs=SLOPE_VARIABLES, method=SigmoidNet(hidden=HIDDEN, seed=start))
        )
        for start in range(STARTS)
    )
    typical = int(np.argsort([_net(n).loss_history_[-1] for n in nets])[STARTS // 2])
    ours = fit_position(learned, PositionOptions(order=EQ6.degree(), inputs=(*TEMPERATURES, *SPEED), method="dynamic"))
    fits = {MRA: regression, NET: nets[typical], DYNAMIC: ours}
    return Positioning(learned, other, from_recording(first, "EAY"), fits, nets, linear, law.seek(seed))


def _net(fit: PositionFit) -> Any:
    return fit.trained[0].estimator


# -- claims --------------------------------------------------------------------------------------------------------


def claims(found: Positioning) -> list[Claim]:
    """Judge what the paper says about the profiles, by criteria that were fixed beforehand."""
    learned, regression = found.learned, found.regression
    k1, geometric = found.slope(learned), found.geometric(learned)
    apart, lowest, highest = Errors.of(geometric - EQ6(learned.position)), geometric.min(), geometric.max()
    thermal = learned.values - geometric
    bent = Errors.of(thermal - along(learned, k1)).rms / Errors.of(thermal).rms
    second = [t for t in regression.terms_ if "*" in t]
    r2_net = float(np.median(found.net_r2))
    slope = Errors.of(k1)
    left = {m: found.left(fit, found.other) for m, fit in (*found.fits.items(), ("", found.linear))}
    other = Errors.of(found.slope(found.other)).rms
    net = _net(found.nets[0])
    return [
        shown(
            ("C-22", "C-36"),
            "A polynomial of fifth order describes the cold profile (the virtual machine's own is Eq. 6, so this tells "
            "only what the noise of the laser does)",
            "-18.5 .. 8.5 um",
            f"{lowest:.1f} .. {highest:.1f} um, within {apart.max_abs:.2f} um of Eq. 6",
        ),
        judged(
            ("C-04", "C-05", "C-07"),
            f"Only the slope of the profile varies: a straight line leaves at most {STRAIGHT:.0%} of its thermal part",
            "",
            f"{bent:.1%}",
            bent <= STRAIGHT,
            f"the screw does not warm evenly, and {bent:.1%} of the thermal part (RMS) is no straight line",
        ),
        shown(
            ("C-23",),
            f"{SETS} sets of slopes, {CANDIDATES} unscreened coefficients",
            f"{SETS}, {CANDIDATES}",
            f"{len(learned)}, {len(regression.candidates_)}",
        ),
        judged(
            ("C-23", "C-24"),
            "Stepwise regression needs neither higher-order nor product terms",
            f"{', '.join(EQ8)}",
            ", ".join(regression.terms_),
            not second,
            f"{', '.join(second)} came in; on another day this model leaves {left[MRA]:.2f} um/m (RMS) and one of "
            f"first-order terms alone {left['']:.2f}, of slopes of {other:.1f}",
        ),
        judged(
            ("C-24", "C-36"),
            f"The regression fits the slopes closely in warm-up and cool-down (R2 >= {CLOSELY})",
            "Fig. 7",
            f"R2 {regression.r_squared_:.3f}",
            round(regression.r_squared_, 3) >= CLOSELY,
            f"standard error of estimate {regression.standard_error_:.2f} um/m beside slopes of up to "
            f"{slope.max_abs:.1f} um/m",
        ),
        judged(
            ("C-27", "C-36"),
            f"The 5-8-1 net can also fit the slopes (R2 >= {CLOSELY})",
            "Fig. 13",
            f"R2 {r2_net:.3f} ({found.net_r2.min():.3f}-{found.net_r2.max():.3f})",
            round(r2_net, 3) >= CLOSELY,
            f"after {net.n_epochs} epochs of {len(learned)} patterns it is no nearer",
        ),
        shown(
            ("C-27",),
            "The net has more weights than there are sets (ours: it warns)",
            "",
            f"{net.n_parameters_} for {net.n_patterns_}; {net.caution_ or 'no warning'}",
        ),
        shown(
            ("C-24",),
            "Slope on another day that was not learned: RMS left (ours)",
            "",
            f"{other:.2f} um/m; " + ", ".join(f"{m} {left[m]:.2f}" for m in found.fits) + " um/m",
        ),
        *law.claims(found.law),
        _lateral(found),
    ]


def _lateral(found: Positioning) -> Claim:
    """Judge the error of a dimension over the whole travel, on the day that was not learned."""
    left = lateral(found)
    best = left[NONE] / min(left[MRA], left[NET])
    slopes = {m: found.left(fit, found.other) for m, fit in found.fits.items()}
    after = ", ".join(f"{m} {left[m]:.1f}" for m in found.fits)
    return judged(
        ("C-35",),
        "Errors of dimensions along Y shrink by a factor of ten or more. Here: largest error of a length of the whole "
        "travel on another day",
        f"{LATERAL[0]} -> {LATERAL[1]} um, {LATERAL[0] / LATERAL[1]:.1f} times",
        f"{left[NONE]:.1f} um; {after} um: {best:.1f} times",
        best >= TENFOLD,
        f"even the measured slope leaves {left[MEASURED]:.1f} um; the temperatures tell the slope to "
        f"{min(slopes[MRA], slopes[NET]):.2f} um/m (RMS)",
    )


def residuals(found: Positioning, day: Profiles) -> dict[str, FloatArray]:
    """Return what each method leaves of the profiles of a day, cold profile taken off, (n_states, n_points) [um]."""
    thermal, k1 = day.values - found.geometric(day), found.slope(day)
    slopes = {m: found.predicted(fit, day) for m, fit in found.fits.items()} | {MEASURED: k1}
    return {NONE: thermal} | {m: thermal - along(day, slope) for m, slope in slopes.items()}


def along(day: Profiles, slope: FloatArray) -> FloatArray:
    """Return slope times position, shape (n_states, n_points) [um]."""
    return 1e-3 * np.outer(slope, day.position)


def lateral(found: Positioning) -> dict[str, float]:
    """Return the largest error of a length of the whole travel on the other day, per method [um]."""
    return {m: float(np.abs(e[:, -1] - e[:, 0]).max()) for m, e in residuals(found, found.other).items()}


def numbers(found: Positioning) -> dict[str, float]:
    """Return the figures that a page can assert."""
    short = {NONE: "none", MRA: "mra", NET: "net", DYNAMIC: "dynamic", MEASURED: "measured"}
    r = found.regression
    made = {"slope_sets": float(r.n_rows_), "slope_candidates": float(len(r.candidates_)), "slope_r2_mra": r.r_squared_}
    made |= {"slope_terms": float(len(r.terms_)), "slope_r2_net": float(np.median(found.net_r2))}
    made |= {f"lateral_{short[m]}_um": e for m, e in lateral(found).items()}
    return made | law.numbers(found.law)


# -- tables and figures --------------------------------------------------------------------------------------------


def tables(found: Positioning) -> list[Table]:
    """Return Eq. 6 and Eq. 8 beside ours, the planted law, and the error without and with compensation."""
    learned = found.learned
    ours = dict(zip(found.regression.terms_, found.regression.coef_.tolist(), strict=True))
    # in plain mm, as the paper's
    cold = np.polynomial.polynomial.polyfit(learned.position, found.geometric(learned), EQ6.degree())
    eq6 = [
        [f"y^{k}", f"{1e-3 * c:.3e}", f"{1e-3 * p:.3e}"]
        for k, (c, p) in enumerate(zip(cold, EQ6.coef.tolist(), strict=True))
    ]
    eq8 = [[t, *(f"{c[t]:.3f}" if t in c else "" for c in (ours, EQ8))] for t in {**ours, **EQ8}]
    errors = {}
    for day, what in ((learned, "learned"), (found.other, "another day")):
        errors[what, NONE] = day.values
        errors |= {(what, "cold profile alone" if m == NONE else m): e for m, e in residuals(found, day).items()}
    return [
        Table("Cold profile [mm, y in mm] here and in Eq. 6", ("term", "here", "Eq. 6"), eq6),
        Table("Slope of Y: coefficients [um/m per degC, degC2] here and in Eq. 8", ("term", "here", "Eq. 8"), eq8),
        common.errors_table("Positioning of Y, all profiles: error without and with compensation", errors),
        *law.tables(found.law),
    ]


def figures(found: Positioning) -> list[Figure]:
    """Return Figs. 1, 6, 7 and 13."""
    learned, k1 = found.learned, found.slope(found.learned)
    hours = learned.states.time / 3600.0
    peak = int(np.abs(k1).argmax())
    states = [*np.linspace(0, peak, 5).round().astype(int).tolist(), len(hours) - 1]
    drawn = []
    for number, day, text, label in (
        (1, found.pitch, "pitch of Y (the paper shows its yaw)", "pitch of Y [urad]"),
        (6, learned, "positioning errors of Y", "positioning error of Y [um]"),
    ):
        curves = [Curve(f"after {hours[k]:.1f} h", day.position, day.values[k]) for k in states]
        panel = Panel("", "position of Y [mm]", label, curves)
        drawn.append(_figure(number, f"{text} in several thermal states.", panel))
    for number, method in ((7, MRA), (13, NET)):
        fit = found.predicted(found.fits[method], learned)
        curves = [Curve("measured", hours, k1, "points"), Curve(method, hours, fit)]
        panel = Panel("", "time [h]", "slope [um/m]", curves)
        drawn.append(_figure(number, f"slope of the positioning error of Y, and the fit by the {method}.", panel))
    return drawn


def _figure(number: int, text: str, panel: Panel) -> Figure:
    return Figure(f"chen1996-fig{number}", f"Fig. {number}: {text}", [panel])
