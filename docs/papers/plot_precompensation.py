"""
Pre-compensation: the drift from the spindle speed alone
========================================================

The paper, of which only a part is available, uses no temperatures. The drift ten minutes ahead is computed from the
present drift and the spindle speed, which is specified in the NC program; so the drift of a whole program can be
computed beforehand, and its negative added to Z. A neural network learns the coefficients; depth differences between
surfaces milled cold and after an hour decreased from 7 to 2 um.

This page does the same on the virtual machining centre, in a measuring room; ``thermocomp papers precompensation``
prints the same. The cutting tests are done twice: once by applying the schedule of corrections to the depths, and once
with NC programs that are revised as by ``thermocomp revise``, read back and milled.
"""

# %%
# One call runs the whole study. For a claim that does not hold here the reason is given.

import matplotlib.pyplot as plt

from thermocomp.papers.report import papers as page
from thermocomp.papers.studies import run

study = run("precompensation")
numbers = study.numbers
figures = {f.key: f for f in study.figures}


def draw(key: str) -> None:
    """Draw a figure of the study."""
    page.paint(figures[key], plt.figure(figsize=page.size(figures[key]), layout="constrained"))
    plt.show()


print(page.headline(study))

# %%
# Orders of the model
# -------------------
#
# The numbers of past drifts k and of past speeds m are selected by the final prediction error, which is the error one
# step ahead with a penalty for every coefficient.

print(page.text(study, "P-02"))
print(page.format_table(study.tables[0]))
print()
print(page.format_table(study.tables[2]))
assert numbers["k"] >= 1

# %%
# Free run
# --------
#
# For a prediction one step ahead, the model is given the measured drift of ten minutes ago, which no machine in
# production has. So all models are evaluated in free run (simulation): from the start of the test on, the speed is the
# only input of a model. The speeds of the test do not occur in the training data.

print(page.text(study, "P-03", "P-05", "E-P3"))
draw("precompensation-fig4")
assert numbers["rms_one_step_um"] < numbers["rms_least_squares_um"] < 0.3 * numbers["rms_none_um"]

# %%
# Four models cover the whole travel of Z; between their positions the drift is interpolated.

print(page.text(study, "P-04"))

# %%
# The program
# -----------
#
# Every ten minutes of the program a new correction is added to Z. Deviations are actual minus commanded, so the
# correction is minus the deviation.

print(page.text(study, "P-06"))
draw("precompensation-schedule")

# %%
# A surface is milled with the cold machine, then the spindle runs at varying speeds for an hour, then another surface
# is milled: how much deeper is the second? Eight such tests, each with different speeds.

print(page.text(study, "P-07"))
print(page.format_table(study.tables[4]))
draw("precompensation-cut")
assert numbers["depth_difference_corrected_um"] < 0.5 * numbers["depth_difference_um"]

# %%
# For the second method each test has its NC program: four faces at four positions of Z, an hour of moves at other
# spindle speeds, four more faces. The program is revised as a file and read back as a controller reads it, and the
# commanded positions are added to the true drift at that instant and position.

print(page.format_table(study.tables[5]))
print()
print(page.format_table(study.tables[6]))
draw("precompensation-surfaces")
assert numbers["program_depth_difference_cold_revised_um"] < 0.5 * numbers["program_depth_difference_cold_um"]

# %%
# Effects that the model does not include
# ---------------------------------------
#
# A program that begins while the machine is still warm from the previous one, and a changing room temperature:

print(page.text(study, "E-P5", "E-P6"))
draw("precompensation-warm")
assert numbers["room_peak_to_peak_um"] > 1

# %%
# The same with NC programs: if the initial state is wrong by half an hour, the revised program is worse than the
# original; with the state at the end of the last job, it is better.

print(page.format_table(study.tables[7]))
draw("precompensation-programs")
wrong, carried = (
    numbers[f"program_depth_difference_warm_{what}_revised_um"] for what in ("taken_for_cold", "carried_over")
)
assert carried < numbers["program_depth_difference_warm_taken_for_cold_um"] < wrong
