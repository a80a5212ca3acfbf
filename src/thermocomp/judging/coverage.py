"""Conditions covered by the judged blocks (cycles or files), and the similarity of these blocks.

Similarity: each block's inputs (as recorded, so that the ambient temperature counts) are averaged over `PLACES` parts
of its duration. The squared distance of two blocks is the mean square difference over these parts, summed over the
inputs of a quantity and divided by their summed variance over all judged rows, averaged over the quantities; plus the
squared logarithm of the ratio of their durations. So sensors are weighted by their variation: the noise of an idle
sensor does not make two blocks different. Two blocks with a distance below `ALIKE` are alike: a copy of a block, or the
same program on a similar day, adds no information. Alike blocks count once (single linkage).
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from scipy.sparse.csgraph import connected_components

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message
from thermocomp.core.validity import Validity
from thermocomp.judging.choice import Cell, Table
from thermocomp.judging.splits import Judging
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples

#: distance below which two blocks are alike [standard deviations of the inputs]
ALIKE = 0.1
#: number of parts of a block that are compared
PLACES = 32
#: speeds that differ by less than this fraction of the largest are merged
_SAME_SPEED = 0.02


def find_validity(samples: Samples, judging: Judging, recordings: Sequence[Recording] = ()) -> Validity:
    """Return the conditions covered by the blocks (cycles or files) of a judging scheme."""
    blocks = [rows for split in judging.splits if (rows := split.judge & samples.valid).any()]
    judged = np.any(blocks, axis=0) if blocks else np.zeros(len(samples), dtype=np.bool_)
    distances = unit_distances(samples, blocks)
    temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    starts = [float(samples.values[np.flatnonzero(rows)[0], temperatures].mean()) for rows in blocks if temperatures]
    days = samples.days()[judged]
    name, ambient = _ambient(samples, judged, recordings)
    return Validity(
        units=len(blocks),
        independent=int(connected_components(distances < ALIKE)[0]) if blocks else 0,
        nearest=float(distances[np.triu_indices(len(blocks), 1)].min()) if len(blocks) > 1 else None,
        speeds=_speeds(samples, judged, recordings),
        ambient=ambient,
        ambient_channel=name,
        start=(min(starts), max(starts)) if starts else None,
        days=int(np.unique(days[~np.isnat(days)]).size),
        hours=float(np.where(np.isfinite(samples.dt()), samples.dt(), 0.0)[judged].sum() / 3600.0),
        axes=_axes(samples, judged, recordings),
    )


def unit_distances(samples: Samples, blocks: Sequence[BoolArray]) -> FloatArray:
    """Return the distances between all blocks, (n_units, n_units); see the module docstring.

    Parameters
    ----------
    blocks : sequence of ndarray of bool of shape (n_rows,)
        Rows of each block; every input must be finite in them.

    Returns
    -------
    ndarray of shape (n_units, n_units)
    """
    if not blocks:
        return np.empty((0, 0))
    judged = np.any(blocks, axis=0)
    steps = np.where(np.isfinite(samples.dt()), samples.dt(), 0.0)
    durations = np.log([max(float(steps[rows].sum()), 1e-9) for rows in blocks])
    square = (durations[:, None] - durations[None]) ** 2
    moving = []
    for quantity in dict.fromkeys(c.quantity for c in samples.inputs):
        own = [j for j, c in enumerate(samples.inputs) if c.quantity == quantity]
        variance = float(samples.values[judged][:, own].var(axis=0).sum())
        if variance > (1e-9 * np.abs(samples.values[judged][:, own]).max()) ** 2:
            curves = np.array([_curve(samples.values[rows][:, own], steps[rows]) for rows in blocks])
            apart = ((curves[:, None] - curves[None]) ** 2).mean(axis=2).sum(axis=-1)
            moving.append(apart / variance)
    return np.asarray(np.sqrt(square + np.mean(moving, axis=0)) if moving else np.sqrt(square))


def _curve(values: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the means of a block's inputs in `PLACES` parts of its duration, (n_places, n_inputs)."""
    time = np.cumsum(steps)
    part = np.minimum((PLACES * time / max(time[-1], 1e-9)).astype(np.intp), PLACES - 1)
    known, at = np.unique(part, return_inverse=True)
    count = np.bincount(at)
    means = np.stack([np.bincount(at, v) / count for v in values.T], axis=1)
    return np.stack([np.interp(np.arange(PLACES), known, v) for v in means.T], axis=1)


def _speeds(samples: Samples, judged: BoolArray, recordings: Sequence[Recording]) -> tuple[float, ...]:
    columns = [j for j, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    measured = [samples.values[judged][:, columns].ravel()]
    for k, recording in enumerate(recordings):  # a model may not use the speed at which it was judged
        if recording.speed is not None:
            measured.append(recording.values([recording.speed])[samples.row[judged & (samples.test == k)], 0])
    known = np.concatenate(measured)
    values = np.unique(np.round(known[np.isfinite(known)], 1))
    found: list[float] = []
    for v in values.tolist():
        if not found or v - found[-1] > _SAME_SPEED * float(np.abs(values).max()):
            found.append(v)
    return tuple(found)


def _axes(
    samples: Samples, judged: BoolArray, recordings: Sequence[Recording]
) -> Literal["moved", "stood still", "not recorded"]:
    given = [(c.quantity, samples.values[judged, j]) for j, c in enumerate(samples.inputs)]
    for k, recording in enumerate(recordings):
        rows = samples.row[judged & (samples.test == k)]
        given += [(c.quantity, recording.values([c])[rows, 0]) for c in recording.channels]
    moved = list[bool]()
    for quantity, values in given:
        if quantity in ("feed", "position") and (known := values[np.isfinite(values)]).size:
            moved.append(bool(np.ptp(known) > 0 or (quantity == "feed" and known.any())))
    return "moved" if any(moved) else "stood still" if moved else "not recorded"


def _ambient(
    samples: Samples, judged: BoolArray, recordings: Sequence[Recording]
) -> tuple[str, tuple[float, float] | None]:
    named, values = "", []
    for k, recording in enumerate(recordings):
        air = recording.ambient
        if air is not None:
            rows = samples.row[judged & (samples.test == k)]
            values.append(recording.table[air.name].to_numpy(dtype=np.float64)[rows])
            named = named or air.name
    known = np.concatenate(values) if values else np.empty(0)
    known = known[np.isfinite(known)]
    return (named, (float(known.min()), float(known.max()))) if known.size else ("", None)


def table(named: Mapping[str, Validity]) -> Table:
    """Return the covered conditions as a short table: one column per judging scheme."""
    columns = [_cells(v) for v in named.values()]
    rows: list[tuple[Cell, ...]] = [(heading, *(c[heading] for c in columns)) for heading in columns[0]]
    caption = Message(
        "Cycles or files count as distinct if their inputs differ by at least {alike:g} of the spread of the inputs; "
        "copies count once.",
        alike=ALIKE,
    )
    return Table(
        title="Conditions covered by the judged cycles or files",
        columns=("", *named),
        rows=tuple(rows),
        caption=caption,
    )


def _cells(v: Validity) -> dict[str, str]:
    days = Message(", {n} day" if v.days == 1 else ", {n} days", n=v.days) if v.days else ""
    distinct = Message("{n}, {distinct} of them distinct", n=v.units, distinct=v.independent)
    near = Message("differ by {by:.2f} of the inputs' spread", by=v.nearest) if v.nearest is not None else ""
    ambient = Message("not specified")
    if v.ambient:
        ambient = Message("{values} ({sensor})", values=_range(v.ambient), sensor=v.ambient_channel)
    return {
        Message("cycles or files judged"): distinct if v.units > 1 else f"{v.units}",
        Message("two most similar"): near,
        Message("hours, days"): Message("{hours:.1f} h{days}", hours=v.hours, days=days),
        Message("spindle speeds [1/min]"): _listed(v.speeds) or Message("not recorded"),
        Message("axes"): Message(v.axes),
        Message("surroundings [degC]"): ambient,
        Message("mean temperature at the start [degC]"): _range(v.start) if v.start else "",
    }


def _range(values: tuple[float, float]) -> Message:
    return Message("{low:.1f} to {high:.1f}", low=values[0], high=values[1])


def _listed(speeds: Sequence[float]) -> str:
    if len(speeds) > 12:
        low, high = speeds[0], speeds[-1]
        return Message("{n} speeds from {low:.0f} to {high:.0f}", n=len(speeds), low=low, high=high)
    return ", ".join(f"{v:.0f}" for v in speeds)
