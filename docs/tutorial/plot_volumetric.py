"""
A compensated work volume
=========================

A drift test gives the error at one position. A part is machined anywhere on the table. In this example a laser with six
degrees of freedom has measured all three axes of the virtual machining centre repeatedly while it worked, probes have
measured the tool point at one position, and the squareness was measured by an artefact. From this data we fit all 18
components of the axes, combine them anywhere in the work volume, and correct. The true error of the virtual machine is
known at every point, so we can evaluate quantities that are not accessible in a workshop. :doc:`../position` shows the
same with files and commands.
"""

# %%
# Imports from thermocomp, and for plotting:

import matplotlib.pyplot as plt
import numpy as np

from thermocomp.core.components import BY_CODE
from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.models.training import train
from thermocomp.recordings.readers import codecolumns
from thermocomp.recordings.readers.profiles import from_recording
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.geometry.kinematics import INDEX
from thermocomp.runtime.geometry.volumetric import VolumetricModel
from thermocomp.virtual import datasets as virtual
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.experiments import simulate
from thermocomp.virtual.volume import VolumetricTruth
from thermocomp.volumetric.models.position import PositionOptions, fit_position
from thermocomp.volumetric.models.positionoptions import fill_options

# %%
# 1. The recordings
# -----------------
#
# Eight days: the spindle alone, the axes alone, both, a hot room, and four days of jobs. Every five minutes there is a
# row with 24 temperatures, the spindle speed, the nest of probes, and the profiles. ``EXX_200_um`` is the positioning
# error of X with X at 200 mm.

tests = virtual.record("volumetric")
codes = codecolumns.codes(tests[0])
print(len(tests), "tests,", sum(len(t) for t in tests), "rows")
print(len(codes), "components:", *codes[:9])
print(" " * 14, *codes[9:])
assert len(codes) == 18

# %%
# 2. From profiles to components
# ------------------------------
#
# From the profiles, without using the temperatures, `~thermocomp.volumetric.models.positionoptions.fill_options`
# determines for each component how many powers of the position change with the thermal state (none, if the thermal part
# is only noise), whether the profile shifts as a whole, and about which position it rotates. Then the cold profile is
# fitted, and the slopes are fitted to the temperatures. These are absolute temperatures: a laser reads the actual state
# of the machine on that morning, which differs from day to day.

fits = {}
for code in codes:
    profiles = [from_recording(t, code) for t in tests]
    options = fill_options(profiles, PositionOptions(method="dynamic", rezero=False))
    fits[code] = fit_position(profiles, options)

print(f"{'':5} {'powers':8} {'about':>6}  {'thermal part':>12}  left")
for code, fit in fits.items():
    unit, model = BY_CODE[code].unit, fit.model
    powers = " ".join(f"k{k}" for k in model.powers) or "-"
    turns = f"{model.reference_position:g}" if model.slopes else ""
    left = fit.remainders[len(model.slopes)] if model.slopes else fit.thermal_rms
    print(f"{code:5} {powers:8} {turns:>6}  {fit.thermal_rms:7.2f} {unit:4}  {left:.2f}")
assert fits["EXX"].model.reference_position == 300.0

# %%
# The last column is the residual of the thermal part after these powers: noise of the laser and, for a long screw, a
# curvature.
#
# 3. The machine
# --------------
#
# At the position at which the lasers were set to zero and the nest of probes was mounted, the angular errors have no
# lever and the profiles are zero. So the nest measures the whole drift at that position, of spindle and axes together,
# and nothing is counted twice.

PLACE, BAR = (300.0, 250.0, 300.0), (0.0, 0.0, -150.0)
TRAVEL = {"X": 600.0, "Y": 550.0, "Z": 600.0}

samples = stack(tests, ["x1_um", "y1_um", "z_um"])
everything = np.ones(len(samples), dtype=bool)
drifts = {code: train("dynamic", samples, k, everything).model for k, code in enumerate(("X0C", "Y0C", "Z0C"))}
square = {code: float(tests[0].table[f"{code}_urad"].iloc[0]) for code in ("C0Y", "B0Z", "A0Z")}

axes = tuple(
    Axis(a, (0.0, TRAVEL[a]), reference_position=PLACE[k], measured_at=PLACE, measured_tool=BAR)
    for k, a in enumerate("XYZ")
)
components = {code: fit.model for code, fit in fits.items()} | square | drifts
machine = Machine("virtual", Structure.parse("w X' b Z Y (C1) t"), axes, components, spindle_tool=BAR, tool=BAR)
model = VolumetricModel(machine)
print(len(components), "of 32 components,", len(model.inputs), "inputs")

# %%
# 4. A day that was not used for training
# ---------------------------------------
#
# A day with different weather, speeds and feed rates. The model is replayed over it, reading by reading, from
# temperatures and speed alone.

day = next(simulate(virtual.find_experiment("volumetric-new"), seed=5, whole=True))
unseen = virtual.make_recording(day)
states = model.replay(unseen.time, {name: unseen.table[name].to_numpy() for name in model.inputs})
hours = unseen.time / 3600
print(f"{len(unseen)} rows, {hours[-1]:.1f} h")

# %%
# Four components in three states of that day. Dots: laser readings. Lines: model.

fig, panels = plt.subplots(2, 2, figsize=(9, 6.5), layout="constrained")
rows = [0, int(np.searchsorted(hours, 5.3)), int(np.searchsorted(hours, 13.0))]
for ax, code in zip(panels.flat, ("EXX", "EYY", "EZY", "EAZ"), strict=True):
    k, unit = "XYZ".index(code[2]), BY_CODE[code].unit
    columns, _ = codecolumns.columns_of(unseen, code)
    along = np.tile(PLACE, (50, 1))
    along[:, k] = np.linspace(0.0, TRAVEL[code[2]], 50)
    for row in rows:
        (line,) = ax.plot(along[:, k], states[row].components(along)[:, INDEX[code]], label=f"{hours[row]:.1f} h")
        ax.plot(list(columns.values()), unseen.table[list(columns)].iloc[row], "o", ms=4, color=line.get_color())
    ax.set_title(f"{code}, {BY_CODE[code].description}", fontsize="medium")
    ax.set_xlabel(f"{code[2]} [mm]")
    ax.set_ylabel(unit)
    ax.axhline(0, color="0.8", lw=0.8, zorder=0)
panels[0, 0].legend()
plt.show()

# %%
# 5. Comparison with the true error
# ---------------------------------
#
# The comparison uses 1,000 random points, each at a random instant of that day. The true error is computed by
# `~thermocomp.virtual.volume` from the structure of the machine, independently of our model. It is relative to the zero
# that was set at the test position at the beginning of the day; the correction is added to the commanded positions of
# the axes.

truth = VolumetricTruth(MachiningCentre().observables)
zero = truth.error(day.observables[:1], [PLACE])


def left(rows, points, corrected=True):
    """True error [um] at points, each in the state of its row, without or with the model's correction."""
    added = np.zeros(points.shape)
    if corrected:
        added = np.array([states[int(row)].correction(p) for row, p in zip(rows, points, strict=True)])
    return truth.error(day.observables[rows], points + 1e-3 * added) - zero + added


def rms(error):
    """Root of the mean square of the vectors' lengths [um]."""
    return float(np.sqrt((error**2).sum(axis=-1).mean()))


rng = np.random.default_rng(0)
points = rng.uniform(size=(1000, 3)) * list(TRAVEL.values())
instants = rng.integers(0, len(unseen), len(points))
before, after = left(instants, points, corrected=False), left(instants, points)
print(f"RMS {rms(before):.1f} um before, {rms(after):.1f} um after: {rms(before) / rms(after):.0f} times smaller")
for k, axis in enumerate("XYZ"):
    print(f"{axis}: {rms(before[:, [k]]):5.1f} -> {rms(after[:, [k]]):.1f} um")
assert rms(before) > 8 * rms(after)

# %%
# Most of the residual has a single cause. At the test position, where all profiles are zero, the error of the predicted
# drift is almost as large as the error anywhere else; if it is subtracted, the contribution of the axes remains.

there = left(instants, np.tile(PLACE, (len(points), 1)))
print(f"residual at the test position {rms(there):.1f} um (Z alone {rms(there[:, [2]]):.1f} um)")
print(f"residual without that of the test position {rms(after - there):.1f} um")
assert rms(after - there) < rms(there)

# %%
# So a better laser would improve the result only a little, whereas probing a sphere occasionally would improve it much.

fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
for name, error, color in (("without compensation", before, "0.3"), ("compensated", after, "tab:green")):
    size = np.sort(np.linalg.norm(error, axis=1))
    share = np.linspace(0, 100, len(size))
    ax.plot(size, share, color=color, label=f"{name}: 95 % below {np.percentile(size, 95):.1f} um")
ax.set_xlabel("length of the error vector [um]")
ax.set_ylabel("points with a smaller error [%]")
ax.set_xlim(left=0)
ax.set_ylim(0, 100)
ax.legend(loc="lower right")
plt.show()

# %%
# The work volume at the worst instant of the day, with true errors enlarged a thousand times.

corners = np.array([[x, y, z] for x in (0.0, 600.0) for y in (0.0, 550.0) for z in (0.0, 600.0)])
size = [rms(left(np.full(8, row), corners, corrected=False)) for row in range(len(unseen))]
worst = int(np.argmax(size))
edges = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.sum(corners[a] != corners[b]) == 1]
fig = plt.figure(figsize=(9, 4.6))
fig.subplots_adjust(left=0.0, right=0.96, bottom=0.07, top=0.95, wspace=0.06)
for n, (title, corrected) in enumerate((("without compensation", False), ("compensated", True)), start=1):
    ax = fig.add_subplot(1, 2, n, projection="3d")
    for a, b in edges:
        line = corners[a] + np.linspace(0, 1, 15)[:, None] * (corners[b] - corners[a])
        ax.plot(*line.T, color="0.7", lw=0.8, ls="--")
        ax.plot(*(line + left(np.full(15, worst), line, corrected)).T, color="tab:green" if corrected else "tab:red")
    ends = left(np.full(8, worst), corners, corrected)
    ax.quiver(*corners.T, *ends.T, color="0.2", lw=1)
    ax.set_title(f"{title}: corners {rms(ends):.1f} um RMS", fontsize="medium")
    ax.set_xlabel("X [mm]")
    ax.set_ylabel("Y [mm]")
    ax.set_zlabel("Z [mm]")
    ax.set(xlim=(-50, 650), ylim=(-50, 600), zlim=(-80, 620))
    ax.set(xticks=(0, 300, 600), yticks=(0, 300, 550), zticks=(0, 300, 600))
    ax.set_box_aspect((1, 1, 1), zoom=1.05)
    ax.view_init(20, -60)
print(f"worst after {hours[worst]:.1f} h")
plt.show()

# %%
# This is a virtual machine: its sensors are close to the heat sources, and its laser reads every five minutes for eight
# days. On a real machine, evaluate the models as ``thermocomp position`` and ``thermocomp fit`` do, on days that were
# left out, and then on a test piece.
