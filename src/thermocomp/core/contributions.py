"""Contributions of the inputs, with their lags, to the output of a `PacedDynamic` model, and their gains."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core import lagbank
from thermocomp.core.arrays import FloatArray
from thermocomp.core.columns import Columns
from thermocomp.core.exceptions import InputError
from thermocomp.core.expression import Input as Leaf
from thermocomp.core.expression import Node, Sum, walk_nodes
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.rows import run_table


class Gain(NamedTuple):
    """Gain of an input: per degree for a temperature, at the highest trained speed for a spindle speed."""

    name: str
    quantity: str
    instantaneous: float  #: effect within one step between rows [unit per degC, or unit]
    settled: float  #: steady-state effect, including all lags [unit per degC, or unit]
    bound: float  #: largest possible contribution at any reading; inputs are clipped [unit]


def contributions(
    model: ErrorModel, table: Columns, time: ArrayLike | str | None = None, *, reference: ArrayLike | None = None
) -> dict[str, FloatArray]:
    """Return the contribution of each input, including its lags or states, to the deviation.

    With the intercept they sum to the model prediction, except where it holds or fades outside its trained range.

    Returns
    -------
    dict of str to ndarray of shape (n_rows,)
        By input name [unit of the model]; 0 before the first complete row of a test.
    """
    run = run_table(model, table, time, reference=reference, further=_parts(model))

    def own(k: int) -> FloatArray:
        return run.spread(lambda r: r.outputs[:, k - len(model.inputs)], 0.0)

    return {i.name: own(k) for k, i in enumerate(model.inputs)}


def _parts(model: ErrorModel) -> list[Node]:
    """Return the terms of each input in the deviation, as expressions."""
    node = model.expression(model.leaves)
    parts: dict[int, list[Node]] = {k: [] for k in range(len(model.inputs))}
    for term in node.terms if isinstance(node, Sum) else (node,):
        match sorted({n.index for n in walk_nodes(term) if isinstance(n, Leaf)}):
            case []:
                continue  # the intercept
            case [index]:
                parts[index].append(term)
            case several:
                names = ", ".join(model.inputs[k].name for k in several)
                raise InputError(
                    f"model of {model.target}: a term depends on several inputs ({names}), so its deviation cannot be "
                    "divided among the inputs"
                )
    return [Sum(tuple(terms)) for terms in parts.values()]


def gains(model: ErrorModel, step: float) -> list[Gain]:
    """Return the gain of each input, in descending order of the bound.

    Parameters
    ----------
    step : float
        Time between two rows [s].
    """
    model = _paced(model)
    if not step > 0:
        raise InputError(f"step {step}: the time between two rows [s] must be positive")
    direct, weights = model.read_out
    owners, bank = _owners(model), model.bank
    rates = bank.rates.copy()
    rates[len(rates) - len(bank.gain) :] += bank.gain  # for speed states: at top speed
    followed = weights * lagbank.step_response(step, 1.0 / rates)
    low, high = model.clip(np.full(len(model.inputs), -np.inf))[0], model.clip(np.full(len(model.inputs), np.inf))[0]
    found = []
    for k, i in enumerate(model.inputs):
        own = owners == k
        if k in bank.temperatures:
            parts = np.append(direct[k], weights[own])
            ends = np.outer(parts, (low[k], high[k]))
        else:
            parts = weights[own]
            share = max(abs(low[k]), abs(high[k])) / model.top_speed
            ends = np.outer(parts, (0.0, 1.0)) * share ** bank.powers[bank.speeds == k][:, None]
        bound = max(float(ends.max(axis=1).sum()), -float(ends.min(axis=1).sum()))
        now = float(direct[k] + followed[own].sum())
        found.append(Gain(name=i.name, quantity=i.quantity, instantaneous=now, settled=float(parts.sum()), bound=bound))
    return sorted(found, key=lambda g: -g.bound)


def _paced(model: ErrorModel) -> PacedDynamic:
    if isinstance(model, PacedDynamic):
        return model
    raise InputError(
        f"{model.target} has a model of the family {model.family}: the contribution of each input can be computed "
        f"only for the family {PacedDynamic.family}, which the method averaged produces"
    )


def _owners(model: PacedDynamic) -> NDArray[np.intp]:
    """Return the index of the input that each state of the memory follows."""
    bank = model.bank
    return np.append(np.tile(bank.temperatures, bank.taus), bank.speeds)
