"""Klipper's ``[z_thermal_adjust]``: one temperature, one coefficient, Z only."""

import math
from collections.abc import Sequence

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.checkscript import KLIPPER, write_script
from thermocomp.export.facts import Facts
from thermocomp.export.reduction.reduced import SHAPES, Reduced, head, in_mm, vectors
from thermocomp.export.reduction.reducedpage import write_page
from thermocomp.export.target import Target

SIGN = (
    "Sign: Klipper adds -temp_coeff x (temperature - temperature at homing) to the commanded Z: a positive temp_coeff "
    "lowers Z as it gets warmer. So temp_coeff is plus the deviation (actual minus commanded) per kelvin. Taken from "
    "Klipper's source (z_thermal_adjust.py, calc_adjust), not tested on a printer: test it as described in the page"
)
UNITS = "Units: temp_coeff in mm/K, temperatures in degC, times in s"
#: largest coefficient accepted by Klipper [mm/K]
_MOST = 1.0
#: margin of the sensor range about the recorded range [degC]; Klipper stops the printer outside the sensor range
_ROOM = 30.0
#: lowest `min_temp` accepted by Klipper [degC]
_COLDEST = -273

_SECTION = """{head}

[z_thermal_adjust]
temp_coeff: {coefficient}
# of the temperature that the recording calls {sensor}
max_z_adjustment: {most}
# mm, in either direction
smooth_time: 10.0
# s
#z_adjust_off_above: 99999
# mm: above this height the adjustment does not change

# FILL IN: the sensor of {sensor}, as for a [temperature_sensor]
sensor_type: FILL_IN
sensor_pin: FILL_IN
min_temp: {low:g}
max_temp: {high:g}
# degC. Outside this range Klipper stops the printer: check these values
"""

_ABOUT = """\
Klipper computes `z_adjust = -temp_coeff * (temperature - temperature_at_homing)` [mm] and adds it to the commanded
Z of every move in X or Y, in increments of at least one motor step. The zero (reference) is the smoothed temperature
when Z was homed."""

_INSTALL = """\
1. Copy `[z_thermal_adjust]` from `{name}.cfg` into `printer.cfg` and fill in `sensor_type`, `sensor_pin`,
   `min_temp` and `max_temp` of the sensor that the recording calls {sensor}. Remove a `[temperature_sensor]` that
   uses the same pin.
2. Make sure that no other macro shifts Z by that temperature.
3. `RESTART`, `G28`. Home again whenever the present temperature is to become the zero.
4. Test the sign once, which takes two minutes: `SET_Z_THERMAL_ADJUST REF_TEMP=R` with R = the present temperature
   minus 10, then `G1` by a millimetre in X, then `SET_Z_THERMAL_ADJUST` without parameters: it prints "Applied Z
   adjustment", which must be {ten} mm, and the nozzle must have moved {way}. `G28` ends the test.

This test shows that Klipper uses the sign as assumed here. Check the sign of the recording yourself: its deviation must
be actual minus commanded, positive if a warm nozzle is further from the bed than commanded."""

_CHECK = """\
`{name}_vectors.csv` contains temperatures at homing and now [degC], the expected adjustment of Z [um] and its
tolerance, also beyond the trained range. `python3 {name}_check.py` (needs only Python) reads `temp_coeff` and
`max_z_adjustment` from `{name}.cfg`, or from a file given as argument (`printer.cfg`), and compares: exit code 0 if
all agree. On the printer: choose a row whose present temperature is close to yours, and give its temperature at homing
as `SET_Z_THERMAL_ADJUST REF_TEMP=`."""

_OFF = """\
`SET_Z_THERMAL_ADJUST ENABLE=0`: the adjustment is frozen, without a jump, and removed by the next `G28`. To remove it
permanently, delete the section from `printer.cfg`, then `RESTART` and `G28`."""


def write_klipper(
    reductions: Sequence[Reduced], limits: Limits, name: str, facts: Facts, *, figure: str = ""
) -> dict[str, bytes]:
    """Return all files of the export to Klipper by name, the page of instructions last."""
    if len(reductions) > 1:
        raise InputError(
            f"Klipper has one [z_thermal_adjust], but there are {', '.join(r.model.target for r in reductions)}: name "
            "one with --axes, such as --axes z_um=Z"
        )
    (r,) = reductions
    ((sensor, factor),) = r.terms
    if abs(factor) > 1e3 * _MOST:
        raise InputError(
            f"{r.model.target}: {factor:g} um/K, and Klipper accepts at most {_MOST:g} mm/K: check the units of the "
            "recording, or export to another controller"
        )
    first = head(reductions, facts, SIGN, UNITS)
    zero = r.zeros[0]
    section = _SECTION.format(
        head="\n".join(f"# {line}" for line in first),
        coefficient=in_mm(factor),
        sensor=sensor.name,
        most=in_mm(limits.magnitude),
        low=max(math.floor(zero + sensor.low - _ROOM), _COLDEST),
        high=math.ceil(zero + sensor.high + _ROOM),
    )
    page = write_page(
        name,
        first,
        reductions,
        what="Klipper's [z_thermal_adjust]",
        about=_ABOUT,
        limits=f"at most {limits.magnitude:g} um. The rate is not limited: a change between two moves is applied with "
        "the next move.",
        failed="Klipper stops the printer if the temperature is outside `min_temp` to `max_temp`; a wrong value "
        "within that range is not detected and moves Z.",
        install=_INSTALL.format(
            name=name,
            sensor=sensor.name,
            ten=f"{-10 * factor / 1e3:+.4f}",
            way="down (towards the bed)" if factor > 0 else "up (away from the bed)",
        ),
        check=_CHECK.format(name=name),
        off=_OFF,
        figure=figure,
    )
    texts = {
        f"{name}.cfg": section,
        f"{name}_vectors.csv": _vectors(r, limits),
        f"{name}_check.py": write_script(KLIPPER, name, "cfg"),
        f"{name}.md": page,
    }
    return {file: text.encode() for file, text in texts.items()}


def _vectors(r: Reduced, limits: Limits) -> str:
    ((_, factor),), (zero,) = r.terms, r.zeros
    rows = ["homing_degC,now_degC,adjustment_um,tolerance_um"]
    pairs = [(home, now) for home in (zero, round(zero + 7.5, 2)) for (now,) in vectors(r)]
    far = round(zero + 1.25 * limits.magnitude / abs(factor), 2)  # beyond the limit
    for home, now in [*pairs, (zero, far), (far, zero)]:
        said = factor * (home - now)
        rows.append(f"{home:g},{now:g},{min(max(said, -limits.magnitude), limits.magnitude):.4f},0.01")
    return "\n".join(rows) + "\n"


TARGET = Target(write=write_klipper, shape=SHAPES["klipper"])
