"""A thermal test that could be run next: speeds, durations, and the change of the room temperature."""

from dataclasses import dataclass
from typing import Literal

from thermocomp.core.messages import Message

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
            return Message("spindle stopped for {hours:g} h while the room temperature changes", hours=longest / 3600)
        if self.kind == "random":
            return Message(
                "{n} runs of {hours:g} h at {low:,.0f} to {high:,.0f} 1/min in a random order (seed {seed}), each with "
                "a stop of equal length",
                n=len(self.speeds),
                hours=longest / 3600,
                low=min(self.speeds),
                high=self.speed,
                seed=self.seed,
            )
        run = Message("{speed:,.0f} 1/min for {hours:g} h", speed=self.speed, hours=longest / 3600)
        if self.kind == "run":
            return run
        if self.kind == "stop":
            return Message("{run}, then a stop of equal length", run=run)
        return Message("{run} and a stop of equal length, repeated", run=run)
