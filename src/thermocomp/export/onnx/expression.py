"""The expression of a model as ONNX operators, and its memory between two calls."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from thermocomp.core import expression as e
from thermocomp.core.curves import Curve
from thermocomp.core.recurrences import Clock
from thermocomp.core.ticker import EARLY
from thermocomp.export.onnx.nodes import BOOL, INT64, Graph

#: largest number of ticks in one call (0.6 s of computing time): a model with roots below 0.9997 has settled by then
MOST_TICKS = 100_000


class Walk:
    """Converter of the expressions of a model; a repeated node is converted once.

    Parameters
    ----------
    change : sequence of str
        Inputs minus their zero, clipped to the trained range.
    begun : str
        Whether there was an earlier reading.
    dt : str
        Time since it [s]; 0 without one.
    state : str
        Incoming state.
    size : int
        First element of the memory in it.
    """

    def __init__(self, graph: Graph, change: Sequence[str], begun: str, dt: str, state: str, size: int) -> None:
        self._graph, self._change, self._begun, self._dt, self._state = graph, change, begun, dt, state
        self._known: dict[e.Node, str] = {}
        self.size = size  #: elements of the state
        self.memory: list[str] = []  #: new values, in the order of the memory

    def value(self, node: e.Node) -> str:
        """Return the name of a node's value."""
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
                return self._clock(Clock(tick, interval))
        return _arithmetic(g, node, self.value)

    def _before(self, begin: str, size: int = 1) -> str:
        """Return the next elements of the memory; at the start, their initial values."""
        self.size += size
        return self._graph.choose(self._begun, self._graph.pick(self._state, range(self.size - size, self.size)), begin)

    def _lag(self, signal: str, paces: str) -> str:
        g, before = self._graph, self._before(signal)
        # 1 - exp(-x) as tanh(x/2) (1 + exp(-x)): no cancellation for short steps
        share = g.put("Mul", g.put("Tanh", g.put("Mul", paces, 0.5)), g.add(1.0, g.put("Exp", g.put("Neg", paces))))
        self.memory.append(g.add(before, g.put("Mul", share, g.put("Sub", signal, before))))
        return self.memory[-1]

    def _clock(self, clock: Clock) -> str:
        """Return a value that is updated at every tick: see `thermocomp.core.ticker`, also for its memory."""
        g, interval, n, k = self._graph, clock.interval, len(clock.leaves), clock.past
        m = max((p.ticks for p in e.walk_nodes(clock.tick, (e.Mean,)) if isinstance(p, e.Mean)), default=0)
        now = g.join([self.value(leaf) for leaf in clock.leaves])
        rest = g.constant(np.zeros(1 + n + k))
        held = self._before(g.join([rest, now, np.zeros((m - 1) * n)]) if m else rest, 1 + n + k + m * n)
        ends = np.cumsum([0, 1, n, k, m * n]).tolist()
        phase, total, own, past = (g.pick(held, range(a, b)) for a, b in pairwise(ends))
        clocks = g.add(phase, self._dt)
        ticks = g.put("Floor", g.add(g.put("Div", clocks, interval), EARLY))
        left = g.put("Mul", g.put("Sub", interval, phase), now)
        mean = g.put("Div", g.add(total, left), interval)  # over the interval that ends at the first tick
        trips = g.put("Cast", g.put("Min", ticks, float(MOST_TICKS)), to=INT64)
        held = g.put("Loop", trips, "", g.join([own, mean, past]), body=_body(g, clock, now, m * n).proto("body"))
        own, past = g.pick(held, range(k)), g.pick(held, range(k + n, k + n + m * n))
        ticked = g.put("Greater", ticks, 0.0)
        left = g.between(g.put("Sub", clocks, g.put("Mul", ticks, interval)), -EARLY * interval, interval)
        phase = g.choose(ticked, left, clocks)
        total = g.add(g.choose(ticked, 0.0, total), g.put("Mul", g.choose(ticked, phase, self._dt), now))
        self.memory += [phase, total, own, past]
        runs, last = g.put("Greater", phase, EARLY * interval), g.pick(own, [0])
        mean = g.put("Div", total, g.choose(runs, phase, 1.0))
        ahead = g.put("Sub", _tick(g, clock, g.join([own, mean, past])), last)
        return g.choose(runs, g.add(last, g.put("Mul", g.put("Div", phase, interval), ahead)), last)


def _body(outer: Graph, clock: Clock, now: str, kept: int) -> Graph:
    """Return the graph of one tick; its variable holds the last values, the mean of the inputs and `kept` earlier ones.

    Parameters
    ----------
    now : str
        Inputs: their mean over the next interval.
    """
    g, k = Graph(outer), clock.past
    g.enter(g.name(), (), INT64)
    g.enter(g.name(), (), BOOL)
    size = k + len(clock.leaves) + kept
    held = g.enter(g.name(), (size,))
    new = g.join([_tick(g, clock, held), g.pick(held, range(k - 1)), now, g.pick(held, range(k, k + kept))])
    moved = g.put("ReduceMax", g.put("Abs", g.put("Sub", new, held)), keepdims=1)
    going = g.put("Squeeze", g.put("Greater", moved, 0.0))  # a settled value does not change any more
    g.leave(g.name(), going, (), BOOL)
    g.leave(g.name(), new, (size,))
    return g


def _tick(g: Graph, clock: Clock, held: str) -> str:
    """Return the next value of a recurrence from its last values and the means of its inputs, newest first."""
    places, known = {leaf: k for k, leaf in enumerate(clock.leaves)}, dict[e.Node, str]()

    def value(node: e.Node) -> str:
        if node not in known:
            match node:
                case e.Past(ticks):
                    known[node] = g.pick(held, [ticks - 1])
                case e.Mean(of, ticks):
                    known[node] = g.pick(held, [clock.past + ticks * len(places) + places[of]])
                case _:
                    known[node] = _arithmetic(g, node, value)
        return known[node]

    return value(clock.tick)


def _arithmetic(g: Graph, node: e.Node, value: Callable[[e.Node], str]) -> str:  # noqa: PLR0911 - a case per node type
    """Return the ONNX form of a node without memory; `value` names its parts."""
    match node:
        case e.Constant(number):
            return g.constant(float(number))
        case e.Named(_, of):
            return value(of)
        case e.Clip(of, low, high):
            return g.between(value(of), float(low), float(high))
        case e.Sum(terms):
            return g.add(*map(value, terms)) if terms else g.constant(0.0)
        case e.Difference(of, minus):
            return g.put("Sub", value(of), value(minus))
        case e.Product(factors):
            made, *others = map(value, factors) if factors else [g.constant(1.0)]
            for factor in others:
                made = g.put("Mul", made, factor)
            return made
        case e.Power(of, exponent):
            return g.put("Pow", value(of), float(exponent))
        case e.Magnitude(of):
            return g.put("Abs", value(of))
        case e.Sigmoid(of):
            return g.put("Div", 1.0, g.add(1.0, g.put("Exp", g.put("Neg", value(of)))))
        case e.Lookup(of, x, y, kind):
            return _look_up(g, value(of), Curve(x, y, kind))
    raise TypeError(f"{node}: {type(node).__name__} has no counterpart in an ONNX graph")


def _look_up(g: Graph, at: str, curve: Curve) -> str:
    """Return the value of a tabulated function of one variable."""
    breaks, *pieces = curve.pieces
    place = g.put("ReduceSum", g.put("Cast", g.put("LessOrEqual", breaks, at), to=INT64), keepdims=1)
    value, slope, left = (g.put("Gather", table, place, axis=0) for table in pieces)
    return g.add(value, g.put("Mul", slope, g.put("Sub", at, left)))
