"""Reproduction of Wessel et al. 2004: optimal transformations of temperatures and displacements (W-01 to W-15).

Four experiments: a finite-element spindle (`thermocomp.papers.wessel2004.spindle`), the choice of temperatures on
23 data sets (`thermocomp.papers.wessel2004.sets`), a heated resting tool and a tool of a working milling machine
(`thermocomp.papers.wessel2004.tools`); and the models of three mountings, exchanged
(`thermocomp.papers.wessel2004.transfer`). The criteria of the claims are at the top of these modules; they were defined
before the first run.
"""

from thermocomp.papers.study import Progress, Study
from thermocomp.papers.wessel2004.sets import appendix_b, told
from thermocomp.papers.wessel2004.spindle import spindle
from thermocomp.papers.wessel2004.tools import milling_machine, resting_tool
from thermocomp.papers.wessel2004.transfer import transfer
from thermocomp.virtual.protocol import Physics

TITLE = "Wessel et al. 2004: Predicting thermal displacements in modular tool systems"


def run(seed: int, progress: Progress, physics: Physics | None = None) -> Study:
    """Reproduce the study on the virtual machines.

    Parameters
    ----------
    physics : {'linear', 'nonlinear'}, optional
        Physics of the virtual machines. Default: as defined by the experiments.
    """

    def within(begin: float, end: float) -> Progress:
        return lambda done, what: progress(begin + done * (end - begin), what)

    fem = spindle(seed, within(0.0, 0.03), physics)
    selection = appendix_b(seed, within(0.03, 0.5), physics)
    tool = resting_tool(seed, within(0.5, 0.88), selection, physics)
    mountings = transfer(seed, within(0.88, 0.93), physics)
    milling = milling_machine(seed, within(0.93, 1.0), physics)
    progress(1.0, "done")
    title = TITLE if physics in (None, "linear") else f"{TITLE}; {physics} virtual machines"
    return Study.of("wessel2004", title, fem, told(selection), tool, mountings, milling)
