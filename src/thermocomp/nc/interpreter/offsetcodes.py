"""Codes that change offsets without moving the tool: work coordinate systems, G10, G52, G92, tool lengths."""

from thermocomp.nc.interpreter.block import Block, Known, triple
from thermocomp.nc.interpreter.codes import HAAS_SYSTEMS, ROTARY
from thermocomp.nc.interpreter.offsets import EXTERNAL, LAST, mark_axes
from thermocomp.nc.interpreter.state import InterpreterState
from thermocomp.nc.interpreter.words import BlockWords

_SYSTEMS = {f"G{53 + n}": n for n in range(1, 7)} | {f"G59.{n}": 6 + n for n in range(1, 4)}
_LENGTH_CERTAIN: Known = (True, True, True)


def select_system(state: InterpreterState, words: BlockWords) -> None:
    """Execute G54 to G59.3, Fanuc G54.1 P, or Haas G154 P and G110 to G129."""
    code = words.groups["system"]
    if code in ("G54.1", "G154"):
        number = words.whole("P", least=1)
        if number is None:
            raise words.error(f"{code} needs P, the number of the work coordinate system")
        system = 100 + number
    else:
        system = _SYSTEMS[code] if code in _SYSTEMS else 100 + HAAS_SYSTEMS[code]
    state.renamed(state.offsets.select(system))
    state.placed()


def tool_length(state: InterpreterState, words: BlockWords) -> None:
    """Execute a tool length offset: G43, G43.1, G43.2 or G49."""
    code = words.groups["tool length"]
    offsets = state.offsets
    if state.length_inch not in (None, state.modal.inch) and not state.fanuc:
        raise words.error(
            f"{code} after a change of unit (G20, G21) with a tool length in force: LinuxCNC 2.9 converts the length "
            "wrongly and moves Z by the error; write G49 before the unit changes"
        )
    state.length_inch = None if code == "G49" else state.modal.inch
    if code == "G43.1":
        # axes without a word keep their offset
        offset = triple(state.axis_values(words).get(i, old) for i, old in enumerate(offsets.tool))
        certain = _LENGTH_CERTAIN
        untold = None if "Z" in words.values else state.untold_tool
    elif code == "G49":
        offset, certain, untold = (0.0, 0.0, 0.0), _LENGTH_CERTAIN, None
    else:
        number = _length_number(state, words, code)
        sure = number in state.lengths or (number == 0 and state.fanuc)
        length = state.lengths.get(number, state.doubtful.get(number, 0.0))
        offset, certain = (0.0, 0.0, length), (True, True, sure)
        told = sure or (number in state.setup.tools and state.doubtful.get(number) == state.setup.tools[number])
        untold = None if told else number
        if code == "G43.2":
            untold = untold if state.untold_tool is None else state.untold_tool
            a, b, c = offsets.tool
            offset = (a, b, c + offset[2])
            certain = (certain[0], certain[1], certain[2] and offsets.certain_tool[2])
    state.renamed(offsets.set_tool(offset, certain))
    state.untold_tool = untold
    state.placed()


def _length_number(state: InterpreterState, words: BlockWords, code: str) -> int:
    number = words.whole("H")
    if state.fanuc:
        if number is None:
            number = state.length_number
        state.length_number = number
        return -1 if number is None else number
    if code == "G43.2" and not number:
        raise words.error("G43.2 needs H, the number of the tool whose length is added")
    return number or state.tool  # H0 is the tool in the spindle


def local(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G92 or G52, or a code that cancels or restores them."""
    code = words.groups["once"]
    offsets = state.offsets
    values = state.axis_values(words)
    if code in ("G92", "G52"):
        if not values and not ROTARY & words.values.keys():
            raise words.error(f"{code} without axis words; name the axes")
        if state.fanuc and any(offsets.shift) and code != state.shifted_by:
            raise words.error("G52 and G92 together are not supported; cancel one before the other")
        state.shifted_by = code
        block.kind = "set"
    for letter in ROTARY & words.values.keys():
        state.rezeroed.add(letter)
        if code == "G92":
            state.rotary[letter] = words.values[letter]
        state.turned_to()
    if code == "G92":
        offsets.name_place(state.place, values, state.known)
        still = _LENGTH_CERTAIN
    elif code == "G52":
        still = offsets.set_shift(values)
    elif code == "G92.3":
        still = offsets.restore_shift()
    elif code in ("G92.1", "G92.2"):
        still = offsets.drop_shift(keep=code == "G92.2")
    else:  # codes added to the table must be handled here
        raise words.error(f"{code} is known but not implemented; please report this")
    state.renamed(still)


def g10(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute G10: set origins or tool lengths."""
    kind = words.whole("L")
    number = words.whole("P")
    if kind not in (2, 20) and (state.fanuc or kind not in (1, 10, 11)):
        raise words.error(f"G10 L{kind if kind is not None else ''} is not supported; L2 and L20 are")
    if number is None:
        raise words.error(f"G10 L{kind} needs P, the number of the tool or work coordinate system")
    if kind in (2, 20):
        _origin(state, words, block, kind, number)
    else:
        _length(state, words, block, kind, number)


def _origin(state: InterpreterState, words: BlockWords, block: Block, kind: int, number: int) -> None:
    if anew := ROTARY & words.values.keys():
        state.rezeroed |= anew
        state.turned_to()
    offsets = state.offsets
    values = state.axis_values(words)
    if state.fanuc:
        system, rotation = (100 + number if kind == 20 else number or EXTERNAL), None
        if "R" in words.values:
            raise words.error("a Fanuc has no R with G10 L2; remove it")
        top = 6 if kind == 2 else 300
    else:
        system, rotation, top = number or offsets.system, words.values.get("R"), LAST
        if "I" in words.values or "J" in words.values or (rotation is not None and kind == 20):
            raise words.error(f"G10 L{kind} takes X Y Z{' and R' if kind == 2 else ''} only")
    if number > top:
        raise words.error(f"G10 L{kind} P{number}: there are only {top} work coordinate systems")
    if kind == 20 and not state.fanuc:
        offsets.name_origin(system, state.machine, values, state.known)
        if system == offsets.system:
            block.kind = "set"
            state.renamed(mark_axes(_LENGTH_CERTAIN, values, to=offsets.named or not number))
        return
    if not (number or offsets.named or state.fanuc):
        raise words.error(
            "G10 L2 P0 sets the work coordinate system in force, which the program has not selected; write G54 "
            "(or another) before it, or its number as P"
        )
    offsets.set_origin(system, values, rotation, add=state.fanuc and not state.modal.absolute)
    if system in (offsets.system, EXTERNAL) or not offsets.named:
        state.renamed(mark_axes(_LENGTH_CERTAIN, values, to=False))
        state.placed()
        if rotation is not None or (offsets.rotation and (0 in values or 1 in values)):
            state.known = (False, False, state.known[2])


def _length(state: InterpreterState, words: BlockWords, block: Block, kind: int, number: int) -> None:
    """Execute G10 L1, L10 or L11: set a tool length in the table; it takes effect with the next G43."""
    values = words.values
    if {"X", "Y", "A", "B", "C"} & values.keys():
        raise words.error(f"G10 L{kind} with X, Y or a rotary axis is not supported; Z and R are")
    if "Z" not in values:
        return
    length = values["Z"] * state.scale
    certain = True
    if kind != 1:
        block.kind = "set"
        offsets = state.offsets
        system = offsets.system if kind == 10 else LAST
        shift = offsets.shift[2] if kind == 10 else 0.0
        length = state.machine[2] - offsets.origins.get(system, (0.0, 0.0, 0.0))[2] - shift - length
        certain = kind == 10 and state.known[2] and offsets.certain_tool[2]
    state.lengths.pop(number, None)
    state.doubtful.pop(number, None)
    (state.lengths if certain else state.doubtful)[number] = length
