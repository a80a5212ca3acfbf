"""Reproduction of pre-compensation: drift from the spindle speed alone, added to the NC program (P-01 to P-07).

The text is a fragment: figures and the equation are lost (E-P1). The model is identified in one test with the speeds of
milling jobs, and judged in free run in another with new speeds (P-05), at four positions of Z. The cutting tests are
simulated twice: here by applying the schedule of corrections to recordings, and in
`thermocomp.papers.precompensation.cutting` with NC programs that are revised, read back and milled.
"""

import numpy as np

from thermocomp.models.selection.orders import Order
from thermocomp.papers.common import Errors, errors_table, rms
from thermocomp.papers.pictures import curves, single
from thermocomp.papers.precompensation import cutting, cuttingtold, setup
from thermocomp.papers.precompensation.setup import CHOSEN, CUTS, LEAST, NET, PAPERS_DEPTHS, POSITIONS, Computed
from thermocomp.papers.study import Claims, Figure, Ours, Panel, Part, Progress, Study, StudyTable

TITLE = "Pre-compensation of thermal errors by revising the NC program"
#: criterion for "describes thermal errors well": minimum explained share of the variance at every position
WELL = 0.9
#: criterion for "errors at any z can be obtained": maximum ratio of the interpolated RMS to that of a local model
AS_WELL = 1.1
#: minimum share of rows outside the identified range that is reported
BEYOND = 0.02


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
    c = setup.compute(seed, lambda share, what: progress(share / 2, what))
    models = c.models | cutting.house_models(c.learn)
    m = cutting.compute(models, seed, lambda share, what: progress((1 + share) / 2, what))
    recorded = Part(claims(c), _tables(c), _figures(c), _numbers(c))
    milled = Part(cuttingtold.claims(m), cuttingtold.tables(m), cuttingtold.figures(m), cuttingtold.numbers(m))
    return Study.of("precompensation", TITLE, recorded, milled)


# -- models ------------------------------------------------------------------------------------------------------------

claims = Claims[Computed]()


@claims.add("P-01 P-02", "The final prediction error chooses k = 1 and m = 0, at every position", "k = 1, m = 0")
def _orders(c: Computed) -> Ours:
    best = [(o.k, o.m) for o in c.by_fpe]
    plain = [next(o.fpe for o in table if (o.k, o.m) == setup.PAPERS_ORDERS) for table in c.orders]
    chosen, least = rms(c.left[CHOSEN]), rms(c.left[LEAST])
    others = "; ".join(f"{h / 60:g} min: k = {k}, m = {m}" for h, ((k, m), _, _) in c.clocks.items())
    worth = "the larger model is not the better one (E-P3)." if chosen >= least else "they are worth it."
    return Ours(
        "; ".join(f"{p} mm: k = {k}, m = {m}" for p, (k, m) in zip(POSITIONS, best, strict=True)),
        all(orders == setup.PAPERS_ORDERS for orders in best),
        f"With k = 1, m = 0 it is at most {max(p / o.fpe for p, o in zip(plain, c.by_fpe, strict=True)):.2f} times as "
        f"large. In free run under new conditions the orders it chooses leave {chosen:.2f} um RMS, k = 1, m = 0 "
        f"{least:.2f} um: {worth} By the step of time: {others}.",
    )


@claims.add("P-03 E-P2", "Free run of the net, its hidden nodes by trial, and of least squares with the same orders")
def _net(c: Computed) -> str:
    return f"RMS {rms(c.left[NET]):.2f} um ({', '.join(map(str, c.hidden))} hidden nodes), {rms(c.left[LEAST]):.2f} um"


# -- free run ----------------------------------------------------------------------------------------------------------


@claims.add(
    "P-05",
    f"The model describes the drift under new conditions well (criterion: {WELL:.0%} of its variance at every "
    "position, in free run)",
    "well (Fig. 4)",
)
def _described(c: Computed) -> Ours:
    z, learned, left, shares = c.judge.deviations, c.learn.deviations, c.left[NET], c.shares(NET)
    beyond = (z < learned.min(axis=0)) | (z > learned.max(axis=0))
    outside = ""
    if beyond.mean() > BEYOND:
        outside = (
            f"{beyond.mean():.0%} of the drift goes beyond what the identification showed (to {learned.min():.0f} um, "
            f"here to {z.min():.0f} um), where the net's sigmoid ends; within, its RMS is {rms(left[~beyond]):.2f} um. "
        )
    return Ours(
        f"{', '.join(f'{s:.1%}' for s in shares)}; RMS {rms(left):.2f} um instead of {rms(z):.2f} um",
        all(s >= WELL for s in shares),
        f"What it leaves is {Errors.of(left).max_abs:.1f} um at most. {outside}"
        f"Least squares describes {min(c.shares(LEAST)):.0%} or more with the same orders and "
        f"{min(c.shares(CHOSEN)):.0%} or more with those by FPE: k = 1 is one time constant for all stores of heat, "
        "and none of them knows the room.",
    )


@claims.add("E-P3", "RMS one step ahead, with the measured drift of ten minutes before, and in free run")
def _one_step(c: Computed) -> str:
    return f"{c.one_step:.2f} um, {rms(c.left[LEAST]):.2f} um"


@claims.add(
    "P-04",
    "Between the positions of the models the drift can be interpolated (criterion: left out, a position is "
    f"predicted by the others with at most {AS_WELL:g} times the RMS of its own model)",
    "at any z",
)
def _interpolated(c: Computed) -> Ours:
    z = c.judge.deviations
    errors = {POSITIONS[k]: (rms(z[:, k] - c.interpolated(k, NET)), rms(c.left[NET][:, k])) for k in c.inner}
    return Ours(
        "; ".join(f"{p} mm: {between:.2f} um, own model {own:.2f} um" for p, (between, own) in errors.items()),
        all(between <= AS_WELL * own for between, own in errors.values()),
        note=f"The drift at {POSITIONS[0]} and {POSITIONS[-1]} mm differs by {rms(z[:, 0] - z[:, -1]):.1f} um RMS; "
        "here the neighbours are up to 400 mm apart, in the paper half as far.",
    )


# -- cutting tests -----------------------------------------------------------------------------------------------------


@claims.add(
    "P-06 E-P4",
    "The program corrected every 10 min, minus the deviation being added to Z: RMS left, and with a correction "
    "at every moment",
    "every 10 min",
)
def _scheduled(c: Computed) -> Ours:
    return Ours(
        f"{rms(c.judge.deviations + c.schedule):.2f} um, {rms(c.left[NET]):.2f} um",
        note=f"From one correction to the next it changes by {np.abs(np.diff(c.schedule, axis=0)).max():.1f} um at "
        "most: a step in the surface. Deviation is actual minus commanded, so the paper's adding is a matter of sign.",
    )


@claims.add(
    "P-07",
    "Depth difference of surfaces milled cold and after 1 h of varying speeds (criterion: at most the paper's "
    f"share of it is left, {setup.SHARE:.2f})",
    f"{PAPERS_DEPTHS[0]:g} -> {PAPERS_DEPTHS[1]:g} um",
)
def _depth(c: Computed) -> Ours:
    without, with_ = c.depths
    worse = sum(after > before for before, after in (k.means for k in c.cuts))
    return Ours(
        f"{without:.1f} -> {with_:.1f} um, mean of {CUTS} tests and {len(POSITIONS)} positions",
        with_ <= setup.SHARE * without,
        "What is left is the model's error in free run, after an hour that it was not taught.",
        note=f"It falls to {with_ / without:.2f} of what it was; it grows in {worse} of {CUTS} tests.",
    )


# -- limits ------------------------------------------------------------------------------------------------------------


@claims.add(
    "E-P5",
    "A job that begins on a warm machine: RMS in its first hour if the model begins cold, and if it continues "
    "from the last job",
    "assumes a cold start",
)
def _warm(c: Computed) -> Ours:
    cold, carried, none = (rms(e[c.warm.hours <= 1]) for e in (c.warm.cold, c.warm.carried, c.warm.drift))
    return Ours(
        f"{cold:.1f} um, {carried:.1f} um; without compensation {none:.1f} um",
        note="Begun cold it is worse than no compensation." if cold > none else "",
    )


@claims.add(
    "E-P6",
    "The same verification in a workshop whose air follows the day, and what the room alone moves Z by in a "
    "day at rest",
    "a relatively stable environment",
)
def _room(c: Computed) -> Ours:
    return Ours(
        f"RMS {c.workshop:.2f} um instead of {rms(c.left[NET]):.2f} um; {c.room:.1f} um peak to peak",
        note="A model that knows only the speed sees nothing of the room.",
    )


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[StudyTable, ...]:
    order = range(setup.GREATEST + 1)
    table = {(o.k, o.m): o for o in c.orders[0]}
    fpe = [[f"k = {k}", *(_fpe(table.get((k, m))) for m in order)] for k in order]
    left = {(f"z at {p} mm", name): e[:, j] for j, p in enumerate(POSITIONS) for name, e in c.left.items()}
    clocks = [
        [f"{h / 60:g}", f"{k}, {m}", f"{chosen:.2f}", f"{paper:.2f}"] for h, ((k, m), chosen, paper) in c.clocks.items()
    ]
    cuts = [[f"test {n}", *(f"{v:+.1f}" for v in (*k.without, *k.scheduled))] for n, k in enumerate(c.cuts, start=1)]
    first = f"at z = {POSITIONS[0]} mm"
    return (
        StudyTable(
            f"Final prediction error [um2] {first}, steps of 10 min; in brackets: the free run does not decay",
            ("", *(f"m = {m}" for m in order)),
            fpe,
        ),
        errors_table("Free run in the verification: what is left", left),
        StudyTable(
            f"Orders by the step of time, {first}",
            ("step [min]", "k, m by FPE", "free-run RMS [um]", "with k = 1, m = 0 [um]"),
            clocks,
        ),
        StudyTable(
            "Depth difference of the second surface to the first [um]",
            ("", *(f"{p} mm{what}" for what in ("", ", corrected") for p in POSITIONS)),
            cuts,
        ),
    )


def _fpe(order: Order | None) -> str:
    if order is None:
        return ""
    return f"{order.fpe:.2f}" if order.admissible else f"({order.fpe:.2f})"


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, z, left = c.judge.time / 3600, c.judge.deviations, c.left[NET]
    predicted = {
        k: {"measured": z[:, k], "net": c.free_run[NET][:, k], "residual": left[:, k]} for k in (0, len(POSITIONS) - 1)
    }
    added = {"drift": z[:, 0], "added to the program": c.schedule[:, 0], "left": z[:, 0] + c.schedule[:, 0]}
    without, with_ = np.array([k.means for k in c.cuts]).T
    warm = {"drift": c.warm.drift, "left, begun cold": c.warm.cold, "left, carried over": c.warm.carried}
    return (
        Figure(
            "precompensation-fig4",
            "Fig. 4: drift of Z under new conditions, and its prediction from the spindle speed alone.",
            [
                Panel(f"z at {POSITIONS[k]} mm", "time [h]", "z [um]", curves(hours, values, dashed=["net"]))
                for k, values in predicted.items()
            ],
            columns=2,
        ),
        single(
            "precompensation-schedule",
            "The correction that stands in the program, a new one every 10 min, and what is left of the drift (P-06).",
            ("time [h]", "[um]"),
            curves(hours, added, dashed=["added to the program"]),
            title=f"z at {POSITIONS[0]} mm",
        ),
        single(
            "precompensation-cut",
            "The effectiveness of pre-compensation: depth difference in each cutting test (P-07).",
            ("cutting test", "depth difference [um]"),
            curves(np.arange(1.0, CUTS + 1), {"without": without, "with": with_}, "points"),
            columns=2,
        ),
        single(
            "precompensation-warm",
            "Not in the paper: a job begins on a warm machine. What is left if the model begins cold, and if it "
            "carries its state over (E-P5).",
            ("time since the job began [h]", "z [um]"),
            curves(c.warm.hours, warm, dashed=["left, carried over"]),
        ),
    )


def _numbers(c: Computed) -> dict[str, float]:
    without, with_ = c.depths
    return {
        "k": float(c.by_fpe[0].k),
        "m": float(c.by_fpe[0].m),
        "rms_none_um": rms(c.left[setup.NONE]),
        "rms_net_um": rms(c.left[NET]),
        "rms_least_squares_um": rms(c.left[LEAST]),
        "rms_orders_by_fpe_um": rms(c.left[CHOSEN]),
        "rms_one_step_um": c.one_step,
        "rms_scheduled_um": rms(c.judge.deviations + c.schedule),
        "depth_difference_um": without,
        "depth_difference_corrected_um": with_,
        "rms_net_workshop_um": c.workshop,
        "room_peak_to_peak_um": c.room,
    }
