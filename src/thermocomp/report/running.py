"""Compensator judged with the models: its gate and limits, as text."""

from collections.abc import Sequence

from thermocomp.core.messages import Message, join
from thermocomp.judging.results import Assessment

#: maximum number of models reported without gate and limits; the JSON output has all
MOST = 4


def describe_running(assessments: Sequence[Assessment]) -> list[str]:
    """Return the effect of the compensator's gate and limits on the results."""
    judged = [a for a in assessments if a.alone is not None and not a.failure]
    limited = [a for a in judged if a.limits is not None]
    lines = list[str]()
    if limited and limited[0].limits is not None:
        off = [(a, a.metric("rms"), a.alone_metric("rms")) for a in limited]
        other = sorted((x for x in off if f"{x[1]:.2f}" != f"{x[2]:.2f}"), key=lambda x: -abs(x[2] - x[1]))
        shown = [
            Message(
                "{model} for {target} {alone:.2f} instead of {ran:.2f} um",
                model=a.model,
                target=a.target,
                alone=alone,
                ran=ran,
            )
            for a, ran, alone in other[:MOST]
        ]
        if len(other) > MOST:
            shown.append(Message("and smaller differences for {n} more", n=len(other) - MOST))
        lines.append(
            Message(
                "The judged corrections are those that the machine would apply, with the gate (check of each reading) "
                "and the limits ({limits}). RMS of the models alone: {alone}.",
                limits=limited[0].limits.in_words(),
                alone=join(shown or [Message("the same to 0.01 um")], ", "),
            )
        )
    if without := list(dict.fromkeys(a.target for a in judged if a.limits is None)):
        lines.append(
            Message("No limits for {targets}: limits apply only to corrections in um.", targets=", ".join(without))
        )
    lines += [
        Message(
            "The gate rejected {n} of {of} readings for {model}, {target}; the first: {first}.",
            n=a.rejected,
            of=len(a.measured),
            model=a.model,
            target=a.target,
            first=a.turned_away,
        )
        for a in judged
        if a.rejected
    ]
    return lines
