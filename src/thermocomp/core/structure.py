"""Structure codes: axes that carry the workpiece, and axes that carry the tool."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.exceptions import SettingError

Side = Literal["head", "table"]

_LINEAR = "XYZ"
_ROTARY = "ABC"
# a B with a prime or a number denotes an axis, not the bed
_LONG = re.compile(r"W(?P<workpiece>.*?)B(?!['\d])(?P<tool>.*?)(?P<spindle>C\d?|\(C\d?\))?T")
_SHORT = re.compile(r"([ABCU-Z]*)(F?)([ABCU-Z]*)")
_WORD = re.compile(r"\(?[A-Z]\d?'?\)?|.")
_AXIS = re.compile(r"([A-Z])\d?('?)")
_SPINDLE = re.compile(r"\(C\d?'?\)")


@dataclass(frozen=True)
class Structure:
    """The kinematic chain from the workpiece over the bed to the tool.

    Parameters
    ----------
    workpiece : tuple of str
        Axes between workpiece and bed, starting at the workpiece.
    tool : tuple of str
        Axes between bed and tool, starting at the bed.
    rotary : dict of str to {'head', 'table'}
        Rotary axes A, B, C: ``head`` turns the tool, ``table`` turns the workpiece.
    """

    workpiece: tuple[str, ...]
    tool: tuple[str, ...]
    rotary: dict[str, Side] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in self.axes:
            if name not in _LINEAR:
                raise SettingError(
                    f"axis {name}: only the linear axes X, Y and Z and the rotary axes A, B and C can be in a structure"
                )
            if self.axes.count(name) > 1:
                raise SettingError(f"axis {name} occurs twice")
        if not self.axes:
            raise SettingError("the structure has no axis; name at least one")

    @classmethod
    def parse(cls, code: str) -> "Structure":
        """Return the kinematic structure given by a code such as ``w X' b Z Y (C1) t``."""
        text = "".join(code.split()).replace("’", "'").replace("′", "'").upper()
        short = _SHORT.fullmatch(text)
        if short and text:
            before, _, after = short.groups()
            return _made(before, after) if "F" in text else _made("", before + after)
        found = _LONG.fullmatch(text)
        if not found:
            raise SettingError(
                f"{code!r} is not a structure code; write it from the workpiece over the bed to the tool, such as "
                '"w X\' b Z Y (C1) t", or short, such as "XFZY"'
            )
        return _made(_axes(found["workpiece"], code, primed=True), _axes(found["tool"], code, primed=False))

    @property
    def axes(self) -> tuple[str, ...]:
        """All linear axes, from the workpiece to the tool."""
        return (*self.workpiece, *self.tool)

    @property
    def code(self) -> str:
        """Code according to ISO 10791; rotary axes are placed next to workpiece and tool, whatever their position."""
        table = [f"{a}'" for a, side in self.rotary.items() if side == "table"]
        head = [a for a, side in self.rotary.items() if side == "head"]
        return " ".join(["w", *table, *(f"{a}'" for a in self.workpiece), "b", *self.tool, *head, "(C1)", "t"])

    def beyond(self, axis: str) -> tuple[str, ...]:
        """Return the axes between an axis and the tool, which move the tool relative to the slide of this axis."""
        return self.axes[self.axes.index(axis) + 1 :]


def _made(workpiece: Sequence[str], tool: Sequence[str]) -> Structure:
    """Return the structure from the axes on the workpiece side and on the tool side."""
    turning: list[tuple[str, Side]] = [(a, "table") for a in workpiece if a in _ROTARY]
    turning += [(a, "head") for a in tool if a in _ROTARY]
    rotary = dict(turning)
    if len(rotary) < len(turning):
        twice = next(a for a in rotary if [b for b, _ in turning].count(a) > 1)
        raise SettingError(f"axis {twice} occurs twice")
    first, second = (tuple(a for a in side if a not in _ROTARY) for side in (workpiece, tool))
    return Structure(first, second, rotary)


def _axes(text: str, code: str, *, primed: bool) -> tuple[str, ...]:
    """Return the letters of one side, with or without a prime as the side requires."""
    side, found = ("workpiece" if primed else "tool"), []
    for word in _WORD.findall(text):
        if primed and _SPINDLE.fullmatch(word):
            raise SettingError(f"{word} in {code!r}: a spindle on the workpiece's side is not supported")
        match = _AXIS.fullmatch(word)
        if not match:
            raise SettingError(f"{word!r} in {code!r} is not an axis: expected X, Y, Z, A, B or C")
        if primed and not match[2]:
            raise SettingError(f"{word!r} in {code!r} is on the {side}'s side and needs a prime: {word}'")
        if match[2] and not primed:
            raise SettingError(f"{word!r} in {code!r} is on the {side}'s side and must have no prime: {match[1]}")
        found.append(match[1])
    return tuple(found)
