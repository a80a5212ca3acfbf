"""Joint output of several models for one target or axis, adapted by probings."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from thermocomp.core.correction import Deviation
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.runtime import adaptation
from thermocomp.runtime.adaptation import Adaptation, Probing
from thermocomp.runtime.advance import Advanced
from thermocomp.runtime.geometry.straight import best_line


class DeviationLine(NamedTuple):
    """Joint output of several models for one target or axis, in the form used by controllers."""

    models: slice  #: models of this line among those of the compensator
    travel: tuple[float, float]  #: travel of the axis [mm]: the limits hold from end to end
    deviation: Callable[[Sequence[float]], Deviation]  #: computes the deviation from their outputs


class Said(NamedTuple):
    """Output for one target or axis and one reading."""

    deviation: Deviation  #: including adaptation by earlier probings
    half_width: float  #: of its uncertainty band [um]; nan without a band
    learned: Adaptation | None  #: adaptation including the present probing, if any
    refused: str  #: reason why the probing was refused; otherwise empty
    moved: float  #: change of the deviation by the probing [um]
    raw: Deviation  #: output of the models alone, relative to their own zero


def constant(said: Sequence[float]) -> Deviation:
    """Return the deviation of a single model, constant along the axis."""
    return Deviation(said[0])


def straight(source: PositionModel) -> Callable[[Sequence[float]], Deviation]:
    """Return a function that converts the outputs of a model to the best straight line over the travel."""
    low, high = source.travel
    positions, zero = np.linspace(low, high, 41), source.reference_position
    lines = [best_line(positions, (1e-3 * (positions - zero)) ** k, zero) for k in source.powers]
    offsets, slopes = [line.offset for line in lines], [line.slope for line in lines]

    def deviation(said: Sequence[float]) -> Deviation:
        return Deviation(float(np.dot(offsets, said)), float(np.dot(slopes, said)), zero)

    return deviation


def evaluate(
    line: DeviationLine,
    models: Sequence[ErrorModel],
    spoken: Advanced,
    time: float,
    learned: Adaptation | None,
    probing: Probing | None,
    failed: Collection[str],
    zero: Deviation,
    magnitude: float,
) -> Said:
    """Return the output of a target or an axis for one reading.

    Parameters
    ----------
    time : float
        Time of the reading [s].
    magnitude : float
        Largest permitted correction [um]; no probing changes the deviation by more.
    """
    first, end = line.models.start, line.models.stop
    lead, single = models[first], end == first + 1
    raw = line.deviation(spoken.said[first:end])
    deviation = raw.less(zero) if zero.offset or zero.slope else raw
    width, band = math.nan, lead.band if single else None
    if band is not None:
        width = spoken.half_widths[first] * (lead.widening(failed) if failed else 1.0)
    if learned is None and probing is None:
        return Said(deviation=deviation, half_width=width, learned=None, refused="", moved=0.0, raw=raw)
    thresholds, refused, moved = lead.thresholds, "", 0.0
    directions = lead.directions(spoken.states[first], spoken.values[first]) if single else np.zeros(0)
    wanted = deviation
    if learned is not None:
        wanted = replace(deviation, offset=deviation.offset + float(learned.shift(time, directions, thresholds)))
        if band is not None:
            width *= float(learned.narrowing(time, directions, band.floor, thresholds))
    if probing is not None:
        error = probing.deviation - deviation.at(probing.position)
        own = models[line.models]
        size, typical, drift = (_mean_square(line, own, name) for name in ("rms", "typical", "none_rms"))
        most = adaptation.find_most(size, drift, magnitude, thresholds)
        before = (learned or adaptation.begin(size, len(directions), typical, thresholds=thresholds))._replace(
            most=most
        )
        learned, refused = adaptation.take(before, directions, time, error, probing.repeatability, thresholds)
        moved = float(learned.shift(time, directions, thresholds) - before.shift(time, directions, thresholds))
    return Said(deviation=wanted, half_width=width, learned=learned, refused=refused, moved=moved, raw=raw)


def _mean_square(line: DeviationLine, models: Sequence[ErrorModel], name: str) -> float:
    """Return the RMS value `name` of the line over cycles unseen by its models [um]."""
    errors = np.diag([0.0 if m.honest_error is None else getattr(m.honest_error, name) for m in models])
    return math.hypot(*(line.deviation(one).offset for one in errors.tolist()))
