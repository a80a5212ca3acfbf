"""Correction by coordinates, as in the paper: the correction is added to the words of X, Y and Z (P-06).

Treatment of a block, by its kind:

- a line: every axis word gets the present correction of its axis; an axis without a word, but with a changed
  correction, gets a word;
- in G91 a word gets the change of the correction since the last move of its axis;
- an arc: the axes of its plane keep their correction, so that the radius is unchanged; the third axis is treated as in
  a line;
- a drilling cycle: depth and retract plane both get the correction of the drilling axis;
- G92 and G10 L20: the value gets the correction of its axis, so that the coordinates are preserved;
- G53, G28, G30: machine coordinates, without correction;
- during cutter radius compensation: the correction remains as it was when compensation was switched on.
"""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.arcs import length
from thermocomp.nc.interpreter.block import PLANES, Block, triple
from thermocomp.nc.interpreter.codes import CYCLES
from thermocomp.nc.rewrite.contact import CLEAR, Contact
from thermocomp.nc.rewrite.method import AXES, STILL, CorrectionMethod
from thermocomp.nc.rewrite.text import Frame, Vector, format_number, format_shifted, shift_words

#: motion codes of lines that can get additional words
PLAIN = ("G0", "G1")
#: allowed change in the duration of a cut: relative, and absolute [s]
SLOWER, LATER = 0.015, 0.004


@dataclass
class _Edit:
    """Amounts of the correction in the words of X, Y and Z after a line, and the changes of the line for this."""

    new: list[float]
    shifts: dict[str, float] = field(default_factory=dict)  #: of words on the line
    added: dict[str, float] = field(default_factory=dict)  #: words to be added


@dataclass
class Coordinates(CorrectionMethod):
    """Correction method that adds the correction to the words.

    Parameters
    ----------
    helix : bool
        An arc may get a word for its third axis.
    """

    helix: bool = True
    contact: Contact = field(init=False)
    #: correction of depth and retract plane of the cycle in force
    _cycle: float = field(default=0.0, init=False)
    #: initial level of a series of cycles [mm], if the axis has not been moved since, with its correction [um]
    _series: tuple[float, Vector] | None = field(default=None, init=False)
    #: axis and retract plane [mm] of the last cycle, while the tool may still be there
    _plane: tuple[int, float] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.contact = Contact(self.step, self.safe_z)

    def _revise(self, block: Block, demand: Vector) -> tuple[str, ...]:
        self.contact.begin(block)
        before = self.carried
        kind = block.kind
        if self.names_place(block):
            text = self._named_anew(block)
        elif kind in ("none", "set"):
            text = block.line.text
        elif kind == "machine":
            self.leave(block)
            text = block.line.text
        else:
            frame = self.frame(block)
            old = frame.words(self.carried)
            if kind in ("line", "arc", "curve"):
                text = self._path(block, frame, old, demand)
            elif kind == "cycle":
                text = self._drill(block, frame, old, demand)
            else:
                text = self._homewards(block, frame, old)
        if kind != "cycle" and (block.moves or block.modal.motion not in CYCLES):
            self._series = None
        if kind not in ("none", "set", "cycle") and self._plane and AXES[self._plane[0]] in block.words:
            self._plane = None
        self.contact.end(block, [a != b for a, b in zip(self.carried, before, strict=True)])
        return (text,)

    @property
    def splits(self) -> bool:
        """Whether splitting a cut can improve the correction: positions inside the cut must be representable."""
        return self.digits.mm >= 4

    def held_by(self, block: Block) -> str:
        """Return the reason why the correction cannot follow the drift in a block."""
        if block.modal.cutter:
            return "cutter radius compensation"
        if block.kind in ("arc", "curve", "cycle"):
            return {"arc": "arcs", "curve": "splines", "cycle": "the levels of a cycle"}[block.kind]
        return "the step in cuts" if block.modal.absolute else "G91"

    # -- kinds of blocks ---------------------------------------------------------------------------------------------

    def _path(self, block: Block, frame: Frame, old: Vector, demand: Vector) -> str:
        modal = block.modal
        named = self.named(block)
        goal = frame.words(demand)
        if goal != old or frame.turned:
            goal = frame.words(self._limited(block, frame, demand))
        holds = self._holds(block, frame)
        if len(holds) < 3 and goal != old and self._hurries(block, frame, goal, holds):
            holds = (0, 1, 2)
        edit = _Edit(list(old))
        new, shifts = edit.new, edit.shifts
        for i in named:
            letter = AXES[i]
            if modal.absolute:
                if i not in holds and not (block.line.optional and not self.fixed[i]):
                    new[i] = goal[i]
                shifts[letter] = new[i]
                self._placed(block, i, self.carried[i], moved=new[i] != old[i])
            elif i not in holds and not self.fixed[i] and not self.doubtful[i]:
                new[i] = goal[i]
                shifts[letter] = round(new[i] - old[i], frame.digits)
        if len(holds) < 3 and self._takes_words(block, named):
            self._add(block, frame, goal, holds, edit)
        if modal.arc_absolute and block.kind == "arc":
            for i, letter in enumerate("IJK"):
                if letter in block.words:
                    shifts[letter] = old[i] / 2 if modal.diameter and i == 0 else old[i]
        self._take(block, frame, old, new)
        return shift_words(block, shifts, edit.added, frame.digits)

    def _add(self, block: Block, frame: Frame, goal: Vector, holds: tuple[int, ...], edit: _Edit) -> None:
        """Add words for axes that have none, but whose correction has changed."""
        new = edit.new
        for i, letter in enumerate(AXES):
            if letter in block.words or i in holds or goal[i] == new[i] or self.fixed[i] or self.doubtful[i]:
                continue
            if not block.modal.absolute:
                edit.added[letter] = goal[i] - new[i]
            elif self.before[i] and block.known[i]:
                edit.added[letter] = block.end[i] * (frame.scale[i] * 1e3) + goal[i]
            else:
                continue
            new[i] = goal[i]

    def _drill(self, block: Block, frame: Frame, old: Vector, demand: Vector) -> str:
        if block.modal.motion == "G87":
            raise block.error("G87 has levels that cannot be shifted; use --method offset, or --expand")
        axis = PLANES[block.modal.plane][2]
        self._refuse_mixed_levels(block, axis)
        goal = frame.words(demand)
        edit = _Edit(list(old))
        new, shifts = edit.new, edit.shifts
        repeats = block.values.get("L", block.values.get("K", 1.0))
        for i in self.named(block):
            if i == axis:
                continue
            moves = abs(block.end[i] - block.start[i]) > STILL
            if block.modal.absolute:
                if moves or not self.before[i]:
                    new[i] = goal[i]
                shifts[AXES[i]] = new[i]
                self.fixed[i] = self.doubtful[i] = False
            elif moves and repeats == 1 and not self.fixed[i] and not self.doubtful[i]:
                new[i] = goal[i]
                shifts[AXES[i]] = round(new[i] - old[i], frame.digits)
        if block.line.optional and tuple(new) != old:
            raise block.error("an optional line that drills: give --block-delete off or on")
        if not block.moves:  # K0: the cycle is stored, and drills at later lines
            return self._store(block, axis, frame, old, goal[axis])
        self._take(block, frame, old, new)
        if block.modal.absolute:
            self._levels(block, axis, frame, goal[axis], edit)
        elif block.keeps_levels:
            self._drilled(block, axis, frame, self._cycle)
        return shift_words(block, shifts, edit.added, frame.digits)

    def _refuse_mixed_levels(self, block: Block, axis: int) -> None:
        """Raise `ProgramError` if corrected absolute levels would be reused as distances in G91."""
        if block.modal.absolute or block.keeps_levels:
            return
        if any(word not in block.words for word in (AXES[axis], "R")):
            if self._cycle:
                raise block.error(
                    f"G91 while {block.modal.motion} is in force, whose R and {AXES[axis]} are shifted levels: write "
                    "G80 before it, and the cycle with all its words; or use --expand",
                )
        else:
            self._cycle = 0.0

    def _store(self, block: Block, axis: int, frame: Frame, old: Vector, goal: float) -> str:
        carried, before = self.carried, (self.fixed[axis], self.doubtful[axis])
        edit = _Edit(list(old))
        if block.modal.absolute:
            self._levels(block, axis, frame, goal, edit)
            # the axes do not move, but may have words for their present position
            edit.shifts |= {AXES[i]: old[i] for i in self.named(block) if i != axis}
            self.carried, self.inner = carried, None
            self.fixed[axis], self.doubtful[axis] = before
        return shift_words(block, edit.shifts, edit.added, frame.digits)

    def _levels(self, block: Block, axis: int, frame: Frame, goal: float, edit: _Edit) -> None:
        """Shift depth and retract plane of a cycle, both or neither."""
        words = (AXES[axis], "R")
        if self._series is None:
            self._series = block.start[axis], self.carried
        plane = block.sticky["R"] / (frame.scale[axis] * 1e3)
        level, carried = self._series
        # if the axis has not been moved, the order of the levels must not change
        held = True
        if abs(block.start[axis] - plane) < CLEAR:
            goal = frame.words(self.carried)[axis]
        elif abs(level - plane) < CLEAR:
            goal = frame.words(carried)[axis]
        elif not self.before[axis] and self._plane and abs(plane - self._plane[1]) < CLEAR:
            goal = self._cycle
        else:
            held = False
        self._plane = axis, plane
        if block.modal.motion in ("G73", "G83"):
            wanted, goal = goal, _same_pecks(block, words[0], goal, frame.digits)
            if held and goal != wanted:
                raise block.error(
                    f"Q divides the distance from R to {words[0]} without remainder, so that rounding decides the "
                    "number of pecks; R cannot be shifted because the tool is at R: first write G80 and a rapid "
                    "above R, or use --expand",
                )
        if goal != self._cycle or all(word in block.words for word in words):
            edit.added |= {word: block.sticky[word] + goal for word in words if word not in block.words}
            self._cycle = goal
        edit.shifts |= {word: goal for word in words if word in block.words}
        self._drilled(block, axis, frame, goal)

    def _drilled(self, block: Block, axis: int, frame: Frame, goal: float) -> None:
        """Record the corrections in the holes of a cycle, whose levels have a given shift, and after them."""
        assert self._series is not None
        carried, plane = self._series[1], block.sticky["R"] / (frame.scale[axis] * 1e3)
        within = list(frame.words(self.carried))
        within[axis] = goal
        self.inner = frame.shift(triple(within))
        back = list(self.carried)
        at_r = abs(block.end[axis] - plane) < CLEAR
        back[axis], other = (self.inner[axis], carried[axis]) if at_r else (carried[axis], self.inner[axis])
        self.carried = triple(back)
        if at_r or not block.known[axis]:
            self.fixed[axis] = self.doubtful[axis] = False
        if not block.known[axis] and other != back[axis]:
            self.doubt(axis, other)

    def _homewards(self, block: Block, frame: Frame, old: Vector) -> str:
        shifts = {AXES[i]: old[i] for i in self.named(block)} if block.modal.absolute else {}
        self.leave(block)
        return shift_words(block, shifts, {}, frame.digits)

    def _named_anew(self, block: Block) -> str:
        for i in self.named(block):
            if self.doubtful[i]:
                raise block.error(
                    f"the position of {AXES[i]} before this line is unknown: a tool change or an optional line may "
                    "have moved the axis; position it on an earlier line, or give --block-delete off or on",
                )
        frame = self.frame(block)
        old = frame.words(self.carried)
        return shift_words(block, {AXES[i]: old[i] for i in self.named(block)}, {}, frame.digits)

    # -- allowed changes ---------------------------------------------------------------------------------------------

    def _placed(self, block: Block, axis: int, carried: float, *, moved: bool) -> None:
        """Record that an axis moves to a position in absolute coordinates, if the line is run."""
        self.fixed[axis] = False
        if not block.line.optional:
            self.doubtful[axis] = False
        elif moved:
            self.doubt(axis, carried)

    def _hurries(self, block: Block, frame: Frame, goal: Vector, holds: tuple[int, ...]) -> bool:
        """Return whether a change of the correction would change the duration of a cut beyond the allowed limits.

        Axes with uncertain positions are included if the line names them: perhaps they were not moved by hand.
        """
        if len(block.moves) != 1 or block.moves[0].rapid or not block.moves[0].feed:
            return False
        move = block.moves[0]
        moved = frame.shift(goal)
        gaps = [0.0 if i in holds else (moved[i] - self.carried[i]) * 1e-3 for i in range(3)]
        for i, letter in enumerate(AXES):
            if (self.fixed[i] or self.doubtful[i]) and not (block.modal.absolute and letter in block.words):
                gaps[i] = 0.0  # no other word
        way = length(move)
        if move.arc is None:
            longer = math.hypot(*(b - a + g for a, b, g in zip(move.start, move.end, gaps, strict=True)))
        else:
            across = PLANES[move.arc.plane][2]
            rise = move.end[across] - move.start[across]
            longer = math.sqrt(max(way * way - rise * rise, 0.0) + (rise + gaps[across]) ** 2)
        return abs(longer - way) > max(SLOWER * way, move.feed / 60.0 * LATER)

    def _holds(self, block: Block, frame: Frame) -> tuple[int, ...]:
        """Return the axes that must keep their correction in this block."""
        modal = block.modal
        if block.kind == "curve" or modal.motion == "G33.1" or self.stands(block):
            return (0, 1, 2)
        if modal.cutter:
            return tuple(i for i in range(3) if not (self.fixed[i] and i == PLANES[modal.plane][2]))
        if block.kind == "arc":
            first, second, third = PLANES[modal.plane]
            return (0, 1, 2) if frame.turned and third != 2 else (first, second)
        return ()

    def _takes_words(self, block: Block, named: list[int]) -> bool:
        """Return whether a block may get additional words."""
        modal = block.modal
        if block.line.optional or modal.cutter or not block.moves:
            return False
        if block.kind == "arc":
            first, second, _ = PLANES[modal.plane]
            return self.helix and (AXES[first] in block.words or AXES[second] in block.words)
        return block.kind == "line" and modal.motion in PLAIN and bool(named)

    def _limited(self, block: Block, frame: Frame, demand: Vector) -> Vector:
        """Return the demanded correction, limited to the change allowed in a cut over the length of the block."""
        out = []
        for i in range(3):
            gap, most = demand[i] - self.carried[i], self.contact.most(block, i)
            free = self.fixed[i] and self.contact.takes_up(block, gap, known=self.before[i])
            if abs(gap) <= most or free or self.doubtful[i] or not (self.before[i] or self.contact.touching):
                out.append(demand[i])
            else:
                # if the least increment is greater than the step, it is the smallest possible change
                least = 10.0**-frame.digits / frame.scale[i]
                out.append(self.carried[i] + math.copysign(min(abs(gap), max(most, least)) if most else 0.0, gap))
        return triple(out)

    def _take(self, block: Block, frame: Frame, old: Vector, new: list[float]) -> None:
        """Store the new words; in G90, also those of axes whose word on the line is unchanged."""
        words = block.words if block.modal.absolute else {}
        taken = [n != o or letter in words for letter, n, o in zip(AXES, new, old, strict=True)]
        if frame.turned:
            taken[0] = taken[1] = taken[0] or taken[1]
        moved = frame.shift(triple(new))
        self.carried = triple(m if t else c for t, m, c in zip(taken, moved, self.carried, strict=True))


def _same_pecks(block: Block, depth: str, shift: float, digits: int) -> float:
    """Return the nearest shift with which a cycle has the same number of pecks as without.

    If Q divides the depth, the number of pecks depends on rounding.
    """
    feed = block.sticky["Q"]

    def pecks(by: float) -> int:
        levels = []
        for letter in ("R", depth):
            value, word = block.sticky[letter], block.words.get(letter)
            plain = word is not None and word.number is not None
            text = format_shifted(word, value, by, digits) if word and plain else format_number(value + by, digits)
            levels.append(float(text) if by else value)
        plane, bottom = levels
        count, plane = 0, plane - feed
        while plane > bottom:
            count, plane = count + 1, plane - feed
        return count

    wanted, least = pecks(0.0), 10.0**-digits
    for k in sorted(range(-20, 21), key=abs):
        near = round(shift + k * least, digits)
        if pecks(near) == wanted:
            return near
    return shift
