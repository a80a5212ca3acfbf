"""Models of whole recordings, and recordings in which sensors fail in every way."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from driftmodels import ACCEPTED
from numpy.typing import NDArray

from thermocomp.core.model import ErrorModel
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

FloatArray = NDArray[np.float64]
Damage = Callable[[FloatArray, np.random.Generator], None]


def models_of(recording: Recording, targets: list[str], method: str) -> list[ErrorModel]:
    """Fit to everything, with a watch; they may run without every single sensor."""
    samples = stack([recording], targets)
    every = np.ones(len(samples), np.bool_)
    watch = find_watch(samples, every)
    assert watch is not None
    judged = replace(ACCEPTED, lost=dict.fromkeys(watch.names, 2.0))
    return [
        replace(train(method, samples, k, every).model, watch=watch, honest_error=judged) for k in range(len(targets))
    ]


def spoiled(rows: FloatArray, seed: int) -> FloatArray:
    """Return readings in which sensors fail one after the other, each in a way of its own."""
    rng, table = np.random.default_rng(seed), rows.copy()
    for damage in rng.permutation(np.array(DAMAGES, dtype=object))[: rng.integers(0, 4)]:
        damage(table, rng)
    return table


def _sensor(rows: FloatArray, rng: np.random.Generator) -> tuple[slice, int]:
    begin = int(rng.integers(0, len(rows)))
    return slice(begin, begin + int(rng.integers(1, len(rows)))), int(rng.integers(0, rows.shape[1]))


def _missing(rows: FloatArray, rng: np.random.Generator) -> None:
    rows[_sensor(rows, rng)] = np.nan


def _stuck(rows: FloatArray, rng: np.random.Generator) -> None:
    span, k = _sensor(rows, rng)
    rows[span, k] = rows[span.start, k]


def _stepped(rows: FloatArray, rng: np.random.Generator) -> None:
    rows[_sensor(rows, rng)] += rng.normal(0.0, 5.0)


def _drifting(rows: FloatArray, rng: np.random.Generator) -> None:
    span, k = _sensor(rows, rng)
    rows[span, k] += np.linspace(0.0, rng.normal(0.0, 8.0), len(rows[span, k]))


def _swapped(rows: FloatArray, rng: np.random.Generator) -> None:
    a, b = rng.choice(rows.shape[1] - 1, 2, replace=False)
    rows[:, [a, b]] = rows[0, [a, b]] + (rows - rows[0])[:, [b, a]]


def _wild(rows: FloatArray, rng: np.random.Generator) -> None:
    hit = rng.random(rows.shape) < 0.01
    rows[hit] = rng.choice([np.nan, np.inf, -np.inf, 85.0, -127.0, 1e308, 0.0, 65535.0, -1e9], hit.sum())


DAMAGES: list[Damage] = [_missing, _stuck, _stepped, _drifting, _swapped, _wild]
