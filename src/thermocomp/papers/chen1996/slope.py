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
from thermocomp.papers.chen1996.drift import beside
from thermocomp.papers.chen1996.law import HIDDEN, Law, r2_about_zero
from thermocomp.papers.chen1996.setup import CLOSELY, EQ6, EQ8, SLOPE_VARIABLES, exhibits, recordings, with_differences
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import PAPERS_SUPPORT, Errors, rms
from thermocomp.papers.study import Claim, Figure, FloatArray, PlotCurve, StudyTable
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.readers.profiles import from_recording
from thermocomp.volumetric.models.position import PositionFit, PositionOptions, fit_position, slope_samples

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
    yaw : Profiles
        ECY, measured together with `learned`.
    fits : mapping of str to PositionFit
        Fits to `learned` by method; for the nets the one with the median error after training.
    nets : sequence of PositionFit
        5-8-1 nets, each from different starting weights.
    linear : PositionFit
        Stepwise regression on first-order terms only.
    law : Law
        Recovery of a known (synthetic) law.
    """

    learned: Profiles
    other: Profiles
    yaw: Profiles
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
        """Uncentred R2 of each neural net, shape (n_starts,)."""
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

    @property
    def other_slopes(self) -> float:
        """RMS of the slope k1 on the day not used for training [um/m]."""
        return rms(self.slope(self.other))

    @cached_property
    def elsewhere(self) -> dict[str, float]:
        """RMS residuals of the slope k1 on the day not used for training, by method [um/m]."""
        return {m: self.left(fit) for m, fit in self.fits.items()}

    @property
    def k1(self) -> FloatArray:
        """Slope k1 of each profile on the day used for training [um/m]."""
        return self.slope(self.learned)


def learn(seed: int, other_seed: int) -> LearnedPositioning:
    """Run the test on two days and fit the models of the paper to the first."""
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
        yaw=from_recording(first, "ECY"),
        fits=fits,
        nets=nets,
        linear=linear,
        law=law.seek(seed),
    )


def _net(fit: PositionFit) -> Any:
    return fit.trained[0].estimator


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[LearnedPositioning](__name__, law)
length = Claims[LearnedPositioning](__name__, setup, section="length")


def judge(found: LearnedPositioning) -> tuple[Claim, ...]:
    """Return all claims, in order: positioning, known law, length error."""
    return claims(found) + law.claims(found.law) + length(found)


@claims.facts
def _cold(found: LearnedPositioning) -> Facts:
    geometric = found.geometric(found.learned)
    apart = np.abs(geometric - EQ6(found.learned.position)).max()
    return {"least": geometric.min(), "most": geometric.max(), "apart": apart}


@claims.facts
def _straight(found: LearnedPositioning) -> Facts:
    left = residuals(found, found.learned)
    return {"bent": rms(left[MEASURED]) / rms(left[NONE])}


@claims.facts
def _terms(found: LearnedPositioning) -> Facts:
    second = [t for t in found.regression.terms_ if "*" in t]
    return {"second": second, "holds": not second, "first": found.left(found.linear), "slopes": found.other_slopes}


@claims.facts
def _closely(found: LearnedPositioning) -> Facts:
    holds = round(found.regression.r_squared_, 3) >= CLOSELY
    return {"holds": holds, "steepest": Errors.of(found.k1).max_abs}


@claims.facts
def _net_closely(found: LearnedPositioning) -> Facts:
    r2 = float(np.median(found.net_r2))
    facts = {"r2": r2, "least": found.net_r2.min(), "most": found.net_r2.max(), "net": _net(found.nets[0])}
    return facts | {"holds": round(r2, 3) >= CLOSELY}


@claims.facts
def _weights(found: LearnedPositioning) -> Facts:
    net = _net(found.nets[0])
    return {"net": net, "caution": net.caution_ or "no warning"}


@claims.facts
def _another_day(found: LearnedPositioning) -> Facts:
    return {"slopes": found.other_slopes, "left": found.elsewhere}


@length.facts
def _lateral(found: LearnedPositioning) -> Facts:
    errors = largest_length_error(found)
    told = min(found.elsewhere[MRA], found.elsewhere[NET])
    best = errors[NONE] / min(errors[MRA], errors[NET])
    return {"errors": errors, "after": {m: errors[m] for m in found.fits}, "best": best, "told": told}


def residuals(found: LearnedPositioning, day: Profiles) -> dict[str, FloatArray]:
    """Return the residuals of each method for a day's profiles minus the cold profile, (n_states, n_points) [um]."""
    thermal, k1 = day.values - found.geometric(day), found.slope(day)
    slopes = {m: found.predicted(fit, day) for m, fit in found.fits.items()} | {MEASURED: k1}
    return {NONE: thermal} | {m: thermal - 1e-3 * np.outer(slope, day.position) for m, slope in slopes.items()}


def largest_length_error(found: LearnedPositioning) -> dict[str, float]:
    """Return the largest length error over the whole travel on the other day, by method [um]."""
    return {m: float(np.abs(e[:, -1] - e[:, 0]).max()) for m, e in residuals(found, found.other).items()}


def numbers(found: LearnedPositioning) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    made = exhibits.numbers("slope", found, r2_net=np.median(found.net_r2), lateral=largest_length_error(found))
    return made | law.numbers(found.law)


# -- tables and figures ------------------------------------------------------------------------------------------------


def tables(found: LearnedPositioning) -> list[StudyTable]:
    """Return Eq. 6 and Eq. 8 next to our coefficients, the known law, and the errors with and without compensation."""
    learned = found.learned
    ours = dict(zip(found.regression.terms_, found.regression.coef_.tolist(), strict=True))
    # in powers of mm, as in the paper
    cold = np.polynomial.polynomial.polyfit(learned.position, found.geometric(learned), EQ6.degree())
    errors = {}
    for day, what in ((learned, "learned"), (found.other, "another day")):
        errors[what, NONE] = day.values
        errors |= {(what, "cold profile alone" if m == NONE else m): e for m, e in residuals(found, day).items()}
    return [
        exhibits.table(
            "cold", [(k, 1e-3 * c, 1e-3 * p) for k, (c, p) in enumerate(zip(cold, EQ6.coef.tolist(), strict=True))]
        ),
        exhibits.table("eq8", beside(ours, EQ8)),
        common.errors_table("Positioning of Y, all profiles: error without and with compensation", errors),
        *law.tables(found.law),
    ]


def figures(found: LearnedPositioning) -> list[Figure]:
    """Return the figures that correspond to Figs. 1, 6, 7 and 13 of the paper."""
    learned, k1 = found.learned, found.k1
    hours = learned.states.time / 3600.0
    peak = int(np.abs(k1).argmax())
    states = [*np.linspace(0, peak, 5).round().astype(int).tolist(), len(hours) - 1]
    yaw, errors = (
        [PlotCurve(f"after {hours[k]:.1f} h", day.position, day.values[k]) for k in states]
        for day in (found.yaw, learned)
    )
    mra, net = ({"measured": k1, m: found.predicted(found.fits[m], learned)} for m in (MRA, NET))
    return [
        exhibits.figure("chen1996-fig1", yaw, range=np.ptp(found.yaw.slopes(offset=True).factors[:, 1])),
        exhibits.figure("chen1996-fig6", errors),
        exhibits.figure("chen1996-fig7", (hours, mra)),
        exhibits.figure("chen1996-fig13", (hours, net)),
    ]
