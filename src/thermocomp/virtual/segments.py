"""Components of a test: segments, and values selected at random from a seed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from thermocomp.core.exceptions import SettingError
from thermocomp.virtual.axes import AXES, TRAVEL
from thermocomp.virtual.machine import FeedDrive

# Keys and list positions of a location in a protocol
Path = tuple[str | int, ...]
# Location of a segment and its settings
Leaf = tuple[Path, dict[str, Any]]


#: limits of a protocol; more is an error, or would run indefinitely
MOST_VALUES, MOST_REPEATS = 10_000, 10_000


@dataclass(frozen=True)
class SteadySegment:
    """A part of a test with constant conditions.

    Parameters
    ----------
    duration : float
        [s]
    """

    duration: float
    drive: FeedDrive = field(default_factory=FeedDrive)


@dataclass(frozen=True)
class Lot:
    """A number selected at random with equal probabilities: either `one_of`, or `between` with `step`.

    Parameters
    ----------
    between : tuple of float, optional
        Lowest and highest value.
    """

    between: tuple[float, float] | None = None
    step: float | None = None
    one_of: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.one_of and self.between is None and self.step is None:
            return
        if self.one_of or self.between is None or self.step is None:
            raise SettingError("write either one_of = [...], or between = [lowest, highest] and step")
        low, high = self.between
        if not (self.step > 0 and high > low) or abs(self._steps - round(self._steps)) > 1e-9:
            raise SettingError(
                f"expected a range of a whole number of positive steps, found {low:g} to {high:g} in steps of "
                f"{self.step:g}"
            )
        if self._steps > MOST_VALUES:
            raise SettingError(
                f"{self._steps:.3g} values to draw from, but at most {MOST_VALUES} are supported: use a larger step"
            )

    @property
    def _steps(self) -> float:
        (low, high), step = self.between or (0.0, 0.0), self.step or 1.0
        return (high - low) / step

    @property
    def values(self) -> tuple[float, ...]:
        """All values that can be selected at random."""
        if self.between is None or self.step is None:
            return self.one_of
        return tuple(self.between[0] + k * self.step for k in range(round(self._steps) + 1))


Number = float | Lot


def values(number: Number | None) -> tuple[float, ...]:
    """Return all possible values of a number; empty if it is not given."""
    return () if number is None else number.values if isinstance(number, Lot) else (number,)


@dataclass(frozen=True)
class Feed:
    """Mean feed rates of the axes [mm/min]."""

    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0


@dataclass(frozen=True)
class Stroke:
    """Start and end of the axis movements [mm]; None: over the whole travel."""

    x: tuple[float, float] | None = None
    y: tuple[float, float] | None = None
    z: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for axis in AXES:
            stroke, travel = getattr(self, axis), TRAVEL[axis]
            if stroke and not 0.0 <= stroke[0] <= stroke[1] <= travel:
                raise SettingError(
                    f"expected positions that increase, within the travel from 0 to {travel:g} mm, found "
                    f"{stroke[0]:g} and {stroke[1]:g} mm",
                    (axis,),
                )


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of a test as written in a protocol: one segment, or several.

    Its duration, speed, feed, stroke, loads, cooled and powered are the defaults of the segments within it.

    Parameters
    ----------
    duration : float or Lot, optional
        [s]
    speed : float or Lot, optional
        Spindle speed [1/min]. Default: inherited, else 0.
    feed : Feed, optional
        Feed rates. Default: inherited, else the axes are stopped.
    loads : mapping of str to float or Lot, optional
        Additional heat by place [W].
    cooled : bool, optional
        Whether the coolant loop runs. Default: inherited, else it runs.
    powered : bool, optional
        Whether the machine is switched on. Default: inherited, else it is on.
    segments : tuple of Stretch
        Nested segments; none: this is a segment itself.
    repeat : int
        Number of repetitions of its `segments`, or number of random selections.
    order : {'given', 'shuffled', 'drawn'}
        In sequence; all (`repeat` times each) in random order; or one selected at random each time.
    weight : float
        Relative probability where the outer order is ``drawn``.
    """

    duration: Number | None = None
    speed: Number | None = None
    feed: Feed | None = None
    stroke: Stroke | None = None
    loads: Mapping[str, Number] | None = None
    cooled: bool | None = None
    powered: bool | None = None
    segments: tuple["Stretch", ...] = ()
    repeat: int = 1
    order: Literal["given", "shuffled", "drawn"] = "given"
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not 1 <= self.repeat <= MOST_REPEATS:
            raise SettingError(f"expected 1 to {MOST_REPEATS} repeats, found {self.repeat}", ("repeat",))
        if not self.segments and (self.repeat > 1 or self.order != "given"):
            key = "repeat" if self.repeat > 1 else "order"
            raise SettingError("applies to segments, but there are none: add segments = [...]", (key,))
        if not self.weight > 0:
            raise SettingError(f"expected a positive weight, found {self.weight:g}", ("weight",))
        for k, s in enumerate(self.segments):
            if s.weight != 1.0 and self.order != "drawn":
                raise SettingError('applies only where the order is "drawn"', ("segments", k, "weight"))

    @property
    def longest(self) -> float:
        """Longest possible duration over all draws [s]."""
        return self._longest(0.0)

    def _longest(self, outer: float) -> float:
        own = max(values(self.duration), default=outer)
        if not self.segments:
            return own
        parts = [s._longest(own) for s in self.segments]
        return self.repeat * (max(parts) if self.order == "drawn" else sum(parts))

    def leaves(self, outer: Mapping[str, Any] | None = None, path: Path = ()) -> Iterator[Leaf]:
        """Yield the location and settings of each segment."""
        given = self._given(outer or {})
        if not self.segments:
            yield path, given
        for k, s in enumerate(self.segments):
            yield from s.leaves(given, (*path, "segments", k))

    def draw(self, rng: np.random.Generator, outer: Mapping[str, Any] | None = None) -> list[SteadySegment]:
        """Return the segments, with all open values selected at random."""
        given = self._given(outer or {})
        if not self.segments:
            return [_segment(given, rng)]
        parts = list(self.segments)
        if self.order == "drawn":
            weights = np.array([p.weight for p in parts])
            parts = [parts[k] for k in rng.choice(len(parts), size=self.repeat, p=weights / weights.sum())]
        else:
            parts *= self.repeat
            if self.order == "shuffled":
                parts = [parts[k] for k in rng.permutation(len(parts))]
        return [s for p in parts for s in p.draw(rng, given)]

    def _given(self, outer: Mapping[str, Any]) -> dict[str, Any]:
        own = {key: getattr(self, key) for key in _HANDED_DOWN}
        return {**outer, **{key: value for key, value in own.items() if value is not None}}


_HANDED_DOWN = ("duration", "speed", "feed", "stroke", "loads", "cooled", "powered")


def _drawn(number: Number, rng: np.random.Generator) -> float:
    return number.values[rng.integers(len(number.values))] if isinstance(number, Lot) else number


def _segment(given: Mapping[str, Any], rng: np.random.Generator) -> SteadySegment:
    feed, stroke = given.get("feed", Feed()), given.get("stroke", Stroke())
    # The order of the draws is part of the protocol: duration first.
    duration = _drawn(given["duration"], rng)
    speed = _drawn(given.get("speed", 0.0), rng)
    feeds = (_drawn(feed.x, rng), _drawn(feed.y, rng), _drawn(feed.z, rng))
    powered = given.get("powered", True)
    # A machine that is switched off does not rotate, even with an inherited speed.
    drive = FeedDrive(
        speed=speed if powered else 0.0,
        feed=feeds if powered else (0.0, 0.0, 0.0),
        stroke=(stroke.x, stroke.y, stroke.z),
        loads={place: _drawn(load, rng) for place, load in given.get("loads", {}).items()},
        cooled=given.get("cooled", True),
        powered=powered,
    )
    return SteadySegment(duration, drive)
