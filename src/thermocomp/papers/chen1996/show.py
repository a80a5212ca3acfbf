"""Chen, Yuan, Ni 1996, sections 3.2 and 4.2: tables and figures of the fits to the 810 sets."""

from collections.abc import Mapping, Sequence

import numpy as np

from thermocomp.papers import common
from thermocomp.papers.chen1996.drift import MAE_MRA, MAE_NET, R2_X, SEE_X, TERMS, LearnedDrift, LearnedNet, screening
from thermocomp.papers.chen1996.setup import DRIFTS, SENSORS, SUBGROUPS, exhibits
from thermocomp.papers.pictures import end_to_end
from thermocomp.papers.study import Figure, StudyTable

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
    sensors = [(name, SENSORS.get(name, "mean of T6 to T9"), r) for name, r in screening(found).items()]
    printed = {"x": (f" ({R2_X})", f" ({SEE_X:.1f})")}
    fits = []
    for t, regression in found.regressions.items():
        counts = (found.candidates[t], found.terms[t], TERMS[t])
        errors = (found.mra[t], MAE_MRA[t], found.net[t], MAE_NET[t])
        fits.append((t, SUBGROUPS[t], *counts, regression, *printed.get(t, ("", "")), *errors))
    x, y = found.regressions["x"], found.regressions["y"]
    nets = {**found.others, "9-20-3": found.nets}
    return [
        exhibits.table("sensors", sensors),
        exhibits.table("fits", fits),
        exhibits.table("eq5", beside(dict(zip(x.terms_, x.coef_.tolist(), strict=True)), EQ5)),
        exhibits.table("log_x", [(s, s.action.upper()) for s in x.log_]),
        exhibits.table("log_y", [(s, s.action.upper()) for s in y.log_]),
        exhibits.table("nets", [_mean_errors(kind, trained) for kind, trained in nets.items()]),
    ]


def _mean_errors(kind: str, nets: Sequence[LearnedNet]) -> tuple[str, Sequence[LearnedNet], list[float], float]:
    mae = [float(np.mean([n.mae[t] for n in nets])) for t in DRIFTS]
    return kind, nets, mae, float(np.mean(mae))


def beside(ours: Mapping[str, float], paper: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Return the rows of a table of coefficients by term, ours next to those of the paper; empty if there is none."""
    texts = [{term: f"{coefficient:.3f}" for term, coefficient in c.items()} for c in (ours, paper)]
    return [(term, texts[0].get(term, ""), texts[1].get(term, "")) for term in {**ours, **paper}]


def figures(found: LearnedDrift) -> list[Figure]:
    """Return Figs. 3 to 5 and 10 to 12: measurements and fits."""
    samples, drawn = found.samples, []
    for kind, first, models in (("MRA", 3, found.models), ("net", 10, found.typical.models)):
        for number, (target, model) in enumerate(models.items(), start=first):
            hours, measured = end_to_end(samples, common.take_measured(samples, target))
            _, fitted = end_to_end(samples, common.predict_deviation(model, samples))
            drawn.append(exhibits.figure(f"chen1996-fig{number}", (hours, {"measured": measured, kind: fitted})))
    return drawn
