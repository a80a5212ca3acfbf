"""Past values used by a value with a separate clock: see `thermocomp.core.expression.Recurrence`."""

from collections.abc import Iterator
from typing import assert_never

from thermocomp.core import expression as e


class Clock:
    """A value that is updated at every tick.

    Parameters
    ----------
    tick : Node
        New value.
    interval : float
        Time between two ticks [s].
    """

    def __init__(self, tick: e.Node, interval: float) -> None:
        self.tick, self.interval = tick, interval
        parts = list(_walk(tick))
        means = [n for n in parts if isinstance(n, e.Mean)]
        #: nodes that are averaged
        self.leaves: list[e.Node] = list(dict.fromkeys(n.of for n in means)) or [e.Constant(0.0)]
        #: number of past ticks of the value itself that are used
        self.past = max([1, *(n.ticks for n in parts if isinstance(n, e.Past))])
        #: number of past ticks of the means that are used
        self.means = max([1, *(n.ticks for n in means)])


def _walk(node: e.Node) -> Iterator[e.Node]:
    """Yield a node and all its descendants, except the arguments of `Mean` nodes."""
    yield node
    match node:
        case e.Sum(parts) | e.Product(parts):
            inner: tuple[e.Node, ...] = parts
        case e.Sigmoid(of) | e.Named(_, of) | e.Clip(of) | e.Magnitude(of) | e.Power(of) | e.Lookup(of):
            inner = (of,)
        case e.Difference(of, minus):
            inner = (of, minus)
        case e.Constant() | e.Input() | e.Lag() | e.PacedLag() | e.Past() | e.Mean() | e.Recurrence():
            inner = ()
        case _:
            assert_never(node)
    for part in inner:
        yield from _walk(part)
