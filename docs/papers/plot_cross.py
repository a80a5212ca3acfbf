"""
The methods on all experiments
==============================

Each paper tests its own method on its own machine. Here every method is fitted to every paper's experiment and
evaluated on unseen tests: other speeds, other days. ``thermocomp papers cross`` prints the same; ``--with drift.csv``
adds your own recordings, ``--models all`` the slower methods.
"""

# %%

import matplotlib.pyplot as plt

from thermocomp.papers import cross
from thermocomp.papers.report import papers as page

study = cross.run(0)
numbers = study.numbers
overview, *details = study.tables
print(page.format_table(overview))
assert numbers["chen1996, z_um, dynamic: rms_um"] < 0.2 * numbers["chen1996, z_um, none: rms_um"]

# %%
# No method is best everywhere. The method with the closest fit is not the best on the unseen test: compare the first
# two columns. Before relying on any method, also consider the last columns: the effect of noise, and the effect of
# losing the most important sensor without detection (it stays at its zero).

print(page.format_table(details[0]))
print()
print(page.format_table(details[-1]))

# %%
# The same as a figure: the residual of the drift.

(figure,) = study.figures
page.paint(figure, plt.figure(figsize=page.size(figure), layout="constrained"))
plt.show()
print(figure.caption)

# %%
# Is a method better than no compensation at all? On the virtual machines nearly always. On a measured machine this is
# less certain: see :doc:`/real_machine`.

print(page.text(study))
