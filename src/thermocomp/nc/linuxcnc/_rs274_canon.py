"""Receiver of the canonical calls of LinuxCNC's interpreter; it writes them in blocks.

LinuxCNC's module `gcode` only reports moves, offsets and comments. Its functions for spindle, coolant, stops and the
like are empty: the interpreter's entries for them are redirected to methods of the receiver, and a missing entry is an
error. The module gives lengths in inches, whatever the unit of the program; lengths other than those of moves are
output in mm.

Part of the script `_rs274_child.py`: standard library only.
"""

import ctypes
import json
import math
import os
import re
import struct
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, BinaryIO

# loaded by `_rs274_child.py`
hooks, kinds, reading = (import_module(f"_rs274_{name}") for name in ("hooks", "kinds", "reading"))

MM = 25.4
#: number of records in a block
BLOCK = 2048

INT, D, B, P, TEXT = kinds.INT, kinds.D, kinds.B, kinds.P, kinds.TEXT
RECORD, CODES, TOLD, REDIRECTED, PYTHON = kinds.RECORD, kinds.CODES, kinds.TOLD, kinds.REDIRECTED, kinds.PYTHON
ARC, CENTRE = CODES["arc"], CODES["centre"]
RefusedError = reading.RefusedError


def straight(code: int) -> Callable[..., None]:
    """Return the method that records the linear moves of a kind."""

    def move(self: "Canon", *place: float) -> None:
        self.act(moved=place != self.place)
        self.place = place
        self.records.append(RECORD.pack(code, 9, self.line, *place, 0.0))
        if len(self.records) >= BLOCK:
            self.flush()

    return move


class Canon:
    """Receiver of the canonical calls of the interpreter."""

    def __init__(self, out: BinaryIO) -> None:
        self.out = out
        self.records: list[bytes] = []
        self.more: list[Any] = []
        self.line = 0
        self.begun = 0  # 1 after the mark in the start block of the job, 2 after its last call (tool length)
        self.metric = False
        self.interpreter = 0
        self.place: tuple[float, ...] = (0.0,) * 9  # current position in program coordinates [inch, deg]
        self.offset: dict[str, tuple[float, ...]] = dict.fromkeys(("g5x", "g92", "length"), (0.0,) * 9)  # [inch, deg]
        self.angle = 0.0
        self.plane = 1
        self.feed = 0.0  # [mm/min]
        self.path = (3, 0.0, 0.0)  # G64; tolerances [mm]
        self.file = b""
        self.files: dict[bytes, None] = {}  # files opened so far
        self.hooks = hooks.Hooks()
        self.linked = ctypes.PyDLL("librs274.so.0")
        self.sequence = self.linked._ZN6Interp15sequence_numberEv
        self.sequence.argtypes = (P,)
        self.name = self.linked._ZN6Interp9file_nameEPcm
        self.name.argtypes = (P, ctypes.c_char_p, ctypes.c_size_t)
        self.buffer = ctypes.create_string_buffer(512)
        self.alone = True  # no other file has been opened
        self.flushed = 0

    def begin(self, job: dict[str, Any]) -> None:
        """Set the program to be run, its tools, and the limits on its execution."""
        self.parameter_file = job["parameters"]  # read by the module
        self.delete = bool(job["block_delete"])
        self.tools: list[tuple[int, float, float]] = job["tools"]  # number, length, diameter
        self.spindle: int = job["spindle"]
        self.program = os.path.realpath(job["program"].encode())
        home = os.path.dirname(job["home"])  # noqa: PTH120
        self.reading = reading.ProgramReading(job["program"], home, job["folders"], job["lines"], self.reached)

    def connect(self, module: str) -> None:
        """Redirect the empty functions of the module to this object."""

        def told(kind: str) -> Callable[..., None]:
            return lambda *numbers: self.tell(kind, *numbers)

        functions: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
            name: (told(kind), (None, *types)) for name, (kind, types) in TOLD.items()
        }
        functions |= {name: (getattr(self, method), types) for name, (method, types) in REDIRECTED.items()}
        functions[PYTHON] = (self.python, (INT, P, TEXT, P, B))
        # the values returned by the module are wrong after a change of the unit, an offset or the mode
        functions["_Z22GET_EXTERNAL_FEED_RATEv"] = (lambda: self.feed / self.unit(), (D,))
        functions["_Z32GET_EXTERNAL_MOTION_CONTROL_MODEv"] = (lambda: self.path[0], (INT,))
        functions["_Z37GET_EXTERNAL_MOTION_CONTROL_TOLERANCEv"] = (lambda: self.path[1] / self.unit(), (D,))
        functions["_Z46GET_EXTERNAL_MOTION_CONTROL_NAIVECAM_TOLERANCEv"] = (lambda: self.path[2] / self.unit(), (D,))
        for i, axis in enumerate("XYZABCUVW"):
            functions[f"_Z23GET_EXTERNAL_POSITION_{axis}v"] = (partial(self.position, i), (D,))
            functions[f"_Z32GET_EXTERNAL_TOOL_LENGTH_{axis}OFFSETv"] = (partial(self.tool_length, i), (D,))
        before = self.hooks.turn("librs274", functions)
        self.python_before, self.read_before = before[PYTHON], before["fgets"]
        self.unit_before, self.open_before = before["_Z16USE_LENGTH_UNITS11CANON_UNITS"], before["fopen64"]
        made = {"_ZN6InterpC1Ev": (self.constructed, (None, P))}
        self.construct_before = self.hooks.turn(module, made)["_ZN6InterpC1Ev"]

    def constructed(self, this: int) -> None:
        self.construct_before(this)
        self.interpreter = this

    # --- writing ---
    def where(self) -> None:
        """Set line and file to those of the block being executed."""
        if self.interpreter:
            self.move_to(self.sequence(self.interpreter))

    def move_to(self, line: int) -> None:
        self.line = line if self.begun == 2 else 0
        if self.alone:
            return
        self.name(self.interpreter, self.buffer, 512)
        name = self.buffer.value
        if name != self.file:
            self.file = name
            own = not name or os.path.samefile(name, self.program)  # noqa: PTH121
            self.extra("file", "" if own else name.decode("utf-8", "replace"))

    def reached(self) -> tuple[int, bool]:
        """Return the number of the line read last, and whether it belongs to the program's own file."""
        if not self.interpreter:
            return 0, True
        if not self.alone:
            self.name(self.interpreter, self.buffer, 512)
        own = self.alone or not self.buffer.value or os.path.realpath(self.buffer.value) == self.program
        return self.sequence(self.interpreter), own

    def tell(self, kind: str, *numbers: float) -> None:
        self.where()
        self.act(moved=kind == "tap")
        self.record(kind, *numbers)

    def act(self, *, moved: bool) -> None:
        """Count a move, a dwell or the like; only motion of an axis shows progress of a loop."""
        if (reason := self.reading.count_call(moved=moved)) is None:
            return
        # a line runs to its end regardless of the return values, possibly endlessly: only ending the process stops it
        self.where()
        self.refuse(self.line, reason)
        self.flush()
        os._exit(0)

    def refuse(self, line: int, reason: str) -> None:
        self.line = line
        if self.reached()[1]:
            self.extra("file", "")
        self.extra("error", reason)

    def record(self, kind: str, *numbers: float) -> None:
        self.records.append(RECORD.pack(CODES[kind], len(numbers), self.line, *numbers, *(0.0,) * (10 - len(numbers))))
        if len(self.records) >= BLOCK:
            self.flush()

    def text(self, kind: str, text: str) -> None:
        self.where()
        self.extra(kind, re.sub("[^ -~]", "?", text))

    def extra(self, kind: str, what: Any) -> None:
        """Record non-numeric data, such as a text or the points of a curve."""
        self.more.append(what)
        self.record(kind, len(self.more) - 1)

    def flush(self) -> None:
        more = json.dumps(self.more).encode()
        self.out.write(struct.pack("<II", len(self.records), len(more)))
        self.out.writelines(self.records)
        self.out.write(more)
        self.out.flush()
        self.flushed += len(self.records)
        self.records.clear()
        self.more.clear()

    def length(self, value: float) -> float:
        return value * self.unit()

    def unit(self) -> float:
        return 1.0 if self.metric else MM

    # --- position: program = unrotated(machine - origin - tool) - G92 ---
    def turned(self, values: tuple[float, ...], angle: float) -> list[float]:
        c, s = math.cos(angle), math.sin(angle)
        return [values[0] * c - values[1] * s, values[0] * s + values[1] * c, *values[2:]]

    def shifted(self, name: str, values: tuple[float, ...]) -> None:
        """Apply an offset without moving the machine."""
        sums = [o + t for o, t in zip(self.offset["g5x"], self.offset["length"], strict=True)]
        machine = self.turned(tuple(p + g for p, g in zip(self.place, self.offset["g92"], strict=True)), self.angle)
        machine = [m + f for m, f in zip(machine, sums, strict=True)]
        if name == "rotation":
            self.angle = math.radians(values[0])
        else:
            self.offset[name] = values
        sums = [o + t for o, t in zip(self.offset["g5x"], self.offset["length"], strict=True)]
        back = self.turned(tuple(m - f for m, f in zip(machine, sums, strict=True)), -self.angle)
        self.place = tuple(p - g for p, g in zip(back, self.offset["g92"], strict=True))

    def position(self, axis: int) -> float:
        return self.place[axis] * (MM if self.metric and not 3 <= axis < 6 else 1.0)

    def tool_length(self, axis: int) -> float:
        return self.offset["length"][axis] * (MM if self.metric and not 3 <= axis < 6 else 1.0)

    # --- calls that the module ignores ---
    def united(self, unit: int) -> None:
        self.unit_before(unit)
        self.metric = unit == 2
        self.tell("unit", 1.0 if self.metric else MM)

    def synchronised(self, spindle: int, pitch: float, velocity: bool) -> None:
        self.tell("sync", spindle, self.length(pitch), velocity)

    def change_tool_number(self, number: int) -> None:
        self.spindle = number
        self.tell("toolnumber", number)

    def tool_stored(self, place: int, number: int, pose: Any, front: float, back: float, size: float, to: int) -> None:
        """Store a tool (G10 L1, L10, L11) from which M6 and G43 read it [mm]."""
        if 0 < number <= len(self.tools):
            self.tools[number - 1] = (number, pose.values[2], size)
        self.tell("tooltable")

    def opened(self, name: bytes, mode: bytes) -> int:
        """Record the name of a file that the interpreter opens, including the program itself."""
        self.reading.check_file(name, write=not mode.startswith(b"r"))
        result: int = self.open_before(name, mode)
        if result and mode.startswith(b"r"):
            path = os.path.realpath(name)
            self.files[path] = None
            self.alone &= path == self.program or self.begun < 2
        return result

    def line_read(self, buffer: int, size: int, stream: int) -> int | None:
        self.reading.count_line()
        result: int | None = self.read_before(buffer, size, stream)
        return result

    def python(self, this: int, code: bytes, result: int, as_file: bool) -> int:
        """Run Python code of the interpreter itself, and refuse that of a program."""
        if code == b"from interpreter import this":
            done: int = self.python_before(this, code, result, as_file)
            return done
        self.where()
        raise RefusedError(self.line, "it contains Python code (py, ...), which is not run here; remove it")

    def commented(self, text: bytes) -> None:
        self.comment(text.decode("latin-1"))

    def messaged(self, text: bytes) -> None:
        self.text("message", text.decode("latin-1"))

    def tapped(self, line: int, x: float, y: float, z: float, scale: float) -> None:
        self.tell("tap", self.length(x), self.length(y), self.length(z), scale)

    def waited(self, index: int, *more: float) -> int:
        self.tell("wait", index)
        return 0

    def pathed(self, mode: int, tolerance: float) -> None:
        self.path = (mode, self.length(tolerance), self.path[2])
        self.tell("path", mode, self.length(tolerance))

    def naive(self, tolerance: float) -> None:
        self.path = (*self.path[:2], self.length(tolerance))
        self.tell("naive", self.length(tolerance))

    def curved(self, line: int, vector: int, order: int) -> None:
        """Record a spline; the argument is a std::vector of (x, y, weight)."""
        first, last = (ctypes.c_size_t.from_address(vector + 8 * i).value for i in (0, 1))
        numbers = (D * ((last - first) // 8)).from_address(first)
        points = [n if i % 3 == 2 else self.length(n) for i, n in enumerate(numbers)]
        self.place = (points[-3] / MM, points[-2] / MM, *self.place[2:])
        self.where()
        self.act(moved=True)
        self.extra("curve", [order, *points])

    # --- calls reported by the module ---
    def next_line(self, state: Any) -> None:
        if self.alone:
            self.line = state.sequence_number if self.begun == 2 else 0
        elif self.interpreter:
            self.move_to(state.sequence_number)

    straight_traverse, straight_feed, straight_probe = (straight(CODES[kind]) for kind in ("rapid", "feed", "probe"))

    def arc_feed(
        self, end1: float, end2: float, centre1: float, centre2: float, turns: int, end3: float, *more: float
    ) -> None:
        at = {1: (end1, end2, end3), 2: (end3, end1, end2), 3: (end2, end3, end1)}[self.plane]
        plane = {1: 17, 2: 19, 3: 18}[self.plane]
        self.place = (*at, *more)
        centre = (centre1 * MM, centre2 * MM, turns, plane, *(0.0,) * 6)
        self.act(moved=True)
        self.records.append(RECORD.pack(CENTRE, 4, self.line, *centre))
        self.records.append(RECORD.pack(ARC, 9, self.line, *self.place, 0.0))
        if len(self.records) >= BLOCK:
            self.flush()

    def offsets(self, kind: str, first: tuple[int, ...], values: tuple[float, ...]) -> None:
        self.where()
        self.shifted(kind, values)
        self.record(kind, *first, *(v if 3 <= i < 6 else v * MM for i, v in enumerate(values)))
        if kind == "length" and self.begun == 1:
            self.begun = 2

    def set_g5x_offset(self, index: int, *values: float) -> None:
        self.offsets("g5x", (index,), values)

    def set_g92_offset(self, *values: float) -> None:
        self.offsets("g92", (), values)

    def tool_offset(self, *values: float) -> None:
        self.offsets("length", (), values)

    def set_xy_rotation(self, angle: float) -> None:
        self.shifted("rotation", (angle,))
        self.tell("rotation", angle)

    def set_plane(self, plane: int) -> None:
        self.plane = plane
        self.tell("plane", {1: 17, 2: 19, 3: 18}[plane])

    def set_feed_rate(self, feed: float) -> None:
        # the module divides by 25.4 in G21 but not in G20; a feed of rotary axes alone is not a length
        self.feed = feed * MM
        self.tell("feedrate", feed * MM, feed * (MM if self.metric else 1.0))

    def dwell(self, seconds: float) -> None:
        self.tell("dwell", seconds)

    def change_tool(self, number: int) -> None:
        self.spindle = number
        self.tell("change", number)

    def user_defined_function(self, number: int, p: float, q: float) -> None:
        self.tell("user", 100 + number, p, q)

    def comment(self, text: str) -> None:
        if text == "begin" and not self.begun:
            self.begun = 1
        else:
            self.text("comment", text)

    def message(self, text: str) -> None:
        """Do nothing; the call is redirected to `messaged`."""

    def set_traverse_rate(self, rate: float) -> None:
        """Do nothing; no word of a program causes this call."""

    # --- queries of the module ---
    def check_abort(self) -> bool:
        """Return whether to abort the program; called about once per second."""
        reason = self.reading.check_output(self.flushed + len(self.records))
        if reason and not self.hooks.failure:
            self.where()
            self.hooks.failure = RefusedError(self.line, reason)
        return self.hooks.failure is not None

    def get_tool(self, index: int) -> tuple[float, ...]:
        """Return the tool at a table index: number, offsets (X to W), diameter, angles, orientation [mm]."""
        index = index or self.spindle  # index 0 is the spindle
        number, length, diameter = self.tools[index - 1] if 0 < index <= len(self.tools) else (0, 0.0, 0.0)
        return (number, 0.0, 0.0, length, *(0.0,) * 6, diameter, 0.0, 0.0, 0)

    def get_external_angular_units(self) -> float:
        return 1.0

    def get_external_length_units(self) -> float:
        return 1.0  # machine units per mm

    def get_axis_mask(self) -> int:
        return 0x1FF

    def get_block_delete(self) -> bool:
        return self.delete
