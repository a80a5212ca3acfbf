"""Base class of the correction methods: correction of each axis, and its change by a block."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import NamedTuple

from thermocomp.nc.interpreter.block import Block, Known, Modal, system_name, triple
from thermocomp.nc.interpreter.codes import ROTARY
from thermocomp.nc.rewrite.text import LONGEST, Digits, Frame, Vector, part_comments

AXES = "XYZ"
ALL: Known = (True, True, True)
#: a shorter linear move counts as none: F is then in degrees if rotary axes move [mm]
STILL = 1e-7


class Change(NamedTuple):
    """Revised lines of a block, and the corrections before and after it."""

    texts: tuple[str, ...]  #: lines that replace the line; the last one is the line itself
    before: Vector  #: correction of the axes at the start of the block [um, machine axes]
    after: Vector  #: correction at the end of the block
    inner: Vector  #: correction during a cycle that ends at its start
    other: Vector | None = None  #: alternative correction at the end, if the program does not determine which
    placed: bool = True  #: previous positions of the axes in the block are known


@dataclass
class CorrectionMethod(ABC):
    """Method of writing a correction into a program.

    Parameters
    ----------
    step : float
        Maximum change of the correction in a cut per 10 mm of path [um].
    safe_z : float or None
        Work coordinate Z at and above which the tool is up [mm].
    """

    digits: Digits
    step: float
    safe_z: float | None = None
    #: present correction of each axis [um]
    carried: Vector = field(default=(0.0, 0.0, 0.0), init=False)
    #: axes positioned by machine coordinates or an optional line: without a correction to continue from
    fixed: list[bool] = field(default_factory=lambda: [False, False, False], init=False)
    #: axes with uncertain correction: an optional line, a tool change, a stop or a cycle with an uncertain end may have
    #: moved them
    doubtful: list[bool] = field(default_factory=lambda: [False, False, False], init=False)
    #: alternative corrections of doubtful axes [um]
    other: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0], init=False)
    #: axes whose position was known before the block
    before: Known = field(default=(False, False, False), init=False)
    #: correction of the axes within a cycle [um]
    inner: Vector | None = field(default=None, init=False)
    _modal: Modal | None = field(default=None, init=False)
    _frame: Frame = field(default_factory=lambda: Frame.of(Modal(), Digits()), init=False)

    def revise(self, block: Block, demand: Vector) -> Change:
        """Apply the correction to a block, as far as possible.

        Parameters
        ----------
        demand : tuple of float
            Demanded corrections of the axes at the end of the block [um, machine axes].
        """
        before, self.inner = self.carried, None
        refuse_probing(block)
        if block.tool_change is not None:  # the changer may have moved any axis
            self.doubt_all()
        texts = self._revise(block, demand)
        if block.stops:  # the operator may now move any axis
            self.doubt_all()
        if len(texts[-1]) > LONGEST and texts[-1] != block.line.text:
            texts = (*texts[:-1], *part_comments(texts[-1]))
        placed = self.before == ALL or all(self.before[i] for i in self.named(block))
        self.before = block.known
        after = self.carried
        other = triple(o if d else c for o, d, c in zip(self.other, self.doubtful, after, strict=True))
        return Change(
            texts=texts,
            before=before,
            after=after,
            inner=self.inner or after,
            other=None if other == after else other,
            placed=placed,
        )

    @property
    def splits(self) -> bool:
        """Whether splitting a cut can improve the correction."""
        return False

    @property
    def leaves_mark(self) -> bool:
        """Whether an offset may remain in the controller if the program is aborted."""
        return False

    @property
    def leaves_offset(self) -> bool:
        """Whether an offset is in force that the program must cancel."""
        return False

    @abstractmethod
    def held_by(self, block: Block) -> str:
        """Return the reason why the correction cannot follow the drift in a block."""

    @abstractmethod
    def _revise(self, block: Block, demand: Vector) -> tuple[str, ...]: ...

    def doubt(self, axis: int, other: float) -> None:
        """Record that an axis may have an alternative correction [um], unless it is at machine coordinates."""
        if not self.fixed[axis]:
            if not self.doubtful[axis]:
                self.other[axis] = other
            self.doubtful[axis] = True

    def doubt_all(self) -> None:
        """Record that any axis may have been moved by hand or by the machine itself."""
        for i in range(3):
            self.doubt(i, self.carried[i])

    def stands(self, block: Block) -> bool:
        """Return whether a block moves no linear axis, and so must not move one after revision either.

        This includes cuts, and rapids with a rotary axis, after a stop, if the axes have not been moved by hand since.
        """
        if block.kind != "line":
            return False
        a, b = block.start, block.end
        moves = abs(b[0] - a[0]) > STILL or abs(b[1] - a[1]) > STILL or abs(b[2] - a[2]) > STILL
        if moves and ROTARY.isdisjoint(block.words):
            return False
        unknown = [AXES[i] for i in self.named(block) if block.modal.absolute and not self.before[i]]
        if unknown and not ROTARY.isdisjoint(block.words) and not block.moves[-1].rapid:
            raise block.error(
                f"the line turns a rotary axis at feed rate, and F is in degrees only if {unknown[0]} does not move, "
                f"but its position before the line is unknown: first position {' '.join(unknown)} by a rapid",
            )
        return not moves and not (unknown and ROTARY.isdisjoint(block.words) and block.moves[-1].rapid)

    def frame(self, block: Block) -> Frame:
        """Return the conversion of corrections into the words of a block."""
        if block.modal is not self._modal:  # one modal state serves many blocks
            self._modal, self._frame = block.modal, Frame.of(block.modal, self.digits)
        return self._frame

    def named(self, block: Block) -> list[int]:
        """Return the axes that have a word in a block."""
        return [i for i, letter in enumerate(AXES) if letter in block.words]

    def names_place(self, block: Block) -> bool:
        """Return whether a block redefines the coordinates of the present position."""
        if "G92" in block.codes:
            return True
        if "G10" not in block.codes or block.values.get("L") not in (10.0, 11.0, 20.0):
            return False
        if block.values["L"] != 20:
            raise block.error(
                "G10 L10 and L11 set the tool length from the current position, which already includes the thermal "
                "drift; measure tools outside the program",
            )
        if (number := int(block.values.get("P", 0))) and not (block.modal.system_told and number == block.modal.system):
            raise block.error(
                "G10 L20 for a system that may not be in force is not supported; write "
                f"{system_name(number)} before it, or P0",
            )
        return True

    def leave(self, block: Block) -> None:
        """Process a move to machine coordinates: its axes have no correction afterwards."""
        all_go = block.kind == "home" and ROTARY.isdisjoint(block.words)
        axes = self.named(block) or ([0, 1, 2] if all_go else [])
        if axes and self.frame(block).turned and {0, 1} & set(axes):
            axes = sorted({0, 1, *axes})
            if any(self.carried[i] for i in axes if i not in self.named(block) and i != 2):
                raise block.error(
                    "a move in machine coordinates of X or Y alone while the coordinates are rotated; move both axes"
                )
        fed = any(not m.rapid for m in block.moves)
        if fed and not ROTARY.isdisjoint(block.words) and any(self.carried[i] or self.doubtful[i] for i in axes):
            raise block.error(
                "the line turns a rotary axis at feed rate in machine coordinates; X, Y and Z then move to remove "
                "the correction, so that F may no longer be in degrees; write G53 G0, or separate lines",
            )
        after = list(self.carried)
        for i in axes:
            after[i], self.fixed[i], self.doubtful[i] = 0.0, True, False
        self.carried = triple(after)


def refuse_probing(block: Block) -> None:
    """Raise `ProgramError` if a block probes: its result would contain an unknown correction."""
    if block.kind == "probe":
        raise block.error(
            f"{block.modal.motion} probes, and the program uses the result, which already contains the drift; apply "
            "the command revise only to the part of the program that cuts",
        )
