"""Compensator judged with the models: its gate and limits, as text."""

from collections.abc import Sequence

from thermocomp.core.messages import Message
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
        shown = [f"{a.model} for {a.target} {alone:.2f} instead of {ran:.2f} um" for a, ran, alone in other[:MOST]]
        more = f", and smaller differences for {len(other) - MOST} more" if len(other) > MOST else ""
        lines.append(
            Message(
                "The judged corrections are those that the machine would apply, with the gate (check of each reading) "
                "and the limits ({limits}). RMS of the models alone: {alone}.",
                limits=limited[0].limits.in_words(),
                alone=f"{', '.join(shown)}{more}" if shown else Message("the same to 0.01 um"),
            )
        )
    if without := list(dict.fromkeys(a.target for a in judged if a.limits is None)):
        lines.append(f"No limits for {', '.join(without)}: limits apply only to corrections in um.")
    lines += [
        f"The gate rejected {a.rejected} of {len(a.measured)} readings for {a.model}, {a.target}; the first: "
        f"{a.turned_away}."
        for a in judged
        if a.rejected
    ]
    return lines
