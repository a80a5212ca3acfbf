"""Tables and figures of the study of Hwang, Lee and Yang."""

from collections.abc import Callable

import numpy as np

from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.selection.collinearity import Spectrum, spectrum
from thermocomp.models.selection.grouping import Interval
from thermocomp.papers.common import errors_table, rms, table
from thermocomp.papers.hwang import setup
from thermocomp.papers.hwang.setup import JUDGED, LINEAR, OPTIMAL, PLAIN, QUADRATIC, Computed, named
from thermocomp.papers.pictures import curves, single
from thermocomp.papers.study import Figure, Panel, StudyTable


def tables(c: Computed) -> tuple[StudyTable, ...]:
    """Return the tables."""
    swept: dict[str, Callable[[tuple[Interval, CorrelationGrouping]], str]] = {
        "threshold": lambda s: f"{s[0].low:.4f} to {s[0].high:.4f}{' (taken)' if s[0] is c.interval else ''}",
        "groups": lambda s: str(len(s[1].groups_)),
        "as Table 1": lambda s: f"{setup.agreement(s[0].groups):.2f}",
        "models": lambda s: f"{s[1].searched_[0]} + {s[1].searched_[1]}",
        "variables": lambda s: named(s[1].selected_),
        "SE [um]": lambda s: f"{s[1].standard_error_:.2f}",
        "smallest eigenvalue": lambda s: f"{s[1].spectrum_.smallest:.3g}",
        "sum of 1/eigenvalue": lambda s: f"{s[1].spectrum_.sum_inverse:.3g}",
        "condition": lambda s: f"{s[1].spectrum_.condition_number:.2g}",
        "RMS, new tests [um]": lambda s: f"{_unseen(s[1], c):.2f}",
    }
    ones = spectrum(np.column_stack([np.ones(len(c.fit)), c.change[:, c.single.selected_]]))
    eigenvalues = [
        [name, " ".join(f"{v:.3g}" for v in s.eigenvalues), f"{s.sum_inverse:.3g}", f"{s.condition_number:.2g}"]
        for name, s in (
            ("with grouping, paper", Spectrum(setup.TABLE_3[0])),
            ("with grouping, ours", c.grouped.spectrum_),
            ("without, paper", Spectrum(setup.TABLE_3[1])),
            ("without, ours", c.single.spectrum_),
            ("without, ours, with the column of ones (E-H6)", ones),
        )
    ]
    shaken = (LINEAR, QUADRATIC, PLAIN)
    noise = [
        [f"{law} {size:g}", *(f"{v:.4f}" for m in shaken for v in (s[m].mean, s[m].std))]
        for (law, size), s in c.shaken.items()
    ]
    columns = ("model", "eigenvalues [degC2]", "sum of 1/eigenvalue [1/degC2]", "condition number")
    return (
        table("Every threshold there is (E-H1)", c.swept, swept),
        StudyTable("Eigenvalues of X'X (Table 3)", columns, eigenvalues),
        StudyTable(
            "R2 under random sensor error, 100 draws (Fig. 6)",
            ("error [degC]", *(f"{m}, {v}" for m in shaken for v in ("mean", "std"))),
            noise,
        ),
        errors_table("New tests", {("z", name): e for name, e in c.residuals.items()}),
    )


def figures(c: Computed) -> tuple[Figure, ...]:
    """Return the figures."""
    first = c.new.test == 0
    fitted = {name: c.fitted(name) for name in (OPTIMAL, JUDGED)}
    predicted = {name: c.new.deviations[first, 0] - c.residuals[name][first] for name in (OPTIMAL, JUDGED)}
    drift = [
        Panel(title, "time [h]", "z [um]", curves(t / 3600, {"measured": z} | lines, points=["measured"]))
        for title, t, z, lines in (
            ("fitted to", c.fit.time, c.drift, fitted),
            ("a new order", c.new.time[first], c.new.deviations[first, 0], predicted),
        )
    ]
    variables = np.array([len(s.columns) for s in c.grouped.curve_], dtype=np.float64)
    mse = np.array([s.mse for s in c.grouped.curve_])
    shaken = c.shaken["uniform", 0.4]
    draws = {m: shaken[m].draws for m in (LINEAR, QUADRATIC)}
    groups = np.array([float(len(i.groups)) for i, _ in c.swept])
    smallest = np.log10([g.spectrum_.smallest for _, g in c.swept])
    error = np.array([g.standard_error_ for _, g in c.swept])
    errors = {"standard error of the fit": error, "RMS on new tests": np.array([_unseen(g, c) for _, g in c.swept])}
    swept = [
        Panel(title, "number of groups", y, curves(groups, values, "points"))
        for title, y, values in (
            ("collinearity", "log10 of the smallest eigenvalue", {"": smallest}),
            ("error", "[um]", errors),
        )
    ]
    return (
        single(
            "hwang-fig4",
            "Fig. 4: the smallest residual mean square for each number of representatives.",
            ("number of variables", "MSE_p [um2]"),
            curves(variables, {"": mse}),
            columns=2,
        ),
        Figure(
            "hwang-fig5",
            "Fig. 5: drift measured and predicted, in the test the models were fitted to and in a new one.",
            drift,
            columns=2,
        ),
        single(
            "hwang-fig6",
            "Fig. 6: R2 of the two models in 100 draws of random sensor error, uniform within +-0.4 degC.",
            ("draw", "R2"),
            curves(np.arange(1.0, setup.DRAWS + 1), draws),
        ),
        Figure(
            "hwang-thresholds",
            "Not in the paper: what the threshold of the grouping decides. A dot is a range of thresholds with the "
            "same groups; 13 groups are no grouping.",
            swept,
            columns=2,
        ),
    )


def _unseen(grouping: CorrelationGrouping, c: Computed) -> float:
    """Return the RMS residual of the model of a threshold in the new tests [um]."""
    return rms(c.new.deviations[:, 0] - grouping.predict(c.new.frame()))
