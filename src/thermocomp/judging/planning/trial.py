"""A thermal test that could be run next: speeds, durations, and what the room does."""

from dataclasses import dataclass
from typing import Literal

#: repeated: runs and stops of half an hour in turn; stop: a run, then a stop as long; run: one run without a stop;
#: room: the spindle is stopped while the room changes
Kind = Literal["repeated", "stop", "run", "room"]


@dataclass(frozen=True)
class Trial:
    """A thermal test that could be run next.

    Parameters
    ----------
    kind : {'repeated', 'stop', 'run', 'room'}
        repeated: short runs and stops in turn; stop: a run, then a stop as long; run: a run without a stop; room: the
        spindle is stopped while the temperature of the room changes.
    speed : float
        Spindle speed [1/min].
    steps : tuple of (float, float)
        Speed [1/min] and duration [s], one after the other; the first is the stop before the start.
    """

    kind: Kind
    speed: float
    steps: tuple[tuple[float, float], ...]

    @property
    def duration(self) -> float:
        """All of it [s]."""
        return sum(duration for _, duration in self.steps)

    @property
    def words(self) -> str:
        """Description of the test in words."""
        _, (_, longest), *_ = self.steps
        if self.kind == "room":
            return f"spindle is stopped {longest / 3600:g} h, the room changes"
        run = f"{self.speed:,.0f} 1/min for {longest / 3600:g} h"
        return {"run": run, "stop": f"{run}, then a stop as long"}.get(self.kind, f"{run}, stop as long, repeated")
