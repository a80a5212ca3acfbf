"""
The methods on all experiments
==============================

Each paper tries its own method on its own machine. Here every method is trained on every paper's experiment and judged
on tests it has not seen: other speeds, other days. ``thermocomp papers cross`` prints the same; ``--with drift.csv``
adds recordings of your own, ``--models all`` the slower methods.
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
# Nothing wins everywhere. Where the fit is closest the unseen test is not: compare the first two columns. And look at
# the last ones before trusting any of them: what noise does, and what the worst sensor does if it reads no rise at all
# and nobody notices.

print(page.format_table(details[0]))
print()
print(page.format_table(details[-1]))

# %%
# The same as a picture: what is left of the drift.

(figure,) = study.figures
page.paint(figure, plt.figure(figsize=page.size(figure), layout="constrained"))
plt.show()
print(figure.caption)

# %%
# Is a method better than no compensation at all? On these machines nearly always. On a measured one it is not so sure:
# the front page of the project shows the same methods on one.

print(page.text(study))
