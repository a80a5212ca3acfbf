"""Data of curves with hover and zoom, thinned with their peaks kept; ``static/curves.js`` draws them on the page."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.machine import Channel
from thermocomp.core.shown import shorten
from thermocomp.judging.results import Assessment
from thermocomp.recordings.recording import Recording
from thermocomp.report.figures import COLOURS, POINTS, clock, instead, thin_points
from thermocomp.report.language import translate

#: maximum number of points in all recordings of a page, and in each curve of a run: pages stay below 2.5 MB
SHARE, RUN = 25_000, 2400
#: heights of panels that only show when something ran [px]
_LOW = {"spindle_speed": 120, "position": 150, "feed": 120}


class PageCurve(NamedTuple):
    """A curve, or the places of a finding.

    Parameters
    ----------
    tone : str
        Colour: name of a CSS variable.
    dash : int
        Number of a kind of dashes; 0: none.
    shape : {'', 'steps', 'dots'}
        Straight lines between the points, steps, or no line.
    """

    name: str
    hours: FloatArray
    values: FloatArray
    tone: str
    dash: int = 0
    shape: str = ""


def share_points(recordings: Sequence[Recording]) -> int:
    """Return how many points each channel may have on a page of these recordings."""
    return max(40, min(POINTS, SHARE // max(1, sum(len(r.channels) for r in recordings))))


def channels(
    recording: Recording,
    shown: Sequence[Channel],
    points: int,
    more: Sequence[PageCurve] = (),
    limits: tuple[float, float] | None = None,
) -> dict[str, Any]:
    """Return the panel of channels of one quantity, each of which can be hidden.

    Parameters
    ----------
    more : sequence of PageCurve
        Drawn above the channels, with all their points.
    limits : tuple of float, optional
        Values beyond are not drawn unless there are no others. Default: the range of the channels.
    """
    hours, quantity = recording.time / 3600, shown[0].quantity
    shape = "steps" if quantity == "spindle_speed" else ""
    curves = []
    for k, c in enumerate(shown):
        x, y = thin_points(hours, recording.table[c.name].to_numpy(dtype=np.float64), points)
        tone, dash = f"--c{k % len(COLOURS)}", k // len(COLOURS)
        curves.append(PageCurve(name=c.name, hours=x, values=y, tone=tone, dash=dash, shape=shape))
    cycles = [(float(hours[c.start]), float(hours[c.stop - 1]), c.name, "") for c in recording.cycles]
    title = f"{translate(quantity.replace('_', ' '))} [{translate(shown[0].unit)}]"
    return _panel(title, [*curves, *more], cycles, limits, _LOW.get(quantity, 260))


def measured(recording: Recording, points: int) -> list[dict[str, Any]]:
    """Return the panels of the measurements of one test: speed, temperatures, displacements."""
    each = ([recording.speed] if recording.speed else [], recording.temperatures, recording.displacements)
    return [channels(recording, shown, points) for shown in each if shown]


def run(shown: Assessment, recordings: Sequence[Recording], points: int = RUN) -> list[dict[str, Any]]:
    """Return the panel of a model over its judged rows: measured, predicted, residual; thermal cycles shaded."""
    hours = clock(shown, [r.time for r in recordings])
    curves = [
        (translate("measured = without compensation"), shown.measured, "--ink"),
        (translate("predicted"), shown.predicted, "--c0"),
        (translate("residual = with compensation"), shown.measured - shown.predicted, "--c1"),
    ]
    if shown.band and shown.half_widths is not None:
        alone = shown.predicted if shown.alone is None else shown.alone
        edges = ((translate("band, lower"), -1), (translate("band, upper"), 1))
        curves += [(edge, alone + sign * shown.half_widths, "--c5") for edge, sign in edges]
    names = [c.name for r in recordings for c in r.cycles]
    units = {u.name: u for u in shown.verdict.units}
    cycles = []
    begins = np.flatnonzero(np.diff(shown.cycle, prepend=-2) | np.diff(shown.test, prepend=-2))
    for first, last in zip(begins, [*begins[1:] - 1, len(hours) - 1], strict=True):
        name = names[shown.cycle[first]] if shown.cycle[first] >= 0 else ""
        u = units.get(name)
        harm = f", {translate('HARMFUL')}" if u and u.harmful else ""
        told = f"{instead(u.rms, u.none_rms)}{harm}" if u else ""
        cycles.append((float(hours[first]), float(hours[last]), name, told))
    thinned = []
    for name, values, tone in curves:
        x, y = thin_points(hours, values, points)
        thinned.append(PageCurve(name=name, hours=x, values=y, tone=tone, dash=int(tone == "--c0")))
    return [_panel(f"{shown.target.removesuffix('_um')} [{translate('um')}]", thinned, cycles)]


def _panel(
    title: str,
    curves: Sequence[PageCurve],
    cycles: Sequence[tuple[float, float, str, str]],
    limits: tuple[float, float] | None = None,
    height: int = 260,
) -> dict[str, Any]:
    """Return a panel as JSON content; times are differences in units of 1/100,000 of its duration, which is shorter."""
    known = np.concatenate([c.values[np.isfinite(c.values)] for c in curves])
    low, high = limits or ((float(known.min()), float(known.max())) if known.size else (0.0, 1.0))
    digits = int(np.clip(3 - np.floor(np.log10((high - low) or 1.0)), 0, 9))
    ends = [float(t) for c in curves if c.hours.size for t in (c.hours[0], c.hours[-1])]
    first, unit = min(ends, default=0.0), (max(ends, default=1.0) - min(ends, default=0.0)) / 100_000 or 1.0
    return {
        "title": shorten(title, 60),
        "height": height,
        "limits": [low, high],
        "digits": digits,
        "first": first,
        "unit": unit,
        "cycles": [(a, b, shorten(name, 48), told) for a, b, name, told in cycles],
        "curves": [
            {
                "name": shorten(c.name, 48),
                "tone": c.tone,
                "dash": c.dash,
                "shape": c.shape,
                "x": np.diff(np.rint((c.hours - first) / unit), prepend=0).astype(int).tolist(),
                "y": [float(v) if np.isfinite(v) else None for v in np.round(c.values, digits)],
            }
            for c in curves
        ],
    }
