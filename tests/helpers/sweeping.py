"""Random programs: revised by both methods, and judged in drawn states of a controller."""

import math
import random
import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import state_judge
import state_run
from machine_programs import program
from nc_law import Steady, revise

from thermocomp.core.exceptions import InputError, ProgramError, ThermocompError
from thermocomp.nc.interpreter.block import Point, Setup
from thermocomp.nc.rewrite.demand import Field
from thermocomp.nc.rewrite.text import Vector

WAYS = ("coordinates", "offset")
#: programs that a process takes at a time
PIECE = 5


@dataclass
class Swinging(Steady):
    """It swings by up to 180 um within minutes, and never rests: as no machine drifts, so that every fault shows."""

    axes: str = "XYZ"
    time: float = 0.0

    def advance(self, dt: float, speed: float) -> None:
        """Let time pass."""
        self.time += dt

    def deviation(self, point: Point) -> Vector:
        """Return the drift [um]."""
        x, y, z = (math.sin(self.time / period) for period in (31.0, 37.0, 45.0))
        z = -90.0 - 85.0 * z + 0.02 * min(max(point[2], -100.0), 100.0)
        return (50.0 + 50.0 * x, -50.0 - 50.0 * y, z) if self.axes != "Z" else (0.0, 0.0, z)

    def field(self) -> Field:
        """Return the drift as it is now."""
        return Swinging(self.axes, self.time).deviation


@dataclass
class Outcome:
    """What became of a program."""

    seed: int
    way: str
    axes: str
    kind: str  #: revised, refused, report, wrong, invalid
    reasons: tuple[str, ...] = ()
    moves: int = 0
    original: str = ""
    revised: str = ""

    @property
    def groups(self) -> list[str]:
        """The reasons without lines and numbers."""
        return list(dict.fromkeys(map(_group, self.reasons)))

    def refused(self, error: InputError) -> "Outcome":
        """Take in that thermocomp refuses it."""
        self.reasons = (f"line {error.line}: {error.reason}" if isinstance(error, ProgramError) else str(error),)
        self.kind = "report" if "please report" in self.reasons[0] else "refused"
        return self

    def write(self, folder: Path) -> None:
        """Write both programs and the reason."""
        folder.mkdir(parents=True, exist_ok=True)
        name = folder / f"{self.seed}-{self.way}"
        name.with_suffix(".ngc").write_text(self.original, encoding="latin-1")
        name.with_suffix(".revised.ngc").write_text(self.revised, encoding="latin-1")
        name.with_suffix(".txt").write_text(f"{self.axes}\n{chr(10).join(self.reasons)}\n", encoding="utf-8")


def _group(reason: str) -> str:
    plain = re.sub(r"^(state \d+: )?(line \d+[:,]? ?)?", "", reason)
    return re.sub(r"'[^']*\d[^']*'", "'...'", re.sub(r"-?\d+\.\d+|(?<![\w.])-?\d+(?![\w.])", "#", plain))[:150]


def setup(way: str, axes: str) -> Setup:
    """Return what is stated of the controller."""
    rotations = dict.fromkeys(range(1, 10), 0.0) if axes != "Z" else {}
    return Setup(
        inch=False,
        speed=3000.0,
        rotations=rotations,
        no_shift=way == "offset",
        rotary=dict.fromkeys("ABC", "table"),
    )


def tried(seed: int, folder: Path, proof: bool) -> Iterator[Outcome]:
    """Yield what becomes of the program of a seed by both ways, or that it is no program."""
    text = program(seed)
    axes = random.Random(seed).choice(("Z", "XYZ"))
    (ran,) = state_run.run(text, state_run.states(seed, state_run.Stated(True, True))[:1], folder)
    if isinstance(ran, ThermocompError):
        yield Outcome(seed, "", axes, "invalid", (str(ran),))
        return
    for way in WAYS:
        yield outcome(seed, text, way, axes, folder, proof)


def outcome(seed: int, text: str, way: str, axes: str, folder: Path, proof: bool = False) -> Outcome:
    """Revise a program and have it judged, and proved as `thermocomp revise` does it."""
    found = Outcome(seed, way, axes, "revised", original=text)
    path = folder / "original.ngc"
    path.write_text(text, encoding="latin-1", newline="")
    try:
        trial = revise(path, folder, Swinging(axes), way, setup=setup(way, axes))
    except InputError as error:
        return found.refused(error)
    found.revised = trial.revised.read_text(encoding="latin-1")
    most = tuple(max(abs(row.deviation[i]) for row in trial.rows) for i in range(3))
    stated = state_run.Stated(no_rotation=axes != "Z", no_shift=way == "offset")
    try:
        found.moves = state_judge.judge(
            text, found.revised, (most[0], most[1], most[2]), state_run.states(seed, stated), folder
        ).moves
    except state_judge.WrongError as error:
        found.kind, found.reasons = "wrong", tuple(error.faults)
    except state_judge.InvalidError as error:
        found.kind, found.reasons = "invalid", (str(error),)
    if proof and found.kind != "invalid":  # what is wrong and not written is a report
        try:
            trial.proved()
        except InputError as error:
            return found.refused(error)
    return found


def sweep(seeds: Sequence[int], processes: int = 1, proof: bool = True) -> Iterator[Outcome]:
    """Yield what becomes of the programs of some seeds, in their order.

    Parameters
    ----------
    seeds : sequence of int
    processes : int
    proof : bool
        They are also proved as `thermocomp revise` does it; what cannot be proved is refused.
    """
    pieces = [seeds[k : k + PIECE] for k in range(0, len(seeds), PIECE)]
    piece = partial(_piece, proof=proof)
    if processes == 1:
        for some in pieces:
            yield from piece(some)
        return
    with ProcessPoolExecutor(processes) as pool:
        for found in pool.map(piece, pieces):
            yield from found


def _piece(seeds: Sequence[int], proof: bool) -> list[Outcome]:
    with tempfile.TemporaryDirectory(prefix="sweep-") as folder:
        return [found for seed in seeds for found in tried(seed, Path(folder), proof)]


class Counts:
    """What a sweep has found.

    Parameters
    ----------
    outcomes : sequence of Outcome
    """

    def __init__(self, outcomes: Sequence[Outcome]) -> None:
        self._outcomes = outcomes
        self.programs = len({o.seed for o in outcomes})
        self.valid = self.programs - len({o.seed for o in outcomes if o.kind == "invalid"})

    def of(self, way: str, kind: str) -> list[Outcome]:
        """Return the outcomes of one way and kind."""
        return [o for o in self._outcomes if o.way == way and o.kind == kind]

    def refused(self, way: str) -> float:
        """Return the share of valid programs that were refused."""
        return len(self.of(way, "refused")) / max(self.valid, 1)

    def __str__(self) -> str:
        rows = [f"programs {self.programs}, valid {self.valid}"]
        for way in WAYS:
            counts = {kind: self.of(way, kind) for kind in ("revised", "refused", "report", "wrong")}
            moves = sum(o.moves for o in counts["revised"])
            rows.append(
                f"{way}: revised {len(counts['revised'])}, refused {len(counts['refused'])} ({self.refused(way):.1%}), "
                f"please report {len(counts['report'])}, wrong {len(counts['wrong'])}; {moves:,} moves right"
            )
            for kind in ("refused", "report", "wrong"):
                seeds: dict[str, int] = {}
                reasons: Counter[str] = Counter()
                for o in counts[kind]:
                    reasons.update(o.groups)
                    seeds |= dict.fromkeys(o.groups, o.seed)
                rows += (f"  {kind:8} {n:4}  {group} [seed {seeds[group]}]" for group, n in reasons.most_common())
        return "\n".join(rows)
