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
without allocation, and moves external offsets of {letters} in steps of 0.01 um. For LinuxCNC 2.9 in user space
(Debian's, or with a kernel of PREEMPT_RT), not for RTAI.

The other way is `thermocomp linuxcnc setup` with `thermocomp serve`: models, page, journal and probings are kept by a
service there, and HAL keeps the correction alone. Use one of the two.

## Prove it

    cc -std=c99 {name}.c {name}_test.c -lm -o {name}_test && ./{name}_test

runs the models over their test vectors, faults among them, and compares with what thermocomp says. Its exit code is 0
if all is well. Step 6 below proves the rest at the machine.

## Install it

1. `sudo apt-get install linuxcnc-uspace-dev`, and in this folder: `sudo halcompile --install {component}.comp`.
   After an update of LinuxCNC do it again. A warning that a frame is larger than 2560 bytes may be passed over: the
   servo thread has a stack of 1 MB. The one call in which the zero becomes known, up to 300 s after power-on, takes
   longer (0.4 ms on a desktop processor): home and cut after it.
2. Copy `{name}.hal` beside the machine's INI, and add to its `[HAL]`, behind the other lines:
   `HALFILE = {name}.hal`.
3. Add `OFFSET_AV_RATIO = 0.1` to {sections}: the share of speed and
   acceleration that an external offset may take. Without it LinuxCNC takes offsets and does nothing. Nothing else may
   use an external offset of these axes.
4. `{name}.hal` has places to **FILL IN**: where each value comes from. A value that comes from nowhere is missing, and
   without a count of `reading` nothing ever moves.
5. Have whoever reads the sensors write all values, and then count `reading` up (any change will do), every second or
   ten. If that stands still, the values are old. Where values come from inputs that the servo thread reads itself, let
   a `charge_pump` count through `conv_bit_u32`, and give the watchdog of the card, inverted, to `good-K`.
6. Start LinuxCNC, home, and look: `halcmd show pin {hal}`. `rejected` has to be 0 within the second of a reading, and
   `engaged` TRUE when the machine is on, homed, and in MDI, AUTO or jogging axes. Once a correction is not zero,
   {offsets} must be as large, in machine units. **Try the sign**: with a dial gauge on the axis, the tool has to move
   by the correction, in plus direction if it is positive. `motion.eoffset-limited` is TRUE while a soft limit cuts it.

| value | what it is | unit |
|---|---|---|
{values}

| correction | of | {line} |
|---|---|---|
{corrections}

{zero} {status}{sensors}

A reading counts once: between readings `rejected` is 1 and `status-K` 2, and nothing moves.

A value that is NaN or not plausible, `good-K` FALSE, and a `reading` that stands still move no axis: the correction
stays for {hold:g} s and then goes to zero. Where an offset is not what was asked for, because something else clears or
moves it, {losts} TRUE and nothing is sent until the machine was off and on.

When the machine is switched on again, LinuxCNC has set its offsets to zero; they come back no faster than the rate. It
takes the place where the axis stands for the commanded one then, until the next absolute move. `#5063` of a probing has
the external offset in it.

## Switch it off

`halcmd setp {hal}.enable 0`: the corrections stay for {hold:g} s and then go to zero, slowly. Once they are zero, take
the line out of the INI. Never set `axis.L.eoffset-clear` or take `eoffset-enable` away before: the axis would jump.
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
