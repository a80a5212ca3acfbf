"""All files of an export to structured text: the blocks, their test, and the instructions."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, get_args
from uuid import NAMESPACE_URL, uuid5

from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.pages import describe, explain
from thermocomp.export.recorded import find_readings
from thermocomp.export.st.plcopen import write_project
from thermocomp.export.st.secondedition import adapt
from thermocomp.export.st.structuredtext import INPUTS, SourceUnit, translate
from thermocomp.export.st.ststatements import BAGS, Dialect, comment, wrapped
from thermocomp.export.st.sttest import allow, write_test
from thermocomp.export.target import Target
from thermocomp.export.vectors import replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather
from thermocomp.runtime.program.variables import RECORDS

_INSTALL: dict[Dialect, str] = {
    "codesys": """`{name}.st` holds types, functions and the function block `{name}`, in IEC 61131-3 structured text.
Create an object for each `TYPE`, `FUNCTION` and `FUNCTION_BLOCK` (CODESYS: Add object > DUT or POU; declaration in the
upper part, statements in the lower part, without the `END_...` of a POU); do the same for `{name}_test.st`.
Instead, `{name}.xml` can be imported at once (Project > Import PLCopenXML).""",
    "twincat": """Each `.TcDUT` and `.TcPOU` file is one object. In the PLC project, add all of them: Add > Existing
item.""",
    "iec": """`{name}.xml` (PLCopen XML) holds all types, functions and function blocks, and the test: import it
(Beremiz, OpenPLC editor, CODESYS). `{name}.st` and `{name}_test.st` are the same as text. It keeps to IEC 61131-3,
second edition, and avoids what MATIEC and STruC++ refused or ignored in the text for CODESYS.""",
    "scl": """`{name}.scl` is an external source. TIA Portal: External source files > Add new external file, then
Generate blocks from source; do the same for `{name}_test.scl`. For S7-1500 only (it needs LReal and optimized data:
{kilobytes} kB per instance).""",
}

#: how a variable is retained
_RETAIN: dict[Dialect, str] = {
    "codesys": "Declare `kept` where the block is called: `VAR RETAIN kept : {name}_state; END_VAR`, or in a list of "
    "persistent variables, which also outlasts a download.",
    "twincat": "Declare `kept` where the block is called: `VAR PERSISTENT kept : {name}_state; END_VAR` (with a UPS; "
    "`VAR RETAIN` with NOVRAM).",
    "iec": "Declare `kept` where the block is called: `VAR RETAIN kept : {name}_state; END_VAR`.",
    "scl": 'Declare `kept : "{name}_state"` in a global data block with optimized access and mark it *Retain*.',
}

_README = """{facts}

# {name}: thermal compensation in structured text ({dialect})

{install}
**Not confirmed:** the text was parsed and run outside the vendor's tools, but has not been compiled in them
yet.

## Verify it

Call an instance of `{name}_test` in a task, once per cycle. After {calls} cycles its output `done` is TRUE. `wrong`
must then be 0, and `largest`, the largest difference from thermocomp relative to the correction (in um for corrections
below 1 um), must be below {tolerance:.1g}. The test vectors include sensor faults{recorded}. At the end the test adds
up all tables and limits. Remove the test and its vectors afterwards.

## Run it

Call one instance of `{name}` in a cyclic task with a cycle time of ten seconds. It needs LREAL.
{each_call}

| input | meaning |
|---|---|
| `value[k]` | see below |
| `good[k]` | FALSE for a sensor without a reading or with a reported failure |
{other}
| `kept` | in and out: the retained state, a variable of type `{name}_state` |

{stopped}

| value | meaning | unit |
|---|---|---|
{values}

| correction | target | {line} |
|---|---|---|
{corrections}

{geometry}{zero} {status}{sensors}

## At power-up

{power}

{retain} Every ten seconds the block copies its state to `kept`, with a check value and the number of its models;
{kilobytes} kB must be retained. Give `off_time` from the controller's clock: keep the time of the last cycle in a
retained variable, too, and do not call the block before the clock is valid. Apply `correction` before the axes are
referenced.

{about}## Test the sign

{sign}

## Switch it off

Do not set the correction to zero in one step: the axis would jump. Instead, call the block with an age of 1.0E+9: the
correction is held for {hold:g} s and then decays slowly to zero. Do not use the controller's own temperature
compensation at the same time.
"""

_OBJECT = """<?xml version="1.0" encoding="utf-8"?>
<TcPlcObject Version="1.1.0.1">
  <{kind} Name="{name}" Id="{{{guid}}}"{special}>
    <Declaration><![CDATA[{declaration}
]]></Declaration>{implementation}
  </{kind}>
</TcPlcObject>
"""


def write_package(
    compensator: Compensator,
    name: str,
    facts: Facts,
    dialect: Dialect = "codesys",
    recording: Any = None,
) -> dict[str, bytes]:
    """Return all files of the export to structured text, by name."""
    return write_blocks(compensator, name, facts, dialect, recording=recording)


def write_blocks(
    compensator: Compensator,
    name: str,
    facts: Facts,
    dialect: Dialect,
    more: Sequence[SourceUnit] = (),
    about: str = "",
    recording: Any = None,
) -> dict[str, bytes]:
    """Return all files of a compensator, and of further blocks for a controller."""
    tables, said, name = gather(compensator), facts.lines(compensator), identifier(name)
    readings = find_readings(tables, recording)
    answers = replay(compensator, tables, readings)
    answers = answers.certain(replay(compensator, tables, readings.shifted(way)) for way in (1, -1))
    units = [*translate(tables, name, dialect), *more]
    tests = write_test(tables, name, dialect, readings, answers, units)
    more_said = explain(
        compensator,
        tables,
        kept="kept, and off_time above 0",
        cold="cold, or a rising edge of restart",
        off="age := 1.0E+9",
    )
    head, told = ("".join(wrapped(f"(* {comment(x)} *)") + "\n" for x in lines) for lines in (said, more_said))
    page = _README.format(
        facts="  \n".join(said),
        name=name,
        dialect={"codesys": "CODESYS", "twincat": "TwinCAT 3", "scl": "Siemens SCL", "iec": "IEC 61131-3"}[dialect],
        install=_INSTALL[dialect].format(name=name, kilobytes=_kilobytes(tables)),
        about=f"{about.lstrip()}\n" if about else "",
        retain=_RETAIN[dialect].format(name=name),
        kilobytes=_kilobytes(tables, "s"),
        calls=len(readings.age),
        recorded=f", and readings of {recording.name}" if recording else "",
        tolerance=allow(tables),
        other="\n".join(f"| `{i}` | {about} |" for i, (_, about) in INPUTS.items()),
        **describe(compensator, tables),
    )
    if dialect == "twincat":
        files = dict(_object(unit, head + told * (unit.name == name)) for unit in [*units, *tests])
    else:
        suffix = "scl" if dialect == "scl" else "st"
        files = {}
        if dialect != "scl":
            plain = adapt([*units, *tests], name)
            files[f"{name}.xml"] = write_project(plain, name, facts, "; ".join(said))
            if dialect == "iec":
                names = {t.name for t in tests}
                tests = [u for u in plain if u.name.startswith(tuple(names))]
                units = [u for u in plain if u not in tests]
        files |= {
            f"{name}.{suffix}": _joined(units, head + told, dialect),
            f"{name}_test.{suffix}": _joined(tests, head, dialect),
        }
    return {file: text.encode() for file, text in {**files, f"{name}.md": page}.items()}


def _kilobytes(tables: Tables, bags: Iterable[str] = (*BAGS, "s")) -> int:
    """Return the approximate size of an instance, with two states and its constants, or of some structures [kB]."""
    variables = [v for bag in bags for v in RECORDS[bag].variables().values()]
    return 1 + 8 * sum(math.prod(tables.sizes.get(d, 0) for d in v.dims) for v in variables) // 1000


def _joined(units: Sequence[SourceUnit], head: str, dialect: Dialect) -> str:
    return "\n".join([head, *(unit.text(dialect) for unit in units)])


def _object(unit: SourceUnit, head: str) -> tuple[str, str]:
    """Return the name and the text of a TwinCAT 3 file for a block or type."""
    body = (
        f"\n    <Implementation><ST><![CDATA[{chr(10).join(unit.body())}\n]]></ST></Implementation>" if unit.end else ""
    )
    kind = "POU" if unit.end else "DUT"
    first, rest = unit.head().split("\n", 1)
    text = _OBJECT.format(
        kind=kind,
        name=unit.name,
        guid=uuid5(NAMESPACE_URL, f"thermocomp/{unit.name}"),
        special=' SpecialFunc="None"' if unit.end else "",
        declaration=f"{first}\n{head}{rest}",
        implementation=body,
    )
    return f"{unit.name}.Tc{kind}", text


TARGET = Target(write=write_package, vectors=True, dialects=get_args(Dialect))
