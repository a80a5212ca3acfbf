"""Curves of the page over time: a row of numbers at intervals."""

from collections import deque

from thermocomp.live.latest import Latest
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Compensated

#: points of each curve that are kept to be shown, and time between two [s of the machine]
POINTS, EVERY = 720, 30.0


class Curves(deque[dict[str, float]]):
    """Rows of numbers by name, ``time`` first; the oldest go.

    Parameters
    ----------
    compensator : Compensator
    """

    def __init__(self, compensator: Compensator) -> None:
        super().__init__(maxlen=POINTS)
        self._heat = {i.name for m in compensator.models for i in m.inputs if i.quantity == "temperature"}

    def take(self, now: float, said: Compensated, latest: Latest) -> None:
        """Keep a row, if the last one is old enough.

        Parameters
        ----------
        now : float
            On the clock of the machine [s].
        said : Compensated
        latest : Latest
        """
        if not said.deviations or (self and now - self[-1]["time"] < EVERY):
            return
        row = {"time": now} | {name: latest[name][0] for name in sorted(self._heat & latest.keys())}
        for target, deviation in said.deviations.items():
            row[f"{target} predicted"] = deviation.offset
            if target in said.half_widths:
                row[f"{target} +-"] = said.half_widths[target]
        self.append(row | {f"{target} correction": c.offset for target, c in said.corrections.items()})
