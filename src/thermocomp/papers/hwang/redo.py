"""Hwang, Lee, Yang redone: correlation grouping, successive regression, collinearity and noise (H-01 to H-18)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.selection.collinearity import Spectrum, contributions
from thermocomp.models.selection.grouping import group, interval_of
from thermocomp.papers.hwang import setup, show
from thermocomp.papers.hwang.setup import (
    JUDGED,
    LINEAR,
    NAMES,
    NONE,
    OPTIMAL,
    PLAIN,
    QUADRATIC,
    SAME,
    SINGLE,
    Computed,
    named,
    rms,
)
from thermocomp.papers.study import Claim, Progress, Study

FloatArray = NDArray[np.float64]


def run(seed: int, progress: Progress) -> Study:
    """Redo the study.

    Parameters
    ----------
    seed : int
    progress : callable

    Returns
    -------
    Study
    """
    c = setup.compute(seed, progress)
    return Study(
        "hwang",
        "Hwang, Lee, Yang: Optimal variable selection in a thermal error model for real time error compensation",
        (*_choice(c), *_accuracy(c), *_collinearity(c), *_noise(c)),
        show.tables(c),
        show.figures(c),
        _numbers(c),
    )


# -- claims ------------------------------------------------------------------------------------------------------------


def _choice(c: Computed) -> list[Claim]:
    exact = interval_of([[k - 1 for k in g] for g in setup.TABLE_1], [i for i, _ in c.swept])
    likest, _ = max(c.swept, key=lambda s: setup.agreement(s[0].groups))
    g = c.grouped
    unsigned = group(g.correlation_, c.interval.low, absolute=True)
    sizes = [len(s.columns) for s in g.curve_]
    best = min(g.curve_, key=lambda s: s.mse)
    return [
        Claim(
            ("H-03", "H-10", "E-H1"),
            "Correlation grouping makes the 8 groups of Table 1",
            _listed([[k - 1 for k in g] for g in setup.TABLE_1]),
            f"thresholds from {exact.low:.4f} to {exact.high:.4f}" if exact else _listed(c.interval.groups),
            exact is not None,
            ""
            if exact
            else f"No threshold gives them. Ours are {len(c.interval.groups)} groups, for thresholds from "
            f"{c.interval.low:.4f} to {c.interval.high:.4f}; next to Table 1 come thresholds from {likest.low:.4f}, "
            f"where {setup.agreement(likest.groups):.0%} of all pairs of sensors are together or apart as there. Which "
            "sensors move alike depends on where the heat of a machine comes from, and on the places of its sensors.",
        ),
        Claim(
            ("E-H2",),
            "Pairs of temperatures whose correlation is negative, for which it matters whether it goes by its sign",
            "",
            f"{int((np.triu(g.correlation_, 1) < 0).sum())} of {len(g.candidates_) * (len(g.candidates_) - 1) // 2}",
            None,
            "By magnitude the groups are "
            + ("the same." if unsigned == c.interval.groups else f"others: {_listed(unsigned)}."),
        ),
        Claim(
            ("H-04",),
            "Representatives of the groups that take part, by successive regression",
            "T7 T8 T2 T1",
            named([r for r in g.representatives_ if any(r in g.groups_[k] for k in g.participating_)]),
            None,
        ),
        Claim(
            ("H-05", "H-11"),
            "The residual mean square is smallest with fewer variables than there are groups",
            "4 of 8",
            f"{len(best.columns)} of {len(g.groups_)}",
            len(best.columns) < len(g.groups_),
            ""
            if len(best.columns) < len(g.groups_)
            else f"Each of the {len(g.groups_)} groups still lowers it: from {g.curve_[0].mse:.3g} um2 with one to "
            f"{best.mse:.3g} um2 with {max(sizes)}. The mean square takes the {len(c.fit)} rows as independent; they "
            f"are worth {effective_sample_size(c.fit.deviations[:, 0] - c.fitted(OPTIMAL)):.0f}.",
        ),
        Claim(
            ("H-01", "H-07"),
            "Grouping leaves few models to try",
            "8191, grouped 255 + 4",
            f"{c.single.searched_[0]}, grouped {g.searched_[0]} + {g.searched_[1]}",
            None,
        ),
        Claim(
            ("H-06", "H-11", "H-12"),
            "The best variables",
            "T7 T8 T2 T6",
            named(g.selected_),
            None,
            f"z = {c.fits[OPTIMAL].model.formula()}",
        ),
        Claim(("H-08", "H-09", "E-H7"), "Rows the models are fitted to", "about 32", str(len(c.fit)), None),
        Claim(
            ("H-15",),
            "Without grouping the model takes more variables",
            "7 instead of 4",
            f"{len(c.single.selected_)} instead of {len(g.selected_)}: {named(c.single.selected_)}",
            len(c.single.selected_) > len(g.selected_),
            ""
            if len(c.single.selected_) > len(g.selected_)
            else "The smallest mean square needs no more of them here.",
        ),
    ]


def _accuracy(c: Computed) -> list[Claim]:
    ours, judged = c.fits[OPTIMAL], c.fits[JUDGED]
    z, left = c.new.deviations[:, 0], c.residuals
    new, old = rms(left[OPTIMAL]), rms(left[JUDGED])
    lonely = rms(left[SINGLE])
    rows = effective_sample_size(c.fit.deviations[:, 0] - c.fitted(OPTIMAL))
    return [
        Claim(
            ("H-12", "H-13"),
            "The linear model fits as well as the engineering judgement model with its squares "
            f"(criterion: standard error at most {SAME:g} times)",
            f"{_both(*setup.TABLE_2['optimal'])}; with squares {_both(*setup.TABLE_2['judgement'])}",
            f"{_both(ours.r_squared, ours.error)}; with squares {_both(judged.r_squared, judged.error)}",
            ours.error <= SAME * judged.error,
            "" if ours.error <= SAME * judged.error else _worse(ours.error / judged.error, c),
        ),
        Claim(
            ("H-12", "H-13"),
            f"Likewise on new tests (Fig. 5): here {setup.NEW}, with other orders of the states and other weather "
            f"(criterion: RMS at most {SAME:g} times)",
            f"R2 {setup.TABLE_2['optimal'][0]}",
            f"R2 {_r_squared(left[OPTIMAL], z):.4f}, RMS {new:.2f} um; with squares "
            f"R2 {_r_squared(left[JUDGED], z):.4f}, RMS {old:.2f} um; without compensation {rms(z):.2f} um",
            new <= SAME * old,
            "" if new <= SAME * old else _worse(new / old, c),
        ),
        Claim(
            ("H-15", "E-H10"),
            "Not in the paper: RMS on new tests with grouping, and without",
            "",
            f"{new:.2f} um, without {lonely:.2f} um",
            None,
            ""
            if new <= lonely
            else f"Grouping costs accuracy here: {new / lonely:.2f} times the error, for {len(c.grouped.selected_)} "
            f"sensors instead of {len(c.single.selected_)}. The noise of the sensors is small beside the drift, so "
            "badly determined coefficients do little harm as long as the temperatures go together as they did.",
        ),
        Claim(
            ("E-C12",),
            "Independent rows that the fit is worth",
            "",
            f"{rows:.0f} of {len(c.fit)}",
            None,
            "R2, standard error and mean square take all rows as independent.",
        ),
    ]


def _collinearity(c: Computed) -> list[Claim]:
    with_, without = c.grouped.spectrum_, c.single.spectrum_
    better = with_.smallest > without.smallest and with_.sum_inverse < without.sum_inverse
    compared = [g.spectrum_.smallest > without.smallest for _, g in c.swept if g.selected_ != c.single.selected_]
    paper = [Spectrum(t) for t in setup.TABLE_3]
    r = dict(zip(NAMES[:13], contributions(c.change, c.fit.deviations[:, 0]).tolist(), strict=True))
    spindle, others = min(abs(r["T7"]), abs(r["T8"])), max(abs(r["T2"]), abs(r["T6"]))
    top = sorted(r, key=lambda n: -abs(r[n]))
    return [
        Claim(
            ("H-14", "H-16"),
            "Grouping raises the smallest eigenvalue of X'X and lowers the sum of 1/eigenvalue, the variance of the "
            "coefficients",
            f"smallest {paper[0].smallest:g} instead of {paper[1].smallest:g}, sum {paper[0].sum_inverse:.3f} instead "
            f"of {paper[1].sum_inverse:.1f}",
            f"smallest {with_.smallest:.3g} instead of {without.smallest:.3g}, sum {with_.sum_inverse:.3g} instead of "
            f"{without.sum_inverse:.3g}",
            better,
            (
                f"So at {sum(compared)} of {len(compared)} thresholds that lead to another model than no grouping. "
                f"Collinearity is lessened, not gone (E-H10): condition number {with_.condition_number:.2g} instead of "
                f"{without.condition_number:.2g} (paper {paper[0].condition_number:.2g} and "
                f"{paper[1].condition_number:.2g})."
            )
            if better
            else f"The two models have {len(c.grouped.selected_)} and {len(c.single.selected_)} variables. At "
            f"{sum(compared)} of {len(compared)} thresholds that lead to another model than no grouping the smallest "
            "eigenvalue is larger.",
        ),
        Claim(
            ("H-17",),
            "The temperatures of the spindle, T7 and T8, have most to do with the drift: their correlation with it is "
            "above that of T2 and T6",
            ", ".join(f"{n} {v}" for n, v in setup.EQUATION_9.items()),
            ", ".join(f"{n} {r[n]:.4f}" for n in setup.EQUATION_9),
            spindle > others,
            f"Of all 13 the most: {', '.join(f'{n} {r[n]:.4f}' for n in top[:4])}. In our model: "
            + ", ".join(
                f"{NAMES[k]} {v:.4f}" for k, v in zip(c.grouped.selected_, c.grouped.contributions_, strict=True)
            )
            + ".",
        ),
    ]


def _noise(c: Computed) -> list[Claim]:
    at = c.shaken["uniform", 0.4]
    ratios = {key: s[QUADRATIC].std / s[LINEAR].std for key, s in c.shaken.items()}
    worse = [f"{law} {size:g} degC" for (law, size), v in ratios.items() if v <= 1]
    alone = at[PLAIN].std / at[LINEAR].std
    plain = f"{alone:.2f} times as much as the linear model at +-0.4 degC" + (
        ", so much of it comes from the choice of the temperatures, not from the squares"
        if alone > 0.5 * ratios["uniform", 0.4]
        else ", so it is mostly the squares that do it"
    )
    spread = f"from {min(ratios.values()):.2f} to {max(ratios.values()):.2f}"
    return [
        Claim(
            ("H-18", "E-H8"),
            "Under random sensor error R2 of the linear model scatters less than that of the quadratic one, in 100 "
            f"draws (criterion: at every size, {', '.join(f'{s:g}' for s in setup.NOISES)} degC, and both laws)",
            "smaller standard deviation (Fig. 6)",
            f"uniform +-0.4 degC: {at['linear'].std:.4f}, quadratic {at['quadratic'].std:.4f}",
            not worse,
            f"Its standard deviation is {spread} times that of the linear model over all sizes and laws"
            + (f"; not above for {', '.join(worse)}. " if worse else ". ")
            + f"The quadratic model's own three temperatures without their squares scatter {plain}. "
            + f"At +-0.4 degC R2 is {at['linear'].mean:.3f} in the mean for the linear model, "
            f"{at['quadratic'].mean:.3f} for the quadratic one, without error {at['linear'].r_squared:.3f} and "
            f"{at['quadratic'].r_squared:.3f}. Differences from T14 carry the error of two sensors.",
        )
    ]


def _worse(ratio: float, c: Computed) -> str:
    return (
        f"{ratio:.2f} times the error of the engineering judgement model. That one takes {_named_sensors(JUDGED, c)}, "
        f"ours {_named_sensors(OPTIMAL, c)}: the grouping chooses by the fit to {len(c.fit)} rows of one test."
    )


def _named_sensors(model: str, c: Computed) -> str:
    return " ".join(n for n in c.fits[model].model.sensors if n != setup.REFERENCE)


# -- numbers -----------------------------------------------------------------------------------------------------------


def _numbers(c: Computed) -> dict[str, float]:
    at = c.shaken["uniform", 0.4]
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
        "rms_new_none_um": rms(c.residuals[NONE]),
        "rms_new_um": rms(c.residuals[OPTIMAL]),
        "rms_new_judgement_um": rms(c.residuals[JUDGED]),
        "rms_new_without_grouping_um": rms(c.residuals[SINGLE]),
    }


def _both(r_squared: float, error: float) -> str:
    return f"R2 {r_squared:.4f}, {error:.2f} um"


def _listed(groups: Sequence[Sequence[int]]) -> str:
    return ", ".join("{" + " ".join(str(k + 1) for k in sorted(g)) + "}" for g in groups)


def _r_squared(residual: FloatArray, z: FloatArray) -> float:
    return float(1 - np.sum(residual**2) / np.sum((z - z.mean()) ** 2))
