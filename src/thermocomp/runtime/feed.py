"""Whether the source of the readings still measures, or repeats its last values, such as a gateway that has hung.

All temperatures together are the feed. Two rules find that it has stopped, and the first temperature that changes ends
that. If the noise of the sensors exceeds their resolution, the temperatures change at every update of the source: how
many readings that takes is learned while it works, and the same values for many such intervals are no measurement. If
temperatures repeat on a sound machine, this proves nothing; then they must repeat although the watch predicts that one
of them has changed. A source that counts its readings is also stale if the counter does not advance.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.thresholds import Thresholds
from thermocomp.core.watch import Watch
from thermocomp.runtime.gate import is_number
from thermocomp.runtime.watchstate import GOOD, WatchState

#: stands for a temperature without a value; larger numbers are none
NONE, LARGEST = 1e13, 1e12
#: maximum count of repeated readings, which a controller can store
MOST_REPEATED = 1e9


class FeedState(NamedTuple):
    """State of the feed between two readings; intervals are numbers of readings."""

    values: tuple[float, ...] = ()  #: last temperatures [degC]
    steps: tuple[float, ...] = ()  #: smallest change of each: its resolution, or its noise [degC]
    repeated: float = 0.0  #: readings since a temperature changed
    changes: float = 0.0  #: number of intervals between changes that were averaged
    usual: float = 0.0  #: their mean
    longest: float = 0.0  #: longest one, not counting stops of the source
    predicted: tuple[FloatArray, ...] = ()  #: predictions of the watches at the first repeated reading [degC]
    moved: str = ""  #: why the repetition is implausible, according to these predictions; empty if it is not
    counter: float = 0.0  #: last number of a reading; 0: the source does not count
    waited: float = 0.0  #: time for which it has not changed [s]


class TemperatureFeed:
    """Temperatures of a compensator, and the rules for their repetition.

    Parameters
    ----------
    names : sequence of str
    watches : sequence of Watch
    """

    def __init__(self, names: Sequence[str], watches: Sequence[Watch], thresholds: Thresholds) -> None:
        self.names, self._watches, self._thresholds = tuple(names), tuple(watches), thresholds
        self.counts = may_count(watches, thresholds)
        place = {name: k for k, name in enumerate(self.names)}
        #: for each watch, index of each of its temperatures
        self.places = [[place[name] for name in w.names] for w in watches] if names else []

    def heed(
        self, feed: FeedState, values: Mapping[str, object], counter: object, travel: float, longest: float
    ) -> tuple[FeedState, str]:
        """Return the state after a reading, and why it must not be used; empty if it may be used.

        Parameters
        ----------
        counter : float
            Number of the reading; 0 or less if the source does not count.
        travel : float
            Time since the previous reading [s].
        longest : float
            Time after which the counter must have advanced [s].
        """
        if is_number(counter) and 0.0 < (number := float(counter)) <= LARGEST:  # type: ignore[arg-type]
            advances = number != feed.counter
            # the first number shows nothing: the source may have stopped before
            begun = 0.0 if feed.counter else NONE
            feed = feed._replace(counter=number, waited=begun if advances else feed.waited + travel)
            if feed.waited > longest:
                since = "since the start" if feed.waited >= NONE else f"for {feed.waited:.0f} s"
                return feed, f"the counter of the readings has been {number:g} {since}: the source has stopped"
            if not advances:
                return feed, self.explain(feed)
        given = tuple([_temperature(values.get(name)) for name in self.names])
        if len(feed.values) != len(given):  # at the start, or with another configuration
            return FeedState(given, (NONE,) * len(given), counter=feed.counter, waited=feed.waited), ""
        changed = sum(map(float.__ne__, given, feed.values))
        if changed:
            both = zip(given, feed.values, feed.steps, strict=True)
            # twice as fast as `min`
            steps = tuple([s if v == b or (step := abs(v - b)) > s else step for v, b, s in both])
            feed = self._learn(feed, changed)._replace(values=given, steps=steps, repeated=0.0, predicted=(), moved="")
        elif any(v != NONE for v in given):
            feed = feed._replace(repeated=min(feed.repeated + 1.0, MOST_REPEATED))
        return feed, self.explain(feed)

    def _learn(self, feed: FeedState, changed: int) -> FeedState:
        """Return the state with the interval that a change ends, averaged.

        If most temperatures change at once after a long interval, it was the source that had stopped, not the machine
        that was at rest. An interval counts as `repeat_factor` usual ones at most: a single stop is hardly learned, but
        a source that has become slower is.
        """
        limits, interval = self._thresholds, feed.repeated + 1.0
        known = feed.changes >= limits.repeat_changes
        counted = min(interval, limits.repeat_factor * feed.usual) if known else interval
        changes = min(feed.changes + 1.0, limits.repeat_memory)
        few = changed == 1 or 2 * changed <= len(self.names)
        return feed._replace(
            changes=changes,
            usual=feed.usual + (counted - feed.usual) / changes,
            longest=max(feed.longest, interval) if few else feed.longest,
        )

    def unchanged(self, feed: FeedState) -> bool:
        """Return whether no temperature has ever changed: the source may never have measured."""
        return bool(feed.steps) and min(feed.steps) > LARGEST

    def find_stale(self, feed: FeedState, values: Mapping[str, object]) -> str:
        """Return which temperature of a reading shows that those since the start were old; empty if none does.

        After a long time a coarse sensor changes by its resolution: `Thresholds.unknown_step`. If most temperatures
        change, it was the source that had stopped; then `Watched.frozen` is enough. A temperature counts at its first
        change, since each may arrive in a message of its own.
        """
        repeated = self.unchanged(feed) and feed.repeated >= 1.0
        if not (repeated or 1.0 <= feed.changes < len(self.names)):
            return ""
        rows = zip(self.names, feed.values, feed.steps, strict=False)
        given = [(n, _temperature(values.get(n)), v, step) for n, v, step in rows]
        moves = {n: now - v for n, now, v, step in given if step > LARGEST and now != v and NONE not in (now, v)}
        coarse, finer = self._thresholds.unknown_step + 1e-6, dict[str, float]()
        for watch in self._watches if 2 * len(moves) > len(self.names) else ():
            finer |= zip(watch.names, watch.limits("frozen").tolist(), strict=True)
        far = [n for n, moved in moves.items() if abs(moved) > min(coarse, finer.get(n, coarse))]
        return f"{far[0]} has changed by {moves[far[0]]:+.1f} degC at once" if far else ""

    def explain(self, feed: FeedState) -> str:
        """Return why the feed has stopped; empty if it has not."""
        limits = self._thresholds
        most = limits.repeat_factor * feed.usual
        known = self.counts and feed.changes >= limits.repeat_changes and limits.repeat_margin * feed.longest <= most
        if feed.moved or (known and feed.repeated > most):
            why = feed.moved or f"usual: a change every {_readings(feed.usual)}"
            every = f"all {len(self.names)} temperatures have" if len(self.names) > 1 else f"{self.names[0]} has"
            same = f"{every} repeated for {feed.repeated:.0f} readings"
            return f"{same} ({why}): the source has stopped"
        return ""

    def compare_predictions(self, feed: FeedState, states: Sequence[WatchState]) -> tuple[FeedState, str]:
        """Compare the predictions with those at the first repeated reading; see `heed`."""
        if feed.repeated < 1.0 or not states:
            return feed, ""
        if any(math.isnan(s.time) for s in states):
            return feed._replace(predicted=()), ""
        if not feed.predicted:
            return feed._replace(predicted=tuple(s.predicted for s in states)), ""
        if feed.repeated <= self._thresholds.repeat_wait * feed.usual:
            return feed, ""
        of = zip(self._watches, states, feed.predicted, self.places, strict=True)
        for watch, state, before, places in of:
            moved, steps = state.predicted - before, np.array([feed.steps[p] for p in places])
            if not feed.changes:  # nothing has changed yet: the resolution is that of the training
                steps = np.zeros(len(places))
            least = np.maximum(watch.limits("frozen"), self._thresholds.repeat_moved * steps)
            far = (state.fault == GOOD) & (np.abs(moved) > least)
            if far.any():
                k = int(np.argmax(far))
                feed = feed._replace(moved=f"{watch.names[k]} should have changed by {moved[k]:+.2f} degC")
                return feed, self.explain(feed)
        return feed, ""


def may_count(watches: Sequence[Watch], thresholds: Thresholds) -> bool:
    """Return whether the recordings permit counting: their temperatures did not repeat for long in health."""
    return all(thresholds.repeat_margin * w.repeats <= thresholds.repeat_factor for w in watches)


def _readings(count: float) -> str:
    return "reading" if count < 1.05 else f"{count:.3g} readings"


def _temperature(value: object) -> float:
    """Return a temperature as delivered by the source, or `NONE` if it is no number."""
    if type(value) is not float:
        value = float(value) if is_number(value) else NONE  # type: ignore[arg-type]
    return value if -LARGEST <= value <= LARGEST else NONE
