"""Effect of probings: as text, and as a section of a page with the state learned after each probing."""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from thermocomp.core.shown import shorten
from thermocomp.judging.assessing import Judged
from thermocomp.judging.results import Assessment
from thermocomp.recordings.recording import Recording
from thermocomp.report.drawing import Drawn, add_legend, drawing, svg
from thermocomp.report.figures import LONGEST, MEASURED, NONE, POINTS, PREDICTED, clock
from thermocomp.report.sections import Section, Shown


def describe_probings(assessments: Sequence[Assessment]) -> Iterator[str]:
    """Yield lines about models judged with probings."""
    for a in assessments:
        if (probed := a.probed) is None:
            continue
        if (after := a.metric("max_abs")) > (before := a.unprobed_metric("max_abs")):
            yield f"{a.target}: the probings increase the largest error, from {before:.2f} to {after:.2f} um"
        held = " with probings but no model, each correction held until the next probing"
        ways = {"": a.metric, " without": a.unprobed_metric, held: a.held_metric}
        left = "; ".join(f"{find('rms'):.2f} and {find('mae'):.2f}{words}" for words, find in ways.items())
        yield f"{a.target}, {probed.plan.words} ({int(probed.at.sum())} in all): RMS and MAE in um: {left}"
        if probed.refused:
            yield f"{a.target}: {len(probed.refused)} of the probings were refused; the first: {probed.refused[0]}"


def describe_gains(judged: Judged) -> Iterator[str]:
    """Yield the error of each target that a probing every two hours would leave."""
    for target, gain in judged.probing.items():
        yield f"{target}: {gain.words}"


def section(judged: Judged, recordings: Sequence[Recording]) -> Section | None:
    """Return the section of the page about probings; None if there were none."""
    probed = [a for a in judged.overall() if a.probed is not None and not a.failure]
    if not probed:
        return None
    shown = Shown(
        draw_shifts(probed, recordings),
        "Error of the model at each probing, and the shift added to the model from then on.",
    )
    return Section("Probings", [shown, *describe_probings(probed)])


def draw_shifts(probed: Sequence[Assessment], recordings: Sequence[Recording]) -> Drawn:
    """Plot, for each target, the model error without probings, and the shift added after each probing."""
    times = [r.time for r in recordings]
    with drawing("probings"):
        figure = Figure(figsize=(9.6, 0.6 + 1.7 * len(probed)), layout="constrained")
        axes = figure.subplots(len(probed), 1, squeeze=False, sharex=True)[:, 0]
        for ax, a in zip(axes, probed, strict=True):
            assert a.probed is not None
            hours, wrong = clock(a, times), a.measured - a.probed.without
            rows = slice(None, None, max(1, len(hours) // POINTS))
            ax.axhline(0.0, color=NONE, lw=0.8)
            ax.plot(
                hours[rows], wrong[rows], color=MEASURED, lw=0.9, label="measured minus predicted, without probings"
            )
            ax.step(
                hours[rows],
                a.probed.shift[rows],
                color=PREDICTED,
                lw=1.4,
                where="post",
                label="shift added to the model",
            )
            ax.plot(hours[a.probed.at], wrong[a.probed.at], "o", ms=5, color="#222", mfc="white", label="probing")
            ax.set_ylabel(f"{shorten(a.target.removesuffix('_um'), LONGEST)} [um]")
            low, high = np.quantile(wrong, [0.001, 0.999])
            room = 0.15 * max(high - low, 0.1)
            ax.set_ylim(min(low, float(a.probed.shift.min())) - room, max(high, float(a.probed.shift.max())) + room)
        axes[-1].set_xlabel("time [h]")
        add_legend(axes[0], loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
        return svg(figure)
