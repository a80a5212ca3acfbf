"""Header data, workpiece and measurement uncertainty of tests, as text, as a table and as JSON."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from thermocomp.core.messages import Message, join
from thermocomp.judging.results import Assessment
from thermocomp.judging.settling.averaging import K
from thermocomp.judging.uncertainty import FIGURES, FigureUncertainty
from thermocomp.recordings.recording import Recording
from thermocomp.report.layout import Column, Layout, PrintedLine

#: names of the figures in JSON, by their place in a contribution
_NAMES = ("none_rms_um", "none_max_um", "rms_um", "max_um")


def header_lines(recordings: Sequence[Recording]) -> list[str]:
    """Return the header data of recordings as lines of text, one for all that have the same."""
    told: dict[str, list[str]] = {}
    for r in recordings:
        told.setdefault(str(r.declared.test), []).append(r.name)
    alone = len(told) == 1
    return [
        Message("Test: {text}", text=text) if alone else f"{', '.join(names)}: {text}"
        for text, names in told.items()
        if text
    ]


def recording(r: Recording) -> dict[str, Any]:
    """Return header data and workpiece as plain numbers and text; nothing of what is not declared."""
    test, w = r.declared.test.stated(), r.declared.workpiece
    found: dict[str, Any] = {"test": test} if test else {}
    if w is None:
        return found
    told: str = Message(
        "Workpiece ({material}{length:g} mm, {coefficient:g} um/(m K), {sensor})",
        material=f"{w.material}, " if w.material else "",
        length=float(w.length_mm),
        coefficient=float(w.coefficient_um_per_m_K),
        sensor=w.temperature,
    )
    known = {c.name for c in r.temperatures}
    name = r.channel(w.temperature).name if r.has(w.temperature) else ""
    values = r.table[name].to_numpy(dtype=np.float64) if name in known else np.empty(0)
    if not np.isfinite(values).any():
        none = Message(": the recording has no such temperature; correct [workpiece] temperature in the mapping.")
        told = join([told, none])
        return {**found, "workpiece": {"text": told, "smallest_um": None, "largest_um": None}}
    low, high = (w.expansion(float(f(values))) for f in (np.nanmin, np.nanmax))
    told = Message(
        "{workpiece}: longer than at {reference:g} degC by {low:.2f} to {high:.2f} um, which the errors of the machine "
        "do not contain.",
        workpiece=told,
        reference=float(w.reference_degC),
        low=low,
        high=high,
    )
    return {**found, "workpiece": {"text": told, "smallest_um": low, "largest_um": high}}


def plus_minus(found: FigureUncertainty | None, figure: str, none: bool = False) -> str:
    """Return the expanded uncertainty of a figure as text behind the figure; empty if there is none."""
    value = None if found is None else found.expanded(figure, none=none)
    return "" if value is None else f" ± {value:.2f}"


def measured(a: Assessment, metric: str, *, none: bool = False) -> str:
    """Return a figure of a model, or without it, as text with its expanded uncertainty."""
    value = a.none_metric(metric) if none else a.metric(metric)
    return f"{value:.2f}{plus_minus(a.uncertainty, metric, none)}" if math.isfinite(value) else ""


def describe(found: FigureUncertainty) -> str:
    """Return what an uncertainty contains, and what it does not, as text."""
    own = Message(", with a repeatability of {value:.2g} um from the scatter of the rows", value=found.repeatability)
    absent = [Message(name) for name in found.absent]
    return Message(
        "±: expanded measurement uncertainty (k = 2, ISO/TR 230-9){own}.{left}",
        own=own if found.repeatability > 0 else "",
        left=Message(" Not stated, so not contained: {names}.", names=join(absent, ", ")) if absent else "",
    )


def budget(a: Assessment) -> Layout | None:
    """Return the contributions to the uncertainty of the figures of a model; None if none are stated."""
    if a.uncertainty is None:
        return None
    whole = (
        Message("expanded (k = 2)"),
        *(a.uncertainty.expanded(f, none=none) for none in (True, False) for f in FIGURES),
    )
    rows = [*((Message(name), *u.ravel().tolist()) for name, u in a.uncertainty.contributions.items()), whole]
    own = Message("{model}: RMS", model=a.model), Message("{model}: largest", model=a.model)
    headings = (Message("none: RMS"), Message("none: largest"), *own)
    columns = (Column(h, k, "um", unit="um", named=True) for k, h in enumerate(headings, start=1))
    title = Message("{target}: standard uncertainties of the figures, by contribution", target=a.target)
    return Layout((Column("contribution", 0), *columns), rows, title, caption=describe(a.uncertainty))


def answer(rows: Sequence[Assessment]) -> list[PrintedLine]:
    """Return a line with the expanded uncertainties of models: the smallest and the largest of all targets."""
    told = []
    for word, figure in (("RMS", "rms"), ("largest", "max_abs")):
        values = [a.uncertainty.expanded(figure) or 0.0 for a in rows if a.uncertainty is not None]
        if not values:
            return []
        told.append(f"{word} ± {' to '.join(dict.fromkeys(f'{v:.2f}' for v in (min(values), max(values))))}")
    return [PrintedLine(f"Measurement uncertainty (k = 2) [um]: {', '.join(told)}.")]


def content(a: Assessment) -> dict[str, Any]:
    """Return the measurement uncertainty of the figures of a model as plain numbers."""
    found = a.uncertainty
    if found is None:
        return {}
    values = [found.expanded(figure, none=none) for none in (True, False) for figure in FIGURES]
    parts = {name: dict(zip(_NAMES, u.ravel().tolist(), strict=True)) for name, u in found.contributions.items()}
    whole = dict(zip(_NAMES, values, strict=True))
    return {
        "uncertainty": {"k": K, "expanded": whole, "standard": parts, "repeatability_um": found.repeatability}
        | {"not_stated": list(found.absent)}
    }
