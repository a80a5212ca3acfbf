"""Reproduction of stepwise2017: few of 24 temperatures, selected by partial F and judged on-line (T-01 to T-10).

Temperatures are relative to the start of the test, as in Fig. 2 of the paper. Its own comparison (Fig. 6) is on-line,
so methods are judged by their RMS residual in a test on another day with other speeds.
"""

import numpy as np

from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import errors_table, rms
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.stepwise2017 import setup
from thermocomp.papers.stepwise2017.setup import F_ENTER, LEAST, PAPERS_RESIDUAL, PURSUIT, STEPWISE, Computed
from thermocomp.papers.study import Figure, Part, Progress, Study, StudyTable

TITLE = "Open Mech. Eng. J. 11 (2017): Temperature measurement point optimization by stepwise regression"
#: numbers of the temperatures in Fig. 2 of the paper, whose description is not used (E-T6)
FIGURE_2 = (3, 11, 14)


def run(seed: int, progress: Progress) -> Study:
    """Reproduce the study stepwise2017, and return its claims, tables and figures."""
    c = setup.compute(seed, progress)
    numbers = exhibits.numbers("redo", c, temperatures=len(c.fit.inputs) - 1, fewest=c.thinned[-1].names)
    return Study.of("stepwise2017", TITLE, Part(claims(c), _tables(c), _figures(c), numbers))


def _place(name: str) -> str:
    return name.removeprefix("t_").removesuffix("_C")


claims, exhibits = Claims[Computed](__name__, setup), Exhibits(__name__)


@claims.facts
def _given(c: Computed) -> Facts:
    return {"temperatures": len(c.fit.inputs) - 1}


@claims.facts
def _first(c: Computed) -> Facts:
    log = c.selection.log_
    return {"holds": bool(log)} | ({"place": _place(log[0].term), "f": log[0].f} if log else {})


@claims.facts
def _few(c: Computed) -> Facts:
    log = c.selection.log_
    facts = {"places": list(map(_place, c.chosen)), "any": bool(log), "fewest": c.thinned[-1]}
    few, as_many = 1 <= len(c.chosen) <= setup.PAPERS_COUNT, len(c.chosen) == setup.PAPERS_COUNT
    facts |= {"holds": few, "as_many": as_many}
    return facts | ({"last": log[-1], "explained": F_ENTER / (F_ENTER + log[-1].df)} if log else {})


@claims.facts
def _model(c: Computed) -> Facts:
    return {"formula": c.models[STEPWISE].formula()}


@claims.facts
def _deleted(c: Computed) -> Facts:
    return {"places": [_place(s.term) for s in c.selection.log_ if s.action == "remove"] or "none"}


@claims.facts
def _beats(c: Computed, other: str) -> Facts:
    ours, theirs = c.errors[STEPWISE].rms, c.errors[other].rms
    fit, its = rms(c.left_in_fit[STEPWISE]), rms(c.left_in_fit[other])
    return {"ours": ours, "theirs": theirs, "ratio": ours / theirs, "fit": fit, "its": its, "closer": its < fit}


@claims.facts
def _bounded(c: Computed) -> Facts:
    online, drift, little = c.on_dsp, c.errors[setup.NONE].max_abs, 2 * PAPERS_RESIDUAL
    over = float(np.mean(np.abs(c.left_exported) > PAPERS_RESIDUAL))
    tiny = online.max_abs < PAPERS_RESIDUAL and drift < little
    return {"online": online, "drift": drift, "over": over, "little": little, "tiny": tiny}


@claims.facts
def _robust(c: Computed) -> Facts:
    told, factors = [], {}
    for m in (STEPWISE, LEAST, PURSUIT):
        clean, noisy, without = _stressed(c, m)
        factors[m] = noisy / clean, without / clean
        told.append((m, noisy, _place(c.shaken[m].worst_lost[0]), without, clean))
    ours = factors[STEPWISE]
    return {
        "told": told,
        "stepwise": ours,
        "others": [(m.partition(",")[0], *factors[m]) for m in (LEAST, PURSUIT)],
        "holds": all(ours[0] < factors[m][0] and ours[1] < factors[m][1] for m in (LEAST, PURSUIT)),
    }


@claims.facts
def _recommended(c: Computed) -> Facts:
    return {"averaged": _stressed(c, setup.AVERAGED), "its": _stressed(c, STEPWISE)}


def _stressed(c: Computed, method: str) -> tuple[float, float, float]:
    """Return the RMS on-line: undisturbed, with noise, and with the worst sensor lost [um]."""
    return c.errors[method].rms, c.shaken[method].noise_rms["uniform"][0], c.shaken[method].worst_lost[1]


@claims.facts
def _thinned(c: Computed) -> Facts:
    kept = [(len(t.names), t.rows) for t in c.thinned]
    return {"kept": kept, "most": c.thinned[0], "fewest": c.thinned[-1]}


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[StudyTable, ...]:
    steps = [(s, "+" if s.action == "enter" else "-", _place(s.term)) for s in c.selection.log_]
    tests = (("fit", c.left_in_fit), ("on-line", c.left))
    return (
        exhibits.table("steps", steps),
        errors_table("Residuals of the methods", {(what, m): e for what, left in tests for m, e in left.items()}),
        exhibits.table("thinned", [(t, list(map(_place, t.names))) for t in c.thinned]),
    )


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, clock, now = c.fit.time / 3600, c.online.time / 3600, c.online.deviations[:, 0]
    warm = {f"No. {k}, {_place(c.fit.inputs[k - 1].name)}": c.fit.values[:, k - 1] for k in FIGURE_2}
    left = {m: c.left[m] for m in (STEPWISE, LEAST, PURSUIT)}
    estimated = {m: now - e for m, e in left.items()} | {"measured": now}
    rows, kept = np.array([(float(t.rows), float(len(t.names))) for t in c.thinned]).T
    return (
        exhibits.figure("stepwise2017-fig2", (hours, warm), (hours, {"": c.fit.deviations[:, 0]})),
        exhibits.figure("stepwise2017-fig6", (clock, estimated), (clock, left)),
        exhibits.figure("stepwise2017-rows", (rows, {"": kept})),
    )
