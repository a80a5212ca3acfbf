"""Structure codes: which axes carry the workpiece and which the tool."""

import re
from dataclasses import dataclass

from thermocomp.core.exceptions import SettingError

_LINEAR = "XYZ"
# a B with a prime or a number is an axis, not the bed
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
        Axes between workpiece and bed, the nearest to the workpiece first.
    tool : tuple of str
        Axes between bed and tool, the nearest to the bed first.
    """

    workpiece: tuple[str, ...]
    tool: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.axes:
            if name not in _LINEAR:
                raise SettingError(f"axis {name}: only the linear axes X, Y and Z can be in a structure")
            if self.axes.count(name) > 1:
                raise SettingError(f"axis {name} is there twice")
        if not self.axes:
            raise SettingError("has no axis")

    @classmethod
    def parse(cls, code: str) -> "Structure":
        """Read a structure code.

        Parameters
        ----------
        code : str
            As of ISO 10791, ``w X' b Z Y (C1) t``: from the workpiece over the bed to the tool, axes that carry the
            workpiece with a prime; or short, ``XFZY``: the letters before F carry the workpiece, those behind it the
            tool; without F all carry the tool. Blanks and small letters do not matter.

        Returns
        -------
        Structure

        Raises
        ------
        SettingError
            It is neither, has an axis twice, a rotary axis, a prime in the wrong place, or a spindle that turns the
            workpiece.
        """
        text = "".join(code.split()).replace("’", "'").replace("′", "'").upper()
        short = _SHORT.fullmatch(text)
        if short and text:
            before, _, after = short.groups()
            return cls(tuple(before), tuple(after)) if "F" in text else cls((), tuple(before + after))
        found = _LONG.fullmatch(text)
        if not found:
            raise SettingError(
                f"{code!r} is no structure code; write it from the workpiece over the bed to the tool, such as "
                '"w X\' b Z Y (C1) t", or short, such as "XFZY"'
            )
        return cls(
            _axes(found["workpiece"], code, primed=True),
            _axes(found["tool"], code, primed=False),
        )

    @property
    def axes(self) -> tuple[str, ...]:
        """All axes, from the workpiece to the tool."""
        return (*self.workpiece, *self.tool)

    @property
    def code(self) -> str:
        """The code of ISO 10791."""
        return " ".join(["w", *(f"{a}'" for a in self.workpiece), "b", *self.tool, "(C1)", "t"])

    def beyond(self, axis: str) -> tuple[str, ...]:
        """Return the axes between an axis and the tool: those that move the tool against what the axis guides.

        Parameters
        ----------
        axis : {'X', 'Y', 'Z'}
        """
        return self.axes[self.axes.index(axis) + 1 :]


def _axes(text: str, code: str, *, primed: bool) -> tuple[str, ...]:
    """Return the letters of one side, with or without a prime as the side wants it."""
    side, found = ("workpiece" if primed else "tool"), []
    for word in _WORD.findall(text):
        if primed and _SPINDLE.fullmatch(word):
            raise SettingError(f"{word} in {code!r}: a spindle on the workpiece's side is not supported")
        match = _AXIS.fullmatch(word)
        if not match:
            raise SettingError(f"{word!r} in {code!r} is no axis: want X, Y or Z")
        if primed and not match[2]:
            raise SettingError(f"{word!r} in {code!r} stands on the {side}'s side and needs a prime: {word}'")
        if match[2] and not primed:
            raise SettingError(f"{word!r} in {code!r} stands on the {side}'s side and has no prime: {match[1]}")
        found.append(match[1])
    return tuple(found)
