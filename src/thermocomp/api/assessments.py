"""Assessments as tables, figures and sentences, for the results of `compare`, `fit` and `assess`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message
from thermocomp.judging.results import Assessment
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def starts_content(begins: Sequence[tuple[str, Start]]) -> list[dict[str, object]]:
    """Return the initial thermal states of recordings for the JSON output."""
    return [start.content(name) for name, start in begins]


def frame_of(assessments: Sequence[Assessment]) -> pd.DataFrame:
    """Return assessments as a table.

    Parameters
    ----------
    assessments : sequence of Assessment

    Returns
    -------
    DataFrame
        A row per assessment; errors, half-widths of bands and measured values in um; nan where a model has no band.
    """
    return pd.DataFrame(
        {
            "target": [a.target for a in assessments],
            "model": [str(a.model) for a in assessments],
            "block": [a.block for a in assessments],
            "rms": [a.metric("rms") for a in assessments],
            "mae": [a.metric("mae") for a in assessments],
            "max_abs": [a.metric("max_abs") for a in assessments],
            "none_rms": [a.none_metric("rms") for a in assessments],
            "reduction_pct": [a.metric("reduction") for a in assessments],
            "coverage": [a.coverage for a in assessments],
            "half_width": [a.half_width for a in assessments],
            "sensors": [a.n_sensors[1] for a in assessments],
            "verdict": [a.word for a in assessments],
            "deployable": [a.deployable for a in assessments],
            "reason": [a.reason for a in assessments],
        }
    )


def residuals_of(assessments: Sequence[Assessment], recordings: Sequence[Recording]) -> pd.DataFrame:
    """Return measured and predicted deviations of all judged rows, and the residuals."""
    parts = [
        pd.DataFrame(
            {
                "target": a.target,
                "model": str(a.model),
                "recording": [recordings[k].name for k in a.test.tolist()],
                "time_s": [recordings[k].time[row] for k, row in zip(a.test.tolist(), a.row.tolist(), strict=True)],
                "measured": a.measured,
                "predicted": a.predicted,
                "residual": a.measured - a.predicted,
            }
        )
        for a in assessments
        if a.overall and not a.failure
    ]
    return pd.concat(parts, ignore_index=True)


def describe(a: Assessment) -> str:
    """Return an assessment in a sentence."""
    if a.failure:
        return Message("{target}: {what}.", target=a.target, what=a.reason)
    return Message(
        "{target}: {model} {word}, {rms:.2f} um RMS instead of {none:.2f} um ({reason}).",
        target=a.target,
        model=a.model,
        word=Message(a.word),
        rms=a.metric("rms"),
        none=a.none_metric("rms"),
        reason=a.reason,
    )


def draw_run(
    assessments: Sequence[Assessment], recordings: Sequence[Recording], target: str | None, model: str | None
) -> "Figure":
    """Return the figure of a model over time on its unseen blocks; `model` may be None if there is one per target."""
    from thermocomp.report import figures

    overall = [a for a in assessments if a.overall and (target, model) in ((a.target, None), (a.target, str(a.model)))]
    if not overall:
        known = ", ".join(dict.fromkeys(f"{a.model} for {a.target}" for a in assessments if a.overall))
        raise InputError(f"there is no {model or 'model'} for {target}; there are {known}")
    blocks = [a for a in assessments if (a.target, a.model) == (overall[0].target, overall[0].model) and not a.overall]
    times = [r.time for r in recordings]
    return figures.prediction(overall[0], blocks or overall, times).figure
