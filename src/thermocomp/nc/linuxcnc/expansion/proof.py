"""Verification that two programs have the same effect on a machine."""

import math
from collections.abc import Iterator
from itertools import zip_longest
from typing import NamedTuple

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.linuxcnc.rs274 import ORIGIN, PLANE_AXES, Canonical, Place, ProgramFrame

TOLERANCE = 1e-6  #: of positions [mm]
#: calls that set a state, with the name of the state
STATES = {
    "feedmode": "feed mode", "speed": "speed", "speedmode": "speed mode", "select": "tool", "path": "path",
    "naive": "naive",
    "m3": "spindle", "m4": "spindle", "m5": "spindle", "mist": "mist", "mistoff": "mist", "flood": "flood",
    "floodoff": "flood", "sync": "sync", "unsync": "sync", "feedoverride": "feed override",
    "nofeedoverride": "feed override", "speedoverride": "speed override", "nospeedoverride": "speed override",
    "adaptive": "adaptive", "noadaptive": "adaptive", "feedhold": "feed hold", "nofeedhold": "feed hold",
}  # fmt: skip
#: calls that have no effect on the machine, or whose effect is visible in the moves
REMARKS = {"comment", "unit", "plane", "feedrate", "g5x", "g92", "rotation", "length"}
#: parameters that a controller stores: homes, G92, work coordinate systems
KEPT = range(5161, 5391)
#: of these, the offsets of G92 and G52, and the flag that they are in force
G92, G92_IN_FORCE = range(5211, 5220), 5210


class Act(NamedTuple):
    """Action of the machine, with the state in which it occurs."""

    line: int
    kind: str
    numbers: tuple[float, ...]  #: for moves: machine coordinates [mm, deg] and the feed
    state: tuple[tuple[str, str, tuple[float, ...]], ...]
    text: str

    def told(self) -> str:
        """Return the action of the machine as text, for messages."""
        return f"{self.kind} {' '.join(f'{n:.6f}' for n in self.numbers)} {self.text}".strip()


def compare(asked: Iterator[Canonical], done: Iterator[Canonical]) -> int:
    """Compare the actions of two programs in the same controller.

    Returns
    -------
    int
        Number of actions, all equal: moves within 1e-6 mm, their feeds, spindle, coolant, tools, stops, dwells.
    """
    count, line = 0, 1
    for first, second in zip_longest(trace_acts(asked), trace_acts(done)):
        line = first.line if first else line
        if first is None or second is None or not _equal(first, second):
            words = [act.told() if act else "nothing" for act in (first, second)]
            if first and second and words[0] == words[1]:
                words = [f"{word} with {act.state}" for word, act in zip(words, (first, second), strict=True)]
            raise ProgramError(
                max(line, 1), f"the plain lines would not do the same as the program: {words[1]} instead of {words[0]}"
            )
        count += 1
    return count


def compare_parameters(asked: dict[int, float], done: dict[int, float]) -> None:
    """Compare the parameters that two programs leave in the controller; raise `ProgramError` if they differ."""
    shifted = any(left.get(number) for left in (asked, done) for number in G92)
    for number in KEPT:
        if number == G92_IN_FORCE and not shifted:
            continue  # the shift is zero, whether in force or not
        if abs(asked.get(number, 0.0) - done.get(number, 0.0)) > TOLERANCE:
            raise ProgramError(
                1, f"the plain lines would leave a different value in parameter #{number} of the controller"
            )


def trace_acts(calls: Iterator[Canonical]) -> Iterator[Act]:
    """Yield the actions of the machine from the first line on, without moves of zero length."""
    frame, here, feed = ProgramFrame(), ORIGIN, (0.0, 0.0)
    states: dict[str, tuple[str, str, tuple[float, ...]]] = {}
    state: tuple[tuple[str, str, tuple[float, ...]], ...] = ()
    for call in calls:
        kind = call.kind
        if kind in {"rapid", "feed", "arc", "probe", "tap", "curve"}:
            end, numbers = _way(call, frame, here)
            if kind in {"rapid", "feed"} and all(abs(x - y) < 2 * TOLERANCE for x, y in zip(end, here, strict=True)):
                continue
            if kind != "rapid" and states.get("sync", ("", "", ()))[1] != "sync":
                turning = all(abs(end[i] - here[i]) < TOLERANCE for i in (0, 1, 2, 6, 7, 8))  # rotary axes alone
                numbers = (*numbers, feed[turning])
            here = end
            if call.line:
                yield Act(line=call.line, kind=kind, numbers=numbers, state=state, text="")
        elif kind in STATES:
            states[STATES[kind]] = (STATES[kind], kind, call.values)
            state = tuple(states[name] for name in sorted(states))
        elif kind == "feedrate":
            feed = call.values[0], call.values[1]
        elif kind in REMARKS:
            frame.take(kind, call.values)
        elif call.line:
            yield Act(line=call.line, kind=kind, numbers=call.values, state=state, text=call.text)


def _way(call: Canonical, frame: ProgramFrame, here: Place) -> tuple[Place, tuple[float, ...]]:
    """Return the end of a move and all data of its path, in machine coordinates."""
    if (arc := call.arc) is not None:
        numbers = (*call.machine, arc.plane, arc.turns, *arc.machine_centre, _sweep(call, frame.program(here)))
        return call.machine, numbers
    if call.kind in {"rapid", "feed", "probe"}:
        return call.machine, call.machine
    from_here = frame.program(here)
    if call.kind == "tap":
        x, y, z = call.values[:3]
        return here, (*frame.machine((x, y, z, *from_here[3:])), call.values[3])
    ways = [frame.machine((x, y, *from_here[2:])) for x, y in zip(call.values[1::3], call.values[2::3], strict=True)]
    return ways[-1], tuple(v for way in ways for v in way)


def _sweep(call: Canonical, start: Place) -> float:
    """Return the length of an arc in its plane [mm]: end points alone do not distinguish a full circle from none."""
    assert call.arc is not None
    i, j, _ = PLANE_AXES[call.arc.plane]
    x, y = call.arc.centre[i], call.arc.centre[j]
    first = math.atan2(start[j] - y, start[i] - x)
    last = math.atan2(call.program[j] - y, call.program[i] - x)
    radius = math.hypot(start[i] - x, start[j] - y)
    angle = ((last - first) if call.arc.turns > 0 else (first - last)) % math.tau
    if min(angle, math.tau - angle) * radius < 2 * TOLERANCE:
        # if start and end differ by less than the written digits, a full turn or none depends on the controller
        angle = math.tau if math.dist((start[i], start[j]), (call.program[i], call.program[j])) < 1e-9 else angle
    return radius * (angle + (abs(call.arc.turns) - 1) * math.tau)


def _equal(asked: Act, done: Act) -> bool:
    if (asked.kind, len(asked.numbers), asked.text) != (done.kind, len(done.numbers), done.text):
        return False
    if asked.state != done.state and not (
        [s[:2] for s in asked.state] == [s[:2] for s in done.state]
        and all(all(map(_near, s[2], t[2])) for s, t in zip(asked.state, done.state, strict=True))
    ):
        return False
    return all(map(_near, asked.numbers, done.numbers))


def _near(first: float, second: float) -> bool:
    # above 1 m, rotated and summed coordinates exceed the precision of a double at 1e-6 mm
    return abs(first - second) <= TOLERANCE * max(1.0, abs(first) / 1000.0)
