"""Reproduction of stepwise2017: few of 24 temperatures, selected by partial F and judged on-line (T-01 to T-10).

Temperatures are relative to the start of the test, as in Fig. 2 of the paper. Its own comparison (Fig. 6) is on-line,
so methods are judged by their RMS residual in a test on another day with other speeds.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from thermocomp.models.numerics.stepwise import StepwiseStep
from thermocomp.papers.common import Errors, errors_table, rms, table
from thermocomp.papers.pictures import curves, single
from thermocomp.papers.stepwise2017 import setup
from thermocomp.papers.stepwise2017.setup import F_ENTER, LEAST, PAPERS_RESIDUAL, PURSUIT, STEPWISE, Computed, Thinned
from thermocomp.papers.study import Claims, Figure, Ours, Panel, Part, Progress, Study, StudyTable

TITLE = "Open Mech. Eng. J. 11 (2017): Temperature measurement point optimization by stepwise regression"
#: numbers of the temperatures in Fig. 2 of the paper
FIGURE_2 = (3, 11, 14)


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
    return Study.of("stepwise2017", TITLE, Part(claims(c), _tables(c), _figures(c), _numbers(c)))


def _place(name: str) -> str:
    return name.removeprefix("t_").removesuffix("_C")


# -- the selection -----------------------------------------------------------------------------------------------------

claims = Claims[Computed]()


@claims.add("T-01", "Temperatures, and rows of the test", "24")
def _given(c: Computed) -> str:
    return f"{len(c.fit.inputs) - 1}, {len(c.fit)} rows"


@claims.add("T-03 T-04", f"The best single temperature reaches F_E = {F_ENTER:g}", f">= {F_ENTER:g}")
def _first(c: Computed) -> Ours:
    log = c.selection.log_
    return Ours(
        f"{_place(log[0].term)}: F = {log[0].f:.0f}" if log else "none does",
        bool(log),
        f"A first variable needs R2 >= {c.thinned[0].first:.2f} with {len(c.fit)} rows.",
    )


@claims.add(
    "T-03 T-07",
    "F_E = 100 and F_D = 50 leave five temperatures of 24, or fewer",
    f"5: {', '.join(map(str, setup.PAPERS_CHOICE))}",
)
def _few(c: Computed) -> Ours:
    n, count, log = len(c.fit), len(c.chosen), c.selection.log_
    many = "No temperature reaches F_E."
    if log:
        many = (
            f"F grows with the number of rows: with {n} rows F_E is reached by what still explains "
            f"{F_ENTER / (F_ENTER + log[-1].df):.0%} of the rest, and the rows are not independent (worth "
            f"{c.worth:.0f}). The last step raised R2 by {log[-1].r_squared_step:.1e}; thinned to "
            f"{c.thinned[-1].rows} rows it keeps {len(c.thinned[-1].names)}."
        )
    return Ours(f"{count}: {', '.join(map(_place, c.chosen))}", 1 <= count <= len(setup.PAPERS_CHOICE), many)


@claims.add("T-05 T-06", "Temperatures that came in and were deleted again")
def _deleted(c: Computed) -> str:
    return ", ".join(_place(s.term) for s in c.selection.log_ if s.action == "remove") or "none"


# -- on-line -----------------------------------------------------------------------------------------------------------


def _beats(c: Computed, other: str) -> Ours:
    ours, theirs = c.errors[STEPWISE].rms, c.errors[other].rms
    fit, its = rms(c.left_in_fit[STEPWISE]), rms(c.left_in_fit[other])
    reason = (
        "what the temperatures it leaves out know is true on another day too, with as little noise."
        if its < fit
        else "its advantage shows on the new day only."
    )
    return Ours(
        f"RMS {ours:.2f} um, {theirs:.2f} um",
        ours < theirs,
        f"{ours / theirs:.2f} times its error. In the fit stepwise leaves {fit:.2f} um, the other {its:.2f} um: "
        f"{reason}",
    )


for _name, _called in ((LEAST, "least squares on all temperatures"), (PURSUIT, "projection pursuit regression")):
    claims.add("T-08 T-09", f"On-line, stepwise regression predicts better than {_called}", "better (Fig. 6)")(
        partial(_beats, other=_name)
    )


@claims.add("T-08 T-09", f"On-line, the residual stays below {PAPERS_RESIDUAL:g} um", f"< {PAPERS_RESIDUAL:g} um")
def _bounded(c: Computed) -> Ours:
    online, drift = c.errors[STEPWISE], c.errors[setup.NONE].max_abs
    over = float(np.mean(np.abs(c.left[STEPWISE]) > PAPERS_RESIDUAL))
    holds = online.max_abs < PAPERS_RESIDUAL
    tiny = holds and drift < 2 * PAPERS_RESIDUAL
    return Ours(
        f"{online.max_abs:.1f} um at most; without compensation {drift:.1f} um",
        holds,
        f"It is above in {over:.0%} of the rows; RMS {online.rms:.2f} um. In the test it was fitted to it is "
        f"{Errors.of(c.left_in_fit[STEPWISE]).max_abs:.1f} um at most. The model knows temperatures, not how they came "
        "about: speeds that change and rooms that differ leave what the chosen sensors do not see.",
        note=f"The drift itself is below {2 * PAPERS_RESIDUAL:g} um: this says little." if tiny else "",
    )


@claims.add("T-08", "Residual in the test that was fitted to")
def _in_fit(c: Computed) -> str:
    return f"{Errors.of(c.left_in_fit[STEPWISE]).max_abs:.1f} um at most"


@claims.add("T-10", "On-line RMS of the neighbours: principal components (Miao), sliced inverse regression (Zhang)")
def _neighbours(c: Computed) -> str:
    return f"{c.errors[setup.COMPONENTS].rms:.2f} um, {c.errors[setup.SLICED].rms:.2f} um"


# -- beyond the paper --------------------------------------------------------------------------------------------------


@claims.add(
    "E-T5",
    "Robustness is considerably improved (criterion: noise of 0.4 degC and the worst single lost sensor "
    "multiply the on-line error less than those of both others)",
    "claimed, not shown",
)
def _robust(c: Computed) -> Ours:
    told, noise, lost = [], {}, {}
    for m, shaken in c.shaken.items():
        clean, noisy, (sensor, without) = c.errors[m].rms, shaken.noise_rms["uniform"][0], shaken.worst_lost
        noise[m], lost[m] = noisy / clean, without / clean
        told.append(f"{m}: noise {noisy:.1f} um, {_place(sensor)} lost {without:.1f} um, clean {clean:.1f} um")
    return Ours(
        f"noise x {noise[STEPWISE]:.1f}, lost sensor x {lost[STEPWISE]:.1f}; least squares x {noise[LEAST]:.1f}, "
        f"x {lost[LEAST]:.1f}; projection pursuit x {noise[PURSUIT]:.1f}, x {lost[PURSUIT]:.1f}",
        all(noise[STEPWISE] < noise[m] and lost[STEPWISE] < lost[m] for m in (LEAST, PURSUIT)),
        "With few sensors each one counts for more.",
        note=f"{'; '.join(told)}.",
    )


@claims.add("E-T3", f"Temperatures that F_E = {F_ENTER:g} and F_D = {setup.F_DELETE:g} keep of the same test, thinned")
def _thinned(c: Computed) -> Ours:
    return Ours(
        ", ".join(f"{len(t.names)} with {t.rows} rows" for t in c.thinned),
        note=f"A first variable needs R2 >= {c.thinned[0].first:.2f} with {c.thinned[0].rows} rows and "
        f"{c.thinned[-1].first:.2f} with {c.thinned[-1].rows}: a fixed F is another rule for each sampling.",
    )


@claims.add("E-C12", "Independent rows that the fit is worth")
def _worth(c: Computed) -> Ours:
    return Ours(f"{c.worth:.0f} of {len(c.fit)}", note="F takes all rows as independent.")


@claims.add("E-T5", "On-line RMS with temperatures as they are in place of their rise from the start of the test")
def _absolute(c: Computed) -> str:
    return f"{c.absolute:.2f} um instead of {c.errors[STEPWISE].rms:.2f} um"


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[StudyTable, ...]:
    steps: dict[str, Callable[[StepwiseStep], str]] = {
        "step": lambda s: str(s.number),
        "temperature": lambda s: f"{'+' if s.action == 'enter' else '-'} {_place(s.term)}",
        "partial F": lambda s: f"{s.f:.1f}",
        "alpha if rows were independent": lambda s: f"{s.alpha:.1e}",
        "R2": lambda s: f"{s.r_squared:.4f}",
        "change of R2": lambda s: f"{s.r_squared_step:+.1e}",
    }
    thinned: dict[str, Callable[[Thinned], str]] = {
        "rows": lambda t: str(t.rows),
        "independent": lambda t: f"{t.effective:.0f}",
        "R2 a first one needs": lambda t: f"{t.first:.2f}",
        "chosen": lambda t: str(len(t.names)),
        "which": lambda t: ", ".join(map(_place, t.names)),
        "on-line RMS [um]": lambda t: f"{t.rms:.2f}",
    }
    tests = (("fit", c.left_in_fit), ("on-line", c.left))
    return (
        table("Steps of the selection", c.selection.log_, steps),
        errors_table("What the methods leave", {(what, m): e for what, left in tests for m, e in left.items()}),
        table("What a fixed F owes to the number of rows (E-T3)", c.thinned, thinned),
    )


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, clock, now = c.fit.time / 3600, c.online.time / 3600, c.online.deviations[:, 0]
    warm = {f"No. {k}, {_place(c.fit.inputs[k - 1].name)}": c.fit.values[:, k - 1] for k in FIGURE_2}
    left = {m: c.left[m] for m in (STEPWISE, LEAST, PURSUIT)}
    estimated = {m: now - e for m, e in left.items()} | {"measured": now}
    rows, kept = np.array([(float(t.rows), float(len(t.names))) for t in c.thinned]).T
    return (
        Figure(
            "stepwise2017-fig2",
            "Fig. 2 and 4: temperatures No. 3, 11 and 14 of our sensors, and the drift of X.",
            [
                Panel("temperatures", "time [h]", "[degC]", curves(hours, warm)),
                Panel("drift", "time [h]", "x [um]", curves(hours, {"": c.fit.deviations[:, 0]})),
            ],
            columns=2,
        ),
        Figure(
            "stepwise2017-fig6",
            "Fig. 6: on another day with other speeds, the drift and its predictions, and what each of them leaves.",
            [
                Panel("predicted", "time [h]", "x [um]", curves(clock, estimated, dashed=["measured"])),
                Panel("residual", "time [h]", "[um]", curves(clock, left)),
            ],
        ),
        single(
            "stepwise2017-rows",
            "Not in the paper: the same test, every row to every 16th, and how many temperatures F_E = 100 keeps.",
            ("rows", "temperatures"),
            curves(rows, {"": kept}),
            columns=2,
        ),
    )


def _numbers(c: Computed) -> dict[str, float]:
    short = {
        setup.NONE: "_none",
        STEPWISE: "",
        LEAST: "_least_squares",
        PURSUIT: "_projection_pursuit",
        setup.COMPONENTS: "_principal_components",
        setup.SLICED: "_sliced_inverse",
    }
    return {
        "temperatures": float(len(c.fit.inputs) - 1),
        "chosen": float(len(c.chosen)),
        "max_online_um": c.errors[STEPWISE].max_abs,
        "rms_fit_um": rms(c.left_in_fit[STEPWISE]),
        "chosen_of_fewest_rows": float(len(c.thinned[-1].names)),
    } | {f"rms_online{name}_um": c.errors[m].rms for m, name in short.items()}
