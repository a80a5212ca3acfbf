"""Figures of the volumetric error over time and by component, as SVG text."""

import numpy as np
from matplotlib.figure import Figure

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.report.drawing import BESIDE, add_legend, drawing, svg
from thermocomp.report.figures import COLOURS, MEASURED, line_style, thin_points
from thermocomp.runtime.geometry.kinematics import INDEX
from thermocomp.volumetric.judging.volumetric import Moment, Volumetric

WIDTH = 9.6
MAX_MOMENTS = 3
#: smallest error at which figures are still enlarged [um]
SMALL = 0.1
#: components below this share of the largest one are not shown
NEGLIGIBLE = 0.01


def over_time(study: Volumetric) -> str:
    """Plot the error at the point over time; the moments of the other figures are marked."""
    course = study.course
    hours = course.time / 3600
    tilted = bool(np.abs(course.tilt).max() > 0)
    with drawing("over-time"):
        figure = Figure(figsize=(WIDTH, 4.4 if tilted else 2.8), layout="constrained")
        axes = figure.subplots(1 + tilted, 1, sharex=True, squeeze=False, height_ratios=[1.5, 1][: 1 + tilted])[:, 0]
        for values, ax, names, unit in (
            (course.error, axes[0], "XYZ", "um"),
            (course.tilt, axes[-1], "ABC", "urad"),
        )[: 1 + tilted]:
            ax.axhline(0, color="#aaa", lw=0.8)
            for k, name in enumerate(names):
                ax.plot(*thin_points(hours, values[:, k]), color=COLOURS[k], label=name)
            ax.set_ylabel(unit)
        length = np.linalg.norm(course.error, axis=-1)
        axes[0].plot(*thin_points(hours, length), color=MEASURED, ls="--", lw=1.0, label="length")
        for moment in study.moments:
            for ax in axes:
                ax.axvline(moment.time / 3600, color="#999", lw=0.8, ls=":")
            axes[0].annotate(
                moment.label,
                (moment.time / 3600, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 2),
                textcoords="offset points",
                ha="right" if moment.time > 0.9 * course.time[-1] else "left",
                fontsize=7,
                color="#666",
            )
        axes[0].set_title("error of the tool's tip", pad=14)
        if tilted:
            axes[1].set_title("tilt of the tool")
        for ax in axes:
            add_legend(ax, **BESIDE)
            ax.margins(x=0)
        axes[-1].set_xlabel("time [h]")
        return svg(figure)


def curves(study: Volumetric) -> str:
    """Plot each position-dependent component along its axis in each state: its drift and straightness."""
    machine = study.machine
    known = [c for c in COMPONENTS if c.depends_on and c.code in machine.components]
    axes_shown = [a for a in "XYZ" if any(c.depends_on == a for c in known)]
    kinds = [k for k in ("EX", "EY", "EZ", "EA", "EB", "EC") if any(c.code[:2] == k for c in known)]
    with drawing("curves"):
        figure = Figure(figsize=(WIDTH, 0.6 + 1.35 * len(kinds)), layout="constrained")
        grid = figure.subplots(len(kinds), len(axes_shown), squeeze=False, sharex="col", sharey="row")
        for kind, row in zip(kinds, grid, strict=True):
            for name, ax in zip(axes_shown, row, strict=True):
                component = BY_CODE[kind + name]
                ax.set_title(f"{component.code}  {component.description}", fontsize=8)
                ax.axhline(0, color="#aaa", lw=0.8)
                if component not in known:
                    ax.text(0.5, 0.55, "nothing known", transform=ax.transAxes, ha="center", color="#999", fontsize=8)
                    continue
                along = np.linspace(*machine.axis(name).travel, 61)
                points = np.tile(np.asarray(study.course.point), (len(along), 1))
                points[:, "XYZ".index(name)] = along
                for k, moment in enumerate(choose_moments(study)):
                    values = moment.field.components(points)[:, INDEX[component.code]]
                    ax.plot(along, values, color=COLOURS[k], ls=("-", "--", "-.")[k % 3], label=moment.name)
                ax.margins(x=0)
            row[0].set_ylabel("um" if kind[1] in "XYZ" else "urad")
        for name, ax in zip(axes_shown, grid[-1], strict=True):
            ax.set_xlabel(f"{name} [mm]")
        add_legend(figure, loc="outside upper left", ncols=3)
        return svg(figure)


def scalars(study: Volumetric) -> str:
    """Plot each component that depends on time only, over time."""
    course = study.course
    hours = course.time / 3600
    known = [c for c in COMPONENTS if c.is_scalar and c.code in study.machine.components]
    units = [u for u in ("um", "urad") if any(c.unit == u for c in known)]
    with drawing("scalars"):
        figure = Figure(figsize=(WIDTH, 0.5 + 2.0 * len(units)), layout="constrained")
        for ax, unit in zip(figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0], units, strict=True):
            ax.axhline(0, color="#aaa", lw=0.8)
            for k, c in enumerate(c for c in known if c.unit == unit):
                values = course.values[:, INDEX[c.code]]
                ax.plot(*thin_points(hours, values), **line_style(k), label=f"{c.code} {c.description}")
            ax.set_ylabel(unit)
            ax.margins(x=0)
            add_legend(ax, **BESIDE, fontsize=7)
        ax.set_xlabel("time [h]")
        return svg(figure)


def contributions(study: Volumetric) -> str:
    """Plot the contributions of the components to the error in each state: at the point, and over the work volume."""
    moments = choose_moments(study)
    parts = [study.course.contributions(m.row) for m in moments]
    lengths = np.max(
        [np.maximum(np.linalg.norm(p, axis=-1), m.shares) for p, m in zip(parts, moments, strict=True)], axis=0
    )
    order = [k for k in np.argsort(-lengths, kind="stable") if lengths[k] > NEGLIGIBLE * lengths.max()]
    tables = [
        np.column_stack(
            [
                np.vstack([part[order], part.sum(axis=0)]),
                np.append(moment.shares[order], moment.straight.before.rms),
            ]
        )
        for part, moment in zip(parts, moments, strict=True)
    ]
    top = max(SMALL, *(float(np.abs(t).max()) for t in tables))
    with drawing("contributions"):
        figure = Figure(figsize=(WIDTH, 1.1 + 0.24 * max(len(order), 1)), layout="constrained")
        axes = figure.subplots(1, MAX_MOMENTS, squeeze=False, sharey=True)[0]
        for ax in axes[len(moments) :]:
            ax.set_visible(False)
        for ax, moment, cells in zip(axes, moments, tables, strict=False):
            ax.pcolormesh(cells, cmap="RdBu_r", vmin=-top, vmax=top, edgecolor="white", linewidth=0.8)
            for (row, column), value in np.ndenumerate(cells):
                ink = "white" if abs(value) > 0.65 * top else "#222"
                if abs(value) >= 0.05:
                    weight = "bold" if row == len(order) else "normal"
                    ax.text(
                        column + 0.5,
                        row + 0.5,
                        f"{value:.1f}",
                        ha="center",
                        va="center",
                        size=7.5,
                        c=ink,
                        weight=weight,
                    )
            ax.axhline(len(order), color="#222", lw=1.2)
            ax.axvline(3.0, color="white", lw=4.0)
            ax.set_xticks([0.5, 1.5, 2.5, 3.5], ["X", "Y", "Z", "volume"])
            ax.xaxis.set_ticks_position("top")
            ax.tick_params(length=0)
            ax.grid(visible=False)
            ax.spines[:].set_visible(False)
            ax.set_title(moment.name, pad=18)
        labels = [f"{COMPONENTS[k].description}  {COMPONENTS[k].code}" for k in order]
        axes[0].set_yticks(np.arange(len(order) + 1) + 0.5, [*labels, "all components together"], fontsize=8)
        axes[0].set_ylim(len(order) + 1, 0)
        return svg(figure)


def choose_moments(study: Volumetric) -> list[Moment]:
    """Return the moments shown on the page, which include the one with the largest error."""
    others = [m for m in study.moments if m is not study.worst][: MAX_MOMENTS - 1]
    return [m for m in study.moments if m is study.worst or m in others]
