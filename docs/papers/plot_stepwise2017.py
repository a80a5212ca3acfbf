"""
Stepwise regression 2017: from 24 temperatures to a few
=======================================================

*The Open Mechanical Engineering Journal* 11, 2017. 24 temperatures of a machine are more than a model needs. Stepwise
regression adds the temperature with the largest partial F, tests the included ones again, and continues until none
enters and none leaves; five remain. On-line, the five predict the drift of X better than least squares on all 24 and
than projection pursuit, with a residual below 5 um.

This page does the same on the virtual machining centre; ``thermocomp papers stepwise2017`` prints the same. The paper
compares its models on-line without specifying the conditions; here this is another day with other speeds.
"""

# %%
# One call runs the whole study. For a claim that does not hold here the reason is given.

from paper_page import Page

study = Page("stepwise2017")
numbers = study.numbers

# %%
# The test
# --------
#
# Four speeds, each followed by a standstill; three of the 24 temperatures, and the drift of X.

study.draw("fig2")
assert numbers["temperatures"] == 24

# %%
# The selection
# -------------
#
# A temperature enters with a partial F of 100 or more, and leaves below 50.

study.tell("T-01", "T-03", "T-06", "T-07")
study.show("Steps of the selection")
assert 1 <= numbers["chosen"] < 24

# %%
# On-line
# -------
#
# Another day: the models run reading by reading, as they would at the machine, and are compared with the probe
# measurement. The paper ran its model on a DSP; here the selected model is exported to C, compiled and given the same
# readings (without a C compiler: its Python twin). A test runs the same loop on an emulated Cortex-M7.

study.draw("fig6")
study.tell("T-08", "T-10")
study.show("Residuals of the methods")
assert numbers["rms_online_um"] < 0.5 * numbers["rms_online_none_um"]

# %%
# Robustness
# ----------
#
# The paper claims robustness without evidence. Noise on every temperature, and one sensor lost at a time:

study.tell("E-T5")

# %%
# What the thresholds mean
# ------------------------
#
# F increases with the number of rows, so a threshold of 100 is low for a test with fast sampling, and high for one with
# slow sampling. In addition, the rows of a drift are not independent: their effective sample size does not grow with
# the sampling rate.

study.draw("rows")
study.tell("E-T3", "E-C12")
study.show("Effect of the number of rows")
assert numbers["chosen_of_fewest_rows"] <= numbers["chosen"]
