"""Leaks: rows used for both training and judging, and inputs that are computed from the target."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.learned import probe_noise
from thermocomp.core.model import ErrorModel
from thermocomp.judging.results import Assessment
from thermocomp.judging.splits import Judging
from thermocomp.recordings.overlaps import overlap, repeats
from thermocomp.recordings.samples import Samples

#: a test with a smaller fraction of new rows is not judged
LEAST_NEW = 0.05
#: an input is computed from the target if a straight line through it leaves less than this share of the drift
LEAK = 0.02
#: with a larger share of noise in the means, nothing is said
NOISY = 0.1
#: number of parts of a test whose means are compared, and minimum number in all
PARTS, LEAST_PARTS = 100, 20


def find_learned_rows(model: ErrorModel, samples: Samples) -> BoolArray:
    """Return the rows that were used for training a model.

    Returns
    -------
    ndarray of bool of shape (n_rows,)
        All rows of a test whose hash is in the model's provenance, rows that match its fingerprints, and the remaining
        rows of a test if they are few.
    """
    known = np.zeros(len(samples), dtype=np.bool_)
    if model.provenance is None:
        return known
    known |= np.isin(samples.hashes, model.provenance.data_sha256)[samples.test]
    if model.provenance.prints is not None:
        known |= overlap(model.provenance.prints, samples, 0) >= 0
    judged = np.isfinite(samples.deviations[:, 0])
    for test in np.unique(samples.test[known]):
        mine = samples.test == test
        if np.count_nonzero(mine & judged & ~known) < LEAST_NEW * np.count_nonzero(mine & judged):
            known |= mine
    return known


def refuse_leaks(samples: Samples, judging: Judging) -> None:
    """Reject data in which a row occurs twice, if one copy is used for training and the other for judging."""
    for target in range(len(samples.targets)):
        source = repeats(samples, target)
        copies = np.flatnonzero(source >= 0)
        for split in judging.splits:
            learn, judge = split.learn[copies], split.judge[copies]
            origin = source[copies]
            leaked = (judge & split.learn[origin]) | (learn & split.judge[origin])
            if leaked.any():
                raise InputError(_told(samples, copies, origin, int(np.argmax(leaked)), split.block))


def _told(samples: Samples, copies: IntArray, origin: IntArray, k: int, block: str) -> str:
    # one stretch: consecutive rows that repeat consecutive rows
    breaks = np.flatnonzero((np.diff(copies) > 1) | (np.abs(np.diff(origin)) > 100)) + 1
    a = int(breaks[breaks <= k].max(initial=0))
    b = int(breaks[breaks > k].min(initial=len(copies))) - 1
    later, earlier = (samples.test_names[samples.test[rows[k]]] for rows in (copies, origin))
    return (
        f"{later}: rows {samples.row[copies[a]]}-{samples.row[copies[b]]} repeat rows "
        f"{samples.row[origin[a]]}-{samples.row[origin[b]]} of "
        f"{'the same recording' if later == earlier else earlier} (approximate rows): with {block} left out, the "
        "same data would be used for both training and validation. Delete one of the two copies"
    )


def find_leaks(samples: Samples, target: int, names: Collection[str]) -> dict[str, float]:
    """Return the inputs that follow a target without lag, better than a temperature of a machine can.

    The heat of a machine reaches its sensors and its tool point by different ways: on measured and virtual machines a
    straight line through the best single temperature leaves a sixth to a half of the drift (of that of a slender tool a
    thirtieth). One that leaves less than `LEAK` is computed from the displacement, or shares its wire. Means over short
    parts of each test are compared, and their noise is taken into account, so that neither noise nor rounding hides it.

    Parameters
    ----------
    names : collection of str
        Inputs to be examined.

    Returns
    -------
    dict of str to float
        Share of the drift (RMS) that a straight line through the input leaves.
    """
    deviation = samples.deviations[:, target]
    own = (samples.cycle >= 0) & np.isfinite(deviation)
    found = {}
    for j, channel in enumerate(samples.inputs):
        if channel.name not in names or channel.quantity == "spindle_speed":
            continue
        parts, noises = [], []
        for test in np.unique(samples.test[own]):
            rows = np.flatnonzero(own & (samples.test == test) & np.isfinite(samples.values[:, j]))
            if rows.size:
                both = np.stack([samples.values[rows, j], deviation[rows]])
                cuts = np.array_split(both, min(PARTS, rows.size), axis=1)
                means = np.stack([c.mean(axis=1) for c in cuts], axis=1)
                parts.append(means - means.mean(axis=1, keepdims=True))
                noise = np.array([probe_noise(v) for v in both])
                noises += [noise / np.sqrt(c.shape[1]) for c in cuts]
        if len(noises) >= LEAST_PARTS:
            share = _share_left(np.concatenate(parts, axis=1), np.array(noises))
            if share < LEAK:
                found[channel.name] = share
    return found


def cap_leaks(found: Assessment, leaks: Mapping[str, float]) -> Assessment:
    """Return an assessment that is not accepted if its model uses inputs computed from the target."""
    caps = [
        f"{name} follows {found.target} without lag, better than a temperature can (a straight line leaves "
        f"{share:.1%}): it seems to be computed from the displacement; leave it out"
        for name, share in leaks.items()
        if name in found.sensors
    ]
    return replace(found, verdict=replace(found.verdict, caps=(*found.verdict.caps, *caps))) if caps else found


def _share_left(means: FloatArray, noises: FloatArray) -> float:
    """Return the share of a drift that a straight line through an input leaves; 1 if it is hidden by noise.

    Parameters
    ----------
    means : ndarray of shape (2, n_parts)
        Means of input and drift over parts of the tests, minus those of each test.
    noises : ndarray of shape (n_parts, 2)
        Standard deviations of their noise.
    """
    x, y = means
    if not (x.any() and y.any()):
        return 1.0
    slope = (x @ y) / (x @ x)
    left, noise = y - slope * x, noises @ np.diag([slope, 1.0])
    size, known = float(y @ y), float((noise**2).sum())
    return float(np.sqrt(max(left @ left - known, 0.0) / size)) if known < NOISY**2 * size else 1.0
