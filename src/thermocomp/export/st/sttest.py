"""A function block that runs the structured text of a compensator over its test vectors, one call per cycle."""

import math
from collections.abc import Iterable, Sequence

from thermocomp.export.st.structuredtext import NOTHING, SourceUnit
from thermocomp.export.st.ststatements import SCL, Dialect, array, number, quoted, section, values, wrapped
from thermocomp.export.vectors import Answers, Readings, find_tolerance
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Kind

#: minimum tolerance, as a fraction of the correction, or in um for corrections below 1 um
_TOLERANCE = 1e-9

_BODY = """IF NOT {_}done THEN
    FOR {_}j := 0 TO {last} DO
        {_}value[{_}j] := {_}v.given[{_}row * {width} + {_}j];
        {_}good[{_}j] := {_}value[{_}j] < 1.0E+30;
    END_FOR;
    {_}event := TRUNC({_}v.given[{_}row * {width} + {inputs} + 3]);
    IF {_}event = 2 THEN
        {_}kept.correction[0] := {_}kept.correction[0] + 1.0;
    END_IF;
    {_}tested(value := {_}value, good := {_}good, age := {_}v.given[{_}row * {width} + {inputs}],
        elapsed := {_}v.given[{_}row * {width} + {inputs} + 1],
        reading := {_}v.given[{_}row * {width} + {inputs} + 2],
        off_time := {_}v.given[{_}row * {width} + {inputs} + 4],
        cold := FALSE, restart := ({_}event = 3), rezero := ({_}event > 3), target := {_}event - 4,
        remaining := {_}v.given[{_}row * {width} + {inputs} + 4],
        first := ({_}event = 1) OR ({_}event = 2), kept := {_}kept);
    {_}off := (({_}tested.rejected = 0) <> {_}v.used[{_}row]) OR ({_}tested.warm <> {_}v.warm[{_}row]);
    FOR {_}j := 0 TO {last_target} DO
        {_}want := {_}v.wanted[{_}row * {targets} + {_}j];
        {_}size := ABS({_}want);
        IF {_}size < 1.0 THEN
            {_}size := 1.0;
        END_IF;
        {_}apart := ABS({_}tested.correction[{_}j] - {_}want) / {_}size;
        IF {_}apart > {_}largest THEN
            {_}largest := {_}apart;
        END_IF;
        IF NOT ({_}apart <= {tolerance}) OR ({_}tested.status[{_}j] <> {_}v.told[{_}row * {targets} + {_}j]) THEN
            {_}off := TRUE;
        END_IF;
    END_FOR;
{faults}    IF {_}off THEN
        {_}wrong := {_}wrong + 1;
    END_IF;
    {_}row := {_}row + 1;
    {_}done := {_}row >= {calls};
END_IF;
"""

_FAULTS = """    FOR {_}j := 0 TO {last_sensor} DO
        IF {_}tested.fault[{_}j] <> {_}v.found[{_}row * {sensors} + {_}j] THEN
            {_}off := TRUE;
        END_IF;
    END_FOR;
"""


def write_test(tables: Tables, name: str, dialect: Dialect, readings: Readings, answers: Answers) -> list[SourceUnit]:
    """Return the type with the test vectors, and the block that runs them."""
    scl, inputs, calls = dialect == "scl", len(tables.channels), len(readings.age)
    targets, sensors = len(tables.targets), len(tables.sensors)
    mark = "#" if scl else ""
    held: dict[str, tuple[Kind, Sequence[float]]] = {
        "given": ("real", _finite(readings.columns.ravel())),
        "wanted": ("real", answers.correction.ravel().tolist()),
        "told": ("int", answers.status.ravel().tolist()),
        "used": ("bool", answers.passed.tolist()),
        "warm": ("bool", answers.warm.tolist()),
    }
    if sensors:
        held["found"] = ("int", answers.fault.ravel().tolist())
    lines = [
        f"TYPE {quoted(f'{name}_vectors', scl)}{'' if scl else ' :'}",
        *(SCL if scl else []),
        "STRUCT",
    ]
    lines += [wrapped(f"    {n} : {array(k, len(v))} := {values(v, k)};") for n, (k, v) in held.items()]
    vectors = SourceUnit(f"{name}_vectors", "\n".join([*lines, f"END_STRUCT{';' if scl else ''}", "END_TYPE"]))
    parts = [
        f"FUNCTION_BLOCK {quoted(f'{name}_test', scl)}",
        *(SCL if scl else []),
        f"(* Runs {name} on its test vectors, one per cycle: done after {calls} cycles; wrong must then be 0. *)",
        section("VAR_OUTPUT", {"row": "DINT", "wrong": "DINT", "largest": "LREAL", "done": "BOOL"}),
        section(
            "VAR",
            {
                "tested": quoted(name, scl),
                "kept": quoted(f"{name}_state", scl),
                "event": "DINT",
                "v": quoted(f"{name}_vectors", scl),
                "value": array("real", inputs),
                "good": array("bool", inputs),
                "j": "DINT",
                "want": "LREAL",
                "size": "LREAL",
                "apart": "LREAL",
                "off": "BOOL",
            },
        ),
    ]
    sizes = {
        "_": mark,
        "inputs": inputs,
        "width": inputs + 5,
        "last": inputs - 1,
        "targets": targets,
        "last_target": targets - 1,
        "calls": calls,
        "tolerance": number(allow(tables)),
        "sensors": sensors,
        "last_sensor": sensors - 1,
    }
    body = _BODY.format(**sizes, faults=_FAULTS.format(**sizes) if sensors else "")
    return [vectors, SourceUnit(f"{name}_test", "\n".join(parts), body, "END_FUNCTION_BLOCK")]


def allow(tables: Tables) -> float:
    """Return the tolerance, as a fraction of the correction, or in um for corrections below 1 um."""
    return max(_TOLERANCE, find_tolerance(tables.models))


def _finite(given: Iterable[float]) -> list[float]:
    """Return numbers that a controller can hold."""
    return [float(v) if math.isfinite(v) else NOTHING for v in given]
