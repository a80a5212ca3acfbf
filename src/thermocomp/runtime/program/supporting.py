"""Models outside their training range: ``hold`` and ``fade``, as statements of a program, and their numbers."""

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

from thermocomp.core.inputs import Input
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.distances import find_distances
from thermocomp.runtime.program.language import let, when
from thermocomp.runtime.program.numbers import larger
from thermocomp.runtime.program.values import Number, integer, real
from thermocomp.runtime.program.variables import Kept, Work


class Supports:
    """Support policies of several models; identical supports are stored once.

    Parameters
    ----------
    ranges : sequence of Input
        Ranges that include those of the inputs of the models.
    """

    def __init__(self, ranges: Sequence[Input]) -> None:
        self._ranges = ranges
        self._known: dict[str, int] = {}
        self._models: list[ErrorModel] = []
        self._distances: dict[int, tuple[Number, Number]] = {}

    def record(self, model: ErrorModel, place: int, said: Number, worked_out: set[int]) -> None:
        """Record the statements applied to the output of a model: they change ``s.deviation[place]``.

        Parameters
        ----------
        place : int
            Index of the model.
        said : Number
            Output of the model.
        worked_out : set of int
            Indices of the distances already computed in the function.
        """
        s, w, t = Kept(), Work(), Constants()
        policy = model.support.policy
        if policy == "clip":
            s.deviation[place] = said
            return
        key = repr((model.inputs, *model.bounds, model.joint))
        k = self._known.setdefault(key, len(self._known))
        if k == len(self._models):
            self._models.append(model)
        if k not in worked_out:
            worked_out.add(k)
            find_distances(s, w, t, integer(k))
            self._distances[k] = let(f"excess{k}", w.excess), let(f"far{k}", w.distance)
        excess, far = self._distances[k]
        if policy == "hold":
            with when(~((excess > 0.0) | (far > 1.0))):
                s.deviation[place] = said
        else:
            most = larger((far - 1.0) / float(model.support.fade_over), excess)
            s.deviation[place] = said * larger(real(0.0), 1.0 - most)

    def finish(self) -> tuple[dict[str, int], dict[str, list[Any]]]:
        """Return the sizes and numbers of `thermocomp.runtime.program.distances`."""
        models = self._models
        bounds = [m.bounds for m in models]
        joints = [
            m.joint or JointSupport(columns=(), scale=(), points=(), limit=1.0, speeds=(), levels=(), tolerances=())
            for m in models
        ]
        places = [[self._ranges.index(i) for i in m.inputs] for m in models]
        units = [j.limit * math.sqrt(len(j.columns)) for j in joints]
        levels = [level for j in joints for level in j.levels]
        values: dict[str, list[Any]] = {
            "member_begin": _begins([len(p) for p in places]),
            "member_range": [r for p in places for r in p],
            **{
                f"member_{name}": [float(v) for b in bounds for v in b[k]]
                for k, name in enumerate(("low", "high", "span"))
            },
            "column_begin": _begins([len(j.columns) for j in joints]),
            "column_range": [p[c] for j, p in zip(joints, places, strict=True) for c in j.columns],
            "column_weight": [1.0 / (s * unit) for j, unit in zip(joints, units, strict=True) for s in j.scale],
            "points": [len(j.points) for j in joints],
            "point_begin": _begins([len(j.points) * len(j.columns) for j in joints]),
            "point": [v / u for j, u in zip(joints, units, strict=True) for point in j.points for v in point],
            "speeds_begin": _begins([len(j.speeds) for j in joints]),
            "speed_range": [p[c] for j, p in zip(joints, places, strict=True) for c in j.speeds],
            "tolerance": [float(x) for j in joints for x in j.tolerances],
            "level_begin": _begins([len(level) for level in levels]),
            "level": [float(v) for level in levels for v in level],
        }
        sizes = {
            "SUPPORTS": len(models),
            "ENDS_OF_SUPPORTS": len(models) + 1,
            "SUPPORTED": len(values["member_range"]),
            "COLUMNS": len(values["column_range"]),
            "POINTS": len(values["point"]),
            "LEVELLED": len(levels),
            "ENDS_OF_LEVELS": len(levels) + 1,
            "LEVELS": len(values["level"]),
        }
        return sizes, values


def _begins(sizes: Sequence[int]) -> list[int]:
    """Return the start index of each of several concatenated lists, and the end of the last."""
    return list(accumulate(sizes, initial=0))
