"""Reproduction of Hwang, Lee, Yang: correlation grouping, successive regression, collinearity, noise (H-01 to H-19)."""

from collections.abc import Sequence

import numpy as np

from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.selection.collinearity import Spectrum, contributions, spectrum
from thermocomp.models.selection.grouping import group, interval_of
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import described, errors_table, rms
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.hwang import setup
from thermocomp.papers.hwang.setup import JUDGED, LINEAR, NAMES, NONE, OPTIMAL, QUADRATIC, SINGLE, Computed, named
from thermocomp.papers.pictures import end_to_end
from thermocomp.papers.study import Figure, Part, Progress, Study, StudyTable

TITLE = "Hwang, Lee, Yang: Optimal variable selection in a thermal error model for real time error compensation"


def run(seed: int, progress: Progress) -> Study:
    """Reproduce Hwang's study, and return its claims, tables and figures."""
    c = setup.compute(seed, progress)
    numbers = exhibits.numbers("redo", c, models=sum(c.grouped.searched_), shaken=c.shaken["uniform", 0.4])
    return Study.of("hwang", TITLE, Part(claims(c), _tables(c), _figures(c), numbers))


def _listed(groups: Sequence[Sequence[int]]) -> list[str]:
    return ["{" + " ".join(str(k + 1) for k in sorted(g)) + "}" for g in groups]


claims, exhibits = Claims[Computed](__name__, setup), Exhibits(__name__)


@claims.facts
def _groups(c: Computed) -> Facts:
    exact = interval_of([[k - 1 for k in g] for g in setup.TABLE_1], [i for i, _ in c.swept])
    likest, _ = max(c.swept, key=lambda s: setup.agreement(s[0].groups))
    facts = {"groups": _listed(c.interval.groups), "likest": likest, "agreement": setup.agreement(likest.groups)}
    return facts | {"exact": exact is not None} | ({"low": exact.low, "high": exact.high} if exact else {})


@claims.facts
def _negative(c: Computed) -> Facts:
    g = c.grouped
    unsigned = group(g.correlation_, c.interval.low, absolute=True)
    return {
        "negative": int((np.triu(g.correlation_, 1) < 0).sum()),
        "pairs": len(g.candidates_) * (len(g.candidates_) - 1) // 2,
        "same": unsigned == c.interval.groups,
        "unsigned": _listed(unsigned),
    }


@claims.facts
def _representatives(c: Computed) -> Facts:
    g = c.grouped
    return {"names": named([r for r in g.representatives_ if any(r in g.groups_[k] for k in g.participating_)])}


@claims.facts
def _fewer(c: Computed) -> Facts:
    sizes = [len(s.columns) for s in c.grouped.curve_]
    best = min(c.grouped.curve_, key=lambda s: s.mse)
    variables, groups = len(best.columns), len(c.grouped.groups_)
    return {"best": best, "variables": variables, "groups": groups, "share": variables / groups, "most": max(sizes)}


@claims.facts
def _quicker(c: Computed) -> Facts:
    with_, without = (1e3 * c.seconds[name] for name in (OPTIMAL, SINGLE))
    return {"models": sum(c.grouped.searched_), "with": with_, "without": without, "times": without / with_}


@claims.facts
def _best(c: Computed) -> Facts:
    return {"names": named(c.grouped.selected_), "formula": c.fits[OPTIMAL].model.formula()}


@claims.facts
def _more(c: Computed) -> Facts:
    ours, without = c.grouped.selected_, c.single.selected_
    further = len(without) - len(ours) >= np.subtract(*setup.PAPERS_VARIABLES)
    facts = {"ours": len(ours), "without": len(without), "names": named(without), "further": bool(further)}
    return facts | {"formula": c.fits[SINGLE].model.formula()}


def _takes(c: Computed, ratio: float) -> Facts:
    judged, ours = (
        " ".join(n for n in c.fits[model].model.sensors if n != setup.REFERENCE) for model in (JUDGED, OPTIMAL)
    )
    printed = setup.PAPERS_ERRORS[0] / setup.PAPERS_ERRORS[1]
    facts = {"ratio": ratio, "printed": printed, "smaller": ratio <= printed}
    return facts | {"judged_takes": judged, "ours_takes": ours}


@claims.facts
def _fits(c: Computed) -> Facts:
    ours, judged = c.fits[OPTIMAL], c.fits[JUDGED]
    return _takes(c, ours.error / judged.error) | {"ours": ours, "judged": judged}


@claims.facts
def _predicts(c: Computed) -> Facts:
    z, ours, judged = (c.residuals[name] for name in (NONE, OPTIMAL, JUDGED))
    facts = {"ours_r2": described(ours, z), "judged_r2": described(judged, z)}
    return _takes(c, c.errors[OPTIMAL].rms / c.errors[JUDGED].rms) | facts


@claims.facts
def _costs(c: Computed) -> Facts:
    ratio = c.errors[OPTIMAL].rms / c.errors[SINGLE].rms
    return {"ratio": ratio, "cost": ratio > 1, "others": [(name, c.errors[name].rms) for name in c.ours]}


@claims.facts
def _collinearity(c: Computed) -> Facts:
    with_, without = c.grouped.spectrum_, c.single.spectrum_
    compared = [g.spectrum_.smallest > without.smallest for _, g in c.swept if g.selected_ != c.single.selected_]
    better = with_.smallest > without.smallest and with_.sum_inverse < without.sum_inverse
    raised, paper = with_.smallest / without.smallest, setup.TABLE_3[0][-1] / setup.TABLE_3[1][-1]
    facts = {"with": with_, "without": without, "holds": better, "raised": raised, "paper": paper}
    return facts | {"larger": sum(compared), "compared": len(compared), "others": True}


@claims.facts
def _contributions(c: Computed) -> Facts:
    r = dict(zip(NAMES[:13], contributions(c.change, c.drift).tolist(), strict=True))
    ours = zip(c.grouped.selected_, c.grouped.contributions_, strict=True)
    return {
        "papers": {n: r[n] for n in ("T7", "T8", "T2", "T6")},
        "top": [(n, r[n]) for n in sorted(r, key=lambda n: -abs(r[n]))[:4]],
        "ours": [(NAMES[k], v) for k, v in ours],
        "spindle": min(abs(r["T7"]), abs(r["T8"])),
        "others": max(abs(r["T2"]), abs(r["T6"])),
    }


@claims.facts
def _noise(c: Computed) -> Facts:
    at = c.shaken["uniform", 0.4]
    ratios = {key: s[QUADRATIC].std / s[LINEAR].std for key, s in c.shaken.items()}
    worse = [f"{law} {size:g} degC" for (law, size), v in ratios.items() if v <= 1]
    alone = at[setup.PLAIN].std / at[LINEAR].std
    facts = {"linear": at[LINEAR], "quadratic": at[QUADRATIC], "alone": alone}
    facts |= {"least": min(ratios.values()), "most": max(ratios.values()), "worse": worse, "not_above": bool(worse)}
    return facts | {"choice": alone > 0.5 * ratios["uniform", 0.4], "holds": not worse}


# -- tables and figures -----------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[StudyTable, ...]:
    """Return the tables of the study."""
    swept = [
        (i, g, " (taken)" if i is c.interval else "", setup.agreement(i.groups), named(g.selected_), _unseen(g, c))
        for i, g in c.swept
    ]
    ones = spectrum(np.column_stack([np.ones(len(c.fit)), c.change[:, c.single.selected_]]))
    eigenvalues = {
        "with grouping, paper": Spectrum(setup.TABLE_3[0]),
        "with grouping, ours": c.grouped.spectrum_,
        "without, paper": Spectrum(setup.TABLE_3[1]),
        "without, ours": c.single.spectrum_,
        "without, ours, with the column of ones (E-H6)": ones,
    }
    noise = [(law, size, s[LINEAR], s[QUADRATIC], s[setup.PLAIN]) for (law, size), s in c.shaken.items()]
    return (
        exhibits.table("thresholds", swept),
        exhibits.table("eigenvalues", eigenvalues.items()),
        exhibits.table("noise", noise),
        errors_table(
            "New tests; `dynamic` and `averaged` are not in the paper",
            {("z", name): e for name, e in c.residuals.items()},
        ),
    )


def _figures(c: Computed) -> tuple[Figure, ...]:
    """Return the figures of the study."""
    first = c.new.test == 0
    z = c.new.deviations[first, 0]
    hours, _ = end_to_end(c.fit, c.drift)
    fitted = {"measured": c.drift} | {name: c.fitted(name) for name in (OPTIMAL, JUDGED)}
    fitted = {name: end_to_end(c.fit, values)[1] for name, values in fitted.items()}
    predicted = {"measured": z} | {name: z - c.residuals[name][first] for name in (OPTIMAL, JUDGED)}
    variables = np.array([len(s.columns) for s in c.grouped.curve_], dtype=np.float64)
    mse = np.array([s.mse for s in c.grouped.curve_])
    draws = {m: c.shaken["uniform", 0.4][m].draws for m in (LINEAR, QUADRATIC)}
    groups = np.array([float(len(i.groups)) for i, _ in c.swept])
    smallest = np.log10([g.spectrum_.smallest for _, g in c.swept])
    error = np.array([g.standard_error_ for _, g in c.swept])
    errors = {"standard error of the fit": error, "RMS on new tests": np.array([_unseen(g, c) for _, g in c.swept])}
    return (
        exhibits.figure("hwang-fig4", (variables, {"": mse})),
        exhibits.figure("hwang-fig5", (hours, fitted), (c.new.time[first] / 3600, predicted)),
        exhibits.figure("hwang-fig6", (np.arange(1.0, setup.DRAWS + 1), draws)),
        exhibits.figure("hwang-thresholds", (groups, {"": smallest}), (groups, errors)),
    )


def _unseen(grouping: CorrelationGrouping, c: Computed) -> float:
    """Return the RMS residual of the model of a threshold in the new tests [um]."""
    return rms(c.new.deviations[:, 0] - grouping.predict(c.new.frame()))
