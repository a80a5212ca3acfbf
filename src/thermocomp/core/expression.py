"""Expression of a frozen model as a small tree: the printed formula and all exports use it, independent of the family.

The leaves are the inputs minus their reference values. A tree represents the model within its trained range: inputs are
clipped to that range, widened by the margin; the effect of `Support` beyond it (``hold``, ``fade``) is not included.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from thermocomp.core.exceptions import InputError


@dataclass(frozen=True)
class Constant:
    """A constant number in an expression."""

    value: float


@dataclass(frozen=True)
class Input:
    """Model input relative to its reference value [unit of the input].

    Parameters
    ----------
    index : int
        Position in ``ErrorModel.inputs``.
    name : str
    """

    index: int
    name: str


@dataclass(frozen=True)
class Clip:
    """An expression clipped to a lower and an upper bound."""

    of: "Node"
    low: float
    high: float


@dataclass(frozen=True)
class Sum:
    """The sum of its terms; 0 if there are none."""

    terms: tuple["Node", ...]


@dataclass(frozen=True)
class Difference:
    """Difference of two expressions."""

    of: "Node"
    minus: "Node"


@dataclass(frozen=True)
class Product:
    """The product of its factors; 1 if there are none."""

    factors: tuple["Node", ...]


@dataclass(frozen=True)
class Power:
    """A value raised to a power; the value is not negative if the exponent is not an integer."""

    of: "Node"
    exponent: float


@dataclass(frozen=True)
class Magnitude:
    """Absolute value of an expression."""

    of: "Node"


@dataclass(frozen=True)
class Sigmoid:
    """1 / (1 + exp(-value)) (C-25)."""

    of: "Node"


@dataclass(frozen=True)
class Lookup:
    """A function of one value, constant beyond its ends; see `thermocomp.core.additive.Curve`.

    Parameters
    ----------
    of : Node
    x, y : tuple of float
    kind : {'linear', 'step'}
    name : str
        Name in the formula, such as ``phi1``.
    """

    of: "Node"
    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: Literal["linear", "step"]
    name: str


@dataclass(frozen=True)
class Lag:
    """A first-order lag: tau dx/dt = value - x; the value is constant over a step, and the lag starts at steady state.

    Parameters
    ----------
    of : Node
    time_constant : float
        tau [s].
    """

    of: "Node"
    time_constant: float


@dataclass(frozen=True)
class PacedLag:
    """A first-order lag with 1/tau = (1 - pace)/stopped + pace/running; the pace is a fraction of the top speed.

    Parameters
    ----------
    of : Node
    stopped, running : float
        Time constants at a pace of 0 and of 1 [s].
    pace : Node
        Value at the end of the step.
    """

    of: "Node"
    stopped: float
    running: float
    pace: "Node"


@dataclass(frozen=True)
class Past:
    """Value of a `Recurrence` a number of ticks ago; 1 is the last tick."""

    ticks: int


@dataclass(frozen=True)
class Mean:
    """Mean of a value over the interval that ended a number of ticks ago, in a `Recurrence`; 0: the one that ends now.

    A reading is assigned to the time since the previous one. The value before the first reading is 0, except at the
    start.
    """

    of: "Node"
    ticks: int


@dataclass(frozen=True)
class Recurrence:
    """A value that is updated at fixed intervals (ticks); see `thermocomp.core.autoregressive`.

    Between ticks it is interpolated linearly towards the next value at the mean of the inputs since the last tick.

    Parameters
    ----------
    tick : Node
        Expression with `Past` and `Mean` among its leaves.
    interval : float
        Time between two ticks [s].
    """

    tick: "Node"
    interval: float


@dataclass(frozen=True)
class Named:
    """A subexpression with a separate name in the printed formula, such as ``T6-T7``."""

    name: str
    of: "Node"


Node = (
    Constant
    | Input
    | Clip
    | Sum
    | Difference
    | Product
    | Power
    | Magnitude
    | Sigmoid
    | Lookup
    | Lag
    | PacedLag
    | Past
    | Mean
    | Recurrence
    | Named
)


def scale_node(factor: float, of: Node) -> Node:
    """Return an expression multiplied by a number."""
    return of if factor == 1.0 else Product((Constant(factor), of))


def sum_weighted(weights: Sequence[float], of: Sequence[Node], constant: float = 0.0) -> Node:
    """Return the weighted sum of nodes plus a constant; terms with zero weight are omitted."""
    found: list[Node] = [Constant(constant)] if constant else []
    found += [Product((Constant(w), x)) for w, x in zip(weights, of, strict=True) if w != 0]
    return Sum(tuple(found))


def children(node: Node) -> tuple[Node, ...]:
    """Return the operands of an expression."""
    match node:
        case Constant() | Input() | Past():
            return ()
        case Sum(parts) | Product(parts):
            return parts
        case Difference(of, minus):
            return (of, minus)
        case PacedLag(of, pace=pace):
            return (of, pace)
        case Recurrence(tick):
            return (tick,)
    return (node.of,)


def walk_nodes(node: Node, leaves: tuple[type, ...] = ()) -> Iterator[Node]:
    """Yield a node and all its descendants, without those of nodes of the types `leaves`."""
    yield node
    if not isinstance(node, leaves):
        for part in children(node):
            yield from walk_nodes(part, leaves)


def replace_leaves(node: Node, leaf: Callable[[Node], Node | None]) -> Node:
    """Return a tree in which each node for which `leaf` returns another one is replaced by it."""
    if (found := leaf(node)) is not None:
        return found
    match node:
        case Sum(terms):
            return Sum(tuple(replace_leaves(t, leaf) for t in terms))
        case Product(factors):
            return Product(tuple(replace_leaves(f, leaf) for f in factors))
        case Difference(of, minus):
            return Difference(replace_leaves(of, leaf), replace_leaves(minus, leaf))
        case Sigmoid() | Named() | Clip() | Magnitude() | Power() | Lookup():
            return replace(node, of=replace_leaves(node.of, leaf))
    return node


def format_node(node: Node) -> str:  # noqa: PLR0911, PLR0912 - a case for every kind of node
    """Return a tree as one line of text, such as ``1.5 T1 - 0.5 lag(T1, 10 min) + 4e-07 n*n``.

    Parameters
    ----------
    node : Node

    Returns
    -------
    str
    """
    match node:
        case Constant(value):
            return f"{value:.6g}"
        case Input(_, name) | Named(name, _):
            return name
        case Clip(of):
            return format_node(of)
        case Sum(terms):
            return _sum(terms)
        case Difference(of, minus):
            return f"{format_node(of)}-{_bracketed(minus)}"
        case Product((Constant(value), *others)) if others:
            return f"{value:.6g} {_product(others)}"
        case Product(factors):
            return _product(factors)
        case Power(of, exponent) if exponent == int(exponent):
            return "*".join([_bracketed(of)] * int(exponent))
        case Power(of, exponent):
            return f"{_bracketed(of)}^{exponent:.4g}"
        case Magnitude(of):
            return f"|{format_node(of)}|"
        case Sigmoid(of):
            return f"sigmoid({format_node(of)})"
        case Lookup(of, name=name):
            return f"{name}({format_node(of)})"
        case Lag(of, tau):
            return f"lag({format_node(of)}, {tau / 60:.4g} min)"
        case PacedLag(of, stopped, running):
            return f"lag({format_node(of)}, {stopped / 60:.4g} to {running / 60:.4g} min)"
        case Past(ticks):
            return f"dz(t-{ticks})"
        case Mean(of, ticks):
            return f"{format_node(of)}(t-{ticks})" if ticks else f"{format_node(of)}(t)"
        case Recurrence(tick, interval):
            return f"{format_node(tick)}; t in steps of {interval:g} s"
    raise InputError(f"{node!r} cannot be printed: {type(node).__name__} is not a node of thermocomp.core.expression")


def _sum(terms: Sequence[Node]) -> str:
    text = ""
    for term in terms:
        match term:
            case Product((Constant(value), *others)) if others and value < 0:
                text += f" - {format_node(Product((Constant(-value), *others)))}"
            case _:
                text += f" + {format_node(term)}"
    return text.removeprefix(" + ").strip() or "0"


def _product(factors: Sequence[Node]) -> str:
    return "*".join(map(_bracketed, factors)) or "1"


def _bracketed(node: Node) -> str:
    """Return a factor of a product as text, in brackets if it is a sum."""
    inner = node.of if isinstance(node, Named | Clip) else node
    return f"({format_node(node)})" if isinstance(inner, Sum | Difference) else format_node(node)
