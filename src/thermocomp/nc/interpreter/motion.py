"""Moves: linear moves, arcs, cycles, home, machine coordinates, threads, probing, splines."""

from thermocomp.nc.interpreter import fanuc
from thermocomp.nc.interpreter.arcs import CENTRE, ArcError, Flat, centre_of_radius, check_centre
from thermocomp.nc.interpreter.block import PLANES, Arc, Block, Known, Move, triple
from thermocomp.nc.interpreter.codes import ROTARY
from thermocomp.nc.interpreter.cycles import KEPT, ROUNDING, CannedCycle, CycleError, pause
from thermocomp.nc.interpreter.offsets import mark_axes, replace_coordinates
from thermocomp.nc.interpreter.state import InterpreterState
from thermocomp.nc.interpreter.words import BlockWords

#: levels closer than this are equal [mm]
_SAME_LEVEL = 1e-4


def straight(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute a linear move, G0 or G1."""
    values = words.values
    rotary = state.turn(words) if "A" in values or "B" in values or "C" in values else 0.0
    if not rotary and not ("X" in values or "Y" in values or "Z" in values or "A" in values):
        return
    place, known = state.goal(words)
    start = state.machine
    offset = state.offsets.sum
    if offset is None:
        end = state.offsets.machine(place)
    else:
        end = (place[0] + offset[0], place[1] + offset[1], place[2] + offset[2])
    block.kind = "line"
    if state.modal.motion == "G0":
        block.moves.append(Move(rapid=True, start=start, end=end, arc=None, feed=0.0, seconds=None, rotary=rotary))
    else:
        block.moves.append(state.cut(words, start, end, None, rotary))
    state.place, state.machine, state.known = place, end, known


def in_machine(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G53: the words are machine coordinates."""
    if not state.modal.absolute:
        raise words.error("G53 is not allowed in G91; write G90 before it")
    _refuse_compensated(state, words, "G53")
    if state.modal.motion not in ("G0", "G1"):
        raise words.error("G53 needs G0 or G1 on its line or in force")
    rotary = state.turn(words)
    values = state.axis_values(words)
    if not values and not rotary:
        return
    start, end = state.machine, replace_coordinates(state.machine, values)
    block.kind = "machine"
    rapid = state.fanuc or state.modal.motion == "G0"
    block.moves.append(Move(True, start, end, rotary=rotary) if rapid else state.cut(words, start, end))
    state.machine = end
    state.place = state.offsets.program(end)
    state.known = _doubt(state, values)


def _refuse_compensated(state: InterpreterState, words: BlockWords, code: str) -> None:
    """Refuse a code that LinuxCNC also refuses during cutter compensation; the compensated path is not computed."""
    if state.modal.cutter:
        raise words.error(f"{code} is not allowed during cutter compensation; write G40 before it")


def _doubt(state: InterpreterState, axes: dict[int, float]) -> Known:
    """Return, per axis, whether it is still known after a move of some axes to machine coordinates."""
    known = mark_axes(state.known, axes, to=False)
    turned = state.offsets.rotation and (0 in axes or 1 in axes)
    return (False, False, known[2]) if turned else known


def home(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G28 or G30: via the point in the words; only the axes in the words move home, all if there are none."""
    code = words.groups["once"]
    _refuse_compensated(state, words, code)
    turns = not ROTARY.isdisjoint(words.values)  # whether already there or not
    rotary = state.turn(words)
    named = state.axis_values(words)
    if not named and not turns and state.fanuc:
        raise words.error(f"{code} without axis words; name the axes to return, such as {code} Z0")
    place, _ = state.goal(words)
    start, between = state.machine, state.offsets.machine(place)
    far = state.setup.home or (0.0, 0.0, 0.0)
    if named or turns:
        target = state.offsets.program(far)
        place = replace_coordinates(place, {i: target[i] for i in named})
        far = state.offsets.machine(place)
    block.kind = "home"
    block.moves += [Move(True, start, between, rotary=rotary), Move(True, between, far)]
    state.machine = far
    state.place = state.offsets.program(far)
    axes = named or ({} if turns else {0: 0.0, 1: 0.0, 2: 0.0})
    state.known = mark_axes(state.known, axes, to=False)


def arc(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute an arc, G2 or G3."""
    modal, values, scale = state.modal, words.values, state.scale
    first, second, _ = PLANES[modal.plane]
    letters = CENTRE[modal.plane]
    clockwise = modal.motion == "G2"
    turns = words.whole("P", least=1) or 1
    if letters[2] in values:
        raise words.error(f"{letters[2]} in an arc of G{modal.plane}; the centre is in {letters[0]} and {letters[1]}")
    has_centre = letters[0] in values or letters[1] in values
    if has_centre == ("R" in values):
        raise words.error("an arc needs its centre in I J K, or its radius in R, and not both")
    if modal.plane != 17 and state.offsets.rotation:
        raise words.error("an arc of G18 or G19 in rotated coordinates is not supported; write it as G1 moves")
    rotary = state.turn(words)
    start = state.place
    place, known = state.goal(words)
    begin, end = (start[first], start[second]), (place[first], place[second])
    try:
        if has_centre:
            centre = _centre(state, words, begin)
            check_centre(begin, end, centre, modal.inch)
        else:
            centre = centre_of_radius(begin, end, values["R"] * scale, clockwise)
    except ArcError as error:
        raise words.error(str(error)) from None
    middle = state.offsets.machine(replace_coordinates(place, {first: centre[0], second: centre[1]}))
    turned = Arc(modal.plane, (middle[first], middle[second]), clockwise, turns)
    was = state.machine
    state.reach(place, known)
    block.kind = "arc"
    block.moves.append(state.cut(words, was, state.machine, turned, rotary))


def _centre(state: InterpreterState, words: BlockWords, begin: Flat) -> Flat:
    """Return the centre from I J K, in program coordinates of the plane's axes."""
    letters = CENTRE[state.modal.plane]
    values, scale = words.values, state.scale
    a, b = values.get(letters[0]), values.get(letters[1])
    if state.modal.arc_absolute:
        if a is None or b is None:
            raise words.error(f"G90.1 needs {letters[0]} and {letters[1]} for every arc")
        return (a * scale, b * scale)
    return (begin[0] + (a or 0.0) * scale, begin[1] + (b or 0.0) * scale)


def in_step(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G33 or G33.1, synchronised with the spindle; G33.1 returns to its start."""
    code = state.modal.motion
    if "K" not in words.values:
        raise words.error(f"{code} needs K, the distance per turn")
    if "F" in words.values:
        raise words.error(f"{code} gets its feed from K, but F was found; remove F")
    _refuse_compensated(state, words, code)
    rotary = state.turn(words)
    start, before, was_known = state.machine, state.place, state.known
    state.reach(*state.goal(words))
    pitch = words.values["K"] * state.scale
    block.kind = "line"
    block.moves.append(state.per_turn(words, start, state.machine, abs(pitch), rotary=rotary))
    if code == "G33.1":
        back = words.values.get("I", 1.0)
        if back <= 0.0:
            raise words.error(f"G33.1 with I{back:g}: the speed multiple of the return must be above 0")
        block.moves.append(state.per_turn(words, state.machine, start, abs(pitch) * back))
        state.reach(before, was_known)


def probe(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G38 or G31: the end of the move is unknown; the target is used as the end."""
    code = state.modal.motion
    _refuse_compensated(state, words, code)
    if state.modal.feed_mode == 95:
        raise words.error(f"{code} needs a feed per minute; write G94 and F before it")
    rotary = state.turn(words)
    start, before = state.machine, state.place
    place, known = state.goal(words)
    if place == before and not rotary:
        raise words.error(f"{code} ends where it starts; check its axis words")
    state.reach(place, known)
    block.kind = "probe"
    block.moves.append(state.cut(words, start, state.machine, None, rotary))
    state.known = mark_axes(known, {i: 0.0 for i in range(3) if place[i] != before[i]}, to=False)


def curve(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G5 or G5.1; the move is recorded as the straight line from start to end."""
    code, values = state.modal.motion, words.values
    if code not in ("G5", "G5.1"):  # codes added to the table must be handled here
        raise words.error(f"{code} is known but not implemented; please report this")
    if state.modal.plane != 17 or {"Z", "A", "B", "C"} & values.keys():
        raise words.error(f"{code} is for X and Y in G17 only")
    _refuse_compensated(state, words, code)
    if state.modal.feed_mode == 93:
        raise words.error(f"{code} in G93 is not supported; write G94 and F before it")
    needed = ("P", "Q") if code == "G5" else ("I", "J")
    if not all(letter in values for letter in needed):
        raise words.error(f"{code} needs {needed[0]} and {needed[1]}")
    if ("I" in values) != ("J" in values):
        raise words.error("G5 needs both I and J, or neither")
    start = state.machine
    state.reach(*state.goal(words))
    block.kind = "curve"
    block.moves.append(state.cut(words, start, state.machine))


def cycle(state: InterpreterState, words: BlockWords, block: Block, again: bool) -> None:
    """Execute a canned cycle, G73 to G89."""
    modal, values = state.modal, words.values
    code, scale = modal.motion, state.scale
    _may_drill(state, words)
    if state.fanuc:
        fanuc.check_dwell(words)
    across = PLANES[modal.plane][2]
    letter = "XYZ"[across]
    axes = {"XYZ"[i]: v / scale for i, v in state.axis_values(words).items()}
    named = {c: v for c, v in axes.items() if c != letter}
    _keep_words(state, words, again, axes, letter)
    start = state.place
    frame = (modal.plane, modal.inch, modal.diameter)
    if state.level is None:
        state.level, state.level_known, state.level_frame = start[across], state.known[across], frame
        state.keeps_levels = False
    elif state.level_frame != frame:
        raise words.error(f"{code} continues a cycle after a change of plane or unit; write G80 before the change")
    elif modal.absolute and modal.retract == 98 and not state.fanuc:
        _refuse_near_r(start[across], state.level, state.sticky["R"] * scale, words)
    block.kind, block.sticky, block.keeps_levels = "cycle", state.sticky, state.keeps_levels
    if state.fanuc and not fanuc.drills(state, words):
        return
    repeats = words.whole("K" if "K" in values and state.fanuc else "L", least=1) or 1
    begin = triple(v / scale for v in start)
    run = CannedCycle(
        modal=modal,
        start=begin,
        named=named,
        sticky=state.sticky,
        level=state.level / scale,
        repeats=repeats,
        direct=state.fanuc,
        levels=state.keeps_levels,
    )
    _turn_for_a_tap(state, words, block)
    block.pause += repeats * dwell_seconds(state, pause(code, state.sticky))
    at = state.machine
    try:
        for rapid, (x, y, z) in run.steps():
            start = (x * scale, y * scale, z * scale)
            end = state.offsets.machine(start)
            block.moves.append(Move(True, at, end) if rapid else state.cut(words, at, end))
            at = end
    except CycleError as error:
        raise words.error(f"{code}: {error}") from None
    known = state.known
    if modal.absolute:
        known = mark_axes(known, {i: 0.0 for i in range(3) if "XYZ"[i] in named}, to=True)
    state.place, state.machine = start, at
    state.known = mark_axes(known, {across: 0.0}, to=_ends_certainly(state))


def _keep_words(state: InterpreterState, words: BlockWords, again: bool, axes: dict[str, float], letter: str) -> None:
    """Store the words of a cycle that also hold for the following holes."""
    values, code = words.values, state.modal.motion
    kept = {c: values[c] for c in "RQPIJK" if c in values and (c != "K" or not state.fanuc)}
    depth = {letter: axes[letter]} if letter in axes else {}
    state.sticky = (state.sticky if again else {}) | kept | depth
    missing = [c for c in KEPT[code] + letter if c not in state.sticky and not (state.fanuc and c == "P")]
    if missing:
        raise words.error(f"{code} needs {' '.join(missing)} on its first line")
    if code in ("G73", "G83") and state.sticky["Q"] <= 0.0:
        raise words.error(f"Q of {code} must be above 0")
    if code in ("G74", "G84") and not state.fanuc:
        state.sticky.setdefault("P", state.last_dwell)  # P of the previous cycle, in LinuxCNC
    state.last_dwell = state.sticky.get("P", state.last_dwell)


def _turn_for_a_tap(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Start the spindle, as the tapping cycles of a Fanuc do."""
    code = state.modal.motion
    if state.fanuc and code in ("G74", "G84") and not state.turning:
        if state.spindle is None:
            raise words.error(f"{code} without a spindle speed; write S before it")
        block.speed = state.spindle if code == "G84" else -state.spindle


def _ends_certainly(state: InterpreterState) -> bool:
    """Return whether the level after a cycle is known: R (G99), the initial level (G98), or R in either mode."""
    modal = state.modal
    absolute = modal.absolute or state.keeps_levels
    if modal.retract_stated and modal.retract == 99 and absolute:
        return True
    rises = state.sticky["R"] * state.scale - (state.level or 0.0 if absolute else 0.0)
    return state.level_known and (modal.retract_stated or rises >= 0.0)


def _refuse_near_r(start: float, level: float, plane: float, words: BlockWords) -> None:
    if ROUNDING < abs(start - plane) < _SAME_LEVEL < abs(level - plane):
        raise words.error(
            "G98 after a hole that ended at almost the same R: whether LinuxCNC retracts before the next hole depends "
            "on rounding; write the same R, or G80 between them"
        )


def _may_drill(state: InterpreterState, words: BlockWords) -> None:
    code, modal = state.modal.motion, state.modal
    if {"A", "B", "C"} & words.values.keys():
        raise words.error(f"{code} with a rotary axis; turn the axis on an earlier line")
    if modal.feed_mode == 93:
        raise words.error(f"{code} is not allowed in G93; write G94 and F before it")
    _refuse_compensated(state, words, code)
    if state.fanuc:
        return
    turning = state.turning
    if code in ("G74", "G84", "G87") and modal.plane != 17:
        raise words.error(f"{code} in G{modal.plane}: LinuxCNC 2.9 confuses the axes there; write G17 before it")
    if code in ("G74", "G84", "G86", "G87") and not turning:
        raise words.error(f"{code} while the spindle is stopped; start it first")
    if (code == "G84" and turning < 0) or (code == "G74" and turning > 0):
        raise words.error(
            f"{code} while the spindle turns in the wrong direction; write {'M3' if code == 'G84' else 'M4'} before it"
        )


def dwell_seconds(state: InterpreterState, p: float) -> float:
    """Return the time of a dwell [s]: P is in seconds in LinuxCNC, in milliseconds in Fanuc."""
    return p / 1000.0 if state.fanuc else p
