"""The law of a revised program, and drifts to try it with: its moves are the original's plus what each axis carries."""

from dataclasses import dataclass
from pathlib import Path

from thermocomp.nc.interpreter.block import Point, Setup
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.verification.verify import Ledger, Proof, prove
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand, Field
from thermocomp.nc.rewrite.method import CorrectionMethod
from thermocomp.nc.rewrite.offset import Offset
from thermocomp.nc.rewrite.revise import Revised, Revision
from thermocomp.nc.rewrite.text import DIGITS, Vector

#: what the programs do not say: that the controller starts in mm, without rotation and G92, and the spindle turns
STATED = Setup(inch=False, speed=3000.0, rotations=dict.fromkeys(range(1, 10), 0.0), no_shift=True)
#: a drift that does not change [um]
STEADY: Vector = (12.3, -7.7, 25.0)


@dataclass
class Steady:
    """The drift is there at once and stays."""

    by_position = False  # the programs say no origins

    def advance(self, dt: float, speed: float) -> None:
        """Let time pass."""

    def deviation(self, point: Point) -> Vector:
        """Return the drift [um]."""
        return STEADY

    def field(self) -> Field:
        """Return the drift as it is now."""
        return self.deviation


@dataclass
class Growing(Steady):
    """It grows with time, and Z with the place, too: much faster than a machine drifts."""

    time: float = 0.0
    rate: Vector = (0.05, -0.03, 0.1)  #: [um/s]
    slope: float = 0.02  #: of X and Z along Z [um/mm]

    def advance(self, dt: float, speed: float) -> None:
        """Let time pass."""
        self.time += dt

    def deviation(self, point: Point) -> Vector:
        """Return the drift [um]."""
        (x, y, z), along = self.rate, self.slope * point[2]
        return 3 + x * self.time + along, -5 + y * self.time, 25 + z * self.time + along

    def field(self) -> Field:
        """Return the drift as it is now."""
        return Growing(self.time, self.rate, self.slope).deviation


class Still(Steady):
    """The machine does not drift."""

    def deviation(self, point: Point) -> Vector:
        """Return the drift [um]."""
        return 0.0, 0.0, 0.0


def method(name: str, step: float = 1.0) -> CorrectionMethod:
    """Return a way of revising by its name."""
    digits = DIGITS["linuxcnc"]
    return Coordinates(digits, step) if name == "coordinates" else Offset(digits, step, safe_z=5.0)


@dataclass
class Trial:
    """A program that was revised.

    Parameters
    ----------
    original, revised : Path
    run : Revision
    rows : list of Revised
    ledger : Ledger
    setup : Setup
    """

    original: Path
    revised: Path
    run: Revision
    rows: list[Revised]
    ledger: Ledger
    setup: Setup

    def proved(self) -> Proof:
        """Have the interpreter judge it."""
        return prove(self.original, self.revised, self.ledger, self.setup)

    def shifts(self) -> list[tuple[int, Vector]]:
        """Return by how much the interpreter's moves differ [um], with the line of the original."""
        moves = [
            [(c.line, c.machine[:3]) for c in rs274.read(path) if c.kind in ("rapid", "feed", "arc")]
            for path in (self.original, self.revised)
        ]
        return [
            (line, ((b[0] - a[0]) * 1e3, (b[1] - a[1]) * 1e3, (b[2] - a[2]) * 1e3))
            for (line, a), (_, b) in zip(*moves, strict=True)
        ]


def revise(
    original: Path,
    folder: Path,
    drift: Steady,
    way: str,
    *,
    every: float | None = None,
    setup: Setup = STATED,
    step: float = 1.0,
    split: bool = True,
    stock_top: float | None = None,
) -> Trial:
    """Revise a program; `ProgramError` if it is refused."""
    run = Revision(
        setup, MotionLimits(), drift, method(way, step), Demand(1.0, every), split=split, stock_top=stock_top
    )
    ledger, rows = Ledger(), []
    with original.open(encoding="latin-1", newline="") as file:
        for row in run.revise(file):
            ledger.take(row)
            rows.append(row)
    revised = folder / f"revised-{original.name}"
    revised.write_text("".join(t for row in rows for t in row.texts), encoding="latin-1", newline="")
    return Trial(original, revised, run, rows, ledger, setup)
