"""Figure of a reduction: residuals of the full and the reduced model on unseen cycles."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from thermocomp.core.shown import shorten
from thermocomp.export.reduction.judging import Reduction
from thermocomp.report.drawing import Drawn, add_legend, drawing, svg
from thermocomp.report.figures import LONGEST, MEASURED, PREDICTED, RESIDUAL, SHADE, clock, thin_points


def residuals(reductions: Sequence[Reduction]) -> Drawn:
    """Plot the loss of a reduction: the deviation, and the residual of either model on each unseen cycle in turn."""
    with drawing("reduction"):
        figure = Figure(figsize=(9.6, 0.4 + 2.9 * len(reductions)), layout="constrained")
        panels = np.atleast_1d(figure.subplots(len(reductions), 1, squeeze=False)[:, 0])
        for ax, found in zip(panels, reductions, strict=True):
            r, begin = found.reduced, 0.0
            full = {a.block: a for a in found.full}
            ax.axhline(0, color="#aaa", lw=0.8)
            for k, block in enumerate(found.blocks):
                hours = begin + clock(block, found.time)
                if k % 2 == 0:
                    ax.axvspan(begin, float(hours[-1]), color=SHADE, lw=0, zorder=0)
                curves = [(block.measured, MEASURED, 1.8), (block.measured - block.predicted, RESIDUAL, 1.2)]
                if block.block in full:
                    other = full[block.block]
                    curves.append((other.measured - other.predicted, PREDICTED, 1.2))
                for values, colour, width in curves:
                    ax.plot(*thin_points(hours, values, 400), color=colour, lw=width)
                begin = float(hours[-1])
            lines = [("without compensation", MEASURED, r.none.rms), ("reduced model", RESIDUAL, r.reduced.rms)]
            if full:
                lines.append(("full model", PREDICTED, r.full.rms))
            for text, colour, rms in lines:
                ax.plot([], [], color=colour, label=f"{text}: RMS {rms:.2f} um")
            ax.set_ylabel(f"{shorten(r.model.target.removesuffix('_um'), LONGEST)} [um]")
            ax.set_title(r.axis)
            add_legend(ax, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(lines), borderaxespad=0.0)
            ax.margins(x=0)
        panels[-1].set_xlabel(
            "time [h]: unseen cycles, one after the other; each is judged with a model fitted without it"
        )
        return svg(figure)
