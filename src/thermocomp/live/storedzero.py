"""The zero of a machine, stored beside the state of its models: other models of the same machine can take it over."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.files.typed import decode, want
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import CompensatorState, Reference, Status


class StoredInput(NamedTuple):
    """Zero of an input."""

    value: float  #: [unit]
    quantity: str
    unit: str


class StoredTarget(NamedTuple):
    """What is known of a target or axis apart from its model."""

    correction: Correction  #: in force
    reference: Reference | None  #: None: its zero was not known yet
    order: Status | None


class StoredZero(NamedTuple):
    """Zero of the inputs, and the corrections in force; times are stamps of the readings."""

    begun: float  #: first reading of the zero [s]
    read: float  #: last accepted reading [s]
    inputs: dict[str, StoredInput]  #: inputs whose zero was found at the machine
    targets: dict[str, StoredTarget]

    def find_missing(self, compensator: Compensator) -> dict[str, str]:
        """Return the inputs of the models and watches that have no zero, with the reason."""
        found = dict[str, str]()
        for channel in inputs_of(compensator):
            own = self.inputs.get(channel.name)
            if channel.rezero and own is None:
                found[channel.name] = "has no zero for it"
            elif channel.rezero and own is not None and own[1:] != (channel.quantity, channel.unit):
                found[channel.name] = f"has its zero as a {own.quantity} in {own.unit}, not {channel.unit}"
        return found


@dataclass(frozen=True)
class StateOfOthers:
    """The part of a state file that does not depend on the models, and the time at which it was written."""

    written: datetime
    zero: StoredZero

    def __str__(self) -> str:
        return f"the state of {self.written.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def inputs_of(compensator: Compensator) -> list[Input]:
    """Return the inputs of all models and of their watches; a name may occur more than once."""
    return [*(i for w in compensator.watches for i in w.inputs), *(i for m in compensator.models for i in m.inputs)]


def zero_of(state: CompensatorState, compensator: Compensator, before: StoredZero | None) -> StoredZero:
    """Return the zero of a state.

    Parameters
    ----------
    before : StoredZero or None
        The zero that was stored before, if it is to be kept: the present models have no valid zero, or have not
        accepted a reading since the start. Corrections and orders are those of the state.
    """
    read = math.nan if state.time is None else state.time + state.origin
    if before is None:
        values = np.concatenate([*(s.reference for s in state.watches), *(s.reference for s in state.models)])
        pairs = zip(inputs_of(compensator), values.tolist(), strict=True)
        before = StoredZero(
            begun=state.zeroed,
            read=read,
            inputs={i.name: StoredInput(v, i.quantity, i.unit) for i, v in pairs if i.rezero and not math.isnan(v)},
            targets={t: StoredTarget(c, state.references.get(t), None) for t, c in state.corrections.items()},
        )
    targets = dict(before.targets)
    for t, correction in state.corrections.items():
        # a model that must not run is no order, and says nothing about another model
        order = state.orders.get(t) if state.orders.get(t) != compensator.shadow.get(t) else None
        reference = targets[t].reference if t in targets else None
        targets[t] = StoredTarget(correction, reference, order)
    return before._replace(targets=targets, read=before.read if math.isnan(read) else max(before.read, read))


def decode_zero(entry: Any, written: datetime) -> StateOfOthers | None:
    """Return a stored zero that can be used; None if there is none, or its numbers are impossible."""
    try:
        found: StoredZero = decode(StoredZero, entry, "zero")
        numbers = [found.begun, found.read, *(i.value for i in found.inputs.values())]
        want(all(map(math.isfinite, numbers)) and 0.0 <= found.begun <= found.read, None, "zero", "finite numbers")
    except (ValueError, InputError):
        return None
    return StateOfOthers(written, found) if found.inputs else None
