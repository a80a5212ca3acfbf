"""Figures of the work volume as SVG text: its deformation, and sections through it."""

import itertools
import math
from collections.abc import Callable

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.report.drawing import drawing, svg
from thermocomp.report.figures import MEASURED
from thermocomp.volumetric.judging.volumetric import Moment, Volumetric, lay_grid
from thermocomp.volumetric.report.volumetric_figures import SMALL, WIDTH, choose_moments

#: light to dark, so that large values stand out on white paper, also in greyscale
MAGNITUDE = ListedColormap(colormaps["inferno_r"](np.linspace(0.12, 0.88, 256)), name="magnitude")
#: viewpoint: to the right in front of the machine, above the table [degrees]
AZIMUTH, ELEVATION = -58.0, 24.0
#: drawn size of the largest error as a share of the longest travel
DRAWN = 0.2
#: points of a section that get an arrow
_EVERY = slice(2, None, 4)
#: indices of the two axes, positions along them [mm], errors before and after [um]
_Section = tuple[int, int, FloatArray, FloatArray, FloatArray, FloatArray]


def boxes(study: Volumetric) -> str:
    """Draw the deformation of the work volume in each state, and its residual after the straight lines of the axes."""
    moments = choose_moments(study)
    travels = lay_grid(study.machine, 2).reshape(-1, 3)
    largest = max(SMALL, *(m.straight.before.largest for m in moments))
    with drawing("boxes"):
        axes: NDArray[np.object_]
        if len(moments) > 1:
            figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
            axes = figure.subplots(2, len(moments), squeeze=False)
        else:  # before and after next to each other
            figure = Figure(figsize=(WIDTH, 3.9), layout="constrained")
            axes = figure.subplots(1, 2, squeeze=False).T
        magnified = _nice(DRAWN * float(np.ptp(travels, axis=0).max()) / (1e-3 * largest))
        norm = Normalize(0.0, largest)
        room = np.concatenate(
            [_seen(travels + 1e-3 * magnified * m.error(travels)) for m in moments] + [_seen(travels)]
        )
        for column, moment in enumerate(moments):
            for row, (title, error, size) in enumerate(
                (
                    (moment.name, moment.error, moment.straight.before),
                    ("corrected by straight lines", moment.after_lines, moment.straight.after),
                )
            ):
                ax = axes[row, column]
                _bent(ax, study, error, magnified, norm)
                ax.set_title(f"{title}\nRMS {size.rms:.1f} um, largest {size.largest:.1f} um", fontsize=8.5)
                _bare(ax, room)
                _triad(ax, study)
        _scale(axes[1, 0], study, magnified, largest)
        figure.colorbar(
            ScalarMappable(norm, MAGNITUDE), ax=axes, label="length of the error vector [um]", shrink=0.7, aspect=30
        )
        return svg(figure)


def sections(study: Volumetric, moment: Moment) -> str:
    """Draw size and direction of the error in the work volume, in three sections through a point."""
    machine, n = study.machine, 21
    planes = [p for p in ("XY", "XZ", "YZ") if set(p) <= set(machine.structure.axes)]
    spans = [[float(np.ptp(machine.axis(a).travel)) for a in p] for p in planes]
    with drawing("sections"):
        # remaining width after labels and colour bar, so that the panels fill the page
        per_mm = (WIDTH - 1.2 - 0.7 * len(planes)) / sum(s[0] for s in spans)
        height = min(per_mm * max(s[1] for s in spans), 3.5)
        axes: NDArray[np.object_]
        if len(planes) > 1:
            figure = Figure(figsize=(WIDTH, 1.2 + 2 * height), layout="constrained")
            axes = figure.subplots(2, len(planes), squeeze=False, width_ratios=[s[0] for s in spans])
        else:  # before and after next to each other
            figure = Figure(figsize=(WIDTH, 0.8 + height), layout="constrained")
            axes = figure.subplots(1, 2, squeeze=False).T
        keys = []
        drawn: list[_Section] = []
        for plane in planes:
            first, second = ("XYZ".index(a) for a in plane)
            u, v = (np.linspace(*machine.axis(a).travel, n) for a in plane)
            points = np.broadcast_to(np.asarray(study.course.point), (n, n, 3)).copy()
            points[..., first], points[..., second] = np.meshgrid(u, v)
            drawn.append((first, second, u, v, moment.error(points), moment.after_lines(points)))
        for row, panels in enumerate(axes):
            found = [after if row else before for *_, before, after in drawn]
            largest = max(SMALL, *(float(np.linalg.norm(error, axis=-1).max()) for error in found))
            levels = np.asarray(MaxNLocator(8).tick_values(0.0, largest), dtype=np.float64)
            norm = BoundaryNorm(levels, MAGNITUDE.N)
            key = _nice(largest)
            for ax, plane, error, (first, second, u, v, _, _) in zip(panels, planes, found, drawn, strict=True):
                arrows = _section(ax, error, (u, v), (first, second), key / (0.18 * min(min(s) for s in spans)), levels)
                ax.set_ylabel(f"{plane[1]} [mm]")
                ax.set_title("corrected by straight lines" if row else _plane_named(study, plane))
                if row or len(planes) == 1:
                    ax.set_xlabel(f"{plane[0]} [mm]")
            mappable, shrink = ScalarMappable(norm, MAGNITUDE), 1.0 if len(planes) > 1 else 0.7
            bar = figure.colorbar(mappable, ax=panels, label="length of the error [um]", aspect=18, shrink=shrink)
            keys.append((ax, arrows, bar.ax, key))
        figure.draw_without_rendering()  # the positions of the bars are known only after the layout
        for ax, arrows, beside, key in keys:
            box = beside.get_position()
            ax.quiverkey(
                arrows,
                box.x1 + 0.03,
                box.y0 - 0.2 / figure.get_figheight(),
                key,
                f"{key:g} um",
                labelpos="W",
                coordinates="figure",
            )
        return svg(figure)


def _bent(
    ax: Axes, study: Volumetric, error: Callable[[FloatArray], FloatArray], magnified: float, norm: Normalize
) -> None:
    """Draw the work volume, its deformation by an error, and the error at its corners."""
    for points, face in _lines(study):
        ax.plot(
            *_seen(points[[0, -1]]).T,
            color="#b5b5b5",
            lw=0.4 if face else 0.9,
            ls="-" if face else (0, (4, 2)),
        )
        found = error(points)
        bent = _seen(points + 1e-3 * magnified * found)
        pieces = np.stack([bent[:-1], bent[1:]], axis=1)
        length = np.linalg.norm(found, axis=-1)
        colour = MAGNITUDE(norm(0.5 * (length[:-1] + length[1:])))
        ax.add_collection(
            LineCollection(list(pieces), colors=colour, linewidths=0.6 if face else 1.9, capstyle="round")
        )
    travels = lay_grid(study.machine, 2).reshape(-1, 3)
    found = error(travels)
    start, way = _seen(travels), _seen(1e-3 * magnified * found)
    ax.quiver(
        *start.T,
        *way.T,
        angles="xy",
        scale_units="xy",
        scale=1,
        units="inches",
        width=0.014,
        color=MEASURED,
        zorder=5,
    )


def _section(
    ax: Axes,
    error: FloatArray,
    places: tuple[FloatArray, FloatArray],
    axes: tuple[int, int],
    scale: float,
    levels: FloatArray,
) -> Quiver:
    """Draw the length of the error as colour and its in-plane part as arrows, which are returned."""
    (u, v), (first, second) = places, axes
    norm = BoundaryNorm(levels, MAGNITUDE.N)
    ax.contourf(u, v, np.linalg.norm(error, axis=-1), levels, cmap=MAGNITUDE, norm=norm)
    arrows = ax.quiver(
        u[_EVERY],
        v[_EVERY],
        error[_EVERY, _EVERY, first],
        error[_EVERY, _EVERY, second],
        angles="xy",
        scale_units="xy",
        scale=scale,
        units="inches",
        width=0.022,
        color="black",
        edgecolor="white",
        linewidth=0.4,
    )
    ax.set_aspect("equal")
    ax.grid(visible=False)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    return arrows


def _plane_named(study: Volumetric, plane: str) -> str:
    """Return the name of a section, and the position of the axis normal to it."""
    across = next(a for a in "XYZ" if a not in plane)
    here = f" at {across} {study.course.point['XYZ'.index(across)]:g} mm"
    return f"{plane[0]}-{plane[1]}{here if across in study.machine.structure.axes else ''}"


def _nice(value: float) -> float:
    """Return the largest of 1, 1.5, 2, 3, 5, 10 ... that does not exceed a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(f for f in (1.0, 1.5, 2.0, 3.0, 5.0) if f * power <= value * (1 + 1e-9)) * power


def _seen(points: FloatArray) -> FloatArray:
    """Return the positions of points in the figure by parallel projection, (..., 3) -> (..., 2)."""
    a, e = math.radians(AZIMUTH), math.radians(ELEVATION)
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    up = np.array([-math.cos(a) * math.sin(e), -math.sin(a) * math.sin(e), math.cos(e)])
    return np.stack([points @ right, points @ up], axis=-1)


def _lines(study: Volumetric) -> list[tuple[FloatArray, bool]]:
    """Return lines of the work volume to draw: grids on the three rear faces (True), then the edges."""
    travel = [study.machine.axis(a).travel for a in "XYZ"]
    back = [travel[0][0], travel[1][1], travel[2][0]]
    found = []
    for along in range(3):
        one, two = (k for k in range(3) if k != along)
        places = [(p, q, False) for p, q in itertools.product(travel[one], travel[two])]
        inner = [np.linspace(*travel[k], 5)[1:-1] for k in (one, two)]
        places += [(p, back[two], True) for p in inner[0]] + [(back[one], q, True) for q in inner[1]]
        for p, q, face in places:
            n = 7 if face else 11
            points = np.empty((n, 3))
            points[:, along], points[:, one], points[:, two] = np.linspace(*travel[along], n), p, q
            found.append((points, face))
    return sorted(found, key=lambda line: not line[1])


def _bare(ax: Axes, room: FloatArray) -> None:
    """Remove axes and frame, and give all panels the same limits, which contain the given points (n, 2)."""
    low, high = room.min(axis=0), room.max(axis=0)
    beside = 0.1 * (high - low)
    ax.set_xlim(low[0] - beside[0], high[0] + beside[0])
    ax.set_ylim(low[1] - 1.8 * beside[1], high[1] + 0.3 * beside[1])
    ax.set_aspect("equal")
    ax.axis("off")


def _triad(ax: Axes, study: Volumetric) -> None:
    """Draw the letters of the axes at the ends of the edges that start at the front corner."""
    low, high = (np.array([study.machine.axis(a).travel[k] for a in "XYZ"]) for k in (0, 1))
    size = 0.07 * float((high - low).max())
    middle = 0.5 * (low + high)
    for name, at, away in (
        ("X", [middle[0], low[1], low[2]], [0.0, -size, -size]),
        ("Y", [high[0], middle[1], low[2]], [1.4 * size, 0.0, -size]),
        ("Z", [low[0], low[1], middle[2]], [-1.3 * size, 0.0, 0.0]),
    ):
        x, y = _seen(np.array(at) + np.array(away))
        ax.text(x, y, name, ha="center", va="center", fontsize=8, color="#666")


def _scale(ax: Axes, study: Volumetric, magnified: float, largest: float) -> None:
    """Draw a scale bar for an error of a round number of um."""
    size = _nice(0.7 * largest)
    length = 1e-3 * size * magnified
    corners = _seen(lay_grid(study.machine, 2).reshape(-1, 3))
    x, y = corners[:, 0].min(), corners[:, 1].min() - 0.12 * float(np.ptp(corners[:, 1]))
    ax.plot([x, x + length], [y, y], color=MEASURED, lw=1.6, marker="|", ms=6)
    ax.text(
        x + length + 0.03 * float(np.ptp(corners[:, 0])),
        y,
        f"{size:g} um of error, magnified {magnified:,.0f} times",
        va="center",
        fontsize=8,
    )
