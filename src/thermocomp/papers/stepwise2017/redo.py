"""stepwise2017 redone: of 24 temperatures the few that partial F keeps, judged on-line (T-01 to T-10).

Temperatures are counted from the start of the test, as the paper draws their variation (Fig. 2). Its own comparison
(Fig. 6) is on-line, so methods are judged on a test of another day with other speeds, by the RMS of what they leave.
"""

import numpy as np
from numpy.typing import NDArray

from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.numerics.stepwise import Step
from thermocomp.papers.common import Errors, errors_table
from thermocomp.papers.stepwise2017 import setup
from thermocomp.papers.stepwise2017.setup import (
    COMPONENTS,
    F_DELETE,
    F_ENTER,
    LEAST,
    NONE,
    PAPERS_RESIDUAL,
    PURSUIT,
    SLICED,
    STEPWISE,
    Computed,
)
from thermocomp.papers.study import Claim, Curve, Figure, Panel, Progress, Study, Table

FloatArray = NDArray[np.float64]

#: temperatures of the paper's Fig. 2, by their number
FIGURE_2 = (3, 11, 14)


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
        "stepwise2017",
        "Open Mech. Eng. J. 11 (2017): Temperature measurement point optimization by stepwise regression",
        (*_selection(c), *_comparison(c), *_beyond(c)),
        _tables(c),
        _figures(c),
        _numbers(c),
    )


# -- claims ------------------------------------------------------------------------------------------------------------


def _selection(c: Computed) -> list[Claim]:
    log, n = c.selection.log_, len(c.fit)
    count = len(c.chosen)
    few = 1 <= count <= len(setup.PAPERS_CHOICE)
    return [
        Claim(
            ("T-01",),
            "Temperatures, and rows of the test",
            "24",
            f"{len(c.fit.inputs) - 1}, {n} rows",
            None,
        ),
        Claim(
            ("T-03", "T-04"),
            f"The best single temperature reaches F_E = {F_ENTER:g}",
            f">= {F_ENTER:g}",
            f"{_place(log[0].term)}: F = {log[0].f:.0f}" if log else "none does",
            bool(log),
            "" if log else f"A first variable needs R2 >= {c.thinned[0].first:.2f} with {n} rows.",
        ),
        Claim(
            ("T-03", "T-07"),
            "F_E = 100 and F_D = 50 leave five temperatures of 24, or fewer",
            "5: " + ", ".join(map(str, setup.PAPERS_CHOICE)),
            f"{count}: {', '.join(map(_place, c.chosen))}",
            few,
            "" if few else _many(c),
        ),
        Claim(
            ("T-05", "T-06"),
            "Temperatures that came in and were deleted again",
            "",
            ", ".join(_place(s.term) for s in log if s.action == "remove") or "none",
            None,
        ),
    ]


def _many(c: Computed) -> str:
    n, last = len(c.fit), c.selection.log_[-1] if c.selection.log_ else None
    if last is None:
        return "No temperature reaches F_E."
    return (
        f"F grows with the number of rows: with {n} rows F_E is reached by what still explains "
        f"{F_ENTER / (F_ENTER + last.df):.0%} of the rest, and the rows are not independent (worth {_worth(c):.0f}). "
        f"The last step raised R2 by {last.r_squared_step:.1e}; thinned to {c.thinned[-1].rows} rows it keeps "
        f"{len(c.thinned[-1].names)}."
    )


def _comparison(c: Computed) -> list[Claim]:
    rms = {name: Errors.of(e).rms for name, e in c.left.items()}
    online, fit = Errors.of(c.left[STEPWISE]), Errors.of(c.left_in_fit[STEPWISE])
    tiny = Errors.of(c.left[NONE]).max_abs < 2 * PAPERS_RESIDUAL
    over = float(np.mean(np.abs(c.left[STEPWISE]) > PAPERS_RESIDUAL))
    claims = [
        Claim(
            ("T-08", "T-09"),
            f"On-line, stepwise regression predicts better than {other}",
            "better (Fig. 6)",
            f"RMS {rms[STEPWISE]:.2f} um, {rms[name]:.2f} um",
            rms[STEPWISE] < rms[name],
            "" if rms[STEPWISE] < rms[name] else _beaten(c, name, rms),
        )
        for name, other in ((LEAST, "least squares on all temperatures"), (PURSUIT, "projection pursuit regression"))
    ]
    return [
        *claims,
        Claim(
            ("T-08", "T-09"),
            f"On-line, the residual stays below {PAPERS_RESIDUAL:g} um",
            f"< {PAPERS_RESIDUAL:g} um",
            f"{online.max_abs:.1f} um at most; without compensation {Errors.of(c.left[NONE]).max_abs:.1f} um",
            online.max_abs < PAPERS_RESIDUAL,
            (f"The drift itself is below {2 * PAPERS_RESIDUAL:g} um: this says little." if tiny else "")
            if online.max_abs < PAPERS_RESIDUAL
            else f"It is above in {over:.0%} of the rows; RMS {online.rms:.2f} um. In the test it was fitted to it is "
            f"{fit.max_abs:.1f} um at most. The model knows temperatures, not how they came about: speeds that change "
            "and rooms that differ leave what the chosen sensors do not see.",
        ),
        Claim(("T-08",), "Residual in the test that was fitted to", "", f"{fit.max_abs:.1f} um at most", None),
        Claim(
            ("T-10",),
            "On-line RMS of the neighbours: principal components (Miao), sliced inverse regression (Zhang)",
            "",
            f"{rms[COMPONENTS]:.2f} um, {rms[SLICED]:.2f} um",
            None,
        ),
    ]


def _beaten(c: Computed, name: str, rms: dict[str, float]) -> str:
    fits = {m: Errors.of(c.left_in_fit[m]).rms for m in (STEPWISE, name)}
    return (
        f"{rms[STEPWISE] / rms[name]:.2f} times its error. In the fit stepwise leaves {fits[STEPWISE]:.2f} um, the "
        f"other {fits[name]:.2f} um: "
        + (
            "what the temperatures it leaves out know is true on another day too, with as little noise."
            if fits[name] < fits[STEPWISE]
            else "its advantage shows on the new day only."
        )
    )


def _beyond(c: Computed) -> list[Claim]:
    rms = {name: Errors.of(c.left[name]).rms for name in c.shaken}
    noise = {m: r.noise_rms["uniform"][0] / rms[m] for m, r in c.shaken.items()}
    lost = {m: r.worst_lost[1] / rms[m] for m, r in c.shaken.items()}
    robust = all(noise[STEPWISE] < noise[m] and lost[STEPWISE] < lost[m] for m in (LEAST, PURSUIT))
    told = "; ".join(
        f"{m}: noise {c.shaken[m].noise_rms['uniform'][0]:.1f} um, {_place(c.shaken[m].worst_lost[0])} lost "
        f"{c.shaken[m].worst_lost[1]:.1f} um, clean {rms[m]:.1f} um"
        for m in c.shaken
    )
    counts = [f"{len(t.names)} with {t.rows} rows" for t in c.thinned]
    return [
        Claim(
            ("E-T5",),
            "Robustness is considerably improved (criterion: noise of 0.4 degC and the worst single lost sensor "
            "multiply the on-line error less than those of both others)",
            "claimed, not shown",
            f"noise x {noise[STEPWISE]:.1f}, lost sensor x {lost[STEPWISE]:.1f}; least squares x {noise[LEAST]:.1f}, "
            f"x {lost[LEAST]:.1f}; projection pursuit x {noise[PURSUIT]:.1f}, x {lost[PURSUIT]:.1f}",
            robust,
            told + ("" if robust else ". With few sensors each one counts for more."),
        ),
        Claim(
            ("E-T3",),
            f"Temperatures that F_E = {F_ENTER:g} and F_D = {F_DELETE:g} keep of the same test, thinned",
            "",
            ", ".join(counts),
            None,
            f"A first variable needs R2 >= {c.thinned[0].first:.2f} with {c.thinned[0].rows} rows and "
            f"{c.thinned[-1].first:.2f} with {c.thinned[-1].rows}: a fixed F is another rule for each sampling.",
        ),
        Claim(
            ("E-C12",),
            "Independent rows that the fit is worth",
            "",
            f"{_worth(c):.0f} of {len(c.fit)}",
            None,
            "F takes all rows as independent.",
        ),
        Claim(
            ("E-T5",),
            "On-line RMS with temperatures as they are in place of their rise from the start of the test",
            "",
            f"{c.absolute.rms:.2f} um instead of {Errors.of(c.left[STEPWISE]).rms:.2f} um",
            None,
        ),
    ]


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[Table, ...]:
    steps = [_step(s) for s in c.selection.log_]
    thinned = [
        [
            str(t.rows),
            f"{t.effective:.0f}",
            f"{t.first:.2f}",
            str(len(t.names)),
            ", ".join(map(_place, t.names)),
            f"{t.rms:.2f}",
        ]
        for t in c.thinned
    ]
    tests = (("fit", c.left_in_fit), ("on-line", c.left))
    return (
        Table(
            "Steps of the selection",
            ("step", "temperature", "partial F", "alpha if rows were independent", "R2", "change of R2"),
            steps,
        ),
        errors_table("What the methods leave", {(what, m): e for what, left in tests for m, e in left.items()}),
        Table(
            "What a fixed F owes to the number of rows (E-T3)",
            ("rows", "independent", "R2 a first one needs", "chosen", "which", "on-line RMS [um]"),
            thinned,
        ),
    )


def _step(s: Step) -> list[str]:
    sign = "+" if s.action == "enter" else "-"
    return [
        str(s.number),
        f"{sign} {_place(s.term)}",
        f"{s.f:.1f}",
        f"{s.alpha:.1e}",
        f"{s.r_squared:.4f}",
        f"{s.r_squared_step:+.1e}",
    ]


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, clock = c.fit.time / 3600, c.online.time / 3600
    x, now = c.fit.deviations[:, 0], c.online.deviations[:, 0]
    compared = (STEPWISE, LEAST, PURSUIT)
    warm = [Curve(f"No. {k}, {_place(c.fit.inputs[k - 1].name)}", hours, c.fit.values[:, k - 1]) for k in FIGURE_2]
    rows = np.array([float(t.rows) for t in c.thinned])
    kept = np.array([float(len(t.names)) for t in c.thinned])
    return (
        Figure(
            "stepwise2017-fig2",
            "Fig. 2 and 4: temperatures No. 3, 11 and 14 of our sensors, and the drift of X.",
            [
                Panel("temperatures", "time [h]", "[degC]", warm),
                Panel("drift", "time [h]", "x [um]", [Curve("", hours, x)]),
            ],
            columns=2,
        ),
        Figure(
            "stepwise2017-fig6",
            "Fig. 6: on another day with other speeds, the drift and its predictions, and what each of them leaves.",
            [
                Panel(
                    "predicted",
                    "time [h]",
                    "x [um]",
                    [*(Curve(m, clock, now - c.left[m]) for m in compared), Curve("measured", clock, now, "dashed")],
                ),
                Panel("residual", "time [h]", "[um]", [Curve(m, clock, c.left[m]) for m in compared]),
            ],
            columns=1,
        ),
        Figure(
            "stepwise2017-rows",
            "Not in the paper: the same test, every row to every 16th, and how many temperatures F_E = 100 keeps.",
            [Panel("", "rows", "temperatures", [Curve("", rows, kept)])],
            columns=2,
        ),
    )


def _numbers(c: Computed) -> dict[str, float]:
    online = {name: Errors.of(e) for name, e in c.left.items()}
    return {
        "temperatures": float(len(c.fit.inputs) - 1),
        "chosen": float(len(c.chosen)),
        "rms_online_none_um": online[NONE].rms,
        "rms_online_um": online[STEPWISE].rms,
        "max_online_um": online[STEPWISE].max_abs,
        "rms_online_least_squares_um": online[LEAST].rms,
        "rms_online_projection_pursuit_um": online[PURSUIT].rms,
        "rms_online_principal_components_um": online[COMPONENTS].rms,
        "rms_online_sliced_inverse_um": online[SLICED].rms,
        "rms_fit_um": Errors.of(c.left_in_fit[STEPWISE]).rms,
        "chosen_of_fewest_rows": float(len(c.thinned[-1].names)),
    }


def _worth(c: Computed) -> float:
    return effective_sample_size(c.left_in_fit[STEPWISE])


def _place(name: str) -> str:
    return name.removeprefix("t_").removesuffix("_C")
