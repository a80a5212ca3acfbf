"""Options of a revision, as given to ``thermocomp revise``, and the objects built from them.

The options of the drift are in `thermocomp.nc.revision.thermaloptions`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Machine
from thermocomp.files.machines import read_machine
from thermocomp.nc.interpreter.block import Setup, triple
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.revision.values import (
    Spread,
    m_code_of,
    origin_of,
    percent_of,
    point_of,
    read_value,
    rotations_of,
    spread_of,
    startup_of,
    tool_of,
)
from thermocomp.nc.rewrite.conditions import Assumption, Conditions, Kind, OtherRun
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand
from thermocomp.nc.rewrite.method import CorrectionMethod
from thermocomp.nc.rewrite.offset import Offset
from thermocomp.nc.rewrite.text import DIGITS


@dataclass(frozen=True, kw_only=True)
class Way:
    """Method of writing the correction into the program.

    Parameters
    ----------
    method : str
        Method of correction. coordinates: the correction is added to the X, Y and Z words; offset: G52 shifts the work
        coordinates, only where the tool is up (see --safe-z); requires --no-g92.
    every : str
        Interval at which the correction is updated, such as "10 min".
    tolerance : str
        Change of the drift that triggers an update of the correction. With --every, only changes along the path do, if
        the drift depends on the position.
    step : str
        Largest change of the correction per 10 mm of path in a cut; it is distributed over the block.
    largest : str
        Largest plausible correction. A program that needs a larger one is refused, because thermal drift is not that
        large.
    safe_z : str
        Work coordinate Z at and above which the tool is up and there is no cut. Default: the tool counts as up after a
        rapid that lifts it (coordinates), or after tool changes and moves of Z in machine coordinates (offset).
    stock_top : str
        Work coordinate Z of the top of the stock: above it feed moves do not count as cuts in the residual and the
        bound. Default: every feed move counts, also the start of a plunge in the air.
    stop_limit : str
        Largest error that a stop of another duration, within the range of --stop, may cause in the cuts right after it.
        Where it may cause more, a message before the stop tells the operator below which duration to wait and above
        which to probe. Default: no messages.
    no_split : bool
        Do not split long cuts. Default: a cut is split where a linear change of the correction over it would be wrong
        by more than one correction step at mid-cut (method coordinates, linuxcnc).
    expand : bool
        Expand loops, variables and subprograms into plain lines first: with the interpreter of LinuxCNC, or, for fanuc,
        with a built-in unroller that supports those in the same file.
    subroutines : list of Path
        Folders of subprograms for --expand; the folder of the program is always searched first.
    unproved : bool
        Write the program even if no interpreter has verified it; its header then says so.
    """

    method: Literal["coordinates", "offset"] = "coordinates"
    every: str | None = None
    tolerance: str = "1 um"
    step: str = "1 um"
    largest: str = "400 um"
    safe_z: str | None = None
    stock_top: str | None = None
    stop_limit: str | None = None
    no_split: bool = False
    expand: bool = False
    subroutines: list[Path] | None = None
    unproved: bool = False

    def demand(self) -> Demand:
        """Return the conditions for updating the correction."""
        every = None if self.every is None else read_value(self.every, "time", "--every", "10 min", positive=True)
        tolerance = read_value(self.tolerance, "displacement", "--tolerance", "1 um", positive=True)
        return Demand(tolerance, every, read_value(self.largest, "displacement", "--largest", "400 um", positive=True))

    def top(self) -> float | None:
        """Return the top of the stock [mm]."""
        return None if self.stock_top is None else read_value(self.stock_top, "position", "--stock-top", "0 mm")

    def conditions(self, every: Sequence[Assumption]) -> Conditions:
        """Return the conditions of the bound, with the limit of messages about stops."""
        if self.stop_limit is None:
            return Conditions(every)
        if not any(c.kind == "stop" and c.runs for c in every):
            raise InputError('--stop-limit requires a range of stops, such as --stop "60 s, 0 s to 20 min"')
        return Conditions(every, read_value(self.stop_limit, "displacement", "--stop-limit", "5 um", positive=True))

    def made(self, setup: Setup, axes: Sequence[str]) -> CorrectionMethod:
        """Return the correction method with its settings."""
        digits, step = DIGITS[setup.controller], read_value(self.step, "displacement", "--step", "1 um", positive=True)
        safe = None if self.safe_z is None else read_value(self.safe_z, "position", "--safe-z", "5 mm")
        if self.method == "coordinates":
            # a helix is an option of older Fanucs
            return Coordinates(digits, step, safe_z=safe, helix=setup.controller == "linuxcnc")
        if not setup.no_shift:
            raise InputError(
                "--method offset writes G52, which cancels a G92 or G52 that is in force when the program starts: make "
                "sure that none is, and give --no-g92; or use --method coordinates"
            )
        return Offset(digits, step, safe_z=safe, axes=triple(name in axes for name in "XYZ"))

    def folders(self) -> list[Path]:
        """Return the folders of subprograms."""
        folders = self.subroutines or []
        if folders and not self.expand:
            raise InputError("--subroutines requires --expand: without --expand, subprograms are refused")
        for folder in folders:
            if not folder.is_dir():
                raise InputError(f"--subroutines {folder}: no such directory")
        return folders

    def words(self) -> str:
        """Return the method of correction as text, for the header."""
        often = f"every {self.every}" if self.every else f"per {self.tolerance} of drift"
        return f"{self.method}, updated {often}" + (f", steps {self.step}" if self.method == "coordinates" else "")


@dataclass(frozen=True, kw_only=True)
class Controller:
    """State of the controller that is not in the program.

    Parameters
    ----------
    controller : str
        Controller whose NC dialect the program uses: linuxcnc, or fanuc (also for Haas and the ISO programs of most
        machining centres). Default: linuxcnc; a Fanuc program, or one that the two controllers would interpret
        differently, is then refused.
    units : str
        Unit of length in force at the start of the program. Default: none, the program must contain G20 or G21.
    startup : str
        Codes in force at the start of the program, such as "G64 P0.01 G98" (mm). Default: G64 (no tolerance), and G99
        for linuxcnc, G98 for fanuc; those that --expand needs must be in the program itself.
    speed : str
        Spindle speed at the start of the program, such as "6000 1/min". Default: none, the program must contain S and
        M3.
    origin : list of str
        Origins of the work coordinates, such as "G54=100 mm, 50 mm, 0 mm"; needed if the drift depends on the position.
    tool : list of str
        Tool lengths, such as "1=120 mm".
    diameter : list of str
        Tool diameters for --expand, such as "1=10 mm", from which the paths of G41 and G42 are computed.
    home : str
        Position approached by G28, such as "0 mm, 0 mm, 400 mm".
    rotation : list of str
        Rotations of work coordinate systems stored in the controller, such as "G54=12 deg"; "none": no rotation is
        stored. Stored rotations also rotate the corrections of X and Y.
    no_g92 : bool
        Confirm that no G92 or G52 is in force at the start of the program, nor suspended by G92.2: the method offset
        would erase it.
    integers : str
        How a length without a decimal point is read. whole: in millimetres or inches; least: in least input increments;
        refuse: the program is refused. Default: whole for linuxcnc, refuse for fanuc.
    least : str
        Least input increment of the controller.
    block_delete : str
        Block-delete switch. on: lines that begin with / are skipped. off: the controller may run or skip them, and a
        program whose result depends on which is refused. Required with --expand, where off writes them as plain lines.
    harmless : list of str
        M codes of the machine builder that neither move an axis nor change the spindle state, such as M88 of a Fanuc or
        M101 of LinuxCNC.
    """

    controller: Literal["linuxcnc", "fanuc"] | None = None
    units: Literal["mm", "inch"] | None = None
    startup: str | None = None
    speed: str | None = None
    origin: list[str] | None = None
    tool: list[str] | None = None
    diameter: list[str] | None = None
    home: str | None = None
    rotation: list[str] | None = None
    no_g92: bool = False
    integers: Literal["whole", "least", "refuse"] | None = None
    least: str = "1 um"
    block_delete: Literal["on", "off"] | None = None
    harmless: list[str] | None = None

    @property
    def whose(self) -> Literal["linuxcnc", "fanuc"]:
        """Controller whose NC dialect the program uses."""
        return self.controller or "linuxcnc"

    def setup(self, machine: Machine | None) -> Setup:
        """Convert the options to a Setup for the program interpreter, with the rotary axes from the machine file."""
        return Setup(
            controller=self.whose,
            inch=None if self.units is None else self.units == "inch",
            startup="" if self.startup is None else startup_of(self.startup, self.whose),
            speed=0.0
            if self.speed is None
            else read_value(self.speed, "spindle_speed", "--speed", "6000 1/min", positive=True),
            offsets=dict(origin_of(text) for text in self.origin or ()),
            tools=dict(tool_of(text, "--tool", "120 mm") for text in self.tool or ()),
            home=None if self.home is None else point_of(self.home, f"--home {self.home!r}"),
            rotations=rotations_of(self.rotation or ()),
            no_shift=self.no_g92,
            rotary={} if machine is None else dict(machine.structure.rotary),
            integers=self.integers or ("whole" if self.whose == "linuxcnc" else "refuse"),
            least=read_value(self.least, "position", "--least", "1 um", positive=True),
            skip_optional=self.block_delete == "on",
            harmless=frozenset(m_code_of(text, self.whose) for text in self.harmless or ()),
        )

    def diameters(self, *, expand: bool) -> dict[int, float] | None:
        """Return the tool diameters [mm]."""
        if self.diameter is None:
            return None
        if not expand:
            raise InputError("--diameter requires --expand: without --expand, G41 and G42 stay in the program")
        return dict(tool_of(text, "--diameter", "10 mm") for text in self.diameter)


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Speeds and accelerations of the machine.

    Parameters
    ----------
    machine : Path
        Machine file (.toml) with rapid rates and accelerations of the axes; its structure gives the rotary axes.
    tool_change : str
        Duration of a tool change, and its range: what the ends of the range would add to the bound is printed. One
        value alone, such as "8 s": it is certain.
    stop : str
        Duration of the operator stops at M0 and M1, and its range.
    override : str
        Feed override, and its range.
    """

    machine: Path | None = None
    tool_change: str = "8 s, 3 s to 40 s"
    stop: str = "60 s, 0 s to 20 min"
    override: str = "100 %, 80 % to 120 %"

    def read(self) -> Machine | None:
        """Return the machine in the machine file; None without one."""
        return None if self.machine is None else read_machine(self.machine)

    @property
    def _spreads(self) -> tuple[Spread, Spread, Spread]:
        """Durations of stops and tool changes [s], and the feed override."""

        def duration(text: str, option: str, example: str) -> Spread:
            return spread_of(text, lambda t: read_value(t, "time", option, example.partition(",")[0]), option, example)

        return (
            duration(self.stop, "--stop", "60 s, 0 s to 20 min"),
            duration(self.tool_change, "--tool-change", "8 s, 3 s to 40 s"),
            spread_of(self.override, percent_of, "--override", "100 %, 80 % to 120 %"),
        )

    def conditions(self) -> list[Assumption]:
        """Return what is assumed about the times of the run, and the runs at the ends of the ranges."""
        kinds: tuple[Kind, ...] = ("stop", "tool change", "feed")
        return [
            Assumption(kind, s.text, s.value, [OtherRun(text, value) for text, value in s.ends if value != s.value])
            for kind, s in zip(kinds, self._spreads, strict=True)
        ]

    def kinematics(self, machine: Machine | None) -> tuple[MotionLimits, list[str]]:
        """Return the dynamics of the machine, and notes on those that are assumed."""
        stop, change, override = (s.value for s in self._spreads)
        if machine is None:
            guess = "no --machine: the times are those of a medium machining centre (rapids 30 m/min, 3 m/s2)"
            return MotionLimits(tool_change=change, stop=stop, override=override), [guess]
        axes = sorted((a for a in machine.axes if a.name in "XYZ"), key=lambda a: a.name)
        notes = [
            f"{self.machine}: no {what} of {', '.join(silent)}: assumed to be {taken}"
            for what, taken in (("rapid", "30 m/min"), ("acceleration", "3 m/s2"))
            if (silent := [a.name for a in axes if getattr(a, what) is None])
        ]
        return MotionLimits.of(machine, tool_change=change, stop=stop, override=override), notes
