"""Conditions of the bound: the revised program in a run with other stops, tool changes, feeds, or from another state.

The corrections are those of the assumed run. In another run they meet the drift of other times; what is then left of it
in the cuts, beyond what is left in the assumed run, adds to the bound.
"""

import copy
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import tee
from typing import Literal

from thermocomp.nc.interpreter.block import Block, Point
from thermocomp.nc.planner.timeline import MotionLimits, Timed, time_blocks
from thermocomp.nc.rewrite.demand import DriftSource, Left
from thermocomp.nc.rewrite.offset import ending
from thermocomp.nc.rewrite.split import Sample, beside, samples_below
from thermocomp.nc.rewrite.text import Vector

Kind = Literal["stop", "tool change", "feed", "start"]

#: while the correction is the same, cuts closer to the last one that was compared need not be compared [s]
_OFTEN = 1.0
#: number of durations of a stop that are tried between the ends of its range
_TRIED = 240


@dataclass
class OtherRun:
    """Run that differs from the assumed one in one respect.

    Parameters
    ----------
    text : str
        What is different, as stated by the user.
    value : float
        Duration of a stop or tool change [s], or fraction of the programmed feed.
    drift : DriftSource or None
        Drift in its initial state; None: that of the assumed run up to the first block that differs.

    Attributes
    ----------
    left : Left
        Remaining drift in the cuts of this run.
    """

    text: str
    value: float = 0.0
    drift: DriftSource | None = None
    left: Left = field(default_factory=Left, init=False)
    _found: list[Vector] = field(default_factory=list, init=False)

    def advance(self, dt: float, speed: float, places: Sequence[Point]) -> None:
        """Advance the drift by `dt` [s], and record it at the places of the samples of a cut."""
        assert self.drift is not None
        self._found = [self.drift.deviation(place) for place in places[:1]]
        pieces = max(len(places) - 1, 1)
        for k in range(1, pieces + 1):
            if dt > 0:
                self.drift.advance(dt / pieces, speed)
            self._found += [self.drift.deviation(place) for place in places[k : k + 1]]

    def take(
        self, block: Block, samples: Sequence[Sample], knots: Sequence[tuple[float, Vector]], top: float | None
    ) -> None:
        """Add what is left in a cut with the corrections at its knots."""
        if self._found:
            mine = [s._replace(deviation=d) for s, d in zip(samples, self._found, strict=True)]
            if counted := samples_below(block, mine, top):
                self.left.take(block.line.number, beside(counted, knots))


@dataclass
class Assumption:
    """Assumption about a run, and runs for which it is not true.

    Parameters
    ----------
    taken : str
        The assumption as text.
    assumed : float
        Assumed duration [s], or fraction of the programmed feed.

    Attributes
    ----------
    count : int
        Number of blocks to which it applies.
    """

    kind: Kind
    taken: str
    assumed: float = 0.0
    runs: Sequence[OtherRun] = ()
    count: int = field(default=0, init=False)

    def concerns(self, block: Block) -> bool:
        """Return whether a block takes another time if the assumption is not true."""
        match self.kind:
            case "stop":
                return block.stops
            case "tool change":
                return block.tool_change is not None
            case "feed":
                return any(not m.rapid for m in block.moves)
        return True

    def added(self, left: Left) -> list[float]:
        """Return what the runs add to the bound of X, Y and Z, given what is left in the assumed run [um]."""
        return [max([0.0, *(run.left.most[k] - left.most[k] for run in self.runs)]) for k in range(3)]


@dataclass
class Conditions:
    """Conditions of a bound, and the runs in which they are not true.

    Parameters
    ----------
    every : sequence of Assumption
        The conditions.
    limit : float or None
        Largest error by a stop of another duration for which no message is written [um]; None: no messages.
    """

    every: Sequence[Assumption] = ()
    limit: float | None = None
    _feeds: list[OtherRun] = field(default_factory=list, init=False)
    _seen: tuple[float, Vector | None] = field(default=(0.0, None), init=False)  # time and correction of the last cut
    _durations: dict[int, float] = field(default_factory=dict, init=False)  # of the present block, by run [s]

    def __post_init__(self) -> None:
        self._feeds = [run for c in self.every if c.kind == "feed" for run in c.runs]

    def time(self, blocks: Iterable[Block], limits: MotionLimits) -> Iterator[Timed]:
        """Yield each block with its times in the assumed run; those with other feeds are kept for `begin`."""
        copies = tee(blocks, 1 + len(self._feeds))
        factors = (limits.override, *(run.value for run in self._feeds))
        runs = [time_blocks(c, replace(limits, override=f)) for c, f in zip(copies, factors, strict=True)]
        for timed, *others in zip(*runs, strict=True):
            self._durations = {id(run): t.end - t.start for run, t in zip(self._feeds, others, strict=True)}
            yield timed

    def begin(self, block: Block, drift: DriftSource) -> None:
        """Begin the runs that differ from the assumed one from this block on, at its drift before the block."""
        for condition in self.every:
            if condition.concerns(block):
                condition.count += 1
                for run in condition.runs:
                    if run.drift is None:
                        run.drift = copy.deepcopy(drift)

    def advance(self, block: Block, dt: float, speed: float, places: Sequence[Point]) -> None:
        """Advance all runs over a block that takes `dt` seconds in the assumed run."""
        for condition in self.every:
            longer = condition.concerns(block) and condition.kind in ("stop", "tool change")
            for run in condition.runs:
                if run.drift is not None:
                    mine = self._durations.get(id(run), dt) + (run.value - condition.assumed if longer else 0.0)
                    run.advance(max(mine, 0.0), speed, places)

    def take(
        self,
        block: Block,
        samples: Sequence[Sample],
        knots: Sequence[tuple[float, Vector]],
        top: float | None,
        time: float,
        *,
        local: bool,
    ) -> None:
        """Add what is left in a cut in each run.

        Parameters
        ----------
        time : float
            End of the cut in the assumed run [s].
        local : bool
            The drift depends on the position.
        """
        same = knots[0][1] == knots[-1][1] == self._seen[1]
        if same and not local and time - self._seen[0] < _OFTEN:
            return
        self._seen = time, knots[-1][1]
        for condition in self.every:
            for run in condition.runs:
                run.take(block, samples, knots, top)

    def message(
        self, block: Block, drift: DriftSource, dt: float, speed: float, point: Point, *, shown: bool
    ) -> tuple[str, ...]:
        """Return the line before a stop whose duration matters: for how long the corrections after it are right.

        Parameters
        ----------
        drift : DriftSource
            Drift before the stop, which takes `dt` seconds in the assumed run.
        shown : bool
            The controller shows a comment that begins with ``MSG`` to the operator.
        """
        stop = next((c for c in self.every if c.kind == "stop" and c.runs), None)
        if self.limit is None or stop is None or not block.stops:
            return ()
        shortest, longest = (f([stop.assumed, *(run.value for run in stop.runs)]) for f in (min, max))
        tried = {shortest + (longest - shortest) * k / _TRIED for k in range(_TRIED + 1)}
        other, now, found = copy.deepcopy(drift), 0.0, dict[float, Vector]()
        for seconds in sorted({stop.assumed, *tried}):
            passed = max(dt + seconds - stop.assumed, now)
            other.advance(passed - now, speed)
            now, found[seconds] = passed, other.deviation(point)
        taken, limit = found[stop.assumed], self.limit
        bad = [t for t, d in found.items() if any(abs(a - b) > limit for a, b in zip(d, taken, strict=True))]
        short = [t for t in found if t > max([-1.0, *(b for b in bad if b < stop.assumed)])]
        long = [t for t in found if t < min([longest + 1.0, *(b for b in bad if b > stop.assumed)])]
        asked = [f"SHORTER THAN {min(short):.0f} S WAIT"] if min(short) > shortest else []
        asked += [f"LONGER THAN {max(long):.0f} S PROBE"] if max(long) < longest else []
        if not asked:
            return ()
        return (f"({'MSG, ' if shown else ''}DRIFT IN THIS STOP, {', '.join(asked)}){ending(block.line.text)}",)
