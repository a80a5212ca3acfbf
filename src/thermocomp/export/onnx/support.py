"""Behaviour of a model outside its training range as ONNX operators: ``hold`` and ``fade``, separately and combined."""

import math

import numpy as np

from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.export.onnx.nodes import Graph


def support(g: Graph, model: ErrorModel, change: str, said: str, before: str) -> str:
    """Return the deviation after a model's support policy, clip, hold or fade, was applied."""
    policy = model.support.policy
    if policy == "clip":
        return said
    low, high, span = map(np.array, model.bounds)
    beyond = g.put("Max", g.put("Sub", low, change), g.put("Sub", change, high), 0.0)
    excess = g.put("ReduceMax", g.put("Div", g.put("Min", beyond, span), span), keepdims=1)
    far = distance(g, model.joint, change) if model.joint is not None else g.constant(0.0)
    if policy == "hold":
        inside = g.put("And", g.put("LessOrEqual", excess, 0.0), g.put("LessOrEqual", far, 1.0))
        return g.choose(inside, said, before)
    over = g.put("Div", g.put("Sub", far, 1.0), model.support.fade_over)
    return g.put("Mul", said, g.between(g.put("Sub", 1.0, g.put("Max", over, excess)), 0.0, 1.0))


def distance(g: Graph, joint: JointSupport, change: str) -> str:
    """Return the joint distance of inputs from the training data: 1 is the limit."""
    parts = [g.constant(0.0)]
    if joint.columns:
        unit = joint.limit * math.sqrt(len(joint.columns))
        state = g.put("Mul", g.pick(change, joint.columns), 1.0 / (np.array(joint.scale) * unit))
        away = g.put("Sub", state, np.array(joint.points, dtype=np.float64) / unit)
        squares = g.put("ReduceSum", g.put("Mul", away, away), np.array([1]), keepdims=0)
        parts.append(g.put("Sqrt", g.put("ReduceMin", squares, keepdims=1)))
    for k, levels, tolerance in zip(joint.speeds, joint.levels, joint.tolerances, strict=True):
        away = g.put("Abs", g.put("Sub", g.pick(change, k), np.array(levels, dtype=np.float64)))
        parts.append(g.put("Div", g.put("ReduceMin", away, keepdims=1), tolerance))
    # identical on every processor
    return g.put("Div", g.put("Round", g.put("Mul", g.put("Max", *parts), 1e6)), 1e6)
