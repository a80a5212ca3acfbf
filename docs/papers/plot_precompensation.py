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

from paper_page import Page

study = Page("precompensation")
numbers = study.numbers

# %%
# Orders of the model
# -------------------
#
# The numbers of past drifts k and of past speeds m are selected by the final prediction error, which is the error one
# step ahead with a penalty for every coefficient.

study.tell("P-02")
study.show("Final prediction error", "Orders by sampling interval")
assert numbers["k"] >= 1

# %%
# Free run
# --------
#
# For a prediction one step ahead, the model is given the measured drift of ten minutes ago, which no machine in
# production has. So all models are evaluated in free run (simulation): from the start of the test on, the speed is the
# only input of a model. The speeds of the test do not occur in the training data.

study.tell("P-03", "P-05", "E-P3")
study.show("Free run")
study.draw("fig4")
assert numbers["rms_one_step_um"] < numbers["rms_least_squares_um"] < 0.3 * numbers["rms_none_um"]

# %%
# Four models cover the whole travel of Z; between their positions the drift is interpolated.

study.tell("P-04")

# %%
# The program
# -----------
#
# Every ten minutes of the program a new correction is added to Z. Deviations are actual minus commanded, so the
# correction is minus the deviation.

study.tell("P-06")
study.draw("schedule")

# %%
# A surface is milled with the cold machine, then the spindle runs at varying speeds for an hour, then another surface
# is milled: how much deeper is the second? Eight such tests, each with different speeds.

study.tell("P-07")
study.show("Depth difference between the second surface")
study.show("Depth difference halfway")
study.draw("cut")
assert numbers["depth_difference_corrected_um"] < 0.5 * numbers["depth_difference_um"]

# %%
# For the second method each test has its NC program: four faces at four positions of Z, an hour of moves at other
# spindle speeds, four more faces. The program is revised as a file and read back as a controller reads it, and the
# commanded positions are added to the true drift at that instant and position.

study.show("Depth difference with NC programs, mean of", "Depth difference with NC programs, mean over")
study.draw("surfaces")
assert numbers["program_depth_difference_cold_revised_um"] < 0.5 * numbers["program_depth_difference_cold_um"]

# %%
# Effects that the model does not include
# ---------------------------------------
#
# A program that begins while the machine is still warm from the previous one, and a changing room temperature:

study.tell("E-P5", "E-P6")
study.draw("warm")
assert numbers["room_peak_to_peak_um"] > 1

# %%
# The same with NC programs: if the initial state is wrong by half an hour, the revised program is worse than the
# original; with the state at the end of the last job, it is better.

study.show("Depth difference with NC programs revised")
study.draw("programs")
wrong, carried = (
    numbers[f"program_depth_difference_warm_{what}_revised_um"] for what in ("taken_for_cold", "carried_over")
)
assert carried < numbers["program_depth_difference_warm_taken_for_cold_um"] < wrong
