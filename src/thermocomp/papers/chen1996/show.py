"""Chen, Yuan, Ni 1996, sections 3.2 and 4.2: tables and figures of the fits to the 810 sets."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common, pictures
from thermocomp.papers.chen1996.drift import MAE_MRA, MAE_NET, R2_X, SEE_X, TERMS, LearnedDrift, LearnedNet, screening
from thermocomp.papers.chen1996.setup import DRIFTS, SENSORS, SUBGROUPS
from thermocomp.papers.study import Figure, PlotCurve, StudyTable

#: Eq. 5 (C-18)
EQ5 = {
    "T2": -0.586,
    "T3": 7.527,
    "(T6-T7)": -36.966,
    "(T8-T9)": 10.809,
    "T3*T3": -0.149,
    "(T6-T7)*(T6-T7)": -18.119,
    "T2*(T6-T7)": 2.499,
}


def tables(found: LearnedDrift) -> list[StudyTable]:
    """Return Tables 1 and 2, the fits, Eq. 5 next to our coefficients, the logs of Fig. 2 and the sweep."""
    first = [
        [name, SENSORS.get(name, "mean of T6 to T9"), *(f"{r:.2f}" for r in row)]
        for name, row in screening(found).items()
    ]
    regressions = found.regressions
    fits: dict[str, Callable[[str], str]] = {
        "": str,
        "variables": lambda t: ", ".join(SUBGROUPS[t]),
        "terms": lambda t: f"{found.candidates[t]}",
        "left (paper)": lambda t: f"{found.terms[t]} ({TERMS[t]})",
        "R2": lambda t: f"{regressions[t].r_squared_:.3f}" + (f" ({R2_X})" if t == "x" else ""),
        "SEE [um]": lambda t: f"{regressions[t].standard_error_:.2f}" + (f" ({SEE_X:.1f})" if t == "x" else ""),
        "MAE [um]": lambda t: f"{found.mra[t]:.2f} ({MAE_MRA[t]})",
        "MAE net [um]": lambda t: f"{found.net[t]:.2f} ({MAE_NET[t]})",
        "independent rows": lambda t: f"{found.independent[t]:.0f}",
    }
    ours = dict(zip(found.regressions["x"].terms_, found.regressions["x"].coef_, strict=True))
    sweep = {**found.others, "9-20-3": found.nets}
    counts = [[kind, *_sweep_row(nets)] for kind, nets in sweep.items()]
    return [
        StudyTable(
            "Table 1: temperatures, and their correlation with the drifts", ("", "channel", "x", "y", "z"), first
        ),
        common.table("Table 2 and the fits, the paper's numbers in brackets", DRIFTS, fits),
        beside("Drift in x: coefficients [um/degC, um/degC2]", "Eq. 5", ours, EQ5),
        *(_log(found.regressions[t], t) for t in ("x", "y")),
        StudyTable(
            "Nets: mean absolute error after training, mean over the starts", ("", "starts", *DRIFTS, "mean"), counts
        ),
    ]


def _sweep_row(nets: Sequence[LearnedNet]) -> list[str]:
    mae = [float(np.mean([n.mae[t] for n in nets])) for t in DRIFTS]
    return [f"{len(nets)}", *(f"{m:.2f}" for m in mae), f"{np.mean(mae):.2f}"]


def beside(what: str, equation: str, ours: Mapping[str, float], paper: Mapping[str, float]) -> StudyTable:
    """Return a table of coefficients by term, ours next to those of the paper.

    Parameters
    ----------
    what : str
        Quantity described by the coefficients, and their unit.
    equation : str
        Equation of the paper, such as ``Eq. 5``.
    ours, paper : mapping of str to float

    Returns
    -------
    StudyTable
    """
    rows = [[t, *(f"{c[t]:.3f}" if t in c else "" for c in (ours, paper))] for t in {**ours, **paper}]
    return StudyTable(f"{what} here and in {equation}", ("term", "here", equation), rows)


def _log(regression: SecondOrderRegression, target: str) -> StudyTable:
    rows = [
        [f"{s.number}", s.action.upper(), s.term, f"{s.r:.3f}", f"{s.r_squared:.3f}", f"{s.f:.1f}"]
        for s in regression.log_
    ]
    note = "; the steps printed in the paper are those of its y (E-C1)" if target == "y" else ""
    return StudyTable(f"Fig. 2: steps in {target}{note}", ("STEP", "", "term", "R", "RSQUARE", "F"), rows)


def figures(found: LearnedDrift) -> list[Figure]:
    """Return Figs. 3 to 5 and 10 to 12: measurements and fits."""
    samples, drawn = found.samples, []
    for kind, first, models in (("MRA", 3, found.models), ("net", 10, found.typical.models)):
        for number, (target, model) in enumerate(models.items(), start=first):
            curves = [
                PlotCurve("measured", *pictures.end_to_end(samples, common.take_measured(samples, target)), "points"),
                PlotCurve(kind, *pictures.end_to_end(samples, common.predict_deviation(model, samples))),
            ]
            axes = "time, five tests one after the other [h]", f"{target} [um]"
            text = f"drift in {target} over the five tests, and the fit by the {kind}."
            drawn.append(figure(number, text, axes, curves))
    return drawn


def figure(number: int, text: str, axes: tuple[str, str], curves: Sequence[PlotCurve]) -> Figure:
    """Return a figure with one panel, corresponding to a figure of the paper.

    Parameters
    ----------
    number : int
    text : str
        Text of the caption after the number.
    axes : tuple of str
        Labels of x and y.
    curves : sequence of PlotCurve

    Returns
    -------
    Figure
    """
    return pictures.single(f"chen1996-fig{number}", f"Fig. {number}: {text}", axes, curves)
