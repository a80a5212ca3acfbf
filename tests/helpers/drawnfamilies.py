"""Models of every family drawn from a generator of random numbers: see `drawnmodels`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from thermocomp.core.additive import Additive
from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Network, Perceptron
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable

Rng = np.random.Generator

#: highest trained speed [1/min]
TOP = 5000.0


def size_of(channel: Input) -> float:
    """Return by how much an input changes."""
    return max(abs(channel.low), abs(channel.high), 0.1)


def draw_model(rng: Rng, family: str, inputs: tuple[Input, ...], support: Support) -> ErrorModel:
    """Return a model whose deviations are some tens of micrometres."""
    intercept = float(rng.choice([0.0, rng.normal(0.0, 2.0)]))
    head = {"target": "z", "unit": "um", "inputs": inputs, "intercept": intercept, "support": support}
    joint = draw_joint(rng, inputs) if rng.random() < 0.5 else None
    return MAKERS[family](rng, head | {"joint": joint}, inputs)


def draw_joint(rng: Rng, inputs: Sequence[Input]) -> JointSupport | None:
    """Return the states of a training, in which not all inputs need take part."""
    speeds = tuple(k for k, i in enumerate(inputs) if i.quantity == "spindle_speed")
    columns = tuple(k for k, i in enumerate(inputs) if k not in speeds and rng.random() < 0.8)
    if not speeds and not columns:
        return None
    scale = tuple(0.3 * size_of(inputs[k]) for k in columns)
    ranges = np.array([[inputs[k].low, inputs[k].high] for k in columns]).reshape(-1, 2)
    points = rng.uniform(ranges[:, 0], ranges[:, 1], (int(rng.integers(1, 8)), len(columns))) / np.array(scale)
    return JointSupport(
        columns=columns,
        scale=scale,
        points=tuple(map(tuple, points.tolist())) if columns else (),
        limit=float(rng.uniform(0.5, 2.0)),
        speeds=speeds,
        levels=tuple((0.0, 0.6 * TOP, TOP)[: int(rng.integers(1, 4))] for _ in speeds),
        tolerances=tuple(float(rng.uniform(200.0, 2000.0)) for _ in speeds),
    )


def _weights(rng: Rng, count: int, size: float = 8.0) -> tuple[float, ...]:
    return tuple(rng.normal(0.0, size, count).tolist())


def _variables(rng: Rng, inputs: Sequence[Input]) -> tuple[tuple[Variable, ...], list[float]]:
    """Return linear combinations of the inputs, and how far they move."""
    found = [Variable.single(i.name, k) for k, i in enumerate(inputs)]
    sizes = [size_of(i) for i in inputs]
    heat = [k for k, i in enumerate(inputs) if i.quantity == "temperature"]
    if len(heat) > 1:
        a, b = rng.choice(heat, 2, replace=False).tolist()
        found.append(Variable("a-b", ((a, 1.0), (b, -1.0))))
        sizes.append(max(sizes[a], sizes[b]))
    weights = tuple((k, float(rng.normal(0.0, 1.0)) / s) for k, s in enumerate(sizes[: len(inputs)]))
    return (*found, Variable("p", weights)), [*sizes, 1.0]


def _polynomial(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    variables, sizes = _variables(rng, inputs)
    each = rng.integers(0, len(variables), (6, 3)).tolist()
    terms = tuple(tuple(t[: int(rng.integers(1, 4))]) for t in each)
    coefficients = tuple(float(rng.normal(0.0, 8.0)) / float(np.prod([sizes[v] for v in t])) for t in terms)
    return Polynomial(**head, variables=variables, terms=terms, coefficients=coefficients)


def draw_lags(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> LinearDynamic:
    signals = [(k,) for k in range(len(inputs))] + [tuple(rng.integers(0, len(inputs), 2).tolist())]
    sizes = [float(np.prod([size_of(inputs[k]) for k in s])) for s in signals]
    follows = rng.integers(0, len(signals), int(rng.integers(1, 5))).tolist()
    return LinearDynamic(
        **head,
        signals=tuple(signals),
        direct=tuple(float(rng.normal(0.0, 3.0)) / s for s in sizes),
        lag_signals=tuple(follows),
        time_constants=tuple(rng.choice([20.0, 300.0, 1800.0, 9000.0], len(follows)).tolist()),
        lagged=tuple(float(rng.normal(0.0, 6.0)) / sizes[k] for k in follows),
    )


def _paced(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    heat = [k for k, i in enumerate(inputs) if i.quantity != "spindle_speed"]
    turns = [k for k, i in enumerate(inputs) if i.quantity == "spindle_speed"]
    taus = tuple(rng.uniform(60.0, 5000.0, int(rng.integers(0, 3))).tolist())
    states = []
    for k in turns * int(rng.integers(1, 3)):
        slow = float(rng.uniform(300.0, 6000.0))
        running = slow * float(rng.uniform(0.2, 1.0))
        states.append(
            SpeedState(k, float(rng.choice([0.5, 1.0, 1.7, 3.0])), slow, running, float(rng.normal(0.0, 9.0)))
        )
    temperatures = [
        LaggedInput(
            k, float(rng.normal(0.0, 3.0)) / size_of(inputs[k]), _weights(rng, len(taus), 5.0 / size_of(inputs[k]))
        )
        for k in heat
    ]
    parts = len(heat) * (1 + len(taus)) + len(states)
    spread = tuple(_weights(rng, parts, 0.3) for _ in range(int(rng.integers(0, 3))))
    return PacedDynamic(
        **head,
        time_constants=taus,
        temperatures=tuple(temperatures),
        top_speed=TOP,
        states=tuple(states),
        spread=spread,
    )


def _curve(rng: Rng, size: float, kind: str) -> Curve:
    x = np.sort(rng.uniform(-0.5, 1.2, int(rng.integers(1, 6))) * size)
    return Curve(tuple(x.tolist()), _weights(rng, len(x) + (kind == "step")), kind)  # type: ignore[arg-type]


def _additive(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    variables, sizes = _variables(rng, inputs)
    curves = tuple(_curve(rng, s, str(rng.choice(["linear", "linear", "step"]))) for s in sizes)
    response = _curve(rng, 20.0, "linear") if rng.random() < 0.5 else None
    return Additive(**head, variables=variables, curves=curves, response=response)


def _net(rng: Rng, count: int, output: Sequence[str]) -> Perceptron:
    hidden = int(rng.integers(1, 4))
    return Perceptron(
        tuple(_weights(rng, count, 1.0) for _ in range(hidden)),
        _weights(rng, hidden, 1.0),
        (_weights(rng, hidden, 1.0),),
        _weights(rng, 1, 0.5),
        str(rng.choice(["sigmoid", "tanh", "identity"])),  # type: ignore[arg-type]
        str(rng.choice(output)),  # type: ignore[arg-type]
    )


def _network(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    gains = tuple(1.0 / size_of(i) for i in inputs)
    return Network(
        **head,
        net=_net(rng, len(inputs), ("sigmoid", "tanh", "identity")),
        input_scaling=Affine(gains, _weights(rng, len(gains), 0.3)),
        output_scaling=Affine((float(rng.uniform(5.0, 30.0)),), (-7.0,)),
    )


INTERVALS = (0.5, 7.0, 15.0, 60.0, 900.0)


def _ticks(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    more = int(rng.integers(0, 3))
    return Autoregressive(
        **head,
        interval=float(rng.choice(INTERVALS)),
        a=((0.7,), (0.5, 0.3), (), (1.2, -0.35))[int(rng.integers(4))],
        b=tuple(_weights(rng, more + 1, 2.0 / size_of(i)) for i in inputs),
    )


def _ticking_net(rng: Rng, head: dict[str, Any], inputs: Sequence[Input]) -> ErrorModel:
    k, m = int(rng.integers(0, 3)), int(rng.integers(0, 3))
    gains = (0.004,) * k + tuple(1.0 / size_of(i) for i in inputs) * (m + 1)
    return AutoregressiveNet(
        **head,
        interval=float(rng.choice(INTERVALS)),
        k=k,
        m=m,
        net=_net(rng, len(gains), ("sigmoid", "tanh")),
        input_scaling=Affine(gains, _weights(rng, len(gains), 0.3)),
        output_scaling=Affine((30.0,), (-15.0,)),
    )


MAKERS: dict[str, Callable[[Rng, dict[str, Any], Sequence[Input]], ErrorModel]] = {
    "polynomial": _polynomial,
    "linear-dynamic": draw_lags,
    "paced-dynamic": _paced,
    "additive": _additive,
    "network": _network,
    "autoregressive": _ticks,
    "autoregressive-network": _ticking_net,
}
FAMILIES = tuple(MAKERS)


def resize(model: ErrorModel, factor: float) -> ErrorModel:
    """Return a model of the same inputs and memory with another output."""
    match model:
        case Polynomial():
            return replace(model, coefficients=tuple(factor * c for c in model.coefficients))
        case LinearDynamic():
            return replace(model, lagged=tuple(factor * c for c in model.lagged))
        case PacedDynamic():
            return replace(model, states=tuple(replace(s, weight=factor * s.weight) for s in model.states))
    return replace(model, intercept=model.intercept + factor)
