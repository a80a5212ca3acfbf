"""Uncertainty bands of models as text, and their coverage on the judged data."""

import math
from collections.abc import Sequence

import numpy as np

from thermocomp.core.messages import Message, join
from thermocomp.core.model import ErrorModel
from thermocomp.judging.results import Assessment


def describe_bands(models: Sequence[ErrorModel], assessments: Sequence[Assessment]) -> list[str]:
    """Return a line for each model that has a band."""
    lines = list[str]()
    for model, a in zip(models, assessments, strict=True):
        if model.band is not None:
            held = [] if math.isnan(a.coverage) else [describe_coverage(a)]
            told = join([model.band.tell(model.unit), *held], ". ")
            lines.append(Message("{target}: {what}", target=model.target, what=told))
    return lines


def describe_coverage(a: Assessment) -> str:
    """Return the fraction of the judged rows inside the band, and the width of the band there."""
    share = 0.0 if a.half_widths is None else float(np.isfinite(a.half_widths).mean())
    some = Message(" with a band ({share:.0f} % of all; there is none while the correction is held)", share=100 * share)
    return Message(
        "The band contains {inside:.0f} % of the judged rows{some}{seen}, with a mean half-width of {width:.2f} um "
        "({band})",
        inside=100 * a.coverage,
        some=some if share < 0.995 else "",
        seen=Message(", which were used for training") if a.caveat else "",
        width=a.half_width,
        band=a.band,
    )
