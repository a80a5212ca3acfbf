"""Interpretation of a program, line by line: modal state and resulting moves, as in the controller.

The order of execution within a line, the tolerances and the moves of cycles follow LinuxCNC; the tests compare
every move with its interpreter. Programs that cannot be interpreted with certainty are refused with line and reason.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

from thermocomp.nc.interpreter import fanuc, modal, motion, offsetcodes
from thermocomp.nc.interpreter.block import Block, Setup, triple
from thermocomp.nc.interpreter.codes import CYCLES, STOPS, TAKES_AXES
from thermocomp.nc.interpreter.state import InterpreterState
from thermocomp.nc.interpreter.words import BlockWords, Reader
from thermocomp.nc.parser.expressions import Parameters
from thermocomp.nc.parser.line import Line

_AXIS_LETTERS: Final = frozenset("XYZABC")
_PLAIN_LETTERS: Final = frozenset("XYZF")
_PROBES: Final = frozenset({"G31", "G38.2", "G38.3", "G38.4", "G38.5"})
_THREADS: Final = frozenset({"G33", "G33.1"})
_STATED_ANEW: Final = frozenset({"", "G0", "G1", "G2", "G3"})
_CURVES: Final = frozenset({"G5", "G5.1"})


def follow_program(lines: Iterable[Line], setup: Setup) -> Iterator[Block]:
    """Yield the effect of each line of a program on the machine."""
    step = Follower(setup).step
    for line in lines:
        yield step(line)


class Follower:
    """Model of a controller that executes a program line by line."""

    def __init__(self, setup: Setup) -> None:
        self.state = InterpreterState(setup)
        self._setup = setup
        self._parameters = Parameters(setup.controller)
        self._reader = Reader(setup, self._parameters)
        self._began = False
        self._demarcated = False
        self._ended = False
        self._if_skipped: str | None = None  # motion in force if the optional lines are not run

    def step(self, line: Line) -> Block:
        """Execute one line and return its effect."""
        if self._ended:
            return self._idle(line)
        if line.demarcation:
            return self._percent(line)
        if not self._began:  # text before the first % of a Fanuc program is a leader
            acts = line.words or line.assignments or line.flow if self.state.fanuc else line.text.strip()
            self._began = bool(acts)
        if line.optional and self._setup.skip_optional:
            return self._idle(line)
        if line.error:
            raise line.fault(line.error)
        if line.flow:
            remedy = "writes them as plain lines" if self.state.fanuc else "lets the interpreter unroll them"
            raise line.fault(f"{line.flow}: loops, branches and subprograms are not supported; --expand {remedy}")
        if not line.words and not line.assignments:
            return self._idle(line)
        words = self._reader.read(line)
        if line.optional:
            return self._optional(words)
        if self._if_skipped is not None:
            self._check_motion(words, self._if_skipped)
        return self._run(words)

    def _idle(self, line: Line) -> Block:
        state, place = self.state, self.state.place
        speed = 0.0 if self._ended else state.speed
        return Block(line, state.modal, start=place, end=place, known=state.known, feed=state.feed, speed=speed)

    def _percent(self, line: Line) -> Block:
        """Begin or end the program at ``%``."""
        if self._began:
            if not self._demarcated and not self.state.fanuc:
                raise line.fault("'%' in a program that does not begin with it; remove it")
            block = self._idle(line)
            block.ends = self._ended = True
            return block
        self._began = self._demarcated = True
        return self._idle(line)

    def _optional(self, words: BlockWords) -> Block:
        """Execute a line that the operator may skip: refuse it if later lines depend on it."""
        before, motion = self._summary(), self.state.modal.motion
        block = self._run(words)
        after = self._summary()
        if self.state.modal.motion != motion and self._if_skipped is None:
            self._if_skipped = motion
        changed = [what for what, was in before.items() if after[what] != was]
        if block.ends:
            changed.append("the end of the program")
        if block.kind in ("cycle", "set"):
            changed.append(f"the state of {' '.join(block.codes) or 'the cycle'}")
        if block.moves and not block.modal.absolute and block.kind != "home":
            changed.append("the position of all later G91 moves")
        if changed:
            raise words.error(
                f"an optional line (/) that changes {changed[0]}: the lines after it depend on whether the operator "
                "skips it; decide with --block-delete"
            )
        if block.moves:
            block.known = self.state.known = triple(
                k and letter not in block.values and a == b
                for k, letter, a, b in zip(block.known, "XYZ", block.start, block.end, strict=True)
            )
        return block

    def _check_motion(self, words: BlockWords, otherwise: str) -> None:
        """Refuse a line whose motion code comes from an optional line."""
        told, force = words.groups.get("motion"), self.state.modal.motion
        if told is None and force != otherwise and self._motion(words):
            raise words.error(
                f"the motion code in force is {force}, set by an optional line (/), or {otherwise or 'none'} if that "
                "line is skipped; write the motion code on this line, or set --block-delete"
            )
        if told is not None or force == otherwise:
            self._if_skipped = None

    def _summary(self) -> dict[str, object]:
        state = self.state
        # lines that need a motion code or a feed after optional lines must state the code; the feed only affects time
        plain = state.modal.motion in _STATED_ANEW and not state.fanuc
        return {
            "modal codes": replace(state.modal, motion="") if plain else state.modal,
            "offsets": state.offsets.state(),
            "tool lengths": (dict(state.lengths), dict(state.doubtful)),
            "the feed": None if plain else (state.feed, state.feed_word),
            "the spindle's speed": (state.spindle, state.turning),
            "the tool": (state.tool, state.selected),
            "the cycle": (dict(state.sticky), state.level),
        }

    def _run(self, words: BlockWords) -> Block:
        state, values, groups = self.state, words.values, words.groups
        before = state.modal
        code = self._motion(words)
        if state.fanuc:
            fanuc.check_codes(state, words, code)
        if values.keys() - _PLAIN_LETTERS:
            self._reader.check_letters(words, code)
        block = Block(words.line, before, codes=words.codes, words=words.words, values=values, start=state.place)
        if groups and not (len(groups) == 1 and "motion" in groups):
            modal.apply_modal_codes(state, words, block)
        else:
            modal.check_units(state, words)
            modal.speeds(state, words, before.inch)
        once = groups.get("once")
        if once is not None:
            self._once(words, block, once)
        if state.turned_anew:
            fanuc.check_place(state, words, code)
        if code:
            self._move(words, block, code)
        self._after(groups, block, code, before.motion)
        if state.lathe and not all(move.rapid for move in block.moves):
            raise modal.lathe(words, f"{state.lathe} on an earlier line, and no M6")
        stop = groups.get("stop")
        if stop is not None:
            block.ends = self._ended = stop not in STOPS
        if stop in STOPS:  # the operator may move the axes
            block.stops = True
            state.known, state.level_known = (False, False, False), False
        block.end = state.place
        block.known = state.known
        block.turned = state.turned
        block.feed = state.feed
        block.speed = block.speed or state.speed
        return block

    def _after(self, groups: dict[str, str], block: Block, code: str, before: str) -> None:
        """Put in force the motion code that applies after the line; `before` was in force before it."""
        state = self.state
        block.modal = state.modal
        if groups.get("motion") == "G80":
            state.sticky = {}
            state.level = None
            if not state.fanuc:
                state.moves_by("")
            elif state.modal.motion in CYCLES:  # a separate modal group in Fanuc controls
                state.moves_by(state.under)
            block.modal = state.modal
        elif code in _CURVES:
            state.moves_by("")
        elif code == "G31":  # non-modal
            state.moves_by(before)

    def _motion(self, words: BlockWords) -> str:
        """Return the motion code that this line runs; empty if there is no move."""
        groups, values = words.groups, words.values
        told = groups.get("motion")
        once = groups.get("once")
        turns = groups.get("rotation") == "G68"
        smoothed = "high speed" in groups and not _AXIS_LETTERS.isdisjoint(values)
        if smoothed and (told or any(values.get(letter) for letter in _AXIS_LETTERS)):  # zeros select the axes
            raise words.error(
                "axis words and a code that smooths the path are on one line; put the code on a separate line"
            )
        if once is None and not smoothed and not turns and "tool length" not in groups:
            if told == "G80":
                return "" if _AXIS_LETTERS.isdisjoint(values) else fanuc.motion_beside_g80(self.state, words)
            if told is not None:
                return told
        takes = smoothed or turns or once in TAKES_AXES or groups.get("tool length") == "G43.1"
        if once in ("G4", "G92.1") and self.state.fanuc:
            takes = True
        if takes:
            self._beside(words, told, "G68" if turns else once or "G43.1")
            return ""
        if told is not None and told != "G80":
            return told
        if _AXIS_LETTERS.isdisjoint(values) and not self._turns(words):
            return ""
        force = self.state.modal.motion
        if not force or told == "G80":
            raise words.error("axis words, but no motion code is in force; write G0, G1 ... before them")
        return force

    def _beside(self, words: BlockWords, told: str | None, other: str) -> None:
        """Process a motion code together with another code that uses the axis words."""
        if told in ("G0", "G1") and self.state.fanuc and other in ("G28", "G30", "G68"):
            fanuc.put_in_force(self.state, told)
        elif told not in (None, "G80"):
            raise words.error(f"{told} with {other}: both would use the axis words; put them on separate lines")

    def _turns(self, words: BlockWords) -> bool:
        """Return whether the line is an arc without axis words: a full circle."""
        force = self.state.modal.motion
        return force in ("G2", "G3") and not words.values.keys().isdisjoint("IJK") and "once" not in words.groups

    def _once(self, words: BlockWords, block: Block, once: str) -> None:
        """Execute a non-modal code, except G53, which belongs to the motion."""
        state, values = self.state, words.values
        if once == "G4":
            if "P" in values:
                if state.fanuc:
                    fanuc.check_dwell(words)
                seconds = motion.dwell_seconds(state, values["P"])
            elif state.fanuc and "X" in values:
                seconds = fanuc.dwell_of_x(state, words)
            else:
                raise words.error("G4 needs P, the dwell time")
            if seconds < 0.0:
                raise words.error("G4 has a negative time; P must be 0 or more")
            block.pause += seconds
        elif once in ("G28", "G30"):
            motion.home(state, words, block)
        elif once == "G10":
            offsetcodes.g10(state, words, block)
        elif once != "G53":
            offsetcodes.local(state, words, block)

    def _move(self, words: BlockWords, block: Block, code: str) -> None:
        state = self.state
        again = state.modal.motion == code
        if not again:
            state.moves_by(code)
        if code not in CYCLES:
            if state.level is not None:
                state.level, state.sticky = None, {}
        elif _AXIS_LETTERS.isdisjoint(words.values):
            raise words.error(f"{code} without axis words; write the end position")
        if words.groups.get("once") == "G53":
            motion.in_machine(state, words, block)
        elif code in ("G0", "G1"):
            motion.straight(state, words, block)
        elif code in ("G2", "G3"):
            motion.arc(state, words, block)
        elif code in CYCLES:
            motion.cycle(state, words, block, again)
        elif _AXIS_LETTERS.isdisjoint(words.values):
            raise words.error(f"{code} without axis words; write the end position")
        elif code in _PROBES:
            motion.probe(state, words, block)
        elif code in _THREADS:
            motion.in_step(state, words, block)
        else:
            motion.curve(state, words, block)
