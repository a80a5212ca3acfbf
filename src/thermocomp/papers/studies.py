"""The studies by name; each is imported when it is asked for."""

from dataclasses import dataclass
from importlib import import_module

from thermocomp.papers.study import Progress, Study, silent


@dataclass(frozen=True)
class Paper:
    """A paper that can be redone.

    Parameters
    ----------
    title : str
        Authors, year and title.
    module : str
        Of its ``run(seed, progress) -> Study``.
    """

    title: str
    module: str


STUDIES: dict[str, Paper] = {
    "chen1996": Paper(
        "Chen, Yuan, Ni 1996: Thermal error modelling for real-time error compensation", "thermocomp.papers.chen1996"
    ),
    "wessel2004": Paper(
        "Wessel et al. 2004: Predicting thermal displacements in modular tool systems", "thermocomp.papers.wessel2004"
    ),
    "hwang": Paper("Hwang, Lee, Yang: Optimal variable selection for a thermal error model", "thermocomp.papers.hwang"),
    "precompensation": Paper(
        "Pre-compensation of thermal error by revision of the NC program", "thermocomp.papers.precompensation"
    ),
    "stepwise2017": Paper(
        "Open Mech. Eng. J. 11 (2017): Stepwise selection of temperature points by partial F",
        "thermocomp.papers.stepwise2017",
    ),
}


def run(name: str, *, seed: int = 0, progress: Progress = silent) -> Study:
    """Redo a paper's study on the virtual machine.

    Parameters
    ----------
    name : str
        Key of `STUDIES`.
    seed : int
        Of weather, noise and what is drawn by lot.
    progress : callable
        Told the share done and what comes next.

    Returns
    -------
    Study
    """
    study: Study = import_module(STUDIES[name].module).run(seed, progress)
    return study
