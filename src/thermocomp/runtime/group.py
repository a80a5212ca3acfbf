"""Groups of models of a compensator that are stepped together: common parts are computed once."""

import math
from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bands import Bands
from thermocomp.core.bounds import GAP
from thermocomp.core.layers import Layers
from thermocomp.core.model import ErrorModel
from thermocomp.core.state import State
from thermocomp.runtime.gate import Ranges

#: reported as outside if each input is inside its own range but their combination is unlike the training
TOGETHER = "combination of inputs"


class Group:
    """Models with the same inputs, memory and zero, evaluated jointly; or a single model.

    Parameters
    ----------
    models : sequence of ErrorModel
        Models of a compensator.
    members : sequence of int
        Indices of the members.
    """

    def __init__(self, models: Sequence[ErrorModel], members: Sequence[int]) -> None:
        self.members = tuple(members)
        self.models = tuple(models[k] for k in members)
        self.lead = self.models[0]
        self._joint = _Joint(self.models) if len(self.models) > 1 else None
        self.ranges = Ranges(self.lead.inputs, self.lead.thresholds)
        self._apart = list(dict.fromkeys(m.joint for m in self.models if m.joint is not None))

    @staticmethod
    def of(models: Sequence[ErrorModel]) -> tuple["Group", ...]:
        """Return the groups of models, in the order of their first members."""
        alike: dict[object, list[int]] = {}
        for k, m in enumerate(models):
            alike.setdefault(k if m.support.policy != "clip" else _key(m), []).append(k)
        return tuple(Group(models, members) for members in alike.values())

    def share(self, states: Sequence[State]) -> list[State]:
        """Return the states of the models, with equal references and memories stored only once."""
        lead = states[0]
        same = all(_equal(s.reference, lead.reference) and _equal(s.memory, lead.memory) for s in states)
        if not same:
            return list(states)
        return [State(lead.reference, lead.memory, s.deviation, lead.outside) for s in states]

    def step(
        self, states: Sequence[State], values: FloatArray, dt: float
    ) -> tuple[list[State], list[float], list[float]]:
        """Process a reading, as `ErrorModel.step` does.

        Returns
        -------
        deviations : list of float
            One deviation per model [its unit].
        half_widths : list of float
            Half-widths of the uncertainty bands; nan without a band.
        """
        lead = states[0]
        if self._joint is None or any(s.memory is not lead.memory or s.reference is not lead.reference for s in states):
            each = [m.step(s, values, dt) for m, s in zip(self.models, states, strict=True)]
            widths = [
                math.nan if m.band is None else float(m.half_width(s, values))
                for m, (s, _) in zip(self.models, each, strict=True)
            ]
            return self.share([s for s, _ in each]), [float(d) for _, d in each], widths
        return self._joint.step(lead, values, min(dt, GAP))

    def beyond(self, states: Sequence[State], values: FloatArray) -> list[str]:
        """Return the inputs that are outside the trained range of a model."""
        if np.count_nonzero(states[0].outside):
            return [name for name, out in zip(self.ranges.names, states[0].outside.tolist(), strict=True) if out]
        change = values - states[0].reference
        near = all(joint.distance(change) <= 1.0 for joint in self._apart)
        return [] if near else [TOGETHER]


def _key(model: ErrorModel) -> object:
    """Return the properties that models must have in common to be evaluated jointly."""
    speeds = None if model.band is None else model.band.speeds
    return model.inputs, model.support, model.zeroing, model.remembered, speeds


class _Joint:
    """Models with the same `_key`, compiled together."""

    def __init__(self, models: Sequence[ErrorModel]) -> None:
        self._lead, leaves = models[0], models[0].leaves
        spreads = [m.spread_expressions(leaves) for m in models]
        nodes = [*(m.expression(leaves) for m in models), *(node for nodes in spreads for node in nodes)]
        self._layers, self._n = Layers(nodes, len(leaves), models[0].remembered), len(models)
        own = np.arange(len(leaves))
        self._bands = Bands(models, [own] * len(models), [len(s) for s in spreads])

    def step(self, state: State, values: FloatArray, dt: float) -> tuple[list[State], list[float], list[float]]:
        """Process a reading with all models of the group: see `Group.step`."""
        begins, lead = state.memory is None, self._lead
        reference = lead.settle(state.reference, values) if begins else state.reference
        change = values - reference
        clipped, outside = lead.clip(change)
        memory = self._layers.begin(clipped) if state.memory is None else state.memory
        memory, said = self._layers.advance(memory, clipped, 0.0 if begins else dt)
        deviations, widths = said[: self._n], self._bands.half_widths(change, clipped, said[self._n :])
        found = [State(reference, memory, d, outside) for d in deviations]
        return found, deviations.tolist(), widths.tolist()


def _equal(one: FloatArray | None, other: FloatArray | None) -> bool:
    if one is None or other is None:
        return one is other
    return one is other or bool(np.array_equal(one, other, equal_nan=True))
