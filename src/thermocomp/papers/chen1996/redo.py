"""Chen, Yuan, Ni 1996: screening, drifts of the spindle, positioning of Y, new observations, volume, and a part."""

from dataclasses import replace

import numpy as np

from thermocomp.papers.chen1996 import anywhere, drift, equation5, part, screening, slope, unseen, volume
from thermocomp.papers.chen1996.setup import exhibits
from thermocomp.papers.study import Figure, Part, Progress, Study

TITLE = "J. S. Chen, J. Yuan, J. Ni (1996): Thermal Error Modelling for Real-Time Error Compensation"


def run(seed: int, progress: Progress) -> Study:
    """Reproduce Chen's study, and return its claims, tables and figures."""
    new, first_laser, second_laser, first_week, second_week = ((seed + 1) * 1000 + k for k in range(5))
    progress(0.0, "five tests, regressions and nets")
    learned = drift.learn(seed, lambda share: progress(0.5 * share, "nets"))
    screened, imposed = screening.learn(seed, new, learned), equation5.seek(learned, seed)
    progress(0.5, "slopes of Y")
    slopes = slope.learn(first_laser, second_laser)
    progress(0.6, "new observations, noise, a lost sensor")
    observed = unseen.observe(learned, new)
    progress(0.65, "the whole work volume")
    whole = volume.learn(first_week)
    week = anywhere.predict(whole, second_week)
    volumes = anywhere.judge(whole, week, second_week)
    inspected = part.inspect(week, second_week)
    study = Study.of(
        "chen1996",
        TITLE,
        Part(screening.claims(screened), screening.tables(screened), (), screening.numbers(screened)),
        Part(drift.claims(learned), drift.tables(learned), drift.figures(learned), exhibits.numbers("drift", learned)),
        Part(equation5.claims(imposed), equation5.tables(imposed), (), equation5.numbers(imposed)),
        Part(slope.judge(slopes), slope.tables(slopes), slope.figures(slopes), slope.numbers(slopes)),
        Part(unseen.claims(observed), unseen.tables(observed), unseen.figures(observed), unseen.numbers(observed)),
        Part(anywhere.claims(volumes), anywhere.tables(volumes), anywhere.figures(volumes), anywhere.numbers(volumes)),
        Part(part.claims(inspected), part.tables(inspected), (), part.numbers(inspected)),
    )
    progress(1.0, "done")
    return replace(study, figures=tuple(sorted(study.figures, key=_number)))


def _number(figure: Figure) -> float:
    """Return the number of the figure in the paper; infinity for additional figures."""
    number = figure.key.removeprefix("chen1996-fig")
    return float(number) if number.isdigit() else np.inf
