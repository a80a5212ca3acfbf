"""Codes specific to Fanuc controls: G80 with words, G0 with G28, G68, and cycles that depend on the model."""

from typing import Final

from thermocomp.nc.interpreter.block import PLANES
from thermocomp.nc.interpreter.codes import CYCLES
from thermocomp.nc.interpreter.state import InterpreterState
from thermocomp.nc.interpreter.words import BlockWords

_PLANE_LETTERS: Final = frozenset("XY")
_STRAIGHT: Final = ("G0", "G1")
#: modal groups and codes that the manuals forbid while G68 is in force
_NOT_TURNED: Final = frozenset({"plane", "system", "units"})
_ONCE_NOT_TURNED: Final = frozenset({"G10", "G28", "G30", "G52", "G53", "G92", "G92.1"})
#: positions closer than this are equal [mm]
_SAME: Final = 1e-6


def motion_beside_g80(state: InterpreterState, words: BlockWords) -> str:
    """Return the motion for axis words on a line with G80 only: the motion in force before the cycle."""
    if not state.fanuc:
        raise words.error("axis words with G80; write the motion code they are for")
    modal = state.modal.motion
    before = state.under if modal in CYCLES else modal
    if before not in _STRAIGHT:
        raise words.error(
            "axis words with G80, but neither G0 nor G1 was in force before the cycle; write G0 with them"
        )
    return before


def put_in_force(state: InterpreterState, motion: str) -> None:
    """Put a motion code in force next to a code that uses the axis words, such as ``G0 G91 G28 Z0.``."""
    state.moves_by(motion)
    state.level, state.sticky = None, {}


def check_codes(state: InterpreterState, words: BlockWords, code: str) -> None:
    """Refuse codes that Fanuc controls interpret differently, before any part of the line takes effect."""
    modal, groups = state.modal, words.groups
    told = groups.get("motion")
    drilling = modal.motion in CYCLES and (told is None or told in CYCLES)
    kept = drilling and state.keeps_levels and state.level is not None
    if drilling and "distance" in groups and (groups["distance"] == "G90") != modal.absolute:
        plain = modal.plane == 17 and state.level is not None and told is None and "once" not in groups
        if not kept and not (modal.absolute and plain):
            raise words.error(
                f"{groups['distance']} while {modal.motion} is in force: whether R and Z of the cycle change their "
                "meaning depends on the control; write G80 before it"
            )
        state.keeps_levels = kept = modal.absolute  # G91 X10. K4: more holes, with the same levels
    if kept and (told is not None or not {"R", "Z"}.isdisjoint(words.values)):
        raise words.error(
            "a new cycle, R or Z in G91 while a cycle is in force that began in G90; write G80 before G91"
        )
    if groups.get("once") == "G92.1" and not words.values.keys() >= {"X", "Y", "Z"}:
        raise words.error(
            "G92.1 without X, Y and Z: the control determines which other axes are restored; name X, Y and Z"
        )
    rotation = groups.get("rotation")
    if modal.turned and rotation != "G69":
        wrong = sorted((_NOT_TURNED & groups.keys()) | ({groups.get("once", "")} & _ONCE_NOT_TURNED))
        if wrong:
            raise words.error(
                f"{groups.get(wrong[0], wrong[0])} while G68 is in force, which controls reject or read in "
                "different ways; write G69 before it"
            )
    if rotation is not None and modal.cutter:
        raise words.error(f"{rotation} during cutter compensation; write G40 before it")
    if rotation is not None and code in CYCLES:
        raise words.error(f"{rotation} on a line that drills; put it on a separate line")


def rotate(state: InterpreterState, words: BlockWords) -> None:
    """Execute G68 X Y R or G69: rotate X and Y of the program about a point in program coordinates."""
    modal, offsets = state.modal, state.offsets
    if words.groups["rotation"] == "G69":
        if modal.turned:
            offsets.turn(None)
            _turned(state, "G69")
        return
    if modal.plane != 17:
        raise words.error(f"G68 in G{modal.plane} is not supported; write the rotated coordinates")
    if not modal.absolute:
        raise words.error(
            "G68 in G91: whether its words count from the tool position depends on the control; write G90 before it"
        )
    if modal.motion in CYCLES:
        raise words.error(f"G68 while {modal.motion} is in force; write G80 before it")
    values = words.values
    missing = [letter for letter in "XYR" if letter not in values]
    if missing:
        raise words.error(
            f"G68 without {' '.join(missing)}: {'the angle' if missing == ['R'] else 'its centre'} then depends on the "
            "control; write X, Y and R"
        )
    if "Z" in values:
        raise words.error("G68 with Z is not supported; write X, Y and R only")
    if modal.turned:
        raise words.error(
            "G68 while G68 is in force: whether the angles add depends on the control; write G69 between them"
        )
    offsets.turn((values["X"] * state.scale, values["Y"] * state.scale), values["R"])
    _turned(state, "G68")


def _turned(state: InterpreterState, code: str) -> None:
    state.renamed((False, False, True))
    state.changed(rotation=state.offsets.rotation, turned=code == "G68")
    state.turned_anew = code


def check_place(state: InterpreterState, words: BlockWords, code: str) -> None:
    """Refuse the first X or Y move after G68 or G69 unless it names both axes: its start point is uncertain."""
    if not code or words.groups.get("once") == "G53":
        return
    named = _PLANE_LETTERS & words.values.keys()
    straight = code in _STRAIGHT
    if not named and straight:
        return
    if named != _PLANE_LETTERS or not state.modal.absolute or not (straight or code in CYCLES):
        raise words.error(
            f"the first move after {state.turned_anew} must be a linear move to X and Y in G90: until then, the tool "
            "position assumed by the control is uncertain"
        )
    state.turned_anew = ""


def check_dwell(words: BlockWords) -> None:
    """Refuse a dwell in P with a decimal point: a Haas reads seconds, and a Fanuc rejects it."""
    word = words.words.get("P")
    if word is not None and word.number is not None and "." in word.value:
        seconds = f"G4 X{word.value.strip()} for seconds, or " if words.groups.get("once") == "G4" else ""
        raise words.error(
            f"P{word.value.strip()} for a dwell: with a decimal point it is in seconds for a Haas, and a Fanuc does "
            f"not accept it; write {seconds}P without a decimal point for milliseconds"
        )


def dwell_of_x(state: InterpreterState, words: BlockWords) -> float:
    """Return the dwell time of G4 X [s]."""
    word = words.words["X"]
    if word.number is None or "." in word.value or not word.number:
        return words.values["X"]
    if state.setup.integers == "refuse":
        raise words.error(
            f"G4 X{word.value.strip()} has no decimal point: whether it is in seconds or milliseconds depends on the "
            "control; state which with --integers, or write the decimal point"
        )
    return words.values["X"] / (1000.0 if state.setup.integers == "least" else 1.0)


def drills(state: InterpreterState, words: BlockWords) -> bool:
    """Return whether a line of a cycle drills: with K0 or L0 it only stores its words."""
    _check_level(state, words)
    if not any(words.values.get(letter) == 0.0 for letter in "KL"):
        return True
    across = PLANES[state.modal.plane][2]
    for i, place in state.axis_values(words).items():
        if i != across and not (state.modal.absolute and state.known[i] and abs(place - state.place[i]) < _SAME):
            raise words.error(
                f"{'XYZ'[i]} with {'K0' if 'K' in words.values else 'L0'}, which only stores the words of the cycle: "
                f"some controls move {'XYZ'[i]} nevertheless; write {'XYZ'[i]} on an earlier line"
            )
    return False


def _check_level(state: InterpreterState, words: BlockWords) -> None:
    """Refuse a cycle with G98 whose R is above its initial level: where it ends depends on the control.

    With G99 all move to the hole at the initial level, up to R, and end at R.
    """
    plane, level = state.sticky["R"] * state.scale, state.level or 0.0
    absolute = state.modal.absolute or state.keeps_levels
    above = plane - level if absolute else plane
    sure = state.level_known or not absolute
    back_to_r = absolute and state.modal.retract_stated and state.modal.retract == 99
    if sure and above > _SAME and not back_to_r:
        raise words.error(
            f"R is {above:g} mm above the initial level of the cycle: with G98 its end depends on the control; "
            "write G99, or first move to the level of R"
        )
