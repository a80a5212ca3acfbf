"""Settings that precede any motion of a line, in LinuxCNC's order: units, feed, spindle, tool, modal codes."""

from collections.abc import Callable
from typing import Final

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter import fanuc, offsetcodes
from thermocomp.nc.interpreter.block import PLANES, Block
from thermocomp.nc.interpreter.codes import CYCLES, LENGTHS
from thermocomp.nc.interpreter.offsets import mark_axes
from thermocomp.nc.interpreter.state import MM, InterpreterState
from thermocomp.nc.interpreter.words import BlockWords

#: by modal group: field of the modal state, and its value for a code
_FIELDS: Final[dict[str, tuple[str, Callable[[str], object]]]] = {
    "plane": ("plane", lambda code: int(code[1:])),
    "units": ("inch", lambda code: code == "G20"),
    "diameter": ("diameter", lambda code: code == "G7"),
    "cutter": ("cutter", lambda code: code != "G40"),
    "distance": ("absolute", lambda code: code == "G90"),
    "arc distance": ("arc_absolute", lambda code: code == "G90.1"),
    "retract": ("retract", lambda code: int(code[1:])),
}
#: groups that LinuxCNC refuses during cutter compensation
_NOT_UNDER_CUTTER: Final = frozenset({"tool length", "system", "path", "retract", "tool", "io", "override"})


def lengths(state: InterpreterState, words: BlockWords) -> None:
    """Convert lengths without a decimal point as this control interprets them."""
    if words.groups.get("once") == "G4":
        return
    setup, inch, groups = state.setup, state.modal.inch, words.groups
    motion = groups.get("motion", state.modal.motion)
    none = ""  # counts: K repeats a Fanuc cycle, Q is a number except in cycles, splines and G64
    if "high speed" in groups:
        none = "QR"
    elif not (motion in CYCLES or motion == "G5" or "path" in groups):
        none = "Q"
    elif state.fanuc and motion in CYCLES:
        none = "K"
    for letter, word in words.words.items():
        if letter not in LENGTHS or letter in none or word.number is None or "." in word.value or not word.number:
            continue
        if setup.integers == "refuse":
            raise words.error(
                f"{letter}{word.value} has no decimal point: whether it counts units or least increments depends on "
                "the control; state which with --integers"
            )
        angle = letter == "R" and "rotation" in groups
        words.values[letter] = word.number * setup.least / (MM if inch and not angle else 1.0)


def check_units(state: InterpreterState, words: BlockWords) -> None:
    """Refuse lengths while their unit is not known."""
    if not state.unit_told:
        _unit_needed(state, words)
    if state.setup.integers != "whole":
        lengths(state, words)


def _unit_needed(state: InterpreterState, words: BlockWords) -> None:
    if words.groups.get("once") == "G4":
        return
    for letter in "XYZIJKF":
        inverse = letter == "F" and state.modal.feed_mode == 93
        if words.values.get(letter) and not inverse:
            raise words.error(
                f"{letter}{words.words[letter].value.strip()} before G20 or G21: inches or millimetres? write G20 or "
                "G21 on a line before it, or state which unit the control starts with (--units)"
            )


def speeds(state: InterpreterState, words: BlockWords, inch: bool) -> None:
    """Execute the words F (feed), S (spindle speed) and T (tool)."""
    values = words.values
    if "F" in values:
        word = values["F"]
        if word < 0.0:
            raise words.error(f"F{word:g} is negative; write a feed above 0")
        state.feed_word = word
        state.feed = word * MM if inch and state.modal.feed_mode != 93 else word
    if "S" in values:
        if values["S"] < 0.0:
            raise words.error(f"S{values['S']:g} is negative; write it positive, with M4 to reverse the spindle")
        state.spindle = values["S"]
    if "T" in values:
        state.selected = words.whole("T") or 0
        if state.fanuc and state.lathe is not None and state.selected > 99 and "tool" not in words.groups:
            state.lathe = f"T{words.words['T'].value.strip()}"
            if state.lathe[1] == "0":
                raise lathe(words, f"{state.lathe} without M6")


def lathe(words: BlockWords, sign: str) -> ProgramError:
    """Return the error for a lathe program, with the sign by which it was recognised."""
    return words.error(
        f"{sign}: this is a lathe program, in which X is a diameter and G99 feed per turn; not supported"
    )


def apply_modal_codes(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Apply all codes except non-modal codes and motion, in the order of LinuxCNC."""
    groups = words.groups
    inch = state.modal.inch
    if state.modal.cutter and not state.fanuc:
        _check_cutter(state, words)
    if "feed mode" in groups:
        mode = int(groups["feed mode"][1:])
        if mode != state.modal.feed_mode or not state.fanuc:
            state.feed = state.feed_word = 0.0
        state.changed(feed_mode=mode)
    if groups.get("scaling") == "G50" and (
        "S" in words.values or (not {"X", "Z"}.isdisjoint(words.values) and "motion" not in groups)
    ):
        raise lathe(words, "G50 with S, X or Z")
    if state.fanuc and "units" in groups:
        inch = groups["units"] == "G20"
    if "units" in groups:
        _unit_of_feed(state, words)
    else:
        check_units(state, words)
    speeds(state, words, inch)
    _machine_codes(state, words, block)
    _modal_codes(state, words)
    if "units" in groups and state.setup.integers != "whole":
        lengths(state, words)
    if "tool length" in groups:
        offsetcodes.tool_length(state, words)
    if "system" in groups:
        offsetcodes.select_system(state, words)
    if "rotation" in groups:
        fanuc.rotate(state, words)


def _unit_of_feed(state: InterpreterState, words: BlockWords) -> None:
    """Refuse F with G20 or G21 where LinuxCNC reads F before the change of units."""
    code = words.groups["units"]
    if not (state.unit_told or state.fanuc or state.modal.feed_mode == 93) and words.values.get("F"):
        raise words.error(
            f"F on the line of {code}: LinuxCNC reads it in the unit in force before; put it on a line after {code}, "
            "or state which unit the control starts with (--units)"
        )
    state.unit_told = True


def _check_cutter(state: InterpreterState, words: BlockWords) -> None:
    groups = words.groups
    for group in _NOT_UNDER_CUTTER & groups.keys():
        raise words.error(f"{groups[group]} is not allowed during cutter compensation; write G40 before it")
    if groups.get("once") in ("G52", "G92", "G92.1", "G92.2", "G92.3", "G10"):
        raise words.error(f"{groups['once']} is not allowed during cutter compensation; write G40 before it")
    if groups.get("cutter", "G40") != "G40":
        raise words.error(f"{groups['cutter']} while cutter compensation is on; write G40 before it")
    plane = groups.get("plane")
    if plane is not None and int(plane[1:]) != state.modal.plane:
        raise words.error(f"{plane} during cutter compensation; write G40 before it")


def _machine_codes(state: InterpreterState, words: BlockWords, block: Block) -> None:
    """Execute the M codes of a line except stops."""
    groups, values = words.groups, words.values
    tool = groups.get("tool")
    if tool == "M6":
        block.tool_change = state.tool = state.selected
        state.turning = 0
        # macros, remapped codes and machine settings may move axes to the tool changer
        state.known, state.level_known = (False, False, False), False
        state.lathe = None
    elif tool == "M61":
        number = words.whole("Q")
        if number is None:
            raise words.error("M61 needs Q, the tool number")
        state.tool = number
    spindle = groups.get("spindle")
    if spindle in ("M3", "M4"):
        if state.spindle is None:
            raise words.error(
                f"{spindle} without a spindle speed: the drift would be unknown; write S, or state the speed "
                "the control starts with"
            )
        state.turning = 1 if spindle == "M3" else -1
    elif spindle is not None:
        state.turning = 0
    if groups.get("io") == "M66" and values.get("L"):
        block.stops = True  # waits for an input, for an unknown time


def _modal_codes(state: InterpreterState, words: BlockWords) -> None:
    groups = words.groups
    fields: dict[str, object] = {name: say(groups[group]) for group, (name, say) in _FIELDS.items() if group in groups}
    if "units" in groups:
        state.scale = MM if fields["inch"] else 1.0
    if state.modal.cutter and not fields.get("cutter", True):  # the tool remains offset from the programmed path
        state.known = mark_axes(state.known, dict.fromkeys(PLANES[state.modal.plane][:2]), to=False)
    if "path" in groups:
        # Fanuc-type controls smooth the path in G61.1 and stop in G61
        exact = groups["path"] == "G61" or (groups["path"] == "G61.1" and not state.fanuc)
        blend = 0.0 if exact else words.values.get("P", 0.0) * state.scale
        naive = words.values.get("Q", 0.0) * state.scale if blend and "Q" in words.values else blend
        stops = exact and (groups["path"] == "G61.1" or state.fanuc)
        fields |= {"blend": None if exact else blend, "naive": naive, "exact_stop": stops}
    if "retract" in groups:
        fields["retract_stated"] = True
    state.changed(**fields)
