"""Expressions compiled to array operations: the same for one reading or many, for one model or several.

Equal nodes are computed once. Sums are linear forms of other values; values of one kind that depend on equally many
others are computed by one operation on an array, a layer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core import expression as e
from thermocomp.core.arrays import FloatArray
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.forms import Form, Forms, add_forms
from thermocomp.core.operations import IntArray, Lags, Layer, Ticks
from thermocomp.core.recurrences import Clock
from thermocomp.core.ticker import Ticker

#: number of values computed at once: they fit into the cache of a processor
BLOCK = 2**17


@dataclass(frozen=True)
class _Slot:
    """A value that has no position in the arrays yet."""

    level: int
    kind: str
    operands: tuple[Form, ...]
    numbers: tuple[float, ...] = ()
    curve: Curve | None = None
    node: e.Lag | e.PacedLag | e.Recurrence | None = None  #: the node, if it has a memory


_WORK: dict[str, Callable[..., FloatArray]] = {
    "linear": lambda of: of,
    "product": lambda *of: np.multiply.reduce(of),
    "magnitude": np.abs,
    "sigmoid": lambda of: 0.5 + 0.5 * np.tanh(0.5 * of),
}


class Layers:
    """Expressions compiled to layers.

    Parameters
    ----------
    outputs : sequence of Node
    n_inputs : int
        Number of inputs; the leaves of the expressions are inputs.
    first : sequence of Node
        Nodes with a memory in the order of the memory; others follow in the order of the outputs.
    """

    def __init__(self, outputs: Sequence[e.Node], n_inputs: int, first: Sequence[e.Node] = ()) -> None:
        self.n_inputs = n_inputs
        builder = _Builder(n_inputs)
        for node in first:
            builder.form(node)
        forms = [builder.form(node) for node in outputs]
        places, self._layers, self.n_memory = builder.lay()
        #: nodes with a memory, in its order
        self.remembered = builder.remembered
        self._forms = [f.moved(places) for f in forms]
        self._outputs = Forms(self._forms, builder.exact)
        self._n = n_inputs + len(places)

    @property
    def linear(self) -> list[tuple[FloatArray, float]]:
        """Weights, (n_inputs,), and constant of each output if all are linear forms of the inputs; else empty."""
        if self._layers:
            return []
        found = []
        for form in self._forms:
            weights = np.zeros(self.n_inputs)
            for k, w in form.weights:
                weights[k] = w
            found.append((weights, form.constant))
        return found

    def begin(self, change: FloatArray) -> FloatArray:
        """Return the memory, (..., n_memory), of a machine at steady state for `change`, (..., n_inputs)."""
        memory = np.empty((*change.shape[:-1], self.n_memory))
        self._run(memory, change, np.inf)
        return memory

    def begin_at(self, change: FloatArray, value: FloatArray) -> FloatArray:
        """Return the memory of a machine at steady state for `change`, with known values of its recurrences, (...)."""
        memory = self.begin(change)
        for layer in self._layers:
            if isinstance(layer, Ticks):
                values = self._run(memory.copy(), change, np.inf)
                memory[..., layer.memory] = layer.ticker.begin_at(value, layer.inputs.evaluate(values))
        return memory

    def advance(self, memory: FloatArray, change: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return the memory `dt` seconds later, at the inputs `change`, and the outputs, (..., n_outputs)."""
        if memory.shape[:-1] != change.shape[:-1]:  # one state for many readings, or many for one
            shape = np.broadcast_shapes(memory.shape[:-1], change.shape[:-1])
            memory = np.broadcast_to(memory, (*shape, self.n_memory))
            change = np.broadcast_to(change, (*shape, self.n_inputs))
        memory = memory.copy()
        return memory, self._outputs.evaluate(self._run(memory, change, dt))

    def run(self, memory: FloatArray, changes: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Advance the memory through readings, one after another; `advance` with the loop over time inside the layers.

        Parameters
        ----------
        memory : ndarray of shape (..., n_memory)
        changes : ndarray of shape (n_readings, ..., n_inputs)
        steps : ndarray of shape (n_readings,)
            Time since the previous reading [s].

        Returns
        -------
        memory : ndarray of shape (..., n_memory)
            After the last reading.
        outputs : ndarray of shape (n_readings, ..., n_outputs)
        """
        memory, found = memory.copy(), np.empty((*changes.shape[:-1], len(self._forms)))
        each = max(1, BLOCK // max(1, int(np.prod(changes.shape[1:-1])) * self._n))
        for k in range(0, len(changes), each):
            part = changes[k : k + each]
            values = np.empty((*part.shape[:-1], self._n))
            values[..., : self.n_inputs] = part
            for layer in self._layers:
                layer.follow(values, memory, steps[k : k + each])
            found[k : k + each] = self._outputs.evaluate(values)
        return memory, found

    def _run(self, memory: FloatArray, change: FloatArray, dt: float) -> FloatArray:
        """Advance `memory` in place by one time step; return the values of all slots."""
        values = np.empty((*change.shape[:-1], self._n))
        values[..., : self.n_inputs] = change
        for layer in self._layers:
            layer.advance(values, memory, dt)
        return values


class _Builder:
    """Builder of layers: collects the values of expressions, each once, in the order of their computation."""

    def __init__(self, n_inputs: int) -> None:
        self._n_inputs = n_inputs
        self._slots: dict[_Slot, int] = {}
        self._levels = [0] * n_inputs
        self._forms: dict[int, tuple[e.Node, Form]] = {}  #: by identity of the node, which is kept alive

    def form(self, node: e.Node) -> Form:
        """Return the linear form of slots that computes a node of an expression."""
        known = self._forms.get(id(node))
        if known is None:
            known = self._forms[id(node)] = node, self._new_form(node)
        return known[1]

    def _new_form(self, node: e.Node) -> Form:  # noqa: PLR0911, PLR0912 - one case per node type
        match node:
            case e.Constant(value):
                return Form((), value)
            case e.Input(index):
                return Form(((index, 1.0),), 0.0)
            case e.Named(_, of):
                return self.form(of)
            case e.Sum(terms):
                return add_forms([self.form(t) for t in terms])
            case e.Difference(of, minus):
                return add_forms([self.form(of), self.form(minus).scaled(-1.0)])
            case e.Product(factors):
                forms = [self.form(f) for f in factors]
                factor = float(np.prod([f.constant for f in forms if not f.weights]))
                others = [f for f in forms if f.weights]
                if not others:
                    return Form((), factor)
                own = others[0] if len(others) == 1 else self._value("product", *others)
                return own.scaled(factor)
            case e.Power(of, exponent):
                return self._value("power", self.form(of), numbers=(exponent,))
            case e.Magnitude(of):
                return self._value("magnitude", self.form(of))
            case e.Sigmoid(of):
                return self._value("sigmoid", self.form(of))
            case e.Clip(of, low, high):
                return self._value("clip", self.form(of), numbers=(low, high))
            case e.Lookup(of, x, y, kind):
                return self._value("curve", self.form(of), curve=Curve(x, y, kind))
            case e.Lag(of, tau):
                return self._value("lag", self.form(of), numbers=(1.0 / tau, 0.0), node=node)
            case e.PacedLag(of, stopped, running, pace):
                numbers = (1.0 / stopped, 1.0 / running - 1.0 / stopped)
                return self._value("paced", self.form(of), self.form(pace), numbers=numbers, node=node)
            case e.Recurrence(tick, interval):
                inputs = [self.form(leaf) for leaf in Clock(tick, interval).leaves]
                return self._value("recurrence", *inputs, node=node)
        raise InputError(
            f"{node!r} cannot be evaluated: {type(node).__name__} is not a node of thermocomp.core.expression"
        )

    def _value(
        self,
        kind: str,
        *operands: Form,
        numbers: tuple[float, ...] = (),
        curve: Curve | None = None,
        node: e.Lag | e.PacedLag | e.Recurrence | None = None,
    ) -> Form:
        """Return the linear form of the slot in which a node's value is computed."""
        if kind not in ("linear", "recurrence"):
            operands = tuple(self._single(f) for f in operands)
        level = 1 + max((self._levels[k] for f in operands for k, _ in f.weights), default=0)
        slot = _Slot(level=level, kind=kind, operands=operands, numbers=numbers, curve=curve, node=node)
        if slot not in self._slots:
            self._slots[slot] = len(self._levels)
            self._levels.append(level)
        return Form(((self._slots[slot], 1.0),), 0.0)

    def _single(self, form: Form) -> Form:
        """Return a form of a single slot; the result of a form of several slots becomes a new slot."""
        return form if len(form.weights) == 1 else self._value("linear", form)

    @property
    def exact(self) -> bool:
        """True if the values include curves, which may have steps."""
        return any(s.curve is not None for s in self._slots)

    def lay(self) -> tuple[list[int], list[Layer | Lags | Ticks], int]:
        """Return the position of each slot, the layers in the order of computation, and the number of lags."""
        groups: dict[tuple[object, ...], list[_Slot]] = {}
        for slot in sorted(self._slots, key=lambda s: s.level):
            key = (
                slot.level,
                slot.kind,
                len(slot.operands),
                slot.curve,
                slot.node if slot.kind == "recurrence" else None,
            )
            groups.setdefault(key, []).append(slot)
        places = list(range(self._n_inputs)) + [0] * len(self._slots)
        begin = self._n_inputs
        for members in groups.values():
            for k, slot in enumerate(members):
                places[self._slots[slot]] = begin + k
            begin += len(members)
        tickers = {s: _ticker(s.node) for s in self._slots if isinstance(s.node, e.Recurrence)}
        kept = [s for s in self._slots if s.node is not None]  # in the order of their first use
        self.remembered = tuple(s.node for s in kept if s.node is not None)
        ends = np.cumsum([0, *(tickers[s].n_memory if s in tickers else 1 for s in kept)])
        begin_of = dict(zip(kept, ends.tolist(), strict=False))
        layers = list[Layer | Lags | Ticks]()
        for members in groups.values():
            first = places[self._slots[members[0]]]
            own = slice(first, first + len(members))
            if (ticker := tickers.get(members[0])) is not None:
                (slot,) = members
                inputs = Forms([f.moved(places) for f in slot.operands], self.exact)
                memory = slice(begin_of[slot], begin_of[slot] + ticker.n_memory)
                layers.append(Ticks(own, memory, inputs, ticker))
                continue
            operands = tuple(
                Forms([f.moved(places) for f in column], self.exact)
                for column in zip(*(s.operands for s in members), strict=True)
            )
            numbers = np.array([s.numbers for s in members]).T
            if (kind := members[0].kind) in ("lag", "paced"):
                rest, gain = numbers
                paces = operands[1] if kind == "paced" else None
                where = _places([begin_of[s] for s in members])
                layers.append(Lags(slots=own, memory=where, signals=operands[0], rest=rest, gain=gain, paces=paces))
            else:
                layers.append(Layer(own, operands, _work_of(members[0], numbers)))
        return places, layers, int(ends[-1])


def _places(found: list[int]) -> slice | IntArray:
    """Return positions in the memory, as a slice if they are adjacent."""
    adjacent = found == list(range(found[0], found[0] + len(found)))
    return slice(found[0], found[0] + len(found)) if adjacent else np.array(found, dtype=np.intp)


def _work_of(slot: _Slot, numbers: FloatArray) -> Callable[..., FloatArray]:
    """Return the array function that computes a layer."""
    if slot.kind == "power":
        (exponents,) = numbers
        return np.square if (exponents == 2).all() else lambda of: of**exponents
    if slot.kind == "clip":
        low, high = numbers
        return lambda of: np.minimum(np.maximum(of, low), high)
    if slot.curve is not None:
        return slot.curve
    return _WORK[slot.kind]


def _ticker(node: e.Recurrence) -> Ticker:
    parts = list(e.walk_nodes(node.tick, (e.Mean,)))
    leaves = Clock(node.tick, node.interval).leaves
    k = max((p.ticks for p in parts if isinstance(p, e.Past)), default=0)
    m, n = max((p.ticks for p in parts if isinstance(p, e.Mean)), default=0), len(leaves)
    tick = Layers([_regressed(node.tick, k, leaves)], k + (m + 1) * n)
    nothing = np.empty(0)
    linear = tick.linear[0] if tick.linear else None
    return Ticker(
        lambda given: tick.advance(nothing, given, 0.0)[1][..., 0],
        linear,
        interval=node.interval,
        k=k,
        m=m,
        n_inputs=n,
    )


def _regressed(node: e.Node, k: int, leaves: Sequence[e.Node]) -> e.Node:
    """Return the expression of a tick with its past values and means as inputs."""

    def leaf(node: e.Node) -> e.Node | None:
        match node:
            case e.Past(ticks):
                return e.Input(ticks - 1, "")
            case e.Mean(of, ticks):
                return e.Input(k + ticks * len(leaves) + leaves.index(of), "")
        return None

    return e.replace_leaves(node, leaf)
