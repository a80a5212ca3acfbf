"""Groups of models of a compensator that are stepped together: common parts are computed once."""

import math
from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import GAP
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.state import State
from thermocomp.core.together import Together, TogetherState
from thermocomp.runtime.gate import Ranges

#: reported as outside if each input is inside its own range but their combination is unlike the training
TOGETHER = "inputs together"


class Group:
    """Models with the same inputs, states and zero, each with a separate read-out; or a single model of any family.

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
        paced = [m for m in self.models if isinstance(m, PacedDynamic)]
        self._together = Together(paced) if len(paced) == len(self.models) > 1 else None
        self.ranges = Ranges(self.lead.inputs)
        self._apart = list(dict.fromkeys(m.joint for m in self.models if m.joint is not None))

    @staticmethod
    def of(models: Sequence[ErrorModel]) -> tuple["Group", ...]:
        """Return the groups of models, in the order of their first members."""
        alike: dict[object, list[int]] = {}
        for k, m in enumerate(models):
            key = Together.key(m) if isinstance(m, PacedDynamic) else None
            alike.setdefault(k if key is None else (key, m.zeroing), []).append(k)
        return tuple(Group(models, members) for members in alike.values())

    def share(self, states: Sequence[State]) -> list[State]:
        """Return states in which equal parts are shared objects."""
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
        if self._together is None or any(
            s.memory is not lead.memory or s.reference is not lead.reference for s in states
        ):
            each = [m.step(s, values, dt) for m, s in zip(self.models, states, strict=True)]
            widths = [
                math.nan if m.band is None else float(m.half_width(s, values))
                for m, (s, _) in zip(self.models, each, strict=True)
            ]
            return self.share([s for s, _ in each]), [float(d) for _, d in each], widths
        before = TogetherState(lead.reference, lead.memory, lead.reference, lead.outside)
        after, deviations = self._together.step(before, values, min(dt, GAP))
        found = [State(after.reference, after.memory, d, after.outside) for d in deviations]
        return found, deviations.tolist(), self._together.half_widths(after).tolist()

    def beyond(self, states: Sequence[State], values: FloatArray) -> list[str]:
        """Return the inputs that are outside the trained range of a model."""
        if np.count_nonzero(states[0].outside):
            return [name for name, out in zip(self.ranges.names, states[0].outside.tolist(), strict=True) if out]
        change = values - states[0].reference
        near = all(joint.distance(change) <= 1.0 for joint in self._apart)
        return [] if near else [TOGETHER]


def _equal(one: FloatArray | None, other: FloatArray | None) -> bool:
    if one is None or other is None:
        return one is other
    return one is other or bool(np.array_equal(one, other, equal_nan=True))
