"""Uncertainty bands of models as text, and their coverage on the judged data."""

import math
from collections.abc import Sequence

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.judging.results import Assessment


def describe_bands(models: Sequence[ErrorModel], assessments: Sequence[Assessment]) -> list[str]:
    """Return a line for each model that has a band."""
    lines = []
    for model, a in zip(models, assessments, strict=True):
        if model.band is not None:
            held = "" if math.isnan(a.coverage) else f". {describe_coverage(a)}"
            lines.append(f"{model.target}: {model.band.tell(model.unit)}{held}")
    return lines


def describe_coverage(a: Assessment) -> str:
    """Return the fraction of the judged rows inside the band, and the width of the band there."""
    share = 0.0 if a.half_widths is None else float(np.isfinite(a.half_widths).mean())
    none = "there is none while the correction is held"
    some = f" with a band ({100 * share:.0f} % of all; {none})" if share < 0.995 else ""
    seen = ", which were used for training" if a.caveat else ""
    return (
        f"The band contains {100 * a.coverage:.0f} % of the judged rows{some}{seen}, with a mean half-width of "
        f"{a.half_width:.2f} um ({a.band})"
    )
