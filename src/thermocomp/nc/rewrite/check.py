"""Check of a revised program by interpretation: every move must be that of the original plus its correction."""

from collections import deque
from collections.abc import Iterator

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import PLANES, Block, Move, Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.rewrite.method import Change
from thermocomp.nc.rewrite.text import LONGEST, Vector

#: largest difference regarded as rounding [um]
ROUNDING = 0.1


class Check:
    """Interpreter of the revised program in parallel with the original.

    Parameters
    ----------
    setup : Setup
        Setup of the original.
    """

    def __init__(self, setup: Setup) -> None:
        self._texts: deque[str] = deque()
        self._blocks = follow_program(read_lines(self._given(), setup.controller), setup)

    def _given(self) -> Iterator[str]:
        while self._texts:
            yield self._texts.popleft()

    def check(self, block: Block, change: Change) -> None:
        """Compare a block of the original with its revised lines; raise an error if the moves differ."""
        longest = max(map(len, change.texts))
        if longest > (most := max(LONGEST, len(block.line.text))):
            raise block.error(
                f"the revised line would have {longest} characters; at most {most} are allowed; divide the line"
            )
        self._texts.extend(change.texts)
        try:
            moves = [m for _ in change.texts for m in next(self._blocks).moves]
        except ProgramError as e:
            text = change.texts[-1].strip()
            raise block.error(f"the revised line {text!r} cannot be read: {e.reason}") from e
        if len(moves) != len(block.moves):
            raise _fault(block, change, f"makes {len(moves)} moves instead of {len(block.moves)}")
        for k, (was, now) in enumerate(zip(block.moves, moves, strict=True)):
            inside = block.kind in ("cycle", "home") and k < len(moves) - 1
            others = [change.before, change.inner] if inside else []
            others += [change.other] if change.other is not None else []
            for axis, (a, b, wanted) in enumerate(zip(was.end, now.end, change.after, strict=True)):
                found = (b - a) * 1e3
                if abs(found - wanted) <= ROUNDING or any(abs(found - o[axis]) <= ROUNDING for o in others):
                    continue
                raise _fault(block, change, f"moves {'XYZ'[axis]} by {found:.2f} um instead of {wanted:.2f} um")
            if (was.arc or now.arc) and not _same_arc(was, now, change.after):
                raise _fault(block, change, "makes a different arc")


def _same_arc(was: Move, now: Move, shift: Vector) -> bool:
    a, b = was.arc, now.arc
    if a is None or b is None:
        return a is b
    first, second, _ = PLANES[a.plane]
    wanted = (shift[first], shift[second])
    moved = ((q - p) * 1e3 for p, q in zip(a.centre, b.centre, strict=True))
    return (a.plane, a.clockwise, a.turns) == (b.plane, b.clockwise, b.turns) and all(
        abs(m - w) <= ROUNDING for m, w in zip(moved, wanted, strict=True)
    )


def _fault(block: Block, change: Change, what: str) -> ProgramError:
    return block.error(
        f"{block.line.text.strip()!r} would become {change.texts[-1].strip()!r}, which {what}: "
        "please report this; nothing was written",
    )
