"""The bound of a revised program against true runs: a plant that is exactly linear, and the program as it was written.

The truth shares nothing with the bound but the interpreter and the planner: it reads the revised program again, with
the durations and the feed of the true run, and compares the tool with the original.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import thermocomp as tc
from thermocomp.nc.interpreter.block import Block, Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.planner.timeline import MotionLimits, time_blocks
from thermocomp.nc.rewrite.text import Vector

TOP = 9000.0  #: [1/min]
SETUP = Setup(inch=False)
#: seconds of a tool change, of a stop, and the fraction of the feed, as the command assumes them
ASSUMED = {"tool change": 8.0, "stop": 60.0, "feed": 1.0}
#: true runs: condition, its value, seconds at the top speed and at rest before the start
TRUTHS: tuple[tuple[str, float], ...] = (
    ("as assumed", 0.0),
    ("stop", 0.0),
    ("stop", 300.0),
    ("stop", 1200.0),
    ("tool change", 3.0),
    ("tool change", 40.0),
    ("feed", 0.8),
    ("feed", 0.9),
    ("feed", 1.2),
    ("start", 0.0),
)


@dataclass
class Plant:
    """Drift of X, Y and Z: lags of the spindle speed, integrated exactly.

    Parameters
    ----------
    seed : int
        For its gains and time constants.
    """

    seed: int
    taus: np.ndarray[Any, Any] = field(init=False)
    state: np.ndarray[Any, Any] = field(init=False)
    gains: np.ndarray[Any, Any] = field(init=False)

    def __post_init__(self) -> None:
        draw = random.Random(self.seed)
        self.taus = np.array([draw.uniform(240, 600), draw.uniform(1500, 3600)])
        sizes = [draw.choice((-1, 1)) * draw.uniform(*r) for r in ((6, 14), (4, 10), (25, 45))]
        self.gains = np.array([[s * (part := draw.uniform(0.2, 0.5)), s * (1 - part)] for s in sizes]) / TOP
        self.state = np.zeros(2)

    def advance(self, dt: float, speed: float) -> None:
        """Let the spindle run at a speed [1/min] for a time [s]."""
        self.state = speed + (self.state - speed) * np.exp(-dt / self.taus)

    def deviation(self) -> Vector:
        """Return the drift since the machine was cold [um]."""
        x, y, z = (self.gains @ self.state).tolist()
        return x, y, z


def learn(seed: int, folder: Path) -> Path:
    """Fit models to a drift test of the plant, with noise of 0.1 um; return their file."""
    draw, noise = random.Random(seed + 1), np.random.default_rng(seed)
    recordings = []
    for cycle in range(5):
        plant, rows = Plant(seed), []
        speeds = [0.0] + [draw.choice((0.0, *range(1500, 9001, 500))) for _ in range(14)] + [TOP * (cycle == 0)]
        time = 0.0
        for speed in speeds:
            for _ in range(draw.randrange(20, 80)):
                measured = np.array(plant.deviation()) + noise.normal(0.0, 0.1, 3)
                rows.append(f"{time:g},{speed:g}," + ",".join(f"{v:.3f}" for v in measured))
                plant.advance(30.0, speed)
                time += 30.0
        path = folder / f"test-{cycle}.csv"
        path.write_text("time_s,spindle_rpm,x_um,y_um,z_um\n" + "\n".join(rows) + "\n", encoding="ascii")
        recordings.append(path)
    models = tc.fit(recordings, ["x_um", "y_um", "z_um"], "dynamic", inputs="spindle_rpm")
    return models.save(folder / "model.json")


def written(seed: int) -> str:
    """Return a program of about an hour: operations with other tools and speeds, stops and dwells between them."""
    draw = random.Random(seed)
    lines = ["G21 G90 G94 G17 G54 G98"]
    between = ["M5\nM0", "G4 P900", "", "M0", f"M5\nG4 P{draw.randrange(60, 400)}"]
    draw.shuffle(between)
    for tool, pause in enumerate(between[: draw.randrange(3, 6)], start=1):
        lines += ["M5", f"T{tool} M6", f"S{draw.randrange(2000, 9000, 100)} M3", "G0 X0 Y0 Z5", "G1 Z-1 F300"]
        feed = draw.choice((60, 100, 160))
        for row in range(draw.randrange(8, 16)):
            lines += [f"G1 X{100 * (1 - row % 2)} F{feed}", f"Y{2 * row + 2}"]
        lines += ["G0 Z20", *[f"G81 X{10 * k} Y{-5 * k} Z-8 R2 F60" for k in range(3)], "G80", "G0 Z50"]
        lines += [pause] if pause else []
    return "\n".join([*lines, "M5", "M2", ""])


class Truth(NamedTuple):
    """True run and its largest error of X, Y and Z in the cuts [um]."""

    kind: str
    value: float
    error: Vector


def run(original: str, revised: str, seed: int, kind: str, value: float) -> Truth:
    """Run a revised program on the plant; the tool should be where the original moves a tool that does not drift."""
    plant, times = Plant(seed), {**ASSUMED, kind: value}
    if kind == "start":
        plant.advance(1800.0, TOP)
        plant.advance(600.0, 0.0)
    zero, worst, now = plant.deviation(), [0.0] * 3, 0.0
    limits = MotionLimits(tool_change=times["tool change"], stop=times["stop"])
    slowed = "\n".join(_with_feed(text, times["feed"]) for text in revised.splitlines())
    wanted = (b for b in _blocks(original) if b.moves)
    for block, start, end in time_blocks(_blocks(slowed), limits):
        plant.advance(start - now, block.speed)
        now = start
        moves = next(wanted).moves if block.moves else []
        cuts = [k for k, move in enumerate(moves) if not move.rapid]
        parts = max(math.ceil((end - start) / 5.0), 1)
        for k in range(parts + 1):
            if k:
                plant.advance((end - start) / parts, block.speed)
            for move in cuts:
                _note(worst, plant, zero, (moves[move], block.moves[move]), k / parts)
        now = end
    x, y, z = worst
    return Truth(kind, value, (x, y, z))


def _note(worst: list[float], plant: Plant, zero: Vector, pair: tuple[Any, Any], share: float) -> None:
    places = [[a + share * (b - a) for a, b in zip(m.start, m.end, strict=True)] for m in pair]
    if places[0][2] <= 0.0:  # the top of the stock
        for i, drift in enumerate(plant.deviation()):
            error = drift - zero[i] + 1e3 * (places[1][i] - places[0][i])
            worst[i] = max(worst[i], abs(error))


def _blocks(text: str) -> Iterator[Block]:
    return follow_program(read_lines(text.splitlines(keepends=True)), SETUP)


def _with_feed(text: str, factor: float) -> str:
    words = text.split()
    return (
        text if text.startswith("(") else " ".join(f"F{factor * float(w[1:]):.6g}" if w[0] == "F" else w for w in words)
    )


class Row(NamedTuple):
    """True error of an axis in a run, and what was printed for it [um]."""

    seed: int
    kind: str
    value: float
    axis: str
    error: float
    more: float  #: than in the run as assumed
    printed: float
    adds: float  #: part of `printed` by which the condition is wider than the bound


def table(seed: int, folder: Path, truths: tuple[tuple[str, float], ...] = TRUTHS, **options: Any) -> list[Row]:
    """Revise a program by models of the plant, and return its errors in true runs with the printed ranges."""
    model, program = learn(seed, folder), folder / "part.ngc"
    program.write_text(written(seed), encoding="ascii")
    wanted: dict[str, Any] = {"cold": True, "controller": "linuxcnc", "rotation": ["none"], "stock_top": "0 mm"}
    done = tc.revise(program, model, folder / "out.ngc", **(wanted | {"no_split": True} | options))
    bounds = {a["axis"].lower(): a["bound_um"] for a in done.summary["axes"]}
    adds = {c["kind"]: c["adds_um"] for c in done.summary["conditions"]}
    rows, first = [], dict.fromkeys("xyz", 0.0)
    for kind, value in truths:
        truth = run(program.read_text(), (folder / "out.ngc").read_text(), seed, kind, value)
        for axis, error in zip("xyz", truth.error, strict=True):
            first[axis] = error if kind == "as assumed" else first[axis]
            added = adds.get(kind, first | dict.fromkeys("xyz", 0.0))[axis]
            rows.append(
                Row(
                    seed=seed,
                    kind=kind,
                    value=value,
                    axis=axis,
                    error=error,
                    more=error - first[axis],
                    printed=bounds[axis] + added,
                    adds=added,
                )
            )
    return rows


def largest(rows: list[Row]) -> list[Row]:
    """Return the row of the largest error for each program, condition and axis."""
    found: dict[tuple[int, str, str], Row] = {}
    for row in rows:
        key = (row.seed, row.kind, row.axis)
        found[key] = max(row, found.get(key, row), key=lambda r: r.error)
    return list(found.values())
