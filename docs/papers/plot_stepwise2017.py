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

import matplotlib.pyplot as plt

from thermocomp.papers.report import papers as page
from thermocomp.papers.studies import run

study = run("stepwise2017")
numbers = study.numbers
figures = {f.key: f for f in study.figures}


def draw(key: str) -> None:
    """Draw a figure of the study."""
    page.paint(figures[key], plt.figure(figsize=page.size(figures[key]), layout="constrained"))
    plt.show()


print(page.headline(study))

# %%
# The test
# --------
#
# Four speeds, each followed by a standstill; three of the 24 temperatures, and the drift of X.

draw("stepwise2017-fig2")
assert numbers["temperatures"] == 24

# %%
# The selection
# -------------
#
# A temperature enters with a partial F of 100 or more, and leaves below 50.

print(page.text(study, "T-01", "T-03", "T-06"))
print(page.format_table(study.tables[0]))
assert 1 <= numbers["chosen"] < 24

# %%
# On-line
# -------
#
# Another day: the models run reading by reading, as they would at the machine, and are compared with the probe
# measurement. The paper ran its model on a DSP; here the selected model is exported to C, compiled and given the same
# readings (without a C compiler: its Python twin). A test runs the same loop on an emulated Cortex-M7.

draw("stepwise2017-fig6")
print(page.text(study, "T-08", "T-10"))
print(page.format_table(study.tables[1]))
assert numbers["rms_online_um"] < 0.5 * numbers["rms_online_none_um"]

# %%
# Robustness
# ----------
#
# The paper claims robustness without evidence. Noise on every temperature, and one sensor lost at a time:

print(page.text(study, "E-T5"))

# %%
# What the thresholds mean
# ------------------------
#
# F increases with the number of rows, so a threshold of 100 is low for a test with fast sampling, and high for one with
# slow sampling. In addition, the rows of a drift are not independent: their effective sample size does not grow with
# the sampling rate.

draw("stepwise2017-rows")
print(page.text(study, "E-T3", "E-C12"))
print(page.format_table(study.tables[2]))
assert numbers["chosen_of_fewest_rows"] <= numbers["chosen"]
