"""Words that LinuxCNC and Fanuc controls both accept but interpret differently in time, drift or correction."""

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from thermocomp.nc.interpreter.codes import M_CODES
from thermocomp.nc.interpreter.inforce import (
    ARC_WORDS,
    ARCS,
    DRILLS,
    MOTIONS,
    TAKES_AXES,
    InForce,
    LineWords,
    read_number,
)

_DWELLS: Final = (74.0, 82.0, 84.0, 86.0, 89.0)
#: cycles that LinuxCNC does not start without P
_WANT_P: Final = (82.0, 86.0, 89.0)
_TAPS: Final = (74.0, 84.0)
_PECKS: Final = (73.0, 83.0)
_OTHER_CYCLES: Final = (76.0, 87.0, 88.0)
_LATHE_CYCLES: Final = (70.0, 71.0, 71.1, 71.2, 72.0, 72.1, 72.2)
_LENGTHS: Final = "XYZABCIJKRQ"
_AXES: Final = "XYZABCUVW"
_LOGIC = re.compile(r"(?<![A-Z])(?:AND|X?OR)(?![A-Z])")
_ROUNDING = re.compile(r"(?<![A-Z])(?:FIX|FUP|MOD|ROUND)(?![A-Z])")
_BARE = re.compile(r"[-+]?0*[1-9][0-9]*").fullmatch
_ANGLE = re.compile(r"(?<![A-Z])(?:ASIN|ATAN)(?![A-Z])")
_VARIABLE = re.compile(r"#(?:0*[1-9][0-9]{3,}|#[#0-9]*|\[)")

_SHIFT = (
    "shares one stored offset with G92 and G52 in LinuxCNC, which keeps it after the end of the program; a Fanuc "
    "stores it separately and clears it: shift by G54 to G59"
)
_OTHER = "is a different cycle in LinuxCNC and in a Fanuc: replace it with its moves"
_TILTED = "sets the tool length offset to its words in LinuxCNC, and applies the length along a tilted tool in a Fanuc"
_NORMAL = "reads the cutter diameter from D in LinuxCNC, and turns an axis along the path in a Fanuc (normal direction)"
_STORES = "stores the tool position in LinuxCNC, and moves in a Fanuc (to a floating reference point)"
#: codes that are ambiguous wherever they occur: kind, and interpretations
_OPEN_CODES: Final = {
    **dict.fromkeys((52.0, 92.0, 92.1), ("shift", _SHIFT)),
    **dict.fromkeys((*_OTHER_CYCLES, *_LATHE_CYCLES), ("other cycle", _OTHER)),
    7.0: (
        "diameter",
        "makes X a diameter in LinuxCNC, and begins or ends hypothetical-axis interpolation in a Fanuc, where the "
        "axis does not move (G7 X0 to G7 X1)",
    ),
    **dict.fromkeys((28.1, 30.1), ("stored home", _STORES)),
    33.0: ("thread", "reads the distance per turn from K in LinuxCNC, and from F in a Fanuc"),
    **dict.fromkeys((41.1, 42.1), ("normal", _NORMAL)),
    43.1: ("tilted", _TILTED),
    43.2: ("tilted", "adds a tool length to that in force in LinuxCNC, and applies it along a tilted tool in a Fanuc"),
    61.0: ("exact", "follows corners exactly in LinuxCNC, and stops in them in a Fanuc: write G64"),
    61.1: ("exact", "stops in corners in LinuxCNC, and smooths them in a Fanuc: write G64"),
}
_G10 = (
    "sets other offsets in LinuxCNC (L1, L10, L11: the tool table; L20: by the tool position; P0: the system in "
    "force) than in a Fanuc (L10 to L13: tool offsets; L20: G54.1; P0: the external offset): write G10 L2 P1 to P6, in "
    "G90 and without R"
)
#: M codes of LinuxCNC that are machine-specific on a Fanuc; M48 and M49, too, although most builders agree on them
_MAKERS_M: Final = {
    n: code.does for n, code in M_CODES["linuxcnc"].items() if n not in M_CODES["fanuc"] or n in (48.0, 49.0)
}
_STATE: Final = (70.0, 71.0, 72.0, 73.0)
_SAY: Final = "give --controller"
_SAY_DWELL: Final = f"{_SAY}, or for a Fanuc write G4 X, which is in seconds with a decimal point"
_CALL = "is read by LinuxCNC from separate files, and by a Fanuc from its memory: write the moves in the program"


class OpenWord(NamedTuple):
    """A word that LinuxCNC and Fanuc controls interpret differently."""

    kind: str
    text: str
    readings: str  #: interpretations, and what to write instead


def list_open_words(line: LineWords, force: InForce) -> Iterator[OpenWord]:
    """Yield the ambiguous words of a line."""
    codes, values = set(line.g), line.values
    if 4.0 in codes:
        yield from _open_dwell(values)
    yield from (OpenWord(_OPEN_CODES[n][0], f"G{n:g}", _OPEN_CODES[n][1]) for n in line.g if n in _OPEN_CODES)
    yield from (OpenWord("call", f"M{n:g}", _CALL) for n in line.m if n in (98.0, 99.0))
    if line.p_of in ("G8", "G54") and (user := line.linuxcncs_user_of_p()):
        what = f"belongs to {user} in LinuxCNC, and may belong to {line.p_of} in a Fanuc: put the two on separate lines"
        yield OpenWord("whose P", f"P{values['P']}", what)
    if line.g == [8.0]:  # a Fanuc expects G8 in a separate block
        yield OpenWord("radius", "G8", "makes X a radius in LinuxCNC, and looks ahead in a Fanuc, where it has P")
    yield from _open_machine(line)
    if 10.0 in codes and not _sets_origin(values, force):
        words = "".join(f" {letter}{values[letter]}" for letter in "LP" if letter in values)
        yield OpenWord("g10", f"G10{words}", _G10)
    if 53.0 in codes and force.motion in (1.0, *ARCS):
        what = "moves at feed rate in LinuxCNC under G1, and as a rapid in a Fanuc: write G53 G0"
        yield OpenWord("g53", "G53", what)
    yield from _open_places(codes, values)
    if force.motion in ARCS and force.takes_p(line) and read_number(values.get("P", "1")) != 1.0:
        what = (
            "is the number of turns of an arc in LinuxCNC, and ignored by a Fanuc: write each turn on a separate line"
        )
        yield OpenWord("turns", f"P{values['P']}", what)
    for letter in "UVW":
        if letter in values and 4.0 not in codes:
            what = "is a separate axis in LinuxCNC, and an increment of X, Y or Z in a Fanuc: write X, Y and Z"
            yield OpenWord("way", f"{letter}{values[letter]}", what)
    yield from _open_expressions(line)
    yield from _open_lathe(codes, values, force)
    if force.feed and _is_bare(values.get("F", "")):
        unit = f"{force.unit or ' mm'} per {'turn' if force.per_turn else 'minute'}"
        what = (
            f"is {int(values['F'])}{unit} in LinuxCNC, perhaps in least increments in a Fanuc: write the decimal point"
        )
        yield OpenWord("feed", f"F{values['F']}", f"{what} (F{values['F']}.)")
    if force.motion in DRILLS and not values.keys().isdisjoint("XYZABC") and codes.isdisjoint(TAKES_AXES):
        yield from _open_cycle(codes, line, force)
    if 4.0 not in codes and not (force.whole or 19.0 in line.m):
        yield from _open_lengths(codes, values, force)


def _open_dwell(values: dict[str, str]) -> Iterator[OpenWord]:
    if _counts(values.get("P")):
        yield OpenWord("dwell", f"G4 P{values['P']}", _seconds(values["P"], _SAY_DWELL))
    if beside := [letter for letter in _AXES if letter in values]:
        what = "moves in LinuxCNC, and a Fanuc reads X or U as the dwell time: write the move on a separate line"
        yield OpenWord("dwell and move", f"{beside[0]}{values[beside[0]]} with G4", what)


def _open_places(codes: set[float], values: dict[str, str]) -> Iterator[OpenWord]:
    if not codes.isdisjoint((28.0, 30.0)) and values.keys().isdisjoint(_AXES):
        code = "G28" if 28.0 in codes else "G30"
        yield OpenWord("home", code, "without axes moves all axes in LinuxCNC, and none in a Fanuc: name the axes")
    if side := next((f"G{n:g}" for n in (41.0, 42.0) if n in codes), None):
        yield from _open_radius(side, values.get("D"))
    if 43.0 in codes and "H" not in values:
        what = "uses the tool in the spindle in LinuxCNC, and the last H in a Fanuc: write H"
        yield OpenWord("g43", "G43 without H", what)
    if 43.0 in codes and read_number(values.get("H", "")) == 0.0:
        what = "uses the length of the tool in the spindle in LinuxCNC, and none in a Fanuc: write its number, or G49"
        yield OpenWord("g43", f"G43 H{values['H']}", what)


def _open_radius(side: str, number: str | None) -> Iterator[OpenWord]:
    if number is None:
        what = "uses the radius of the tool in the spindle in LinuxCNC, and the last D in a Fanuc: write D"
        yield OpenWord("g41", f"{side} without D", what)
    elif read_number(number) == 0.0:
        what = "uses the radius of the tool in the spindle in LinuxCNC, and none in a Fanuc: write its number, or G40"
        yield OpenWord("g41", f"{side} D{number}", what)


def _open_machine(line: LineWords) -> Iterator[OpenWord]:
    """Yield the M codes with machine-specific functions on a Fanuc."""
    for number in line.m:
        if number in _MAKERS_M:
            what = f"belongs to LinuxCNC: {_MAKERS_M[number]}; on a Fanuc or Haas the machine builder defines"
            kind = "state" if number in _STATE else "maker"
            yield OpenWord(kind, f"M{number:g}", f"{what} it (pallets, clamps, outputs)")
    beside = next((letter for letter in "RPQ" if letter in line.values), None)
    if 19.0 in line.m and beside:
        what = "has the angle in R, direction in P, time in Q in LinuxCNC, and words of the machine builder on a Fanuc"
        yield OpenWord("orient", f"M19 {beside}{line.values[beside]}", f"{what} or Haas (P may be an angle)")


def _open_expressions(line: LineWords) -> Iterator[OpenWord]:
    if line.computed:
        what = "is computed at run time, and may be a code that the controls interpret differently: write its number"
        yield OpenWord("computed", line.computed, what)
    if _LOGIC.search(line.code):
        what = "works on bits in a Fanuc, and on true and false in LinuxCNC: avoid it"
        yield OpenWord("logic", "AND, OR or XOR", what)
    if _ROUNDING.search(line.code):
        what = "rounds differently in a Fanuc and in LinuxCNC (below zero, or ROUND within a word): avoid it"
        yield OpenWord("rounding", "FIX, FUP, MOD or ROUND", what)
    if _ANGLE.search(line.code):
        what = (
            "below zero is a negative angle in LinuxCNC, and may be 360 degrees more in a Fanuc (parameter 6004): "
            "write the angle as a number"
        )
        yield OpenWord("angle", "ASIN or ATAN", what)
    if variable := _VARIABLE.search("".join(line.code.split())):
        what = "from #1000 on has different meanings in LinuxCNC and in a Fanuc: use #1 to #999, by their number"
        yield OpenWord("variable", variable[0].replace("[", "[..]"), what)


def _open_lathe(codes: set[float], values: dict[str, str], force: InForce) -> Iterator[OpenWord]:
    """Yield words that a Fanuc lathe interprets differently, unless the whole program rules out a lathe (`DOUBTS`)."""
    if 99.0 in codes or (98.0 in codes and force.per_turn):
        code = "G99" if 99.0 in codes else "G98"
        what = "without cycles is feed per turn (G99) or minute (G98) on a Fanuc's lathe: write G95 or G94 instead"
        yield OpenWord("feed mode", code, what)
    if (tool := values.get("T", "")).isdigit() and len(tool) in (3, 4):  # a tool and its offset
        what = "without M6 changes the tool on a Fanuc's lathe, and only selects it in LinuxCNC: write M6"
        yield OpenWord("tool", f"T{tool}", what)
    cycle = next((f"G{n:g}" for n in (90.0, 94.0) if n in codes), None)
    if cycle and codes.isdisjoint((*MOTIONS, *TAKES_AXES)) and {"X", "Z"} <= values.keys() and "Y" not in values:
        what = "with X and Z is a turning cycle on a Fanuc's lathe: write it on a separate line"
        yield OpenWord("turning", cycle, what)


#: kinds of words that are not ambiguous if the whole program has this property
DOUBTS: Final = {"feed mode": "drilled", "tool": "changed", "turning": "mill"}


def _is_bare(value: str) -> bool:
    """Return whether a word has a nonzero number without a decimal point."""
    return _BARE(value) is not None


def _sets_origin(values: dict[str, str], force: InForce) -> bool:
    """Return whether G10 sets the origin of G54 to G59, as in both controls."""
    return (
        read_number(values.get("L", "")) == 2.0
        and 1.0 <= read_number(values.get("P", "")) <= 6.0
        and "R" not in values
        and force.absolute
    )


def _open_cycle(codes: set[float], line: LineWords, force: InForce) -> Iterator[OpenWord]:
    values, motion, code = line.values, force.motion, f"G{force.motion:g}"
    if force.begins_above(line):
        what = (
            "is above the level at which the cycle begins: LinuxCNC ends the cycle at R, and when the tool of a "
            "Fanuc moves up depends on its model: move to that level before the cycle"
        )
        yield OpenWord("high R", f"{code} R{values['R']}", what)
    if motion == 86.0 and read_number(values.get("P", "0")) != 0.0:
        what = "dwells in LinuxCNC, and a Fanuc's G86 has no dwell: write P0, or single moves"
        yield OpenWord("cycle dwell", f"G86 P{values['P']}", what)
    elif motion in _DWELLS and _counts(values.get("P")):
        yield OpenWord("cycle dwell", f"{code} P{values['P']}", _seconds(values["P"], _SAY))
    elif motion in _WANT_P and force.begins and "P" not in values:
        what = "is refused by LinuxCNC on the first line of a cycle, and does not dwell in a Fanuc: write P0, or a time"
        yield OpenWord("no dwell", f"{code} without P", what)
    if "L" in values or ("K" in values and motion not in _OTHER_CYCLES):
        letter = "L" if "L" in values else "K"
        what = "repeats the cycle: LinuxCNC and a Haas read L, a Fanuc reads K: write each hole on a separate line"
        yield OpenWord("repeats", f"{code} {letter}{values[letter]}", what)
    if force.across:
        what = (
            "in G18 or G19 drills across that plane in LinuxCNC, and along Z in a Fanuc unless it is set otherwise "
            "(parameter 5101): write G17, or single moves"
        )
        yield OpenWord("across", code, what)
    if force.kept not in (None, force.absolute):
        what = (
            "continues with R and depth of earlier lines (positions in G90, distances in G91): LinuxCNC reads "
            "them again, and a Fanuc depending on its model: write all words of the cycle after G80"
        )
        yield OpenWord("kept", f"{code} in G{90 if force.absolute else 91}", what)
    if not force.retract:
        what = "returns to R in LinuxCNC (G99), and to the initial level in a Fanuc (G98): write G98 or G99"
        yield OpenWord("retract", f"{code} before G98 or G99", what)
    if motion in _PECKS and motion in codes:
        what = "stops 0.254 mm above the last depth in LinuxCNC, and by a parameter in a Fanuc: write single moves"
        yield OpenWord("peck", code, what)
    if motion in _TAPS and motion in codes:
        what = "needs a turning spindle in LinuxCNC, and starts it in a Fanuc: write G33.1, or M29 for a Fanuc"
        yield OpenWord("tap", code, what)


def _open_lengths(codes: set[float], values: dict[str, str], force: InForce) -> Iterator[OpenWord]:
    """Yield the first length without a decimal point, and count the arcs that show the meaning of such lengths."""
    drills = force.motion in DRILLS
    bare = {letter: value for letter, value in values.items() if _is_bare(value)}
    if force.motion in ARCS and not bare.keys().isdisjoint(ARC_WORDS):
        force.mixed += any("." in values.get(letter, "") for letter in ARC_WORDS)
    for letter in _LENGTHS:
        counts = (letter == "K" and drills) or (letter == "Q" and not drills) or (letter == "R" and 10.0 in codes)
        if letter not in bare or counts:
            continue
        value = bare[letter]
        unit, least = (" deg", 1e-3) if letter in "ABC" else (force.unit, 1e-4 if force.unit == " in" else 1e-3)
        yield OpenWord(
            "length",
            f"{letter}{value}",
            f"is {int(value)}{unit} for LinuxCNC, and {int(value) * least:g}{unit} for a Fanuc that uses least "
            f"increments: write the decimal point ({letter}{value}.)",
        )
        return


def _counts(value: str | None) -> bool:
    """Return whether a dwell may be either in seconds or in milliseconds: all controls read fractions as seconds."""
    return value is not None and (number := read_number(value)) != 0.0 and number % 1.0 == 0.0


def _seconds(value: str, advice: str) -> str:
    number = read_number(value)
    if number < 0.0:
        return f"is in seconds for LinuxCNC, and in milliseconds for a Fanuc: {advice}"
    if "." in value:
        return (
            f"is {number:g} s for LinuxCNC and a Haas, a Fanuc expects milliseconds without a decimal point: {advice}"
        )
    return f"is {number:g} s for LinuxCNC, and {number / 1000.0:g} s for a Fanuc: {advice}"
