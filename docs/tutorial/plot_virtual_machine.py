"""
The virtual machine tool
========================

The recordings in the examples come from a virtual machining centre: a finite-element model reduced to about a hundred
states, which are computed in microseconds per step. This page runs it through the warm-up and cool-down of Chen, Yuan
and Ni (six hours at one speed, ten hours at standstill) and evaluates the results as a metrologist would.
"""

# %%
# The machine is at rest overnight, runs at 2600 1/min while its axes move, and stops. We read its outputs directly,
# without sensors, in steps of ten seconds.

import matplotlib.pyplot as plt
import numpy as np

from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.machine import Air, FeedDrive

machine = MachiningCentre()
room = Air(temperature=22.0, stratification=0.5)
drives = [FeedDrive()] * 4320 + [FeedDrive(2600.0, feed=(600.0, 1000.0, 600.0))] * 2160 + [FeedDrive()] * 3600
air = np.tile(room.values, (len(drives), 1))

_, truth = machine.run(machine.init(room), drives, air, dt=10.0)
print(f"{len(drives)} steps of 10 s; {len(machine.model.one)} states")

hours = (np.arange(len(drives)) - 4319) / 360.0
temperature = dict(zip(machine.places, truth.temperatures.T, strict=True))
drift = {name: row - row[4319] for name, row in zip(machine.observables, truth.observables.T, strict=True)}

# %%
# Temperatures and drift
# ----------------------
#
# The bearing and the shaft are warm within minutes, the headstock within hours, and the column hardly warms up at all;
# but the front of the column gets warmer than its rear, which bends it.

fig, axes = plt.subplots(2, 1, figsize=(9, 7), sharex=True, layout="constrained")
for place in ("front_bearing", "front_seat", "housing", "headstock_front", "column_front_right", "column_rear_right"):
    axes[0].plot(hours, temperature[place], label=place)
axes[0].set_ylabel("temperature [degC]")
for name in ("x", "y", "z"):
    axes[1].plot(hours, drift[name], label=name)
axes[1].set_ylabel("tool point against workpiece [um]")
axes[1].set_xlabel("time [h]")
axes[1].set_xlim(-1, 16)
for ax in axes:
    ax.axvspan(0, 6, color="0.95")
    ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1, 1))
plt.show()


def until(share, course):
    """Hours until a share of the change is done."""
    change = np.abs(course[4320:6480] - course[4319])
    return hours[4320:6480][np.argmax(change >= share * change.max())]


for name, course in (("spindle growth", drift["tip"]), ("column front", temperature["column_front_right"])):
    print(f"{name:15} 63 % after {60 * until(0.63, course):4.0f} min")
assert 20 < np.abs(drift["z"]).max() < 200
assert until(0.63, drift["tip"]) < 0.4 * until(0.63, temperature["column_front_right"])

# %%
# Hysteresis
# ----------
#
# The same temperature of the housing corresponds to different drifts during warm-up and cool-down. No function of this
# single temperature can predict the drift, however nonlinear: this is why the papers use several sensors, and why
# the method `dynamic` also uses their past values.

fig, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for ax, name in zip(axes, ("z", "y"), strict=True):
    ax.plot(temperature["housing"][4320:6480], drift[name][4320:6480], label="running")
    ax.plot(temperature["housing"][6480:], drift[name][6480:], label="stopped")
    ax.set_xlabel("housing [degC]")
    ax.set_ylabel(f"{name} [um]")
    ax.legend()
plt.show()

# %%
# Position
# --------
#
# The displacement of the nut of a warm ball screw increases with the distance from the fixed bearing, and a bent column
# pitches the headstock: the error of Y depends on Y. One slope describes most of this; Chen observed the same, and
# therefore modelled a slope instead of a profile.

fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
positions = np.arange(0, 551, 50)
profiles = np.array([drift[f"yy@{p}"] for p in positions])
for hour in (0.5, 1, 2, 4, 6, 8, 12):
    ax.plot(positions, profiles[:, 4319 + round(360 * hour)] - profiles[0, 4319 + round(360 * hour)], label=f"{hour} h")
ax.set_xlabel("Y [mm]")
ax.set_ylabel("positioning error of Y [um]")
ax.legend(fontsize="small", ncols=2)
plt.show()

warm = profiles[:, 6480] - profiles[0, 6480]
slope, offset = np.polyfit(positions, warm, 1)
bend = np.abs(warm - np.polyval([slope, offset], positions)).max()
print(f"slope {1e3 * slope:.0f} um/m; deviation from the straight line at most {bend:.1f} um of {np.ptp(warm):.0f} um")
assert bend < 0.15 * np.ptp(warm)
