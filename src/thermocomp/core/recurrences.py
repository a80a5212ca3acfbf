"""Past values used by a value that is updated at fixed intervals: see `thermocomp.core.expression.Recurrence`."""

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
        parts = list(e.walk_nodes(tick, (e.Mean,)))
        means = [n for n in parts if isinstance(n, e.Mean)]
        #: nodes that are averaged
        self.leaves: list[e.Node] = list(dict.fromkeys(n.of for n in means)) or [e.Constant(0.0)]
        #: number of past ticks of the value itself that are used
        self.past = max([1, *(n.ticks for n in parts if isinstance(n, e.Past))])
        #: number of past ticks of the means that are used
        self.means = max([1, *(n.ticks for n in means)])
