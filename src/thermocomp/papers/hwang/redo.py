"""Reproduction of Hwang, Lee, Yang: correlation grouping, successive regression, collinearity, noise (H-01 to H-18)."""

from collections.abc import Sequence

import numpy as np

from thermocomp.models.selection.collinearity import Spectrum, contributions
from thermocomp.models.selection.grouping import group, interval_of
from thermocomp.papers.common import described, rms
from thermocomp.papers.hwang import setup, show
from thermocomp.papers.hwang.setup import JUDGED, LINEAR, NAMES, NONE, OPTIMAL, QUADRATIC, SAME, SINGLE, Computed, named
from thermocomp.papers.study import Claims, Ours, Part, Progress, Study

TITLE = "Hwang, Lee, Yang: Optimal variable selection in a thermal error model for real time error compensation"
TABLE_1 = [[k - 1 for k in g] for g in setup.TABLE_1]


def run(seed: int, progress: Progress) -> Study:
    """Reproduce the study.

    Parameters
    ----------
    seed : int
    progress : callable

    Returns
    -------
    Study
    """
    c = setup.compute(seed, progress)
    return Study.of("hwang", TITLE, Part(claims(c), show.tables(c), show.figures(c), _numbers(c)))


def _both(r_squared: float, error: float) -> str:
    return f"R2 {r_squared:.4f}, {error:.2f} um"


def _listed(groups: Sequence[Sequence[int]]) -> str:
    return ", ".join("{" + " ".join(str(k + 1) for k in sorted(g)) + "}" for g in groups)


# -- the choice of variables -------------------------------------------------------------------------------------------

claims = Claims[Computed]()


@claims.add("H-03 H-10 E-H1", "Correlation grouping makes the 8 groups of Table 1", _listed(TABLE_1))
def _groups(c: Computed) -> Ours:
    exact = interval_of(TABLE_1, [i for i, _ in c.swept])
    likest, _ = max(c.swept, key=lambda s: setup.agreement(s[0].groups))
    return Ours(
        f"thresholds from {exact.low:.4f} to {exact.high:.4f}" if exact else _listed(c.interval.groups),
        exact is not None,
        f"No threshold gives them. Ours are {len(c.interval.groups)} groups, for thresholds from "
        f"{c.interval.low:.4f} to {c.interval.high:.4f}; next to Table 1 come thresholds from {likest.low:.4f}, "
        f"where {setup.agreement(likest.groups):.0%} of all pairs of sensors are together or apart as there. Which "
        "sensors move alike depends on where the heat of a machine comes from, and on the places of its sensors.",
    )


@claims.add(
    "E-H2", "Pairs of temperatures whose correlation is negative, for which it matters whether it goes by its sign"
)
def _negative(c: Computed) -> Ours:
    g = c.grouped
    unsigned = group(g.correlation_, c.interval.low, absolute=True)
    return Ours(
        f"{int((np.triu(g.correlation_, 1) < 0).sum())} of {len(g.candidates_) * (len(g.candidates_) - 1) // 2}",
        note="By magnitude the groups are "
        + ("the same." if unsigned == c.interval.groups else f"others: {_listed(unsigned)}."),
    )


@claims.add("H-04", "Representatives of the groups that take part, by successive regression", "T7 T8 T2 T1")
def _representatives(c: Computed) -> str:
    g = c.grouped
    return named([r for r in g.representatives_ if any(r in g.groups_[k] for k in g.participating_)])


@claims.add("H-05 H-11", "The residual mean square is smallest with fewer variables than there are groups", "4 of 8")
def _fewer(c: Computed) -> Ours:
    g = c.grouped
    best = min(g.curve_, key=lambda s: s.mse)
    return Ours(
        f"{len(best.columns)} of {len(g.groups_)}",
        len(best.columns) < len(g.groups_),
        f"Each of the {len(g.groups_)} groups still lowers it: from {g.curve_[0].mse:.3g} um2 with one to "
        f"{best.mse:.3g} um2 with {max(len(s.columns) for s in g.curve_)}. The mean square takes the {len(c.fit)} rows "
        f"as independent; they are worth {c.worth:.0f}.",
    )


@claims.add("H-01 H-07", "Grouping leaves few models to try", "8191, grouped 255 + 4")
def _models(c: Computed) -> str:
    return f"{c.single.searched_[0]}, grouped {c.grouped.searched_[0]} + {c.grouped.searched_[1]}"


@claims.add("H-06 H-11 H-12", "The best variables", "T7 T8 T2 T6")
def _best(c: Computed) -> Ours:
    return Ours(named(c.grouped.selected_), note=f"z = {c.fits[OPTIMAL].model.formula()}")


@claims.add("H-08 H-09 E-H7", "Rows the models are fitted to", "about 32")
def _rows(c: Computed) -> str:
    return str(len(c.fit))


@claims.add("H-15", "Without grouping the model takes more variables", "7 instead of 4")
def _more(c: Computed) -> Ours:
    ours, without = c.grouped.selected_, c.single.selected_
    return Ours(
        f"{len(without)} instead of {len(ours)}: {named(without)}",
        len(without) > len(ours),
        "The smallest mean square needs no more of them here.",
    )


# -- accuracy ----------------------------------------------------------------------------------------------------------


def _worse(ratio: float, c: Computed) -> str:
    judged, ours = (
        " ".join(n for n in c.fits[model].model.sensors if n != setup.REFERENCE) for model in (JUDGED, OPTIMAL)
    )
    return (
        f"{ratio:.2f} times the error of the engineering judgement model. That one takes {judged}, "
        f"ours {ours}: the grouping chooses by the fit to {len(c.fit)} rows of one test."
    )


@claims.add(
    "H-12 H-13",
    "The linear model fits as well as the engineering judgement model with its squares "
    f"(criterion: standard error at most {SAME:g} times)",
    f"{_both(*setup.TABLE_2['optimal'])}; with squares {_both(*setup.TABLE_2['judgement'])}",
)
def _fits(c: Computed) -> Ours:
    ours, judged = c.fits[OPTIMAL], c.fits[JUDGED]
    return Ours(
        f"{_both(ours.r_squared, ours.error)}; with squares {_both(judged.r_squared, judged.error)}",
        ours.error <= SAME * judged.error,
        _worse(ours.error / judged.error, c),
    )


@claims.add(
    "H-12 H-13",
    f"Likewise on new tests (Fig. 5): here {setup.NEW}, with other orders of the states and other weather "
    f"(criterion: RMS at most {SAME:g} times)",
    f"R2 {setup.TABLE_2['optimal'][0]}",
)
def _predicts(c: Computed) -> Ours:
    z, ours, judged = (c.residuals[name] for name in (NONE, OPTIMAL, JUDGED))
    return Ours(
        f"R2 {described(ours, z):.4f}, RMS {rms(ours):.2f} um; with squares R2 {described(judged, z):.4f}, "
        f"RMS {rms(judged):.2f} um; without compensation {rms(z):.2f} um",
        rms(ours) <= SAME * rms(judged),
        _worse(rms(ours) / rms(judged), c),
    )


@claims.add("H-15 E-H10", "Not in the paper: RMS on new tests with grouping, and without")
def _costs(c: Computed) -> Ours:
    new, lonely = rms(c.residuals[OPTIMAL]), rms(c.residuals[SINGLE])
    cost = (
        f"Grouping costs accuracy here: {new / lonely:.2f} times the error, for {len(c.grouped.selected_)} "
        f"sensors instead of {len(c.single.selected_)}. The noise of the sensors is small beside the drift, so "
        "badly determined coefficients do little harm as long as the temperatures go together as they did."
    )
    return Ours(f"{new:.2f} um, without {lonely:.2f} um", note="" if new <= lonely else cost)


@claims.add("E-C12", "Independent rows that the fit is worth")
def _worth(c: Computed) -> Ours:
    return Ours(
        f"{c.worth:.0f} of {len(c.fit)}", note="R2, standard error and mean square take all rows as independent."
    )


# -- collinearity ------------------------------------------------------------------------------------------------------

WITH_PAPER, WITHOUT_PAPER = (Spectrum(t) for t in setup.TABLE_3)


@claims.add(
    "H-14 H-16",
    "Grouping raises the smallest eigenvalue of X'X and lowers the sum of 1/eigenvalue, the variance of the "
    "coefficients",
    f"smallest {WITH_PAPER.smallest:g} instead of {WITHOUT_PAPER.smallest:g}, "
    f"sum {WITH_PAPER.sum_inverse:.3f} instead of {WITHOUT_PAPER.sum_inverse:.1f}",
)
def _collinearity(c: Computed) -> Ours:
    with_, without = c.grouped.spectrum_, c.single.spectrum_
    better = with_.smallest > without.smallest and with_.sum_inverse < without.sum_inverse
    compared = [g.spectrum_.smallest > without.smallest for _, g in c.swept if g.selected_ != c.single.selected_]
    others = f"at {sum(compared)} of {len(compared)} thresholds that lead to another model than no grouping"
    lessened = (
        f"So {others}. Collinearity is lessened, not gone (E-H10): condition number {with_.condition_number:.2g} "
        f"instead of {without.condition_number:.2g} (paper {WITH_PAPER.condition_number:.2g} and "
        f"{WITHOUT_PAPER.condition_number:.2g})."
    )
    return Ours(
        f"smallest {with_.smallest:.3g} instead of {without.smallest:.3g}, sum {with_.sum_inverse:.3g} instead of "
        f"{without.sum_inverse:.3g}",
        better,
        f"The two models have {len(c.grouped.selected_)} and {len(c.single.selected_)} variables. A{others[1:]} the "
        "smallest eigenvalue is larger.",
        note=lessened if better else "",
    )


@claims.add(
    "H-17",
    "The temperatures of the spindle, T7 and T8, have most to do with the drift: their correlation with it is "
    "above that of T2 and T6",
    ", ".join(f"{n} {v}" for n, v in setup.EQUATION_9.items()),
)
def _contributions(c: Computed) -> Ours:
    r = dict(zip(NAMES[:13], contributions(c.change, c.drift).tolist(), strict=True))
    top = sorted(r, key=lambda n: -abs(r[n]))[:4]
    ours = zip(c.grouped.selected_, c.grouped.contributions_, strict=True)
    return Ours(
        ", ".join(f"{n} {r[n]:.4f}" for n in setup.EQUATION_9),
        min(abs(r["T7"]), abs(r["T8"])) > max(abs(r["T2"]), abs(r["T6"])),
        note=f"Of all 13 the most: {', '.join(f'{n} {r[n]:.4f}' for n in top)}. "
        f"In our model: {', '.join(f'{NAMES[k]} {v:.4f}' for k, v in ours)}.",
    )


# -- errors of the sensors ---------------------------------------------------------------------------------------------


@claims.add(
    "H-18 E-H8",
    "Under random sensor error R2 of the linear model scatters less than that of the quadratic one, in 100 "
    f"draws (criterion: at every size, {', '.join(f'{s:g}' for s in setup.NOISES)} degC, and both laws)",
    "smaller standard deviation (Fig. 6)",
)
def _noise(c: Computed) -> Ours:
    at = c.shaken["uniform", 0.4]
    linear, quadratic = at[LINEAR], at[QUADRATIC]
    ratios = {key: s[QUADRATIC].std / s[LINEAR].std for key, s in c.shaken.items()}
    worse = [f"{law} {size:g} degC" for (law, size), v in ratios.items() if v <= 1]
    not_above = f"; not above for {', '.join(worse)}" if worse else ""
    alone = at[setup.PLAIN].std / linear.std
    reason = (
        "so much of it comes from the choice of the temperatures, not from the squares"
        if alone > 0.5 * ratios["uniform", 0.4]
        else "so it is mostly the squares that do it"
    )
    return Ours(
        f"uniform +-0.4 degC: {linear.std:.4f}, quadratic {quadratic.std:.4f}",
        not worse,
        note=f"Its standard deviation is from {min(ratios.values()):.2f} to {max(ratios.values()):.2f} times that of "
        f"the linear model over all sizes and laws{not_above}. "
        "The quadratic model's own three temperatures without their squares scatter "
        f"{alone:.2f} times as much as the linear model at +-0.4 degC, {reason}. "
        f"At +-0.4 degC R2 is {linear.mean:.3f} in the mean for the linear model, {quadratic.mean:.3f} for the "
        f"quadratic one, without error {linear.r_squared:.3f} and {quadratic.r_squared:.3f}. Differences from T14 "
        "carry the error of two sensors.",
    )


# -- numbers -----------------------------------------------------------------------------------------------------------


def _numbers(c: Computed) -> dict[str, float]:
    at = c.shaken["uniform", 0.4]
    left = {NONE: "none", OPTIMAL: "", JUDGED: "judgement", SINGLE: "without_grouping"}
    return {
        "rows": float(len(c.fit)),
        "groups": float(len(c.grouped.groups_)),
        "models_tried": float(sum(c.grouped.searched_)),
        "models_tried_without_grouping": float(c.single.searched_[0]),
        "variables": float(len(c.grouped.selected_)),
        "variables_without_grouping": float(len(c.single.selected_)),
        "r_squared": c.fits[OPTIMAL].r_squared,
        "standard_error_um": c.fits[OPTIMAL].error,
        "r_squared_judgement": c.fits[JUDGED].r_squared,
        "standard_error_judgement_um": c.fits[JUDGED].error,
        "smallest_eigenvalue_degC2": c.grouped.spectrum_.smallest,
        "smallest_eigenvalue_without_grouping_degC2": c.single.spectrum_.smallest,
        "std_r_squared_linear": at[LINEAR].std,
        "std_r_squared_quadratic": at[QUADRATIC].std,
    } | {f"rms_new_{short}{short and '_'}um": rms(c.residuals[name]) for name, short in left.items()}
