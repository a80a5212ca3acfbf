"""Correction by offset: ``G52`` shifts the whole work coordinate system, only where this cannot mark the part.

``G52`` is absolute, takes effect wherever it is written, and is the same in LinuxCNC and Fanuc. A new one is written at
safe points only: the tool is up, no cutter compensation or cycle is on, and the next block is a rapid in G90. The words
of the program are unchanged.
"""

from dataclasses import dataclass, field

from thermocomp.nc.interpreter.block import PLANES, Block, triple
from thermocomp.nc.interpreter.codes import CYCLES
from thermocomp.nc.rewrite.contact import CLEAR
from thermocomp.nc.rewrite.method import AXES, STILL, CorrectionMethod
from thermocomp.nc.rewrite.text import Frame, Vector, format_number

#: codes that use the same stored offset as G52
SAME_STORE = ("G52", "G92", "G92.1", "G92.2", "G92.3")


@dataclass
class Offset(CorrectionMethod):
    """Correction method that shifts the work coordinate system at safe points.

    Parameters
    ----------
    axes : tuple of bool
        Axes that ``G52`` names.
    """

    axes: tuple[bool, bool, bool] = (True, True, True)
    _up: bool = field(default=True, init=False)
    _begun: bool = field(default=False, init=False)
    _cycling: bool = field(default=False, init=False)
    _shift: Vector = field(default=(0.0, 0.0, 0.0), init=False)
    #: correction at the initial level of a series of cycles [um]
    _level: float | None = field(default=None, init=False)

    def held_by(self, block: Block) -> str:  # noqa: ARG002 - whatever it does
        """Return the reason why the correction cannot follow the drift in a block."""
        return "a long way between safe points"

    @property
    def leaves_mark(self) -> bool:
        """Whether an offset may remain in the controller if the program is aborted."""
        return self._begun

    @property
    def leaves_offset(self) -> bool:
        """Whether an offset is in force that the program must cancel."""
        return self._begun and any(self._shift)

    def _revise(self, block: Block, demand: Vector) -> tuple[str, ...]:
        self._refuse_rivals(block)
        frame = self.frame(block)
        before: tuple[str, ...] = ()
        if self._safe(block):
            # other axes of the plane would only move later, in a cut; perpendicular to it, the tool first comes down
            named = {*self.named(block), PLANES[block.modal.plane][2]}
            shift = triple(demand[i] if i in named else self._shift[i] for i in range(3))
            before = self._update(block, frame, shift)
        elif self._begun and self.stands(block):
            before = self._stay(block, frame)
        elif block.ends and self._begun:
            if block.modal.cutter:
                raise block.error("the program ends during cutter radius compensation; write G40 before its end")
            before = self._update(block, frame, (0.0, 0.0, 0.0))
        self._carry(block, frame)
        self._look_up(block)
        return (*before, block.line.text)

    # -- conditions --------------------------------------------------------------------------------------------------

    def _safe(self, block: Block) -> bool:
        modal = block.modal
        return (
            self._up
            and (
                (block.kind == "line" and modal.motion == "G0")
                or (block.kind == "cycle" and modal.retract_stated and not self._cycling and not self._near(block))
            )
            and modal.absolute
            and bool(block.moves)
            and not modal.cutter
            and not (modal.turned or "G69" in block.codes)  # G52 would precede G69
            and not block.line.optional
            and bool(self.named(block))
            and not self.stands(block)
        )

    def _near(self, block: Block) -> bool:
        """Return whether a cycle starts at its first hole, or at R, where the order of the levels is critical."""
        first, second, drill = PLANES[block.modal.plane]
        if all(self.before[i] and abs(block.end[i] - block.start[i]) <= STILL for i in (first, second)):
            return True
        plane = block.sticky["R"] / (self.frame(block).scale[drill] * 1e3)
        return self.before[drill] and abs(block.start[drill] - plane) < CLEAR

    def _look_up(self, block: Block) -> None:
        """Update whether the tool is up after a block."""
        if block.tool_change is not None or (block.kind in ("machine", "home") and (self.fixed[2])):
            self._up = True
        elif block.moves:
            rapid = all(m.rapid for m in block.moves)
            high = self.safe_z is not None and block.known[2] and block.end[2] >= self.safe_z - 1e-9
            level = block.end[2] == block.start[2]
            self._up = rapid and ((high and not block.line.optional) or (self._up and level))
        if block.moves or block.kind == "cycle":  # K0 stores its words, for the present level of the tool
            self._cycling = block.kind == "cycle"

    def _stay(self, block: Block, frame: Frame) -> tuple[str, ...]:
        """Reset the offset of axes that a block names at their present position, so that they do not move."""
        named = self.named(block) if block.modal.absolute else []
        shift = triple(self.carried[i] if i in named else self._shift[i] for i in range(3))
        if shift == self._shift or block.modal.cutter or block.modal.turned or block.line.optional:
            return ()
        return self._update(block, frame, shift)

    # -- changes -----------------------------------------------------------------------------------------------------

    def _update(self, block: Block, frame: Frame, demand: Vector) -> tuple[str, ...]:
        if frame.turned and any(demand[:2]):
            raise block.error("the coordinates are rotated: to shift X and Y, use --method coordinates")
        words = frame.words(demand)
        if not any(self.axes) or (self._begun and frame.shift(words) == self._shift):
            return ()
        # the first G52 is written even if it is zero: an aborted run may have left an offset in force
        self._begun, self._shift = True, frame.shift(words)
        text = "G90 G52" + "".join(
            f" {letter}{format_number(w, frame.digits)}"
            for letter, w, on in zip(AXES, words, self.axes, strict=True)
            if on
        )
        return (text + ending(block.line.text),)

    def _carry(self, block: Block, frame: Frame) -> None:
        """Update the correction of the axes as the controller does: a named axis moves to the shifted position."""
        kind = block.kind
        if kind in ("machine", "home"):
            if kind == "home" and block.modal.absolute:  # via a position in work coordinates
                named = self.named(block)
                self.inner = triple(self._shift[i] if i in named else self.carried[i] for i in range(3))
            self.leave(block)
            return
        if self.names_place(block):
            self._refuse_mixed(block, self.named(block), "names a place")
        if kind != "cycle" and (block.moves or block.modal.motion not in CYCLES):
            self._level = None
        if kind in ("none", "set") or not block.modal.absolute or not block.moves:
            return
        if self.stands(block):
            self._refuse_mixed(block, self.named(block), "does not move X, Y and Z")
        after = list(self.carried)
        for i in self.named(block):
            if block.line.optional and self.carried[i] != self._shift[i]:
                raise block.error("an optional line after an update of the offset: give --block-delete off or on")
            after[i], self.fixed[i], self.doubtful[i] = self._shift[i], False, False
        if kind in ("arc", "curve", "cycle"):
            plane = PLANES[block.modal.plane]
            self._refuse_mixed(block, [i for i in plane[:2] if kind != "cycle"], "an arc")
            if kind == "cycle":
                drill = plane[2]
                self.inner = self._shift
                after[drill] = self._drilled(block, frame, drill)
        self.carried = triple(after)

    def _drilled(self, block: Block, frame: Frame, drill: int) -> float:
        if self._level is None:
            self._level = self.carried[drill]
        plane = block.sticky["R"] / (frame.scale[drill] * 1e3)
        ends = self._shift[drill], self._level
        at_r = abs(block.end[drill] - plane) < 1e-6
        certain = block.known[drill]
        if at_r or not certain:
            self.fixed[drill] = self.doubtful[drill] = False
        if not certain and ends[0] != ends[1]:
            self.doubt(drill, ends[at_r])
        return ends[not at_r]

    # -- refusals ----------------------------------------------------------------------------------------------------

    def _refuse_rivals(self, block: Block) -> None:
        for code in block.codes:
            if code in SAME_STORE:
                raise block.error(f"{code} uses the offset that holds the correction: use --method coordinates")

    def _refuse_mixed(self, block: Block, axes: list[int], what: str) -> None:
        """Raise `ProgramError` if an axis has not moved since a change of the offset, and its position matters."""
        for i in axes:
            if self.carried[i] != self._shift[i]:
                raise block.error(
                    f"{what}, but {AXES[i]} has not been positioned since the offset was updated: "
                    "use --method coordinates, or position all axes after the tool change",
                )


def ending(text: str) -> str:
    """Return the line ending of a program line."""
    return text[len(text.rstrip("\r\n")) :] or "\n"
