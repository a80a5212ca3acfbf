"""IEC 61131-3: a compensator as a function block with its functions and types."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from thermocomp.export.st.ststatements import (
    BAGS,
    SCL,
    TYPES,
    Dialect,
    array,
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
}

_BODY = """IF {restart} AND NOT {restarted} THEN
    {start}({s});
END_IF;
{restarted} := {restart};
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
"""


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
        return "\n".join([self.declaration, *begin, self.statements.rstrip("\n"), self.end]) + "\n"


def translate(tables: Tables, name: str, dialect: Dialect) -> list[SourceUnit]:
    """Return a compensator in structured text, with every block or type after those that it uses.

    The code processes values as `Compensator.step` processes a reading.
    """
    scl = dialect == "scl"
    functions = write_functions(tables, name, dialect)
    used = "\n".join(statements for _, statements in functions.values())
    used += " ".join([*(f" s.{safe(n)}" for n in OUTPUTS), f"w.value w.age w.{safe('dt')} w.counter t.rate"])
    if scl:
        used = used.replace("#", "")
    units = [SourceUnit(f"{name}_{word}", write_type(tables, name, bag, used, dialect)) for bag, word in BAGS.items()]
    units += [SourceUnit(n, head, body, "END_FUNCTION") for n, (head, body) in functions.items()]
    return [*units, _start(tables, name, used, scl), _block(tables, name, scl)]


def _start(tables: Tables, name: str, used: str, scl: bool) -> SourceUnit:
    """Return the function that restarts the compensator; the corrections in force are kept as the starting point."""
    mark = "#" if scl else ""
    lines = []
    for n, var in used_in("s", used).items():
        if n in ("correction", "slope"):
            continue
        zero = number(0, var.kind)
        if var.dims:
            last = size_of(var, tables.sizes) - 1
            lines += [f"FOR {mark}k := 0 TO {last} DO", f"    {mark}s.{safe(n)}[{mark}k] := {zero};", "END_FOR;"]
        else:
            lines.append(f"{mark}s.{safe(n)} := {zero};")
    own = quoted(f"{name}_start", scl)
    parts = [f"FUNCTION {own} : {'Void' if scl else 'BOOL'}", *(SCL if scl else [])]
    parts += [
        "(* Restart: the present temperatures become the zero; corrections continue from their present values. *)"
    ]
    parts += [section("VAR_IN_OUT", {"s": quoted(f"{name}_state", scl)})]
    parts += [section("VAR_TEMP" if scl else "VAR", {"k": "DINT"})]
    return SourceUnit(f"{name}_start", "\n".join(parts), "\n".join(lines), "END_FUNCTION")


def _block(tables: Tables, name: str, scl: bool) -> SourceUnit:
    """Return the function block of the compensator."""
    mark, n = "#" if scl else "", len(tables.channels)
    outputs = {o: (tables.sizes[size] if size else 0) for o, size in OUTPUTS.items() if o != "fault" or tables.sensors}
    kinds: Mapping[str, Kind] = {"correction": "real", "slope": "real"}
    numbered = [f"{k}: {c.name} [{c.unit}]" for k, c in enumerate(tables.channels)]
    parts = [f"FUNCTION_BLOCK {quoted(name, scl)}", *(SCL if scl else [])]
    parts += [wrapped(f"(* Thermal compensation. value, by number: {comment('; '.join(numbered))} *)")]
    parts += [wrapped(f"(* correction [um], by number: {comment(_listed(tables.targets))} *)")]
    parts += [
        section(
            "VAR_INPUT",
            {
                "value": array("real", n),
                "good": f"{array('bool', n)} := [{', '.join(['TRUE'] * n)}]",
                "age": "LREAL",
                "elapsed": "LREAL",
                "reading": "LREAL",
                "restart": "BOOL",
            },
        ),
        section(
            "VAR_OUTPUT",
            {o: array(kinds.get(o, "int"), size) if size else TYPES["int"] for o, size in outputs.items()},
        ),
        section("VAR", {**{bag: quoted(f"{name}_{word}", scl) for bag, word in BAGS.items()}, "restarted": "BOOL"}),
        section("VAR_TEMP" if scl else "VAR", {"k": "DINT"}),
    ]
    names = ("s", "w", "k", "value", "good", "age", "elapsed", "reading", "restart", "restarted")
    body = _BODY.format(
        **{v: f"{mark}{v}" for v in names if v != "s"},
        s=f"s := {mark}s",
        start=quoted(f"{name}_start", scl),
        step=quoted(f"{name}_step", scl),
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


def comment(text: str) -> str:
    """Return a text in which nothing ends a comment of structured text."""
    for sign in ("*)", "(*", "]]>"):
        text = text.replace(sign, " ".join(sign))
    return " ".join(text.split())
