"""C99: a compensator as one header and one source file, without dynamic memory and without globals."""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from thermocomp.export.c99.cstatements import comment, write_functions, write_tables, write_variables
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
{single}#else
{double}#endif

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

/* state to be saved, as bytes, at every opportunity, and given back after a power-up */
typedef struct {{
    {name}_state state;
    unsigned long model; /* to which models it belongs */
    unsigned long check; /* of its bytes */
}} {name}_saved;

/* Start without a state: the reference is unknown, and all corrections stay zero; see {name}.md. */
void {name}_start({name}_state *s);

/* Save the state. */
void {name}_save(const {name}_state *s, {name}_saved *saved);

/*
 * Start with a saved state (NULL: none) after `off` seconds without power (0: unknown).
 * 0: it continues; 1: it starts, as the machine is cold after this time; 2: the reference is unknown.
 */
int {name}_power_up({name}_state *s, const {name}_saved *saved, double off);

/* The machine is cold, or its datums are set anew: the next temperatures become the zero; corrections move on. */
void {name}_cold({name}_state *s);

/*
 * A target continues from its correction minus the deviation (actual minus commanded) that was measured with the
 * correction in force [um]; 0: its datum was set anew.
 */
void {name}_rezero({name}_state *s, int target, double remaining);

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

#: functions for the caller
_CALLS = ("start", "save", "power_up", "cold", "rezero", "step", "step_counted")

_REFUSED = """#ifdef TC_FLOAT
#error "single precision is too coarse for this model: compile without -DTC_FLOAT"
#endif

"""

_SOURCE = """{facts}#include "{name}.h"

#include <math.h>
#include <stddef.h>

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
/* return the check value (CRC-32) of a state */
static unsigned long tc_crc(const {name}_state *s)
{{
    const unsigned char *byte = (const unsigned char *)s;
    unsigned long crc = 0xFFFFFFFFUL;
    size_t k;
    int j;

    for (k = 0; k < sizeof *s; k++) {{
        crc ^= byte[k];
        for (j = 0; j < 8; j++) {{
            crc = (crc >> 1) ^ ((crc & 1UL) != 0UL ? 0xEDB88320UL : 0UL);
        }}
    }}
    return crc;
}}

void {name}_start({name}_state *s)
{{
    static const {name}_state none = {{0}};

    *s = none;
}}

void {name}_save(const {name}_state *s, {name}_saved *saved)
{{
    saved->model = 0;
    saved->state = *s;
    saved->check = tc_crc(&saved->state);
    saved->model = {fingerprint}UL;
}}

int {name}_power_up({name}_state *s, const {name}_saved *saved, double off)
{{
    {name}_work w;

    {name}_start(s);
    if (saved && saved->model == {fingerprint}UL && saved->check == tc_crc(&saved->state)) {{
        *s = saved->state;
    }}
    tc_power_up(s, &w, (tc_real)off);
    if (w.begins != 0) {{
        {name}_start(s);
    }}
    if (w.begins == 1) {{
        {name}_cold(s);
    }}
    return w.begins;
}}

void {name}_cold({name}_state *s)
{{
    const {name}_state before = *s;
    int k;

    {name}_start(s);
    for (k = 0; k < {targets}; k++) {{
        s->correction[k] = before.correction[k];
        s->slope[k] = before.slope[k];
        s->referenced[k] = 1;
    }}
}}

void {name}_rezero({name}_state *s, int target, double remaining)
{{
    {name}_work w;

    tc_rezero(s, &w, target, (tc_real)remaining);
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


def translate(
    tables: Tables, name: str, facts: Sequence[str] = (), told: Sequence[str] = (), *, double_only: bool = False
) -> Sources:
    """Return a compensator in C99.

    The code processes values as `Compensator.step` processes a reading.

    Parameters
    ----------
    facts, told : sequence of str
        Comments above both files, and above the source.
    """
    name, n, sizes = identifier(name), len(tables.channels), tables.sizes
    functions = write_functions(tables, name)
    above = "".join(f"/* {comment(line)} */\n" for line in facts)
    source = _SOURCE.format(
        facts=above + "".join(f"/* {comment(line)} */\n" for line in told),
        name=name,
        n=n,
        work=write_variables(sizes, "w", functions + "w->value w->age w->dt w->counter"),
        constants=write_tables(tables, functions),
        functions=functions,
        fingerprint=tables.values["fingerprint"],
        targets=len(tables.targets),
    )
    header = _HEADER.format(
        name=name,
        n=n,
        facts=above,
        **{p: "".join(f"#define {name}_{c} {name}_{c}_{p}\n" for c in _CALLS) for p in ("single", "double")},
        refused=_REFUSED if double_only else "",
        guard=f"{name.upper()}_H",
        inputs=_enumerated(name, "IN", [f"{c.name} [{c.unit}]" for c in tables.channels]),
        outputs=_enumerated(name, "OUT", [f"{t} [um]" for t in tables.targets]),
        state=write_variables(
            sizes, "s", functions + "s->status s->correction s->rejected s->fault s->outside s->warm"
        ),
    )
    return Sources(name, header, "".join(_wrapped(line) for line in source.splitlines(keepends=True)))


def _wrapped(line: str) -> str:
    """Return a long line as several: C compilers need not accept more than 4,095 characters."""
    if len(line) <= 120:
        return line
    indent = line[: len(line) - len(line.lstrip())] + "    "
    return textwrap.fill(line, 116, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) + "\n"


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
