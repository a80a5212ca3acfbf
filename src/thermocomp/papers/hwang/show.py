"""What the study of Hwang, Lee and Yang shows: its tables and figures."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.models.selection.collinearity import Spectrum, spectrum
from thermocomp.papers.common import errors_table
from thermocomp.papers.hwang import setup
from thermocomp.papers.hwang.setup import JUDGED, LINEAR, OPTIMAL, PLAIN, QUADRATIC, Computed, named, rms
from thermocomp.papers.study import Curve, Figure, Panel, Table

FloatArray = NDArray[np.float64]


def tables(c: Computed) -> tuple[Table, ...]:
    """Return the tables."""
    rows = []
    for i, g in c.swept:
        left = c.new.deviations[:, 0] - g.predict(c.new.frame())
        rows.append(
            [
                f"{i.low:.4f} to {i.high:.4f}{' (taken)' if i is c.interval else ''}",
                str(len(g.groups_)),
                f"{setup.agreement(i.groups):.2f}",
                f"{g.searched_[0]} + {g.searched_[1]}",
                named(g.selected_),
                f"{g.standard_error_:.2f}",
                f"{g.spectrum_.smallest:.3g}",
                f"{g.spectrum_.sum_inverse:.3g}",
                f"{g.spectrum_.condition_number:.2g}",
                f"{rms(left):.2f}",
            ]
        )
    header = ["threshold", "groups", "as Table 1", "models", "variables", "SE [um]"]
    header += ["smallest eigenvalue", "sum of 1/eigenvalue", "condition", "RMS, new tests [um]"]
    eigenvalues = [
        [name, " ".join(f"{v:.3g}" for v in s.eigenvalues), f"{s.sum_inverse:.3g}", f"{s.condition_number:.2g}"]
        for name, s in (
            ("with grouping, paper", Spectrum(setup.TABLE_3[0])),
            ("with grouping, ours", c.grouped.spectrum_),
            ("without, paper", Spectrum(setup.TABLE_3[1])),
            ("without, ours", c.single.spectrum_),
            ("without, ours, with the column of ones (E-H6)", _with_ones(c)),
        )
    ]
    noise = [
        [f"{law} {size:g}", *(f"{v:.4f}" for m in (LINEAR, QUADRATIC, PLAIN) for v in (s[m].mean, s[m].std))]
        for (law, size), s in c.shaken.items()
    ]
    return (
        Table("Every threshold there is (E-H1)", header, rows),
        Table(
            "Eigenvalues of X'X (Table 3)",
            ("model", "eigenvalues [degC2]", "sum of 1/eigenvalue [1/degC2]", "condition number"),
            eigenvalues,
        ),
        Table(
            "R2 under random sensor error, 100 draws (Fig. 6)",
            ("error [degC]", *(f"{m}, {v}" for m in (LINEAR, QUADRATIC, PLAIN) for v in ("mean", "std"))),
            noise,
        ),
        errors_table("New tests", {("z", name): e for name, e in c.residuals.items()}),
    )


def figures(c: Computed) -> tuple[Figure, ...]:
    """Return the figures."""
    z, hours = c.fit.deviations[:, 0], c.fit.time / 3600
    first = c.new.test == 0
    new, clock = c.new.deviations[first, 0], c.new.time[first] / 3600
    drift = [
        Panel(title, "time [h]", "z [um]", [Curve("measured", t, measured, "points"), *predictions])
        for title, t, measured, predictions in (
            ("fitted to", hours, z, [_line(n, c, hours, z, None) for n in (OPTIMAL, JUDGED)]),
            ("a new order", clock, new, [_line(n, c, clock, new, first) for n in (OPTIMAL, JUDGED)]),
        )
    ]
    numbers = np.array([len(s.columns) for s in c.grouped.curve_], dtype=np.float64)
    mse = np.array([s.mse for s in c.grouped.curve_])
    draws = np.arange(1.0, setup.DRAWS + 1)
    shaken = c.shaken["uniform", 0.4]
    groups = np.array([float(len(i.groups)) for i, _ in c.swept])
    smallest = np.log10([g.spectrum_.smallest for _, g in c.swept])
    error = np.array([g.standard_error_ for _, g in c.swept])
    unseen = np.array([rms(c.new.deviations[:, 0] - g.predict(c.new.frame())) for _, g in c.swept])
    swept = [
        Panel("collinearity", "number of groups", "log10 of the smallest eigenvalue", [_dots("", groups, smallest)]),
        Panel(
            "error",
            "number of groups",
            "[um]",
            [_dots("standard error of the fit", groups, error), _dots("RMS on new tests", groups, unseen)],
        ),
    ]
    return (
        Figure(
            "hwang-fig4",
            "Fig. 4: the smallest residual mean square for each number of representatives.",
            [Panel("", "number of variables", "MSE_p [um2]", [Curve("", numbers, mse)])],
            columns=2,
        ),
        Figure(
            "hwang-fig5",
            "Fig. 5: drift measured and predicted, in the test the models were fitted to and in a new one.",
            drift,
            columns=2,
        ),
        Figure(
            "hwang-fig6",
            "Fig. 6: R2 of the two models in 100 draws of random sensor error, uniform within +-0.4 degC.",
            [Panel("", "draw", "R2", [Curve(m, draws, shaken[m].draws) for m in (LINEAR, QUADRATIC)])],
        ),
        Figure(
            "hwang-thresholds",
            "Not in the paper: what the threshold of the grouping decides. A dot is a range of thresholds with the "
            "same groups; 13 groups are no grouping.",
            swept,
            columns=2,
        ),
    )


def _dots(label: str, x: FloatArray, y: FloatArray) -> Curve:
    return Curve(label, x, y, "points")


def _line(name: str, c: Computed, t: FloatArray, z: FloatArray, rows: NDArray[np.bool_] | None) -> Curve:
    left = c.residuals[name][rows] if rows is not None else z - c.fitted(name)
    return Curve(name, t, z - left)


def _with_ones(c: Computed) -> Spectrum:
    return spectrum(np.column_stack([np.ones(len(c.fit)), c.change[:, c.single.selected_]]))
