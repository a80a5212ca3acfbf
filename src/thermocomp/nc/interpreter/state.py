"""State of a controller while it runs a program."""

import math
from dataclasses import replace
from typing import Final

from thermocomp.nc.interpreter import startup
from thermocomp.nc.interpreter.arcs import length
from thermocomp.nc.interpreter.block import Arc, Known, Modal, Move, Point, Setup
from thermocomp.nc.interpreter.codes import CYCLES, ROTARY
from thermocomp.nc.interpreter.offsets import Offsets, combine_known
from thermocomp.nc.interpreter.words import BlockWords

MM: Final = 25.4  # per inch
_TRUE: Known = (True, True, True)


class InterpreterState:
    """Position of the tool, and state set by words and codes."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.fanuc = setup.controller == "fanuc"
        self.modal = startup.modal(setup)
        self._variants: dict[str, Modal] = {}
        self.unit_told = setup.inch is not None
        self.scale = MM if setup.inch else 1.0
        self.offsets = Offsets(setup)
        self.place: Point = self.offsets.program((0.0, 0.0, 0.0))
        self.machine: Point = (0.0, 0.0, 0.0)
        self.known: Known = (False, False, False)
        self.rotary: dict[str, float] = dict.fromkeys(ROTARY, 0.0)
        self.rezeroed: set[str] = set()  # rotary axes whose zero has been changed
        self.turned: dict[str, float] = {}
        self.feed = 0.0
        self.feed_word = 0.0
        self.spindle: float | None = setup.speed or None
        self.turning = 0
        self.selected = -1
        self.tool = -1
        self.lathe: str | None = ""  # Fanuc: a T word that may be for a lathe; None: an M6 has occurred
        self.under = ""  # Fanuc: motion that G80 restores
        self.turned_anew = ""  # Fanuc: G68 or G69, while X and Y have not been named since
        self.lengths: dict[int, float] = {}  # set by the program
        self.doubtful: dict[int, float] = dict(setup.tools)
        self.shifted_by = ""
        self.length_number: int | None = None
        self.untold_tool: int | None = None
        self.length_inch: bool | None = None
        self.sticky: dict[str, float] = {}
        self.last_dwell = 0.0
        self.level: float | None = None
        self.level_known = False
        self.keeps_levels = False  # Fanuc: G91 within a cycle that began in G90
        self.level_frame = (17, False, False)

        self.placed()

    @property
    def speed(self) -> float:
        """Spindle speed, negative in M4 [1/min]."""
        return self.turning * (self.spindle or 0.0)

    def changed(self, **fields: object) -> None:
        """Set fields of the modal state to new values."""
        modal = replace(self.modal, **fields)  # type: ignore[arg-type]
        if modal != self.modal:
            self.modal = modal
            self._variants = {modal.motion: modal}

    def moves_by(self, motion: str) -> None:
        """Put a motion code in force; modal states of earlier motions are reused."""
        if motion == self.modal.motion:
            return
        if motion in CYCLES and self.modal.motion not in CYCLES:
            self.under = self.modal.motion
        self._variants[self.modal.motion] = self.modal
        known = self._variants.get(motion)
        if known is None:
            known = self._variants[motion] = replace(self.modal, motion=motion)
        self.modal = known

    def placed(self) -> None:
        """Copy the state of the offsets to the modal state."""
        offsets = self.offsets
        self.changed(
            system=offsets.system,
            system_told=offsets.named,
            rotation=offsets.rotation,
            rotation_told=self.fanuc or offsets.rotation_told,
            origin_told=offsets.origin_told,
            untold_tool=self.untold_tool,
        )

    def axis_values(self, words: BlockWords) -> dict[int, float]:
        """Return the values of the words X, Y and Z of a line, by axis [mm]; X as a radius."""
        values, scale = words.values, self.scale
        found = {i: values[letter] * scale for i, letter in enumerate("XYZ") if letter in values}
        if self.modal.diameter and 0 in found:
            found[0] /= 2.0
        return found

    def goal(self, words: BlockWords) -> tuple[Point, Known]:
        """Return the target of the axis words in program coordinates [mm], and which coordinates are known."""
        values, scale, modal = words.values, self.scale, self.modal
        x, y, z = self.place
        if modal.absolute:
            a, b, c = self.known
            if "X" in values:
                x = values["X"] * scale
                a = True
                if modal.diameter:
                    x /= 2.0
            if "Y" in values:
                y = values["Y"] * scale
                b = True
            if "Z" in values:
                z = values["Z"] * scale
                c = True
            return (x, y, z), (a, b, c) if a is not b or b is not c or not a else _TRUE
        step = values.get("X", 0.0) * scale
        x += step / 2.0 if modal.diameter else step
        y += values.get("Y", 0.0) * scale
        z += values.get("Z", 0.0) * scale
        return (x, y, z), self.known

    def turned_to(self) -> None:
        """Record which rotary axes are not at 0 [deg]; nan: their zero has been changed."""
        at = self.rotary | dict.fromkeys(self.rezeroed, math.nan)
        self.turned = {letter: angle for letter, angle in at.items() if angle % 360.0}

    def turn(self, words: BlockWords) -> float:
        """Move the rotary axes; return their travel [deg]."""
        way = 0.0
        for letter in ROTARY & words.values.keys():
            value = words.values[letter]
            step = value - self.rotary[letter] if self.modal.absolute else value
            self.rotary[letter] += step
            way = math.hypot(way, step)
        if way:
            self.turned_to()
        return way

    def reach(self, place: Point, known: Known) -> None:
        """Set the tool position, in program coordinates, and which of its axes are known."""
        self.place, self.known = place, known
        self.machine = self.offsets.machine(place)

    def renamed(self, still: Known) -> None:
        """Keep the tool position under new offsets; known coordinates remain known where `still` is True."""
        self.place = self.offsets.program(self.machine)
        self.known = combine_known(self.known, still)

    def cut(self, words: BlockWords, start: Point, end: Point, arc: Arc | None = None, rotary: float = 0.0) -> Move:
        """Return a move at feed rate.

        Parameters
        ----------
        start, end : tuple of float
            Machine coordinates [mm].
        rotary : float
            Travel of the rotary axes [deg].
        """
        mode, feed = self.modal.feed_mode, self.feed
        if mode == 93:
            if not words.values.get("F"):
                raise words.error("G93 needs F on every feed move; add it, or write G94")
            return Move(rapid=False, start=start, end=end, arc=arc, feed=0.0, seconds=60.0 / feed, rotary=rotary)
        if not feed:
            raise words.error("a feed move, but no F is in force (in LinuxCNC, G93, G94 and G95 clear it); write F")
        if rotary and start == end and arc is None:
            feed = self.feed_word
        if mode == 94:
            return Move(rapid=False, start=start, end=end, arc=arc, feed=feed, seconds=None, rotary=rotary)
        return self.per_turn(words, start, end, feed, arc, rotary)

    def per_turn(
        self, words: BlockWords, start: Point, end: Point, pitch: float, arc: Arc | None = None, rotary: float = 0.0
    ) -> Move:
        """Return a move with feed per revolution of the spindle.

        Parameters
        ----------
        start, end : tuple of float
            Machine coordinates [mm].
        pitch : float
            Travel per revolution [mm], or degrees.
        rotary : float
            Travel of the rotary axes [deg].
        """
        feed = pitch * abs(self.speed)
        if not feed:
            raise words.error("a feed per turn while the spindle is stopped; start it first, with S and M3")
        move = Move(rapid=False, start=start, end=end, arc=arc, feed=feed, rotary=rotary)
        move.seconds = (length(move) or rotary) / feed * 60.0
        return move
