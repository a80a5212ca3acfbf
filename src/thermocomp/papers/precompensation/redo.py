"""Reproduction of pre-compensation: drift from the spindle speed alone, added to the NC program (P-01 to P-07).

The text is a fragment: figures and the equation are lost (E-P1). The model is identified in one test with the speeds of
milling jobs, and judged in free run in another with new speeds (P-05), at four positions of Z. The cutting tests are
simulated twice: here by applying the schedule of corrections to recordings, and in
`thermocomp.papers.precompensation.cutting` with NC programs that are revised, read back and milled.
"""

from dataclasses import replace

import numpy as np

from thermocomp.models.selection.orders import Order
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import errors_table, rms
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.precompensation import cutting, cuttingtold, setup
from thermocomp.papers.precompensation.setup import CHOSEN, CUTS, LEAST, LINEAR, NET, NONE, POSITIONS, Computed
from thermocomp.papers.study import Figure, Part, Progress, Study, StudyTable

TITLE = "Pre-compensation of thermal errors by revising the NC program"
#: criterion for "describes thermal errors well": minimum explained share of the variance at every position
WELL = 0.9
#: criterion for "errors at any z can be obtained": maximum ratio of the interpolated RMS to that of a local model
AS_WELL = 1.1
#: minimum share of rows outside the identified range that is reported
BEYOND = 0.02


def run(seed: int, progress: Progress) -> Study:
    """Reproduce the study of pre-compensation, and return its claims, tables and figures."""
    c = setup.compute(seed, lambda share, what: progress(share / 2, what))
    c = replace(c, models=c.models | cutting.house_models(c.learn))
    m = cutting.compute(c.models, seed, lambda share, what: progress((1 + share) / 2, what))
    recorded = Part(claims(c), _tables(c), _figures(c), exhibits.numbers("redo", c, first=c.by_fpe[0]))
    milled = Part(cuttingtold.claims(m), cuttingtold.tables(m), cuttingtold.figures(m), cuttingtold.numbers(m))
    return Study.of("precompensation", TITLE, recorded, milled)


claims, exhibits = Claims[Computed](__name__, setup), Exhibits(__name__)


@claims.facts
def _orders(c: Computed) -> Facts:
    plain = [next(o.fpe for o in table if (o.k, o.m) == setup.PAPERS_ORDERS) for table in c.orders]
    return {
        "best": [(p, o.k, o.m) for p, o in zip(POSITIONS, c.by_fpe, strict=True)],
        "holds": all((o.k, o.m) == setup.PAPERS_ORDERS for o in c.by_fpe),
        "more": max(p / o.fpe for p, o in zip(plain, c.by_fpe, strict=True)),
        "worth": c.errors[CHOSEN].rms < c.errors[LEAST].rms,
        "others": [(h / 60, *orders) for h, (orders, _, _) in c.clocks.items()],
    }


@claims.facts
def _net(c: Computed) -> Facts:
    return {"others": [(name, c.errors[name].rms) for name in c.models if name not in (NET, LEAST, CHOSEN)]}


@claims.facts
def _described(c: Computed) -> Facts:
    z, learned, left, shares = c.judge.deviations, c.learn.deviations, c.left[NET], c.shares(NET)
    beyond = (z < learned.min(axis=0)) | (z > learned.max(axis=0))
    facts = {"shares": shares, "holds": all(s >= WELL for s in shares)}
    facts |= {"outside": beyond.mean() > BEYOND, "beyond": beyond.mean()}
    facts |= {"learned": learned.min(), "judged": z.min(), "within": rms(left[~beyond])}
    return facts | {"least_share": min(c.shares(LEAST)), "fpe_share": min(c.shares(CHOSEN))}


@claims.facts
def _interpolated(c: Computed) -> Facts:
    z = c.judge.deviations
    inner = range(1, len(POSITIONS) - 1)
    errors = [(POSITIONS[k], rms(z[:, k] - c.interpolated(k, NET)), rms(c.left[NET][:, k])) for k in inner]
    holds = all(between <= AS_WELL * own for _, between, own in errors)
    return {"errors": errors, "holds": holds, "apart": rms(z[:, 0] - z[:, -1]), "last": POSITIONS[-1]}


@claims.facts
def _scheduled(c: Computed) -> Facts:
    return {"step": np.abs(np.diff(c.schedule, axis=0)).max()}


@claims.facts
def _depth(c: Computed) -> Facts:
    without, with_ = c.depths
    worse = sum(after > before for before, after in (k.means for k in c.cuts))
    return {"without": without, "with": with_, "left": with_ / without, "worse": worse}


@claims.facts
def _between(c: Computed) -> Facts:
    means = {name: float(np.mean([k.means[1] for k in tests])) for name, tests in c.between.items()}
    without = float(np.mean([k.means[0] for k in c.between[LINEAR]]))
    joined = [[k.scheduled for k in tests] for name, tests in c.between.items() if name != setup.NEAREST]
    holds = max(means.values()) <= setup.SHARE * without
    return {"without": without, "means": means, "apart": np.ptp(joined, axis=0).max(), "holds": holds}


@claims.facts
def _warm(c: Computed) -> Facts:
    cold, carried, none = (rms(e[c.warm.hours <= 1]) for e in (c.warm.cold, c.warm.carried, c.warm.drift))
    return {"cold": cold, "carried": carried, "none": none, "harmful": cold > none}


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[StudyTable, ...]:
    order = range(setup.GREATEST + 1)
    table = {(o.k, o.m): o for o in c.orders[0]}
    left = {(f"z at {p} mm", name): e[:, j] for j, p in enumerate(POSITIONS) for name, e in c.left.items()}
    between = [(name, np.mean([np.abs(k.scheduled) for k in tests], axis=0)) for name, tests in c.between.items()]
    return (
        exhibits.table("orders", [(k, [_fpe(table.get((k, m))) for m in order]) for k in order]),
        errors_table("Free run in the verification: residual", left),
        exhibits.table("clocks", [(h / 60, *clock) for h, clock in c.clocks.items()]),
        exhibits.table("cuts", [(n, k.without, k.scheduled) for n, k in enumerate(c.cuts, start=1)]),
        exhibits.table("between", [(NONE, np.mean([np.abs(k.without) for k in c.between[LINEAR]], axis=0)), *between]),
    )


def _fpe(order: Order | None) -> str:
    if order is None:
        return ""
    return f"{order.fpe:.2f}" if order.admissible else f"({order.fpe:.2f})"


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, z, left = c.judge.time / 3600, c.judge.deviations, c.left[NET]
    first, last = (
        {"measured": z[:, k], "net": c.free_run[NET][:, k], "residual": left[:, k]} for k in (0, len(POSITIONS) - 1)
    )
    added = {"drift": z[:, 0], "added to the program": c.schedule[:, 0], "left": z[:, 0] + c.schedule[:, 0]}
    without, with_ = np.array([k.means for k in c.cuts]).T
    warm = {"drift": c.warm.drift, "residual, cold start": c.warm.cold, "residual, state carried over": c.warm.carried}
    return (
        exhibits.figure("precompensation-fig4", (hours, first), (hours, last)),
        exhibits.figure("precompensation-schedule", (hours, added)),
        exhibits.figure("precompensation-cut", (np.arange(1.0, CUTS + 1), {"without": without, "with": with_})),
        exhibits.figure("precompensation-warm", (c.warm.hours, warm)),
    )
