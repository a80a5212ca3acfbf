"""C99: a compensator as one header and one source file, without dynamic memory and without globals."""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from thermocomp.export.c99.cstatements import write_functions, write_tables, write_variables
from thermocomp.runtime.program.tables import Tables

_HEADER = """{facts}#ifndef {guard}
#define {guard}

#ifndef TC_REAL
#define TC_REAL
#ifdef TC_FLOAT
typedef float tc_real;
#else
typedef double tc_real;
#endif
#endif

{refused}#ifdef __cplusplus
extern "C" {{
#endif

/* files compiled in different precisions do not link */
#ifdef TC_FLOAT
#define {name}_start {name}_start_float
#define {name}_step {name}_step_float
#define {name}_step_counted {name}_step_counted_float
#else
#define {name}_start {name}_start_double
#define {name}_step {name}_step_double
#define {name}_step_counted {name}_step_counted_double
#endif

/* inputs, in this order */
enum {{
{inputs}
}};

/* targets of the corrections, in this order */
enum {{
{outputs}
}};

/* state between two calls: read only */
typedef struct {{
{state}}} {name}_state;

/* Start: all corrections are zero. */
void {name}_start({name}_state *s);

/*
 * Read values, measured `age` seconds ago, and update the corrections; `dt` is the time since the previous call [s].
 * Give a missing value as NAN. Call it in every cycle: without new values it waits, then holds the corrections, and
 * finally lets them decay to zero.
 */
void {name}_step({name}_state *s, const tc_real value[{n}], double age, double dt);

/*
 * The same with the number of the reading: it changes with each new reading, from 1, and the values are too old if it
 * does not, whatever their age. 0: they are not numbered.
 */
void {name}_step_counted({name}_state *s, const tc_real value[{n}], double age, double dt, double reading);

#ifdef __cplusplus
}}
#endif

#endif
"""

_REFUSED = """#ifdef TC_FLOAT
#error "single precision is too coarse for this model: compile without -DTC_FLOAT"
#endif

"""

_SOURCE = """{facts}#include "{name}.h"

#include <math.h>

#ifdef __FAST_MATH__
#error "NaN would not be detected: compile without -ffast-math"
#endif

#define TC(x) ((tc_real)(x))
/* TC_ROUNDED: a number, and the nearest single-precision number within its bounds */
#ifdef TC_FLOAT
#define TC_MATH(name) name##f
#define TC_ROUNDED(x, single) TC(single)
#else
#define TC_MATH(name) name
#define TC_ROUNDED(x, single) TC(x)
#endif

/* intermediate results, computed again in every call */
typedef struct {{
{work}}} {name}_work;

{constants}
{functions}
void {name}_start({name}_state *s)
{{
    static const {name}_state cold = {{0}};

    *s = cold;
}}

void {name}_step({name}_state *s, const tc_real value[{n}], double age, double dt)
{{
    {name}_step_counted(s, value, age, dt, 0.0);
}}

void {name}_step_counted({name}_state *s, const tc_real value[{n}], double age, double dt, double reading)
{{
    {name}_work w;
    int k;

    for (k = 0; k < {n}; k++) {{
        w.value[k] = value[k];
    }}
    w.age = age;
    w.dt = dt;
    w.counter = reading;
    tc_step(s, &w);
}}
"""


@dataclass(frozen=True)
class Sources:
    """Source and header of a compensator in C99.

    Parameters
    ----------
    name : str
        Name of the files and prefix of all names in them.
    """

    name: str
    header: str
    source: str


def translate(tables: Tables, name: str, facts: Sequence[str] = (), *, double_only: bool = False) -> Sources:
    """Return a compensator in C99.

    The code processes values as `Compensator.step` processes a reading.
    """
    name, n, sizes = identifier(name), len(tables.channels), tables.sizes
    functions = write_functions(tables, name)
    above = "".join(f"/* {comment(line)} */\n" for line in facts)
    source = _SOURCE.format(
        facts=above,
        name=name,
        n=n,
        work=write_variables(sizes, "w", functions + "w->value w->age w->dt w->counter"),
        constants=write_tables(tables, functions),
        functions=functions,
    )
    header = _HEADER.format(
        name=name,
        n=n,
        facts=above,
        refused=_REFUSED if double_only else "",
        guard=f"{name.upper()}_H",
        inputs=_enumerated(name, "IN", [f"{c.name} [{c.unit}]" for c in tables.channels]),
        outputs=_enumerated(name, "OUT", [f"{t} [um]" for t in tables.targets]),
        state=write_variables(sizes, "s", functions + "s->status s->correction s->rejected s->fault s->outside"),
    )
    return Sources(name, header, "".join(_wrapped(line) for line in source.splitlines(keepends=True)))


def _wrapped(line: str) -> str:
    """Return a long line as several: C compilers need not accept more than 4,095 characters."""
    if len(line) <= 200:
        return line
    return textwrap.fill(line, 110, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False) + "\n"


def _enumerated(name: str, kind: str, texts: Sequence[str]) -> str:
    lines = []
    for k, text in enumerate(texts):
        word = re.sub(r"[^A-Za-z0-9]+", "_", text.split(" [")[0]).strip("_").upper() or "X"
        lines.append(
            f"    {name.upper()}_{kind}_{k}_{word} = {k}{',' if k < len(texts) - 1 else ''} /* {comment(text)} */"
        )
    return "\n".join(lines)


def identifier(name: str) -> str:
    """Return a valid C identifier close to a name."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return f"tc_{text}"


def comment(text: str) -> str:
    """Return a text in which nothing ends a C comment."""
    for sign in ("*/", "/*", "??"):
        text = text.replace(sign, " ".join(sign))
    return " ".join(text.split())
