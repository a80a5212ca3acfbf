"""The expression of a model as statements of C99: one local constant per part, states in a struct."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from thermocomp.core import expression as e

#: functions that look a value up in a table
_LOOKUPS = {"linear": "linear", "step": "stairs"}


@dataclass
class Written:
    """Statements that work trees out, and what they remember.

    Parameters
    ----------
    channels : sequence of int
        Of the inputs: which of the values that are read each of them is.
    lines : list of str
        Of the body, in order.
    lags : int
        How many lags there are: ``s->lag[k]``.
    clocks : list of Clock
        Of the recurrences.
    tables : list of Lookup
        ``table0_x`` and ``table0_y``, and so on.
    """

    channels: Sequence[int]
    lines: list[str] = field(default_factory=list)
    lags: int = 0
    clocks: list["Clock"] = field(default_factory=list)
    tables: list[e.Lookup] = field(default_factory=list)
    _known: dict[e.Node, str] = field(default_factory=dict, init=False, repr=False)
    _gains: dict[str, str] = field(default_factory=dict, init=False, repr=False)

    def take_lines(self) -> list[str]:
        """Return the statements so far; the next trees are worked out in a function of their own."""
        lines, self.lines, self._known, self._gains = self.lines, [], {}, {}
        return lines

    def value(self, node: e.Node) -> str:
        """Return the name of what a part says; a part that stands in several places is worked out once."""
        if isinstance(node, e.Named):
            return self.value(node.of)
        if isinstance(node, e.Constant):
            return number(node.value)
        if (known := self._known.get(node)) is None:
            known = self._known[node] = self._add(self._text(node))
        return known

    def _add(self, text: str) -> str:
        name = f"v{len(self._known)}"
        self.lines.append(f"const tc_real {name} = {text};")
        return name

    def _text(self, node: e.Node) -> str:
        match node:
            case e.Input(index):
                return f"w->input[{self.channels[index]}] - s->zero[{index}]"
            case e.Lag(of, tau):
                return self._lag(self.value(of), f"dt / {number(tau)}")
            case e.PacedLag(of, stopped, running, pace):
                signal, share = self.value(of), self.value(pace)
                gain = 1.0 / running - 1.0 / stopped
                return self._lag(signal, f"dt * ({number(1.0 / stopped)} + {share} * {number(gain)})")
            case e.Recurrence(tick, interval):
                clock = Clock.of(len(self.clocks), tick, interval)
                self.clocks.append(clock)
                now = ", ".join(map(self.value, clock.leaves))
                self.lines.append(f"const tc_real now{clock.index}[{len(clock.leaves)}] = {{{now}}};")
                return f"clock{clock.index}_step(&s->clock{clock.index}, now{clock.index}, dt, begun)"
            case e.Lookup(of, x, _, kind):
                place = len(self.tables)
                self.tables.append(node)
                return f"tc_{_LOOKUPS[kind]}({self.value(of)}, table{place}_x, table{place}_y, {len(x)})"
        return arithmetic(node, self.value)

    def _lag(self, signal: str, paces: str) -> str:
        place, self.lags = self.lags, self.lags + 1
        if paces not in self._gains:
            self._gains[paces] = f"gain{len(self._gains)}"
            self.lines.append(f"const tc_real {self._gains[paces]} = -TC_MATH(expm1)(-({paces}));")
        return f"tc_lag(&s->lag[{place}], {signal}, {self._gains[paces]}, begun)"


@dataclass
class Clock:
    """A value that is made anew at every tick of a clock of its own: see `thermocomp.core.expression.Recurrence`.

    Parameters
    ----------
    index : int
    tick : Node
    interval : float
        [s]
    leaves : dict of Node to None
        What it takes means of.
    past, means : int
        How many ticks back it looks at itself, and at the means.
    """

    index: int
    tick: e.Node
    interval: float
    leaves: dict[e.Node, None]
    past: int = 1
    means: int = 0

    def __post_init__(self) -> None:
        for node in walk(self.tick):
            if isinstance(node, e.Past):
                self.past = max(self.past, node.ticks)
            if isinstance(node, e.Mean):
                self.means = max(self.means, node.ticks)

    @classmethod
    def of(cls, index: int, tick: e.Node, interval: float) -> "Clock":
        """Return the clock of a recurrence."""
        leaves = {n.of: None for n in walk(tick) if isinstance(n, e.Mean)}
        return cls(index, tick, interval, leaves or {e.Constant(0.0): None})

    def statements(self) -> list[str]:
        """Return the statements that work a tick out of ``mean``, ``s->mean`` and ``s->past``."""
        lines, known, places = list[str](), dict[e.Node, str](), {leaf: k for k, leaf in enumerate(self.leaves)}

        def value(node: e.Node) -> str:
            match node:
                case e.Named(_, of):
                    return value(of)
                case e.Constant(constant):
                    return number(constant)
                case e.Past(ticks):
                    return f"s->past[{ticks - 1}]"
                case e.Mean(of, 0):
                    return f"mean[{places[of]}]"
                case e.Mean(of, ticks):
                    return f"s->mean[{ticks - 1}][{places[of]}]"
            if node not in known:
                text = arithmetic(node, value)  # first what it is made of
                known[node] = f"v{len(known)}"
                lines.append(f"const tc_real {known[node]} = {text};")
            return known[node]

        said = value(self.tick)
        return [*lines, f"return {said};"]


def arithmetic(node: e.Node, value: Callable[[e.Node], str]) -> str:  # noqa: PLR0911 - a case for every kind of node
    """Return what a part without memory is, its parts being named by `value`."""
    match node:
        case e.Clip(of, low, high):
            return f"tc_clip({value(of)}, {number(low)}, {number(high)})"
        case e.Sum(terms):
            return " + ".join(map(value, terms)) or number(0.0)
        case e.Difference(of, minus):
            return f"{value(of)} - {value(minus)}"
        case e.Product(factors):
            return " * ".join(map(value, factors)) or number(1.0)
        case e.Power(of, exponent):
            return f"TC_MATH(pow)({value(of)}, {number(exponent)})"
        case e.Magnitude(of):
            return f"TC_MATH(fabs)({value(of)})"
        case e.Sigmoid(of):
            return f"{number(1.0)} / ({number(1.0)} + TC_MATH(exp)(-{value(of)}))"
    raise TypeError(f"{node}: no part of a formula")


def number(value: float) -> str:
    """Return a number as C writes it: in parentheses where it is negative, exact in double precision."""
    if not math.isfinite(value):
        raise ValueError(f"{value}: is not finite")
    text = repr(float(value))
    return f"TC({text})" if value >= 0 else f"(-TC({text[1:]}))"


def walk(node: e.Node) -> Iterator[e.Node]:
    """Give a part and all that it is made of, what a `Mean` is of excepted."""
    yield node
    match node:
        case e.Sum(parts) | e.Product(parts):
            inner: tuple[e.Node, ...] = parts
        case e.Sigmoid(of) | e.Named(_, of) | e.Clip(of) | e.Magnitude(of) | e.Power(of) | e.Lookup(of):
            inner = (of,)
        case e.Difference(of, minus):
            inner = (of, minus)
        case _:
            inner = ()
    for part in inner:
        yield from walk(part)
