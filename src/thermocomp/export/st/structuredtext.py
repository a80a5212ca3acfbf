"""IEC 61131-3: a compensator as a function block with its functions and types."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from thermocomp.export.st.ststatements import (
    BAGS,
    SCL,
    TYPES,
    Dialect,
    array,
    comment,
    number,
    quoted,
    safe,
    section,
    size_of,
    used_in,
    wrapped,
    write_functions,
    write_type,
)
from thermocomp.runtime.program.printer import compact
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Kind

#: represents NaN and infinity: a controller may stop at a NaN
NOTHING = 1e31

#: outputs visible to the caller, and their sizes
OUTPUTS: dict[str, str] = {
    "correction": "TARGETS",
    "slope": "TARGETS",
    "status": "TARGETS",
    "fault": "FAILING",
    "rejected": "",
    "outside": "",
    "warm": "",
}
#: inputs of the function block that are not arrays, and their types
INPUTS = {
    "age": ("LREAL", "time since the values were measured [s]"),
    "elapsed": ("LREAL", "time since the previous call, measured or the cycle time of the task [s]"),
    "reading": (
        "LREAL",
        "optional: number of the reading, which changes with each new one, from 1; 0: they are not numbered",
    ),
    "off_time": ("LREAL", "at the first call: time without power [s], from a clock that runs on; 0: unknown"),
    "cold": ("BOOL", "TRUE: the machine is cold; without effect once all references are known"),
    "restart": (
        "BOOL",
        "rising edge: the machine is cold: its temperatures become the zero, the corrections move to 0 at their rate",
    ),
    "rezero": ("BOOL", "rising edge: `correction[target]` continues from its value minus `remaining` [um]"),
    "target": ("DINT", "number of the correction that is re-zeroed"),
    "remaining": ("LREAL", "deviation that remains there, actual minus commanded [um]"),
    "first": ("BOOL", "TRUE: the call counts as the first one after a power-up (for the test)"),
}
#: variables of the function block that it does not retain
_OWN = {"running": "BOOL", "restarted": "BOOL", "rezeroed": "BOOL", "unsaved": "LREAL"}

_BODY = """IF {first} OR NOT {running} THEN
    {running} := TRUE;
    {start}({s}, none := {none}, known := FALSE, keep := FALSE);
    IF {kept}.model = {t}.fingerprint THEN
        IF {check}(s := {kept}) = {kept}.checked THEN
            {_}s := {kept};
        END_IF;
    END_IF;
    {power_up}({bags}, off := {off_time});
    IF {w}.begins > 0 THEN
        {start}({s}, none := {none}, known := ({w}.begins = 1), keep := FALSE);
    END_IF;
END_IF;
{unknown} := FALSE;
FOR {k} := 0 TO {last_target} DO
    {unknown} := {unknown} OR NOT {_}s.referenced[{k}];
END_FOR;
IF ({restart} AND NOT {restarted}) OR ({cold} AND {unknown}) THEN
    {start}({s}, none := {none}, known := TRUE, keep := TRUE);
END_IF;
{restarted} := {restart};
IF {rezero} AND NOT {rezeroed} THEN
    {order}({bags}, k := {target}, remaining := {remaining});
END_IF;
{rezeroed} := {rezero};
FOR {k} := 0 TO {last} DO
    {w}.value[{k}] := {value}[{k}];
    IF NOT {good}[{k}] THEN
        {w}.value[{k}] := {nothing};
    END_IF;
END_FOR;
{w}.age := {age};
{w}.{w_dt} := {elapsed};
{w}.counter := {reading};
{step}({bags});
{unsaved} := {unsaved} + {elapsed};
IF {first} OR ({unsaved} >= {interval}) OR ({unsaved} < 0.0) THEN
    {unsaved} := 0.0;
    {kept}.model := 0;
    {kept} := {_}s;
    {kept}.checked := {check}(s := {kept});
    {kept}.model := {t}.fingerprint;
END_IF;
"""
#: factors of variables in one statement of the check value
_FACTORS = ("", "0.7 * ", "0.4 * ")
#: longest time between two copies of the state to the retained one [s]
INTERVAL = 10.0


#: longest section of declarations on one line [characters]
_SHORT = 110


@dataclass(frozen=True)
class SourceUnit:
    """Source text of a block or a type.

    Parameters
    ----------
    declaration, statements : str
        Declarations and code; a type has no statements.
    end : str
        Last line of a block.
    """

    name: str
    declaration: str
    statements: str = ""
    end: str = ""

    def text(self, dialect: Dialect) -> str:
        """Return the complete source text of the block or type."""
        if not self.end:
            return self.declaration + "\n"
        begin = ["BEGIN"] if dialect == "scl" else []
        return "\n".join([self.head(), *begin, *self.body(), self.end]) + "\n"

    def head(self) -> str:
        """Return the declarations with short sections on one line: only spaces differ."""

        def joined(section: re.Match[str]) -> str:
            text = " ".join(section[0].split())
            return text if len(text) <= _SHORT and "(*" not in text else section[0]

        return re.sub(r"^VAR.*?^END_VAR$", joined, self.declaration, flags=re.MULTILINE | re.DOTALL)

    def body(self) -> list[str]:
        """Return the statements with short branches and loops on one line: only spaces differ."""
        begin, end = r"(?:IF|FOR|WHILE)\b.*(?:THEN|DO)", r"END_(?:IF|FOR|WHILE);"
        return compact(self.statements.rstrip("\n").split("\n"), begin, "ELSE", end)


def translate(tables: Tables, name: str, dialect: Dialect) -> list[SourceUnit]:
    """Return a compensator in structured text, with every block or type after those that it uses.

    The code processes values as `Compensator.step` processes a reading.
    """
    scl = dialect == "scl"
    functions = write_functions(tables, name, dialect)
    used = "\n".join(statements for _, statements in functions.values())
    used += " ".join([*(f" s.{safe(n)}" for n in OUTPUTS), f"w.value w.age w.{safe('dt')} w.counter t.rate"])
    used += " s.referenced s.model s.checked t.fingerprint"
    if scl:
        used = used.replace("#", "")
    units = [SourceUnit(f"{name}_{word}", write_type(tables, name, bag, used, dialect)) for bag, word in BAGS.items()]
    units += [SourceUnit(n, head, body, "END_FUNCTION") for n, (head, body) in functions.items()]
    return [*units, _start(tables, name, scl), _check(tables, name, used, scl), _block(tables, name, scl)]


def _start(tables: Tables, name: str, scl: bool) -> SourceUnit:
    """Return the function that starts the compensator; the corrections in force may be kept as the starting point."""
    m = "#" if scl else ""
    lines = [f"FOR {m}k := 0 TO {len(tables.targets) - 1} DO"]
    for n in ("correction", "slope"):
        kept = f"{m}s.{n}[{m}k]"
        chosen = f"SEL(G := {m}keep, IN0 := 0.0, IN1 := {kept})" if scl else f"SEL({m}keep, 0.0, {kept})"
        lines.append(f"    {m}none.{n}[{m}k] := {chosen};")
    lines += [f"    {m}none.referenced[{m}k] := {m}known;", "END_FOR;", f"{m}s := {m}none;"]
    about = "Start with a known reference or not; the next temperatures become the zero. Corrections may be kept."
    given = {"known": "BOOL", "keep": "BOOL"}
    return _function(name, "start", "Void" if scl else "BOOL", about, given, lines, scl, also=("none",))


def _check(tables: Tables, name: str, used: str, scl: bool) -> SourceUnit:
    """Return the function that computes the check value of a state."""
    mark, sizes = "#" if scl else "", dict[int, list[str]]()
    for n, var in used_in("s", used).items():
        value = f"{mark}s.{safe(n)}{f'[{mark}k]' if var.dims else ''}"
        if var.kind == "int":
            value = f"DINT_TO_LREAL({value})"
        elif var.kind == "bool":
            value = f"SEL(G := {value}, IN0 := 0.0, IN1 := 1.0)" if scl else f"SEL({value}, 0.0, 1.0)"
        if n not in ("model", "checked"):
            sizes.setdefault(size_of(var, tables.sizes) if var.dims else 0, []).append(value)
    total = f"{mark}total"
    lines = [f"{total} := 0.0;"]
    for size, values in sizes.items():
        sums = [
            f"{total} := {total} * 0.999 + {' + '.join(f'{f}{v}' for f, v in zip(_FACTORS, three, strict=False))};"
            for three in (values[k : k + 3] for k in range(0, len(values), 3))
        ]
        lines += [f"FOR {mark}k := 0 TO {size - 1} DO", *(f"    {x}" for x in sums), "END_FOR;"] if size else sums
    lines.append(f"{mark}{name}_sum := {total};")
    return _function(name, "sum", "LREAL", "Return the check value of a state.", {}, lines, scl, {"total": "LREAL"})


def _function(
    name: str,
    word: str,
    gives: str,
    about: str,
    given: Mapping[str, str],
    lines: Sequence[str],
    scl: bool,
    own: Mapping[str, str] = MappingProxyType({}),
    also: Sequence[str] = (),
) -> SourceUnit:
    """Return a function of a state, and of others of its type."""
    parts = [f"FUNCTION {quoted(f'{name}_{word}', scl)} : {gives}", *(SCL if scl else []), f"(* {about} *)"]
    parts += [
        section("VAR_IN_OUT", dict.fromkeys(("s", *also), quoted(f"{name}_state", scl))),
        section("VAR_INPUT", given),
    ]
    parts += [section("VAR_TEMP" if scl else "VAR", {"k": "DINT", **own})]
    return SourceUnit(f"{name}_{word}", "\n".join(filter(None, parts)), "\n".join(lines), "END_FUNCTION")


def _block(tables: Tables, name: str, scl: bool) -> SourceUnit:
    """Return the function block of the compensator."""
    mark, n = "#" if scl else "", len(tables.channels)
    outputs = {o: (tables.sizes[size] if size else 0) for o, size in OUTPUTS.items() if o != "fault" or tables.sensors}
    kinds: Mapping[str, Kind] = {"correction": "real", "slope": "real", "warm": "bool"}
    numbered = [f"{k}: {c.name} [{c.unit}]" for k, c in enumerate(tables.channels)]
    parts = [f"FUNCTION_BLOCK {quoted(name, scl)}", *(SCL if scl else [])]
    parts += [wrapped(f"(* Thermal compensation. value, by number: {comment('; '.join(numbered))} *)")]
    parts += [wrapped(f"(* correction [um], by number: {comment(_listed(tables.targets))} *)")]
    if tables.sensors:
        order = "" if list(tables.sensors) == [c.name for c in tables.channels] else ", in another order than value"
        parts += [wrapped(f"(* fault, by number{order}: {comment(_listed(tables.sensors))} *)")]
    kept = used_in("s", " ".join(f"s.{safe(o)}" for o in outputs))
    parts += [wrapped(f"(* {o}: {kept[o].about} *)") for o in outputs]
    parts += [wrapped(f"(* {i}: {about.replace('`', '')} *)") for i, (_, about) in INPUTS.items()]
    parts += [f"(* kept: the state that is retained (RETAIN, PERSISTENT, or Retain in SCL): a {name}_state *)"]
    parts += [
        section(
            "VAR_INPUT",
            {
                "value": array("real", n),
                "good": f"{array('bool', n)} := [{', '.join(['TRUE'] * n)}]",
                **{i: kind for i, (kind, _) in INPUTS.items()},
            },
        ),
        section(
            "VAR_OUTPUT",
            {o: array(kinds.get(o, "int"), n) if n else TYPES[kinds.get(o, "int")] for o, n in outputs.items()},
        ),
        section("VAR_IN_OUT", {"kept": quoted(f"{name}_state", scl)}),
        section(
            "VAR", {**{bag: quoted(f"{name}_{word}", scl) for bag, word in (*BAGS.items(), ("none", "state"))}, **_OWN}
        ),
        section("VAR_TEMP" if scl else "VAR", {"k": "DINT", "unknown": "BOOL"}),
    ]
    names = ("w", "t", "k", "none", "unknown", "kept", "value", "good", *INPUTS, *_OWN)
    calls = {"start": "start", "check": "sum", "power_up": "power_up", "order": "rezero", "step": "step"}
    body = _BODY.format(
        **{v: f"{mark}{v}" for v in names},
        **{v: quoted(f"{name}_{word}", scl) for v, word in calls.items()},
        _=mark,
        s=f"s := {mark}s",
        interval=number(INTERVAL),
        last_target=len(tables.targets) - 1,
        w_dt=safe("dt"),
        last=n - 1,
        nothing=number(NOTHING),
        bags=", ".join(f"{b} := {mark}{b}" for b in BAGS),
    )
    for o, size in outputs.items():
        if size:
            body += f"FOR {mark}k := 0 TO {size - 1} DO\n    {mark}{o}[{mark}k] := {mark}s.{safe(o)}[{mark}k];\n"
            body += "END_FOR;\n"
        else:
            body += f"{mark}{o} := {mark}s.{safe(o)};\n"
    return SourceUnit(name, "\n".join(parts), body, "END_FUNCTION_BLOCK")


def _listed(names: Sequence[str]) -> str:
    return "; ".join(f"{k}: {n}" for k, n in enumerate(names))
