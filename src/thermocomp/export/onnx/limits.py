"""Limits of the corrections as ONNX operators: all targets at once."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.export.onnx.nodes import Graph
from thermocomp.runtime.program.tables import Tables


class Drive:
    """Movement of corrections, equivalent to ``drive`` and ``idle`` of `thermocomp.runtime.program.steps`."""

    def __init__(self, graph: Graph, tables: Tables) -> None:
        t, self._graph = tables.values, graph
        self._magnitude: float = t["magnitude"]
        self._rate, self._fade, self._hold = t["rate"], t["fade"], t["hold"]
        shadow, position = np.array(t["shadow"]), np.array(t["position"], dtype=np.float64)
        self._band = np.where(shadow, 0.0, t["dead_band"])
        self._low = np.array(t["travel_low"], dtype=np.float64) - position
        self._high = np.array(t["travel_high"], dtype=np.float64) - position
        self._travels = self._low < self._high
        line = np.repeat(np.arange(len(shadow)), np.diff(t["line_begin"]))
        mine = (line == np.arange(len(shadow))[:, None]) & ~shadow[:, None]
        self._to_offset = np.where(mine, t["to_offset"], 0.0)
        self._to_slope = np.where(mine, t["to_slope"], 0.0)

    def holds(self, correction: str, slope: str) -> str:
        """Return whether all corrections are within the magnitude, and only axes with a travel have a slope."""
        g = self._graph
        within = g.put("LessOrEqual", self._largest(correction, slope), self._magnitude * (1.0 + 1e-9))
        flat = g.put("Or", g.put("Equal", slope, 0.0), self._travels)
        return g.every(g.put("And", within, flat))

    def move(self, deviation: str, correction: str, slope: str, travel: str) -> tuple[str, str]:
        """Return corrections and slopes moved towards the values required by the models."""
        g = self._graph
        offset = g.put("Sub", 0.0, g.put("MatMul", self._to_offset, deviation))
        flat = self._limit(offset, correction, travel)
        if not self._travels.any():
            return flat, slope
        tilt = g.put("Sub", 0.0, g.put("MatMul", self._to_slope, deviation))
        ends = [self._limit(self._at(offset, tilt, p), self._at(correction, slope, p), travel) for p in self._ends]
        length = np.where(self._travels, self._high - self._low, 1.0)
        rise = g.put("Div", g.put("Sub", ends[1], ends[0]), length)
        level = g.put("And", g.put("Equal", tilt, 0.0), g.put("Equal", slope, 0.0))
        return (
            g.choose(level, flat, g.put("Sub", ends[0], g.put("Mul", rise, self._low))),
            g.choose(level, slope, g.put("Mul", rise, 1000.0)),
        )

    def rest(self, correction: str, slope: str, idle: str, travel: str) -> tuple[str, str]:
        """Return corrections and slopes that no model drives: held, and faded to zero after the hold time.

        Parameters
        ----------
        idle : str
            Time without an update from the models [s].
        """
        g, largest = self._graph, self._largest(correction, slope)
        share = g.put("Exp", g.put("Div", g.put("Neg", travel), self._fade))
        reach = g.put("Mul", self._rate, travel)
        slow = g.put("Sub", 1.0, g.put("Div", reach, g.put("Max", largest, 1e-300)))
        too_fast = g.put("Greater", g.put("Mul", largest, g.put("Sub", 1.0, share)), reach)
        share = g.choose(too_fast, slow, share)
        fades = g.put("And", g.put("Greater", idle, self._hold), g.put("Greater", travel, 0.0))
        share = g.choose(fades, share, 1.0)
        return g.put("Mul", share, correction), g.put("Mul", share, slope)

    def _largest(self, correction: str, slope: str) -> str:
        """Return the larger magnitude of corrections at the two ends of their travels."""
        g = self._graph
        return g.put("Max", *(g.put("Abs", self._at(correction, slope, p)) for p in self._ends))

    @property
    def _ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._low, self._high

    def _at(self, offset: str, slope: str, place: NDArray[np.float64]) -> str:
        g = self._graph
        return g.add(offset, g.put("Mul", g.put("Mul", slope, 0.001), place))

    def _limit(self, wanted: str, current: str, travel: str) -> str:
        """Return corrections moved towards the required values, within magnitude, rate and dead band."""
        g, most = self._graph, self._magnitude
        aim = g.between(wanted, -most, most)
        way, reach = g.put("Sub", aim, current), g.put("Mul", self._rate, travel)
        size = g.put("Abs", way)
        near = g.put("LessOrEqual", size, reach)
        part = g.between(g.add(current, g.put("Mul", g.put("Sign", way), reach)), -most, most)
        goes = g.put("And", g.put("Greater", travel, 0.0), g.put("Greater", size, self._band))
        return g.choose(goes, g.choose(near, aim, part), current)
