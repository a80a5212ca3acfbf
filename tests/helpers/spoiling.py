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


def _stuck_late(rows: FloatArray) -> None:
    rows[200:, 0] = rows[200, 0]


def _first_two_swapped(rows: FloatArray) -> None:
    rows[:, [0, 1]] = rows[0, [0, 1]] + (rows - rows[0])[:, [1, 0]]


def _drifts_slowly(rows: FloatArray) -> None:
    rows[200:, 1] += np.linspace(0.0, 8.0, len(rows) - 200)


def _spikes(rows: FloatArray) -> None:
    rows[100::37, 0] += 7.0


def _back(rows: FloatArray) -> None:
    rows[150:260, 1] = np.nan


def _dead_at_the_start(rows: FloatArray) -> None:
    rows[:, 0] = 0.0


def _no_speed(rows: FloatArray) -> None:
    rows[40:90, 3] = np.nan


def _fast(rows: FloatArray) -> None:
    rows[300:302, 3] = 65535.0


#: of the day of `watchedmachine.failing`: three temperatures and the speed
FAILURES: dict[str, Callable[[FloatArray], None]] = {
    "stuck": _stuck_late,
    "swapped": _first_two_swapped,
    "drifting": _drifts_slowly,
    "spikes": _spikes,
    "back": _back,
    "dead_at_the_start": _dead_at_the_start,
    "no_speed": _no_speed,
    "fast": _fast,
}
