"""Watches drawn from a seed, which hold on the drawn machine: `drawnmodels` knows how its temperatures move."""

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP
from thermocomp.core.heatcheck import HeatCheck
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.watch import Watch, Watched
from thermocomp.core.zero import Zeroing

if TYPE_CHECKING:
    from drawnmodels import Plant

FloatArray = NDArray[np.float64]
Rng = np.random.Generator


def draw_watch(rng: Rng, plant: "Plant", inputs: Sequence[Input], speed: Input, zeroing: Zeroing) -> Watch:
    """Return a watch over most temperatures, whose predictions are right within a few tenths of a degree.

    Parameters
    ----------
    speed : Input
        Of the spindle that heats the machine.
    """
    heat = [i for i in inputs if i.quantity == "temperature"]
    kept = heat if len(heat) < 3 or rng.random() < 0.7 else heat[1:]
    places = [heat.index(i) for i in kept]
    rise, room, n = plant.heat[places], plant.room[places], len(kept)
    taus = tuple(rng.uniform(100.0, 2000.0, int(rng.integers(0, 3))).tolist())
    others = _mix(rng, room)  # (n, n), of the sensors that predict: by row, of the predicted: by column
    shares = rng.dirichlet([8.0] + [1.0] * len(taus))
    table = np.concatenate([s * others for s in shares])
    # the heat that the others do not show is that of the speed
    missing = rise - rise @ others
    states = ((n, plant.power, plant.slow, plant.fast),) if rng.random() < 0.9 else ()
    table = np.concatenate([table, *[missing[None]] * len(states)])
    off = rng.uniform(0.6, 2.0, n) + (0.0 if states else 0.3 * np.abs(missing))
    sensors = tuple(
        Watched(
            input=k,
            weights=tuple(table[:, k].tolist()),
            off=float(off[k]),
            jump=float(rng.uniform(1.5, 4.0)),
            moved=float(rng.uniform(0.5, 2.0)),
            still=float(rng.choice([1800.0, 7200.0, GAP])),
            unseen=float(rng.choice([0.0, 0.1, 0.4])),
        )
        for k in range(n)
    )
    return Watch(
        inputs=(*kept, speed),
        zeroing=zeroing,
        time_constants=taus,
        top_speed=speed.high,
        states=states,
        sensors=sensors,
        pace=float(rng.choice([30.0, 60.0])),
        checks=draw_checks(rng.spawn(1)[0], plant.power, np.stack([rise, room]), len(taus), n) if states else (),
    )


def draw_checks(rng: Rng, power: float, effects: FloatArray, lags: int, speed: int) -> tuple[HeatCheck, ...]:
    """Return checks of a speed; the temperatures show its heat after lags, and not the room, whatever their weights.

    Parameters
    ----------
    power : float
        Of the heat of the machine.
    effects : ndarray of shape (2, n_temperatures)
        Of the heat and of the room.
    lags : int
        Lags of each temperature.
    speed : int
        Index of the input.
    """
    base = np.linalg.pinv(effects)[:, 0]
    return tuple(
        HeatCheck(
            input=speed,
            power=exponent,
            lag=float(rng.uniform(100.0, 900.0)),
            weights=tuple(np.concatenate([s * base for s in rng.dirichlet([4.0] + [1.0] * lags)]).tolist()),
            off=float(rng.uniform(0.15, 0.6)),
            unseen=float(rng.choice([0.02, 0.1])),
        )
        for exponent in rng.permutation([0.1, power])[: int(rng.integers(0, 3))].tolist()
    )


def _mix(rng: Rng, room: FloatArray) -> FloatArray:
    """Return weights by which each temperature follows from the others where the room alone moves them."""
    n = len(room)
    if n == 1:
        return np.zeros((1, 1))
    weights = rng.uniform(0.1, 1.0, (n, n)) * (1.0 - np.eye(n))
    return weights * (room / (room @ weights))


def draw_lost(rng: Rng, model: ErrorModel, watch: Watch | None) -> dict[str, float]:
    """Return errors of a model without one, two or three of its sensors: some below what it may have, some not."""
    own = [] if watch is None else [i.name for i in model.inputs if i.name in watch.failing]
    judged = (
        (1, 2, 3) if len(own) < 8 or rng.random() < 0.2 else (1,)
    )  # otherwise the errors without several are predicted
    shares = [0.6, 0.2, 0.2] if 2 in judged else [0.4, 0.5, 0.1]
    few = [c for count in judged for c in combinations(own, count)]
    return {", ".join(c): float(rng.choice([1.0, 4.0, 9.0], p=shares)) for c in few if rng.random() < 0.9}
