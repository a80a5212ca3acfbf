"""Plain program from two runs of the same program in two controllers without common stored data.

Data common to both runs come from the program: equal program coordinates become words in work coordinates, equal
machine coordinates become moves in machine coordinates (G53), end positions at the controller's home become G28 and
G30. Anything else depends on data stored in the controller, and is refused.
"""

from collections.abc import Callable, Iterator

from thermocomp.nc.linuxcnc.expansion.origins import DEPENDS, G10, STILL, OriginWriter, agree, format_number
from thermocomp.nc.linuxcnc.rs274 import AXES, PLANE_AXES, Canonical, Stored

CENTRES = {17: "IJ", 18: "KI", 19: "JK"}
#: lines for calls without and with numbers
PLAIN = {
    "m0": "M0", "m1": "M1", "m3": "M3", "m4": "M4", "m5": "M5", "change": "M6", "end": "M2",
    "mist": "M7", "flood": "M8", "mistoff": "M9", "floodoff": "M9",
    "feedoverride": "M50 P1", "nofeedoverride": "M50 P0", "speedoverride": "M51 P1", "nospeedoverride": "M51 P0",
    "adaptive": "M52 P1", "noadaptive": "M52 P0", "feedhold": "M53 P1", "nofeedhold": "M53 P0",
    "dwell": "G4 P{}", "select": "T{}", "toolnumber": "M61 Q{}", "plane": "G{}",
    "m62": "M62 P{}", "m63": "M63 P{}", "m64": "M64 P{}", "m65": "M65 P{}", "m67": "M67 E{} Q{}", "m68": "M68 E{} Q{}",
}  # fmt: skip
#: calls made by a controller at the end of a program
RESETS = {
    "m5", "mistoff", "floodoff", "feedoverride", "speedoverride", "adaptive", "noadaptive", "feedhold", "g5x", "g92",
    "plane", "feedmode", "speedmode", "path", "length",
}  # fmt: skip
REFUSED = {
    "probe": "it probes (G38): its end position is unknown before the run",
    "wait": "it waits for an input (M66)",
    "tooltable": "it writes the tool table (G10 L1, L10, L11)",
    "orient": "it orients the spindle (M19)",
}


class Writer(OriginWriter):
    """Converter from pairs of canonical calls to lines of a plain program.

    Parameters
    ----------
    first, second : Stored
        Values stored in the controllers of the two runs.
    source : callable
        Text of a line of the program, by its number.
    inch : bool or None
        Unit in force at the start; None: the program must specify it.
    user_codes : bool
        Keep M100 to M199, which run user-defined programs.

    Attributes
    ----------
    ended : bool
        M2 or M30 was written.
    """

    def __init__(
        self, first: Stored, second: Stored, source: Callable[[int], str], inch: bool | None, user_codes: bool
    ) -> None:
        super().__init__(first, second, 25.4 if inch else 1.0)
        self.source = source
        self.stated = inch is not None
        self.user_codes = user_codes
        self.feed: float | None = 0.0
        self.written_feed: float | None = None
        self.pitch = 0.0  # pitch of a thread [mm]
        self.pieces = 0  # number of sections of this thread
        self.arcs = self.ended = False
        self.held: tuple[Canonical, Canonical] | None = None  # pair held back until the next pair is known
        self.waiting: list[tuple[str, str, int]] = []  # (kind, text, line) held back in case the program ends

    def write(self, first: Canonical, second: Canonical) -> Iterator[tuple[str, int]]:
        """Yield the lines for a pair of calls, each with the number of its line in the program."""
        before, self.held = self.held, None
        line = self.line if first.file or first.line < 1 else first.line
        if first.kind != second.kind or first.line != second.line:
            self.line = line if first.file or second.file else min(line, second.line)
            raise self.refuse(
                f"the path of execution {DEPENDS}: a branch or a loop uses a parameter, an origin or a position that "
                "the program has not set; set it in the program first",
                first.file,
            )
        merged = False
        if before is not None:
            texts, merged = self.release(*before, first, second)
            for kind, text in texts:
                yield from self.put(kind, text, self.line)
        self.line = line
        if not merged:
            if first.kind in {"g5x", "path", "speedmode", "pallet"} or (first.kind == "comment" and first.text == G10):
                self.held = first, second
                return
            for kind, text in self.single(first, second):
                yield from self.put(kind, text, self.line)

    def put(self, kind: str, text: str, line: int) -> Iterator[tuple[str, int]]:
        """Hold back actions that the end of the program performs anyway; write others."""
        if kind == "end":
            self.ended = True
            self.waiting = [w for w in self.waiting if w[2] != line]
        if kind in RESETS:
            if text and (not self.waiting or self.waiting[-1][1] != text):  # M9 makes two calls
                self.waiting.append((kind, text, line))
            return
        yield from self.flush()
        yield text, line

    def flush(self) -> Iterator[tuple[str, int]]:
        """Yield the lines held back."""
        yield from ((text, line) for _, text, line in self.waiting)
        self.waiting.clear()

    def release(  # noqa: PLR0911
        self, held: Canonical, other: Canonical, a: Canonical, b: Canonical
    ) -> tuple[list[tuple[str, str]], bool]:
        """Return the lines (kind, text) for a pair of calls held back, and whether the next pair is merged into it."""
        kind, close = held.kind, a.line == held.line
        if kind == "g5x":
            if a.kind == "g92" and close and self.unshifted(a, b):
                self.held = held, other  # selecting a system also reports G92 again
                return [], True
            merged = a.kind == "rotation" and close
            angles = (a.values[0], b.values[0]) if merged else None
            source = "" if held.file else self.source(held.line)
            return self.chosen_system(held, other, angles, source), merged
        if kind == "path":
            merged = a.kind == "naive" and close
            if held.values != other.values or (merged and a.values != b.values):
                raise self.refuse(
                    "a canned cycle restores the path mode, which the program has not set; write G61, G61.1 or G64"
                )
            return [(kind, self.path(held.values, a.values[0] if merged else 0.0))], merged
        if kind == "speedmode":
            merged = a.kind == "speed" and close
            return [(kind, self.speedmode(held, a.values[1] if merged else None))], merged
        if kind == "pallet":
            merged = a.kind in {"m0", "end"}
            return [(a.kind if merged else kind, "M30" if a.kind == "end" else "M60")], merged
        if a.kind == "g5x" and close:
            return [], False
        return [("g10", self.plain_g10("" if held.file else self.source(held.line)))], False

    def unshifted(self, a: Canonical, b: Canonical) -> bool:
        """Return whether the G92 offset is unchanged in both runs."""
        old = (*self.sides[0].frame.shift, *self.sides[1].frame.shift)
        return all(agree(x, y) for x, y in zip((*a.values, *b.values), old, strict=True))

    def single(self, a: Canonical, b: Canonical) -> Iterator[tuple[str, str]]:
        """Yield the lines for a pair of corresponding calls, each as (kind, text)."""
        kind = a.kind
        if kind in REFUSED or (kind == "user" and not self.user_codes):
            what = REFUSED.get(kind) or f"M{a.values[0]:.0f} is a user-defined code"
            raise self.refuse(what, a.file)
        if kind in {"rapid", "feed", "arc", "tap", "curve"}:
            if not self.stated:
                raise self.refuse("no unit is set before this move; write G20 or G21", a.file)
            yield from ((kind, text) for text in self.move(a, b))
        elif kind in {"g92", "length"}:
            old = self.sides[0].frame.shift, self.sides[1].frame.shift
            for side, call in zip(self.sides, (a, b), strict=True):
                side.take(kind, call.values)
            if kind == "length":
                yield kind, self.tool_length()
            else:
                yield kind, self.shift(old, "" if a.file else self.source(a.line))
        elif kind in {"comment", "message"}:
            if a.text != b.text:
                raise self.refuse(
                    "the values in this message depend on what is stored in the machine; set them in the program first",
                    a.file,
                )
            text = a.text.replace("(", "[").replace(")", "]")
            yield kind, f"(MSG,{text})" if kind == "message" else f"({text})"
        elif kind == "feedrate":
            self.feed = a.values[1] if agree(a.values[1], b.values[1]) else None
        elif not all(agree(x, y) for x, y in zip(a.values, b.values, strict=True)):
            raise self.refuse(
                f"{kind} {' '.join(map(format_number, a.values))} {DEPENDS}; set it in the program first", a.file
            )
        else:
            yield from self.state(a)

    def state(self, call: Canonical) -> Iterator[tuple[str, str]]:
        """Yield kind and text of a call with values that are the same in both runs."""
        kind, values = call.kind, call.values
        if kind == "unit":
            if self.feed is not None:
                self.feed *= self.words.unit / values[0]
            self.words.unit, self.stated, self.written_feed = values[0], True, None
            yield kind, "G21" if values[0] == 1.0 else "G20"
        elif kind == "feedmode":
            self.written_feed = None
            yield kind, "G95" if values[1] else "G94"
        elif kind == "speed":
            yield kind, f"S{format_number(values[1])}"
        elif kind == "sync":
            self.pitch, self.pieces = values[1], 0
        elif kind == "unsync":
            self.pitch = 0.0
        elif kind == "user":  # -1: word not present
            words = (f" {letter}{format_number(v)}" for letter, v in zip("PQ", values[1:], strict=True) if v != -1)
            yield kind, f"M{format_number(values[0])}{''.join(words)}"
        elif kind in PLAIN:
            yield kind, PLAIN[kind].format(*map(format_number, values))
        elif kind not in {"rotation", "naive"}:
            raise self.refuse(f"'{kind}' has no equivalent in plain codes", call.file)

    # --- moves ---
    def move(self, a: Canonical, b: Canonical) -> Iterator[str]:
        """Yield the lines of a move, and apply it to both runs."""
        first, second = self.sides
        if a.kind == "curve":
            yield self.curve(a, b)
            return
        if a.kind == "tap":
            yield self.tap(a, b)
            return
        pa, pb = a.program, b.program
        if a.kind == "rapid" and all(self.still(i, pa[i], pb[i]) for i in range(9)):
            return  # G28 moves via the current position
        known = [agree(x, y) for x, y in zip(pa, pb, strict=True)]
        if all(k or self.still(i, pa[i], pb[i]) for i, k in enumerate(known)):
            if a.arc and b.arc:
                yield from self.arc(a, b, known)
            elif words := [self.words.axis(i, pa[i]) for i in range(9) if known[i]]:
                yield f"{self.code(a)} {' '.join(words)}{self.feed_word(a)}"
            self.pieces += self.pitch != 0.0
        elif a.arc:
            raise self.refuse(f"the start or end of this arc {DEPENDS}; set it in the program first")
        else:
            yield from self.machine_move(a, b)
        first.move(pa)
        second.move(pb)

    def tap(self, a: Canonical, b: Canonical) -> str:
        """Return the line of a rigid tapping move, G33.1, which returns to its start."""
        words = ""
        for i, (first, second) in enumerate(zip(a.values[:3], b.values[:3], strict=True)):
            if agree(first, second):
                words += " " + self.words.axis(i, first)
            elif not self.still(i, first, second):
                raise self.refuse(f"the position of the tapped hole {DEPENDS}; set it in the program first")
        scale = "" if a.values[3] == 1 else f" I{format_number(a.values[3])}"
        self.pieces += 1
        return f"G33.1{words} K{self.words.length(self.pitch)}{scale}"

    def still(self, axis: int, first: float, second: float) -> bool:
        """Return whether a move leaves an axis at rest in both runs."""
        a, b = self.sides
        return abs(first - a.program[axis]) < STILL and abs(second - b.program[axis]) < STILL

    def code(self, call: Canonical) -> str:
        """Return the motion code of a linear move: G0, G1 or G33."""
        if call.kind == "rapid":
            return "G0"
        if self.pitch:
            if self.pieces:
                raise self.refuse(
                    "a thread of several sections (G76 with a taper at its end) has no equivalent in plain codes"
                )
            return f"G33 K{self.words.length(self.pitch)}"
        return "G1"

    def machine_move(self, a: Canonical, b: Canonical) -> Iterator[str]:
        """Yield the lines of a move in machine coordinates, or home."""
        ma, mb = a.machine, b.machine
        first, second = self.sides
        moved = [i for i in range(9) if abs(ma[i] - first.machine[i]) > STILL or abs(mb[i] - second.machine[i]) > STILL]
        if all(agree(ma[i], mb[i]) for i in moved) and not self.pitch:
            words = " ".join(self.words.axis(i, ma[i]) for i in moved)
            yield f"G53 {self.code(a)} {words}{self.feed_word(a)}"
            return
        for code, homes in (
            ("G28", (first.stored.home28, second.stored.home28)),
            ("G30", (first.stored.home30, second.stored.home30)),
        ):
            there = [agree(ma[i], homes[0][i]) and agree(mb[i], homes[1][i]) for i in range(9)]
            if a.kind == "rapid" and all(there[i] for i in moved):
                if all(there):
                    yield code
                elif all(agree(first.program[i], second.program[i]) for i in moved):
                    yield f"{code} {' '.join(self.words.axis(i, first.program[i]) for i in moved)}"
                else:  # via the current position, wherever that is
                    yield f"G91 {code} {' '.join(AXES[i] + '0' for i in moved)}"
                    yield "G90"
                return
        raise self.refuse(
            f"the end position in {', '.join(AXES[i] for i in moved)} {DEPENDS} (origins, tools, parameters, G98 or "
            "G99, its position at the start): set it in the program first"
        )

    def arc(self, a: Canonical, b: Canonical, known: list[bool]) -> Iterator[str]:
        """Yield the lines of an arc."""
        assert a.arc is not None
        assert b.arc is not None
        i, j, _ = PLANE_AXES[a.arc.plane]
        if self.pitch or a.arc.turns == 0 or a.arc[0] != b.arc[0] or a.arc.turns != b.arc.turns:
            raise self.refuse(f"the direction of this arc {DEPENDS}; set it in the program first")
        centre = ""
        for axis, letter in zip((i, j), CENTRES[a.arc.plane], strict=True):
            starts = [side.program[axis] for side in self.sides]
            if not (known[axis] and agree(*starts) and agree(a.arc.centre[axis], b.arc.centre[axis])):
                raise self.refuse(f"the start or end of this arc {DEPENDS}; set it in the program first")
            # relative to the start as written, so that rounding errors do not accumulate
            centre += f" {letter}{self.words.length(a.arc.centre[axis] - self.words.rounded(starts[0]))}"
        words = " ".join(self.words.axis(axis, a.program[axis]) for axis in range(9) if known[axis])
        turns = f" P{abs(a.arc.turns)}" if abs(a.arc.turns) > 1 else ""
        if not self.arcs:
            yield "G91.1"
            self.arcs = True
        yield f"{'G3' if a.arc.turns > 0 else 'G2'} {words}{centre}{turns}{self.feed_word(a)}"

    def curve(self, a: Canonical, b: Canonical) -> str:
        """Return G5 or G5.1, with offsets of the control points from start and end."""
        order, points = int(a.values[0]), [a.values[k : k + 3] for k in range(1, len(a.values), 3)]
        start = self.sides[0].program[:2], self.sides[1].program[:2]
        agreed = all(agree(x, y) for x, y in zip((*a.values, *start[0]), (*b.values, *start[1]), strict=True))
        if not agreed:
            raise self.refuse(f"the path of this curve {DEPENDS}; set it in the program first")
        if order not in {3, 4} or len(points) != order or any(p[2] != 1 for p in points):
            raise self.refuse("splines of G5.2 have no equivalent in plain codes")
        (x0, y0), end = map(self.words.rounded, start[0]), [self.words.rounded(v) for v in points[-1][:2]]
        words = [self.words.axis(0, end[0]), self.words.axis(1, end[1])]
        words += ["I" + self.words.length(points[1][0] - x0), "J" + self.words.length(points[1][1] - y0)]
        if order == 4:
            words += ["P" + self.words.length(points[2][0] - end[0]), "Q" + self.words.length(points[2][1] - end[1])]
        for side in self.sides:
            side.move((*points[-1][:2], *side.program[2:]))  # type: ignore[arg-type]
        return f"{'G5.1' if order == 3 else 'G5'} {' '.join(words)}{self.feed_word(a)}"

    def feed_word(self, call: Canonical) -> str:
        """Return the F word if the feed has changed, else an empty text."""
        if call.kind == "rapid" or self.pitch:
            return ""
        if self.feed is None:
            raise self.refuse(f"the feed {DEPENDS}; set it in the program first")
        if self.feed == self.written_feed:
            return ""
        self.written_feed = self.feed
        return f" F{format_number(self.feed)}"

    def path(self, values: tuple[float, ...], naive: float) -> str:
        """Return the code of the path control mode: G61, G61.1 or G64."""
        if values[0] != 3:
            return "G61" if values[0] == 2 else "G61.1"
        return f"G64 P{self.words.length(values[1])} Q{self.words.length(naive)}" if values[1] or naive else "G64"

    def speedmode(self, call: Canonical, speed: float | None) -> str:
        """Return the code of the spindle speed mode: G96 or G97."""
        limit = call.values[1]
        if limit and speed is None:
            raise self.refuse("G96 without S; write S")
        return (f"G96 D{format_number(limit)}" if limit else "G97") + (
            "" if speed is None else f" S{format_number(speed)}"
        )
