"""A function block that runs the structured text of a compensator over its test vectors, one call per cycle."""

import math
from collections.abc import Iterable, Iterator, Sequence

from thermocomp.export.st.structuredtext import NOTHING, SourceUnit
from thermocomp.export.st.ststatements import SCL, Dialect, array, number, quoted, safe, section, values, wrapped
from thermocomp.export.vectors import INNER, Answers, Readings, find_tolerance
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Kind
from thermocomp.runtime.program.variables import Kept

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
    {_}off := ({_}tested.rejected <> {_}v.why[{_}row]) OR ({_}tested.outside <> {_}v.outside[{_}row])
        OR ({_}tested.warm <> {_}v.warm[{_}row]);
    FOR {_}j := 0 TO {last_target} DO
        IF {_}tested.status[{_}j] <> {_}v.told[{_}row * {targets} + {_}j] THEN
            {_}off := TRUE;
        END_IF;
    END_FOR;
{numbers}{faults}    IF {_}off THEN
        {_}wrong := {_}wrong + 1;
    END_IF;
    {_}row := {_}row + 1;
    {_}done := {_}row >= {calls};
END_IF;
"""

_NUMBERS = """    FOR {_}j := 0 TO {last_target} DO
        {_}want := {_}v.{output}[{_}row * {targets} + {_}j];
        {_}size := ABS({_}want);
        IF {_}size < 1.0 THEN
            {_}size := 1.0;
        END_IF;
        {_}apart := ABS({_}tested.{output}[{_}j] - {_}want) / {_}size;
        IF {_}apart > {_}largest THEN
            {_}largest := {_}apart;
        END_IF;
        IF NOT ({_}apart <= {tolerance}) THEN
            {_}off := TRUE;
        END_IF;
    END_FOR;
"""

_FAULTS = """    FOR {_}j := 0 TO {last_sensor} DO
        IF {_}tested.fault[{_}j] <> {_}v.found[{_}row * {sensors} + {_}j] THEN
            {_}off := TRUE;
        END_IF;
    END_FOR;
    IF {_}v.given[{_}row * {width} + {inputs} + 1] >= 10.0 THEN
        {_}want := {_}v.inner[{_}row];
        {_}apart := ABS({check}(s := {_}kept) - {_}want) / (1.0 + ABS({_}want));
        IF NOT ({_}apart <= 1.0E-9) THEN
            {_}off := TRUE;
        END_IF;
    END_IF;
"""

_PART = """{_}size := ABS({_}value);
IF {_}size > 1.0E+13 THEN
    {_}size := 1.0E+13;
END_IF;
{_}size := LN(1.0 + 10000.0 * {_}size) * DINT_TO_LREAL({_}index + 1);
IF {_}value < 0.0 THEN
    {_}size := -{_}size;
END_IF;
{_}{name}_test_part := {_}size;
"""


def write_test(tables: Tables, name: str, dialect: Dialect, readings: Readings, answers: Answers) -> list[SourceUnit]:
    """Return the type with the test vectors, the functions of check values, and the block that runs the vectors."""
    scl, inputs, calls = dialect == "scl", len(tables.channels), len(readings.age)
    targets, sensors = len(tables.targets), len(tables.sensors)
    mark = "#" if scl else ""
    held: dict[str, tuple[Kind, Sequence[float]]] = {
        "given": ("real", _finite(readings.columns.ravel())),
        "correction": ("real", answers.correction.ravel().tolist()),
        "told": ("int", answers.status.ravel().tolist()),
        "why": ("int", answers.why.tolist()),
        "outside": ("int", answers.outside.tolist()),
        "warm": ("bool", answers.warm.tolist()),
    }
    if sloped := any(tables.values["to_slope"]):
        held["slope"] = ("real", answers.slope.ravel().tolist())
    if sensors:
        held |= {"found": ("int", answers.fault.ravel().tolist()), "inner": ("real", answers.inner.tolist())}
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
        "check": quoted(f"{name}_test_state", scl),
    }
    numbers = "".join(_NUMBERS.format(**sizes, output=o) for o in ("correction", "slope")[: 1 + sloped])
    body = _BODY.format(**sizes, numbers=numbers, faults=_FAULTS.format(**sizes) if sensors else "")
    checks = [*_checks(tables, name, scl)] if sensors else []
    return [vectors, *checks, SourceUnit(f"{name}_test", "\n".join(parts), body, "END_FUNCTION_BLOCK")]


def _checks(tables: Tables, name: str, scl: bool) -> Iterator[SourceUnit]:
    """Yield the functions of the check value of the state: of a number, and of all."""
    mark, local, head = "#" if scl else "", "VAR_TEMP" if scl else "VAR", "\n".join(SCL) + "\n" if scl else ""
    part, state = quoted(f"{name}_test_part", scl), quoted(f"{name}_test_state", scl)
    given = section("VAR_INPUT", {"value": "LREAL", "index": "DINT"})
    about = f"{head}(* Return the part of a number in a check value. *)\n"
    text = f"FUNCTION {part} : LREAL\n{about}{given}\n{section(local, {'size': 'LREAL'})}"
    yield SourceUnit(f"{name}_test_part", text, _PART.format(_=mark, name=name), "END_FUNCTION")
    lines, total, at = [], f"{mark}total", f"{mark}s"
    for variable in INNER:
        var = Kept.variables()[variable]
        value = f"{at}.{safe(variable)}[{mark}k]"
        test = value if var.kind == "bool" else f"NOT {at}.cleared[{mark}k]" if variable == "evidence" else ""
        number_ = "1.0" if var.kind == "bool" else value
        own = [f"{total} := {total} + {part}(value := {number_}, index := {mark}k);"]
        own = [f"IF {test} THEN", f"    {own[0]}", "END_IF;"] if test else own
        if size := math.prod(tables.sizes.get(d, 0) for d in var.dims):
            lines += [f"FOR {mark}k := 0 TO {size - 1} DO", *(f"    {line}" for line in own), "END_FOR;"]
    lines = [f"{total} := 0.0;", f"IF {at}.looked THEN", *(f"    {line}" for line in lines), "END_IF;"]
    given = section("VAR_IN_OUT", {"s": quoted(f"{name}_state", scl)})
    about = f"{head}(* Return a check value of the state of the monitoring. *)\n"
    text = f"FUNCTION {state} : LREAL\n{about}{given}\n{section(local, {'k': 'DINT', 'total': 'LREAL'})}"
    body = "\n".join([*lines, f"{mark}{name}_test_state := {total};"])
    yield SourceUnit(f"{name}_test_state", text, body, "END_FUNCTION")


def allow(tables: Tables) -> float:
    """Return the tolerance, as a fraction of the correction, or in um for corrections below 1 um."""
    return max(_TOLERANCE, find_tolerance(tables.models))


def _finite(given: Iterable[float]) -> list[float]:
    """Return numbers that a controller can hold."""
    return [float(v) if math.isfinite(v) else NOTHING for v in given]
