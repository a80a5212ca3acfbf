"""Compensators drawn from a seed: models of every family on a machine of temperatures, speeds and other values."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from drawnfamilies import FAMILIES, TOP, draw_lags, draw_model, resize, size_of
from drawnwatch import draw_lost, draw_watch
from driftmodels import ACCEPTED
from numpy.typing import NDArray

from thermocomp.core.band import Band
from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.zero import FIRST_READING, Zeroing
from thermocomp.runtime.compensator import Compensator

FloatArray = NDArray[np.float64]
Rng = np.random.Generator

SPEED, TACHOMETER = "n_rpm", "tacho_rpm"
HEATER = Input(SPEED, "spindle_speed", "1/min", 0.0, rezero=False, low=0.0, high=TOP)
#: other inputs of models: quantity, unit, trained range
OTHERS = {
    "c_rpm": ("spindle_speed", "1/min", 0.0, 3000.0),
    "d_um": ("displacement", "um", -20.0, 30.0),
    "p_mm": ("position", "mm", -300.0, 300.0),
    "load": ("dimensionless", "1", 0.0, 1.0),
}


#: usual numbers of temperatures, and so many that errors with two of them lost are predicted
FEW, MANY = range(1, 6), range(8, 13)


class Plant(NamedTuple):
    """The machine: temperatures follow the heat of its spindle and the room."""

    zero: FloatArray  #: (n_temperatures,), at the start [degC]
    heat: FloatArray  #: (n_temperatures,), rise at the highest speed [degC]
    room: FloatArray  #: (n_temperatures,), share of the change of the room [-]
    power: float  #: exponent of the fraction of the highest speed
    slow: float  #: time constant of the heat at rest [s]
    fast: float  #: at the highest speed [s]


class Drawn(NamedTuple):
    """A compensator, and the machine on which it runs."""

    compensator: Compensator
    plant: Plant


def draw_compensator(seed: int) -> Drawn:
    """Return a compensator; seeds in a row take turns at families, policies, watches and positions."""
    rng, zeroing = np.random.default_rng((1, seed)), ZEROINGS[seed % len(ZEROINGS)]
    plant = draw_plant(rng, MANY if seed % 10 == 6 else FEW)
    inputs = draw_inputs(rng, plant)
    thresholds = draw_thresholds(seed) if seed % 3 == 2 else THRESHOLDS
    watch = draw_watch(rng, plant, inputs, HEATER, zeroing) if seed % 4 else None
    watch = watch and replace(watch, thresholds=thresholds)
    models: list[ErrorModel] = []
    for k in range(int(rng.integers(1, 6))):
        if models and rng.random() < 0.3:  # steps together with the one before
            model = resize(models[-1], float(rng.uniform(0.3, 1.7)))
        else:
            family = FAMILIES[(seed + k) % len(FAMILIES)]
            model = draw_model(rng, family, _pick(rng, inputs), SUPPORTS[(seed // 2 + k) % len(SUPPORTS)])
        lost = draw_lost(rng, model, watch)
        refused = k > 0 and (seed + k) % 6 == 5
        honest = replace(ACCEPTED, lost=lost, verdict="refused" if refused else "accepted")
        known = watch if k == 0 or rng.random() < 0.8 else None
        own = replace(model, target=f"e{k}_um", zeroing=zeroing, watch=known, thresholds=thresholds)
        models.append(replace(own, honest_error=honest))
    limits = draw_limits(rng)
    return Drawn(Compensator.of(draw_sources(rng, models), limits, watching=True), plant)


def draw_thresholds(seed: int) -> Thresholds:
    """Return thresholds of half to twice the usual values."""
    rng = np.random.default_rng((5, seed))
    usual = {row.name: row.value for row in THRESHOLDS.rows}
    drawn = {name: float(round(value * 2.0 ** rng.uniform(-1.0, 1.0), 4)) for name, value in usual.items()}
    drawn["speed_return"] /= 20.0  # the tests are shorter than a night
    drawn["implausible"] = 2.0 * max(drawn["suspect"], drawn["suspect_first"])
    return Thresholds(**drawn)


#: how a zero is averaged: the first reading, or more, with and without a channel that shows whether the spindle stands
ZEROINGS = (
    Zeroing(300.0, 10.0, SPEED),
    FIRST_READING,
    Zeroing(120.0, 40.0, TACHOMETER),
    Zeroing(0.0, 60.0, SPEED),
    Zeroing(100.0, 100.0),
)
SUPPORTS = tuple(
    Support(policy, margin, over)  # type: ignore[arg-type]
    for policy, margin, over in (
        ("clip", 0.25, 0.5),
        ("hold", 0.1, 0.5),
        ("fade", 0.25, 2.0),
        ("clip", 1.0, 0.5),
        ("fade", 0.0, 0.3),
        ("hold", 0.5, 0.5),
        ("clip", 0.0, 0.5),
    )
)


def draw_plant(rng: Rng, temperatures: range = FEW) -> Plant:
    """Return a machine with a number of temperatures out of a range."""
    n = int(rng.integers(temperatures.start, temperatures.stop))
    slow = float(rng.uniform(1800.0, 6000.0))
    return Plant(
        zero=20.0 + rng.uniform(-8.0, 8.0) + rng.uniform(-2.0, 2.0, n),
        heat=rng.uniform(2.0, 14.0, n) * np.where(rng.random(n) < 0.2, 0.2, 1.0),
        room=rng.uniform(0.4, 1.2, n),
        power=float(rng.uniform(0.7, 2.0)),
        slow=slow,
        fast=float(rng.uniform(0.3, 1.0)) * slow,
    )


def draw_inputs(rng: Rng, plant: Plant) -> tuple[Input, ...]:
    """Return what the models of a machine may read: temperatures, usually a speed, and more."""
    mode = rng.choice(["all", "none", "some"], p=[0.5, 0.2, 0.3])
    found = []
    for k, heat in enumerate(plant.heat.tolist()):
        rezero = mode == "all" or (mode == "some" and bool(rng.random() < 0.5))
        room = float(rng.uniform(0.5, 4.0)) + (0.0 if rezero else 9.0)
        low, high = -room, float(rng.choice([0.5, 1.0, 1.2])) * heat + room
        found.append(Input(f"t{k}_C", "temperature", "degC", 20.0, rezero, low, high))
    if rng.random() < 0.8:
        found.append(Input(SPEED, "spindle_speed", "1/min", 0.0, bool(rng.random() < 0.05), 0.0, TOP))
    for name, (quantity, unit, low, high) in OTHERS.items():
        if rng.random() < 0.2:
            rezero = bool(rng.random() < 0.3)
            at = float(rng.uniform(low, high)) if rng.random() < 0.5 else 0.0
            width = 0.0 if rng.random() < 0.1 else 1.0  # one that did not move
            found.append(Input(name, quantity, unit, at, rezero, width * (low - at), width * (high - at)))
    return tuple(found)


def _pick(rng: Rng, inputs: Sequence[Input]) -> tuple[Input, ...]:
    """Return the inputs of a model: all or some, a few with another trained range than in the other models."""
    kept = [i for i in inputs if rng.random() < 0.7] if rng.random() < 0.5 else list(inputs)
    kept = kept or [inputs[0]]
    if rng.random() < 0.3:
        rng.shuffle(kept)
    if rng.random() < 0.2:
        k = int(rng.integers(len(kept)))
        kept[k] = replace(kept[k], low=0.6 * kept[k].low, high=1.1 * kept[k].high)
    return tuple(kept)


def draw_limits(rng: Rng) -> Limits:
    """Return limits, narrow ones more often than those that a machine has."""
    magnitude, rate, dead_band, age, hold, fade = (
        float(rng.choice(of))
        for of in (
            [4.0, 25.0, 25.0, 1e9],
            [0.004, 0.05, 0.5, 1e9],
            [0.0, 0.0, 0.25, 2.0],
            [5.0, 60.0, 60.0, 600.0],
            [3.0, 120.0, 1800.0],
            [20.0, 600.0, 3600.0],
        )
    )
    return Limits(magnitude=magnitude, rate=rate, dead_band=dead_band, reading_age=age, hold=hold, fade=fade)


def draw_sources(rng: Rng, models: Sequence[ErrorModel]) -> list[ErrorModel | PositionModel]:
    """Return what a compensator is made of: models, and some of them as offset and slopes along an axis."""
    found, rest = list[ErrorModel | PositionModel](), list(models)
    while rest:
        count = int(rng.integers(1, min(len(rest), 3) + 1)) if rng.random() < 0.5 else 0
        if not count:
            found.append(rest.pop(0))
            continue
        mine, rest = rest[:count], rest[count:]
        offset = mine.pop(0) if len(mine) == count and rng.random() < 0.7 else None
        slopes = tuple(replace(m, unit=("um/m", "um/m^2", "um/m^3")[k]) for k, m in enumerate(mine))
        low = float(rng.uniform(-400.0, 0.0))
        found.append(
            PositionModel(
                target=models[0].target.replace("e0", f"p{len(found)}"),
                unit="um",
                axis="X",
                travel=(low, low + float(rng.uniform(100.0, 900.0))),
                reference_position=float(rng.choice([0.0, 120.0])),
                offset=offset,
                slopes=slopes,
            )
        )
    return found


# -- of models that run on their own -----------------------------------------------------------------------------------


def draw_alone(seed: int) -> Drawn:
    """Return a compensator of one model, with a band, over the inputs of a drawn machine."""
    drawn, rng = draw_compensator(seed), np.random.default_rng((3, seed))
    first, own = drawn.compensator.models[0], drawn.compensator
    speeds = tuple(k for k, i in enumerate(first.inputs) if i.quantity == "spindle_speed")
    band = Band(
        level=0.9,
        basis="assumption",
        cycles=5,
        floor=0.7,
        running=2.0,
        stopped=1.5,
        speeds=speeds if rng.random() < 0.5 else (),
        widening=0.3,
    )
    near = JointSupport((0,), (2.0,), ((0.0,),), 1.0) if first.inputs and rng.random() < 0.5 else None
    model = replace(first, unit="um", target="z_um", band=band if rng.random() < 0.8 else None, joint=near)
    return Drawn(Compensator.of([model], own.limits), drawn.plant)


def draw_fleet(seed: int) -> tuple[LinearDynamic, Limits, Plant]:
    """Return a model of which many machines may run, and limits of their corrections."""
    rng = np.random.default_rng((4, seed))
    plant = draw_plant(rng)
    inputs = draw_inputs(rng, plant)
    support = Support("clip", float(rng.choice([0.0, 0.25])))
    head = {"target": "z_um", "unit": "um", "inputs": inputs, "support": support, "honest_error": ACCEPTED}
    model, n = draw_lags(rng, head, inputs), len(inputs)
    straight = rng.random() < 0.3  # one lag after each input
    count = n if straight else int(rng.integers(1, 5))
    follows = list(range(n)) if straight else rng.integers(0, n, count).tolist()
    single = replace(
        model,
        signals=model.signals[:n],
        direct=model.direct[:n],
        lag_signals=tuple(follows),
        time_constants=tuple(rng.choice([20.0, 300.0, 1800.0], count).tolist()),
        lagged=tuple(float(rng.normal(0.0, 6.0)) / size_of(inputs[k]) for k in follows),
        intercept=float(rng.normal(0.0, 1.0)),
    )
    return single, draw_limits(rng), plant
