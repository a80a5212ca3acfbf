"""Translation of a Fanuc program for LinuxCNC, whose interpreter can then verify its revision.

Only equivalent functions are translated: G68 becomes an offset and a rotation, K becomes L, a dwell is converted to
seconds, and codes without motion are omitted. Anything that LinuxCNC does differently or cannot do raises an error.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import PLANES, Block, Point, Setup, system_name, triple
from thermocomp.nc.interpreter.codes import ADDITIONAL_SYSTEMS, CYCLES
from thermocomp.nc.interpreter.cycles import KEPT
from thermocomp.nc.interpreter.interpret import Follower
from thermocomp.nc.parser.tokens import read_lines

#: diameter of all cutters under G41 and G42: small enough for every contour [mm]
DIAMETER: Final = 0.02
#: LinuxCNC systems used for G54.1 P1 etc.
_SPARE: Final = (7, 8, 9)
_MOST_M: Final = 4
_GO: Final = "G0"

#: identical codes, in LinuxCNC's order of execution
_SAME: Final = (
    *("G93", "G94", "G95", "G97", "G17", "G18", "G19", "G40", "G61", "G64"),
    *(f"G{n}" for n in range(54, 60)),
    *("G90", "G91"),
)
_OTHER: Final = {"G61": "G61.1"}
_SAME_M: Final = frozenset({"M0", "M1", "M2", "M3", "M4", "M5", "M6", "M7", "M8", "M9", "M30", "M48", "M49"})
#: codes without motion, for path smoothing or cancelling inactive modes; G98 and G99 are written with each cycle
_LEFT_OUT: Final = frozenset(
    {"G5", "G5.1", "G8", "G9", "G61.1", "G103", "G187"}
    | {"G13.1", "G15", "G22", "G23", "G50", "G50.1", "G67"}
    | {"G98", "G99", "M19", "M29"}
)
_MOTION: Final = CYCLES | {"G0", "G1", "G2", "G3", "G80", "G31"}
_ONCE: Final = ("G4", "G10", "G28", "G30", "G52", "G53", "G92", "G92.1")
_AXES: Final = "XYZABC"


class UntranslatableError(InputError):
    """Error for a line that cannot be translated into LinuxCNC code.

    Parameters
    ----------
    line : int
        Line number (1-based).
    """

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line
        self.reason = reason


class Translator:
    """Translator of one Fanuc program.

    Parameters
    ----------
    setup : Setup
        Setup of the program.

    Attributes
    ----------
    systems : dict of int to int
        LinuxCNC systems, by the systems of G54.1 (100 + P) in the program.
    """

    def __init__(self, setup: Setup) -> None:
        self.systems: dict[int, int] = {}
        self._setup = setup
        self._follower = Follower(setup)
        self._stores: set[str] = set()  # G52, G68 and G92 share one stored offset in LinuxCNC
        self._local: Point = (0.0, 0.0, 0.0)  # offset of G52 [mm]
        self._turned = False
        self._turning = 0
        self._length: int | None = None

    def translate(self, lines: Iterable[str]) -> Iterator[tuple[str, int]]:
        """Yield the lines of a Fanuc program translated for LinuxCNC."""
        for line in read_lines(lines, "fanuc"):
            block = self._follower.step(line)
            if line.optional and self._setup.skip_optional:
                continue
            texts = self._told(block)
            for text in texts:
                yield f"{'/' if line.optional else ''}{text}\n", line.number
            if block.ends:
                return

    def setup(self) -> Setup:
        """Return the state of an equivalent LinuxCNC controller, after the whole program has been translated.

        A Fanuc stores no rotation, and by default starts with G98 and without a path tolerance. If the program uses G52
        or G68, no G92 may be in force at its start: LinuxCNC has one stored offset for all of them.
        """
        own = self._setup
        offsets = {self.systems.get(system, system): place for system, place in own.offsets.items()}
        return replace(
            own,
            controller="linuxcnc",
            offsets={system: place for system, place in offsets.items() if 1 <= system <= 9},
            rotations=dict.fromkeys(range(1, 10), 0.0),
            no_shift=own.no_shift or bool(self._stores & {"G52", "G68"}),
            integers="whole",
            harmless=frozenset(),
        )

    # -- one line ----------------------------------------------------------------------------------------------------

    def _told(self, block: Block) -> list[str]:
        if block.line.demarcation:
            return ["M2"] if block.ends else []
        if not block.codes and not block.values:
            return []
        codes = set(block.codes)
        self._check(block, codes)
        # LinuxCNC reads an F next to G20 in the previous unit
        first: list[str] = [code for code in ("G20", "G21") if code in codes]
        head = [_OTHER.get(code, code) for code in _SAME if code in codes]
        head += self._cutter(block, codes) + self._lengths(block, codes) + self._system(block, codes)
        head += self._speeds(block, codes)
        machine = [code for code in block.codes if code in _SAME_M]
        if len(machine) > _MOST_M:
            first.append(" ".join(machine[:_MOST_M]))
            machine = machine[_MOST_M:]
        rotation = self._rotation(block, codes)
        once = next((code for code in _ONCE if code in codes), "")
        before, action, after = ([], self._once(block, once), []) if once else self._move(block, codes)
        before = [" ".join((*head, text)) if text.startswith(_GO) else text for text in before]
        main = [" ".join(filter(None, (*head, *machine, action)))]
        turned = [*main, *rotation] if block.modal.turned else [*rotation, *main]
        return [text for text in (*first, *before, *turned, *after) if text]

    def _check(self, block: Block, codes: set[str]) -> None:
        known = {*_SAME, *_SAME_M, *_LEFT_OUT, *_MOTION, *(f"M{n}" for n in self._setup.harmless)}
        known |= {*_ONCE, "G20", "G21", "G41", "G42", "G43", "G49", "G68", "G69", *ADDITIONAL_SYSTEMS}
        if strange := sorted(codes - known):
            raise _cannot(block, f"{strange[0]} has no counterpart in LinuxCNC")
        if block.kind == "probe":
            raise _cannot(block, "G31 probes: its end position is unknown")
        self._stores |= codes & {"G52", "G68", "G92", "G92.1"}
        if self._stores & {"G92", "G92.1"} and self._stores & {"G52", "G68"}:
            raise _cannot(block, "G92 with G52 or G68: LinuxCNC has one stored offset for all of them")

    def _cutter(self, block: Block, codes: set[str]) -> list[str]:
        side = next((code for code in ("G41", "G42") if code in codes), None)
        if side is None:
            return []
        return [f"{side}.1 D{format_number(DIAMETER / (25.4 if block.modal.inch else 1.0))}"]

    def _lengths(self, block: Block, codes: set[str]) -> list[str]:
        if "G49" in codes:
            return ["G49"]
        if "G43" not in codes:
            return []
        self._length = int(block.values["H"]) if "H" in block.values else self._length
        if self._length is None:
            raise _cannot(block, "G43 without H: the control uses the last H, which is not in the program")
        return [f"G43 H{self._length}"] if self._length else ["G49"]

    def _system(self, block: Block, codes: set[str]) -> list[str]:
        if not ADDITIONAL_SYSTEMS & codes:
            return []
        return [system_name(self._spare(block, block.modal.system))]

    def _spare(self, block: Block, system: int) -> int:
        """Return the LinuxCNC system that replaces a system of G54.1."""
        if system not in self.systems:
            if len(self.systems) == len(_SPARE):
                raise _cannot(block, f"LinuxCNC can hold up to {len(_SPARE)} work coordinate systems of G54.1")
            self.systems[system] = _SPARE[len(self.systems)]
        return self.systems[system]

    def _speeds(self, block: Block, codes: set[str]) -> list[str]:
        """Return F, S, T words; F is repeated after G94, because LinuxCNC, unlike a Fanuc, resets it."""
        told = []
        state = self._follower.state
        if "F" in block.values or ({"G94", "G95"} & codes and state.feed_word):
            told.append(f"F{format_number(state.feed_word)}")
        told += [f"{letter}{format_number(block.values[letter])}" for letter in "ST" if letter in block.values]
        self._turning = state.turning
        return told

    def _once(self, block: Block, once: str) -> str:
        """Return the non-modal code of a line with its words, translated."""
        values = block.values
        words = _words(values, _AXES)
        if once == "G10":
            return self._stored(block)
        if once == "G30" and values.get("P", 2.0) != 2.0:
            raise _cannot(block, f"G30 P{values['P']:g}: LinuxCNC has only two reference points")
        if once == "G52":
            scale = self._follower.state.scale
            self._local = triple(
                values[c] * scale if c in values else v for c, v in zip("XYZ", self._local, strict=True)
            )
        if once == "G53":  # always a rapid
            return f"G0 G53 {words}" if block.moves else ""
        return {"G4": f"G4 P{format_number(block.pause)}", "G92.1": once}.get(once, f"{once} {words}")

    def _move(self, block: Block, codes: set[str]) -> tuple[list[str], str, list[str]]:
        """Return lines before the line, words on the line, and lines after it; each move has its motion code."""
        if block.kind == "cycle":
            return self._cycle(block)
        if block.kind in ("line", "arc"):
            letters = _AXES if block.kind == "line" else f"{_AXES}IJKR"
            return [], f"{block.modal.motion} {_words(block.values, letters)}", []
        return [], "G80" if "G80" in codes else "", []

    def _stored(self, block: Block) -> str:
        values = block.values
        kind, target = int(values["L"]), int(values["P"])
        if not block.modal.absolute:
            raise _cannot(block, "G10 in G91 moves the origin by its words, which LinuxCNC does not do")
        if kind == 20:
            target = self._spare(block, 100 + target)
        elif not target:
            raise _cannot(block, "G10 L2 P0 sets the external offset, which LinuxCNC does not have")
        return f"G10 L2 P{target} {_words(values, _AXES)}"

    def _rotation(self, block: Block, codes: set[str]) -> list[str]:
        """Return the lines for G68 or G69: LinuxCNC rotates about the system's origin, hence the shift."""
        turned = block.modal.turned
        if "G68" not in codes and (turned or not self._turned):
            return []
        self._turned = turned
        scale = self._follower.state.scale
        angle, x, y = 0.0, self._local[0], self._local[1]
        if turned:
            angle = math.radians(block.values["R"])
            a, b = block.values["X"] * scale + x, block.values["Y"] * scale + y
            x += a * math.cos(angle) + b * math.sin(angle) - a
            y += b * math.cos(angle) - a * math.sin(angle) - b
        # under a G52 LinuxCNC changes the position when a rotation changes
        turn = f"G10 L2 P0 R{format_number(math.degrees(angle))}"
        return ["G52 X0 Y0", turn, f"G52 X{format_number(x / scale)} Y{format_number(y / scale)}"]

    # -- cycles ------------------------------------------------------------------------------------------------------

    def _cycle(self, block: Block) -> tuple[list[str], str, list[str]]:
        """Return a cycle with all its words: LinuxCNC keeps them for the same cycle only, a Fanuc until G80."""
        if not block.moves:  # K0
            return [], "", []
        state, modal = self._follower.state, block.modal
        # the shift of G76 at the bottom, by Q in a direction that a parameter sets, is the same in both programs
        code = "G82" if modal.motion == "G76" else modal.motion
        across = PLANES[modal.plane][2]
        letter = "XYZ"[across]
        words = {c: v for c, v in block.values.items() if c in _AXES}
        words |= {
            c: block.sticky[c] for c in (letter, "R", "Q") if c in block.sticky and (c != "Q" or "Q" in KEPT[code])
        }
        if "P" in KEPT[code] or code in ("G74", "G84"):
            words["P"] = block.sticky.get("P", 0.0) / 1000.0
        repeats = block.values.get("K", block.values.get("L"))
        if repeats is not None:
            words["L"] = repeats
        if code == "G74":
            words.pop("L", None)
        before, after = self._spindle(block)
        scale, back = state.scale, f"G{modal.retract} " if modal.retract_stated else ""
        level, plane = state.level or 0.0, block.sticky["R"] * scale
        if modal.absolute and modal.retract == 98 and abs(block.start[across] - plane) < 1e-3 < level - plane:
            # from R a Fanuc moves to the next hole at R; LinuxCNC moves up before or not, depending on rounding
            up = f"G0 {letter}{format_number(level / scale)}"
            return before, f"G99 {code} {_words(words, 'XYZRQPL')}", [up, *after]
        if block.keeps_levels:
            return before, "", [*self._holes(block, f"{back}{code}", words), *after]
        if modal.absolute and modal.retract == 99 and state.level_known and plane - block.start[across] > 1e-6:
            # a Fanuc moves to the hole first and then up to R, LinuxCNC up first
            before = [*before, f"{_GO} {_words(block.values, 'XYZ'.replace(letter, ''))}"]
        return before, f"{back}{code} {_words(words, 'XYZRQPL')}", after

    def _holes(self, block: Block, code: str, words: dict[str, float]) -> list[str]:
        """Return a line for each hole of a cycle in G91 whose levels were stated in G90; LinuxCNC has no such mode."""
        state = self._follower.state
        steps = {c: words[c] for c in "XY" if c in words}
        level, plane = state.level or 0.0, block.sticky["R"] * state.scale
        if not all(state.known["XY".index(c)] for c in steps) or (state.modal.retract == 98 and plane > level - 1e-3):
            raise _cannot(block, "G91 in a cycle from a position that is not known, or with R at or above its start")
        lines = []
        for k in range(1, int(words.pop("L", 1.0)) + 1):
            places = {c: block.start["XY".index(c)] / state.scale + k * step for c, step in steps.items()}
            lines.append(f"G90 {code} {_words(words | places, 'XYZRQP')}")
        return [*lines, "G91"]

    def _spindle(self, block: Block) -> tuple[list[str], list[str]]:
        """Return the lines that start the spindle before a tap and restore it after: a Fanuc does so automatically."""
        code, turning = block.modal.motion, self._turning
        if code not in ("G74", "G84", "G86"):
            return [], []
        wanted = -1 if code == "G74" else turning or 1
        wanted = 1 if code == "G84" else wanted
        if wanted == turning:
            return [], []
        if code == "G86" or not self._follower.state.spindle:
            raise _cannot(block, f"{code} while the spindle is stopped, which LinuxCNC refuses")
        names = {1: "M3", -1: "M4", 0: "M5"}
        return [names[wanted]], [names[turning]]


def format_number(value: float) -> str:
    """Return a number in LinuxCNC format."""
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text.strip("-0.") == "" else text


def _words(values: dict[str, float], letters: str) -> str:
    return " ".join(f"{letter}{format_number(values[letter])}" for letter in letters if letter in values)


def _cannot(block: Block, why: str) -> UntranslatableError:
    return UntranslatableError(block.line.number, why)
