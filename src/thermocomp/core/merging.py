"""The lag of a sum in place of a sum of lags: the same deviation from less memory, for replays of many variants.

A first-order lag is linear: a weighted sum of lags with the same time constant is the lag of the weighted sum. A model
of 16 temperatures with two lags each needs two lags in place of 32. The memory is another one, so a state of the model
itself does not fit.
"""

from collections.abc import Iterator

from thermocomp.core.expression import Constant, Difference, Lag, Named, Node, PacedLag, Product, Sum


def merge_lags(node: Node) -> Node:
    """Return an expression of equal value in which lags with the same time constants are merged.

    Parameters
    ----------
    node : Node
        Expression of a model, evaluated from steady state on.
    """
    merged: dict[object, list[Node]] = {}
    lags, others = dict[object, Lag | PacedLag](), list[Node]()
    for factor, term in _terms(node, 1.0):
        if not isinstance(term, Lag | PacedLag):
            others.append(Product((Constant(factor), term)))
            continue
        key = term.time_constant if isinstance(term, Lag) else (term.stopped, term.running, term.pace)
        lags.setdefault(key, term)
        merged.setdefault(key, []).append(Product((Constant(factor), term.of)))
    return Sum((*others, *(_of(lags[key], Sum(tuple(terms))) for key, terms in merged.items())))


def _of(lag: Lag | PacedLag, of: Node) -> Node:
    return Lag(of, lag.time_constant) if isinstance(lag, Lag) else PacedLag(of, lag.stopped, lag.running, lag.pace)


def _terms(node: Node, factor: float) -> Iterator[tuple[float, Node]]:
    """Yield the terms of a weighted sum, with their factors."""
    match node:
        case Sum(terms):
            for term in terms:
                yield from _terms(term, factor)
        case Named(_, of):
            yield from _terms(of, factor)
        case Difference(of, minus):
            yield from _terms(of, factor)
            yield from _terms(minus, -factor)
        case Product(factors) if sum(not isinstance(f, Constant) for f in factors) == 1:
            (other,) = (f for f in factors if not isinstance(f, Constant))
            for f in factors:
                factor *= f.value if isinstance(f, Constant) else 1.0
            yield from _terms(other, factor)
        case _:
            yield factor, node
