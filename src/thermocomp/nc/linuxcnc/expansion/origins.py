"""Words, work coordinate systems, G92 and tool lengths of a plain program, from the two runs it is derived from."""

import re

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.linuxcnc.rs274 import AXES, ORIGIN, Canonical, Place, ProgramFrame, Stored

SYSTEMS = {1: "G54", 2: "G55", 3: "G56", 4: "G57", 5: "G58", 6: "G59", 7: "G59.1", 8: "G59.2", 9: "G59.3"}
#: interpreter's remark when an origin is set
G10 = "interpreter: setting coordinate system origin"
PLAIN_G10 = re.compile(r"(?:N\d+)?G10L2P[1-9](?:[XYZABCR][-+]?(?:\d+\.?\d*|\.\d+))+")
_ACTIVE = re.compile(r"G10(?!\d).*P0+(?![\d.]*[1-9])")
DEPENDS = "depends on what is stored in the machine"
EQUAL = 1e-7  #: tolerance for equal values in both runs [mm]
STILL = 1e-8  #: an axis that moves less is at rest [mm]


def agree(first: float, second: float) -> bool:
    """Return whether the values of two runs agree within `EQUAL`."""
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
        """Process a call that precedes the first line of the program."""
        self.take(call.kind, call.values)
        if call.kind == "rapid":
            self.move(call.program)

    def move(self, program: Place) -> None:
        """Move to a position in program coordinates."""
        self.program, self.machine = program, self.frame.machine(program)

    def take(self, kind: str, values: tuple[float, ...]) -> None:
        """Apply a new offset: the machine position is unchanged, the program position changes."""
        self.frame.take(kind, values)
        self.program = self.frame.program(self.machine)


class OriginWriter:
    """Converter of calls about coordinates to lines of a plain program.

    Parameters
    ----------
    first, second : Stored
        Values stored in the controllers of the two runs.
    unit : float
        Unit in force at the start [mm].
    """

    def __init__(self, first: Stored, second: Stored, unit: float) -> None:
        self.sides = Side(first), Side(second)
        self.words = Words(unit)
        self.line = 0  #: last line of the program with any effect

    def refuse(self, reason: str, file: str = "") -> ProgramError:
        """Return an error for the line being run; in a subprogram in another file, for the last line of the program."""
        return ProgramError(
            max(self.line, 1),
            f"the program cannot be written as plain lines: {reason}" + (f" (in {file})" if file else ""),
        )

    def chosen_system(
        self, a: Canonical, b: Canonical, angles: tuple[float, float] | None, source: str
    ) -> list[tuple[str, str]]:
        """Return (kind, text) of lines that select a work coordinate system, or set its origin or rotation.

        Parameters
        ----------
        angles : tuple of float or None
            Rotations reported with these calls [deg].
        """
        index, chosen = int(a.values[0]), self.sides[0].frame.system
        if index != int(b.values[0]):
            raise self.refuse(f"the work coordinate system {DEPENDS}; set it in the program first")
        changed: set[int] = set()
        turned = False
        for side, call, angle in zip(self.sides, (a, b), angles or (None, None), strict=True):
            changed.update(i for i in range(9) if not agree(call.values[1 + i], side.origins[index][i]))
            side.take("g5x", call.values)
            side.origins[index] = call.values[1:]
            if angle is not None:
                turned = turned or not agree(angle, side.rotations[index])
                side.take("rotation", (angle,))
                side.rotations[index] = angle
        first, second = self.sides
        fixed, here = [], []
        for i in sorted(changed):
            if agree(a.values[1 + i], b.values[1 + i]):
                fixed.append(self.words.axis(i, a.values[1 + i]))
            elif agree(first.program[i], second.program[i]):
                here.append(self.words.axis(i, first.program[i]))
            else:
                raise self.refuse(f"the origin of {AXES[i]} {DEPENDS}; set it in the program first")
        if turned:
            if not agree(first.frame.rotation, second.frame.rotation):
                raise self.refuse(f"the rotation of the work coordinate system {DEPENDS}; set it in the program first")
            fixed.append(f"R{format_number(first.frame.rotation)}")
        # P0 is the system in force; the system in force here may differ from that of the machine
        place = 0 if _ACTIVE.search(_bare(source)) else index
        result = [
            ("g10", f"G10 {way} P{place} {' '.join(some)}") for way, some in (("L2", fixed), ("L20", here)) if some
        ]
        if index != chosen or not result:
            result.append(("g5x", SYSTEMS[index]))
        return result

    def plain_g10(self, source: str) -> str:
        """Return the line that sets the origin of a system not in force: only the source line states which system."""
        text = _bare(source)
        if not PLAIN_G10.fullmatch(text):
            raise self.refuse(
                "the origin of a work coordinate system that is not in force is set by expressions; select that "
                "system before (G54 ...), or write plain numbers"
            )
        index = int(text[text.index("P") + 1])
        for letter, value in re.findall(r"([XYZABC])([-+]?[\d.]+)", text):
            axis = AXES.index(letter)
            for side in self.sides:
                origin = list(side.origins[index])
                origin[axis] = float(value) * (1.0 if axis > 2 else self.words.unit)
                side.origins[index] = tuple(origin)
        for value in re.findall(r"R([-+]?[\d.]+)", text):
            for side in self.sides:
                side.rotations[index] = float(value)
        return re.sub(r"(?<=[\d.])(?=[A-Z])", " ", re.sub(r"^N\d+", "", text))

    def shift(self, old: tuple[Place, Place], source: str) -> str:
        """Return the line for a new G92 offset: a named position (G92), a fixed shift (G52), or cancellation."""
        first, second = self.sides
        now = first.frame.shift, second.frame.shift
        if not (any(now[0]) or any(now[1])):
            return "G92.2" if re.search(r"G0*92\.2", re.sub(r"\s", "", source).upper()) else "G92.1"
        named, fixed = [], []
        for i in range(9):
            if agree(now[0][i], old[0][i]) and agree(now[1][i], old[1][i]):
                continue
            if agree(first.program[i], second.program[i]):
                named.append(self.words.axis(i, first.program[i]))
            elif agree(now[0][i], now[1][i]):
                fixed.append(self.words.axis(i, now[0][i]))
            else:
                raise self.refuse(f"the shift of {AXES[i]} by G92 {DEPENDS}; set it in the program first")
        if named and fixed:
            raise self.refuse(f"the shifts by G92 {DEPENDS}; set it in the program first")
        return f"G92 {' '.join(named)}" if named else f"G52 {' '.join(fixed)}" if fixed else ""

    def tool_length(self) -> str:
        """Return the line that activates the tool length in force in both runs."""
        first, second = (side.frame.length for side in self.sides)
        if not (any(first) or any(second)):
            return "G49"
        if not any(first[:2] + first[3:] + second[:2] + second[3:]):
            one, two = (side.stored for side in self.sides)
            for tool, length in one.lengths.items():
                if agree(length, first[2]) and agree(two.lengths[tool], second[2]):
                    return f"G43 H{tool}"
            if agree(one.lengths[one.spindle], first[2]) and agree(two.lengths[two.spindle], second[2]):
                return "G43"  # of the tool in the spindle at the start, whatever its number
        if all(agree(x, y) for x, y in zip(first, second, strict=True)) and not any(first[3:]):
            return f"G43.1 {' '.join(self.words.axis(i, first[i]) for i in range(3))}"
        raise self.refuse(f"the tool length in force {DEPENDS}; set it in the program first")


def _bare(source: str) -> str:
    return re.sub(r"\([^)]*\)|;.*|\s", "", source).upper()
