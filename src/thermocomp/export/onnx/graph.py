"""A model as a graph: `ErrorModel.step` with the zero, the time step and the state as inputs."""

import math
import sys

import numpy as np

from thermocomp.core.bounds import GAP, READING
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.export.onnx.expression import Walk
from thermocomp.export.onnx.nodes import BOOL, Graph

#: elements at the beginning of the state, before the memory: whether there was a reading, and the last deviation
FIRST = 2


def translate(model: ErrorModel) -> Graph:
    """Return the graph of a model.

    Its inputs are ``value`` and ``zero`` in the order of the model's inputs, ``dt`` [s] if the model has a memory, and
    ``state`` if it has one or holds its deviation; its outputs ``deviation``, ``outside`` by input, and ``next_state``.
    Where `ErrorModel.step` rejects its arguments, the deviation is NaN and the state unchanged.
    """
    g, n = Graph(), len(model.inputs)
    value = g.enter("value", (n,), about=", ".join(f"{i.name} [{i.unit}]" for i in model.inputs))
    zero = g.enter("zero", (n,), about=tell_zeros(model))
    fixed = np.array([i.reference for i in model.inputs], dtype=np.float64)
    zero = g.choose(np.array([i.rezero for i in model.inputs], dtype=np.bool_), zero, fixed)
    change = g.put("Sub", g.between(value, -READING, READING), zero)
    low, high, _ = map(np.array, model.bounds)
    clipped = g.between(change, low, high)
    inside = g.put("Equal", clipped, change)
    finite = [g.put("LessOrEqual", g.put("Abs", x), sys.float_info.max) for x in (value, zero)]
    good = g.every(*finite)
    begun, dt, kept = "", "", model.remembers or model.support.policy == "hold"
    if model.remembers:
        begun, dt = (
            g.put("Greater", g.pick("state", [0]), 0.5),
            g.enter("dt", about="time since the previous accepted call [s]"),
        )
        timely = [g.put("GreaterOrEqual", dt, 0.0), g.put("LessOrEqual", dt, sys.float_info.max)]
        good = g.every(good, *timely)
        dt = g.choose(g.put("And", good, begun), g.put("Min", dt, GAP), 0.0)
    walk = Walk(g, [g.pick(clipped, [k]) for k in range(n)], begun, dt, "state", FIRST)
    for node in model.remembered:
        walk.value(node)
    said = _support(g, model, change, inside, walk.value(model.expression(model.leaves)))
    about = f"{model.target} [{model.unit}], actual minus commanded"
    g.leave("deviation", g.choose(good, said, math.nan), about=about)
    g.leave("outside", g.put("Not", inside), (n,), BOOL, "inputs outside the trained range")
    if kept:
        g.enter("state", (walk.size,), about="next_state of that call, zeros at the start")
        g.leave(
            "next_state",
            g.choose(good, g.join([1.0, said, *walk.memory]), "state"),
            (walk.size,),
            about="state for the next call",
        )
    return g


def tell_zeros(model: ErrorModel) -> str:
    """Return the zero (reference value) of each input, such as ``t1_C: mean at the start, t2_C: 20 degC``."""
    return ", ".join(
        f"{i.name}: {'mean at the start' if i.rezero else f'{i.reference:g} {i.unit}'}" for i in model.inputs
    )


def _support(g: Graph, model: ErrorModel, change: str, inside: str, said: str) -> str:
    """Return the deviation after the support policy of a model."""
    policy = model.support.policy
    if policy == "clip":
        return said
    far = _distance(g, model.joint, change) if model.joint is not None else g.constant(0.0)
    if policy == "hold":
        return g.choose(g.every(inside, g.put("LessOrEqual", far, 1.0)), said, g.pick("state", [1]))
    low, high, span = map(np.array, model.bounds)
    beyond = g.put("Max", g.put("Sub", low, change), g.put("Sub", change, high))
    excess = g.put("Div", g.put("Min", beyond, span), span)
    over = g.put("Div", g.put("Sub", far, 1.0), model.support.fade_over)
    most = g.put("ReduceMax", g.join([excess, over]), keepdims=1)
    return g.put("Mul", said, g.between(g.put("Sub", 1.0, most), 0.0, 1.0))


def _distance(g: Graph, joint: JointSupport, change: str) -> str:
    """Return the joint distance of inputs from the training data: 1 is the limit."""
    parts = [g.constant(0.0)]
    if joint.columns:
        unit = joint.limit * math.sqrt(len(joint.columns))
        state = g.put("Mul", g.pick(change, joint.columns), 1.0 / (np.array(joint.scale) * unit))
        away = g.put("Sub", state, np.array(joint.points, dtype=np.float64) / unit)
        squares = g.put("ReduceSum", g.put("Mul", away, away), np.array([1]), keepdims=0)
        parts.append(g.put("Sqrt", g.put("ReduceMin", squares, keepdims=1)))
    for k, levels, tolerance in zip(joint.speeds, joint.levels, joint.tolerances, strict=True):
        away = g.put("Abs", g.put("Sub", g.pick(change, [k]), np.array(levels, dtype=np.float64)))
        parts.append(g.put("Div", g.put("ReduceMin", away, keepdims=1), tolerance))
    # identical on every processor
    return g.put("Div", g.put("Round", g.put("Mul", g.put("Max", *parts), 1e6)), 1e6)
