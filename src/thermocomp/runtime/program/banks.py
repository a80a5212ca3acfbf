"""Lags and weighted sums of models as loops over tables: inputs, signals, time constants and coefficients, row by row.

All values that sums weigh are in one array, `term`: first the clipped inputs, then their lags, then all others. The
values of a model that do not fit are computed one by one (`thermocomp.runtime.program.models`).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from thermocomp.core import expression as e
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, expm1, let, procedure
from thermocomp.runtime.program.numbers import clip
from thermocomp.runtime.program.values import Condition, Whole, integer
from thermocomp.runtime.program.variables import Kept, Work

Lags = e.Lag | e.PacedLag


@procedure
def read_inputs(s: Kept, w: Work, t: Constants, first: Whole, end: Whole, at: Whole) -> None:
    """Take the inputs of the models, relative to their zero and clipped, as terms."""
    for k in each("k", first, end):
        g = let("g", t.input_range[k])
        w.term[at + k] = clip(w.input[t.channel[g]] - s.zero[g], t.input_low[k], t.input_high[k])


@procedure
def find_gains(s: Kept, w: Work, t: Constants, first: Whole, end: Whole) -> None:
    """Find the share of their way to the input that lags go in this step, from their time constants."""
    for k in each("k", first, end):
        rate = let("rate", 1.0 / t.tau_running[k] - 1.0 / t.tau_stopped[k])
        rate.set(1.0 / t.tau_stopped[k] + w.term[t.pace_term[k]] * rate)
        w.gain[k] = -expm1(-(w.step * rate))


@procedure
def advance_lags(s: Kept, w: Work, t: Constants, first: Whole, end: Whole, at: Whole, begun: Condition) -> None:
    """Advance the lags of the models by a step; they start at their inputs."""
    for k in each("k", first, end):
        signal = let("signal", w.term[t.lag_term[k]])
        s.lag[k] = choose(begun, s.lag[k] + w.gain[t.lag_pace[k]] * (signal - s.lag[k]), signal)
        w.term[at + k] = s.lag[k]


@procedure
def add_up(s: Kept, w: Work, t: Constants, first: Whole, end: Whole, term: Whole, last_term: Whole) -> None:
    """Add up the terms, weighted with the coefficients of each sum."""
    for m in each("m", first, end):
        w.total[m] = t.constant[m]
    for k in each("k", term, last_term):
        for m in each("m", first, end):
            w.total[m] = w.total[m] + t.coefficient[k, m] * w.term[k]


def stripped(node: e.Node) -> e.Node:
    """Return a node without a name or an exponent of 1."""
    return (
        stripped(node.of) if isinstance(node, e.Named) or (isinstance(node, e.Power) and node.exponent == 1) else node
    )


def _operands(node: e.Node) -> Iterator[e.Node]:
    """Yield the operands of a node; of a value updated at intervals those that are read at every step."""
    if isinstance(node, e.Recurrence):
        yield from (stripped(m.of) for m in e.walk_nodes(node.tick, (e.Mean,)) if isinstance(m, e.Mean))
    else:
        yield from map(stripped, e.children(node))


def weigh(node: e.Sum) -> tuple[float, dict[e.Node, float]]:
    """Return a sum as a constant and its other terms with their coefficients."""
    constant, weights = 0.0, dict[e.Node, float]()
    for term in map(stripped, node.terms):
        match term:
            case e.Constant(value):
                constant += value
                continue
            case e.Product((e.Constant(weight), of)):
                of = stripped(of)
            case _:
                weight, of = 1.0, term
        weights[of] = weights.get(of, 0.0) + weight
    return constant, weights


def _below(node: e.Node) -> Iterator[e.Node]:
    """Yield all nodes that a node depends on."""
    for part in _operands(node):
        yield part
        yield from _below(part)


def _pace(lag: Lags) -> tuple[float, float, e.Node | None]:
    """Return the time constants at a pace of 0 and of 1 [s], and the pace if they differ."""
    match lag:
        case e.Lag(_, tau):
            return tau, tau, None
        case e.PacedLag(_, stopped, running, pace):
            return stopped, running, stripped(pace)


class TableBank:
    """Values of the models of one function that are computed by loops over tables.

    Parameters
    ----------
    outputs : iterable of Node
        Formulas of the models, with inputs numbered like the ranges.
    before : sequence of TableBank
        Of the other functions: their rows come first in the tables.
    """

    def __init__(self, outputs: Iterable[e.Node], before: Sequence["TableBank"]) -> None:
        self._levels: dict[e.Node, int] = {}
        self.inputs, self.lags, self.sums = list[e.Clip](), list[Lags](), list[e.Sum]()
        outputs = list(map(stripped, outputs))
        stepped = [n for o in outputs for n in (o, *_below(o)) if isinstance(n, Lags | e.Recurrence)]
        self._lagged = {part for node in dict.fromkeys(stepped) for part in _below(node)}
        for node in outputs:
            self._level(node)
        known = {*self.inputs, *self.lags}
        self.signals = [n for n in dict.fromkeys(n for g in self.lags for n in _operands(g)) if n not in known]
        weighed = dict.fromkeys(n for total in self.sums for n in weigh(total)[1])
        self.others = [n for n in weighed if n not in {*known, *self.signals}]
        self.terms: list[e.Node] = [*self.inputs, *self.signals, *self.lags, *self.others]
        self.paces = list(dict.fromkeys(map(_pace, self.lags)))
        #: of each table the rows of this bank
        self.rows = {
            name: range(first := sum(len(getattr(b, name)) for b in before), first + len(getattr(self, name)))
            for name in ("inputs", "lags", "terms", "paces", "sums")
        }
        self.places = dict(zip(self.terms, self.rows["terms"], strict=True))

    def _level(self, node: e.Node) -> int:
        """Return when a value is known: 0 before the lags, 1 before the sums, 2 after them."""
        if (known := self._levels.get(node)) is not None:
            return known
        parts = list(_operands(node))
        levels = [self._level(p) for p in parts]
        level = max(levels, default=0)
        if isinstance(node, e.Clip) and isinstance(node.of, e.Input):
            self.inputs.append(node)
        elif isinstance(node, Lags) and max(levels[1:], default=0) == 0 and (level == 0 or parts[0] in self.lags):
            self.lags.append(node)
            level = 1
        elif isinstance(node, e.Sum) and level < 2 and node not in self._lagged and len(weigh(node)[1]) > 1:
            self.sums.append(node)
            level = 2
        self._levels[node] = level
        return level

    def record(self, begun: Condition, store: Callable[[Sequence[e.Node]], None]) -> None:
        """Record the loops over the tables.

        Parameters
        ----------
        begun : Condition
            The lags have started.
        store : callable
            Records the values of nodes that no loop computes, as terms.
        """
        s, w, t = Kept(), Work(), Constants()
        ends = {table: (integer(r.start), integer(r.stop)) for table, r in self.rows.items()}
        if self.inputs:
            read_inputs(s, w, t, *ends["inputs"], integer(self.places[self.inputs[0]] - self.rows["inputs"].start))
        store(self.signals)
        if self.lags:
            find_gains(s, w, t, *ends["paces"])
            at = integer(self.places[self.lags[0]] - self.rows["lags"].start)
            advance_lags(s, w, t, *ends["lags"], at, begun)
        store(self.others)
        if self.sums:
            add_up(s, w, t, *ends["sums"], *ends["terms"])

    def tables(self, all_sums: int) -> dict[str, list[Any]]:
        """Return the rows of the tables of this bank; a row of coefficients has a column for each of all sums."""
        paces = dict(zip(self.paces, self.rows["paces"], strict=True))
        sums = [weigh(total) for total in self.sums]
        left, right = [0.0] * self.rows["sums"].start, [0.0] * (all_sums - self.rows["sums"].stop)
        return {
            "input_range": [n.of.index for n in self.inputs if isinstance(n.of, e.Input)],
            "input_low": [n.low for n in self.inputs],
            "input_high": [n.high for n in self.inputs],
            "tau_stopped": [stopped for stopped, _, _ in self.paces],
            "tau_running": [running for _, running, _ in self.paces],
            "pace_term": [self.places[pace or self.terms[0]] for _, _, pace in self.paces],
            "lag_term": [self.places[stripped(lag.of)] for lag in self.lags],
            "lag_pace": [paces[_pace(lag)] for lag in self.lags],
            "constant": [constant for constant, _ in sums],
            "coefficient": [[*left, *(w.get(n, 0.0) for _, w in sums), *right] for n in self.terms],
        }


def join(banks: Sequence[TableBank]) -> tuple[dict[str, int], dict[str, list[Any]]]:
    """Return the sizes and tables of all banks."""
    count = {name: sum(len(rows) for b in banks if (rows := b.rows[name])) for name in banks[0].rows}
    tables = [b.tables(count["sums"]) for b in banks]
    sizes = {"INPUTS": "inputs", "TERMS": "terms", "BANKED": "lags", "PACES": "paces", "SUMS": "sums"}
    return (
        {name: count[table] for name, table in sizes.items()},
        {name: [row for t in tables for row in t[name]] for name in tables[0]},
    )
