"""Words of a plain program, and the two runs they are drawn from."""

from thermocomp.nc.linuxcnc.rs274 import AXES, ORIGIN, Canonical, Place, ProgramFrame, Stored

EQUAL = 1e-7  #: [mm] two runs agree
STILL = 1e-8  #: [mm] an axis does not move


def agree(first: float, second: float) -> bool:
    """Return whether two runs agree."""
    return abs(first - second) < EQUAL


def format_number(value: float) -> str:
    """Write a number without an exponent and without empty decimals."""
    text = f"{value:.8f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


class Words:
    """Writes lengths in the program's unit.

    Attributes
    ----------
    unit : float
        In force [mm].
    """

    def __init__(self, unit: float) -> None:
        self.unit = unit

    def in_unit(self, value: float) -> float:
        """Return a length [mm] in the program's unit, with as many digits as are written."""
        return round(value / self.unit, 7 if self.unit == 1.0 else 8)

    def rounded(self, value: float) -> float:
        """Return a length as it is written [mm]."""
        return self.in_unit(value) * self.unit

    def length(self, value: float) -> str:
        """Write a length [mm]."""
        return format_number(self.in_unit(value))

    def axis(self, axis: int, value: float) -> str:
        """Write the word of an axis, 0 to 8 [mm, deg]."""
        return AXES[axis] + (format_number(round(value, 7)) if 3 <= axis < 6 else self.length(value))


class Side:
    """One of the two runs: where it is, and what is stored in its controller.

    Attributes
    ----------
    program, machine : tuple of float
        Position [mm, deg].
    frame : ProgramFrame
    origins, rotations : dict by work coordinate system
        As they are stored now [mm, deg].
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
        """Go to program coordinates."""
        self.program, self.machine = program, self.frame.machine(program)

    def take(self, kind: str, values: tuple[float, ...]) -> None:
        """Apply an offset; the machine stays where it is."""
        self.frame.take(kind, values)
        self.program = self.frame.program(self.machine)
