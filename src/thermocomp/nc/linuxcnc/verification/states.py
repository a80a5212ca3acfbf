"""Possible states of a controller at the start of a program: given settings are fixed, all others are random."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

from thermocomp.nc.interpreter import startup
from thermocomp.nc.interpreter.block import Setup, system_name
from thermocomp.nc.linuxcnc.rs274process import SYSTEMS, InterpreterJob, Stored, draw_controller

#: number of states in which a revised program is verified
STATES = 8
#: seed of a start position that no state uses
ELSEWHERE = 99
#: random settings present in only half of the states
HALF = frozenset({"rotation", "G92"})
#: random settings, with the way to specify them
REMEDIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rotation": "give --rotation none if none is stored, or state it, such as --rotation 'G54=0 deg'",
        "G92": "give --no-g92 if no G92 or G52 is in force when the program starts",
        "G98/G99": "write G98 or G99 before the first cycle, or state it: --startup G98",
        "system in force": "write G54 before the first move",
        "origins": "state them, such as --origin 'G54=0 mm, 0 mm, 0 mm'",
        "tool lengths": "state them, such as --tool '1=120 mm'",
        "homes": "state it: --home '0 mm, 0 mm, 0 mm'; G30 cannot be stated",
        "start": "position all axes before this line",
        "unit": "write G20 or G21 at the start of the program, or state it: --units",
        "optional lines": "state whether they run: --block-delete",
        "tool diameters": "expand the program for its tools: --expand",
        "parameters": "give them a value in the program",
    }
)


def build_stored(setup: Setup) -> Stored:
    """Return the state of the controller with the given settings; all others are 0."""
    return Stored(
        origins={system: origin for system, origin in setup.offsets.items() if system in SYSTEMS},
        lengths=setup.tools,
        home28=setup.home or (),
        rotations=setup.rotations,
        startup=startup.complete_codes(setup),
    )


def list_unstated(setup: Setup) -> tuple[str, ...]:
    """Return the settings that are not given and are therefore random."""
    held = {
        "rotation": all(system in setup.rotations for system in SYSTEMS),
        "G92": setup.no_shift,
        "G98/G99": not {"G98", "G99"}.isdisjoint(setup.startup.split()),
        "homes": False,
        "unit": setup.inch is not None,
        "optional lines": setup.skip_optional,
    }
    return tuple(name for name in REMEDIES if not held.get(name, False))


def state(setup: Setup, number: int, what: frozenset[str] | set[str], program: Path) -> InterpreterJob:
    """Return the job of running a program in a state of the controller."""
    base = replace(build_stored(setup), start=draw_controller(ELSEWHERE).start)
    one, two, four = number & 1, number >> 1 & 1, number >> 2 & 1
    other = draw_controller(number)
    changes: dict[str, object] = {}
    if "rotation" in what and two:
        changes["rotations"] = {**other.rotations, **setup.rotations}
    if "G92" in what and four:
        changes["shift"] = other.shift
    if "G98/G99" in what and one:
        changes["startup"] = base.startup.replace("G99", "G98")
    if "system in force" in what:
        changes["system"] = 1 + number
    if "origins" in what:
        # origins of rotary axes can never be specified
        given = {s: (*origin[:3], *other.origins[s][3:]) for s, origin in base.origins.items()}
        changes["origins"] = {**other.origins, **given}
    if "tool lengths" in what:
        changes["lengths"] = {**other.lengths, **setup.tools}
    if "tool diameters" in what:
        changes["diameters"] = other.diameters
    if "homes" in what:
        changes["home28"] = (*(setup.home or other.home28[:3]), *other.home28[3:])
        changes["home30"] = other.home30
    if "parameters" in what:
        # not all 5000 parameters: reading them would take as long as a short program
        changes["parameters"] = {number: other.parameters[number] for number in range(31, 131)}
    if "start" in what and other.start is not None:
        x, y, z, *more = other.start
        changes |= {
            "start": (x, y, -abs(z) if two ^ four else abs(z), *more),
            "active_length": other.active_length,
            "spindle": other.spindle,
        }
    inch = bool(setup.inch) or ("unit" in what and bool(one ^ two))
    skips = setup.skip_optional or ("optional lines" in what and bool(one ^ two ^ four))
    return InterpreterJob(program, replace(base, **changes), inch, skips)  # type: ignore[arg-type]


def describe_setup(setup: Setup) -> tuple[str, ...]:
    """Return the given settings as text."""
    said = [] if setup.inch is None else ["inch" if setup.inch else "mm"]
    said += [f"{system_name(system)} at {_point(origin)}" for system, origin in sorted(setup.offsets.items())]
    said += [f"tool {tool} = {length:g} mm" for tool, length in sorted(setup.tools.items())]
    said += [] if setup.home is None else [f"home {_point(setup.home)}"]
    angles = sorted(setup.rotations.items())
    if len(angles) >= len(SYSTEMS) and not any(angle for _, angle in angles):
        said.append("no rotation")
    else:
        said += [f"{system_name(system)} turned by {angle:g} deg" for system, angle in angles]
    said += ["no G92"] * setup.no_shift + [setup.startup] * bool(setup.startup)
    said += [f"M{number} moves nothing" for number in sorted(setup.harmless)]
    return (*said, *["optional lines skipped"] * setup.skip_optional)


def _point(place: tuple[float, ...]) -> str:
    return " ".join(f"{axis}{value:g}" for axis, value in zip("XYZ", place, strict=True))
