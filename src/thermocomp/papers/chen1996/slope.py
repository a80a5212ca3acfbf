"""Chen, Yuan, Ni 1996, sections 3.3 and 4.3: the positioning error of Y, cold profile plus a slope that drifts."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.mra import StepwiseMRA
from thermocomp.models.training import train
from thermocomp.papers import common
from thermocomp.papers.chen1996.setup import (
    CLOSELY,
    DIFFERENCES,
    SLOPE_VARIABLES,
    SPEED,
    TEMPERATURES,
    TENFOLD,
    recordings,
)
from thermocomp.papers.common import Errors, judged, shown
from thermocomp.papers.study import Claim, Curve, Figure, Panel, Table
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples, stack

FloatArray = NDArray[np.float64]

#: Eq. 6 (C-22): mm, for y in mm, constant first
EQ6 = (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)
#: Eq. 8 (C-24; T7-T9 by E-C4): um/m per degC (E-C6)
EQ8 = {"T3": 0.465, "T4": 2.705, "(T6-T8)": 3.675, "(T7-T9)": -5.589}
#: sets, unscreened and screened coefficients (C-23)
SETS, CANDIDATES = 51, 20
#: error of a dimension along Y before and after compensation [um] (C-35)
LATERAL = (92.4, 7.2)
#: the 5-8-1 net (C-27), and how often it is trained
HIDDEN, STARTS = 8, 5
#: share of the thermal part beside its straight line up to which the line is enough (C-05)
STRAIGHT = 0.1
NONE, MRA, NET, DYNAMIC, MEASURED = "no compensation", "MRA", "net", "dynamic (ours)", "measured slope"


@dataclass(frozen=True, eq=False)
class Profiles:
    """Profiles of the positioning error of Y, measured one after the other.

    Parameters
    ----------
    recording : Recording
    positions : ndarray of shape (n_positions,)
        [mm]
    errors : ndarray of shape (n_profiles, n_positions)
        [um]
    geometric : ndarray of shape (n_positions,)
        Positioning error of the cold machine, by its polynomial [um].
    """

    recording: Recording
    positions: FloatArray
    errors: FloatArray
    geometric: FloatArray

    @property
    def thermal(self) -> FloatArray:
        """What is not geometric, shape (n_profiles, n_positions) [um] (C-07)."""
        return self.errors - self.geometric

    @property
    def slope(self) -> FloatArray:
        """Slope k1 of the thermal part through position 0, shape (n_profiles,) [um/m] (Eq. 2; C-04, E-C6)."""
        return 1e3 * (self.thermal @ self.positions) / (self.positions @ self.positions)

    def along(self, slope: FloatArray) -> FloatArray:
        """Return slope times position, shape (n_profiles, n_positions) [um]."""
        return 1e-3 * np.outer(slope, self.positions)

    @cached_property
    def samples(self) -> Samples:
        """Temperatures, their differences and the speed; target k1."""
        table = self.recording.table.assign(k1=self.slope)
        channels = (*self.recording.channels, Channel("k1", "angle", "urad", "slope of the positioning of Y"))  # = um/m
        made = replace(self.recording, table=table, channels=channels)
        differences = {f"{plus}-{minus}": {plus: 1.0, minus: -1.0} for plus, minus in DIFFERENCES[2:]}
        for name, weights in differences.items():
            made = common.derived(made, Channel(name, "temperature", "degC"), weights)
        return stack([made], ["k1"], (*TEMPERATURES, *differences, *SPEED))


@dataclass(frozen=True, eq=False)
class Slopes:
    """What was learned from the profiles of one test, and those of another day.

    Parameters
    ----------
    learned, other : Profiles
        The 51 sets, and the same test on another day, with the geometric part of the first.
    polynomial : ndarray of shape (6,)
        Of the cold profile, constant first [um, mm].
    regression : StepwiseMRA
    nets : sequence of SigmoidNet
        5-8-1, each from another start.
    models : mapping of str to ErrorModel
        One of each method; of the nets the one with the median error after training.
    linear : ErrorModel
        By stepwise regression on first-order terms alone.
    """

    learned: Profiles
    other: Profiles
    polynomial: FloatArray
    regression: StepwiseMRA
    nets: Sequence[SigmoidNet]
    models: Mapping[str, ErrorModel]
    linear: ErrorModel

    @cached_property
    def net_r2(self) -> FloatArray:
        """R2 of the nets about zero, shape (n_starts,)."""
        change, slope = self.learned.samples.only(SLOPE_VARIABLES).frame(), self.learned.slope
        return np.array([_r2(slope, n.predict(change)) for n in self.nets])


def learn(seed: int, other_seed: int) -> Slopes:
    """Run the test on two days and fit what the paper fits to the first.

    Parameters
    ----------
    seed, other_seed : int
        Of weather and noise on the two days.

    Returns
    -------
    Slopes
    """
    (first,), (second,) = recordings("chen1996-slope", seed), recordings("chen1996-slope", other_seed)
    positions, errors = profiles(first, "displacement")
    fit = np.polynomial.Polynomial.fit(positions, errors[0], len(EQ6) - 1)
    learned = Profiles(first, positions, errors, fit(positions))
    other = Profiles(second, positions, profiles(second, "displacement")[1], fit(positions))

    heat = learned.samples.only(TEMPERATURES)
    # The two regressions differ in their candidates only.
    regression, straight = (
        StepwiseMRA(differences=DIFFERENCES, subset=SLOPE_VARIABLES, second_order=second) for second in (True, False)
    )
    model, linear = (common.fitted(r, heat, ["k1"])["k1"] for r in (regression, straight))
    nets = [SigmoidNet(hidden=HIDDEN, seed=start) for start in range(STARTS)]
    variables = learned.samples.only(SLOPE_VARIABLES)
    frozen: list[dict[str, ErrorModel]] = Parallel(n_jobs=-1, prefer="threads")(
        delayed(common.fitted)(net, variables, ["k1"]) for net in nets
    )
    typical = int(np.argsort([n.loss_history_[-1] for n in nets])[STARTS // 2])
    every = np.ones(len(heat), dtype=np.bool_)
    dynamic = train("dynamic", learned.samples.only((*TEMPERATURES, *SPEED)), 0, every).model
    models = {MRA: model, NET: frozen[typical]["k1"], DYNAMIC: dynamic}
    return Slopes(learned, other, np.asarray(fit.convert().coef, dtype=np.float64), regression, nets, models, linear)


def profiles(recording: Recording, quantity: str) -> tuple[FloatArray, FloatArray]:
    """Return positions [mm] and profiles, (n_rows, n_positions), of the channels named ``.._POSITION_UNIT``.

    Parameters
    ----------
    recording : Recording
    quantity : {'displacement', 'angle'}

    Returns
    -------
    positions : ndarray of shape (n_positions,)
        [mm]
    profiles : ndarray of shape (n_rows, n_positions)
        [um or urad]
    """
    found = {c: re.search(r"_(\d+)_[a-z]+$", c.name) for c in recording.of_quantity(quantity)}
    places = {c: float(match[1]) for c, match in found.items() if match}
    return np.array(list(places.values())), recording.values(list(places))


def _r2(measured: FloatArray, predicted: FloatArray) -> float:
    """Return R2 about zero, as of a regression without constant (E-C10)."""
    return float(1 - np.sum((measured - predicted) ** 2) / np.sum(measured**2))


# -- claims --------------------------------------------------------------------------------------------------------


def claims(found: Slopes) -> list[Claim]:
    """Judge what the paper says about the profiles, by criteria that were fixed beforehand."""
    learned, regression = found.learned, found.regression
    cold = 1e3 * np.polynomial.Polynomial(EQ6)(learned.positions)
    apart, lowest, highest = Errors.of(learned.geometric - cold), learned.geometric.min(), learned.geometric.max()
    bent = Errors.of(learned.thermal - learned.along(learned.slope)).rms / Errors.of(learned.thermal).rms
    second = [t for t in regression.terms_ if "*" in t]
    r2_net = float(np.median(found.net_r2))
    slope = Errors.of(learned.slope)
    left = {m: Errors.of(_left(model, found.other)).rms for m, model in (*found.models.items(), ("", found.linear))}
    net = found.nets[0]
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
            f"{len(learned.slope)}, {len(regression.candidates_)}",
        ),
        judged(
            ("C-23", "C-24"),
            "Stepwise regression needs neither higher-order nor product terms",
            f"{', '.join(EQ8)}",
            ", ".join(regression.terms_),
            not second,
            f"{', '.join(second)} came in; on another day this model leaves {left[MRA]:.2f} um/m (RMS) and one of "
            f"first-order terms alone {left['']:.2f}, of slopes of {Errors.of(found.other.slope).rms:.1f}",
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
            f"after {net.n_epochs} epochs of {len(learned.slope)} patterns it is no nearer",
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
            f"{Errors.of(found.other.slope).rms:.2f} um/m; "
            + ", ".join(f"{m} {left[m]:.2f}" for m in found.models)
            + " um/m",
        ),
        _lateral(found),
    ]


def _lateral(found: Slopes) -> Claim:
    """Judge the error of a dimension over the whole travel, on the day that was not learned."""
    left = lateral(found)
    best = left[NONE] / min(left[MRA], left[NET])
    slopes = {m: Errors.of(_left(model, found.other)).rms for m, model in found.models.items()}
    after = ", ".join(f"{m} {left[m]:.1f}" for m in found.models)
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


def lateral(found: Slopes) -> dict[str, float]:
    """Return the largest error of a length of the whole travel on the other day, per method [um]."""
    day = found.other
    slopes = {NONE: 0.0 * day.slope, MEASURED: day.slope}
    slopes |= {m: common.predicted(model, day.samples) for m, model in found.models.items()}
    left = {m: day.thermal - day.along(slope) for m, slope in slopes.items()}
    return {m: float(np.abs(e[:, -1] - e[:, 0]).max()) for m, e in left.items()}


def _left(model: ErrorModel, day: Profiles) -> FloatArray:
    return day.slope - common.predicted(model, day.samples)


def numbers(found: Slopes) -> dict[str, float]:
    """Return the figures that a page can assert."""
    short = {NONE: "none", MRA: "mra", NET: "net", DYNAMIC: "dynamic", MEASURED: "measured"}
    r = found.regression
    made = {"slope_sets": float(r.n_rows_), "slope_candidates": float(len(r.candidates_)), "slope_r2_mra": r.r_squared_}
    made |= {"slope_terms": float(len(r.terms_)), "slope_r2_net": float(np.median(found.net_r2))}
    made |= {f"lateral_{short[m]}_um": e for m, e in lateral(found).items()}
    return made


# -- tables and figures --------------------------------------------------------------------------------------------


def tables(found: Slopes) -> list[Table]:
    """Return Eq. 6 and Eq. 8 beside ours, and the error of the profiles without and with compensation."""
    ours = dict(zip(found.regression.terms_, found.regression.coef_.tolist(), strict=True))
    eq6 = [
        [f"y^{k}", f"{1e-3 * c:.3e}", f"{p:.3e}"] for k, (c, p) in enumerate(zip(found.polynomial, EQ6, strict=True))
    ]
    eq8 = [[t, *(f"{c[t]:.3f}" if t in c else "" for c in (ours, EQ8))] for t in {**ours, **EQ8}]
    residuals = {}
    for day, what in ((found.learned, "learned"), (found.other, "another day")):
        residuals[what, NONE] = day.errors
        residuals[what, "cold profile alone"] = day.thermal
        for method, model in found.models.items():
            residuals[what, method] = day.thermal - day.along(common.predicted(model, day.samples))
        residuals[what, MEASURED] = day.thermal - day.along(day.slope)
    return [
        Table("Cold profile [mm, y in mm] here and in Eq. 6", ("term", "here", "Eq. 6"), eq6),
        Table("Slope of Y: coefficients [um/m per degC, degC2] here and in Eq. 8", ("term", "here", "Eq. 8"), eq8),
        common.errors_table("Positioning of Y, all profiles: error without and with compensation", residuals),
    ]


def figures(found: Slopes) -> list[Figure]:
    """Return Figs. 1, 6, 7 and 13."""
    learned = found.learned
    hours = learned.recording.time / 3600.0
    peak = int(np.abs(learned.slope).argmax())
    states = [*np.linspace(0, peak, 5).round().astype(int).tolist(), len(hours) - 1]
    drawn = []
    for number, quantity, text, label in (
        (1, "angle", "pitch of Y (the paper shows its yaw)", "pitch of Y [urad]"),
        (6, "displacement", "positioning errors of Y", "positioning error of Y [um]"),
    ):
        positions, values = profiles(learned.recording, quantity)
        if positions.size:
            curves = [Curve(f"after {hours[k]:.1f} h", positions, values[k]) for k in states]
            panel = Panel("", "position of Y [mm]", label, curves)
            drawn.append(_figure(number, f"{text} in several thermal states.", panel))
    for number, method in ((7, MRA), (13, NET)):
        fit = common.predicted(found.models[method], learned.samples)
        curves = [Curve("measured", hours, learned.slope, "points"), Curve(method, hours, fit)]
        panel = Panel("", "time [h]", "slope [um/m]", curves)
        drawn.append(_figure(number, f"slope of the positioning error of Y, and the fit by the {method}.", panel))
    return drawn


def _figure(number: int, text: str, panel: Panel) -> Figure:
    return Figure(f"chen1996-fig{number}", f"Fig. {number}: {text}", [panel])
