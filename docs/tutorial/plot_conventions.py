"""
Sign conventions in drawings
============================

Which direction is positive? All figures on this page are drawn from results of `thermocomp.volumetric`: exact
transforms with errors enlarged several thousand times to make them visible. The numbers next to them are checked when
the page is built. :doc:`../volumetric` describes the conventions in words.

In all drawings the **commanded** state is grey and dashed, the **actual** state is black, and the orange arrow is the
error: actual minus commanded, tool relative to workpiece.
"""

# %%
# The sections below need a machine of a given structure whose axes were measured at position zero, and the error of its
# tool tip if some components are given and all others are zero.

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pencil  # the drawings' arrows, boxes and labels

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry import exact
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics


def machine(code, **more):
    """Return a machine whose axes have their reference points at zero."""
    structure = Structure.parse(code)
    axes = tuple(Axis(a, (-1000.0, 1000.0)) for a in structure.axes)
    return Machine("drawn", structure, axes, **more)


def values(components):
    """Return all 32 components, those that are not named being zero."""
    found = np.zeros(len(COMPONENTS))
    for name, value in components.items():
        found[INDEX[name]] = value
    return found


def error(of, components, at=(0, 0, 0), tool=(0, 0, 0)):
    """Return the error of the tip [um]; at: X, Y, Z [mm]; tool: gauge point to tip [mm]."""
    found, _ = Kinematics(of).synthesize(values(components), np.asarray(at, float), tool)
    return found.round(6).tolist()


# sphinx_gallery_start_ignore
def moved(of, components, places, at=(0, 0, 0)):
    """Return the actual positions of points of the last body [mm], (n, 3), for components of any size."""
    places = np.asarray(places, float)
    off = [exact.error(of, values(components), np.asarray(at, float), p) for p in places]
    return np.asarray(at, float) + places + 1e-3 * np.array(off)


# sphinx_gallery_end_ignore
# %%
# Axes and rotations
# ------------------
#
# X, Y and Z are those of ISO 841: Z along the spindle, positive where tool and workpiece move apart. A, B and C are the
# rotations about X, Y and Z. They are positive by the right-hand rule: thumb along the axis, fingers in the positive
# direction. So A rotates Y towards Z, B rotates Z towards X and C rotates X towards Y: a rotation of 1 urad moves a
# point 1000 mm away by 1 um.

single = machine("w b X (C1) t")

assert error(single, {"EAX": 1}, tool=(0, 1000, 0)) == [0, 0, 1]
assert error(single, {"EBX": 1}, tool=(0, 0, 1000)) == [1, 0, 0]
assert error(single, {"ECX": 1}, tool=(1000, 0, 0)) == [0, 1, 0]

# sphinx_gallery_start_ignore
fig, ax = plt.subplots(figsize=(6.4, 5.2), layout="constrained")
pencil.paper(ax, "", (-0.65, 1.75), (-0.8, 1.8))
for k, (name, turn) in enumerate(zip("XYZ", "ABC", strict=True)):
    way, second, third = np.roll(np.eye(3), -k, axis=0)
    pencil.arrow(ax, pencil.see(-0.12 * way), pencil.see(1.6 * way), pencil.INK, lw=2.2, size=20)
    pencil.label(ax, pencil.see(1.72 * way), name, weight="bold", size=15)
    start = 1000.0 * (0.30 * second - 0.12 * third)
    angles = np.linspace(0, np.radians(290), 90) * 1e6
    ring = np.array([moved(single, {f"E{turn}X": a}, [start])[0] for a in angles]) / 1000.0
    pencil.course(ax, pencil.see(ring + 1.05 * way), pencil.ORANGE, lw=2.2)
    pencil.label(ax, pencil.see(1.45 * ring[(62, 8, 62)[k]] + 1.05 * way), turn, pencil.ORANGE, weight="bold", size=15)
pencil.label(ax, (-0.10, -0.13), "0", size=11)
plt.show()
# sphinx_gallery_end_ignore
# %%
# The six errors of an axis
# -------------------------
#
# This example shows those of X; Y and Z have the same six. The second letter denotes the error, the third the moving
# axis. The reference point is in the middle of the carriage: there angular errors cause no displacement.

six = ("EXX", "EYX", "EZX", "EAX", "EBX", "ECX")
for way, name in enumerate(six[:3]):
    assert error(single, {name: 7})[way] == 7
for name in six[3:]:
    assert error(single, {name: 7}) == [0, 0, 0]

# sphinx_gallery_start_ignore
fig, axes = plt.subplots(2, 3, figsize=(9.4, 5.0), layout="constrained")
half = np.array([210.0, 150.0, 75.0])
for ax, name in zip(axes.flat, six, strict=True):
    k, word = six.index(name) % 3, BY_CODE[name].description.removesuffix(" of X")
    pencil.paper(ax, f"{name}  {word}", (-440, 470), (-240, 260))
    for side in (-95, 95):
        ax.plot(*pencil.see([[-430, side, -half[2]], [430, side, -half[2]]]).T, color="0.75", lw=3.5, zorder=1)
    translation = name in six[:3]
    pencil.block(ax, pencil.BOX * half, solid=False)
    pencil.block(ax, moved(single, {name: 8e4 if translation else 0.24e6}, pencil.BOX * half), solid=True)
    way, second, third = np.roll(np.eye(3), -k, axis=0)
    if translation:
        top = np.array([0.0, 0.0, half[2]])
        pencil.arrow(ax, pencil.see(top), pencil.see(top + 150 * way), pencil.ORANGE, lw=2.4, size=17)
        pencil.label(ax, pencil.see(top + 195 * way), f"+{'XYZ'[k]}", pencil.ORANGE, weight="bold", size=11)
    else:
        out = (1.3 * half[k] + 40) * way
        ax.plot(*pencil.see([-out * 1.1, out * 1.3]).T, color=pencil.BLUE, lw=1.0, ls=(0, (8, 2, 2, 2)), zorder=4)
        pencil.label(ax, pencil.see(out * 1.3 + 32 * way), "XYZ"[k], pencil.BLUE, weight="bold", size=11)
        ring = [moved(single, {name: a}, [80.0 * second - 30.0 * third])[0] for a in np.linspace(0, 4.9e6, 80)]
        pencil.course(ax, pencil.see(np.array(ring) + out), pencil.ORANGE, lw=2.0, z=6)
plt.show()
# sphinx_gallery_end_ignore
# %%
# Squareness
# ----------
#
# A squareness error rotates the guide of one axis; the motion along it remains straight, but its deviation increases
# with the distance from the axis' reference position. The second axis is rotated in the positive sense of C, B or A:
# C0Y is positive if the angle from +X to +Y is above 90 degrees, B0Z if the angle from +X to +Z is below, A0Z if the
# angle from +Y to +Z is above 90 degrees.

three = machine("w b X Y Z (C1) t")

assert error(three, {"C0Y": 12}, at=(0, 500, 0)) == [-6, 0, 0]
assert error(three, {"B0Z": 12}, at=(0, 0, 500)) == [6, 0, 0]
assert error(three, {"A0Z": 12}, at=(0, 0, 500)) == [0, -6, 0]

# sphinx_gallery_start_ignore
fig, axes = plt.subplots(1, 3, figsize=(9.4, 4.2), layout="constrained")
for ax, (name, across, along) in zip(axes, (("C0Y", "X", "Y"), ("B0Z", "X", "Z"), ("A0Z", "Y", "Z")), strict=True):
    i, j = "XYZ".index(across), "XYZ".index(along)

    def shown(way, i=i, j=j, name=name):
        """Return the actual position for a commanded `way`, in the drawing's plane, with errors enlarged."""
        at = np.eye(3)[j] * way
        return (at + 25.0 * np.array(error(three, {name: 12}, at=at)))[[i, j]]

    wide = shown(500)[0] < 0
    pencil.paper(
        ax, f"{name} > 0: {across} to {along} {'above' if wide else 'below'} 90\u00b0", (-340, 440), (-180, 720)
    )
    pencil.arrow(ax, (-260, 0), (390, 0), pencil.INK, lw=1.8)
    pencil.label(ax, (418, 0), across, weight="bold", size=13)
    ax.plot([0, 0], [-70, 640], **pencil.COMMANDED)
    pencil.label(ax, (0, 675), along, pencil.GREY, weight="bold", size=13)
    pencil.arrow(ax, shown(0), shown(620), pencil.INK, lw=2.0)
    for way in (300.0, 500.0):
        p, q = np.array([0, way]), shown(way)
        for middle, face, edge, dashes in ((p, "white", pencil.GREY, (0, (3, 2))), (q, pencil.FILL, pencil.INK, "-")):
            ax.add_patch(
                plt.Rectangle(middle - 20, 40, 40, facecolor=face, edgecolor=edge, ls=dashes, lw=1.3, zorder=6)
            )
        pencil.arrow(ax, p, q, pencil.ORANGE, lw=2.4, size=15, z=8)
    sign = "\u2212" if wide else "+"
    angles = np.linspace(0, shown(1000)[0] / 1000, 30)
    pencil.course(ax, 200 * np.stack([np.sin(angles), np.cos(angles)], axis=1), pencil.BLUE, lw=1.8)
    pencil.label(ax, (-115 if wide else 115, 190), f"+{name[0]}", pencil.BLUE, weight="bold", size=12)
    ax.plot(0, 0, "o", color=pencil.INK, ms=6, zorder=9)
    pencil.label(ax, (12, -32), f"{along.lower()}$_0$", size=11, va="top", ha="left")
    formula = f"d$_{across}$ = {sign} {name} \u00b7 ({along.lower()} \u2212 {along.lower()}$_0$)"
    pencil.label(ax, (40, -135), formula, pencil.ORANGE, size=12)
plt.show()
# sphinx_gallery_end_ignore
# %%
# Tilt of the spindle
# -------------------
#
# The drift of the spindle was measured at the tip of a test bar of 150 mm. This is its reference point: the effect of
# the tilt at this point is already contained in the drift. A tool of 250 mm reaches 100 mm further, and a tilt of 30
# urad moves its tip by 3 um: to +Y for A0C, to -X for B0C.

mill = machine("w X' b Z Y (C1) t", spindle_tool=(0, 0, -150))

assert error(mill, {"A0C": 30}, tool=(0, 0, -150)) == [0, 0, 0]
assert error(mill, {"A0C": 30}, tool=(0, 0, -250)) == [0, 3, 0]
assert error(mill, {"B0C": 30}, tool=(0, 0, -250)) == [-3, 0, 0]

# sphinx_gallery_start_ignore
fig, axes = plt.subplots(1, 2, figsize=(8.8, 5.6), layout="constrained")
for ax, (name, across) in zip(axes, (("A0C", "Y"), ("B0C", "X")), strict=True):
    k = "XYZ".index(across)

    def shown(shape, k=k, name=name):
        """Return the actual positions of points of the spindle, with the tilt enlarged 8,000 times."""
        places = np.zeros((len(shape), 3))
        places[:, k], places[:, 2] = np.asarray(shape, float).T
        return moved(mill, {name: 30 * 8000}, places)[:, [k, 2]]

    (tip,) = shown([(0, -250)])
    side = np.sign(tip[0])
    looking = "\u2212X" if across == "Y" else "+Y"
    pencil.paper(ax, f"{name} > 0, looking along {looking}", (-200, 200), (-320, 255))
    pencil.spindle(ax, np.asarray, solid=False)
    pencil.spindle(ax, shown, solid=True)
    ax.plot([0, 0], [235, -300], color=pencil.GREY, lw=1.0, ls=(0, (8, 2, 2, 2)))
    ax.plot(*shown([(0, 235), (0, -300)]).T, color=pencil.INK, lw=1.0, ls=(0, (8, 2, 2, 2)), zorder=7)
    pencil.arrow(ax, (0, -250), (tip[0], -250), pencil.ORANGE, lw=2.8, size=16, z=9)
    arc = np.linspace(0, 0.24, 30) * side
    pencil.course(ax, np.stack([-380 * np.sin(arc), 380 * np.cos(arc) - 150], axis=1), pencil.BLUE, lw=1.8)
    pencil.label(ax, (-38 * side, 245), f"+{name[0]}", pencil.BLUE, weight="bold", size=12)
    ax.plot(0, -150, "o", color=pencil.BLUE, ms=8, zorder=9)
    inner, outer = ("right", "left") if side > 0 else ("left", "right")
    pencil.label(ax, (-22 * side, -150), "drift was\nmeasured here", pencil.BLUE, ha=inner, size=9.5)
    x = 62 * side
    pencil.arrow(ax, (x, -150), (x, -250), pencil.INK, lw=1.1, size=11, style="<|-|>")
    for y in (-150, -250):
        ax.plot([12 * side, x + 8 * side], [y, y], color="0.6", lw=0.7, zorder=1)
    pencil.label(ax, (x + 10 * side, -200), "100 mm", ha=outer, size=10)
    sign = "+" if side > 0 else "\u2212"
    pencil.label(ax, (40 * side, -285), f"d$_{across}$ = {sign}3 um for 30 urad", pencil.ORANGE, ha=outer, size=11)
    pencil.frame(ax, (-185 if side < 0 else 110, 80), across, "Z", 55)
plt.show()
# sphinx_gallery_end_ignore
# %%
# Levers, and which side moves
# ----------------------------
#
# A component is the motion of the tool side relative to the workpiece side, whichever of them moves. In the upper row
# the yaw of X is 20 urad. On the left a column carries the tool along X and rotates to the left. On the right a table
# carries the workpiece along X and rotates to the **right**: seen from the workpiece, the tool has rotated to the left.
# It is the same component, and it has the same lever, because Y is between X and the tool on both machines. The ring is
# the tool seen from above, the cross is its nominal position on the workpiece.

yaw_x, yaw_y = {"ECX": 20}, {"ECY": 20}
assert error(machine("w b X Y Z (C1) t"), yaw_x, at=(0, 400, 0)) == [-8, 0, 0]
assert error(machine("w X' b Y Z (C1) t"), yaw_x, at=(0, 400, 0)) == [-8, 0, 0]

# %%
# The lower row shows the yaw of Y, with X 400 mm from the position at which this yaw was measured. On the left the
# gantry carries X, so the position of X is a lever. On the right the saddle rotates together with the table on it,
# about the tool; X is on the workpiece side of Y and does not contribute to the lever. This is the only effect of the
# structure code.

assert error(machine("w b Y X Z (C1) t"), yaw_y, at=(400, 0, 0)) == [0, 8, 0]
assert error(machine("w X' Y' b Z (C1) t"), yaw_y, at=(400, 0, 0)) == [0, 0, 0]

# sphinx_gallery_start_ignore
TURN = 0.15
fig, axes = plt.subplots(2, 2, figsize=(9.4, 9.0), layout="constrained")
titles = (
    "ECX > 0 on w b X Y Z t\na column on X carries the tool",
    "ECX > 0 on w X' b Y Z t\na table on X carries the workpiece",
    "ECY > 0 on w b Y X Z t\na gantry on Y carries X and the tool",
    "ECY > 0 on w X' Y' b Z t\na saddle on Y carries the table on X",
)
for ax, title in zip(axes.flat, titles, strict=True):
    pencil.paper(ax, title, (-460, 520), (-330, 580))
    pencil.frame(ax, (-420, -295), "X", "Y", 95)

ax = axes[0, 0]
pencil.part(ax, pencil.rectangle(-330, 330, 300, 520), z=1)
pencil.label(ax, (190, 480), "workpiece", size=10, weight="bold")
pencil.part(ax, pencil.rectangle(-130, 130, -160, -20), TURN)
pencil.part(ax, pencil.rectangle(-30, 30, -20, 440), TURN, face="white")
pencil.label(ax, (10, -95), "column X", size=11, weight="bold")
(tip,) = pencil.turned([(0, 400)], TURN)
assert np.sign(tip[0]) == np.sign(error(machine("w b X Y Z (C1) t"), yaw_x, at=(0, 400, 0))[0]) == -1
pencil.tip_mark(ax, tip)
pencil.cross(ax, (0, 400), pencil.GREY)
pencil.arrow(ax, (0, 400), (tip[0], 400), pencil.ORANGE, lw=2.6, size=15, z=9)
pencil.lever(ax, (75, 0), (75, 400), "lever\n400 mm", (85, -60))
pencil.label(ax, (-200, 400), "d$_X$ = \u22128 um", pencil.ORANGE, size=12)

ax = axes[0, 1]
pencil.part(ax, pencil.rectangle(-330, 330, -60, 520), -TURN, z=1)
pencil.label(ax, (170, 60), "table X", size=11, weight="bold")
pencil.part(ax, pencil.rectangle(-30, 30, -160, 440), z=4)
pencil.tip_mark(ax, (0, 400))
(spot,) = pencil.turned([(0, 400)], -TURN)
assert np.sign(0 - spot[0]) == np.sign(error(machine("w X' b Y Z (C1) t"), yaw_x, at=(0, 400, 0))[0]) == -1
pencil.cross(ax, spot)
pencil.arrow(ax, (spot[0], 400), (0, 400), pencil.ORANGE, lw=2.6, size=15, z=9)
pencil.lever(ax, (-75, 0), (-75, 400), "lever\n400 mm", (-85, -60))
pencil.label(ax, (-185, 475), "d$_X$ = \u22128 um", pencil.ORANGE, size=12)
pencil.label(ax, (spot[0] + 25, spot[1]), "should be\nunder the tool", size=9, ha="left")

ax = axes[1, 0]
pencil.part(ax, pencil.rectangle(-330, 490, 110, 490), z=1)
pencil.label(ax, (-200, 450), "workpiece", size=10, weight="bold")
pencil.part(ax, pencil.rectangle(-120, 470, -60, 60), TURN)
pencil.part(ax, pencil.rectangle(340, 460, -75, 75), TURN, face="white", z=4)
pencil.label(ax, (140, 20), "gantry Y", size=11, weight="bold")
pencil.label(ax, pencil.turned([(437, 45)], TURN)[0], "X", size=11, weight="bold")
(tip,) = pencil.turned([(400, 0)], TURN)
assert np.sign(tip[1]) == np.sign(error(machine("w b Y X Z (C1) t"), yaw_y, at=(400, 0, 0))[1]) == 1
pencil.tip_mark(ax, tip)
pencil.cross(ax, (400, 0), pencil.GREY)
pencil.arrow(ax, (400, 0), (400, tip[1]), pencil.ORANGE, lw=2.6, size=15, z=9)
pencil.lever(ax, (0, -130), (400, -130), "lever 400 mm", (0, -40))
pencil.label(ax, (395, 165), "d$_Y$ = +8 um", pencil.ORANGE, size=12)

ax = axes[1, 1]
pencil.part(ax, pencil.rectangle(-240, 240, -200, 140), -TURN, face="0.93", z=1)
pencil.part(ax, pencil.rectangle(-420, 60, -110, 90), -TURN, z=3)
pencil.label(ax, pencil.turned([(-290, -10)], -TURN)[0], "table X", size=11, weight="bold")
pencil.label(ax, pencil.turned([(155, -165)], -TURN)[0], "saddle Y", size=11, weight="bold")
pencil.part(ax, pencil.rectangle(-32, 32, -20, 420), z=5)
pencil.tip_mark(ax, (0, 0))
pencil.cross(ax, (0, 0))
pencil.label(ax, (75, 215), "lever 0\nno error", pencil.ORANGE, size=12, ha="left")

for ax in axes.flat[:3]:
    ax.plot(0, 0, "o", color=pencil.BLUE, ms=8, zorder=9)
pencil.label(axes[0, 0], (-50, 30), "measured\nhere", pencil.BLUE, size=9, ha="right")
pencil.label(axes[0, 1], (45, 0), "measured here", pencil.BLUE, size=9, ha="left")
pencil.label(axes[1, 0], (-130, 85), "measured here", pencil.BLUE, size=9)
plt.show()
# sphinx_gallery_end_ignore
# %%
# In all four drawings the measuring point moves with the tool, like a reflector in the spindle. If it is fixed to the
# table, the axis' own travel is also a lever (``measured_on``), because the tool moves away from the measuring point.

table = machine("w X' b Y Z (C1) t")
reflector_on_it = replace(table, axes=tuple(replace(a, measured_on="workpiece") for a in table.axes))

assert error(table, yaw_x, at=(400, 0, 0)) == [0, 0, 0]
assert error(reflector_on_it, yaw_x, at=(400, 0, 0)) == [0, 8, 0]
