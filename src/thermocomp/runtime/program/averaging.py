"""Mean over time of the readings of a zero as scalars: see `thermocomp.core.zero.ZeroMean`."""

from collections.abc import Callable
from typing import NamedTuple

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, let, otherwise, otherwise_when, when
from thermocomp.runtime.program.numbers import median
from thermocomp.runtime.program.values import Condition, Number, Numbers, Whole
from thermocomp.runtime.program.variables import Kept, Work


class Averaged(NamedTuple):
    """Variables of a mean."""

    readings: Whole
    resting: Condition
    first: Number
    last: Number
    before_at: Number
    weight: Number
    mean: Numbers
    before: Numbers
    previous: Numbers

    @classmethod
    def of_models(cls, s: Kept) -> "Averaged":
        """Return the mean for the zero of the models."""
        return cls(**{name: getattr(s, f"zero_{name}") for name in cls._fields})

    @classmethod
    def of_watch(cls, s: Kept) -> "Averaged":
        """Return the mean for the zero of the watch."""
        return cls(**{name: getattr(s, f"watch_{name}") for name in cls._fields})

    def belongs(self, w: Work, t: Constants) -> Condition:
        """Record whether the reading belongs to the averaging interval, in a local variable."""
        belongs = let("belongs", self.readings.equals(0))
        with when(~belongs & (w.stands | ~self.resting)):
            belongs.set(w.now - self.first <= choose(self.resting, t.at_rest, t.otherwise))
        return belongs

    def complete(self, t: Constants) -> Condition:
        """Return the condition that no later reading can belong to the averaging interval."""
        return self.last - self.first >= choose(self.resting, t.at_rest, t.otherwise)

    def add(self, w: Work, size: Whole, value: Callable[[Whole], Number]) -> None:
        """Record the statements that add a reading to the mean, unless it is not later than the previous one.

        Parameters
        ----------
        value : callable
            Returns the value of an input by its index, below `size`.
        """
        with when(self.readings.equals(0) | (w.now > self.last)):
            self._add(w, size, value)

    def _add(self, w: Work, size: Whole, value: Callable[[Whole], Number]) -> None:
        with when(self.readings.equals(0)):
            self.resting.set(w.stands)
            self.first.set(w.now)
        with when(self.readings >= 2):
            self.weight.set(self.weight + (w.now - self.before_at))
        for k in each("k", size):
            reading = let("reading", value(k))
            centre = let("centre", median(self.before[k], self.previous[k], reading))
            with when(self.readings.equals(0)):
                self.mean[k] = reading
            with otherwise_when(self.readings.equals(1)):
                self.mean[k] = (self.previous[k] + reading) / 2.0
            with otherwise_when(self.readings.equals(2)):
                self.mean[k] = centre
            with otherwise():
                share = (w.now - self.before_at) / self.weight
                self.mean[k] = self.mean[k] + (centre - self.mean[k]) * share
            self.before[k] = self.previous[k]
            self.previous[k] = reading
        self.before_at.set(self.last)
        self.last.set(w.now)
        with when(self.readings < 3):
            self.readings.set(self.readings + 1)
