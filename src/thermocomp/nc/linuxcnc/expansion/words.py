"""Words of a plain program, and the two runs from which they are derived."""

from thermocomp.nc.linuxcnc.rs274 import AXES, ORIGIN, Canonical, Place, ProgramFrame, Stored

EQUAL = 1e-7  #: tolerance for equal values in both runs [mm]
STILL = 1e-8  #: an axis that moves less is at rest [mm]


def agree(first: float, second: float) -> bool:
    """Return whether the values of two runs agree."""
    return abs(first - second) < EQUAL


def format_number(value: float) -> str:
    """Return a number as text, without an exponent and without trailing zeros."""
    text = f"{value:.8f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


class Words:
    """Formatter of lengths in the unit of the program.

    Attributes
    ----------
    unit : float
        Unit in force [mm].
    """

    def __init__(self, unit: float) -> None:
        self.unit = unit

    def in_unit(self, value: float) -> float:
        """Return a length [mm] in the unit of the program, rounded to the written digits."""
        return round(value / self.unit, 7 if self.unit == 1.0 else 8)

    def rounded(self, value: float) -> float:
        """Return a length rounded as in the written program [mm]."""
        return self.in_unit(value) * self.unit

    def length(self, value: float) -> str:
        """Return a length [mm] as text."""
        return format_number(self.in_unit(value))

    def axis(self, axis: int, value: float) -> str:
        """Return the word of an axis, 0 to 8 [mm, deg]."""
        return AXES[axis] + (format_number(round(value, 7)) if 3 <= axis < 6 else self.length(value))


class Side:
    """Position in one of the two runs, and data stored in its controller.

    Attributes
    ----------
    program, machine : tuple of float
        Position [mm, deg].
    frame : ProgramFrame
    origins, rotations : dict by work coordinate system
        Present values in the controller [mm, deg].
    """

    def __init__(self, stored: Stored) -> None:
        self.stored = stored
        self.frame = ProgramFrame()
        self.program = self.machine = ORIGIN
        self.origins: dict[int, tuple[float, ...]] = {i: tuple(stored.origins[i]) for i in stored.origins}
        self.rotations = {i: stored.rotations.get(i, 0.0) for i in stored.origins}

    def begin(self, call: Canonical) -> None:
        """Process a call before the first line."""
        self.take(call.kind, call.values)
        if call.kind == "rapid":
            self.move(call.program)

    def move(self, program: Place) -> None:
        """Move to a position in program coordinates."""
        self.program, self.machine = program, self.frame.machine(program)

    def take(self, kind: str, values: tuple[float, ...]) -> None:
        """Apply an offset without moving the machine."""
        self.frame.take(kind, values)
        self.program = self.frame.program(self.machine)
