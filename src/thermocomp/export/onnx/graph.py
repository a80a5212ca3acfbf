"""A compensator as one step of ONNX: values and a state in, corrections and the next state out.

The processing chain is that of `thermocomp.runtime.program.steps`, without the watch over the sensors and without the
averaging of the zero: the caller supplies the zero.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thermocomp.core.bounds import GAP, MEMORY, READING
from thermocomp.export.onnx.expression import Memory, Walk
from thermocomp.export.onnx.limits import Drive
from thermocomp.export.onnx.nodes import Graph
from thermocomp.export.onnx.support import support
from thermocomp.runtime.program.steps import ACTIVE, FADING, HOLDING, SHADOW
from thermocomp.runtime.program.tables import Tables, formula

#: elements at the beginning of the state: has begun, clock, values were used, time of last use
CLOCKS = 4


@dataclass(frozen=True)
class GraphBlock:
    """A compensator as a graph.

    Parameters
    ----------
    size : int
        Number of elements of its state.
    deviation : int
        Index of the models' deviations in the state.
    """

    graph: Graph
    size: int
    deviation: int


@dataclass(frozen=True)
class _Moment:
    """Time of a call, and whether its values are used.

    Parameters
    ----------
    passes, seen : str
        Whether the values are used; whether earlier values were used.
    travel, step : str
        Time available for moving the corrections, and time since the last values used [s].
    clocks : str
        Elements of the next state.
    """

    passes: str
    seen: str
    travel: str
    step: str
    clocks: str


def translate(tables: Tables) -> GraphBlock:
    """Return a compensator as an ONNX graph that processes one reading."""
    g, n, targets = Graph(), len(tables.channels), len(tables.targets)
    places = [CLOCKS + k * targets for k in range(4)]
    value, zero, dt = g.enter("value", (n,)), g.enter("zero", (n,)), g.enter("dt")
    drive = Drive(g, tables)
    state = _checked(g, drive, "state", places)
    change, plausible = _changes(g, tables, value, zero)
    moment = _moment(g, tables, state, dt, plausible)
    idle, correction, slope = (g.part(state, a, a + targets) for a in places[:3])
    memory = Memory(g, state, places[3])
    learned = _models(g, tables, memory, moment, change)
    learned = g.choose(moment.passes, learned, g.part(state, places[3], memory.end))
    idle = g.choose(moment.passes, np.zeros(targets), g.add(idle, moment.travel))
    moved = drive.move(g.part(learned, 0, len(tables.models)), correction, slope, moment.travel)
    rested = drive.rest(correction, slope, idle, moment.travel)
    correction, slope = (g.choose(moment.passes, a, b) for a, b in zip(moved, rested, strict=True))
    waits = g.choose(g.put("Greater", idle, tables.values["hold"]), FADING, HOLDING)
    status = g.choose(np.array(tables.values["shadow"]), SHADOW, g.choose(moment.passes, ACTIVE, waits))
    g.enter("state", (memory.end,))
    g.leave("correction", correction, (targets,))
    g.leave("slope", slope, (targets,))
    g.leave("status", status, (targets,), np.int64)
    g.leave("next_state", g.join([moment.clocks, idle, correction, slope, learned]), (memory.end,))
    return GraphBlock(g, memory.end, places[3])


def _checked(g: Graph, drive: Drive, state: str, places: list[int]) -> str:
    """Return the incoming state, or the initial state if it contains values that this graph cannot have produced."""
    correction, slope = (g.part(state, a, b) for a, b in pairwise(places[1:]))
    finite = g.every(g.put("LessOrEqual", g.put("Abs", state), MEMORY))
    sound = g.put("And", finite, drive.holds(correction, slope))
    return g.choose(sound, state, 0.0)


def _changes(g: Graph, tables: Tables, value: str, zero: str) -> tuple[str, str]:
    """Return all inputs minus their zero, and whether all are present, finite and plausible.

    An invalid value is replaced by its zero, an invalid zero by the training zero; such a call is rejected.
    """
    t = tables.values
    rezero, applies, reference = np.array(t["rezero"]), np.array(t["applies"]), np.array(t["reference"])
    given, begin = g.pick(value, t["channel"]), g.pick(zero, t["channel"])
    known = g.put("LessOrEqual", g.put("Abs", begin), READING)
    begin = g.choose(g.put("And", rezero, known), begin, reference)
    bounded = applies > 0
    low, high, room = (np.array(t[name]) for name in ("low", "high", "room"))
    least = g.put("Max", np.array(t["least"]), g.choose(bounded, g.put("Sub", g.add(begin, low), room), -np.inf))
    most = g.put("Min", np.array(t["most"]), g.choose(bounded, g.add(begin, high, room), np.inf))
    there = g.put("And", g.put("GreaterOrEqual", given, least), g.put("LessOrEqual", given, most))
    used = g.choose(there, given, begin)
    return g.put("Sub", used, begin), g.every(g.put("And", there, g.put("Or", known, ~rezero)))


def _moment(g: Graph, tables: Tables, state: str, dt: str, plausible: str) -> _Moment:
    """Return the time of a call; an invalid time changes nothing."""
    begun, clock, seen, last = (g.pick(state, k) for k in range(CLOCKS))
    begun, seen = g.put("Greater", begun, 0.5), g.put("Greater", seen, 0.5)
    good = g.put("And", g.put("GreaterOrEqual", dt, 0.0), g.put("LessOrEqual", dt, GAP))
    now = g.add(clock, g.choose(g.put("And", good, begun), dt, 0.0))
    later = g.put("Or", g.put("Not", seen), g.put("Greater", now, last))
    passes = g.put("And", g.put("And", good, later), plausible)
    travel = g.put("Min", g.put("Sub", now, clock), tables.values["reading_age"])
    since = g.between(g.put("Sub", now, last), 0.0, GAP)
    step = g.choose(g.put("And", seen, passes), since, 0.0)
    flags = (g.choose(g.put("Or", was, new), 1.0, 0.0) for was, new in ((begun, good), (seen, passes)))
    clocks = g.join([next(flags), now, next(flags), g.choose(passes, now, last)])
    return _Moment(passes=passes, seen=seen, travel=travel, step=step, clocks=clocks)


def _models(g: Graph, tables: Tables, memory: Memory, moment: _Moment, change: str) -> str:
    """Return the outputs of the models, and their next state."""
    last = memory.before(len(tables.models))
    inputs = [g.pick(change, k) for k in range(len(tables.ranges))]
    walk, said = Walk(g, inputs, moment.seen, moment.step, memory), list[str]()
    for k, model in enumerate(tables.models):
        own = g.pick(change, [tables.ranges.index(i) for i in model.inputs]) if model.inputs else change
        said.append(support(g, model, own, walk.value(formula(model, tables.ranges)), g.pick(last, k)))
    return g.join([*said, *memory.after])
