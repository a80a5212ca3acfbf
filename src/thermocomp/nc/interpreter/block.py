"""Effect of a line of an NC program on the machine: modal state and moves."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, TypeVar

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.parser.line import Line, Word

Point = tuple[float, float, float]
Known = tuple[bool, bool, bool]
_Value = TypeVar("_Value")

#: effect of a block on the position: ``none``; ``line`` G0, G1, G33; ``arc`` G2, G3; ``cycle`` G73, G81 ...;
#: ``machine`` a move in machine coordinates (G53); ``home`` G28, G30; ``set`` redefines the coordinates of the
#: current position: G92, G10 L20, L10, L11; ``curve`` G5, G5.1; ``probe`` G38
Kind = Literal["none", "line", "arc", "cycle", "machine", "home", "set", "curve", "probe"]


@dataclass(frozen=True, slots=True)
class Modal:
    """Modal state in which a block runs, including the words of the block.

    Parameters
    ----------
    motion : str
        Motion code in force, such as ``G1``; empty before the first one, and after ``G80``.
    plane : {17, 18, 19}
        Plane of arcs and cycles.
    inch : bool
        G20 (inches) is in force.
    absolute : bool
        G90 is in force; False in G91.
    arc_absolute : bool
        G90.1: centres of arcs are absolute.
    cutter : bool
        G41 or G42: cutter radius compensation is on.
    diameter : bool
        G7: X words are diameters.
    system : int
        Work coordinate system: 1 is G54, 6 G59, 7 to 9 G59.1 to G59.3; 100 + p is G54.1 Pp.
    system_told : bool
        The program specifies the system; otherwise G54 is assumed.
    rotation : float
        Rotation of the program coordinates about Z, stored or by G68 [deg].
    rotation_told : bool
        Program or setup specify the rotation; otherwise a rotation stored in the controller may be in force.
    origin_told : bool
        Program or setup specify the origin of the work coordinate system.
    untold_tool : int or None
        Number of the tool whose length is in force but not given by program or setup; -1: the tool itself is unknown.
    turned : bool
        G68 is in force.
    retract_stated : bool
        The program specifies G98 or G99; otherwise the current mode of the controller applies.
    blend : float or None
        G64 P: maximum deviation of the path at corners [mm]; 0 without P, None in G61 and G61.1 (exact).
    naive : float
        G64 Q, or P without Q: maximum distance of points from a line that replaces several lines [mm]; 0: no merging.
    exact_stop : bool
        G61.1, or G61 on Fanuc controls: the axes stop at the end of every move.
    """

    motion: str = ""
    plane: int = 17
    inch: bool = False
    absolute: bool = True
    arc_absolute: bool = False
    feed_mode: int = 94
    cutter: bool = False
    diameter: bool = False
    system: int = 1
    system_told: bool = False
    rotation: float = 0.0
    rotation_told: bool = False
    origin_told: bool = False
    untold_tool: int | None = None
    turned: bool = False
    retract: int = 98
    retract_stated: bool = False
    blend: float | None = 0.0
    naive: float = 0.0
    exact_stop: bool = False


#: plane -> its two axes and the perpendicular axis
PLANES: Final = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}


class Arc(NamedTuple):
    """Centre, plane and direction of an arc move."""

    plane: int  #: 17, 18, 19
    centre: tuple[float, float]  #: in the axes of the plane (17: X Y, 18: Z X, 19: Y Z), machine coordinates [mm]
    clockwise: bool
    turns: int  #: at least 1: the arc ends in its first turn


@dataclass(slots=True)
class Move:
    """One move of the machine.

    Parameters
    ----------
    start, end : tuple of float
        Machine coordinates [mm], including work and tool offsets if known.
    feed : float
        Feed rate along the path [mm/min]; 0 for rapids and inverse time; degrees per minute if only rotary axes move.
    seconds : float or None
        Duration, if given by the program (G93) or by the spindle (G95, G33, taps).
    rotary : float
        Travel of the rotary axes [deg].
    """

    rapid: bool
    start: Point
    end: Point
    arc: Arc | None = None
    feed: float = 0.0
    seconds: float | None = None
    rotary: float = 0.0


@dataclass(slots=True)
class Block:
    """Effect of one line.

    Parameters
    ----------
    kind : str
        See `Kind`.
    codes : tuple of str
        G and M codes of the line, such as ``("G90", "G1", "M8")``.
    words : dict of str to Word
        Words of X, Y, Z, R, I, J, K, P, Q, F, S, T, H, L ... (not G, M, N) by letter.
    values : dict of str to float
        Their values, expressions evaluated, in the program's units.
    start, end : tuple of float
        Position of the tool before and after the line, as an absolute word would specify it at that time [mm].
    known : tuple of bool
        Per axis: `end` is certain, and was reached in work coordinates: an absolute word of that axis with the value of
        `end` would not move it. False at the start of the program, after G53, G28, G30, M6 and stops, after a change
        of the coordinate system or of the tool length with values not in the file, and after an optional line that
        moved the axis.
    feed : float
        F in force, in mm per minute, mm per turn or 1/min, according to ``modal.feed_mode``.
    speed : float
        Spindle speed, including M3, M4, M5 of the line; 0 while the spindle is stopped, negative in M4 [1/min].
    pause : float
        Dwell [s].
    tool_change : int or None
        Number of the tool loaded by M6; -1 if unknown.
    turned : dict of str to float
        Rotary axes that are not at 0, with their positions [deg]; nan: their zero has been changed.
    stops : bool
        M0, M1, M60: the operator decides on the duration, and may move the axes.
    ends : bool
        M2, M30 or the closing ``%``: nothing after the line is run.
    sticky : dict of str to float
        In a cycle: values of R, Z, Q, P ... in force, in the program's units.
    keeps_levels : bool
        In a cycle of a Fanuc: X and Y are incremental, but R and Z are the levels stated before in G90.
    """

    line: Line
    modal: Modal
    kind: Kind = "none"
    codes: tuple[str, ...] = ()
    words: dict[str, Word] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    start: Point = (0.0, 0.0, 0.0)
    end: Point = (0.0, 0.0, 0.0)
    known: Known = (False, False, False)
    moves: list[Move] = field(default_factory=list)
    feed: float = 0.0
    speed: float = 0.0
    pause: float = 0.0
    tool_change: int | None = None
    turned: dict[str, float] = field(default_factory=dict)
    stops: bool = False
    ends: bool = False
    sticky: dict[str, float] = field(default_factory=dict)
    keeps_levels: bool = False

    def error(self, reason: str) -> ProgramError:
        """Return a `ProgramError` with the number of this line."""
        return self.line.fault(reason)


@dataclass(frozen=True)
class Setup:
    """State of the controller that is not in the program.

    Parameters
    ----------
    controller : {'linuxcnc', 'fanuc'}
        Controller whose NC dialect the program uses.
    inch : bool or None
        Unit in force when the program starts; None: unknown, the program must specify the unit before the first length.
    startup : str
        Codes in force when the program starts, from `thermocomp.nc.interpreter.startup.tidy`.
    speed : float
        Spindle speed S in force when the program starts [1/min]; 0: none.
    offsets : dict of int to tuple of float
        Origins of work coordinate systems, X Y Z [mm]; missing ones count as 0. They give the approximate position of
        the machine, but never count as certain: only origins set by the program itself do.
    tools : dict of int to float
        Lengths of the tools [mm]; used in the same way as `offsets`.
    home : tuple of float or None
        Position approached by G28, in machine coordinates [mm]; None: not given.
    rotations : dict of int to float
        Rotations of work coordinate systems about Z that are stored in the controller [deg], if given.
    no_shift : bool
        The user states that no G92 or G52 is in force when the program starts.
    rotary : dict of str to {'head', 'table'}
        Part rotated by each rotary axis A, B, C, if given: the spindle (head) or the workpiece (table).
    integers : {'whole', 'least', 'refuse'}
        Meaning of a length without a decimal point: whole millimetres or inches, the least increment, or refusal of
        the program.
    least : float
        Least input increment [mm], for `integers` 'least'.
    skip_optional : bool
        Block delete is on: lines that begin with ``/`` are not run.
    harmless : frozenset of int
        M codes defined by the machine builder or user that move no axis and do not change the spindle; known codes keep
        their meaning.
    """

    controller: Literal["linuxcnc", "fanuc"] = "linuxcnc"
    inch: bool | None = None
    startup: str = ""
    speed: float = 0.0
    offsets: dict[int, Point] = field(default_factory=dict)
    tools: dict[int, float] = field(default_factory=dict)
    home: Point | None = None
    rotations: dict[int, float] = field(default_factory=dict)
    no_shift: bool = False
    rotary: dict[str, Literal["head", "table"]] = field(default_factory=dict)
    integers: Literal["whole", "least", "refuse"] = "whole"
    least: float = 0.001
    skip_optional: bool = False
    harmless: frozenset[int] = frozenset()


def triple(values: Iterable[_Value]) -> tuple[_Value, _Value, _Value]:
    """Return the values of X, Y and Z as a tuple of three."""
    x, y, z = values
    return x, y, z


def system_name(system: int) -> str:
    """Return the code of a work coordinate system, such as ``G54``."""
    if system > 100:
        return f"G54.1 P{system - 100}"
    return f"G{53 + system}" if system <= 6 else f"G59.{system - 6}"
