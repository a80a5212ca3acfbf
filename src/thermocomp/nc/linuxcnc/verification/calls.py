"""Calls of one run of LinuxCNC's interpreter as columns: machine positions and durations of moves."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermocomp.core.exceptions import Unprovable
from thermocomp.nc.linuxcnc.rs274 import ORIGIN, PLANE_AXES, ProgramFrame
from thermocomp.nc.linuxcnc.rs274process import CallBlock, InterpreterRun
from thermocomp.nc.linuxcnc.verification.ledger import Floats, Integers

#: an axis that moves less is at rest [mm, deg]
STILL = 1e-6
#: LinuxCNC regards an arc of a smaller angle as a full circle [rad]
FUZZ = 1e-6
#: calls not compared: offsets are verified by the tool positions; comments and line numbers may differ
PASSED = ("g5x", "g92", "length", "tooltable", "rotation", "comment", "message", "file", "centre", "done")
FRAMES = ("g5x", "g92", "length", "rotation")
STRAIGHT = ("rapid", "feed", "probe", "arc")
MOVES = (*STRAIGHT, "tap", "curve")
#: maximum number of calls held back until their line is complete
MOST = 1 << 16
_SPINDLE = ("feedmode", "sync", "unsync", "speed")


@dataclass
class Calls:
    """Columns with one entry per call.

    Parameters
    ----------
    kind, line, raw : array of int
        Code of the kind; line in the original; line in the program that was run.
    values : array, calls x 10
        Numbers of the call; for a curve or tap, the first is its index in `Side.curves`.
    start, end : array, calls x 9
        Start and end of moves: machine coordinates [mm, deg].
    centre : array, calls x 2
        Centre of arcs: machine coordinates in their plane [mm].
    plane, turns : array of int
        Plane of arcs: 17, 18, 19; number of turns, positive counterclockwise.
    sweep : array
        Angle of arcs [rad].
    seconds : array
        Duration of moves at feed rate [s].
    """

    kind: Integers
    line: Integers
    raw: Integers
    values: Floats
    start: Floats
    end: Floats
    centre: Floats
    plane: Integers
    turns: Integers
    sweep: Floats
    seconds: Floats

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, which: Any) -> "Calls":
        """Return the calls selected by a slice, a mask or indices."""
        return Calls(**{name: column[which] for name, column in vars(self).items()})

    def then(self, others: "Calls") -> "Calls":
        """Return these calls, followed by other calls."""
        pairs = zip(vars(self).items(), vars(others).values(), strict=True)
        return Calls(**{name: np.concatenate((mine, more)) for (name, mine), more in pairs})


class Side:
    """Calls of one run of the interpreter, prepared for comparison with the other run.

    Parameters
    ----------
    original : callable
        Maps lines of the program that is run to lines of the original.
    drop : callable
        Selects lines of the original whose feed word is not compared.

    Attributes
    ----------
    curves : list of array
        Points of curves and ends of taps, machine coordinates [mm, deg].
    """

    def __init__(
        self,
        run: InterpreterRun,
        original: Callable[[Integers], Integers],
        drop: Callable[[Integers], "np.ndarray[Any, Any]"],
    ) -> None:
        self.run, self.original, self.drop = run, original, drop
        self.curves: list[Floats] = []
        self._frame = ProgramFrame()
        self._here = np.array(ORIGIN)
        self._states = {"feed": np.zeros(2), "feedmode": np.zeros(2), "sync": np.zeros(2), "speed": np.zeros(2)}

    def chunks(self) -> Iterator[Calls]:
        """Yield the calls to be compared, keeping those of one line together."""
        kept: Calls | None = None
        for block in self.run.blocks():
            calls = self._calls(block)
            if kept is not None:
                calls = kept.then(calls)
            changes = np.flatnonzero(calls.line[1:] != calls.line[:-1])
            end = len(calls) if len(calls) > MOST else int(changes[-1]) + 1 if len(changes) else 0
            if end:
                yield calls.take(slice(0, end))
            kept = calls.take(slice(end, None))
        if kept is not None and len(kept):
            yield kept

    def is_kind(self, kinds: Integers, *names: str) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Return a mask of the calls of the given kinds."""
        table = np.zeros(len(self.run.codes), bool)
        table[[self.run.codes[name] for name in names]] = True
        return table[kinds]

    def name(self, kind: int) -> str:
        """Return the name of a kind of calls."""
        return next(name for name, code in self.run.codes.items() if code == kind)

    def _calls(self, block: CallBlock) -> Calls:
        records = block.records
        kind, raw = records["kind"].astype(int), records["line"].astype(int)
        values = np.ascontiguousarray(records["values"])
        for told in np.flatnonzero(kind == self.run.codes["file"]).tolist():
            if file := block.more[int(values[told, 0])]:
                line = int(raw[max(told - 1, 0)])
                raise Unprovable(
                    f"line {line}: the program calls another file, {file.rsplit('/')[-1]}; --expand inserts its lines"
                )
        plane, turns = self._turned(kind, values)
        end, moving = self._ends(block, kind, values)
        last = np.maximum.accumulate(np.where(moving, np.arange(len(kind)), -1))
        before = np.concatenate(([-1], last[:-1]))
        start = end[before]
        start[before < 0] = self._here
        if last[-1] >= 0:
            self._here = end[last[-1]].copy()
        centre, sweep = _arcs(plane, turns, start, end)
        calls = Calls(
            kind=kind,
            line=raw,
            raw=raw,
            values=values,
            start=start,
            end=end,
            centre=centre,
            plane=plane,
            turns=turns,
            sweep=sweep,
            seconds=np.zeros(len(kind)),
        )
        calls.seconds = self._seconds(calls, moving)
        keep = (raw > 0) & ~self.is_kind(kind, *PASSED)
        calls = calls.take(np.flatnonzero(keep))
        calls.line = self.original(calls.raw)
        feeds = calls.kind == self.run.codes["feedrate"]
        if feeds.any():
            calls = calls.take(np.flatnonzero(~(feeds & self.drop(calls.line))))
        return calls

    # -- positions ---------------------------------------------------------------------------------------------------

    def _ends(self, block: CallBlock, kind: Integers, values: Floats) -> tuple[Floats, "np.ndarray[Any, Any]"]:
        """Return the ends of moves and a mask of moves; offsets may change between moves."""
        end = np.zeros((len(kind), 9))
        moving = self.is_kind(kind, *STRAIGHT)
        bent = self.is_kind(kind, "tap", "curve")
        changes = np.flatnonzero(self.is_kind(kind, *FRAMES)).tolist()
        for first, last in zip([-1, *changes], [*changes, len(kind)], strict=True):
            if first >= 0:
                name = self.name(int(kind[first]))
                count = int(block.records["count"][first])
                self._frame.take(name, tuple(values[first, :count].tolist()))
            if last > first + 1:
                part = slice(first + 1, last)
                end[part] = self._frame.machines(values[part, :9])
                for i in (np.flatnonzero(bent[part]) + first + 1).tolist():
                    self._bend(block, i, kind, values, end)
        return end, moving | bent

    def _bend(self, block: CallBlock, i: int, kind: Integers, values: Floats, end: Floats) -> None:
        """Store the points of a tap or a curve, and set its end."""
        earlier = np.flatnonzero(self.is_kind(kind[:i], *MOVES))
        here = end[earlier[-1]] if len(earlier) else self._here
        there = self._frame.program(tuple(here.tolist()))
        if kind[i] == self.run.codes["tap"]:
            points = [(*values[i, :3].tolist(), *there[3:])]
            values[i, 1], values[i, 2], values[i, 3] = values[i, 3], 0.0, 0.0  # speed scale
        else:
            numbers = block.more[int(values[i, 0])]
            points = [(x, y, *there[2:]) for x, y in zip(numbers[1::3], numbers[2::3], strict=True)]
            values[i, 1], values[i, 2] = numbers[0], sum(numbers[3::3])  # order, weights
        values[i, 0] = len(self.curves)
        places = self._frame.machines(np.array(points))
        self.curves.append(places)
        end[i] = here if kind[i] == self.run.codes["tap"] else places[-1]

    def _turned(self, kind: Integers, values: Floats) -> tuple[Integers, Integers]:
        """Return plane and turns of arcs; insert the centre of each arc, as a point, in its preceding record."""
        plane, turns = np.zeros(len(kind), int), np.zeros(len(kind), int)
        arcs = np.flatnonzero(kind == self.run.codes["arc"])
        if len(arcs):
            first, second, turns[arcs], plane[arcs] = values[arcs - 1, :4].T
            values[arcs - 1] = values[arcs]
            for number, (i, j, _) in PLANE_AXES.items():
                mine = plane[arcs] == number
                values[arcs[mine] - 1, i], values[arcs[mine] - 1, j] = first[mine], second[mine]
        return plane, turns

    # -- durations ---------------------------------------------------------------------------------------------------

    def _seconds(self, calls: Calls, moving: "np.ndarray[Any, Any]") -> Floats:
        """Return the durations of feed moves [s]; with F per revolution and a stopped spindle, in minutes per 1/min."""
        feed = self._state("feed", calls, "feedrate")
        if self.is_kind(calls.kind, *_SPINDLE).any() or self._states["sync"][0] or self._states["feedmode"][1]:
            mode = self._state("feedmode", calls, "feedmode")[:, 1]
            pitch = self._state("sync", calls, "sync", "unsync")[:, 1]
            speed = np.abs(self._state("speed", calls, "speed")[:, 1])
            per_turn = (mode > 0) | (pitch > 0)
            each = np.where(pitch > 0, pitch, feed[:, 0])
            turning = np.where(speed > 0, speed, 60.0)
            feed = np.where(per_turn[:, None], np.stack((each, feed[:, 1]), axis=1) * turning[:, None], feed)
        way = np.abs(calls.end - calls.start)
        linear, other = _long(way[:, :3]), _long(way[:, 6:])
        arcs = np.flatnonzero(calls.plane)
        if len(arcs):
            for number, (i, j, k) in PLANE_AXES.items():
                mine = arcs[calls.plane[arcs] == number]
                radius = _long(calls.start[mine][:, [i, j]] - calls.centre[mine])
                linear[mine] = np.hypot(radius * calls.sweep[mine], way[mine, k])
        for i in np.flatnonzero(self.is_kind(calls.kind, "tap", "curve")).tolist():
            points = np.concatenate((calls.start[i : i + 1], self.curves[int(calls.values[i, 0])]))
            linear[i] = _long(np.diff(points[:, :3], axis=0)).sum()
        linear = np.where(linear > STILL, linear, other)
        turns_only = linear <= STILL
        length = np.where(turns_only, _long(way[:, 3:6]), linear)
        rate = np.where(turns_only, feed[:, 1], feed[:, 0])
        fed = moving & (calls.kind != self.run.codes["rapid"]) & (rate > 0)
        return np.where(fed, 60.0 * length / np.where(fed, rate, 1.0), 0.0)

    def _state(self, name: str, calls: Calls, *kinds: str) -> Floats:
        """Return, for each call, two numbers of the latest call of the given kinds."""
        told = np.flatnonzero(self.is_kind(calls.kind, *kinds))
        if not len(told):
            return np.broadcast_to(self._states[name], (len(calls), 2))
        rows = np.concatenate((self._states[name][None], calls.values[told, :2]))
        self._states[name] = rows[-1]
        since = np.zeros(len(calls), int)
        since[told] = 1
        result: Floats = rows[np.cumsum(since)]
        return result


def _arcs(plane: Integers, turns: Integers, start: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Return centre and angle of arcs; the row before the end of an arc contains its centre."""
    centre, sweep = np.zeros((len(plane), 2)), np.zeros(len(plane))
    if not plane.any():
        return centre, sweep
    for number, (i, j, _) in PLANE_AXES.items():
        mine = np.flatnonzero(plane == number)
        axes = [i, j]
        centre[mine] = end[mine - 1][:, axes]
        x, y = (start[mine][:, axes] - centre[mine]).T
        first = np.arctan2(y, x)
        x, y = (end[mine][:, axes] - centre[mine]).T
        last = np.arctan2(y, x)
        angle = np.where(turns[mine] > 0, last - first, first - last) % (2 * np.pi)
        angle[angle < FUZZ] += 2 * np.pi
        sweep[mine] = angle + (abs(turns[mine]) - 1) * 2 * np.pi
    return centre, sweep


def _long(ways: Floats) -> Floats:
    result: Floats = np.sqrt(np.einsum("ij,ij->i", ways, ways))
    return result
