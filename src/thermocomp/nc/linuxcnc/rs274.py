"""Canonical calls of an NC program, as reported by LinuxCNC's interpreter.

The interpreter verifies every program written here, and expands loops and parameters (see `expand`). It is part of
Debian's package linuxcnc-uspace and needs neither a machine nor a display.
"""

import math
import subprocess
from collections.abc import Generator, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.exceptions import ThermocompError
from thermocomp.files.scratch import scratch
from thermocomp.nc.linuxcnc import rs274process
from thermocomp.nc.linuxcnc.rs274process import AXES, HIGHEST_TOOL, InterpreterJob, InterpreterRun, Stored

__all__ = [
    "AXES", "HIGHEST_TOOL", "ORIGIN", "PACKAGE", "PLANE_AXES", "ArcPath", "Canonical", "Place", "ProgramFrame",
    "Stored", "find_obstacle", "read",
]  # fmt: skip

PACKAGE = "linuxcnc-uspace"
#: Axes of a plane of arcs: first, second, and axis of the helix.
PLANE_AXES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}

Place = tuple[float, float, float, float, float, float, float, float, float]
Places = np.ndarray[Any, np.dtype[np.float64]]
ORIGIN: Place = (0.0,) * 9


class ArcPath(NamedTuple):
    """Direction and centre of an arc; the third coordinate of the centre is that of the end of the arc."""

    plane: int  #: 17, 18, 19
    centre: tuple[float, float, float]  #: program coordinates [mm]
    machine_centre: tuple[float, float, float]  #: machine coordinates [mm]
    turns: int  #: positive counterclockwise; 1: the arc ends in its first turn


class Canonical(NamedTuple):
    """One canonical call of the interpreter.

    `kind` is ``rapid``, ``feed``, ``arc``, ``probe``, ``tap``, ``curve`` for moves, else ``dwell`` (s),
    ``feedrate`` (F converted to mm, F as programmed), ``feedmode`` (spindle, 1 for G95), ``unit`` (mm per unit of
    the program), ``plane``, ``m3``, ``m4``, ``m5``, ``speed`` (spindle, 1/min), ``speedmode`` (spindle, highest
    speed of G96 or 0), ``select`` and ``change`` (tool), ``toolnumber`` (M61), ``tooltable`` (G10 L1, L10, L11),
    ``length`` (tool offset), ``g5x`` (system, origin), ``g92``, ``rotation`` (degrees), ``sync`` (spindle, mm per
    turn, 1 for speed only), ``unsync``, ``path`` (3 G64, 2 G61, 1 G61.1; tolerance), ``naive`` (G64 Q), ``mist``,
    ``flood``, ``mistoff``, ``floodoff``, ``m0``, ``m1``, ``pallet`` (M60; M30 calls it before ``end``), ``end``,
    overrides, ``m62`` to ``m68``, ``wait`` (M66), ``orient`` (M19), ``user`` (code, P, Q), ``comment`` and
    ``message``.
    """

    kind: str
    line: int  #: number of the line in the file of the block (1-based)
    file: str  #: empty for the program itself, else name of the file of the subprogram
    program: Place = ORIGIN  #: end of a move in program coordinates, X to W [mm, deg]
    machine: Place = ORIGIN  #: end of a move in machine coordinates [mm, deg]
    arc: ArcPath | None = None
    values: tuple[float, ...] = ()
    text: str = ""


class ProgramFrame:
    """Offsets between program and machine coordinates.

    Attributes
    ----------
    system : int
        Work coordinate system in force, 1 to 9.
    origin, shift, length : tuple of float
        Offsets of the system, of G92, of the tool, X to W [mm, deg].
    rotation : float
        Rotation about Z [deg].
    """

    def __init__(self) -> None:
        self.system = 1
        self.origin = self.shift = self.length = ORIGIN
        self.rotation = 0.0
        self._settle()

    def _settle(self) -> None:
        self._cos, self._sin = math.cos(math.radians(self.rotation)), math.sin(math.radians(self.rotation))
        self._fixed = _nine(o + t for o, t in zip(self.origin, self.length, strict=True))
        # without a rotation, the sum of all offsets is sufficient
        self._sum = None if self.rotation else _nine(f + s for f, s in zip(self._fixed, self.shift, strict=True))

    def take(self, kind: str, values: tuple[float, ...]) -> None:
        """Update the offsets by a canonical call; calls of other kinds have no effect."""
        if kind == "g5x":
            self.system, self.origin = int(values[0]), _nine(values[1:])
        elif kind == "g92":
            self.shift = _nine(values)
        elif kind == "length":
            self.length = _nine(values)
        elif kind == "rotation":
            self.rotation = values[0]
        else:
            return
        self._settle()

    def machine(self, p: Place) -> Place:
        """Return the machine coordinates of a point in program coordinates."""
        if (o := self._sum) is not None:
            return (
                p[0] + o[0], p[1] + o[1], p[2] + o[2], p[3] + o[3], p[4] + o[4],
                p[5] + o[5], p[6] + o[6], p[7] + o[7], p[8] + o[8],
            )  # fmt: skip
        x, y, *more = (a + b for a, b in zip(p, self.shift, strict=True))
        turned = (x * self._cos - y * self._sin, x * self._sin + y * self._cos, *more)
        return _nine(a + b for a, b in zip(turned, self._fixed, strict=True))

    def machines(self, places: Places) -> Places:
        """Return the machine coordinates of points in program coordinates, one per row."""
        turned = places + self.shift
        if self.rotation:
            x, y = turned[:, 0].copy(), turned[:, 1].copy()
            turned[:, 0], turned[:, 1] = x * self._cos - y * self._sin, x * self._sin + y * self._cos
        turned += self._fixed
        return turned

    def program(self, p: Place) -> Place:
        """Return the program coordinates of a point in machine coordinates."""
        x, y, *more = (a - b for a, b in zip(p, self._fixed, strict=True))
        turned = (x * self._cos + y * self._sin, y * self._cos - x * self._sin, *more)
        return _nine(a - b for a, b in zip(turned, self.shift, strict=True))


def _nine(values: Iterator[float] | Sequence[float]) -> Place:
    a, b, c, d, e, f, g, h, i = values
    return a, b, c, d, e, f, g, h, i


@cache
def find_obstacle() -> str | None:
    """Return the reason why the interpreter cannot be used here; None if it can."""
    advice = f"LinuxCNC's interpreter is needed: install the Debian package {PACKAGE} (apt-get install {PACKAGE})"
    python = rs274process.PYTHON
    if not python.exists():
        return f"{python} does not exist; {advice}"
    with scratch() as folder:
        trying = [str(python), rs274process.ISOLATED, "-c", "import gcode"]
        if subprocess.run(trying, capture_output=True, cwd=folder, check=False).returncode:
            return f"{python} cannot import gcode; {advice}"
        trial = folder / "trial.ngc"
        trial.write_text("G21 M3 S7\nG0 X1\nM5\nM2\n", encoding="ascii")
        try:
            kinds = [call.kind for call in read(trial)]
        except ThermocompError as error:
            return f"the interpreter of {PACKAGE} does not work as expected: {error}"
    expected = {"m3", "speed", "rapid", "m5", "end"}
    if missing := expected - set(kinds):
        return (
            f"the interpreter of {PACKAGE} does not report {', '.join(sorted(missing))}: its version is not supported"
        )
    return None


def read(
    path: Path,
    stored: Stored | None = None,
    *,
    left: dict[int, float] | None = None,
    opened: set[Path] | None = None,
    **settings: Any,
) -> Generator[Canonical]:
    """Run a program through LinuxCNC's interpreter and yield its canonical calls one by one.

    Parameters
    ----------
    stored : Stored, optional
        Values stored in the controller. Default: none.
    """
    with InterpreterRun(InterpreterJob(path, stored or Stored(), **settings)) as run:
        yield from calls(run)
        if opened is not None:
            opened.update(run.opened())
        if left is not None:
            left.update(run.left())


def calls(run: InterpreterRun) -> Iterator[Canonical]:
    """Yield the calls of the next job of a run; see `read`."""
    frame, plane, file, turns = ProgramFrame(), 17, "", 1
    centre = [0.0, 0.0]
    for records, more in run.blocks():
        names = {code: kind for kind, code in run.codes.items()}
        columns = (records[name].tolist() for name in ("kind", "count", "line", "values"))
        for code, count, line, numbers in zip(*columns, strict=True):
            kind = names[code]
            values = tuple(numbers[:count])
            if kind in {"rapid", "feed", "probe"}:
                yield Canonical(kind=kind, line=line, file=file, program=values, machine=frame.machine(values))
            elif kind == "centre":
                centre[:], turns, plane = values[:2], int(values[2]), int(values[3])
            elif kind == "arc":
                i, j, _ = PLANE_AXES[plane]
                at = list(values)
                at[i], at[j] = centre
                about = at[0], at[1], at[2]
                arc = ArcPath(plane, about, frame.machine(_nine(at))[:3], turns)
                yield Canonical(kind=kind, line=line, file=file, program=values, machine=frame.machine(values), arc=arc)
            elif kind in {"comment", "message"}:
                yield Canonical(kind=kind, line=line, file=file, text=more[int(values[0])])
            elif kind == "file":
                file = Path(more[int(values[0])]).name
            elif kind == "curve":
                yield Canonical(kind=kind, line=line, file=file, values=tuple(more[int(values[0])]))
            elif kind != "done":
                frame.take(kind, values)
                yield Canonical(kind=kind, line=line, file=file, values=values)
