"""The 32 error components of a three-axis machine tool, as data.

21 geometric components (ISO 230-1: six per linear axis and three squareness errors) plus the 11 thermal ones of
Chen, Yuan, Ni 1996, section 2 (C-01): three spindle translations, two inclinations of the spindle axis, six shifts
of the axes' references (origins). C-02: 14 of them are scalars, 18 depend on the position of their axis.
"""

from dataclasses import dataclass
from typing import Literal

Group = Literal["axis", "squareness", "spindle", "origin"]


@dataclass(frozen=True)
class ErrorComponent:
    """One component of the tool-point error of a machine.

    Parameters
    ----------
    code : str
        ISO 230-1 code where one exists (``EXX``, ``C0Y``), otherwise a thermocomp code (``XOY``: shift along X of the
        reference of Y).
    group : {'axis', 'squareness', 'spindle', 'origin'}
        Location of the error.
    unit : {'um', 'urad'}
        Unit of the error.
    depends_on : str or None
        Axis along whose travel the error varies; None for a scalar (C-02).
    description : str
        Description as text.
    axes : tuple of str
        Axes that a machine must have for the component to exist.
    """

    code: str
    group: Group
    unit: Literal["um", "urad"]
    depends_on: str | None
    description: str

    axes: tuple[str, ...] = ()

    @property
    def is_scalar(self) -> bool:
        """True for the 14 components that vary with time alone (C-02)."""
        return self.depends_on is None


_AXES = "XYZ"
_ROTATION = {"X": "A", "Y": "B", "Z": "C"}


def _axis_components() -> list[ErrorComponent]:
    found = []
    for axis in _AXES:
        for along in _AXES:
            kind = "positioning" if along == axis else f"straightness in {along}"
            found.append(
                ErrorComponent(
                    code=f"E{along}{axis}",
                    group="axis",
                    unit="um",
                    depends_on=axis,
                    description=f"{kind} of {axis}",
                    axes=(axis,),
                )
            )
        for about in _AXES:
            code = f"E{_ROTATION[about]}{axis}"
            kind = "roll" if about == axis else f"tilt about {about}"
            found.append(
                ErrorComponent(
                    code=code, group="axis", unit="urad", depends_on=axis, description=f"{kind} of {axis}", axes=(axis,)
                )
            )
    return found


def _squareness() -> list[ErrorComponent]:
    pairs = (("C0Y", "Y", "X"), ("B0Z", "Z", "X"), ("A0Z", "Z", "Y"))
    return [
        ErrorComponent(
            code=code,
            group="squareness",
            unit="urad",
            depends_on=None,
            description=f"squareness of {a} to {b}",
            axes=(a, b),
        )
        for code, a, b in pairs
    ]


def _spindle() -> list[ErrorComponent]:
    drifts = [
        ErrorComponent(code=f"{a}0C", group="spindle", unit="um", depends_on=None, description=f"spindle drift in {a}")
        for a in _AXES
    ]
    tilts = [
        ErrorComponent(
            code=f"{_ROTATION[a]}0C",
            group="spindle",
            unit="urad",
            depends_on=None,
            description=f"spindle tilt about {a}",
        )
        for a in "XY"
    ]
    return drifts + tilts


def _origins() -> list[ErrorComponent]:
    # One axis (here Z) is the reference for the other two: two times three translations (C-01).
    return [
        ErrorComponent(
            code=f"{along}O{axis}",
            group="origin",
            unit="um",
            depends_on=None,
            description=f"shift in {along} of the reference of {axis}",
            axes=(axis,),
        )
        for axis in "XY"
        for along in _AXES
    ]


#: all 32 components, in the order axis, squareness, spindle, origin
COMPONENTS: tuple[ErrorComponent, ...] = (*_axis_components(), *_squareness(), *_spindle(), *_origins())

BY_CODE: dict[str, ErrorComponent] = {c.code: c for c in COMPONENTS}
