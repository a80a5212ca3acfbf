"""What probings did, in words."""

from collections.abc import Iterator, Sequence

from thermocomp.assessment.results import Assessment


def describe_probings(assessments: Sequence[Assessment]) -> Iterator[str]:
    """Yield lines about models that were judged with probings.

    Parameters
    ----------
    assessments : sequence of Assessment
        The last words on models and targets.

    Yields
    ------
    str
    """
    for a in assessments:
        if (probed := a.probed) is None:
            continue
        held = " by the probings alone, each held until the next"
        ways = {"": a.metric, " without": a.unprobed_metric, held: a.held_metric}
        left = "; ".join(f"{find('rms'):.2f} and {find('mae'):.2f}{words}" for words, find in ways.items())
        yield f"{a.target}, {probed.plan.words} ({int(probed.at.sum())} in all): RMS and mean in um {left}"
        if probed.refused:
            yield f"{a.target}: {len(probed.refused)} of them refused; the first: {probed.refused[0]}"
