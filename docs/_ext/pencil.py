"""Drawing functions of ``tutorial/plot_conventions.py``: a projection, arrows, boxes, parts in plan view."""

import numpy as np

INK, GREY, FILL, ORANGE, BLUE = "0.1", "0.5", "#dbe9f4", "#d55e00", "#0072b2"
COMMANDED = {"color": GREY, "lw": 1.0, "ls": (0, (4, 2.5))}
_TURN, _RISE = np.radians(-62), np.radians(24)
_VIEW = np.array([np.cos(_RISE) * np.cos(_TURN), np.cos(_RISE) * np.sin(_TURN), np.sin(_RISE)])
_RIGHT = np.array([-np.sin(_TURN), np.cos(_TURN), 0.0])
_SEEN = np.array([_RIGHT, np.cross(_VIEW, _RIGHT)])


def see(points):
    """Project points (..., 3) to the drawing plane (..., 2) by parallel projection."""
    return np.asarray(points, float) @ _SEEN.T


def paper(ax, title="", width=None, height=None):
    ax.set_aspect("equal")
    ax.axis("off")
    ax.set_title(title, fontsize=10.5, loc="left")
    if width:
        ax.set_xlim(*width)
        ax.set_ylim(*height)


def arrow(ax, start, end, color=INK, lw=1.6, size=13, style="-|>", z=5):
    how = {"arrowstyle": style, "color": color, "lw": lw, "shrinkA": 0, "shrinkB": 0, "mutation_scale": size}
    ax.annotate("", xy=end, xytext=start, arrowprops=how, zorder=z)


def course(ax, points, color=INK, lw=1.6, z=4):
    """A curve that ends in an arrow."""
    ax.plot(*points[:-1].T, color=color, lw=lw, zorder=z, solid_capstyle="butt")
    arrow(ax, points[-6], points[-1], color, lw=0, size=17, style="-|>,head_length=0.7,head_width=0.32", z=z)


def label(ax, at, text, color=INK, ha="center", va="center", size=10, **more):
    box = None if "weight" in more else {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    ax.text(*at, text, color=color, ha=ha, va=va, fontsize=size, zorder=9, bbox=box, **more)


def frame(ax, at, along, up, size):
    """Two axes of the machine in a corner."""
    at = np.asarray(at, float)
    for name, way in ((along, (1, 0)), (up, (0, 1))):
        end = at + size * np.asarray(way)
        arrow(ax, at, end, BLUE, lw=1.3, size=10)
        ax.text(*(end + 0.22 * size * np.asarray(way)), name, color=BLUE, ha="center", va="center", weight="bold")


BOX = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
_FACES = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]


def block(ax, corners, solid):
    """A box, given its eight corners in the order of BOX."""
    middle = corners.mean(axis=0)
    for face in _FACES:
        outwards = corners[list(face)].mean(axis=0) - middle
        if outwards @ _VIEW > 0:
            flat = see(corners[list(face)])
            if solid:
                ax.fill(*flat.T, facecolor=FILL, edgecolor=INK, lw=1.4, alpha=0.8, zorder=3, joinstyle="round")
            else:
                ax.fill(*flat.T, facecolor="none", edgecolor=GREY, lw=1.0, ls=(0, (4, 2.5)), zorder=2)


# -- plan views and sections


def spindle(ax, points, solid):
    """Housing, nose and tool; points: a function from the section to the paper."""
    how = {"facecolor": FILL if solid else "none", "edgecolor": INK if solid else GREY, "lw": 1.4 if solid else 1.0}
    ls, z = ("-", 4) if solid else ((0, (4, 2.5)), 2)
    for shape in (rectangle(-48, 48, 20, 190), rectangle(-30, 30, 0, 20)):
        ax.fill(*points(shape).T, **how, ls=ls, zorder=z)
    ax.fill(*points(rectangle(-6, 6, -250, 0)).T, **how | {"lw": 1.1}, ls=ls, zorder=z - 1)


def rectangle(x0, x1, y0, y1):
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float)


def turned(shape, by, about=(0, 0)):
    c, s = np.cos(by), np.sin(by)
    return (np.asarray(shape, float) - about) @ np.array([[c, s], [-s, c]]) + about


def part(ax, shape, by=None, about=(0, 0), face=FILL, z=3):
    """A part in plan view: as commanded, and as turned."""
    if by is None:
        ax.fill(*shape.T, facecolor="0.93", edgecolor="0.6", lw=1.0, zorder=z)
        return
    ax.fill(*shape.T, facecolor="none", edgecolor=GREY, lw=1.0, ls=(0, (4, 2.5)), zorder=z + 3)
    ax.fill(*turned(shape, by, about).T, facecolor=face, edgecolor=INK, lw=1.4, zorder=z)


def tip_mark(ax, at):
    ax.plot(*at, "o", ms=11, mfc="white", mec=INK, mew=1.6, zorder=8)


def cross(ax, at, color=INK):
    ax.plot(*at, "x", ms=9, color=color, mew=2.0, zorder=8)


def lever(ax, a, b, text, off):
    arrow(ax, a, b, BLUE, lw=1.6, size=11, style="<|-|>", z=7)
    label(ax, (np.asarray(a) + b) / 2 + off, text, BLUE, size=9.5)
