"""A function block that runs the structured text of a compensator over its test vectors, one call per cycle."""

import math
import re
from collections.abc import Iterable, Sequence

from thermocomp.export.st.structuredtext import NOTHING, SourceUnit
from thermocomp.export.st.ststatements import SCL, TYPES, Dialect, array, number, quoted, safe, section, values, wrapped
from thermocomp.export.vectors import Answers, Readings, add_up, find_inner, find_tolerance
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
{tables}END_IF;
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
    {_}want := {_}v.inner[{_}row];
    IF ({_}v.given[{_}row * {width} + {inputs} + 1] >= 10.0) AND ({_}want < 1.0E+30) THEN
        {_}apart := ABS({check}(s := {_}kept) - {_}want) / (1.0 + ABS({_}want));
        IF NOT ({_}apart <= 1.0E-9) THEN
            {_}off := TRUE;
        END_IF;
    END_IF;
"""

_TABLES = """    {_}want := {total};
    IF {_}done AND NOT (ABS({check}(t := {_}t) / {_}want - 1.0) <= 1.0E-12) THEN
        {_}wrong := {_}wrong + 1;
    END_IF;
"""

#: a member of a structure with its initial value
_VALUED = re.compile(r"^ {4}(\w+) : (?:ARRAY\[0\.\.(\d+)\] OF )?(\w+)\s*:=\s*([^;]*);", re.MULTILINE)

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


def write_test(
    tables: Tables,
    name: str,
    dialect: Dialect,
    readings: Readings,
    answers: Answers,
    units: Sequence[SourceUnit] = (),
) -> list[SourceUnit]:
    """Return the type with the test vectors, the functions of check values, and the block that runs the vectors.

    Parameters
    ----------
    units : sequence of SourceUnit
        Of the compensator; the numbers of its structure of tables are compared, too.
    """
    scl, inputs, calls = dialect == "scl", len(tables.channels), len(readings.age)
    targets, sensors = len(tables.targets), len(tables.sensors)
    mark = "#" if scl else ""
    vectors = _vectors(tables, name, readings, answers, scl)
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
                **({"t": quoted(f"{name}_tables", scl)} if units else {}),
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
    numbers = "".join(
        _NUMBERS.format(**sizes, output=o) for o in ("correction", "slope")[: 1 + any(tables.values["to_slope"])]
    )
    body = _BODY.format(**sizes, tables="{tables}", numbers=numbers, faults=_FAULTS.format(**sizes) if sensors else "")
    checks = [_part(name, scl), _state(tables, name, scl)] if sensors or units else []
    tables_ = next((u.declaration for u in units if u.name == f"{name}_tables"), "")
    if tables_:
        found = _VALUED.findall(re.sub(r"\(\*.*?\*\)", "", tables_, flags=re.DOTALL))
        checks.append(_sum(name, "tables", [(m, kind, int(last or -1) + 1, "") for m, last, kind, _ in found], scl))
        flags = {"TRUE": "1", "FALSE": "0"}
        lists = [[float(flags.get(v, v)) for v in re.split(r"[,\s]+", text.strip("[] \n")) if v] for *_, text in found]
        sizes["total"], sizes["check"] = number(add_up(lists)), quoted(f"{name}_test_tables", scl)
    body = body.replace("{tables}", _TABLES.format(**sizes) if tables_ else "")
    return [vectors, *checks, SourceUnit(f"{name}_test", "\n".join(parts), body, "END_FUNCTION_BLOCK")]


def _vectors(tables: Tables, name: str, readings: Readings, answers: Answers, scl: bool) -> SourceUnit:
    """Return the type that holds the test vectors."""
    held: dict[str, tuple[Kind, Sequence[float]]] = {
        "given": ("real", _finite(readings.columns.ravel())),
        "correction": ("real", answers.correction.ravel().tolist()),
        "told": ("int", answers.status.ravel().tolist()),
        "why": ("int", answers.why.tolist()),
        "outside": ("int", answers.outside.tolist()),
        "warm": ("bool", answers.warm.tolist()),
    }
    if any(tables.values["to_slope"]):
        held["slope"] = ("real", answers.slope.ravel().tolist())
    if tables.sensors:
        held |= {"found": ("int", answers.fault.ravel().tolist()), "inner": ("real", _finite(answers.inner))}
    lines = [
        f"TYPE {quoted(f'{name}_vectors', scl)}{'' if scl else ' :'}",
        *(SCL if scl else []),
        "STRUCT",
    ]
    lines += [wrapped(f"    {n} : {array(k, len(v))} := {values(v, k)};") for n, (k, v) in held.items()]
    return SourceUnit(f"{name}_vectors", "\n".join([*lines, f"END_STRUCT{';' if scl else ''}", "END_TYPE"]))


def _part(name: str, scl: bool) -> SourceUnit:
    """Return the function of a number's part in a check value."""
    mark, own = "#" if scl else "", {"size": "LREAL"}
    given = section("VAR_INPUT", {"value": "LREAL", "index": "DINT"})
    text = _head(name, "part", "Return the part of a number in a check value.", given, own, scl)
    return SourceUnit(f"{name}_test_part", text, _PART.format(_=mark, name=name), "END_FUNCTION")


def _state(tables: Tables, name: str, scl: bool) -> SourceUnit:
    """Return the function of the check value of the state of the monitoring."""
    members = []
    for variable, size in find_inner(tables).items() if tables.sensors else ():
        unless = f"{'#' if scl else ''}s.cleared" if variable == "evidence" else ""
        members.append((safe(variable), TYPES[Kept.variables()[variable].kind], size, unless))
    return _sum(name, "state", members, scl)


def _sum(name: str, word: str, members: Iterable[tuple[str, str, int, str]], scl: bool) -> SourceUnit:
    """Return the function that adds up members of a structure: name, type, size (0: no array), flags that exclude."""
    mark, bag = "#" if scl else "", word[0]
    part, total, lines = quoted(f"{name}_test_part", scl), f"{mark}total", list[str]()
    for member, kind, size, unless in members:
        value = f"{mark}{bag}.{member}[{mark}k]" if size else f"{mark}{bag}.{member}"
        given = {"BOOL": "1.0", "DINT": f"DINT_TO_LREAL({value})"}.get(kind, value)
        own = [f"{total} := {total} + {part}(value := {given}, index := {f'{mark}k' if size else '0'});"]
        if kind == "BOOL" or unless:
            test = f"NOT {unless}[{mark}k]" if unless else value
            own = [f"IF {test} THEN", f"    {own[0]}", "END_IF;"]
        lines += [f"FOR {mark}k := 0 TO {size - 1} DO", *(f"    {line}" for line in own), "END_FOR;"] if size else own
    lines = [f"{total} := 0.0;", *lines]
    if word == "state":
        lines += [f"IF NOT {mark}s.looked THEN", f"    {total} := 0.0;", "END_IF;"] if len(lines) > 1 else []
    given = section("VAR_IN_OUT", {bag: quoted(f"{name}_{word}", scl)})
    text = _head(name, word, f"Return the check value of {word}.", given, {"k": "DINT", "total": "LREAL"}, scl)
    body = "\n".join([*lines, f"{mark}{name}_test_{word} := {total};"])
    return SourceUnit(f"{name}_test_{word}", text, body, "END_FUNCTION")


def _head(name: str, word: str, about: str, given: str, own: dict[str, str], scl: bool) -> str:
    """Return the declaration of a function of the test."""
    lines = [f"FUNCTION {quoted(f'{name}_test_{word}', scl)} : LREAL", *(SCL if scl else []), f"(* {about} *)", given]
    return "\n".join([*lines, section("VAR_TEMP" if scl else "VAR", own)])


def allow(tables: Tables) -> float:
    """Return the tolerance, as a fraction of the correction, or in um for corrections below 1 um."""
    return max(_TOLERANCE, find_tolerance(tables.models))


def _finite(given: Iterable[float]) -> list[float]:
    """Return numbers that a controller can hold."""
    return [float(v) if math.isfinite(v) else NOTHING for v in given]
