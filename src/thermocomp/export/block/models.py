"""Formulas of models as functions of a block: one variable per node, with lags and clocks in the state."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from thermocomp.core import expression as e
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.export.block.supporting import Supports
from thermocomp.export.recurrences import Clock

#: beyond every argument of a table
_BEYOND = 1e30
#: a larger exponent is left to a library, which may reject a negative base
_FACTORS = 16


class Formulas:
    """Bodies of the functions of `thermocomp.export.block.formulas`, as Python source, and the numbers that they need.

    Parameters
    ----------
    ranges : sequence of Input
        Inputs of the models, without duplicates.
    channels : sequence of int
        Index of each input among the values of a reading.
    """

    def __init__(self, ranges: Sequence[Input], channels: Sequence[int]) -> None:
        self._channels = channels
        self._supports = Supports(ranges)
        self._lags = 0
        self._clocks: list[_Clock] = []
        self._x, self._y = list[float](), list[float]()
        self._begin()
        self.functions: dict[str, str] = {}  #: source by name

    def _begin(self) -> None:
        self._lines, self._known, self._gains = list[str](), dict[e.Node, str](), dict[str, str]()

    def add(self, name: str, models: Iterable[tuple[int, ErrorModel, e.Node]]) -> None:
        """Write a function that computes the outputs of models.

        Parameters
        ----------
        name : str
            Name of the function; ``models_`` is prefixed.
        models : iterable of (int, ErrorModel, Node)
            Index, model and formula; the inputs of a formula are numbered like the ranges.
        """
        self._begin()
        worked_out = set[int]()
        for place, model, node in models:
            said = self._value(node)
            self._lines += self._supports.statements(model, place, said, worked_out)
        text = "\n".join(self._lines)
        head = [f"begun = s.begun_{name}"] if "begun" in text else []
        head += ["dt = w.step"] if "(dt " in text else []
        self._write(f"models_{name}", "s, w, t", [*head, *self._lines, f"s.begun_{name} = True"])

    def finish(self) -> tuple[dict[str, int], dict[str, list[Any]]]:
        """Write the last function; return all sizes and numbers that the functions need."""
        lines = []
        for c, clock in enumerate(self._clocks):
            self._begin()
            said = self._value(clock.tick, clock)
            lines += [f"if c == {c}:", *(f"    {line}" for line in [*self._lines, f"w.next = {said}"])]
        self._write("tick", "s, w, t, c: int", lines)
        sizes, values = self._supports.finish()
        clocks = self._clocks
        sizes |= {
            "LAGS": self._lags,
            "CLOCKS": len(clocks),
            "ENDS_OF_CLOCKS": len(clocks) + 1,
            "PASTS": sum(c.past for c in clocks),
            "LEAVES": sum(len(c.leaves) for c in clocks),
            "AVERAGES": sum(c.means * len(c.leaves) for c in clocks),
            "POINTS_OF_TABLES": len(self._x),
        }
        values |= {
            "interval": [c.interval for c in clocks],
            "past_begin": [c.past_begin for c in clocks] + [sizes["PASTS"]],
            "leaf_begin": [c.leaf_begin for c in clocks] + [sizes["LEAVES"]],
            "average_begin": [c.average_begin for c in clocks] + [sizes["AVERAGES"]],
            "table_x": self._x,
            "table_y": self._y,
        }
        return sizes, values

    def _write(self, name: str, parameters: str, lines: Sequence[str]) -> None:
        self.functions[name] = "\n".join([f"def {name}({parameters}):", *(f"    {line}" for line in lines or ["pass"])])

    def _value(self, node: e.Node, clock: "_Clock | None" = None) -> str:
        """Return the variable name of a node's value; a repeated node is computed once."""
        if isinstance(node, e.Named):
            return self._value(node.of, clock)
        if isinstance(node, e.Constant):
            return number(node.value)
        if (known := self._known.get(node)) is None:
            text = self._text(node) if clock is None else clock.text(node) or self._arithmetic(node, clock)
            known = self._known[node] = f"v{len(self._known)}"
            self._lines.append(f"{known} = {text}")
        return known

    def _text(self, node: e.Node) -> str:
        match node:
            case e.Input(index):
                return f"w.input[{self._channels[index]}] - s.zero[{index}]"
            case e.Lag(of, tau):
                return self._lag(self._value(of), f"dt / {number(tau)}")
            case e.PacedLag(of, stopped, running, pace):
                signal, share = self._value(of), self._value(pace)
                gain = 1.0 / running - 1.0 / stopped
                return self._lag(signal, f"dt * ({number(1.0 / stopped)} + {share} * {number(gain)})")
            case e.Recurrence(tick, interval):
                clock = _Clock(tick, interval, self._clocks)
                for k, leaf in enumerate(clock.leaves, clock.leaf_begin):
                    self._lines.append(f"w.leaf[{k}] = {self._value(leaf)}")
                self._lines.append(f"run_clock(s, w, t, {len(self._clocks)}, begun)")
                self._clocks.append(clock)
                return "w.found"
            case e.Lookup(of, x, y, kind):
                at, first = self._value(of), len(self._x)
                self._x += [*x, _BEYOND] if kind == "step" else x
                self._y += y
                self._lines.append(f"find_{kind}(s, w, t, {at}, {first}, {len(self._x)})")
                return "w.found"
        return self._arithmetic(node)

    def _lag(self, signal: str, paces: str) -> str:
        place, self._lags = self._lags, self._lags + 1
        if paces not in self._gains:
            self._gains[paces] = f"gain{len(self._gains)}"
            self._lines.append(f"{self._gains[paces]} = -math.expm1(-({paces}))")
        lag = f"s.lag[{place}]"
        self._lines.append(f"{lag} = {lag} + {self._gains[paces]} * ({signal} - {lag}) if begun else {signal}")
        return lag

    def _arithmetic(self, node: e.Node, clock: "_Clock | None" = None) -> str:  # noqa: PLR0911 - one case per node type
        def value(part: e.Node) -> str:
            return self._value(part, clock)

        match node:
            case e.Clip(of, low, high):
                return f"clip({value(of)}, {number(low)}, {number(high)})"
            case e.Sum(terms):
                return " + ".join(map(value, terms)) or "0.0"
            case e.Difference(of, minus):
                return f"{value(of)} - {value(minus)}"
            case e.Product(factors):
                return " * ".join(map(value, factors)) or "1.0"
            case e.Power(of, exponent) if exponent in range(1, _FACTORS + 1):
                return " * ".join([value(of)] * int(exponent))
            case e.Power(of, exponent):
                return f"math.pow({value(of)}, {number(exponent)})"
            case e.Magnitude(of):
                return f"abs({value(of)})"
            case e.Sigmoid(of):
                return f"1.0 / (1.0 + math.exp(-{value(of)}))"
        raise TypeError(f"{node}: is not part of a formula")


class _Clock(Clock):
    """A value with a separate clock, and the location of its past values in the block's arrays."""

    def __init__(self, tick: e.Node, interval: float, before: Sequence["_Clock"]) -> None:
        super().__init__(tick, interval)
        self.past_begin = sum(c.past for c in before)
        self.leaf_begin = sum(len(c.leaves) for c in before)
        self.average_begin = sum(c.means * len(c.leaves) for c in before)

    def text(self, node: e.Node) -> str:
        """Return the location of a past value; empty if `node` is not a past value."""
        match node:
            case e.Past(ticks):
                return f"s.past[{self.past_begin + ticks - 1}]"
            case e.Mean(of, 0):
                return f"w.average[{self.leaf_begin + self.leaves.index(of)}]"
            case e.Mean(of, ticks):
                return f"s.averages[{self.average_begin + (ticks - 1) * len(self.leaves) + self.leaves.index(of)}]"
        return ""


def number(value: float) -> str:
    """Return a number as exact Python source."""
    if not math.isfinite(value):
        raise ValueError(f"{value}: must be finite")
    return repr(float(value))
