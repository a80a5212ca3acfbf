"""Chen, Yuan, Ni 1996: drifts of the spindle, positioning of Y, new observations, and the whole work volume."""

from thermocomp.papers.chen1996 import anywhere, drift, show, slope, unseen, volume
from thermocomp.papers.study import Progress, Study


def run(seed: int, progress: Progress) -> Study:
    """Redo the study.

    Parameters
    ----------
    seed : int
        Of weather and noise. New tests get other ones: the same seed would give them the weather that was learned from.
    progress : callable
        Told the share done and what comes next.

    Returns
    -------
    Study
    """
    new, first_laser, second_laser, first_week, second_week = ((seed + 1) * 1000 + k for k in range(5))
    progress(0.0, "five tests, regressions and nets")
    learned = drift.learn(seed, lambda share: progress(0.5 * share, "nets"))
    progress(0.5, "slopes of Y")
    slopes = slope.learn(first_laser, second_laser)
    progress(0.6, "new observations, noise, a lost sensor")
    observed = unseen.observe(learned, new)
    progress(0.65, "the whole work volume")
    compensated = anywhere.judge(volume.learn(first_week), second_week)
    study = Study(
        "chen1996",
        "J. S. Chen, J. Yuan, J. Ni (1996): Thermal Error Modelling for Real-Time Error Compensation",
        (
            *drift.claims(learned),
            *slope.claims(slopes),
            *unseen.claims(observed),
            *anywhere.claims(compensated),
        ),
        (
            *show.tables(learned),
            *slope.tables(slopes),
            *unseen.tables(observed),
            *anywhere.tables(compensated),
        ),
        (
            *sorted(
                (
                    *show.figures(learned),
                    *slope.figures(slopes),
                    *unseen.figures(observed),
                ),
                key=lambda figure: int(figure.key.removeprefix("chen1996-fig")),
            ),
            *anywhere.figures(compensated),
        ),
        drift.numbers(learned) | slope.numbers(slopes) | unseen.numbers(observed) | anywhere.numbers(compensated),
    )
    progress(1.0, "done")
    return study
