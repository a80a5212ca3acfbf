"""A thermal test that could be run next: speeds, durations, and the change of the room temperature."""

from dataclasses import dataclass
from typing import Literal

#: repeated: alternating runs and stops of half an hour; stop: a run, then a stop of the same length; run: one run
#: without a stop; room: the spindle is stopped while the room temperature changes; random: as repeated, at speeds in a
#: random order
Kind = Literal["repeated", "stop", "run", "room", "random"]


@dataclass(frozen=True)
class Trial:
    """A thermal test that could be run next.

    Parameters
    ----------
    kind : {'repeated', 'stop', 'run', 'room', 'random'}
        repeated: short alternating runs and stops; stop: a run, then a stop of the same length; run: a run without a
        stop; room: the spindle is stopped while the temperature of the room changes; random: short alternating runs
        and stops at speeds in a random order.
    speed : float
        Spindle speed; the highest one of several [1/min].
    steps : tuple of (float, float)
        Speed [1/min] and duration [s] of consecutive steps; the first is the stop before the start.
    seed : int
        Seed of the random order.
    """

    kind: Kind
    speed: float
    steps: tuple[tuple[float, float], ...]
    seed: int = 0

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speeds of the runs, in their order [1/min]."""
        return tuple(speed for speed, _ in self.steps if speed)

    @property
    def duration(self) -> float:
        """Total duration of the test [s]."""
        return sum(duration for _, duration in self.steps)

    @property
    def words(self) -> str:
        """Description of the test as text."""
        _, (_, longest), *_ = self.steps
        if self.kind == "room":
            return f"spindle stopped for {longest / 3600:g} h while the room temperature changes"
        if self.kind == "random":
            lowest = f"{min(self.speeds):,.0f}"
            return (
                f"{len(self.speeds)} runs of {longest / 3600:g} h at {lowest} to {self.speed:,.0f} 1/min in a random "
                f"order (seed {self.seed}), each with a stop of equal length"
            )
        run = f"{self.speed:,.0f} 1/min for {longest / 3600:g} h"
        stopped = {"run": run, "stop": f"{run}, then a stop of equal length"}
        return stopped.get(self.kind, f"{run} and a stop of equal length, repeated")
