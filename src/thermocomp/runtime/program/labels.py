"""What the rows and columns of the tables are: sensors with their units, lags, targets."""

from collections.abc import Mapping, Sequence
from typing import Any

from thermocomp.core import expression as e
from thermocomp.core.inputs import Input
from thermocomp.core.watch import Watch
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.banks import stripped
from thermocomp.runtime.program.models import Formulas

Labels = dict[str, list[str]]


def label_inputs(inputs: Sequence[Input]) -> list[str]:
    """Return the names of inputs with their units."""
    return [f"{i.name} [{i.unit}]" for i in inputs]


def label_node(node: e.Node, ranges: Sequence[Input]) -> str:
    """Return what a value of a model is: an input with its unit, its lag with the time constant, else a formula."""
    match node:
        case e.Clip(e.Input(index)):
            return f"{ranges[index].name} [{ranges[index].unit}]"
        case e.Lag(of, tau):
            return f"{label_node(stripped(of), ranges)}, lag {tau:.5g} s"
        case e.PacedLag(of, stopped, running):
            return f"{label_node(stripped(of), ranges)}, lag {stopped:.5g} s at rest, {running:.5g} s at top speed"
        case e.Power(of, exponent):
            return f"({label_node(stripped(of), ranges)})^{exponent:.4g}"
    return e.format_node(node)


def label_all(
    compensator: Compensator,
    channels: Sequence[Input],
    ranges: Sequence[Input],
    values: Mapping[str, Any],
    formulas: Formulas,
) -> Labels:
    """Return the labels of all tables by the names of their sizes.

    Parameters
    ----------
    channels, ranges : sequence of Input
        Values of a reading, and inputs of the models.
    values : mapping of str to object
        The tables.
    formulas : Formulas
    """
    models, banks = compensator.models, formulas.banks
    part_of: dict[e.Node, str] = {}
    for k, node in formulas.nodes.items():
        for part in e.walk_nodes(stripped(node)):
            part_of.setdefault(part, models[k].target if part == stripped(node) else f"part of {models[k].target}")
    return {
        "CHANNELS": label_inputs(channels),
        "RANGES": label_inputs(ranges),
        "FED": label_inputs([channels[k] for k in values["feed_channel"]]),
        "MEMBERS": label_inputs([ranges[k] for k in values["set_range"]]),
        "SUPPORTED": label_inputs([ranges[k] for k in values["member_range"]]),
        "MODELS": [m.target for m in models],
        "TARGETS": [f"{target} [um]" for target in compensator.lines],
        "INPUTS": [label_node(n, ranges) for b in banks for n in b.inputs],
        "TERMS": [label_node(n, ranges) for b in banks for n in b.terms],
        "BANKED": [label_node(n, ranges) for b in banks for n in b.lags],
        "PACES": [f"pace: {label_node(n, ranges)}" if n else "constant" for b in banks for *_, n in b.paces],
        "SUMS": [part_of[n] for b in banks for n in b.sums],
        **label_watch(compensator.watches[0] if compensator.watches else None),
    }


def label_watch(watch: Watch | None) -> Labels:
    """Return the labels of the tables of a watch."""
    if watch is None:
        return {}
    inputs = label_inputs(watch.inputs)
    sensors = [inputs[s.input] for s in watch.sensors]
    lagged = [f"{s}, lag {tau:.5g} s" for tau in watch.time_constants for s in sensors]
    states = [
        f"{inputs[k]} as a share of {watch.top_speed:.5g} to the power of {power:.4g}, lag {slow:.5g} s at rest, "
        f"{fast:.5g} s at top speed"
        for k, power, slow, fast in watch.states
    ]
    checks = [f"heat of {inputs[c.input]}" for c in watch.checks]
    return {
        "SENSORS": sensors,
        "FAILING": [inputs[k] for k in watch.supervised.tolist()],
        "WATCHED": inputs,
        "SPEEDS": [inputs[k] for k in watch.speeds.tolist()],
        "TAUS": [f"lag {tau:.5g} s" for tau in watch.time_constants],
        "STATES": states,
        "LAGGED": lagged,
        "MEMORY": [*lagged, *states],
        "PAIRS": [f"{sensors[i]} and {sensors[j]}" for i, j in zip(*watch.pairs, strict=True)],
        "CHECKS": checks,
        "RESIDUALS": [*sensors, *checks],
        "SHAPES": ["at once", "in the end"],
    }
