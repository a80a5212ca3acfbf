"""G and M codes of LinuxCNC and Fanuc: modal groups, effects, and reasons for refusal.

Codes that are not in these tables are unknown, and programs that use them are refused.
"""

from collections.abc import Iterable
from typing import Final, Literal, NamedTuple

Controller = Literal["linuxcnc", "fanuc"]

#: cycles that drill, bore or tap successive holes
CYCLES: Final = frozenset({"G73", "G74", "G76", "G81", "G82", "G83", "G84", "G85", "G86", "G87", "G88", "G89"})
#: codes outside the motion group that use the axis words of their line
TAKES_AXES: Final = frozenset({"G10", "G28", "G30", "G52", "G92"})
AXES: Final = ("X", "Y", "Z")
#: the operator decides when the program continues
STOPS: Final = frozenset({"M0", "M1", "M60"})
ROTARY: Final = frozenset("ABC")
#: words whose value is a length on a line with a motion, an offset or a cycle
LENGTHS: Final = frozenset("XYZIJKRQ")
#: letters allowed on every line
FREE: Final = frozenset("XYZABCFST")


class Code(NamedTuple):
    """A G or M code and its modal group; a line can have only one code of each group."""

    name: str  #: such as ``G38.2``
    group: str
    does: str
    refused: str = ""  #: reason and remedy; empty if the code is supported


_EXPAND = "--expand lets the interpreter unroll it"
_LATHE = "a turning cycle; replace it with its moves"
_SURFACE = "the spindle's speed follows the diameter (constant surface speed), which is not supported; use G97"

_COMMON_G: Final = (
    Code("G0", "motion", "rapid move"),
    Code("G1", "motion", "linear move at feed rate"),
    Code("G2", "motion", "arc, clockwise"),
    Code("G3", "motion", "arc, counterclockwise"),
    Code("G4", "once", "dwell"),
    Code("G10", "once", "sets offsets"),
    Code("G17", "plane", "plane XY"),
    Code("G18", "plane", "plane ZX"),
    Code("G19", "plane", "plane YZ"),
    Code("G20", "units", "inches"),
    Code("G21", "units", "millimetres"),
    Code("G28", "once", "returns to the first reference point"),
    Code("G30", "once", "returns to the second reference point"),
    Code("G40", "cutter", "cutter compensation off"),
    Code("G41", "cutter", "cutter compensation, left"),
    Code("G42", "cutter", "cutter compensation, right"),
    Code("G43", "tool length", "tool length compensation"),
    Code("G49", "tool length", "tool length compensation off"),
    Code("G52", "once", "local offset"),
    Code("G53", "once", "move in machine coordinates"),
    *(Code(f"G{53 + n}", "system", f"work coordinate system {n}") for n in range(1, 7)),
    Code("G61", "path", "exact stop"),
    Code("G64", "path", "continuous path"),
    Code("G73", "motion", "drilling with chip breaking"),
    Code("G74", "motion", "left-hand tapping"),
    Code("G80", "motion", "cycle off"),
    Code("G81", "motion", "drilling"),
    Code("G82", "motion", "drilling with dwell"),
    Code("G83", "motion", "peck drilling"),
    Code("G84", "motion", "tapping"),
    Code("G85", "motion", "boring, retract at feed rate"),
    Code("G86", "motion", "boring, retract with the spindle stopped"),
    Code("G88", "motion", "boring", "G88 retracts by hand: position and time are unknown; use G82 or G86"),
    Code("G89", "motion", "boring with dwell"),
    Code("G90", "distance", "absolute"),
    Code("G91", "distance", "incremental"),
    Code("G92", "once", "shifts the coordinate system to the words"),
    Code("G94", "feed mode", "feed per minute"),
    Code("G95", "feed mode", "feed per turn"),
    Code("G96", "spindle mode", "constant surface speed", _SURFACE),
    Code("G97", "spindle mode", "constant spindle speed"),
    Code("G98", "retract", "cycles return to the initial level"),
    Code("G99", "retract", "cycles return to R"),
    Code("G93", "feed mode", "inverse time"),
)

_NURBS = "NURBS are not supported; write them as G1, G2, G3 or G5"
_STORES = "it changes the reference point of {}, which is not supported; remove it"

_LINUXCNC_G: Final = (
    Code("G5", "motion", "cubic spline"),
    Code("G5.1", "motion", "quadratic spline"),
    Code("G5.2", "motion", "NURBS", _NURBS),
    Code("G5.3", "once", "end of a NURBS", _NURBS),
    Code("G7", "diameter", "X is a diameter"),
    Code("G8", "diameter", "X is a radius"),
    *(Code(f"{code}.1", "once", "stores the reference point", _STORES.format(code)) for code in ("G28", "G30")),
    Code("G33", "motion", "move synchronised with the spindle"),
    Code("G33.1", "motion", "rigid tapping"),
    *(Code(f"G38.{n}", "motion", "probing") for n in range(2, 6)),
    Code("G41.1", "cutter", "cutter compensation, left"),
    Code("G42.1", "cutter", "cutter compensation, right"),
    Code("G43.1", "tool length", "tool length offset given by axis words"),
    Code("G43.2", "tool length", "additional tool length offset"),
    *(Code(f"G59.{n}", "system", f"work coordinate system {6 + n}") for n in range(1, 4)),
    Code("G61.1", "path", "exact path"),
    *(Code(f"G{n}", "motion", "lathe cycle", _LATHE) for n in ("70", "71", "71.1", "71.2", "72", "72.1", "72.2")),
    Code("G76", "motion", "threading cycle", f"threading cycles are not supported; {_EXPAND}"),
    Code("G87", "motion", "back boring"),
    Code("G90.1", "arc distance", "centres of arcs are absolute"),
    Code("G91.1", "arc distance", "centres of arcs are relative"),
    Code("G92.1", "once", "G92 off, offsets cleared"),
    Code("G92.2", "once", "G92 off, offsets kept"),
    Code("G92.3", "once", "G92 restored"),
)

_NO_SCALING = "scaling is not supported; write the scaled coordinates"
_NO_MIRROR = "mirroring is not supported; write the mirrored coordinates"
_NO_POLAR = "polar coordinates are not supported; write X and Y"
#: Haas codes of the first additional systems
HAAS_SYSTEMS: Final = {f"G{109 + n}": n for n in range(1, 21)}
#: codes of the additional work coordinate systems
ADDITIONAL_SYSTEMS: Final = frozenset({"G54.1", "G154", *HAAS_SYSTEMS})
_NO_POCKET = (
    "milling cycles and hole patterns of the control are not supported; output single moves from the CAM system"
)
_WRITTEN = "--expand writes it as plain lines"
_NO_MODAL_CALL = "modal macro calls are not supported; write G65 on every line that calls the macro"
_NO_TCP = "tool centre point control moves the axes by more than their words; not supported"

_FANUC_G: Final = (
    Code("G5", "high speed", "high precision contour control"),
    Code("G5.1", "high speed", "AI contour control"),
    Code("G7.1", "once", "cylindrical interpolation", "cylindrical interpolation is not supported; write X Y Z"),
    Code("G8", "high speed", "look ahead"),
    Code("G9", "exact", "exact stop on this line"),
    Code("G12.1", "polar plane", "polar interpolation", "polar interpolation is not supported; write X Y Z"),
    Code("G13.1", "polar plane", "polar interpolation off"),
    Code("G15", "polar", "polar coordinates off"),
    Code("G16", "polar", "polar coordinates", _NO_POLAR),
    Code("G22", "stroke", "stored stroke check", "its axis words are limits, which are not supported; remove it"),
    Code("G23", "stroke", "stored stroke check off"),
    Code("G31", "motion", "skip"),
    Code("G43.4", "tool length", "tool centre point control", _NO_TCP),
    Code("G43.5", "tool length", "tool centre point control", _NO_TCP),
    Code("G44", "tool length", "tool length, negative", "negated tool lengths are not supported; use G43"),
    Code("G50", "scaling", "scaling off"),
    Code("G50.1", "mirror", "mirror image off"),
    Code("G51", "scaling", "scaling", _NO_SCALING),
    Code("G51.1", "mirror", "mirror image", _NO_MIRROR),
    Code("G54.1", "system", "one of the additional work coordinate systems"),
    Code("G61.1", "path", "high accuracy"),
    Code("G65", "once", "macro call", f"macros are not supported; {_WRITTEN}"),
    Code("G66", "call", "modal macro call", _NO_MODAL_CALL),
    Code("G67", "call", "modal macro call off"),
    Code("G68", "rotation", "rotation"),
    Code("G68.2", "rotation", "tilted plane", "tilted planes are not supported; write X Y Z"),
    Code("G69", "rotation", "rotation off"),
    Code("G76", "motion", "fine boring"),
    Code("G87", "motion", "back boring", "it shifts the tool by a parameter of the control; not supported"),
    Code("G92.1", "once", "G92 off"),
    Code("G103", "look ahead", "limits the look-ahead of the control"),
    Code("G107", "once", "cylindrical interpolation", "cylindrical interpolation is not supported; write X Y Z"),
    *(
        Code(name, "system", "one of the additional work coordinate systems of a Haas")
        for name in ("G154", *HAAS_SYSTEMS)
    ),
    Code("G187", "high speed", "smoothness"),
    *(Code(f"G{n}", "motion", "pocket or bolt hole cycle of a Haas", _NO_POCKET) for n in (12, 13, 70, 71, 72, 150)),
)

_CALL = "subprograms are not supported; write their moves in the program"
_NO_STORING = f"stored modal states are not supported; {_EXPAND}"

_COMMON_M: Final = (
    Code("M0", "stop", "stop"),
    Code("M1", "stop", "optional stop"),
    Code("M2", "stop", "end"),
    Code("M3", "spindle", "spindle on, clockwise"),
    Code("M4", "spindle", "spindle on, counterclockwise"),
    Code("M5", "spindle", "spindle off"),
    Code("M6", "tool", "tool change"),
    Code("M7", "coolant", "mist on"),
    Code("M8", "coolant", "flood on"),
    Code("M9", "coolant", "coolant off"),
    Code("M19", "spindle", "spindle oriented"),
    Code("M30", "stop", "end"),
    Code("M48", "override", "overrides on"),
    Code("M49", "override", "overrides off"),
    Code(
        "M99",
        "stop",
        "end of a subprogram",
        "in a main program it starts the program again, and the correction is that of one run: write M30 instead; in a "
        f"subprogram: {_CALL}",
    ),
)

_LINUXCNC_M: Final = (
    Code("M98", "stop", "subprogram call", f"{_CALL}; {_EXPAND}"),
    *(Code(f"M{n}", "override", "override switch") for n in range(50, 54)),
    Code("M60", "stop", "stop, change pallets"),
    Code("M61", "tool", "sets the number of the current tool"),
    *(Code(f"M{n}", "io", "inputs and outputs") for n in range(62, 69)),
    *(Code(f"M{n}", "state", "stores or restores modal codes", _NO_STORING) for n in range(70, 74)),
)

_FANUC_M: Final = (
    Code("M97", "stop", "local subprogram call", f"subprograms are not supported; {_WRITTEN}"),
    Code("M98", "stop", "subprogram call", f"subprograms are not supported; {_WRITTEN}"),
    Code("M29", "tapping", "rigid tapping"),
    Code("M198", "stop", "subprogram call", f"{_CALL} in the CAM system"),
)


def _by_number(codes: tuple[Code, ...]) -> dict[float, Code]:
    return {float(code.name[1:]): code for code in codes}


#: G codes by controller and by number as in the program
G_CODES: Final[dict[Controller, dict[float, Code]]] = {
    "linuxcnc": _by_number(_COMMON_G + _LINUXCNC_G),
    "fanuc": _by_number(_COMMON_G + _FANUC_G),
}
M_CODES: Final[dict[Controller, dict[float, Code]]] = {
    "linuxcnc": _by_number(_COMMON_M + _LINUXCNC_M),
    "fanuc": _by_number(_COMMON_M + _FANUC_M),
}


def list_names(*groups: str) -> set[str]:
    """Return the names of the codes in given modal groups, for all controllers."""
    tables = (*G_CODES.values(), *M_CODES.values())
    return {code.name for table in tables for code in table.values() if code.group in groups}


_ARCS: Final = frozenset({"G2", "G3"})

#: by letter, the codes that can use it; a letter used by no code is an error, and the program is refused
USED_BY: Final[dict[Controller, dict[str, frozenset[str]]]] = {
    "linuxcnc": {
        "D": frozenset({"G41", "G42", "G41.1", "G42.1"}),
        "E": frozenset({"M66", "M67", "M68"}),
        "H": frozenset({"G43", "G43.2"}),
        "I": _ARCS | {"G5", "G5.1", "G10", "G33.1", "G87"},
        "J": _ARCS | {"G5", "G5.1", "G10", "G87"},
        "K": _ARCS | {"G33", "G33.1", "G87"},
        "L": (CYCLES - {"G74"}) | {"G10", "G41", "G42", "G41.1", "G42.1", "M66"},
        "P": _ARCS
        | {"G4", "G5", "G10", "G64", "G74", "G82", "G84", "G86", "G89", "M19"}
        | {"M50", "M51", "M52", "M53", "M62", "M63", "M64", "M65", "M66"},
        "Q": frozenset({"G5", "G10", "G64", "G73", "G83", "M19", "M61", "M66", "M67", "M68"}),
        "R": CYCLES | _ARCS | {"G10", "G41.1", "G42.1", "M19"},
    },
    "fanuc": {
        "D": frozenset({"G41", "G42"}),
        "E": frozenset({"G187"}),
        "H": frozenset({"G43", "G49"}),
        "I": _ARCS,
        "J": _ARCS,
        "K": _ARCS | CYCLES,
        "L": CYCLES | {"G10"},
        "P": CYCLES | {"G4", "G5", "G8", "G10", "G30", "G54.1", "G103", "G154", "G187"},
        "Q": frozenset({"G5.1", "G73", "G76", "G83", "G74", "G84"}),
        "R": CYCLES | _ARCS | {"G5.1", "G10", "G68"},
    },
}

#: letters that are refused on every line
REFUSED_LETTERS: Final[dict[str, str]] = {
    "U": "the axes U V W are not supported; write a dwell as G4 P, or on a Fanuc as G4 X",
    "V": "the axes U V W are not supported",
    "W": "the axes U V W are not supported",
    "@": "polar coordinates (@ ^) are not supported; write X and Y",
    "^": "polar coordinates (@ ^) are not supported; write X and Y",
    "$": "more than one spindle ($) is not supported",
}


def find_code(letter: str, number: float, controller: Controller) -> Code | None:
    """Return the code of a G or M word; None if it is unknown."""
    table = (G_CODES if letter == "G" else M_CODES)[controller]
    return table.get(round(number, 3))


_USERS_OF_P: Final = (
    USED_BY["linuxcnc"]["P"] | USED_BY["fanuc"]["P"] | {"G54", "G51", "G65", "G66", "M97", "M98", "M99", "M198"}
)


def find_owner_of_p(words: Iterable[tuple[str, float]]) -> str:
    """Return the code that a P belongs to: the last preceding one that can have a P, else the first following one."""
    owner, there = "", False
    for letter, number in words:
        there = there or letter == "P"
        if letter in "GM" and (name := f"{letter}{number:g}") in _USERS_OF_P:
            owner = name
        if there and owner:
            return owner
    return ""
