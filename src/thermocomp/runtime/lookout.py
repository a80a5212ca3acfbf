"""A watch (sensor monitoring) applied to the values of a source: values by channel in, values by channel out."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from thermocomp.core.watch import Watch
from thermocomp.runtime.gate import Ranges, is_number
from thermocomp.runtime.watch import is_quiet, look
from thermocomp.runtime.watchstate import WORDS, WatchState


class Lookout:
    """A watch, with the indices of its inputs among the values of a reading."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self._ranges = Ranges(watch.inputs, watch.thresholds)

    def believe(
        self, state: WatchState, time: float, values: Mapping[str, float]
    ) -> tuple[WatchState, Mapping[str, float]]:
        """Return the values with substitutes for temperatures that are not trusted.

        Parameters
        ----------
        time : float
            Time of the reading [s].
        """
        given = self._ranges.pick(values)
        if is_quiet(self.watch, state, time) and self._ranges.hold(given, state.reference):
            return state, values
        numbers = np.array([float(v) if is_number(v) else math.nan for v in given])  # type: ignore[arg-type]
        zeroing, watch = self.watch.zeroing, self.watch
        resting = zeroing.stands(values.get(zeroing.speed), watch.thresholds.stopped_speed)
        state, believed = look(watch, state, time, numbers, resting=resting)
        return state, {**values, **dict(zip(watch.failing, believed[watch.supervised].tolist(), strict=True))}

    @staticmethod
    def failed(lookouts: Sequence["Lookout"], states: Sequence[WatchState]) -> dict[str, str]:
        """Return the sensors that are not trusted, with the kind of fault."""
        return {
            name: WORDS[fault]
            for lookout, state in zip(lookouts, states, strict=True)
            if not state.sound
            for name, fault in zip(lookout.watch.failing, state.faults(lookout.watch).tolist(), strict=True)
            if fault
        }
