"""Tables and figures of the study of Hwang, Lee and Yang."""

import numpy as np

from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.selection.collinearity import Spectrum, spectrum
from thermocomp.papers.common import errors_table, rms
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.hwang import setup
from thermocomp.papers.hwang.setup import JUDGED, LINEAR, OPTIMAL, PLAIN, QUADRATIC, Computed, named
from thermocomp.papers.study import Figure, StudyTable

exhibits = Exhibits(__name__)


def tables(c: Computed) -> tuple[StudyTable, ...]:
    """Return the tables."""
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
    noise = [(law, size, s[LINEAR], s[QUADRATIC], s[PLAIN]) for (law, size), s in c.shaken.items()]
    return (
        exhibits.table("thresholds", swept),
        exhibits.table("eigenvalues", eigenvalues.items()),
        exhibits.table("noise", noise),
        errors_table("New tests", {("z", name): e for name, e in c.residuals.items()}),
    )


def figures(c: Computed) -> tuple[Figure, ...]:
    """Return the figures."""
    first = c.new.test == 0
    z = c.new.deviations[first, 0]
    fitted = {"measured": c.drift} | {name: c.fitted(name) for name in (OPTIMAL, JUDGED)}
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
        exhibits.figure("hwang-fig5", (c.fit.time / 3600, fitted), (c.new.time[first] / 3600, predicted)),
        exhibits.figure("hwang-fig6", (np.arange(1.0, setup.DRAWS + 1), draws)),
        exhibits.figure("hwang-thresholds", (groups, {"": smallest}), (groups, errors)),
    )


def _unseen(grouping: CorrelationGrouping, c: Computed) -> float:
    """Return the RMS residual of the model of a threshold in the new tests [um]."""
    return rms(c.new.deviations[:, 0] - grouping.predict(c.new.frame()))
