"""Facts that must be known before a block can be corrected, and the errors if they are unknown."""

import math
from dataclasses import dataclass

from thermocomp.nc.interpreter.block import Block, Setup, system_name
from thermocomp.nc.rewrite.text import Vector


@dataclass
class SpindleState:
    """Spindle speed, including the case that the spindle already runs at the start of the program."""

    setup: Setup
    _told: bool = False

    def speed(self, block: Block) -> float:
        """Return the spindle speed in a block [1/min]."""
        if not self._told:
            self._told = any(code in ("M3", "M4", "M5") for code in block.codes)
            if not self._told and self.setup.speed:
                return self.setup.speed
            if not self._told and any(not m.rapid for m in block.moves):
                raise block.error(
                    "the program cuts, but has not set the spindle speed (S, M3): its drift is unknown; "
                    "state the speed at its start with --speed",
                )
        return block.speed


def refuse_unknown(block: Block, setup: Setup, *, by_position: bool) -> None:
    """Refuse a block in which the drift would be unknown."""
    if by_position:
        _refuse_unknown_place(block)
    if block.turned:
        _refuse_turned(block, setup)


def _refuse_unknown_place(block: Block) -> None:
    """Raise `ProgramError` if a block cuts in coordinates whose origin, or with a tool whose length, is unknown."""
    modal = block.modal
    if (modal.origin_told and modal.untold_tool is None) or all(m.rapid for m in block.moves):
        return
    name, tool = system_name(modal.system), modal.untold_tool
    if not modal.origin_told:
        what = f"the origin of {name} is unknown: --origin '{name}=0 mm, 0 mm, 0 mm'"
    elif tool == -1:
        what = "the length of the tool in the spindle is unknown: write its number (T, M6, or H)"
    else:
        what = f"the length of tool {tool} is unknown: --tool '{tool}=120 mm'"
    raise block.error(f"the drift depends on the position, but {what}")


def _refuse_turned(block: Block, setup: Setup) -> None:
    """Raise `ProgramError` if a rotary axis is not at 0 and may tilt the spindle, which grows along the tool."""
    for letter, angle in block.turned.items():
        side = setup.rotary.get(letter)
        if side == "table":
            continue
        where = "gets a new zero" if math.isnan(angle) else f"is at {angle:g} deg"
        what = (
            "it is in the head, where the spindle grows along the tool and not along Z: not supported"
            if side
            else "state whether it turns the spindle or the workpiece, with --machine, whose structure names it: "
            f'"w {letter}\' X\' b Y Z (C1) t" in the table, "w X\' b Y Z {letter} (C1) t" in the head'
        )
        raise block.error(f"{letter} {where}: {what}")


def refuse_untold_rotation(block: Block, carried: Vector) -> None:
    """Raise `ProgramError` if a rotation stored in the controller would rotate corrections of X and Y."""
    if not (carried[0] or carried[1]) or block.modal.rotation_told:
        return
    name, told = system_name(block.modal.system), block.modal.system_told
    which = f"write {name} before the first move, and state the angle (--rotation '{name}=12 deg')"
    raise block.error(
        f"X or Y is corrected, and a rotation of {name if told else 'the work coordinate system in force'} that is "
        "stored in the controller (G10 L2 R) would turn the correction: state that there is none (--rotation none) or "
        + (f"the angle (--rotation '{name}=12 deg')" if told else which),
    )
