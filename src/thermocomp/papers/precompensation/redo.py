"""Pre-compensation redone: the drift from the spindle speed alone, added to the NC program beforehand (P-01 to P-07).

The text is a fragment: figures and the equation are lost (E-P1). The model is identified in one test with the speeds of
milling jobs, and judged in free run in another one with new speeds (P-05), at four positions of Z. The cutting tests
are done twice: with the schedule of corrections applied to what was recorded, here, and with NC programs that are
revised, read back and milled, in `thermocomp.papers.precompensation.cutting`.
"""

import numpy as np
from numpy.typing import NDArray

from thermocomp.models.selection.orders import Order
from thermocomp.papers.common import Errors, errors_table
from thermocomp.papers.precompensation import cutting, cuttingtold, setup
from thermocomp.papers.precompensation.setup import (
    CHOSEN,
    CUTS,
    LEAST,
    NET,
    NONE,
    PAPERS_DEPTHS,
    PAPERS_ORDERS,
    POSITIONS,
    SHARE,
    Computed,
    scheduled,
)
from thermocomp.papers.study import Claim, Curve, Figure, Panel, Progress, Study, Table

FloatArray = NDArray[np.float64]

#: "describes thermal errors well", criterion: share of the drift's variance that is described at every position
WELL = 0.9
#: "errors at any z can be obtained", criterion: interpolated, the RMS is at most so many times that of a model there
AS_WELL = 1.1
#: share of rows beyond what was identified that is worth telling
BEYOND = 0.02


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
    c = setup.compute(seed, lambda share, what: progress(share / 2, what))
    models = c.models | cutting.house_models(c.learn)
    m = cutting.compute(models, seed, lambda share, what: progress((1 + share) / 2, what))
    return Study(
        "precompensation",
        "Pre-compensation of thermal errors by revising the NC program",
        (*_models(c), *_free_run(c), *_cutting(c), *_limits(c), *cuttingtold.claims(m)),
        (*_tables(c), *cuttingtold.tables(m)),
        (*_figures(c), *cuttingtold.figures(m)),
        _numbers(c) | cuttingtold.numbers(m),
    )


# -- claims ------------------------------------------------------------------------------------------------------------


def _models(c: Computed) -> list[Claim]:
    best = [min((o for o in table if o.admissible), key=lambda o: o.fpe) for table in c.orders]
    found = [(o.k, o.m) for o in best]
    same = all(o == PAPERS_ORDERS for o in found)
    plain = [next(o.fpe for o in table if (o.k, o.m) == PAPERS_ORDERS) for table in c.orders]
    rms = {name: Errors.of(c.left[name]).rms for name in (CHOSEN, LEAST, NET)}
    others = [f"{h / 60:g} min: k = {k}, m = {m}" for h, ((k, m), _, _) in c.clocks.items()]
    return [
        Claim(
            ("P-01", "P-02"),
            "The final prediction error chooses k = 1 and m = 0, at every position",
            "k = 1, m = 0",
            "; ".join(f"{p} mm: k = {k}, m = {m}" for p, (k, m) in zip(POSITIONS, found, strict=True)),
            same,
            ""
            if same
            else "With k = 1, m = 0 it is at most "
            f"{max(p / o.fpe for p, o in zip(plain, best, strict=True)):.2f} times as large. In free run under new "
            f"conditions the orders it chooses leave {rms[CHOSEN]:.2f} um RMS, k = 1, m = 0 {rms[LEAST]:.2f} um: "
            + ("the larger model is not the better one (E-P3)." if rms[CHOSEN] >= rms[LEAST] else "they are worth it.")
            + f" By the step of time: {'; '.join(others)}.",
        ),
        Claim(
            ("P-03", "E-P2"),
            "Free run of the net, its hidden nodes by trial, and of least squares with the same orders",
            "",
            f"RMS {rms[NET]:.2f} um ({', '.join(map(str, c.hidden))} hidden nodes), {rms[LEAST]:.2f} um",
            None,
        ),
    ]


def _free_run(c: Computed) -> list[Claim]:
    z = c.judge.deviations
    shares = _shares(c, NET)
    describes = all(s >= WELL for s in shares)
    own = [Errors.of(c.left[NET][:, k]).rms for k in c.inner]
    between = [Errors.of(z[:, k] - c.interpolated(k, NET)).rms for k in c.inner]
    obtained = all(b <= AS_WELL * o for b, o in zip(between, own, strict=True))
    rms, none = Errors.of(c.left[NET]).rms, Errors.of(z).rms
    return [
        Claim(
            ("P-05",),
            f"The model describes the drift under new conditions well (criterion: {WELL:.0%} of its variance at every "
            "position, in free run)",
            "well (Fig. 4)",
            f"{', '.join(f'{s:.1%}' for s in shares)}; RMS {rms:.2f} um instead of {none:.2f} um",
            describes,
            "" if describes else _not_described(c),
        ),
        Claim(
            ("E-P3",),
            "RMS one step ahead, with the measured drift of ten minutes before, and in free run",
            "",
            f"{c.one_step.rms:.2f} um, {Errors.of(c.left[LEAST]).rms:.2f} um",
            None,
        ),
        Claim(
            ("P-04",),
            "Between the positions of the models the drift can be interpolated (criterion: left out, a position is "
            f"predicted by the others with at most {AS_WELL:g} times the RMS of its own model)",
            "at any z",
            "; ".join(
                f"{POSITIONS[k]} mm: {b:.2f} um, own model {o:.2f} um"
                for k, b, o in zip(c.inner, between, own, strict=True)
            ),
            obtained,
            (
                f"The drift at {POSITIONS[0]} and {POSITIONS[-1]} mm differs by "
                f"{Errors.of(z[:, 0] - z[:, -1]).rms:.1f} um RMS; "
                "here the neighbours are up to 400 mm apart, in the paper half as far."
            ),
        ),
    ]


def _shares(c: Computed, name: str) -> list[float]:
    """Return the share of the drift's variance that a model describes at each position."""
    z = c.judge.deviations
    return [float(1 - np.sum(e**2) / np.sum((d - d.mean()) ** 2)) for e, d in zip(c.left[name].T, z.T, strict=True)]


def _not_described(c: Computed) -> str:
    z, learned = c.judge.deviations, c.learn.deviations
    beyond = (z < learned.min(axis=0)) | (z > learned.max(axis=0))
    left = c.left[NET]
    said = f"What it leaves is {Errors.of(left).max_abs:.1f} um at most. "
    if beyond.mean() > BEYOND:
        said += (
            f"{beyond.mean():.0%} of the drift goes beyond what the identification showed (to {learned.min():.0f} um, "
            f"here to {z.min():.0f} um), where the net's sigmoid ends; within, its RMS is "
            f"{Errors.of(left[~beyond]).rms:.2f} um. "
        )
    return (
        f"{said}Least squares describes {min(_shares(c, LEAST)):.0%} or more with the same orders and "
        f"{min(_shares(c, CHOSEN)):.0%} or more with those by FPE: k = 1 is one time constant for all stores of heat, "
        "and none of them knows the room."
    )


def _cutting(c: Computed) -> list[Claim]:
    steps = _schedule(c)
    every, continuous = Errors.of(c.judge.deviations + steps), Errors.of(c.left[NET])
    without = float(np.mean([np.abs(k.without).mean() for k in c.cuts]))
    with_ = float(np.mean([np.abs(k.scheduled).mean() for k in c.cuts]))
    worse = sum(bool(np.abs(k.scheduled).mean() > np.abs(k.without).mean()) for k in c.cuts)
    holds = with_ <= SHARE * without
    return [
        Claim(
            ("P-06", "E-P4"),
            "The program corrected every 10 min, minus the deviation being added to Z: RMS left, and with a correction "
            "at every moment",
            "every 10 min",
            f"{every.rms:.2f} um, {continuous.rms:.2f} um",
            None,
            f"From one correction to the next it changes by {np.abs(np.diff(steps, axis=0)).max():.1f} um at most: a "
            "step in the surface. Deviation is actual minus commanded, so the paper's adding is a matter of sign.",
        ),
        Claim(
            ("P-07",),
            "Depth difference of surfaces milled cold and after 1 h of varying speeds (criterion: at most the paper's "
            f"share of it is left, {SHARE:.2f})",
            f"{PAPERS_DEPTHS[0]:g} -> {PAPERS_DEPTHS[1]:g} um",
            f"{without:.1f} -> {with_:.1f} um, mean of {CUTS} tests and {len(POSITIONS)} positions",
            holds,
            f"It falls to {with_ / without:.2f} of what it was; it grows in {worse} of {CUTS} tests."
            + (
                "" if holds else " What is left is the model's error in free run, after an hour that it was not taught."
            ),
        ),
    ]


def _limits(c: Computed) -> list[Claim]:
    begun = c.warm.hours <= 1
    cold, carried, none = (Errors.of(e[begun]).rms for e in (c.warm.cold, c.warm.carried, c.warm.drift))
    return [
        Claim(
            ("E-P5",),
            "A job that begins on a warm machine: RMS in its first hour if the model begins cold, and if it goes on "
            "from the last job",
            "assumes a cold start",
            f"{cold:.1f} um, {carried:.1f} um; without compensation {none:.1f} um",
            None,
            "Begun cold it is worse than no compensation." if cold > none else "",
        ),
        Claim(
            ("E-P6",),
            "The same verification in a workshop whose air follows the day, and what the room alone moves Z by in a "
            "day at rest",
            "a relatively stable environment",
            f"RMS {c.workshop.rms:.2f} um instead of {Errors.of(c.left[NET]).rms:.2f} um; "
            f"{c.room.peak_to_peak:.1f} um peak to peak",
            None,
            "A model that knows only the speed sees nothing of the room.",
        ),
    ]


# -- tables, figures, numbers ------------------------------------------------------------------------------------------


def _tables(c: Computed) -> tuple[Table, ...]:
    order = range(setup.GREATEST + 1)
    table = {(o.k, o.m): o for o in c.orders[0]}
    fpe = [[f"k = {k}", *(_fpe(table.get((k, m))) for m in order)] for k in order]
    left = {(f"z at {p} mm", name): e[:, j] for j, p in enumerate(POSITIONS) for name, e in c.left.items()}
    clocks = [
        [f"{h / 60:g}", f"{k}, {m}", f"{chosen:.2f}", f"{paper:.2f}"] for h, ((k, m), chosen, paper) in c.clocks.items()
    ]
    cuts = [
        [f"test {n}", *(f"{v:+.1f}" for v in k.without), *(f"{v:+.1f}" for v in k.scheduled)]
        for n, k in enumerate(c.cuts, start=1)
    ]
    return (
        Table(
            f"Final prediction error [um2] at z = {POSITIONS[0]} mm, steps of 10 min; in brackets: the free run does "
            "not decay",
            ("", *(f"m = {m}" for m in order)),
            fpe,
        ),
        errors_table("Free run in the verification: what is left", left),
        Table(
            f"Orders by the step of time, at z = {POSITIONS[0]} mm",
            ("step [min]", "k, m by FPE", "free-run RMS [um]", "with k = 1, m = 0 [um]"),
            clocks,
        ),
        Table(
            "Depth difference of the second surface to the first [um]",
            ("", *(f"{p} mm" for p in POSITIONS), *(f"{p} mm, corrected" for p in POSITIONS)),
            cuts,
        ),
    )


def _fpe(order: Order | None) -> str:
    if order is None:
        return ""
    return f"{order.fpe:.2f}" if order.admissible else f"({order.fpe:.2f})"


def _figures(c: Computed) -> tuple[Figure, ...]:
    hours, z = c.judge.time / 3600, c.judge.deviations
    shown = (0, len(POSITIONS) - 1)
    steps = _schedule(c)
    tests = np.arange(1.0, CUTS + 1)
    without, with_ = (
        np.array([np.abs(v).mean() for v in vs]) for vs in zip(*((k.without, k.scheduled) for k in c.cuts), strict=True)
    )
    return (
        Figure(
            "precompensation-fig4",
            "Fig. 4: drift of Z under new conditions, and its prediction from the spindle speed alone.",
            [
                Panel(
                    f"z at {POSITIONS[k]} mm",
                    "time [h]",
                    "z [um]",
                    [
                        Curve("measured", hours, z[:, k]),
                        Curve("net", hours, c.free_run[NET][:, k], "dashed"),
                        Curve("residual", hours, c.left[NET][:, k]),
                    ],
                )
                for k in shown
            ],
            columns=2,
        ),
        Figure(
            "precompensation-schedule",
            "The correction that stands in the program, a new one every 10 min, and what is left of the drift (P-06).",
            [
                Panel(
                    f"z at {POSITIONS[0]} mm",
                    "time [h]",
                    "[um]",
                    [
                        Curve("drift", hours, z[:, 0]),
                        Curve("added to the program", hours, steps[:, 0], "dashed"),
                        Curve("left", hours, z[:, 0] + steps[:, 0]),
                    ],
                )
            ],
        ),
        Figure(
            "precompensation-cut",
            "The effectiveness of pre-compensation: depth difference in each cutting test (P-07).",
            [
                Panel(
                    "",
                    "cutting test",
                    "depth difference [um]",
                    [Curve("without", tests, without, "points"), Curve("with", tests, with_, "points")],
                )
            ],
            columns=2,
        ),
        Figure(
            "precompensation-warm",
            "Not in the paper: a job begins on a warm machine. What is left if the model begins cold, and if it "
            "carries its state over (E-P5).",
            [
                Panel(
                    "",
                    "time since the job began [h]",
                    "z [um]",
                    [
                        Curve("drift", c.warm.hours, c.warm.drift),
                        Curve("left, begun cold", c.warm.hours, c.warm.cold),
                        Curve("left, carried over", c.warm.hours, c.warm.carried, "dashed"),
                    ],
                )
            ],
        ),
    )


def _numbers(c: Computed) -> dict[str, float]:
    best = min((o for o in c.orders[0] if o.admissible), key=lambda o: o.fpe)
    return {
        "k": float(best.k),
        "m": float(best.m),
        "rms_none_um": Errors.of(c.left[NONE]).rms,
        "rms_net_um": Errors.of(c.left[NET]).rms,
        "rms_least_squares_um": Errors.of(c.left[LEAST]).rms,
        "rms_orders_by_fpe_um": Errors.of(c.left[CHOSEN]).rms,
        "rms_one_step_um": c.one_step.rms,
        "rms_scheduled_um": Errors.of(c.judge.deviations + _schedule(c)).rms,
        "depth_difference_um": float(np.mean([np.abs(k.without).mean() for k in c.cuts])),
        "depth_difference_corrected_um": float(np.mean([np.abs(k.scheduled).mean() for k in c.cuts])),
        "rms_net_workshop_um": c.workshop.rms,
        "room_peak_to_peak_um": c.room.peak_to_peak,
    }


def _schedule(c: Computed) -> FloatArray:
    """Return what is added to the programmed Z in the verification, (n_rows, n_positions) [um]."""
    return scheduled(c.judge.time, c.free_run[NET])
