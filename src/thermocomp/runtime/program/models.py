"""Formulas of models as functions of a program: one variable per node, with lags and ticks in the state."""

import re
from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add, mul
from typing import Any

from thermocomp.core import expression as e
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.recurrences import Clock
from thermocomp.runtime.program.banks import TableBank, join, stripped
from thermocomp.runtime.program.clocks import run_clock
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, exp, expm1, let, raised, record, when
from thermocomp.runtime.program.numbers import clip, find_linear, find_step
from thermocomp.runtime.program.supporting import Supports
from thermocomp.runtime.program.tree import Expression, Function, Name
from thermocomp.runtime.program.values import Condition, Number, Whole, integer, real
from thermocomp.runtime.program.variables import Kept, Work

#: beyond every argument of a table
_BEYOND = 1e30
#: maximum length of a name of a value [characters]
_LONG = 60
#: powers with a larger exponent are computed by a library function, which may reject a negative base
_FACTORS = 16


class Formulas:
    """Functions `thermocomp.runtime.program.formulas` of a compensator, and the numbers that they need.

    Parameters
    ----------
    ranges : sequence of Input
        Inputs of the models, without duplicates.
    channels : sequence of int
        Index of each input among the values of a reading.
    models : sequence of ErrorModel
    """

    def __init__(self, ranges: Sequence[Input], channels: Sequence[int], models: Sequence[ErrorModel]) -> None:
        self.channels = channels
        self._supports = Supports(ranges)
        self.nodes = {k: formula(m, tuple(ranges)) for k, m in enumerate(models)}
        self.banks = list[TableBank]()
        groups = {
            name: [(k, m) for k, m in enumerate(models) if any(i.rezero for i in m.inputs) == rezeroed]
            for name, rezeroed in (("absolute", False), ("rezeroed", True))
        }
        for group in groups.values():
            self.banks.append(TableBank([self.nodes[k] for k, _ in group], self.banks))
        self.lags = sum(len(b.lags) for b in self.banks)
        self.clocks: list[_Clock] = []
        self.x, self.y = list[float](), list[float]()
        self.functions: dict[str, Function] = {}  #: by name
        for (name, group), bank in zip(groups.items(), self.banks, strict=True):
            self._add(name, group, bank)

    def _add(self, name: str, models: Iterable[tuple[int, ErrorModel]], bank: TableBank) -> None:
        """Record the function that computes the outputs of models."""
        s = Kept()
        begun = s.begun_absolute if name == "absolute" else s.begun_rezeroed
        with record(f"models_{name}") as self.functions[f"models_{name}"]:
            values, worked_out = _Formula(self, bank, begun), set[int]()
            bank.record(begun, values.store)
            for place, model in models:
                self._supports.record(model, place, values.value(self.nodes[place]), worked_out)
            begun.set(True)

    def finish(self) -> tuple[dict[str, int], dict[str, list[Any]]]:
        """Record the last function; return all sizes and numbers that the functions need."""
        w = Work()
        with record("tick") as self.functions["tick"]:
            for k, clock in enumerate(self.clocks):
                with when(Whole(Name("int", "c")).equals(k)):
                    w.next = _Ticking(clock).value(clock.tick)
        sizes, values = self._supports.finish()
        clocks = self.clocks
        own_sizes, own_values = join(self.banks)
        sizes |= own_sizes | {
            "LAGS": self.lags,
            "CLOCKS": len(clocks),
            "ENDS_OF_CLOCKS": len(clocks) + 1,
            "PASTS": sum(c.past for c in clocks),
            "LEAVES": sum(len(c.leaves) for c in clocks),
            "AVERAGES": sum(c.means * len(c.leaves) for c in clocks),
            "POINTS_OF_TABLES": len(self.x),
        }
        values |= own_values | {
            "interval": [c.interval for c in clocks],
            "past_begin": [c.past_begin for c in clocks] + [sizes["PASTS"]],
            "leaf_begin": [c.leaf_begin for c in clocks] + [sizes["LEAVES"]],
            "average_begin": [c.average_begin for c in clocks] + [sizes["AVERAGES"]],
            "table_x": self.x,
            "table_y": self.y,
        }
        return sizes, values


def formula(model: ErrorModel, ranges: tuple[Input, ...]) -> e.Node:
    """Return the formula of a model, with its inputs numbered like the ranges."""
    low, high, _ = model.bounds
    leaves = (e.Input(ranges.index(i), i.name) for i in model.inputs)
    return model.expression([e.Clip(*clip) for clip in zip(leaves, low, high, strict=True)])


def name_value(node: e.Node) -> str:
    """Return a name for the value of a node, with its sensor and lag, valid in C and structured text; empty if none."""
    match node:
        case e.Input(_, name):
            found = f"x_{name}"
        case e.Clip(of, _, _):
            found = f"{name_value(of)}_clip"
        case e.Lag(of, tau):
            found = f"{name_value(of).removesuffix('_clip')}_lag_{tau:.0f}_s"
        case e.PacedLag(of, stopped, running, _):
            found = f"{name_value(of)}_lag_{stopped:.0f}_to_{running:.0f}_s"
        case e.Magnitude(of):
            found = f"{name_value(of).removesuffix('_clip')}_size"
        case e.Product(factors) if len(others := [f for f in factors if not isinstance(f, e.Constant)]) == 1:
            found = f"{name_value(others[0]).removesuffix('_clip')}_term"
        case e.Power(of, exponent):
            found = f"{name_value(of)}_to_{exponent:g}"
        case e.Named(_, of):
            return name_value(of)
        case _:
            return ""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", found).strip("_")
    return plain if plain.startswith("x_") and len(plain) <= _LONG else ""


class _Arithmetic:
    """Values of an expression's nodes as local variables; a repeated node is computed once."""

    def __init__(self) -> None:
        self._known: dict[e.Node, Number] = {}
        self._names = set[str]()

    def value(self, node: e.Node) -> Number:
        """Return the value of an expression's node, computed once."""
        node = stripped(node)
        if isinstance(node, e.Constant):
            return real(node.value)
        if (known := self._known.get(node)) is None:
            found = self._found(node)
            known = self._known[node] = let(self._new_name(node), found)
        return known

    def _term(self, node: e.Node) -> Number:
        """Return the value of a term of a sum; a weighted value has no variable of its own."""
        match stripped(node):
            case e.Product((e.Constant(weight), of)):
                return weight * self.value(of)
        return self.value(node)

    def _new_name(self, node: e.Node) -> str:
        """Return a new name of a variable: that of the sensor and the operation if there is one, otherwise a number."""
        number = len(self._known)
        wanted = name_value(node)
        name = wanted or f"v{number}"
        while name.lower() in self._names:  # structured text does not distinguish upper and lower case
            name = f"{name}_{number}"
        self._names.add(name.lower())
        return name

    def _found(self, node: e.Node) -> Number:  # noqa: PLR0911 - one case per node type
        match node:
            case e.Clip(of, low, high):
                return clip(self.value(of), real(low), real(high))
            case e.Sum(terms):
                return reduce(add, map(self._term, terms)) if terms else real(0.0)
            case e.Difference(of, minus):
                return self.value(of) - self.value(minus)
            case e.Product(factors):
                return reduce(mul, map(self.value, factors)) if factors else real(1.0)
            case e.Power(of, exponent) if exponent in range(1, _FACTORS + 1):
                return reduce(mul, [self.value(of)] * int(exponent))
            case e.Power(of, exponent):
                return raised(self.value(of), real(exponent))
            case e.Magnitude(of):
                return abs(self.value(of))
            case e.Sigmoid(of):
                return 1.0 / (1.0 + exp(-self.value(of)))
        raise TypeError(f"{node}: {type(node).__name__} cannot be translated into arithmetic of the controller")


class _Formula(_Arithmetic):
    """Formula of models, with lags, tables and values updated at fixed intervals."""

    def __init__(self, formulas: Formulas, bank: TableBank, begun: Condition) -> None:
        super().__init__()
        self._formulas, self._bank, self._begun = formulas, bank, begun
        w = Work()
        self._known |= {n: w.term[bank.places[n]] for n in (*bank.inputs, *bank.lags)}
        self._known |= {n: w.total[k] for n, k in zip(bank.sums, bank.rows["sums"], strict=True)}
        self._gains: dict[Expression, Number] = {}

    def store(self, nodes: Iterable[e.Node]) -> None:
        """Record the values of nodes as terms of the bank."""
        for node in nodes:
            term = Work().term[self._bank.places[node]]
            term.set(self.value(node) if node in self._known or isinstance(node, e.Constant) else self._found(node))
            self._known[node] = term

    def _found(self, node: e.Node) -> Number:
        own, s, w, t = self._formulas, Kept(), Work(), Constants()
        match node:
            case e.Input(index):
                return w.input[own.channels[index]] - s.zero[index]
            case e.Lag(of, tau):
                return self._lag(self.value(of), w.step / tau)
            case e.PacedLag(of, stopped, running, pace):
                signal, share = self.value(of), self.value(pace)
                return self._lag(signal, w.step * (1.0 / stopped + share * (1.0 / running - 1.0 / stopped)))
            case e.Recurrence(tick, interval):
                clock = _Clock(tick, interval, own.clocks)
                for k, leaf in enumerate(clock.leaves, clock.leaf_begin):
                    w.leaf[k] = self.value(leaf)
                run_clock(s, w, t, integer(len(own.clocks)), self._begun)
                own.clocks.append(clock)
                return w.found
            case e.Lookup(of, x, y, kind):
                at, first = self.value(of), len(own.x)
                own.x += [*x, _BEYOND] if kind == "step" else x
                own.y += y
                find = find_step if kind == "step" else find_linear
                find(s, w, t, at, integer(first), integer(len(own.x)))
                return w.found
        return super()._found(node)

    def _lag(self, signal: Number, paces: Number) -> Number:
        s, place = Kept(), self._formulas.lags
        self._formulas.lags += 1
        if paces.node not in self._gains:
            self._gains[paces.node] = let(f"gain{len(self._gains)}", -expm1(-paces))
        lag, gain = s.lag[place], self._gains[paces.node]
        s.lag[place] = choose(self._begun, lag + gain * (signal - lag), signal)
        return lag


class _Clock(Clock):
    """A value updated at fixed intervals, and the location of its past values in the arrays of the program."""

    def __init__(self, tick: e.Node, interval: float, before: Sequence["_Clock"]) -> None:
        super().__init__(tick, interval)
        self.past_begin = sum(c.past for c in before)
        self.leaf_begin = sum(len(c.leaves) for c in before)
        self.average_begin = sum(c.means * len(c.leaves) for c in before)


class _Ticking(_Arithmetic):
    """Expression of the next value of a recurrence."""

    def __init__(self, clock: _Clock) -> None:
        super().__init__()
        self._clock = clock

    def _found(self, node: e.Node) -> Number:
        clock, s, w = self._clock, Kept(), Work()
        match node:
            case e.Past(ticks):
                return s.past[clock.past_begin + ticks - 1]
            case e.Mean(of, 0):
                return w.average[clock.leaf_begin + clock.leaves.index(of)]
            case e.Mean(of, ticks):
                return s.averages[clock.average_begin + (ticks - 1) * len(clock.leaves) + clock.leaves.index(of)]
        return super()._found(node)
