"""HAL files for a corrected machine: additions to its configuration, and changes to be made by hand."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.files.draft import drafts
from thermocomp.live.adapters.linuxcnc import haltext
from thermocomp.live.adapters.linuxcnc.haltext import HalAxis
from thermocomp.nc.linuxcnc.machineini import HalFiles, Ini, read_hal, read_ini

Pattern = Literal["offset", "drive"]

HAL_NAME, COMPONENT_NAME, SOCKET_NAME = "thermocomp.hal", "thermocomp_hal.py", "thermocomp.sock"
#: share of the axis' speed and acceleration available to a drive-side correction
SHARE = 0.1
#: maximum length of a socket path [bytes]
LONGEST = 107


@dataclass(frozen=True, kw_only=True)
class HalSettings:
    """Limits of a correction inside LinuxCNC, whatever the service sends.

    Parameters
    ----------
    pattern : {'offset', 'drive'}
        Correction by external offsets, or between the controller and the drive.
    axes : str
        Letters of the axes that are corrected.
    magnitude : float
        Largest correction [um].
    rate : float
        Fastest change of the correction [um/s].
    timeout : float
        Time without a message after which the service is treated as disconnected [s].
    hold : float
        Hold time of the correction after a disconnect [s].
    fade : float
        Rate at which the correction ramps to zero after the hold time [um/s].
    group : str
        User group whose members may connect; without one, only the user that runs LinuxCNC may connect.
    """

    pattern: Pattern = "offset"
    axes: str = "Z"
    magnitude: float = 500.0
    rate: float = 0.5
    timeout: float = 2.0
    hold: float = 1800.0
    fade: float = 0.1
    group: str = ""

    def __post_init__(self) -> None:
        for name in ("magnitude", "rate", "timeout", "hold", "fade"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise SettingError(f"{name} = {getattr(self, name)}: must be positive and finite")
        if not self.axes or set(self.axes.upper()) - set("XYZUVW") or len(set(self.axes.upper())) != len(self.axes):
            raise SettingError(f"axes = {self.axes!r}: expected letters of linear axes, each once, such as XZ")
        if self.group:
            import grp  # not on every system

            try:
                grp.getgrnam(self.group)
            except KeyError as e:
                raise SettingError(f"group = {self.group!r}: there is no such group on this computer") from e


class HalSetup(NamedTuple):
    """Files and settings for corrections of a machine, as returned by `prepare`."""

    hal: str  #: text of the HAL file
    component: str  #: text of the component
    todo: tuple[str, ...]  #: changes to be made by hand, as text
    socket: Path  #: socket to which the service connects
    files: tuple[Path, ...]  #: files to be written


def prepare(path: Path, folder: Path, settings: HalSettings) -> HalSetup:
    """Return the files and settings for corrections of a machine; nothing is written."""
    ini = read_ini(path)
    files = read_hal(ini, HAL_NAME)
    axes = [_axis(ini, letter, settings.pattern) for letter in settings.axes.upper()]
    _check_free(ini, files, axes, settings.pattern)
    folder = folder.resolve()
    socket = folder / SOCKET_NAME
    if len(str(socket).encode()) > LONGEST or any(c.isspace() or c in "\"'#[]$()" for c in str(socket)):
        raise InputError(f"{folder}: HAL and a socket need a short path without spaces: choose another folder with -o")
    todo: list[str] = []
    joints = round(ini.number("KINS", "JOINTS"))
    lines = ["# written by thermocomp linuxcnc setup; do not edit, run setup again instead"]
    lines += haltext.load_modules(axes, joints, settings.pattern, files, todo)
    lines += haltext.make_gate(joints, settings.pattern, files)
    inch = ini.get("TRAJ", "LINEAR_UNITS", "mm").lower() in ("in", "inch", "imperial")
    micron = 1e-3 / 25.4 if inch else 1e-3
    for axis in axes:
        lines += haltext.make_line(axis, files, settings.magnitude, micron)
        lines += (
            haltext.make_offset(axis, files, micron)
            if settings.pattern == "offset"
            else haltext.make_drive(axis, files)
        )
    ends = " ".join(f"--axis {a.letter},{a.low!r},{a.high!r}" for a in axes)
    numbers = " ".join(f"--{n} {getattr(settings, n)!r}" for n in ("magnitude", "rate", "timeout", "hold", "fade"))
    lines.append(
        f"loadusr -Wn thermocomp /usr/bin/python3 {folder / COMPONENT_NAME} --pattern {settings.pattern} {ends} "
        f"--unit {'inch' if inch else 'mm'} {numbers} --socket {socket}"
        + (f" --group {settings.group}" if settings.group else "")
    )
    ours = [Path(name.split()[0]).name for name in ini.sections.get("HAL", {}).get("HALFILE", [])]
    if HAL_NAME not in ours:
        todo.insert(0, f"{path}: add to [HAL], after the other HALFILE lines: HALFILE = {_named(folder, path)}")
    for name in files.unread:
        todo.append(
            f"{name}: its commands cannot be analysed; a pin that it uses, or a module that it loads, must not be used "
            "again"
        )
    component = Path(__file__).with_name("_hal_component.py").read_text(encoding="utf-8")
    return HalSetup(
        hal="\n".join(lines) + "\n",
        component=component,
        todo=tuple(todo),
        socket=socket,
        files=(folder / COMPONENT_NAME, folder / HAL_NAME),
    )


def set_up(path: Path, folder: Path, settings: HalSettings, *, overwrite: bool = False) -> HalSetup:
    """Write the files for correcting a machine: a HAL file and the component that it starts."""
    prepared = prepare(path, folder, settings)
    with drafts(prepared.files, overwrite=overwrite) as started:
        for draft, text in zip(started.values(), (prepared.component, prepared.hal), strict=True):
            draft.write_text(text, encoding="utf-8", newline="\n")
        started.publish()
    return prepared


def _named(folder: Path, ini: Path) -> str:
    here = ini.resolve().parent
    return HAL_NAME if folder == here else str(folder / HAL_NAME)


def _axis(ini: Ini, letter: str, pattern: Pattern) -> HalAxis:
    section = f"AXIS_{letter}"
    if section not in ini.sections:
        known = ", ".join(s for s in ini.sections if s.startswith("AXIS_"))
        raise InputError(f"{ini.path}: there is no [{section}]; there are {known or 'no axes'}")
    low, high = ini.number(section, "MIN_LIMIT"), ini.number(section, "MAX_LIMIT")
    if not low < high:
        raise InputError(f"{ini.path}: [{section}] MIN_LIMIT = {low:g} must be below MAX_LIMIT = {high:g}")
    joint = -1
    if pattern == "offset":
        if not 0.0 < ini.number(section, "OFFSET_AV_RATIO", 0.0) <= 0.9:
            raise InputError(
                f"{ini.path}: [{section}] has no OFFSET_AV_RATIO from 0 to 0.9, and without it LinuxCNC accepts "
                f"external offsets but does not apply them; add OFFSET_AV_RATIO = 0.1 to [{section}] (the share of the "
                "axis' speed and acceleration for the correction; the rest is for programs), or use --pattern drive"
            )
    else:
        joint = _joint(ini, letter)
    speed, acceleration = ini.number(section, "MAX_VELOCITY"), ini.number(section, "MAX_ACCELERATION")
    return HalAxis(
        letter=letter.lower(), joint=joint, low=low, high=high, speed=SHARE * speed, acceleration=SHARE * acceleration
    )


def _joint(ini: Ini, letter: str) -> int:
    """Return the joint number of an axis."""
    name, *rest = ini.get("KINS", "KINEMATICS").split()
    if name != "trivkins":
        raise InputError(
            f"{ini.path}: [KINS] {name}: with --pattern drive each axis must be a joint (trivkins); use --pattern "
            "offset"
        )
    given = [word.partition("=")[2] for word in rest if word.startswith("coordinates=")]
    letters = (given[0] if given else "XYZABCUVW").upper()
    if letters.count(letter) != 1:
        raise InputError(
            f"{ini.path}: [KINS] coordinates={letters}: axis {letter} has {letters.count(letter)} joints, expected "
            "one; use --pattern offset"
        )
    return letters.index(letter)


def _check_free(ini: Ini, files: HalFiles, axes: Sequence[HalAxis], pattern: Pattern) -> None:
    if pattern == "drive":
        if files.unread:
            raise InputError(
                f"{ini.path}: HAL in {files.unread[0]} cannot be analysed (Tcl, or old commands); with "
                "--pattern drive all connections of the drive must be known: use --pattern offset"
            )
        if not {"motion-command-handler", "motion-controller"} <= set(files.functions):
            raise InputError(f"{ini.path}: no HAL file adds motion-command-handler and motion-controller to a thread")
        for axis in axes:
            for end in ("cmd", "fb"):
                if f"joint.{axis.joint}.motor-pos-{end}" not in files.signals:
                    raise InputError(f"{ini.path}: no HAL file nets joint.{axis.joint}.motor-pos-{end}: no drive found")
        return
    for axis in axes:
        for pin in ("counts", "enable", "scale", "clear"):
            if (name := f"axis.{axis.letter}.eoffset-{pin}") in files.signals:
                raise InputError(
                    f"{ini.path}: {name} is used already (signal {files.signals[name]}): LinuxCNC has one external "
                    "offset per axis; use --pattern drive"
                )
