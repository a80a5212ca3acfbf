"""Wessel's sections IV and V: the resting tool that is heated, and the tool of a working milling machine."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from thermocomp.datasets.virtual import record
from thermocomp.models.ace import ACE
from thermocomp.papers.common import Errors
from thermocomp.papers.study import Claim, Curve, Figure, Panel, Progress, Table
from thermocomp.papers.wessel2004.sets import PAPER_SET, Selection, called
from thermocomp.papers.wessel2004.trial import (
    ACE_NAME,
    MLR_NAME,
    SWEEPS,
    Part,
    Trial,
    loop_width,
    place,
    recorded,
    series,
    stacked,
    trial,
)
from thermocomp.recording.recording import Recording

FloatArray = NDArray[np.float64]

#: RMS in the independent test by multiple linear regression and by ACE: resting tool, milling machine [um] (W-08, W-09)
PAPER_TOOL, PAPER_MILLING = (5.7, 1.0), (5.0, 2.2)
#: greatest local gain over linear regression (E-W1); accuracy of the milling test without one episode [um] (E-W2)
PAPER_GAIN, PAPER_ACCURACY = 10.0, 2.0

# What the claims are judged by, set down before the first run:
#: the test is cut into so many stretches to look for the greatest local gain
STRETCHES = 10
#: rows of the test that may lie outside what was learned when the range counts as sufficient
FEW = 0.05
#: measuring points on each side of the worst one that make up its episode
EPISODE = 5
#: boxcar relative to the number of rows: that of N = 10 for the 199 rows of the finite-element spindle (E-W8)
WINDOW = 0.05
#: measuring points between which linear regression over-estimates, and from which it under-estimates (W-09)
OVER, UNDER = (10, 40), 60


def resting_tool(seed: int, progress: Progress, selection: Selection) -> Part:
    """Redo section IV (W-08).

    Parameters
    ----------
    seed : int
    progress : callable
    selection : Selection
        Of Appendix B; the paper's own set is looked at beside.

    Returns
    -------
    Part
    """
    progress(0.0, "resting tool")
    recordings = record("wessel-tool", seed=seed)
    paper = tuple(j - 1 for j in PAPER_SET)
    found = trial(recordings, 0, paper)
    own = trial(recordings, 0, selection.chosen)
    progress(0.5, "every set of temperatures on the test")
    by_set = _by_set(recordings, selection)
    claims = (
        _better(("W-08",), "resting tool, the paper's set", PAPER_TOOL, found, paper),
        _better(("W-08",), "resting tool, the set of our own Appendix B", PAPER_TOOL, own, selection.chosen),
        _locally(own),
        _range(own),
        _by_psi(selection, by_set),
        _window(own),
    )
    tables = (
        found.table(f"Resting tool: {found.target} in the independent test with the paper's set {called(paper)}"),
        own.table(f"The same with our own set {called(selection.chosen)}"),
        _sets_table(selection, by_set, paper),
    )
    numbers = {
        "tool_psi": own.ace.psi_,
        "tool_falling_theta": own.ace.falling_theta_,
        "tool_loop_width": loop_width(own.learned),
        "tool_flagged": float(own.flagged.mean()),
        "tool_best_set_ace_rms_um": min(by_set.values()),
        "tool_none_rms_um": Errors.of(own.measured).rms,
    }
    for label, t in (("paper_set", found), ("own_set", own)):
        for key, method in _KEYS.items():
            if method in t.estimates:
                numbers[f"tool_{label}_{key}_rms_um"] = t.rms(method)
    return Part(claims, tables, _tool_figures(recordings, own, selection), numbers)


_KEYS = {"ace": ACE_NAME, "mlr": MLR_NAME, "ace_monotone": "ace-monotone", "dynamic": "dynamic"}


def milling_machine(seed: int, progress: Progress) -> Part:
    """Redo section V (W-09): four days are learned, the fifth is estimated.

    Parameters
    ----------
    seed : int
    progress : callable

    Returns
    -------
    Part
    """
    progress(0.0, "milling machine, five days")
    recordings = record("wessel-milling", seed=seed)
    temperatures = tuple(range(len(recordings[0].temperatures)))
    found = trial(recordings, 0, temperatures)
    claims = (
        _better(("W-09",), "working milling machine, the fifth day", PAPER_MILLING, found, temperatures),
        _without_episode(found),
        _systematic(found),
    )
    numbers = {
        "milling_psi": found.ace.psi_,
        "milling_falling_theta": found.ace.falling_theta_,
        "milling_loop_width": loop_width(found.learned),
        "milling_flagged": float(found.flagged.mean()),
        "milling_none_rms_um": Errors.of(found.measured).rms,
    }
    numbers |= {f"milling_{key}_rms_um": found.rms(method) for key, method in _KEYS.items()}
    tables = (found.table(f"Milling machine: {found.target} on the fifth day"),)
    return Part(claims, tables, _milling_figures(recordings, found), numbers)


# -- claims --------------------------------------------------------------------------------------------------------


def _better(
    ids: tuple[str, ...], what: str, paper: tuple[float, float], found: Trial, temperatures: tuple[int, ...]
) -> Claim:
    mlr, ace = found.rms(MLR_NAME), found.rms(ACE_NAME)
    beside = [f"{m} {found.rms(m):.2f} um" for m in found.estimates if m not in (ACE_NAME, MLR_NAME)]
    return Claim(
        ids,
        f"ACE beats multiple linear regression under hysteresis: smaller total RMS in the unseen test ({what})",
        f"MLR {paper[0]} um, ACE {paper[1]} um: {paper[0] / paper[1]:.1f}x",
        f"MLR {mlr:.2f} um, ACE {ace:.2f} um: {mlr / ace:.2f}x, with {called(temperatures)}",
        ace < mlr,
        f"{found.reasons()} Without compensation {Errors.of(found.measured).rms:.2f} um; {', '.join(beside)}.",
    )


def _locally(found: Trial) -> Claim:
    """Judge the abstract's "10-fold", which the totals are not (E-W1)."""
    parts = np.array_split(np.arange(len(found.unseen)), STRETCHES)
    gains = [
        Errors.of(found.residual(MLR_NAME)[p]).rms / max(Errors.of(found.residual(ACE_NAME)[p]).rms, 1e-9)
        for p in parts
    ]
    best = int(np.argmax(gains))
    return Claim(
        ("W-08", "E-W1"),
        "Locally the error is up to 10 times smaller than by linear regression, above all in the warm-up at the start",
        f"up to {PAPER_GAIN:g}x; in total {PAPER_TOOL[0] / PAPER_TOOL[1]:.1f}x",
        f"up to {gains[best]:.1f}x, in rows {parts[best][0] + 1}-{parts[best][-1] + 1} of {len(found.unseen)}; "
        f"in total {found.rms(MLR_NAME) / found.rms(ACE_NAME):.1f}x",
        gains[best] >= PAPER_GAIN,
        f"RMS by linear regression over that by ACE in {STRETCHES} stretches of the test: "
        + ", ".join(f"{g:.1f}" for g in gains),
    )


def _range(found: Trial) -> Claim:
    share, beyond = float(found.flagged.mean()), float(found.beyond.mean())
    low, high = found.learned.values.min(axis=0), found.learned.values.max(axis=0)
    ranges = ", ".join(
        f"{place(c.name)} {a:.1f}-{b:.1f} (test {x.min():.1f}-{x.max():.1f})"
        for c, a, b, x in zip(found.learned.inputs, low, high, found.unseen.values.T, strict=True)
    )
    return Claim(
        ("W-08",),
        f"With the break the training covers the test: at most {FEW:.0%} of its rows have a temperature outside",
        "a sufficient range, above all from 30 to 50 degC",
        f"{share:.0%} of the rows outside by temperature, {beyond:.0%} by displacement",
        share <= FEW,
        f"Learned and tested [degC]: {ranges}.",
    )


def _by_psi(selection: Selection, by_set: dict[tuple[int, ...], float]) -> Claim:
    score = selection.small.summed[0]
    rms = np.array([by_set[s] for s in selection.small.subsets])
    rank = float(spearmanr(score, -rms).statistic)
    order = sorted(by_set, key=lambda s: by_set[s])
    position = order.index(selection.chosen) + 1
    return Claim(
        ("W-11",),
        "The set with the greatest Psi estimates an independent test well (ours; Psi is a fit within each data set)",
        "",
        f"the chosen set is number {position} of {len(order)} by RMS in the test, {by_set[selection.chosen]:.2f} um; "
        f"the best, {called(order[0])}, has {by_set[order[0]]:.2f} um",
        None,
        f"ACE with at most 300 sweeps. Rank correlation of the summed Psi with a small RMS in the test: {rank:.2f}.",
    )


def _window(found: Trial) -> Claim:
    wide = ACE(window_share=WINDOW, max_sweeps=SWEEPS).fit(found.learned.values, found.learned.deviations[:, 0])
    rms = Errors.of(found.measured - wide.predict(found.unseen.values)).rms
    return Claim(
        ("E-W8",),
        f"A boxcar of N = {WINDOW:.0%} of the rows on each side does as well as that of N = 10 (ours)",
        "N = 10 whatever the number of rows",
        f"{len(found.learned)} rows: N = {wide.half_window_} has {rms:.2f} um, N = {found.ace.half_window_} "
        f"{found.rms(ACE_NAME):.2f} um",
        None,
    )


def _without_episode(found: Trial) -> Claim:
    error = found.residual(ACE_NAME)
    worst = int(np.argmax(np.abs(error)))
    left = np.ones(len(error), dtype=np.bool_)
    left[max(0, worst - EPISODE) : worst + EPISODE + 1] = False
    rms = Errors.of(error[left]).rms
    return Claim(
        ("W-09", "E-W2"),
        "Without the worst episode ACE is accurate to 1-2 um",
        f"at most {PAPER_ACCURACY:g} um without the errors round point 17; {PAPER_MILLING[1]} um in total",
        f"{rms:.2f} um without points {max(0, worst - EPISODE) + 1}-{min(len(error), worst + EPISODE + 1)}; "
        f"{found.rms(ACE_NAME):.2f} um in total",
        rms <= PAPER_ACCURACY,
        f"The largest error, {error[worst]:.1f} um, is at point {worst + 1}; {found.flagged.mean():.0%} of the rows "
        f"have a temperature outside what was learned. The fit itself has an RMS of {found.fit_rms(ACE_NAME):.2f} um.",
    )


def _systematic(found: Trial) -> Claim:
    """Judge the sign of the linear regression's error; over-estimated means: too much of the drift."""
    drift = np.sign(found.measured.mean()) or 1.0
    excess = -drift * found.residual(MLR_NAME)
    middle, late = float(excess[OVER[0] - 1 : OVER[1]].mean()), float(excess[UNDER - 1 :].mean())
    return Claim(
        ("W-09",),
        f"Linear regression over-estimates between points {OVER[0]} and {OVER[1]} and under-estimates from {UNDER} on",
        "a figure",
        f"mean excess {middle:+.2f} um between them, {late:+.2f} um from {UNDER} on",
        middle > 0 > late,
        f"Mean excess over the whole test {excess.mean():+.2f} um, by ACE "
        f"{-drift * found.residual(ACE_NAME).mean():+.2f} um. The paper does not print the order of its speeds.",
    )


# -- every set of temperatures -------------------------------------------------------------------------------------


def _by_set(recordings: list[Recording], selection: Selection) -> dict[tuple[int, ...], float]:
    """Return the RMS of ACE in the unseen test with each set of at most three temperatures [um].

    With at most 300 sweeps, the default of `ACE`: so many sets, learned to the end, take a minute.
    """
    n = len(recordings[0].temperatures)
    learned, unseen = (stacked(r, 0, range(n)) for r in (recordings[:-1], recordings[-1:]))
    y, measured = learned.deviations[:, 0], unseen.deviations[:, 0]
    found = {}
    for subset in selection.small.subsets:
        columns = list(subset)
        ace = ACE().fit(learned.values[:, columns], y)
        found[subset] = Errors.of(measured - ace.predict(unseen.values[:, columns])).rms
    return found


def _sets_table(selection: Selection, by_set: dict[tuple[int, ...], float], paper: tuple[int, ...]) -> Table:
    order = sorted(by_set, key=lambda s: by_set[s])
    psi = dict(zip(selection.small.subsets, selection.small.summed[0] / len(selection.psi.tests), strict=True))
    listed = list(dict.fromkeys([*order[:5], paper, selection.chosen, order[-1]]))
    names = {paper: "the paper's", selection.chosen: "chosen by Appendix B"}
    if paper == selection.chosen:
        names[paper] = "the paper's, and chosen by Appendix B"
    return Table(
        "Resting tool: ACE (at most 300 sweeps) with other sets, by their RMS in the independent test (in hindsight)",
        ("place", "set", "RMS S1 [um]", "mean Psi S1 in the data sets", ""),
        [
            [str(order.index(s) + 1), called(s), f"{by_set[s]:.2f}", f"{psi[s]:.4f}", names.get(s, "")]
            for s in sorted(listed, key=order.index)
        ],
    )


# -- figures -------------------------------------------------------------------------------------------------------


def _estimated(found: Trial, *, residuals: bool) -> list[Panel]:
    points = np.arange(1, len(found.unseen) + 1, dtype=np.float64)
    shown = [MLR_NAME, ACE_NAME]
    name = place(found.target)
    above = [Curve("measured", points, found.measured)]
    above += [Curve(m, points, found.estimates[m], "dashed") for m in shown]
    panels = [Panel("", "measuring point", f"{name} [um]", above)]
    if residuals:
        below = [Curve(m, points, found.residual(m)) for m in [*shown, "dynamic"]]
        panels.append(Panel("", "measuring point", "measured - estimated [um]", below))
    return panels


def _tool_figures(recordings: list[Recording], own: Trial, selection: Selection) -> tuple[Figure, ...]:
    chosen = called(selection.chosen)
    loops = [
        Panel("", f"{place(c.name)} [degC]", "S1 [um]", [Curve("", x, own.learned.deviations[:, 0])])
        for c, x in zip(own.learned.inputs, own.learned.values.T, strict=True)
    ]
    return (
        Figure(
            "wessel2004-fig5",
            f"Fig. 5: the resting tool, training. Temperatures {chosen}.",
            recorded(recordings[:1], selection.chosen),
        ),
        Figure(
            "wessel2004-fig6",
            "Fig. 6: the resting tool, independent test.",
            recorded(recordings[-1:], selection.chosen),
        ),
        Figure(
            "wessel2004-fig7",
            "Fig. 7: S1 of the test, measured and estimated, and what is left; 'dynamic' is not in the paper.",
            _estimated(own, residuals=True),
        ),
        Figure(
            "wessel2004-tool-loops",
            "Not in the paper: S1 of the training against each temperature. The loops are the hysteresis.",
            loops,
            columns=3,
        ),
    )


def _milling_figures(recordings: list[Recording], found: Trial) -> tuple[Figure, ...]:
    names = [place(c.name) for c in found.unseen.inputs]
    temperatures = series(found.unseen, found.unseen.values, names, points=True)
    return (
        Figure(
            "wessel2004-fig8",
            "Fig. 8: the working machine, training: four days one after the other.",
            recorded(recordings[:-1], range(len(names))),
        ),
        Figure(
            "wessel2004-fig9",
            "Fig. 9: the fifth day: temperatures; the displacement measured and estimated; what is left.",
            [Panel("", "measuring point", "temperature [degC]", temperatures), *_estimated(found, residuals=True)],
        ),
    )
