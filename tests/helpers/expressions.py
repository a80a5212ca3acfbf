"""Computes what an expression says, reading by reading, in the plainest way: the oracle of `ErrorModel.expression`."""

import math
from collections.abc import Sequence

from thermocomp.core import expression as e


class Running:
    """An expression with its memory.

    Parameters
    ----------
    node : Node
    zero : sequence of float
        What the inputs are counted from.
    """

    def __init__(self, node: e.Node, zero: Sequence[float]) -> None:
        self.node, self.zero = node, list(zero)
        self.lags: dict[int, float] = {}
        self.clocks: dict[int, _Clock] = {}

    def step(self, values: Sequence[float], dt: float) -> float:
        """Take a reading in; return the value at its instant."""
        self.change = [v - z for v, z in zip(values, self.zero, strict=True)]
        self.dt, self.done = dt, dict[int, float]()
        return self.value(self.node)

    def value(self, node: e.Node) -> float:
        """Return the value of a part; a part that stands in several places is stepped once."""
        if id(node) not in self.done:
            self.done[id(node)] = self._value(node)
        return self.done[id(node)]

    def _value(self, node: e.Node) -> float:  # noqa: PLR0911, PLR0912 - a case for every kind of node
        match node:
            case e.Constant(number):
                return number
            case e.Input(index):
                return self.change[index]
            case e.Clip(of, low, high):
                return min(max(self.value(of), low), high)
            case e.Sum(terms):
                return sum(map(self.value, terms))
            case e.Difference(of, minus):
                return self.value(of) - self.value(minus)
            case e.Product(factors):
                return math.prod(map(self.value, factors))
            case e.Power(of, exponent):
                return float(self.value(of) ** exponent)
            case e.Magnitude(of):
                return abs(self.value(of))
            case e.Sigmoid(of):
                return 1.0 / (1.0 + math.exp(-self.value(of)))
            case e.Lookup(of, x, y, kind):
                return _curve(self.value(of), x, y, kind)
            case e.Named(_, of):
                return self.value(of)
            case e.Lag(of, tau):
                signal = self.value(of)
                before = self.lags.get(id(node), signal)
                self.lags[id(node)] = before + (1.0 - math.exp(-self.dt / tau)) * (signal - before)
                return self.lags[id(node)]
            case e.PacedLag(of, stopped, running, pace):
                signal, share = self.value(of), self.value(pace)
                rate = (1.0 - share) / stopped + share / running
                before = self.lags.get(id(node), signal)
                self.lags[id(node)] = before + (1.0 - math.exp(-self.dt * rate)) * (signal - before)
                return self.lags[id(node)]
            case e.Recurrence(tick, interval):
                return self.clocks.setdefault(id(node), _Clock(self, tick, interval)).step(self.dt)
        raise AssertionError(node)


class _Clock:
    """A recurrence: its own past, and the means of its inputs over the last intervals, newest first."""

    def __init__(self, running: Running, tick: e.Node, interval: float) -> None:
        self.running, self.tick, self.interval = running, tick, interval
        self.leaves: dict[e.Node, None] = {}
        self._find(tick)
        self.past, self.phase, self.begun = [0.0] * 60, 0.0, False
        self.total = dict.fromkeys(self.leaves, 0.0)
        self.means = {leaf: [0.0] * 60 for leaf in self.leaves}

    def _find(self, node: e.Node) -> None:
        match node:
            case e.Mean(of):
                self.leaves[of] = None
            case e.Sum(parts) | e.Product(parts):
                for part in parts:
                    self._find(part)
            case e.Sigmoid(of) | e.Named(_, of) | e.Clip(of):
                self._find(of)

    def step(self, dt: float) -> float:
        now = {leaf: self.running.value(leaf) for leaf in self.leaves}
        if not self.begun:
            self.begun, dt = True, 0.0
            for leaf, value in now.items():
                self.means[leaf][0] = value
        ticks = math.floor((self.phase + dt) / self.interval + 1e-6)
        for _ in range(ticks):
            left = self.interval - self.phase
            mean = {leaf: (self.total[leaf] + left * now[leaf]) / self.interval for leaf in now}
            self.past.insert(0, self._next(mean))
            for leaf, value in mean.items():
                self.means[leaf].insert(0, value)
            self.phase, dt, self.total = 0.0, dt - left, dict.fromkeys(now, 0.0)
        self.phase += dt
        self.total = {leaf: self.total[leaf] + dt * now[leaf] for leaf in now}
        if self.phase <= 1e-6 * self.interval:
            return self.past[0]
        ahead = self._next({leaf: total / self.phase for leaf, total in self.total.items()})
        return self.past[0] + self.phase / self.interval * (ahead - self.past[0])

    def _next(self, mean: dict[e.Node, float]) -> float:
        def value(node: e.Node) -> float:  # noqa: PLR0911
            match node:
                case e.Past(ticks):
                    return self.past[ticks - 1]
                case e.Mean(of, ticks):
                    return mean[of] if ticks == 0 else self.means[of][ticks - 1]
                case e.Constant(number):
                    return number
                case e.Sum(terms):
                    return sum(map(value, terms))
                case e.Product(factors):
                    return math.prod(map(value, factors))
                case e.Sigmoid(of):
                    return 1.0 / (1.0 + math.exp(-value(of)))
                case e.Named(_, of):
                    return value(of)
            raise AssertionError(node)

        return value(self.tick)


def _curve(at: float, x: Sequence[float], y: Sequence[float], kind: str) -> float:
    if kind == "step":
        return y[sum(b <= at for b in x)]
    if at <= x[0]:
        return y[0]
    for a, b, left, right in zip(x, x[1:], y, y[1:], strict=False):
        if at < b:
            return left + (right - left) * (at - a) / (b - a)
    return y[-1]
