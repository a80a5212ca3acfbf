"""SINUMERIK 840D sl, 828D, ONE: a compensator in SCL, and the values of the setting data."""

from collections.abc import Mapping

from thermocomp.export.axes import Drive, Value, find_drives, write_values
from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.st.package import write_blocks
from thermocomp.export.target import Target
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

#: SD43900, SD43910, SD43920: K0 [mm], tan beta, P0 [mm]
TAKEN = {
    "offset": Value("k0", "SD43900 $SA_TEMP_COMP_ABS_VALUE [mm]", 1e-3),
    "slope": Value("tan_beta", "SD43910 $SA_TEMP_COMP_SLOPE", 1e-6),
    "position": Value("p0", "SD43920 $SA_TEMP_COMP_REF_POSITION [mm]", 1.0),
}

_PAGE = """
## Into the NC

For a SINUMERIK ONE, whose PLC is an S7-1500. The PLC of an 840D sl (S7-300) does not support LReal, that of an 828D or
808D does not support SCL: there a separate computer must run the compensator (C99 or `thermocomp serve`).

dK(T, P) = K0(T) + tan beta(T) (P - P0). The block `{name}_sd` computes these values from `correction` and `slope` of
`{name}`:

| output | setting data | unit |
|---|---|---|
| `k0[k]` | SD43900 `$SA_TEMP_COMP_ABS_VALUE` | mm |
| `tan_beta[k]` | SD43910 `$SA_TEMP_COMP_SLOPE` | |
| `p0[k]` | SD43920 `$SA_TEMP_COMP_REF_POSITION` | mm |

Axes, their targets, and their machine data:

| k | axis | target | MD32750 `$MA_TEMP_COMP_TYPE` | MD32760 `$MA_COMP_ADD_VELO_FACTOR`, at least |
|---|---|---|---|---|
{rows}

The PLC writes the setting data every few seconds to minutes. **UNCONFIRMED**: the block by which your PLC writes NC
variables (see the machine builder's manual), and `direction`, that is whether the NC subtracts the value from the
command (-1, as in the vendor's worked example of a growing screw) or adds it (1). Test this with MD32750 set, the axis
referenced, the spindle stopped and a dial indicator on the axis: with `$SA_TEMP_COMP_ABS_VALUE` of the axis at 0.02
and all other values at 0, the axis moves by +0.02 mm, or by -0.02 mm if the NC subtracts the value.

At power-up the setting data still have the values written last. Write those of the block before the axes are
referenced, also the 0 of a correction whose `status[k]` is 5.

The NC applies a changed value at a speed of at most dv = MD32000 x MD32760, distributed over several cycles; tan beta
is limited to MD32760. Here a correction changes by at most {rate:g} um/s = {speed:g} mm/min. With MD32760 = 0.01 (the
808D's default; at most 0.10 there) and MD32000 = 10000 mm/min, dv is 100 mm/min.
"""


def write_package(
    compensator: Compensator, name: str, facts: Facts, axes: Mapping[str, str] | None = None
) -> dict[str, bytes]:
    """Return all files of the export to SINUMERIK controls, by name."""
    tables, own = gather(compensator), identifier(name)
    drives = find_drives(tables, axes or {})
    more = write_values(f"{own}_sd", "scl", drives, TAKEN, -1.0)
    limits = compensator.limits
    page = _PAGE.format(
        name=own,
        rows="\n".join(
            f"| {k} | {d.letter} | {tables.targets[d.target]} | {_type(d)} | {_slope(d, limits.magnitude)} |"
            for k, d in enumerate(drives)
        ),
        rate=limits.rate,
        speed=limits.rate * 0.06,
    )
    return write_blocks(compensator, name, facts, "scl", [more], page)


def _type(drive: Drive) -> str:
    """Return the value of MD32750: bit 0 for an offset, bit 1 for a slope."""
    return "3 (bits 0, 1)" if drive.travel[0] < drive.travel[1] else "1 (bit 0)"


def _slope(drive: Drive, magnitude: float) -> str:
    low, high = drive.travel
    return f"{2e-3 * magnitude / (high - low):.2g} for tan beta" if low < high else "as it is"


TARGET = Target(write=write_package, axes=True)
