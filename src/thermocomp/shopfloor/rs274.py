"""LinuxCNC's own interpreter, run in a child process: the canonical calls of an NC program.

It is what judges every program that is written here, and what takes loops and parameters apart (see `expand`). It comes
with Debian's package linuxcnc-uspace and needs neither a machine nor a display.
"""

import json
import math
import os
import subprocess
import tempfile
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

from thermocomp.core.exceptions import InputError, ProgramError, ThermocompError

#: The Python of the Debian package, which has the module `gcode`.
PYTHON = Path("/usr/bin/python3")
CHILD = Path(__file__).with_name("_rs274_child.py")
PACKAGE = "linuxcnc-uspace"
AXES = "XYZABCUVW"
#: Axes of a plane of arcs: first, second, and the one the helix goes along.
PLANE_AXES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
HIGHEST_TOOL = 1000
MOST_FOLDERS = 8

Place = tuple[float, float, float, float, float, float, float, float, float]
ORIGIN: Place = (0.0,) * 9


class ArcPath(NamedTuple):
    """How an arc turns; the third coordinate of its centre is that of the arc's end."""

    plane: int  #: 17, 18, 19
    centre: tuple[float, float, float]  #: program coordinates [mm]
    machine_centre: tuple[float, float, float]  #: machine coordinates [mm]
    turns: int  #: positive anticlockwise; 1: the arc ends in its first turn


class Canonical(NamedTuple):
    """One canonical call.

    `kind` is ``rapid``, ``feed``, ``arc``, ``probe``, ``tap``, ``curve`` for moves, else ``dwell`` (s), ``feedrate`` (F
    in mm, F as written), ``feedmode`` (spindle, 1 for G95), ``unit`` (mm in a program's unit), ``plane``, ``m3``,
    ``m4``, ``m5``, ``speed`` (spindle, 1/min), ``speedmode`` (spindle, highest speed of G96 or 0), ``select`` and
    ``change`` (tool), ``toolnumber`` (M61), ``tooltable`` (G10 L1, L10, L11), ``length`` (tool offset), ``g5x``
    (system, origin), ``g92``, ``rotation`` (degrees), ``sync`` (spindle, mm per turn, 1 for speed only), ``unsync``,
    ``path`` (3 G64, 2 G61, 1 G61.1; tolerance), ``naive`` (G64 Q), ``mist``, ``flood``, ``mistoff``, ``floodoff``,
    ``m0``, ``m1``, ``pallet`` (M60, and before the end in M30), ``end``, overrides, ``m62`` to ``m68``, ``wait`` (M66),
    ``orient`` (M19), ``user`` (code, P, Q), ``comment`` and ``message``.
    """

    kind: str
    line: int  #: of the file the block stands in, from 1
    file: str  #: empty for the program itself, else the file of the subprogram
    program: Place  #: end of a move in program coordinates, X to W [mm, deg]
    machine: Place  #: end of a move in machine coordinates [mm, deg]
    arc: ArcPath | None
    values: tuple[float, ...]
    text: str


@dataclass(frozen=True)
class Stored:
    """What is stored in the controller and not in the program.

    Parameters
    ----------
    origins : dict of int to sequence of float
        Of the work coordinate systems, 1 (G54) to 9 (G59.3), X to W [mm, deg]; the others are 0.
    rotations : dict of int to float
        Of the work coordinate systems about Z [deg].
    shift : sequence of float
        G92 offset in force, X to W [mm, deg].
    lengths, diameters : dict of int to float
        Of the tools [mm]; all tools up to 1000 are there, those that are not named with 0.
    active_length : float
        Tool length offset in force at the start [mm].
    spindle : int
        Number of the tool in the spindle at the start; 0: none.
    home28, home30 : sequence of float
        Where G28 and G30 go, X to W [mm, deg].
    startup : str
        Codes in force at the start that no program's end puts back, such as ``G64 P0.01 G98`` (mm).
    start : sequence of float or None
        Machine coordinates at the start, X to W [mm, deg]; None: the origin of the first work coordinate system.
    parameters : dict of int to float
        Others, such as ``#100``.
    """

    origins: Mapping[int, Sequence[float]] = field(default_factory=dict)
    rotations: Mapping[int, float] = field(default_factory=dict)
    shift: Sequence[float] = ()
    lengths: Mapping[int, float] = field(default_factory=dict)
    diameters: Mapping[int, float] = field(default_factory=dict)
    active_length: float = 0.0
    spindle: int = 0
    home28: Sequence[float] = ()
    home30: Sequence[float] = ()
    startup: str = "G64 G98"
    start: Sequence[float] | None = None
    parameters: Mapping[int, float] = field(default_factory=dict)

    def numbers(self) -> dict[int, float]:
        """Return all parameters as the controller keeps them."""
        result = dict(self.parameters)
        result |= {5161 + i: value for i, value in enumerate(self.home28)}
        result |= {5181 + i: value for i, value in enumerate(self.home30)}
        result |= {5211 + i: value for i, value in enumerate(self.shift)}
        result[5210] = float(any(self.shift))
        for system, origin in self.origins.items():
            result |= {5201 + 20 * system + i: value for i, value in enumerate(origin)}
        result |= {5210 + 20 * system: angle for system, angle in self.rotations.items()}
        return result


class Frame:
    """What stands between program and machine coordinates.

    Attributes
    ----------
    system : int
        Work coordinate system in force, 1 to 9.
    origin, shift, length : tuple of float
        Of the system, of G92, of the tool, X to W [mm, deg].
    rotation : float
        About Z [deg].
    """

    def __init__(self) -> None:
        self.system = 1
        self.origin = self.shift = self.length = ORIGIN
        self.rotation = 0.0
        self._settle()

    def _settle(self) -> None:
        self._cos, self._sin = math.cos(math.radians(self.rotation)), math.sin(math.radians(self.rotation))
        self._fixed = _nine(o + t for o, t in zip(self.origin, self.length, strict=True))
        # without a rotation all offsets are one
        self._sum = None if self.rotation else _nine(f + s for f, s in zip(self._fixed, self.shift, strict=True))

    def take(self, kind: str, values: tuple[float, ...]) -> None:
        """Follow a canonical call; calls of other kinds change nothing."""
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
        """Machine coordinates of program coordinates."""
        if (o := self._sum) is not None:
            return (
                p[0] + o[0], p[1] + o[1], p[2] + o[2], p[3] + o[3], p[4] + o[4],
                p[5] + o[5], p[6] + o[6], p[7] + o[7], p[8] + o[8],
            )  # fmt: skip
        x, y, *more = (a + b for a, b in zip(p, self.shift, strict=True))
        turned = (x * self._cos - y * self._sin, x * self._sin + y * self._cos, *more)
        return _nine(a + b for a, b in zip(turned, self._fixed, strict=True))

    def program(self, p: Place) -> Place:
        """Program coordinates of machine coordinates."""
        x, y, *more = (a - b for a, b in zip(p, self._fixed, strict=True))
        turned = (x * self._cos + y * self._sin, y * self._cos - x * self._sin, *more)
        return _nine(a - b for a, b in zip(turned, self.shift, strict=True))


def _nine(values: Iterator[float] | Sequence[float]) -> Place:
    a, b, c, d, e, f, g, h, i = values
    return a, b, c, d, e, f, g, h, i


@cache
def installed() -> str | None:
    """Return why the interpreter cannot be used here; None if it can."""
    advice = f"LinuxCNC's interpreter is needed: install the Debian package {PACKAGE} (apt-get install {PACKAGE})"
    if not PYTHON.exists():
        return f"{PYTHON} is not here; {advice}"
    found = subprocess.run([PYTHON, "-c", "import gcode"], capture_output=True, text=True, check=False)
    if found.returncode:
        return f"{PYTHON} cannot import gcode; {advice}"
    with tempfile.TemporaryDirectory(prefix="rs274-") as folder:
        trial = Path(folder, "trial.ngc")
        trial.write_text("G21 M3 S7\nG0 X1\nM5\nM2\n", encoding="ascii")
        try:
            kinds = [call.kind for call in read(trial)]
        except ThermocompError as error:
            return f"the interpreter of {PACKAGE} does not work as expected: {error}"
    expected = {"m3", "speed", "rapid", "m5", "end"}
    if missing := expected - set(kinds):
        return f"the interpreter of {PACKAGE} does not tell of {', '.join(sorted(missing))}: its version is not known"
    return None


def read(
    path: Path,
    stored: Stored | None = None,
    *,
    inch: bool = False,
    block_delete: bool = False,
    subroutines: Sequence[Path] = (),
    task: bool = False,
    seconds: int = 600,
    left: dict[int, float] | None = None,
    opened: set[Path] | None = None,
) -> Generator[Canonical]:
    """Run a program through LinuxCNC's interpreter and yield its canonical calls as they come.

    Parameters
    ----------
    path : Path
    stored : Stored, optional
        What is stored in the controller; nothing if not given.
    inch : bool
        The controller stands in G20 when the program starts.
    block_delete : bool
        Lines that begin with ``/`` are not run.
    subroutines : sequence of Path
        Folders of subprograms, at most 8; the program's own folder comes first anyway.
    task : bool
        What ``#<_task>`` tells: that the program is run, not previewed.
    seconds : int
        Processor time the interpreter may take [s]: a program can have an endless loop.
    left : dict, optional
        Filled at the end with the parameters the controller would have stored afterwards.
    opened : set, optional
        Filled at the end with the files the interpreter has opened: the program, and those of subprograms.

    Yields
    ------
    Canonical
        Calls before the first line (offsets in force at the start) have line 0. Close the generator if not all is
        read: it ends the interpreter.

    Raises
    ------
    ProgramError
        The interpreter refuses the program: its line and its words.
    InputError
        The file is not there, or the interpreter crashed.
    """
    stored = stored or Stored()
    path = path.absolute()
    if not path.is_file():
        raise InputError(f"{path} is not a file")
    if len(subroutines) > MOST_FOLDERS:
        raise InputError(f"{len(subroutines)} folders of subprograms; the interpreter takes {MOST_FOLDERS}")
    with tempfile.TemporaryDirectory(prefix="rs274-") as name:
        folder = Path(name)
        job = _job(folder, path, stored, inch, subroutines)
        job |= {"block_delete": block_delete, "task": int(task), "seconds": seconds}
        with (folder / "errors").open("wb") as errors:
            process = subprocess.Popen(
                [PYTHON, "-E", CHILD, json.dumps(job)],
                stdout=subprocess.PIPE,
                stderr=errors,
                cwd=folder,
                encoding="utf-8",
            )
        try:
            yield from _calls(process, folder, seconds)
        finally:
            process.kill()  # does nothing if it has ended
            process.communicate()
        if opened is not None:
            names = map(os.fsdecode, (folder / "opened").read_bytes().split(b"\0"))
            opened.update(file for file in map(Path, names) if not file.is_relative_to(folder.resolve()))
        if left is not None:
            rows = (row.split() for row in (folder / "parameters").read_text(encoding="ascii").splitlines())
            left.update({int(row[0]): float(row[1]) for row in rows if len(row) == 2})


def _job(folder: Path, path: Path, stored: Stored, inch: bool, subroutines: Sequence[Path]) -> dict[str, object]:
    """Lay out the files of a run; links keep the lines of the settings short, which are cut at 255 characters."""
    names = [f"s{i}" for i in range(1 + len(subroutines))]
    for name, target in zip(names, [path.parent, *subroutines], strict=True):
        (folder / name).symlink_to(target.absolute())
    (folder / "ini").write_text(f"[RS274NGC]\nSUBROUTINE_PATH = {':'.join(names)}\n", encoding="ascii")
    numbers = sorted(stored.numbers().items())
    (folder / "parameters").write_text("".join(f"{n}\t{v:.9f}\n" for n, v in numbers), encoding="ascii")
    tools = [(n, stored.lengths.get(n, 0.0), stored.diameters.get(n, 0.0)) for n in range(1, HIGHEST_TOOL)]
    table = "".join(f"T{n} P{n} Z{length:.9f} D{diameter:.9f}\n" for n, length, diameter in tools)
    (folder / "table").write_text(table, encoding="ascii")
    start = ""
    if stored.start is not None:
        start = " G53 G0 " + " ".join(f"{a}{v:.9f}" for a, v in zip(AXES, stored.start, strict=False))
    return {
        "program": str(path),
        "home": str(folder),
        "ini": str(folder / "ini"),
        "parameters": str(folder / "parameters"),
        "table": str(folder / "table"),
        "opened": str(folder / "opened"),
        "tools": tools,
        "spindle": stored.spindle,
        "units": f"G21 G90 G17 G40 G49 G80 G94 {stored.startup}{start}",
        # the child waits for this comment and the tool length after it: then the program begins
        "start": f"(begin) G2{0 if inch else 1} G43.1 Z{stored.active_length / (25.4 if inch else 1.0):.9f}",
    }


def _calls(process: "subprocess.Popen[str]", folder: Path, seconds: int) -> Iterator[Canonical]:
    """Read what the child writes."""
    assert process.stdout is not None
    frame, plane, line, file, done = Frame(), 17, 0, "", False
    nowhere: tuple[Place, Place] = (ORIGIN, ORIGIN)
    for row in process.stdout:
        kind, place, rest = row.rstrip("\n").split(" ", 2) if row.count(" ") > 1 else (*row.split(), "")
        line = int(place)
        if kind in {"rapid", "feed", "probe"}:
            values = tuple(map(float, rest.split()))
            end = (*values, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) if len(values) == 3 else values
            yield Canonical(kind, line, file, end, frame.machine(end), None, (), "")  # type: ignore[arg-type]
        elif kind == "arc":
            turns, *numbers = map(float, rest.split())
            first, second, centre1, centre2, third, *more = numbers
            i, j, k = PLANE_AXES[plane]
            at, centre = [0.0] * 3, [0.0] * 3
            at[i], at[j], at[k] = first, second, third
            centre[i], centre[j], centre[k] = centre1, centre2, third
            end = _nine((*at, *(more or (0.0,) * 6)))
            turned = frame.machine(_nine((*centre, *end[3:])))
            arc = ArcPath(plane, (centre[0], centre[1], centre[2]), turned[:3], int(turns))
            yield Canonical(kind, line, file, end, frame.machine(end), arc, (), "")
        elif kind in {"comment", "message"}:
            yield Canonical(kind, line, file, *nowhere, None, (), rest)
        elif kind == "file":
            file = Path(rest).name if rest else ""
        elif kind == "error":
            where = f" (in {file})" if file else ""
            raise ProgramError(max(line, 1), f"the interpreter refuses it{where}: {rest}")
        elif kind == "done":
            done = True
        else:
            values = tuple(map(float, rest.split()))
            if kind == "plane":
                plane = int(values[0])
            frame.take(kind, values)
            yield Canonical(kind, line, file, *nowhere, None, values, "")
    code = process.wait()
    if not done:
        words = (folder / "errors").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        if code == -24:
            raise ProgramError(
                max(line, 1), f"the program takes more than {seconds} s to interpret: has it an endless loop?"
            )
        said = words[-1] if words else "it said nothing"
        if code < 0:
            raise ProgramError(max(line, 1), f"the interpreter died of signal {-code}: {said}")
        raise InputError(f"LinuxCNC's interpreter ended with code {code}: {said}")
