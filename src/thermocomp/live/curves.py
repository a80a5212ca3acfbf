"""Curves shown on the page: rows of values at fixed intervals."""

from collections import deque

from thermocomp.live.latest import Latest
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Compensated

#: number of points kept per curve, and interval between two points [s of machine time]
POINTS, EVERY = 720, 30.0


class Curves(deque[dict[str, float]]):
    """Rows of values by name, ``time`` first; the oldest rows are dropped."""

    def __init__(self, compensator: Compensator) -> None:
        super().__init__(maxlen=POINTS)
        self._heat = {i.name for m in compensator.models for i in m.inputs if i.quantity == "temperature"}

    def take(self, now: float, said: Compensated, latest: Latest) -> None:
        """Append a row of values if the interval since the last one has passed.

        Parameters
        ----------
        now : float
            Machine time [s].
        """
        if not said.deviations or (self and now - self[-1]["time"] < EVERY):
            return
        row = {"time": now} | {name: latest[name][0] for name in sorted(self._heat & latest.keys())}
        for target, deviation in said.deviations.items():
            row[f"{target} predicted"] = deviation.offset
            if target in said.half_widths:
                row[f"{target} +-"] = said.half_widths[target]
        self.append(row | {f"{target} correction": c.offset for target, c in said.corrections.items()})
