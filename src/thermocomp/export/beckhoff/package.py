"""TwinCAT CNC (ISG kernel): a compensator as a function block, and the values of the axis parameters."""

from collections.abc import Mapping

from thermocomp.export.axes import Value, find_drives, write_values
from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.st.package import write_blocks
from thermocomp.export.target import Target
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

#: P-AXIS-00273, P-AXIS-00274, P-AXIS-00272
TAKEN = {
    "offset": Value("offset_value", "P-AXIS-00273 [0.1 um]", 10.0, whole=True),
    "slope": Value("coefficient", "P-AXIS-00274 [um/m]", 1.0),
    "position": Value("position_value", "P-AXIS-00272 [0.1 um]", 1e4, whole=True),
}

_PAGE = """
## Into the CNC

ds(T, s) = offset(T) + coefficient(T) (s - s0). The block `{name}_axis` computes these values from `correction` and
`slope` of `{name}`:

| output | axis parameter | unit |
|---|---|---|
| | P-AXIS-00271: temperature compensation on | |
| `position_value[k]` | P-AXIS-00272: s0 | 0.1 um |
| `offset_value[k]` | P-AXIS-00273: offset | 0.1 um |
| `coefficient[k]` | P-AXIS-00274: coefficient | um/m |

| k | axis | target |
|---|---|---|
{rows}

The PLC writes them over ADS every few seconds (`ADSWRITE` of the library Tc2_System). **UNCONFIRMED**: index group
and offset of these parameters in your version (see the documentation of the CNC), and `direction`, that is whether the
CNC adds the value to the command (1) or subtracts it (-1). Test this with the spindle stopped and a dial indicator on
the axis: with P-AXIS-00273 at 200 and all other values at 0, the axis moves by +0.02 mm, or by -0.02 mm if the CNC
subtracts the value.

At power-up write the values of the block to the parameters before the axes are homed, also the 0 of a correction whose
`status[k]` is 5.

The CNC distributes a change over several of its cycles; here a correction changes by at most {rate:g} um/s.
"""


def write_package(
    compensator: Compensator, name: str, facts: Facts, axes: Mapping[str, str] | None = None
) -> dict[str, bytes]:
    """Return all files of the export to TwinCAT CNC, by name."""
    tables, own = gather(compensator), identifier(name)
    drives = find_drives(tables, axes or {})
    more = write_values(f"{own}_axis", "twincat", drives, TAKEN, 1.0)
    page = _PAGE.format(
        name=own,
        rows="\n".join(f"| {k} | {d.letter} | {tables.targets[d.target]} |" for k, d in enumerate(drives)),
        rate=compensator.limits.rate,
    )
    return write_blocks(compensator, name, facts, "twincat", [more], page)


#: the controller counts in steps of 0.1 um, as 32-bit integers
TARGET = Target(write=write_package, axes=True, magnitude=2e8)
