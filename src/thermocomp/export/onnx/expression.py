"""The formula of a model as ONNX operators, and its state between two calls."""

from collections.abc import Callable, Sequence

import numpy as np

from thermocomp.core import expression as e
from thermocomp.core.recurrences import Clock
from thermocomp.export.onnx.nodes import Graph

#: largest number of ticks in one call (0.6 s of computing time): a model with roots below 0.9997 has settled by then
MOST_TICKS = 100_000
#: fraction of an interval by which an early reading still triggers the tick
EARLY = 1e-6


class Memory:
    """A state vector passed in and out; its elements are allocated consecutively.

    Parameters
    ----------
    state : str
        Incoming state.
    begin : int
        First free element.
    """

    def __init__(self, graph: Graph, state: str, begin: int = 0) -> None:
        self._graph, self._state, self.begin, self.end = graph, state, begin, begin
        self.after: list[str] = []  #: names of the new values, in order

    def before(self, size: int = 1) -> str:
        """Return the stored values of the next elements; the caller appends their new values to `after` in order."""
        self.end += size
        return self._graph.part(self._state, self.end - size, self.end)


class Walk:
    """Converter of expression trees; a repeated node is converted once.

    Parameters
    ----------
    change : sequence of str
        Inputs minus their zero.
    begun : str
        Whether there was an earlier reading.
    dt : str
        Time since the previous reading [s]; 0 without one.
    """

    def __init__(self, graph: Graph, change: Sequence[str], begun: str, dt: str, memory: Memory) -> None:
        self._graph, self._change, self._begun, self._dt, self._memory = graph, change, begun, dt, memory
        self._known: dict[e.Node, str] = {}

    def value(self, node: e.Node) -> str:
        """Return the name of a node's value."""
        if isinstance(node, e.Named):
            return self.value(node.of)
        if (known := self._known.get(node)) is None:
            known = self._known[node] = self._make(node)
        return known

    def _make(self, node: e.Node) -> str:
        g = self._graph
        match node:
            case e.Input(index):
                return self._change[index]
            case e.Lag(of, tau):
                return self._lag(self.value(of), g.put("Div", self._dt, tau))
            case e.PacedLag(of, stopped, running, pace):
                signal, share = self.value(of), self.value(pace)
                rate = g.add(1.0 / stopped, g.put("Mul", share, 1.0 / running - 1.0 / stopped))
                return self._lag(signal, g.put("Mul", self._dt, rate))
            case e.Recurrence(tick, interval):
                return self._clock(tick, interval)
        return arithmetic(g, node, self.value)

    def _lag(self, signal: str, paces: str) -> str:
        g = self._graph
        # 1 - exp(-x) as tanh(x/2) (1 + exp(-x)): no cancellation for short steps
        share = g.put("Mul", g.put("Tanh", g.put("Mul", paces, 0.5)), g.add(1.0, g.put("Exp", g.put("Neg", paces))))
        before = self._memory.before()
        moved = g.add(before, g.put("Mul", share, g.put("Sub", signal, before)))
        after = g.choose(self._begun, moved, signal)
        self._memory.after.append(after)
        return after

    def _clock(self, tick: e.Node, interval: float) -> str:
        """Return a value that is updated at every tick: see `thermocomp.core.autoregressive`."""
        g, clock = self._graph, Clock(tick, interval)
        now = g.join([self.value(leaf) for leaf in clock.leaves])
        n, means = len(clock.leaves), clock.means
        past, kept, total, phase = (self._memory.before(k) for k in (clock.past, means * n, n, 1))
        first = g.join([now, *([np.zeros((means - 1) * n)] if means > 1 else [])])
        kept = g.choose(self._begun, kept, first)
        clocks = g.add(phase, self._dt)
        ticks = g.put("Floor", g.add(g.put("Div", clocks, interval), EARLY))
        trips = g.put("Cast", g.put("Min", ticks, float(MOST_TICKS)), to=_INT64)
        past, kept, total, _ = g.loop(trips, [past, kept, total, phase], self._body(clock, now))
        ticked = g.put("Greater", ticks, 0.0)
        left = g.between(g.put("Sub", clocks, g.put("Mul", ticks, interval)), -EARLY * interval, interval)
        phase = g.choose(ticked, left, clocks)
        total = g.add(total, g.put("Mul", g.choose(ticked, phase, self._dt), now))
        running = g.put("Greater", phase, 0.0)
        mean = g.choose(running, g.put("Div", total, g.choose(running, phase, 1.0)), now)
        self._memory.after += [past, kept, total, phase]
        last = g.pick(past, 0)
        ahead = g.put("Sub", _tick(g, clock, past, kept, mean), last)
        onward = g.add(last, g.put("Mul", g.put("Div", phase, interval), ahead))
        return g.choose(g.put("Greater", phase, EARLY * interval), onward, last)

    def _body(self, clock: Clock, now: str) -> Graph:
        """Return the graph of one tick."""
        g = Graph(self._graph)
        n, means = len(clock.leaves), clock.means
        g.enter(g.name(), (), np.int64)
        g.enter(g.name(), (), np.bool_)
        past, kept, total, phase = (g.enter(g.name(), (k,)) for k in (clock.past, means * n, n, 1))
        rest = g.put("Mul", g.put("Sub", clock.interval, phase), now)
        mean = g.put("Div", g.add(total, rest), clock.interval)
        new = g.join(
            [_tick(g, clock, past, kept, mean), *([g.part(past, 0, clock.past - 1)] if clock.past > 1 else [])]
        )
        seen = g.join([mean, *([g.part(kept, 0, (means - 1) * n)] if means > 1 else [])])
        # a settled value does not change any more
        moved = g.put("Abs", g.put("Sub", g.join([new, seen]), g.join([past, kept])))
        going = g.put("Squeeze", g.put("Greater", g.put("ReduceMax", moved, keepdims=1), 0.0))
        g.leave(g.name(), going, (), np.bool_)
        for value, size in ((new, clock.past), (seen, means * n)):
            g.leave(g.name(), value, (size,))
        g.leave(g.name(), g.constant(np.zeros(n)), (n,))
        g.leave(g.name(), g.constant(0.0), (1,))
        return g


#: `onnx.TensorProto.INT64`, without importing onnx
_INT64 = 7


def _tick(g: Graph, clock: Clock, past: str, kept: str, mean: str) -> str:
    """Return the next value of a recurrence."""
    places, known = {leaf: k for k, leaf in enumerate(clock.leaves)}, dict[e.Node, str]()

    def value(node: e.Node) -> str:
        match node:
            case e.Named(_, of):
                return value(of)
            case e.Past(ticks):
                return g.pick(past, ticks - 1)
            case e.Mean(of, 0):
                return g.pick(mean, places[of])
            case e.Mean(of, ticks):
                return g.pick(kept, (ticks - 1) * len(places) + places[of])
        if node not in known:
            known[node] = arithmetic(g, node, value)
        return known[node]

    return value(clock.tick)


def arithmetic(g: Graph, node: e.Node, value: Callable[[e.Node], str]) -> str:  # noqa: PLR0911 - one case per node type
    """Return the ONNX form of a node without memory; `value` names its parts."""
    match node:
        case e.Constant(number):
            return g.constant(float(number))
        case e.Clip(of, low, high):
            return g.between(value(of), float(low), float(high))
        case e.Sum(terms):
            return _sum(g, terms, value)
        case e.Difference(of, minus):
            return g.put("Sub", value(of), value(minus))
        case e.Product(factors):
            made = g.constant(1.0)
            for k, factor in enumerate(map(value, factors)):
                made = g.put("Mul", made, factor) if k else factor
            return made
        case e.Power(of, exponent):
            return g.put("Pow", value(of), float(exponent))
        case e.Magnitude(of):
            return g.put("Abs", value(of))
        case e.Sigmoid(of):
            return g.put("Div", 1.0, g.add(1.0, g.put("Exp", g.put("Neg", value(of)))))
        case e.Lookup(of, x, y, kind):
            return _look_up(g, value(of), np.array(x), np.array(y), steps=kind == "step")
    raise TypeError(f"{node}: {type(node).__name__} has no counterpart in an ONNX graph")


def _sum(g: Graph, terms: Sequence[e.Node], value: Callable[[e.Node], str]) -> str:
    """Return a sum; all terms with constant weights are computed together."""
    weights, weighted, others = list[float](), list[str](), list[str]()
    for term in terms:
        match term:
            case e.Product((e.Constant(weight), part)) if len(terms) > 2:
                weights.append(weight)
                weighted.append(value(part))
            case _:
                others.append(value(term))
    if weighted:
        others.append(g.put("ReduceSum", g.put("Mul", np.array(weights), g.join(weighted)), keepdims=1))
    return g.add(*others) if others else g.constant(0.0)


def _look_up(g: Graph, at: str, x: np.ndarray, y: np.ndarray, *, steps: bool) -> str:
    """Return the value of a tabulated function of one variable."""
    reached = g.put("Cast", g.put("LessOrEqual", x, at), to=_INT64)
    place = g.put("ReduceSum", reached, keepdims=1)
    if steps:
        return g.put("Gather", y, place, axis=0)
    slope = np.concatenate([[0.0], np.diff(y) / np.diff(x), [0.0]])
    begin, level = np.concatenate([x[:1], x]), np.concatenate([y[:1], y])
    away = g.put("Sub", at, g.put("Gather", begin, place, axis=0))
    rise = g.put("Mul", g.put("Gather", slope, place, axis=0), away)
    return g.add(g.put("Gather", level, place, axis=0), rise)
