"""Chen, Yuan, Ni 1996, sections 3.3 and 4.3: positioning error of Y as a cold profile plus a drifting slope."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import law, setup
from thermocomp.papers.chen1996.law import HIDDEN, Law, r2_about_zero
from thermocomp.papers.chen1996.setup import CLOSELY, EQ6, EQ8, SLOPE_VARIABLES, recordings, with_differences
from thermocomp.papers.chen1996.show import beside, figure
from thermocomp.papers.common import PAPERS_SUPPORT, Errors, rms
from thermocomp.papers.pictures import curves
from thermocomp.papers.study import Claims, Figure, FloatArray, Ours, PlotCurve, StudyTable
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.readers.profiles import from_recording
from thermocomp.volumetric.models.position import PositionFit, PositionOptions, fit_position, slope_samples

#: numbers of sets, unscreened and screened coefficients (C-23)
SETS, CANDIDATES = 51, 20
#: error of a dimension along Y before and after compensation [um] (C-35)
LATERAL = (92.4, 7.2)
#: number of trainings of the 5-8-1 net (C-27)
STARTS = 5
#: maximum nonlinear share of the thermal part for a straight line to be sufficient (C-05)
STRAIGHT = 0.1
NONE, MRA, NET, DYNAMIC, MEASURED = "no compensation", "MRA", "net", "dynamic (ours)", "measured slope"


@dataclass(frozen=True, eq=False)
class LearnedPositioning:
    """Models learned from the profiles of one test, and profiles of another day.

    Parameters
    ----------
    learned, other : Profiles
        EYY: the 51 training sets, and the same test on another day.
    pitch : Profiles
        EAY, measured together with `learned`.
    fits : mapping of str to PositionFit
        Fits to `learned` by method; for the nets the one with the median error after training.
    nets : sequence of PositionFit
        5-8-1 nets, each from other starting weights.
    linear : PositionFit
        Stepwise regression on first-order terms only.
    law : Law
        Recovery of a known (synthetic) law.
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
        """The fitted `SecondOrderRegression`."""
        return self.fits[MRA].trained[0].estimator

    @cached_property
    def net_r2(self) -> FloatArray:
        """R2 about zero of the nets, shape (n_starts,)."""
        return np.array([r2_about_zero(self.k1, n.trained[0].estimator.predict(n.samples.frame())) for n in self.nets])

    def geometric(self, day: Profiles) -> FloatArray:
        """Return the polynomial cold profile of `learned`, shape (n_points,) [um] (C-07, C-22)."""
        return self.fits[MRA].profile.profile.at(day.points)

    def slope(self, day: Profiles) -> FloatArray:
        """Return the slope k1 of the thermal part, through position 0, shape (n_states,) [um/m] (C-04, E-C6)."""
        thermal = day.values - self.geometric(day)
        return 1e3 * (thermal @ day.position) / (day.position @ day.position)

    def predicted(self, fit: PositionFit, day: Profiles) -> FloatArray:
        """Return the slope predicted by a model for a day, shape (n_states,) [um/m]."""
        model = fit.model.slopes[0]
        samples, _ = slope_samples([day], PositionOptions(inputs=[i.name for i in model.inputs]))
        return common.predict_deviation(model, samples)

    def left(self, fit: PositionFit) -> float:
        """Return the RMS residual of the slope with a model on the other day [um/m]."""
        return rms(self.slope(self.other) - self.predicted(fit, self.other))

    @cached_property
    def elsewhere(self) -> dict[str, float]:
        """RMS residuals of the slope on the other day, by method [um/m]."""
        return {m: self.left(fit) for m, fit in self.fits.items()}

    @property
    def k1(self) -> FloatArray:
        """Slope on the training day [um/m]."""
        return self.slope(self.learned)


def learn(seed: int, other_seed: int) -> LearnedPositioning:
    """Run the test on two days and fit the models of the paper to the first.

    Parameters
    ----------
    seed, other_seed : int
        Random seeds of weather and noise on the two days.

    Returns
    -------
    LearnedPositioning
    """
    (first,), (second,) = (map(with_differences, recordings("chen1996-slope", s)) for s in (seed, other_seed))
    learned, other = (from_recording(day, "EYY") for day in (first, second))
    paper = PositionOptions(order=EQ6.degree(), inputs=setup.TEMPERATURES, support=PAPERS_SUPPORT)
    # The two regressions differ only in their candidates.
    chens = partial(SecondOrderRegression, differences=setup.DIFFERENCES, subset=SLOPE_VARIABLES)
    regression, linear = (
        fit_position(learned, replace(paper, method=chens(second_order=second))) for second in (True, False)
    )
    nets: list[PositionFit] = Parallel(n_jobs=-1, prefer="threads")(
        delayed(fit_position)(
            learned, replace(paper, inputs=SLOPE_VARIABLES, method=SigmoidNet(hidden=HIDDEN, seed=start))
        )
        for start in range(STARTS)
    )
    typical = int(np.argsort([_net(n).loss_history_[-1] for n in nets])[STARTS // 2])
    ours = fit_position(
        learned, PositionOptions(order=EQ6.degree(), inputs=(*setup.TEMPERATURES, *setup.SPEED), method="dynamic")
    )
    fits = {MRA: regression, NET: nets[typical], DYNAMIC: ours}
    return LearnedPositioning(
        learned=learned,
        other=other,
        pitch=from_recording(first, "EAY"),
        fits=fits,
        nets=nets,
        linear=linear,
        law=law.seek(seed),
    )


def _net(fit: PositionFit) -> Any:
    return fit.trained[0].estimator


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[LearnedPositioning]()


@claims.add(
    "C-22 C-36",
    "A polynomial of fifth order describes the cold profile (the virtual machine's own is Eq. 6, so this tells "
    "only what the noise of the laser does)",
    "-18.5 .. 8.5 um",
)
def _cold(found: LearnedPositioning) -> str:
    geometric = found.geometric(found.learned)
    apart = np.abs(geometric - EQ6(found.learned.position)).max()
    return f"{geometric.min():.1f} .. {geometric.max():.1f} um, within {apart:.2f} um of Eq. 6"


@claims.add(
    "C-04 C-05 C-07",
    f"Only the slope of the profile varies: a straight line leaves at most {STRAIGHT:.0%} of its thermal part",
)
def _straight(found: LearnedPositioning) -> Ours:
    left = residuals(found, found.learned)
    bent = rms(left[MEASURED]) / rms(left[NONE])
    return Ours(
        f"{bent:.1%}",
        bent <= STRAIGHT,
        f"the screw does not warm evenly, and {bent:.1%} of the thermal part (RMS) is no straight line",
    )


@claims.add("C-23", f"{SETS} sets of slopes, {CANDIDATES} unscreened coefficients", f"{SETS}, {CANDIDATES}")
def _sets(found: LearnedPositioning) -> str:
    return f"{len(found.learned)}, {len(found.regression.candidates_)}"


@claims.add("C-23 C-24", "Stepwise regression needs neither higher-order nor product terms", f"{', '.join(EQ8)}")
def _terms(found: LearnedPositioning) -> Ours:
    terms = found.regression.terms_
    second = [t for t in terms if "*" in t]
    return Ours(
        ", ".join(terms),
        not second,
        f"{', '.join(second)} came in; on another day this model leaves {found.elsewhere[MRA]:.2f} um/m (RMS) and one "
        f"of first-order terms alone {found.left(found.linear):.2f}, of slopes of {rms(found.slope(found.other)):.1f}",
    )


@claims.add(
    "C-24 C-36",
    f"The regression fits the slopes closely in warm-up and cool-down (R2 >= {CLOSELY})",
    "Fig. 7",
)
def _closely(found: LearnedPositioning) -> Ours:
    return Ours(
        f"R2 {found.regression.r_squared_:.3f}",
        round(found.regression.r_squared_, 3) >= CLOSELY,
        f"standard error of estimate {found.regression.standard_error_:.2f} um/m beside slopes of up to "
        f"{Errors.of(found.k1).max_abs:.1f} um/m",
    )


@claims.add("C-27 C-36", f"The 5-8-1 net can also fit the slopes (R2 >= {CLOSELY})", "Fig. 13")
def _net_closely(found: LearnedPositioning) -> Ours:
    r2 = float(np.median(found.net_r2))
    return Ours(
        f"R2 {r2:.3f} ({found.net_r2.min():.3f}-{found.net_r2.max():.3f})",
        round(r2, 3) >= CLOSELY,
        f"after {_net(found.nets[0]).n_epochs} epochs of {len(found.learned)} patterns it is no nearer",
    )


@claims.add("C-27", "The net has more weights than there are sets (ours: it warns)")
def _weights(found: LearnedPositioning) -> str:
    net = _net(found.nets[0])
    return f"{net.n_parameters_} for {net.n_patterns_}; {net.caution_ or 'no warning'}"


@claims.add("C-24", "Slope on another day that was not learned: RMS left (ours)")
def _elsewhere(found: LearnedPositioning) -> str:
    left = ", ".join(f"{m} {e:.2f}" for m, e in found.elsewhere.items())
    return f"{rms(found.slope(found.other)):.2f} um/m; {left} um/m"


claims.include(law.claims, lambda found: found.law)


@claims.add(
    "C-35",
    "Errors of dimensions along Y shrink by a factor of ten or more. Here: largest error of a length of the whole "
    "travel on another day",
    f"{LATERAL[0]} -> {LATERAL[1]} um, {LATERAL[0] / LATERAL[1]:.1f} times",
)
def _lateral(found: LearnedPositioning) -> Ours:
    left = largest_length_error(found)
    best = left[NONE] / min(left[MRA], left[NET])
    after = ", ".join(f"{m} {left[m]:.1f}" for m in found.fits)
    return Ours(
        f"{left[NONE]:.1f} um; {after} um: {best:.1f} times",
        best >= setup.TENFOLD,
        f"even the measured slope leaves {left[MEASURED]:.1f} um; the temperatures tell the slope to "
        f"{min(found.elsewhere[MRA], found.elsewhere[NET]):.2f} um/m (RMS)",
    )


def residuals(found: LearnedPositioning, day: Profiles) -> dict[str, FloatArray]:
    """Return the residuals of each method for a day's profiles minus the cold profile, (n_states, n_points) [um]."""
    thermal, k1 = day.values - found.geometric(day), found.slope(day)
    slopes = {m: found.predicted(fit, day) for m, fit in found.fits.items()} | {MEASURED: k1}
    return {NONE: thermal} | {m: thermal - 1e-3 * np.outer(slope, day.position) for m, slope in slopes.items()}


def largest_length_error(found: LearnedPositioning) -> dict[str, float]:
    """Return the largest length error over the whole travel on the other day, by method [um]."""
    return {m: float(np.abs(e[:, -1] - e[:, 0]).max()) for m, e in residuals(found, found.other).items()}


def numbers(found: LearnedPositioning) -> dict[str, float]:
    """Return the numbers asserted by the documentation."""
    short = {NONE: "none", MRA: "mra", NET: "net", DYNAMIC: "dynamic", MEASURED: "measured"}
    r = found.regression
    made = {"slope_sets": float(r.n_rows_), "slope_candidates": float(len(r.candidates_)), "slope_r2_mra": r.r_squared_}
    made |= {"slope_terms": float(len(r.terms_)), "slope_r2_net": float(np.median(found.net_r2))}
    made |= {f"lateral_{short[m]}_um": e for m, e in largest_length_error(found).items()}
    return made | law.numbers(found.law)


# -- tables and figures ------------------------------------------------------------------------------------------------


def tables(found: LearnedPositioning) -> list[StudyTable]:
    """Return Eq. 6 and Eq. 8 next to our coefficients, the known law, and the errors with and without compensation."""
    learned = found.learned
    ours = dict(zip(found.regression.terms_, found.regression.coef_.tolist(), strict=True))
    # in powers of mm, as in the paper
    cold = np.polynomial.polynomial.polyfit(learned.position, found.geometric(learned), EQ6.degree())
    eq6 = [
        [f"y^{k}", f"{1e-3 * c:.3e}", f"{1e-3 * p:.3e}"]
        for k, (c, p) in enumerate(zip(cold, EQ6.coef.tolist(), strict=True))
    ]
    errors = {}
    for day, what in ((learned, "learned"), (found.other, "another day")):
        errors[what, NONE] = day.values
        errors |= {(what, "cold profile alone" if m == NONE else m): e for m, e in residuals(found, day).items()}
    return [
        StudyTable("Cold profile [mm, y in mm] here and in Eq. 6", ("term", "here", "Eq. 6"), eq6),
        beside("Slope of Y: coefficients [um/m per degC, degC2]", "Eq. 8", ours, EQ8),
        common.errors_table("Positioning of Y, all profiles: error without and with compensation", errors),
        *law.tables(found.law),
    ]


def figures(found: LearnedPositioning) -> list[Figure]:
    """Return Figs. 1, 6, 7 and 13."""
    learned, k1 = found.learned, found.k1
    hours = learned.states.time / 3600.0
    peak = int(np.abs(k1).argmax())
    states = [*np.linspace(0, peak, 5).round().astype(int).tolist(), len(hours) - 1]
    drawn = []
    for number, day, text, label in (
        (1, found.pitch, "pitch of Y (the paper shows its yaw)", "pitch of Y [urad]"),
        (6, learned, "positioning errors of Y", "positioning error of Y [um]"),
    ):
        profiles = [PlotCurve(f"after {hours[k]:.1f} h", day.position, day.values[k]) for k in states]
        drawn.append(figure(number, f"{text} in several thermal states.", ("position of Y [mm]", label), profiles))
    for number, method in ((7, MRA), (13, NET)):
        slopes = {"measured": k1, method: found.predicted(found.fits[method], learned)}
        text = f"slope of the positioning error of Y, and the fit by the {method}."
        lines = curves(hours, slopes, points=["measured"])
        drawn.append(figure(number, text, ("time [h]", "slope [um/m]"), lines))
    return drawn
