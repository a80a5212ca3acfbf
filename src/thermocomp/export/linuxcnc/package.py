"""All files of an export to LinuxCNC: the C99 code, a HAL component around it, a HAL file that moves axes, a page."""

import re
from collections.abc import Mapping

from thermocomp.core.exceptions import InputError
from thermocomp.export.c99 import package as cpackage
from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.linuxcnc.component import name_component, write_component, write_hal
from thermocomp.export.pages import describe
from thermocomp.export.reduction.reduced import find_axis
from thermocomp.export.target import Target
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

_README = """{facts}

# {name}: thermal compensation in LinuxCNC's HAL

`{component}.comp` is a component for the servo thread. It runs `{name}.c` once a second, without Python and
without memory allocation, and moves external offsets of {letters} in steps of 0.01 um. It is for LinuxCNC 2.9 in user
space (as in Debian, or with a PREEMPT_RT kernel), not for RTAI.

The alternative is `thermocomp linuxcnc setup` with `thermocomp serve`: there a service runs models, web page, journal
and probings, and HAL only applies the correction. Use only one of the two.

## Verify it

    cc -std=c99 {name}.c {name}_test.c -lm -o {name}_test && ./{name}_test

runs the models on their test vectors, which include sensor faults, and compares the results with those of thermocomp.
Its exit code is 0 if all agree. Step 6 below verifies the rest at the machine.

## Install it

1. `sudo apt-get install linuxcnc-uspace-dev`, and in this folder: `sudo halcompile --install {component}.comp`.
   Repeat this after an update of LinuxCNC. A warning that a frame is larger than 2560 bytes can be ignored: the
   servo thread has a stack of 1 MB.
2. Copy `{name}.hal` to the folder of the machine's INI file, and add as the last line of its section `[HAL]`:
   `HALFILE = {name}.hal`.
3. Add `OFFSET_AV_RATIO = 0.1` to {sections}: the share of speed and
   acceleration available to an external offset. Without it LinuxCNC accepts offsets but does not apply them. No other
   component may use an external offset of these axes.
4. In `{name}.hal`, **FILL IN** the source of each value. A value without a source is missing, and as long as `reading`
   does not count, nothing moves.
5. The program that reads the sensors must write all values and then increment `reading` (any change is sufficient),
   every one to ten seconds. If `reading` does not change, the values count as old. If the servo thread itself reads the
   inputs, connect a `charge_pump` through `conv_bit_u32` to `reading`, and the inverted watchdog of the card to
   `good-K`.
6. Start LinuxCNC, home, and check `halcmd show pin {hal}`: `rejected` must be 0 within a second of a reading, and
   `engaged` TRUE when the machine is on, homed, and in MDI, AUTO or jogging of axes. While `status-K` is 5, nothing
   moves: on a cold machine `halcmd setp {hal}.told-cold 1` (see below). Once a correction is not zero,
   {offsets} must have the same value, in machine units. **Test the sign**: with a dial indicator on the axis, the tool
   must move by the correction, in the plus direction if it is positive. `motion.eoffset-limited` is TRUE while a soft
   limit restricts the offset.

| value | meaning | unit |
|---|---|---|
{values}

| correction | target | {line} |
|---|---|---|
{corrections}

{zero} {status}{sensors}

## At power-up

{power}

The state outlasts LinuxCNC in a file: `loadrt {component} state_file=/FOLDER/{name}.state` in `{name}.hal`. It is
written when LinuxCNC ends, and read and removed when it starts; the clock of the computer gives the time between. After
a power failure there is no file. Pins: `told-cold`; `rezero` (rising edge) with `rezero-target` (K) and `measured`
[mm].
`halcmd setp {hal}.told-cold 1` tells it cold from a terminal, if the pin is not connected.

## Readings

Each reading is used once: between readings `rejected` is 1 and `status-K` 2, and nothing moves.

A value that is NaN or implausible, `good-K` FALSE, or an unchanged `reading` moves no axis: the correction is held for
{hold:g} s and then decays to zero. If an offset differs from the requested one because another component clears or
moves it, {losts} TRUE, and nothing is sent until the machine has been switched off and on.

When the machine is switched off, LinuxCNC sets its offsets to zero; after it is switched on, they return at the rate
limit. Until the next absolute move, LinuxCNC then regards the actual position of the axis as the commanded one. The
probed position in `#5063` includes the external offset.

## Switch it off

`halcmd setp {hal}.enable 0`: the corrections are held for {hold:g} s and then decay slowly to zero. Once they are zero,
remove the line from the INI file. Do not set `axis.L.eoffset-clear` or reset `eoffset-enable` before: the axis would
jump.
"""


def write_package(
    compensator: Compensator, name: str, facts: Facts, axes: Mapping[str, str] | None = None
) -> dict[str, bytes]:
    """Return all files of the export for LinuxCNC, by name.

    Parameters
    ----------
    axes : mapping of str to str, optional
        Letters by target. Default: derived from the target names.
    """
    tables, said, code = gather(compensator), facts.lines(compensator), cpackage.write_package(compensator, name, facts)
    name = identifier(name)
    letters = {t: find_axis(t, dict(axes or {})) for t in tables.targets}
    if not all(letters.values()) or len(set(letters.values())) < len(letters):
        raise InputError(f"expected a separate axis for each target, found {letters}")
    component = name_component(name)
    about = describe(compensator, tables)
    about["corrections"] = str(about["corrections"]).replace("[um]", "[mm]")  # the pins are in mm
    about["power"] = str(about["power"]).replace("`warm`", "`seems-warm`")
    sections = [f"`[AXIS_{a}]`" for a in letters.values()]
    page = _README.format(
        facts="  \n".join(said),
        name=name,
        component=component,
        hal=component.replace("_", "-"),
        letters=_joined(list(letters.values())),
        sections=_joined(sections),
        offsets=_joined([f"`axis.{a.lower()}.eoffset`" for a in letters.values()]),
        losts=_joined([f"`{a.lower()}-lost`" for a in letters.values()]) + (" are" if len(letters) > 1 else " is"),
        **{k: re.sub(r"`(\w+)\[(\w+)\]`", r"`\1-\2`", v) if isinstance(v, str) else v for k, v in about.items()},
    )
    texts = {
        f"{component}.comp": write_component(tables, name, said, letters),
        f"{name}.hal": write_hal(tables, name, said, letters),
        f"{name}.md": page,
    }
    return {f: c for f, c in code.items() if f not in texts} | {file: text.encode() for file, text in texts.items()}


def _joined(words: list[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]


#: the component counts in steps of 0.01 um, as 32-bit integers
TARGET = Target(write=write_package, axes=True, corrected="XYZ", magnitude=2e7)
