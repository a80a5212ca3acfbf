"""Axes of a LinuxCNC configuration, and the names in use in its HAL files."""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from thermocomp.core.exceptions import InputError

#: folder of the HAL files included in LinuxCNC
LIBRARY = Path("/usr/share/linuxcnc/hallib")
_ARROWS = ("=>", "<=", "<=>")


@dataclass(frozen=True)
class Ini:
    """INI file of LinuxCNC, in which keys may occur several times.

    Parameters
    ----------
    sections : dict of str to dict of str to list of str
        Values by section and key.
    """

    path: Path
    sections: dict[str, dict[str, list[str]]]

    def get(self, section: str, key: str, default: str | None = None) -> str:
        """Return the value of a key in a section of the INI file."""
        found = self.sections.get(section, {}).get(key)
        if found:
            return found[0]
        if default is None:
            raise InputError(f"{self.path}: there is no {key} in [{section}]; give the INI file of the machine")
        return default

    def number(self, section: str, key: str, default: float | None = None) -> float:
        """Return the numeric value of a key in a section of the INI file."""
        text = self.get(section, key, None if default is None else str(default))
        try:
            found = float(text)
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            raise InputError(f"{self.path}: [{section}] {key} = {text}: expected a number")
        return found


@dataclass
class HalFiles:
    """Names used in HAL files, as far as they can be analysed: no Tcl, no conditions.

    Parameters
    ----------
    signals : dict of str to str
        Signal connected to each pin.
    pins : dict of str to list of str
        Pins connected to each signal, in the order of the files.
    modules : dict of str to tuple of str, int, str
        File, line and arguments of ``loadrt``, by module.
    functions : list of str
        Functions in the order of the servo thread.
    unread : list of str
        Files that cannot be analysed.
    read : set of Path
        Files that were read.
    """

    signals: dict[str, str] = field(default_factory=dict)
    pins: dict[str, list[str]] = field(default_factory=dict)
    modules: dict[str, tuple[str, int, str]] = field(default_factory=dict)
    functions: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    read: set[Path] = field(default_factory=set)


def read_ini(path: Path) -> Ini:
    """Read an INI file of LinuxCNC."""
    sections: dict[str, dict[str, list[str]]] = {}
    keys: dict[str, list[str]] = {}
    whole = ""
    for raw in _lines(path):
        whole += raw.strip()
        if whole.endswith("\\") and whole[0] not in "#;":
            whole = whole[:-1]
            continue
        line, whole = whole, ""
        if line.startswith("[") and line.endswith("]"):
            keys = sections.setdefault(line[1:-1].strip(), {})
            continue
        key, equals, value = line.partition("=")
        if equals and key[0] not in "#;":  # LinuxCNC, too, ignores all other lines
            keys.setdefault(key.strip(), []).append(value.strip())
    return Ini(path, sections)


def read_hal(ini: Ini, leave: str) -> HalFiles:
    """Read the HAL files named in an INI file."""
    found, later = HalFiles(), HalFiles()
    for key, into in (("HALFILE", found), ("POSTGUI_HALFILE", later)):
        for name in ini.sections.get("HAL", {}).get(key, []):
            path = _find(ini, name)
            if path.name == leave:
                continue
            if path.suffix != ".hal" or len(name.split()) > 1:
                into.unread.append(name)
                continue
            _read_one(path, ini, into)
    found.signals = later.signals | found.signals  # a pin is on one signal only, set by either group of files
    return found


def _find(ini: Ini, name: str) -> Path:
    """Return the path of a HAL file: next to the INI, or one included in LinuxCNC."""
    first = (name.split() or [""])[0]
    path = ini.path.parent / Path(first.removeprefix("LIB:")).expanduser()
    return LIBRARY / path.name if first.startswith("LIB:") or not path.exists() else path


def _read_one(path: Path, ini: Ini, found: HalFiles) -> None:
    if path in found.read:
        return
    found.read.add(path)
    whole = ""
    for k, raw in enumerate(_lines(path), 1):
        whole += raw.split("#", 1)[0].strip()
        if whole.endswith("\\"):
            whole = f"{whole[:-1]} "
            continue
        words, whole = _filled(whole, ini).split(), ""
        if not words:
            continue
        verb, rest = words[0].lower(), [w for w in words[1:] if w not in _ARROWS]
        if verb == "net" and rest:
            found.pins.setdefault(rest[0], []).extend(rest[1:])
            found.signals.update(dict.fromkeys(rest[1:], rest[0]))
        elif verb == "loadrt" and rest:
            found.modules[rest[0]] = (path.name, k, " ".join(rest[1:]))
        elif verb == "addf" and len(rest) > 1:
            place = int(rest[2]) if len(rest) > 2 and rest[2].lstrip("+-").isdigit() else -1
            at = place - 1 if place > 0 else len(found.functions) + place + 1
            found.functions.insert(at, rest[0])
        elif verb == "source" and rest:
            _read_one(path.parent / rest[0], ini, found)
        elif verb in ("linksp", "linkps", "linkpp"):
            found.unread.append(f"{path.name} (line {k}: {verb})")


def _filled(line: str, ini: Ini) -> str:
    """Return a line with ``[SECTION]KEY`` and ``[SECTION](KEY)`` replaced by the values of the INI file."""
    return re.sub(r"\[(\w+)\](?:\((\w+)\)|(\w+))", lambda m: ini.get(m[1], m[2] or m[3], m[0]) if m[1] else m[0], line)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as e:
        raise InputError(f"{path}: the file cannot be read: {e.strerror or e}") from e
